"""Meaning and unit of the slots of servos and sensor modules; units of registers are those of their table."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

DEVICE: Final = COMMON | {
    "age": ("time since the device last answered", "s"),
    "temperatureLimit": ("temperature at which the device switches itself off", "degC"),
    "minVoltage": ("voltage below which it raises an alarm", "V"),
    "maxVoltage": ("voltage above which it raises an alarm", "V"),
    "returnDelay": ("time between an instruction and the answer", "s"),
    "statusReturnLevel": ("which instructions are answered: 0 pings, 1 reads, 2 all", "1"),
    "baudRate": ("speed of the bus", "bit/s"),
    "lock": ("1 locks the EEPROM until the power is switched off", "1"),
}
TABLE: Final = {
    "asList": ("the devices, in order of their numbers", ""),
    "empty": ("whether there is none", ""),
    "has": ("has(number): whether there is a device with this number", ""),
    "keys": ("the numbers of the devices, in order", ""),
    "size": ("how many there are", "1"),
}
BUS: Final = {
    "missing": ("numbers of the devices that the settings expect and that did not answer yet", ""),
    "on": ("switch all motors on, holding where they are", ""),
    "off": ("switch all motors off", ""),
    "places": ("where the parts of a device are in the tree; used by the server", ""),
    "part": ("part(module, slot): one reading of a sensor module as a device of its own", ""),
    "numbered": ("a Group of devices with numbers; used by the server", ""),
    "fill": ("put the devices of a Group in order; used by the server", ""),
    "grow": ("add new devices to the tree of robot; called by the server", ""),
    "growGroups": ("make the groups of the settings; called by the server", ""),
    "nameOf": ("nameOf(joint): the name of a joint in the tree; used by the server", ""),
    "refuseName": ("refuseName(name, number): log that a joint keeps its number; used by the server", ""),
    "growJoints": ("add new joints to the tree of robot; called by the server", ""),
    "growJoint": ("add a new joint to the tree of robot; called by the server", ""),
}
REGISTERS: Final = {
    "answeredRegister": ("event: a register was read or written; with number, value, error", ""),
    "readRegister": ("readRegister(name): the raw count of a register", ""),
    "writeRegister": ("writeRegister(name, raw): write a raw count into a register", ""),
}
SERVO: Final = {
    "blocked": ("event: something keeps the joint from its goal; with the seconds so far", ""),
    "blockedFor": ("how long something has kept the joint from its goal, 0 if nothing does", "s"),
    "overspeed": ("event: the joint turns faster than its limit; with the speed in rad/s", ""),
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
    "pGain": ("P gain of the position controller", "1"),
    "iGain": ("I gain of the position controller", "1"),
    "dGain": ("D gain of the position controller", "1"),
    "velocityPGain": ("P gain of the speed controller", "1"),
    "velocityIGain": ("I gain of the speed controller", "1"),
    "feedForward1": ("gain of the feed forward of the speed", "1"),
    "feedForward2": ("gain of the feed forward of the acceleration", "1"),
    "PGain": ("P gain of the position controller", "1"),
    "IGain": ("I gain of the position controller", "1"),
    "DGain": ("D gain of the position controller", "1"),
    "jointName": ("name in the settings, empty for none", ""),
    "mode": ("operating mode, such as position, velocity, current", ""),
    "current": ("current in force", "A"),
    "goalCurrent": ("current: the drive in the mode current, else a limit", "A"),
    "goalPwm": ("share of the full voltage, -1 to 1: the drive in the mode pwm, else a limit", "1"),
    "acceleration": ("greatest acceleration on the way to a goal, 0 for no limit", "rad/s^2"),
    "homingOffset": ("angle added to the measured one", "rad"),
}
