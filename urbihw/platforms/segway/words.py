"""Meaning and unit of the slots of a Segway RMP (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BASE: Final = {
    "rmpModel": ("number of the model: 50, 100, 200 or 400", ""),
    "build": ("number of the firmware's build", "1"),
    "restarted": ("event: the base has started again", ""),
}
_COEFFICIENTS: Final = {
    "m/s": ("forwardSpeed", "leftSpeed", "rightSpeed"),
    "rad/s": ("yawSpeed",),
    "m": ("forward", "left", "right"),
    "rad": ("yaw",),
    "N m": ("torque",),
}
"""Unit -> the slots whose coefficients have it."""
RMP: Final = COMMON | {
    "forwardSpeed": ("speed forward", "m/s"),
    "yawSpeed": ("yaw rate, to the left", "rad/s"),
    "leftSpeed": ("speed of the left wheel", "m/s"),
    "rightSpeed": ("speed of the right wheel", "m/s"),
    "forward": ("way driven forward", "m"),
    "yaw": ("angle turned, to the left", "rad"),
    "left": ("way of the left wheel", "m"),
    "right": ("way of the right wheel", "m"),
    **{
        f"{slot}Coeff": (f"{slot} for one count of the base", unit)
        for unit, slots in _COEFFICIENTS.items()
        for slot in slots
    },
    "velocityCoeff": ("speed forward for one count of a command", "m/s"),
    "turnCoeff": ("yaw rate for one count of a command", "rad/s"),
    "models": ("model -> counts for 1 m/s, 1 m, one turn and 1 N m", ""),
    "calibrate": ("calibrate(model): use the coefficients of a model", ""),
    "part": ("part(kind, slots): a device of the tree that is some slots of this one", ""),
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
