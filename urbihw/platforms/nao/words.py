"""Meaning and unit of the slots of a Nao (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

BASE: Final = {
    "services": ("names of the services of NAOqi", ""),
    "volume": ("loudness of the speaker", "%"),
    "memoryEvents": ("events of ALMemory that are followed", ""),
}
JOINT: Final = COMMON | {
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "load": ("stiffness, 0 limp to 1", "ratio"),
    "torque": ("torque; not measured", "N m"),
    "naoqiName": ("name in NAOqi", ""),
}
HAND: Final = {
    "val": ("opening, 0 closed to 1 open", "ratio"),
    "pos": ("position and direction in the frame of the torso, m and rad", ""),
}
LED: Final = {
    "val": ("brightness", "ratio"),
    "r": ("red", "ratio"),
    "g": ("green", "ratio"),
    "b": ("blue", "ratio"),
    "rgb": ("colour, 0xRRGGBB", "1"),
}
WALK: Final = {
    "xSpeed": ("speed forward", "m/s"),
    "ySpeed": ("speed to the left", "m/s"),
    "yawSpeed": ("yaw rate, to the left", "rad/s"),
    "moveConfig": ("parameters of the gait for ALMotion", ""),
    "x": ("position, forward from where it began", "m"),
    "y": ("position, to the left", "m"),
    "theta": ("heading, to the left", "rad"),
}
SENSOR: Final = {"val": ("measured value", "")}
BATTERY: Final = COMMON | {"current": ("current, negative while it drains", "A")}
VOICE: Final = {
    "volume": ("loudness of the voice", "ratio"),
    "lang": ("language", ""),
    "voice": ("name of the voice", ""),
    "speed": ("speed of the voice, 1 is normal", "1"),
    "pitch": ("pitch of the voice, 1 is normal", "1"),
}
SPEECH: Final = {
    "confidence": ("confidence from which a word counts as heard", "ratio"),
    "vocabulary": ("words to recognize", ""),
    "on": ("whether it listens", ""),
    "lang": ("language", ""),
    "recognition": ("name of the service in NAOqi", ""),
    "hear": ("event: a word was heard", ""),
}
CAMERA: Final = {
    "val": ("newest picture", ""),
    "load": ("1 switches the camera on, 0 off", "1"),
    "index": ("number of the camera: 0 on top, 1 at the chin", "1"),
    "format": ("format of val, as a number of the manual", "1"),
    "formatDetail": ("colour space of the picture, as a number of NAOqi", "1"),
    "rate": ("pictures in a second", "Hz"),
    "threaded": ("kept for old programs; has no effect", "1"),
}
