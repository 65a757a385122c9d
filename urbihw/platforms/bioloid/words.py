"""Meaning and unit of the slots of a Bioloid (``platforms.words``); units of registers are those of their table."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

DEVICE: Final = COMMON | {
    "temperatureLimit": ("temperature at which the device switches itself off", "degC"),
    "minVoltage": ("voltage below which it raises an alarm", "V"),
    "maxVoltage": ("voltage above which it raises an alarm", "V"),
    "returnDelay": ("time between an instruction and the answer", "s"),
    "statusReturnLevel": ("which instructions are answered: 0 pings, 1 reads, 2 all", "1"),
    "baudRate": ("speed of the bus", "bit/s"),
    "lock": ("1 locks the EEPROM until the power is switched off", "1"),
}
SERVO: Final = {
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "angle": ("the same as val", "rad"),
    "speed": ("speed of a wheel; of a joint the greatest speed on the way to its goal", "rad/s"),
    "torque": ("torque in force, estimated", "N m"),
    "load": ("1 switches the torque on, 0 off", "1"),
    "moving": ("whether it is on the way to its goal", ""),
    "wheel": ("whether it turns without end; set by cwLimit = ccwLimit = 0", ""),
    "led": ("1 switches the light on, 0 off", "1"),
    "cwLimit": ("least angle", "rad"),
    "ccwLimit": ("greatest angle", "rad"),
    "torqueLimit": ("greatest torque until the power is switched off", "N m"),
    "maxTorque": ("greatest torque after the power is switched on", "N m"),
    "cwComplianceMargin": ("error of the angle that is not corrected, on the clockwise side", "rad"),
    "ccwComplianceMargin": ("error of the angle that is not corrected, on the other side", "rad"),
    "cwComplianceSlope": ("how softly the goal is approached, on the clockwise side", "1"),
    "ccwComplianceSlope": ("how softly the goal is approached, on the other side", "1"),
    "punch": ("least torque of a correction", "N m"),
    "alarmLed": ("alarms at which the light flashes, as bits", "1"),
    "shutdown": ("alarms at which it switches itself off, as bits", "1"),
    "positionPGain": ("P gain of the position controller", "1"),
    "positionIGain": ("I gain of the position controller", "1"),
    "positionDGain": ("D gain of the position controller", "1"),
    "PGain": ("P gain of the position controller", "1"),
    "IGain": ("I gain of the position controller", "1"),
    "DGain": ("D gain of the position controller", "1"),
    "acceleration": ("greatest acceleration on the way to a goal, 0 for no limit", "rad/s^2"),
    "homingOffset": ("angle added to the measured one", "rad"),
}
_SIDES: Final = ("Left", "Center", "Right")
SENSOR: Final = {
    **{f"IR{side}": (f"reflected infrared light, {side.lower()}, 0 to 255", "1") for side in _SIDES},
    **{f"light{side}": (f"brightness, {side.lower()}, 0 to 255", "1") for side in _SIDES},
    **{f"obstacle{side}": (f"whether there is an obstacle, {side.lower()}", "") for side in _SIDES},
    **{f"lightDetected{side}": (f"whether it is bright, {side.lower()}", "") for side in _SIDES},
    "soundVolume": ("loudness of the present sound", "1"),
    "soundVolumeMax": ("loudness of the loudest sound since it was reset", "1"),
    "clapCount": ("number of claps heard in a row", "1"),
    "soundTime": ("time of the last clap", "s"),
    "obstacleThreshold": ("IR value from which it is an obstacle", "1"),
    "lightThreshold": ("brightness from which it is bright", "1"),
    "obstacleThresholdDefault": ("obstacleThreshold after the power is switched on", "1"),
    "lightThresholdDefault": ("lightThreshold after the power is switched on", "1"),
    "buzzerIndex": ("note to play, 0 to 51, or number of a melody", "1"),
    "buzzerTime": ("how long to play the note", "s"),
    "remocon": ("code received from, or to send to, a remote control", "1"),
    "remoconReceived": ("event: a code of a remote control was received", ""),
}
