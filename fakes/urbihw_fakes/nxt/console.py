"""The commands of a TriBot at the console of `python -m urbihw_fakes nxt`."""

from __future__ import annotations

import math
from collections.abc import Callable

from urbihw_fakes.bodies.tribot import SimulatedTriBot
from urbihw_fakes.bodies.words import world_words
from urbihw_fakes.console import Command
from urbihw_fakes.nxt.codes import LIGHT_ACTIVE, LIGHT_INACTIVE
from urbihw_fakes.nxt.inputs import raw_of
from urbihw_fakes.nxt.stream import NxtDevice


def commands(device: NxtDevice, clock: Callable[[], float]) -> dict[str, Command]:
    """Return the commands of one robot; `clock` gives its simulated time in seconds."""
    actions = _Actions(device, clock)
    words = {
        "bump": Command("on|off", "press or release the bumper", actions.bump),
        "obstacle": Command("CM|none", "hold something before the ultrasonic sensor", actions.obstacle),
        "put": Command("CM [DEGREES]", "place the robot at a distance from the wall, turned left", actions.put),
        "sound": Command("LOUDNESS [AUDIBLE]", "loudness 0..1, of the whole band and audible", actions.noise),
        "light": Command("REFLECTED [AMBIENT]", "brightness 0..1 with the LED, and without", actions.light),
        "battery": Command("VOLTS", "set the voltage of the battery", actions.battery),
        "jam": Command("A|B|C [on|off]", "block or release a motor", actions.jam),
        "slip": Command("SHARE", "set the share 0..1 of the wheels' rotation that is lost to slip", actions.slip),
        "state": Command("", "show motors, position and sound", actions.state),
    }
    robot = device.robot
    if isinstance(robot, SimulatedTriBot):
        # What the world decides is not set by hand.
        kept = {word: command for word, command in words.items() if word not in ("obstacle", "put", "slip")}
        return kept | world_words(robot, lambda: device.brick.advance(clock()))
    return words


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, device: NxtDevice, clock: Callable[[], float]) -> None:
        self._robot = device.robot
        self._brick = device.brick
        self._clock = clock

    def _advance(self) -> None:
        self._brick.advance(self._clock())

    def bump(self, words: list[str]) -> str:
        self._advance()
        self._robot.pushed = _switch(words[0])
        self._robot.touch.pressed = self._robot.pushed
        return "ok"

    def obstacle(self, words: list[str]) -> str:
        self._advance()
        self._robot.obstacle = None if words[0] == "none" else _share(words[0], 1000) / 100
        return "ok"

    def put(self, words: list[str]) -> str:
        self._advance()
        robot = self._robot
        robot.x, robot.y, robot.heading = -abs(float(words[0])) / 100, 0.0, math.radians(float((words + ["0"])[1]))
        return "ok"

    def noise(self, words: list[str]) -> str:
        self._robot.sound.loudness = _share(words[0], 1)
        self._robot.sound.audible = _share((words + [words[0]])[1], 1)
        return "ok"

    def light(self, words: list[str]) -> str:
        self._robot.light.reflected = raw_of(LIGHT_ACTIVE, _share(words[0], 1))
        self._robot.light.ambient = raw_of(LIGHT_INACTIVE, _share((words + [words[0]])[1], 1))
        return "ok"

    def battery(self, words: list[str]) -> str:
        self._brick.millivolts = round(_share(words[0], 12) * 1000)
        return "ok"

    def jam(self, words: list[str]) -> str:
        self._advance()
        self._brick.motor(words[0]).jammed = _switch((words + ["on"])[1])
        return "ok"

    def slip(self, words: list[str]) -> str:
        self._robot.slip = _share(words[0], 1)
        return "ok"

    def state(self, words: list[str]) -> str:
        self._advance()
        brick = self._brick
        motors = ", ".join(f"{port} power {brick.motor(port).power} at {brick.motor(port).rotation}" for port in "ABC")
        sounding = f"{brick.sound.frequency} Hz" if brick.sound.sounding(brick.now) else "silent"
        return f"{'on' if brick.awake else 'off'}; {motors}; {self._robot.describe_place()}; {sounding}"


def _switch(text: str) -> bool:
    if text not in ("on", "off"):
        raise ValueError(text)
    return text == "on"


def _share(text: str, most: float) -> float:
    value = float(text)
    if not 0 <= value <= most:
        raise ValueError(text)
    return value
