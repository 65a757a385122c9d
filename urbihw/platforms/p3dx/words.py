"""Meaning and unit of the slots of a Pioneer (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON, untold

BASE: Final = {
    "robotType": ("type that the controller tells", ""),
    "speedDelta": ("the same as body.x.speed", "m/s"),
    "speedAlpha": ("the same as body.yaw.speed", "rad/s"),
    "go": ("go(d): d metres forward, until that is done", ""),
    "turn": ("turn(a): a radians to the right, until that is done", ""),
    "stop": ("stop at once", ""),
    "assemble": ("build the tree of robot; called by the server", ""),
    "steer": ("let robot drive this base; called by the server", ""),
    "sonarPlaces": ("the places of the sonars in the tree, in order of their numbers", ""),
    "motorsLoad": ("the same as body.load", "1"),
    "laserLoad": ("the same as body.laser.load", "1"),
    "distMin": ("the same as body.safetyDistanceMin", "m"),
    "distMax": ("the same as body.safetyDistanceMax", "m"),
    "mapFileName": ("the same as planner.mapFileName", ""),
}
BODY: Final = {
    "load": ("1 switches the motors on, 0 off", "1"),
    "safetyDistanceMin": ("distance of an obstacle at which the base stops", "m"),
    "safetyDistanceMax": ("distance of an obstacle from which it is slower", "m"),
    "stalled": ("whether a wheel is blocked", ""),
    "stopButton": ("whether the stop button is pressed", ""),
    "frontBumpers": ("whether each bumper at the front is pressed, leftmost first", ""),
    "rearBumpers": ("whether each bumper at the rear is pressed, leftmost first", ""),
    "bumped": ("event: a bumper was hit; with front or rear, and its number", ""),
    "digitalIn": ("digital inputs, as bits", "1"),
    "digitalOut": ("digital outputs, as bits", "1"),
}
WHEEL: Final = {"speed": ("speed of the wheel", "m/s")}
X: Final = {
    "speed": ("speed forward: the ordered one when written, the measured one when read", "m/s"),
    "acceleration": ("acceleration of the controller", "m/s^2"),
    "deceleration": ("deceleration of the controller", "m/s^2"),
}
YAW: Final = {
    "speed": ("yaw rate to the left: the ordered one when written, the measured one when read", "rad/s"),
    "acceleration": ("acceleration of the controller", "rad/s^2"),
    "deceleration": ("deceleration of the controller", "rad/s^2"),
}
SONAR: Final = {"val": ("distance of the nearest obstacle, inf without an echo, nan while the sonars are off", "m")}
SONARS: Final = {"load": ("1 switches all sonars on, 0 off", "1")}
BATTERY: Final = COMMON | untold("capacity", "current") | {
    "charging": ("no, bulk, overcharge, float or balance; unknown where there is no dock", ""),
    "low": ("event: the voltage is low", ""),
}
CAMERA: Final = COMMON | {
    "val": ("newest picture, a JPEG", ""),
    "on": ("whether pictures are being read", ""),
    "frames": ("number of pictures received", "1"),
    "format": ("format of the pictures", ""),
    "yaw": ("direction to the left", "rad"),
    "pitch": ("direction upward", "rad"),
    "zoom": ("zoom, 0 wide to 1 near", "ratio"),
    "width": ("width of the picture", "pixel"),
    "height": ("height of the picture", "pixel"),
    "xfov": ("horizontal angle of view", "rad"),
    "yfov": ("vertical angle of view", "rad"),
}
GRIPPER: Final = COMMON | {
    "val": ("paddles: 1 open, 0 closed, 0.5 between", "ratio"),
    "lift": ("1 up, 0 down, 0.5 between", "ratio"),
    "moving": ("whether paddles or lift move", ""),
}
GYRO: Final = COMMON | {
    "speed": ("yaw rate to the left, measured without the wheels", "rad/s"),
    "temperature": ("reading of the gyro's temperature", "1"),
}
