"""Words that several robots have: meaning and unit of their slots, for ``help`` and ``->unit``, and counted things.

A device class adds its own: ``slot_words = COMMON | {"zoom": ("of the camera", "ratio")}``.  Units are
those of the standard interfaces; "1" is a number without unit, "" is for slots that are no numbers.
"""

from __future__ import annotations

from typing import Final


def counted(number: int, word: str) -> str:
    """Return a number of things in words, such as "1 servo" or "3 servos"."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


COMMON: Final[dict[str, tuple[str, str]]] = {
    "id": ("number on the bus", "1"),
    "model": ("model", "1"),
    "modelName": ("name of the model", ""),
    "serial": ("serial number", ""),
    "firmware": ("version of the firmware", "1"),
    "state": ("ok, suspect, lost, back, or alarm while it does not do what it is told", ""),
    "stale": ("whether the values are old, because the device does not answer", ""),
    "alarm": ("what the device complains of, empty for nothing", ""),
    "fault": ("what the device complains of, empty for nothing", ""),
    "lost": ("event: the device does not answer any more", ""),
    "back": ("event: the device answers again", ""),
    "load": ("1 switches the device on, 0 off", "1"),
    "on": ("whether the device is switched on", ""),
    "mode": ("mode of operation", ""),
    "port": ("port that the device is connected to", ""),
    "raw": ("value as the device sends it", "1"),
    "voltage": ("voltage of the supply", "V"),
    "temperature": ("temperature of the device", "degC"),
    "current": ("current drawn", "A"),
    "capacity": ("charge that a full battery holds", "A h"),
    "remain": ("estimated charge that is left", "ratio"),
    "charging": ("whether the battery is being charged", ""),
    "playing": ("whether sound is played", ""),
    "frames": ("number of pictures received", "1"),
    "volume": ("loudness", "%"),
    "answered": ("event: an answer to a request has come", ""),
    "age": ("time since the device was last read", "s"),
}


def untold(*names: str) -> dict[str, tuple[str, str]]:
    """Return the words of slots of an interface that a robot cannot tell: they are numbers, and stay nan."""
    return {name: (f"{COMMON[name][0]}; this robot cannot tell it: nan", COMMON[name][1]) for name in names}


ROBOT: Final[dict[str, tuple[str, str]]] = {
    "name": ("name of the robot", ""),
    "model": ("model of the robot", ""),
    "serial": ("serial number, empty where the robot tells none", ""),
    "IP": ("address of the robot on the network, or else of the computer that serves it", ""),
    "url": ("url of the bus", ""),
    "link": ("whether the link to the robot is up", ""),
    "rate": ("rate of reading and writing", "Hz"),
    "busLoad": ("share of the time that the bus is in use", "ratio"),
    "statistics": ("counters of the bus by name", ""),
    "problems": ("what differs from the expected devices of the settings, and devices that changed their model", ""),
    "estop": ("true holds the robot in an emergency stop, false releases it", ""),
    "epoch": ("number of the motion epoch, one more after each stop", "1"),
    "stops": ("number of stops so far, with those of single devices and by the loss and return of the link", "1"),
    "state": ("ok, lost or back", ""),
    "firmware": ("version of the firmware", ""),
    "linkLost": ("event: the link is down; with the reason", ""),
    "linkBack": ("event: the link is up again", ""),
    "stopped": ("event: the robot was stopped; with the reason", ""),
    "released": ("event: an emergency stop was released; with the name of who did it", ""),
    "guarded": ("event: a temperature or voltage has crossed a limit; with device, limit, whether it is beyond", ""),
    "lost": ("event: a device does not answer any more", ""),
    "back": ("event: a device answers again", ""),
    "found": ("event: a new device was found", ""),
    "refused": ("event: a device refused a write; with device, slot and reason", ""),
    "figureGoals": ("readings of joints by which a link is at a place; robot.figure.part(link).reach moves them", ""),
    "figureText": ("links, joints and shapes as JSON; robot.figure is more convenient", ""),
    "moveTo": ("moveTo([x, y, heading]): go there on the map, along a planned path", ""),
    "answered": ("event: an answer to a request has come", ""),
}
