"""The allowed names of a robot's components and the units of their slots: plain data, and checks.

The manual's chapter 22 ("Standard Component List") lists the components, their parents and the interfaces of those that
are devices; ``DEVICES`` contains the additional names in its chapters about single robots.  The interfaces themselves,
with the slots and the unit of each, are objects of urbiscript (``Interface``, in the standard library).

The functions report the faults of a component of a structure tree; the contract test of the platforms calls them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

EXPERIMENTAL: Final = "experimental"
"""Prefix of the name of a component that has no standard name: ``experimentalGripForce``."""

CATEGORIES: Final = ("humanoid", "four-legged", "wheeled", "industrial arm")
"""Allowed values of ``robot.type`` (manual, "Identity")."""

PLACES: Final = (
    *("up", "inBetween", "down", "top"),
    *("front", "middle", "back"),
    *("right", "center", "left"),
    *("x", "y", "z"),
)
"""The constants of Localization; other positions are numbers from 0 on."""


@dataclass(frozen=True, slots=True)
class ComponentRule:
    """A component: the allowed names of its parent (any, if empty), and the interfaces it may have as a device."""

    part_of: tuple[str, ...] = ()
    interfaces: tuple[str, ...] = ()


def _part(part_of: str = "", interfaces: str = "") -> ComponentRule:
    return ComponentRule(tuple(part_of.split()), tuple(interfaces.split()))


_TURNING: Final = "body neck head hip knee ankle shoulder elbow wrist torso arm leg camera"
"""The manual's list of parents for yaw, pitch and roll, and the components that have these according to its text."""
_ROTATION: Final = "RotationalMotor RotationalSpeedMotor"
_TRANSLATION: Final = "LinearMotor LinearSpeedMotor"

COMPONENTS: Final[dict[str, ComponentRule]] = {
    "robot": _part("", "Identity Network Mobile Tracker"),
    "body": _part("robot"),
    "wheel": _part("body", f"{_ROTATION} {_TRANSLATION}"),
    "leg": _part("body"),
    "arm": _part("body"),
    "shoulder": _part("arm"),
    "elbow": _part("arm", _ROTATION),
    "wrist": _part("arm"),
    "hand": _part("arm"),
    "finger": _part("hand", "Motor"),
    "grip": _part("arm hand", "Motor"),
    "hip": _part("leg"),
    "knee": _part("leg", _ROTATION),
    "ankle": _part("leg"),
    "foot": _part("leg"),
    "toe": _part("foot", "Motor"),
    "neck": _part("body", _ROTATION),
    "tail": _part("body"),
    "head": _part("body neck", _ROTATION),
    "mouth": _part("head", "Motor"),
    "ear": _part("head", "Motor"),
    "joint": _part("tail arm leg lip eyebrow spine body", "Motor"),
    "yaw": _part(_TURNING, _ROTATION),
    "pitch": _part(_TURNING, _ROTATION),
    "roll": _part(_TURNING, _ROTATION),
    "x": _part("body arm", _TRANSLATION),
    "y": _part("body arm", _TRANSLATION),
    "z": _part("body arm", _TRANSLATION),
    "lip": _part("mouth head", "Motor"),
    "eye": _part("head"),
    "eyebrow": _part("head", "Motor"),
    "torso": _part("body"),
    "spine": _part("torso"),
    "clavicle": _part("body", "Motor"),
    "skin": _part("body"),
    "touch": _part("finger grip foot toe body head skin", "TouchSensor"),
    "gyro": _part("body", "GyroSensor"),
    "accel": _part("body", "AccelerationSensor"),
    "camera": _part("head body eye arm", "VideoIn Tracker"),
    # The list of the 2.3 manual exchanges these two; a speaker is an output.
    "speaker": _part("head body", "AudioOut"),
    "micro": _part("head body", "AudioIn"),
    "speech": _part("robot", "SpeechRecognizer"),
    "voice": _part("robot", "TextToSpeech"),
}
"""The components listed in the manual's chapter 22."""

