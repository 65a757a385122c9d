"""Meaning and unit of the slots of a CiA 402 drive (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

DRIVE: Final = COMMON | {
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "speed": ("speed: the ordered one when written, the measured one when read", "rad/s"),
    "torque": ("torque: as far as the drive tells its rated one", "N m"),
    "positionCoeff": ("factor from the shaft of the motor to val", "1"),
    "velocityCoeff": ("factor from the shaft of the motor to speed", "1"),
    "node": ("number on the bus", "1"),
    "increments": ("increments of the encoder in a turn", "1"),
    "watched": ("whether the drive stops by itself when it does not hear us", ""),
    "driveState": ("state of the drive in the words of CiA 402", ""),
    "faulted": ("event: the drive complains; with the fault", ""),
}
