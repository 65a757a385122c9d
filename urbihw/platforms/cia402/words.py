"""Meaning and unit of the slots of a CiA 402 drive (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BUS: Final = {
    "emergency": ("event: a drive has sent an emergency message; with the drive, its code and text", ""),
    "on": ("switch all drives on, standing", ""),
    "off": ("switch all drives off", ""),
}
DRIVE: Final = COMMON | {
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "speed": ("speed: the ordered one when written, the measured one when read", "rad/s"),
    "torque": ("torque: as far as the drive tells its rated one", "N m"),
    "positionCoeff": ("val for one increment of the drive", "rad"),
    "velocityCoeff": ("speed for one unit of the drive", "rad/s"),
    "node": ("number on the bus", "1"),
    "increments": ("increments of the encoder in a turn", "1"),
    "watched": ("whether the drive stops by itself when it does not hear us", ""),
    "driveState": ("state of the drive in the words of CiA 402", ""),
    "faulted": ("event: the drive complains; with the fault", ""),
    "emergency": ("event: the drive has sent an emergency message; with its code and text", ""),
    "homed": ("event: the home position was found", ""),
}
