"""Meaning and unit of the slots of a Nao (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON, untold

BASE: Final = {
    "allJoints": ("names of all joints in NAOqi", ""),
    "headJoints": ("names of the joints of the head in NAOqi", ""),
    "armJoints": ("names of the joints of an arm in NAOqi, without L or R", ""),
    "legJoints": ("names of the joints of a leg in NAOqi, without L or R", ""),
    "ask": ("ask(service, method, arguments): call a method of a service of NAOqi, and return its result", ""),
    "proxy": ("proxy(service): an object whose functions are the methods of a service", ""),
    "groupOf": ("groupOf(names): a Group of these joints", ""),
    "memoryEvent": ("memoryEvent(key): the Event of an event of ALMemory", ""),
    "addAlias": ("another name for a proxy; used by the library", ""),
    "answerTo": ("wait for the answer to a request; used by the library", ""),
    "endOf": ("wait for the end of a call; used by the library", ""),
    "services": ("names of the services of NAOqi", ""),
    "volume": ("loudness of the speaker", "%"),
    "fallen": ("whether the robot lies; nil while that is not known", ""),
    "othersMoving": ("whether somebody else lets the robot walk", ""),
    "memoryEvents": ("events of ALMemory that are followed", ""),
}
JOINT: Final = COMMON | {
    "setDCMWrite": ("the same as ALMotor.setDCMWrite: for all joints", ""),
    "val": ("angle: the goal when written, the measured one when read", "rad"),
    "load": ("stiffness, 0 limp to 1", "ratio"),
    "torque": ("torque; not measured", "N m"),
    "naoqiName": ("name in NAOqi", ""),
}
FSR: Final = {
    "val": ("1 while both feet touch the ground, 0 else", "1"),
    "left": ("1 while the left foot touches the ground, 0 else", "1"),
    "right": ("1 while the right foot touches the ground, 0 else", "1"),
    "leftFootTotalWeight": ("weight on the left foot", "kg"),
    "rightFootTotalWeight": ("weight on the right foot", "kg"),
}
MODULES: Final = {
    "calls": ("calls from NAOqi that run now, by number", ""),
    "run": ("run a function for a call from NAOqi; called by the server", ""),
    "cancel": ("end a call from NAOqi; called by the server", ""),
    "offered": ("event: a module was offered; with the number and the reason of a refusal", ""),
}
DCM: Final = {
    "setDCMWrite": ("setDCMWrite(on): write all joints by the DCM", ""),
    "setDCMShift": ("setDCMShift(ms): time from a write to the date of its command", ""),
    "setTrace": ("setTrace(on): write a trace of the orders to the joints", ""),
    "answerTo": ("wait for the answer to a request; used by the library", ""),
    "answered": ("event: an answer to a request has come", ""),
    "dcmWrite": ("whether joints are written by the DCM", ""),
    "dcmShift": ("time from a write to the date of its command", "s"),
    "traceFile": ("file of the trace, empty while there is none", ""),
}
HAND: Final = {
    "val": ("opening, 0 closed to 1 open", "ratio"),
    "pos": ("position and direction in the frame of the torso, m and rad", ""),
    "open": ("open it, then switch its motor off", ""),
    "close": ("close it, then switch its motor off", ""),
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
    "walks": ("whether it walks, for any client; the last known while the link is lost", ""),
    "speeds": ("measured speeds: forward, to the left (m/s), yaw rate to the left (rad/s); nan if not known", ""),
}
SENSOR: Final = {"val": ("measured value", "")}
BATTERY: Final = COMMON | untold("voltage", "capacity") | {"current": ("current, negative while it drains", "A")}
VOICE: Final = {
    "volume": ("loudness of the voice", "ratio"),
    "lang": ("language", ""),
    "voice": ("name of the voice", ""),
    **dict.fromkeys(
        (
            *("getAvailableLanguages", "getAvailableVoices", "getLanguage", "getParameter", "getVoice", "getVolume"),
            *("setLanguage", "setParameter", "setVoice", "setVolume", "stopAll", "exit", "ping", "version"),
        ),
        ("the method of ALTextToSpeech", ""),
    ),
    "speed": ("speed of the voice, 1 is normal", "1"),
    "pitch": ("pitch of the voice, 1 is normal", "1"),
}
SPEECH: Final = {
    "confidence": ("confidence from which a word counts as heard", "ratio"),
    "vocabulary": ("words to recognize", ""),
    "on": ("whether it listens", ""),
    "lang": ("language", ""),
    "setVocabulary": ("setVocabulary(words): words to recognize from now on", ""),
    "start": ("begin to listen", ""),
    "stop": ("listen no longer", ""),
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
