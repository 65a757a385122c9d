"""Meaning and unit of the slots of an NXT (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BRICK: Final = {
    "address": ("Bluetooth address of the brick", ""),
    "wheelRadius": ("radius of the wheels that drive, negative if their motors are mounted the other way round", "m"),
    "track": ("distance between the wheels that drive", "m"),
    "fullSpeed": ("speed of a motor at 100 %", "rad/s"),
}
MOTOR: Final = COMMON | {
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "angle": ("the same as val", "rad"),
    "turn": ("angle in turns", "turn"),
    "speed": ("speed, in percent of full power", "%"),
    "torque": ("torque; not measured", "N m"),
}
SENSOR: Final = COMMON | {
    "port": ("number of the port", "1"),
    "val": ("measured value", "1"),
    "distance": ("distance of the nearest obstacle", "m"),
    "pressure": ("1 while it is pressed, 0 else", "Pa"),
}
BATTERY: Final = COMMON | {"val": ("estimated charge that is left", "ratio")}