DEVICES: Final[dict[str, ComponentRule]] = {
    "laser": _part("body head", "Laser"),  # "Localization", P3dx.body.laser
    "sonar": _part("body head", "DistanceSensor"),  # P3dx.body.sonar, Nao, TriBot
    "led": _part("body head eye ear foot", "Led"),  # "Localization", Spykee
    "headLed": _part("body head", "Led"),  # Spykee
    "battery": _part("body robot", "Battery"),  # P3dx.body.battery, TriBot, Nao
    "odometry": _part("body"),  # P3dx.body.odometry
    "planner": _part("robot"),  # P3dx.planner
    "track": _part("body", "Motor"),  # Spykee
    "claw": _part("body arm", "Motor"),  # TriBot
    "bumper": _part("body foot", "TouchSensor"),  # TriBot
    "light": _part("body head", "Sensor"),  # TriBot
    "decibel": _part("body head", "Sensor"),  # TriBot
    "beeper": _part("body head"),  # TriBot
    "infrared": _part("body head", "Sensor DistanceSensor"),  # DistanceSensor: "infrared, laser, ultrasonic"
    "temperature": _part("", "TemperatureSensor"),
}
"""The additional device names in the manual's chapters 23 to 29, each with its source."""


@dataclass(frozen=True, slots=True)
class SlotUnit:
    """A unit, and a limit: a value beyond it is certainly in a wrong unit (degrees, millimetres, raw counts)."""

    least: float
    most: float


UNITS: Final[dict[str, SlotUnit]] = {
    "1": SlotUnit(-math.inf, math.inf),
    "ratio": SlotUnit(0.0, 1.0),
    "%": SlotUnit(-100.0, 100.0),
    "m": SlotUnit(-1e4, 1e4),
    "cm": SlotUnit(0.0, 1e4),
    "m/s": SlotUnit(-20.0, 20.0),
    "m/s^2": SlotUnit(-200.0, 200.0),
    "rad": SlotUnit(-4 * math.tau, 4 * math.tau),
    "deg": SlotUnit(-1e7, 1e7),
    "rad/s": SlotUnit(-150.0, 150.0),
    "rad/s^2": SlotUnit(-1e4, 1e4),
    "turn": SlotUnit(-1e5, 1e5),
    "N": SlotUnit(-1e4, 1e4),
    "N m": SlotUnit(-1e3, 1e3),
    "Pa": SlotUnit(0.0, 1e7),
    "degC": SlotUnit(-60.0, 200.0),
    "V": SlotUnit(0.0, 100.0),
    "kg": SlotUnit(0.0, 1e3),
    "bit/s": SlotUnit(0.0, 1e9),
    "A": SlotUnit(-200.0, 200.0),
    "A h": SlotUnit(0.0, 1e3),
    "s": SlotUnit(0.0, 1e6),
    "ms": SlotUnit(0.0, 1e9),
    "Hz": SlotUnit(0.0, 1e5),
    "dB": SlotUnit(-200.0, 200.0),
    "pixel": SlotUnit(0.0, 1e5),
}
"""The units of all slots; "" is for slots that are no numbers.  The manual's NXT chapter has "deg" and "cm"."""


def problems_of_path(path: Sequence[str]) -> list[str]:
    """The faults of the component names on the path from the root to a component (positions left out); empty if there
    are none.
    """
    found = []
    known = COMPONENTS | DEVICES
    if not path or path[0] != "robot":
        found.append(f"{'.'.join(path)}: the root is called robot")
    for parent, name in zip(path, path[1:], strict=False):
        if name.startswith(EXPERIMENTAL):
            continue
        part = known.get(name)
        if part is None:
            found.append(f"{'.'.join(path)}: {name} is no standard name; begin it with {EXPERIMENTAL}")
        elif part.part_of and parent not in part.part_of and not parent.startswith(EXPERIMENTAL):
            found.append(f"{'.'.join(path)}: {name} is part of {' or '.join(part.part_of)}, not of {parent}")
    return found


def problems_of_kinds(path: Sequence[str], kinds: Sequence[str]) -> list[str]:
    """The faults of the interfaces of a device, inherited interfaces included; empty if there are none."""
    name = path[-1]
    part = (COMPONENTS | DEVICES).get(name)
    if not kinds:
        return [f"{'.'.join(path)} has no interface"]
    if part is None or not part.interfaces or set(part.interfaces) & set(kinds):
        return []
    return [f"{'.'.join(path)} is {' '.join(kinds)}, but {name} should be {' or '.join(part.interfaces)}"]


def problem_of_value(unit: str, value: float) -> str:
    """The fault of a value that should have a unit; empty if the value is plausible (nan means: not measured)."""
    known = UNITS.get(unit)
    if known is None:
        return f"there is no unit {unit!r}"
    if known.least <= value <= known.most or math.isnan(value):
        return ""
    return f"{value:g} is no value in {unit}"
