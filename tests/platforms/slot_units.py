"""Units of slots that several robots have: fragments of the table ``UNITS`` in each ``<name>_lab.py``.

A table is typed from the documents: class (or the name of a device, where a class has several kinds) -> unit -> slots.
Sources: the manual's chapters 22 ("Interface") and 23 to 29 (the robots), and, for slots that the manual does not have,
the pages ``urbihw/platforms/*/README.md``.  "1" is a number without unit.
"""

from __future__ import annotations

from typing import Final

Units = dict[str, str]
"""Unit -> the slots that have it."""
UnitTable = dict[str, Units]
"""Class, or name of a device -> the units of its slots."""

# Chapter 22.
GAINS: Final = "PGain IGain DGain "
BATTERY: Final[Units] = {"ratio": "remain", "V": "voltage", "A": "current", "A h": "capacity"}
PICTURE: Final[Units] = {"pixel": "width height", "rad": "xfov yfov", "s": "exposure"}
MOBILE: Final[Units] = {
    "m/s": "xSpeed ySpeed zSpeed defaultXSpeed defaultYSpeed defaultZSpeed",
    "rad/s": "yawSpeed pitchSpeed rollSpeed defaultYawSpeed defaultPitchSpeed defaultRollSpeed",
    "s": "watchdogInterval",
}
# docs/teach.md.
TAUGHT: Final[Units] = {"rad/s": "blendSpeed"}
# docs/operations.md and docs/safety.md: what every robot tells of itself.
BUS: Final[Units] = {"Hz": "rate", "ratio": "busLoad", "1": "epoch stops"}
# docs/navigation.md.
ODOMETRY: Final[Units] = {"m": "x y z coveredDistance", "rad": "yaw coveredAngle", "m, rad": "position"}
PLANNER: Final[Units] = {"m": "path walls", "m/s": "speed", "rad/s": "turnSpeed", "1": "score"}
# The manual's Bioloid chapter, and the control tables of the makers.
ON_BUS: Final[Units] = {
    "V": "voltage minVoltage maxVoltage",
    "degC": "temperature temperatureLimit",
    "bit/s": "baudRate",
    "s": "age returnDelay",
}
SERVO: Final[Units] = ON_BUS | {"rad/s": "speed", "turn": "turn", "s": "age returnDelay blockedFor"}
ANGLES: Final = "val angle cwLimit ccwLimit requested applied "
NUMBERS: Final = GAINS + "id model firmware load shutdown "
AX: Final[Units] = SERVO | {
    "rad": ANGLES + "cwComplianceMargin ccwComplianceMargin",
    "N m": "torque torqueLimit maxTorque punch",
    "1": NUMBERS + "cwComplianceSlope ccwComplianceSlope led lock alarmLed statusReturnLevel",
}
# A touch sensor is 0 or 1 for a button, or Pa (chapter 22); those of these robots are buttons.
BUTTON: Final[Units] = {"1": "val pressure"}
