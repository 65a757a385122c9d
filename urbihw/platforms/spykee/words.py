"""Meaning and unit of the slots of a Spykee (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BASE: Final = {
    "power": ("charge of the battery", "%"),
    "charging": ("whether it is being charged", ""),
    "onDock": ("whether it stands on its dock", ""),
    "volume": ("loudness of the speaker", "%"),
    "uid": ("serial number", ""),
    "robotName": ("name of the robot", ""),
    "fullSpeed": ("speed of the base at 100 %", "m/s"),
    "fullTurn": ("yaw rate of the base at 100 %", "rad/s"),
    "docked": ("event: it has reached its dock", ""),
    "undocked": ("event: it has left its dock", ""),
}
TRACK: Final = {"val": ("speed ordered, in percent of full power", "%")}
LED: Final = {"val": ("1 switches the light on, 0 off", "ratio")}
BATTERY: Final = COMMON
