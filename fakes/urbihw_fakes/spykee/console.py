"""The commands of a Spykee at the console of `python -m urbihw_fakes spykee`."""

from __future__ import annotations

import math
import wave
from collections.abc import Callable
from pathlib import Path

from urbihw_fakes.bodies.tracked import TrackedBody
from urbihw_fakes.bodies.words import world_words
from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.sound import RATE, bytes_of

APART = 0.4
"""Seconds between two claps."""


def commands(robot: Spykee, clock: Callable[[], float]) -> dict[str, Command]:
    """Return the commands of one robot; `clock` gives its simulated time in seconds."""
    actions = _Actions(robot, clock)
    words = {
        "clap": Command("[COUNT]", "clap COUNT times", actions.clap),
        "tone": Command("HZ [SECONDS]", "play a tone to its microphone", actions.tone),
        "hear": Command("FILE", "play a WAVE file to its microphone", actions.hear),
        "played": Command("[FILE]", "show what it has played; save it as a WAVE file", actions.played),
        "place": Command("X Y DEGREES", "place the robot", actions.place),
        "dock": Command("", "place the robot on its dock", actions.dock),
        "battery": Command("PERCENT", "set the charge of the battery", actions.battery),
        "where": Command("", "show its position in the room", actions.where),
    }
    body = robot.body
    if isinstance(body, TrackedBody):
        return words | world_words(body, lambda: body.advance(clock()))
    return words


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, robot: Spykee, clock: Callable[[], float]) -> None:
        self._robot = robot
        self._body = robot.body
        self._clock = clock

    def clap(self, words: list[str]) -> str:
        for index in range(int(words[0]) if words else 1):
            self._robot.microphone.clap(self._clock() + 0.2 + index * APART)
        return "ok"

    def tone(self, words: list[str]) -> str:
        self._robot.microphone.tone(self._clock() + 0.1, float(words[0]), float(words[1]) if len(words) > 1 else 1.0)
        return "ok"

    def hear(self, words: list[str]) -> str:
        try:
            with wave.open(words[0], "rb") as file:
                if (file.getnchannels(), file.getsampwidth(), file.getframerate()) != (1, 2, RATE):
                    raise UnknownRequest(f"hear: {words[0]} is not of one channel, 16 bits, {RATE} samples a second")
                self._robot.microphone.play(self._clock() + 0.1, file.readframes(file.getnframes()))
        except (OSError, EOFError, wave.Error) as error:
            raise UnknownRequest(f"hear: {words[0]}: {error}") from error
        return "ok"

    def played(self, words: list[str]) -> str:
        if words:
            with wave.open(str(Path(words[0])), "wb") as file:
                file.setparams((1, 2, RATE, 0, "NONE", ""))
                file.writeframes(bytes_of(self._robot.speaker.record()))
        music = self._robot.files.get(64, b"")
        seconds = len(self._robot.speaker.record()) / RATE
        return f"sounds {self._robot.sounds}, loudspeaker {seconds:.2f} s, music {len(music)} bytes"

    def place(self, words: list[str]) -> str:
        x, y, degrees = (float(word) for word in words[:3])
        self._body.place(x, y, math.radians(degrees))
        return "ok"

    def dock(self, words: list[str]) -> str:
        self._body.put_on_dock()
        return "ok"

    def battery(self, words: list[str]) -> str:
        self._body.level = min(100.0, max(0.0, float(words[0])))
        return "ok"

    def where(self, words: list[str]) -> str:
        self._body.advance(self._clock())
        doing = "docked" if self._body.docked else self._body.doing
        return f"{self._body.x:.3f} {self._body.y:.3f} {math.degrees(self._body.heading):.1f} {doing}".rstrip()
