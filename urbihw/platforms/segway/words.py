"""Meaning and unit of the slots of a Segway RMP (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BASE: Final = {
    "rmpModel": ("number of the model: 50, 100, 200 or 400", ""),
    "build": ("number of the firmware's build", "1"),
    "restarted": ("event: the base has started again", ""),
}
_COEFFICIENTS: Final = (
    "forwardSpeed", "yawSpeed", "leftSpeed", "rightSpeed", "forward", "yaw", "left", "right", "velocity", "turn",
    "torque",
)  # fmt: skip
RMP: Final = COMMON | {
    "forwardSpeed": ("speed forward", "m/s"),
    "yawSpeed": ("yaw rate, to the left", "rad/s"),
    "leftSpeed": ("speed of the left wheel", "m/s"),
    "rightSpeed": ("speed of the right wheel", "m/s"),
    "forward": ("way driven forward", "m"),
    "yaw": ("angle turned, to the left", "rad"),
    "left": ("way of the left wheel", "m"),
    "right": ("way of the right wheel", "m"),
    **{f"{name}Coeff": (f"factor from the counts of the base to {name}", "1") for name in _COEFFICIENTS},
    "velocityCoeff": ("factor from the counts of a command to m/s", "1"),
    "turnCoeff": ("factor from the counts of a command to rad/s", "1"),
    "period": ("time between two values", "s"),
    "pitch": ("inclination forward", "rad"),
    "pitchRate": ("rate of pitch", "rad/s"),
    "roll": ("inclination to the side", "rad"),
    "rollRate": ("rate of roll", "rad/s"),
    "leftTorque": ("torque of the left motor", "N m"),
    "rightTorque": ("torque of the right motor", "N m"),
    "voltage": ("voltage of the battery of the base", "V"),
    "boxVoltage": ("voltage of the battery of the electronics", "V"),
    "motors": ("whether the motors are on", ""),
    "missing": ("frames that the base does not send any more", ""),
    "gain": ("gain schedule: light, tall or heavy", ""),
    "speedScale": ("factor of the greatest speed", "ratio"),
    "accelerationScale": ("factor of the greatest acceleration", "ratio"),
    "turnScale": ("factor of the greatest yaw rate", "ratio"),
    "currentLimit": ("factor of the greatest current of the motors", "ratio"),
    "lockout": ("whether balancing is locked out", ""),
    "faulted": ("event: the base complains; with the fault", ""),
    "lowVoltage": ("voltage of the base below which its battery is low", "V"),
    "batteryLow": ("event: the battery is low; with its voltage", ""),
}
