"""Meaning and unit of the slots of an NXT (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON, untold

BRICK: Final = {
    "withInterface": ("withInterface(device, kind): the device, also of a kind of the standard robot API", ""),
    "address": ("Bluetooth address of the brick", ""),
    "wheelRadius": ("radius of the wheels that drive, negative if their motors are mounted the other way round", "m"),
    "track": ("distance between the wheels that drive", "m"),
    "fullSpeed": ("speed of a motor at 100 %", "rad/s"),
}
COMMAND: Final = {
    "request": ("request(bytes, size): send a command, and return the first bytes of its answer, [] if it failed", ""),
    "answered": ("event: an answer has come; with its number and bytes", ""),
}
MOTOR: Final = COMMON | {
    "val": ("position: the goal when written, the measured one when read", "deg"),
    "angle": ("position within one turn", "rad"),
    "turn": ("position in turns", "turn"),
    "speed": ("speed, in percent of full power", "%"),
    "torque": ("torque; not measured", "N m"),
}
SENSOR: Final = COMMON | {
    "port": ("number of the port", "1"),
    "distance": ("distance of the nearest obstacle, inf without an echo", "m"),
    "pressure": ("1 while it is pressed, 0 else", "1"),
    "colour": ("name of the colour", ""),
}
SOUND: Final = {"val": ("loudness, 0 to 1", "ratio")}
LIGHT: Final = {"val": ("brightness, 0 to 1; in the mode Normal the raw value, 0 to 1023", "ratio")}
SWITCH: Final = {"val": ("1 while it is pressed, 0 else", "1")}
COLOUR: Final = {"val": ("number of the colour, 1 to 6", "1")}
ECHO: Final = {"val": ("distance of the nearest obstacle, 255 without an echo", "cm")}
I2C: Final = {
    "address": ("I2C address, in 8 bits", "1"),
    "read": ("read(register, count): return the bytes of registers as a list", ""),
    "write": ("write(register, bytes): write bytes to registers", ""),
}
BATTERY: Final = COMMON | untold("capacity", "current") | {"val": ("estimated charge that is left", "ratio")}
