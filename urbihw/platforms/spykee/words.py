"""Meaning and unit of the slots of a Spykee (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON, untold

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
    "networks": ("the networks that the robot hears; waits for the answer", ""),
    "log": ("the log of the robot; waits for the answer", ""),
    "getConfig": ("the configuration of the robot; waits for the answer", ""),
    "getConfigValue": ("getConfigValue(key): a value of the configuration", ""),
    "setConfigValue": ("setConfigValue(key, value): keep a value in the configuration of the robot", ""),
    "answerTo": ("wait for the answer to a request; used by the library", ""),
    "undocked": ("event: it has left its dock", ""),
}
TRACK: Final = {"val": ("speed ordered, in percent of full power", "%")}
MP3: Final = {
    "playing": ("whether the robot plays", ""),
    "sent": ("share that was sent to the robot, nan for a stream of unknown length", "ratio"),
    "ended": ("event: all of it was played", ""),
}
CLAPPER: Final = {
    "val": ("number of claps heard in a row, then 0 again", "1"),
    "emitEvent": ("whether the event sequence is emitted", ""),
    "sequence": ("event: a row of claps has ended; with their number", ""),
}
LED: Final = {"val": ("1 switches the light on, 0 off", "ratio")}
BATTERY: Final = COMMON | untold("capacity", "current", "voltage")
