"""The words for a TriBot at the console of `python -m urbihw_fakes nxt`."""

from __future__ import annotations

import math
from collections.abc import Callable

from urbihw_fakes.console import Command
from urbihw_fakes.nxt.codes import LIGHT_ACTIVE, LIGHT_INACTIVE
from urbihw_fakes.nxt.inputs import raw_of
from urbihw_fakes.nxt.stream import NxtDevice


def commands(device: NxtDevice, clock: Callable[[], float]) -> dict[str, Command]:
    """The table for one robot; `clock` gives the time that it lives in."""
    robot, brick = device.robot, device.brick

    def now() -> None:
        brick.advance(clock())

    def bump(words: list[str]) -> str:
        now()
        robot.pushed = _switch(words[0])
        robot.touch.pressed = robot.pushed
        return "ok"

    def obstacle(words: list[str]) -> str:
        now()
        robot.obstacle = None if words[0] == "none" else _share(words[0], 1000) / 100
        return "ok"

    def put(words: list[str]) -> str:
        now()
        robot.x, robot.y, robot.heading = -abs(float(words[0])) / 100, 0.0, math.radians(float((words + ["0"])[1]))
        return "ok"

    def noise(words: list[str]) -> str:
        robot.sound.loudness = _share(words[0], 1)
        robot.sound.audible = _share((words + [words[0]])[1], 1)
        return "ok"

    def light(words: list[str]) -> str:
        robot.light.reflected = raw_of(LIGHT_ACTIVE, _share(words[0], 1))
        robot.light.ambient = raw_of(LIGHT_INACTIVE, _share((words + [words[0]])[1], 1))
        return "ok"

    def battery(words: list[str]) -> str:
        brick.millivolts = round(_share(words[0], 12) * 1000)
        return "ok"

    def jam(words: list[str]) -> str:
        now()
        brick.motor(words[0]).jammed = _switch((words + ["on"])[1])
        return "ok"

    def state(words: list[str]) -> str:
        now()
        motors = ", ".join(
            f"{port} power {brick.motor(port).power} at {brick.motor(port).rotation}" for port in "ABC"
        )
        sounding = f"{brick.sound.frequency} Hz" if brick.sound.sounding(brick.now) else "silent"
        place = f"{-robot.x * 100:.0f} cm before the wall, heading {math.degrees(robot.heading):.0f}"
        return f"{'on' if brick.awake else 'off'}; {motors}; {place}; {sounding}"

    return {
        "bump": Command("on|off", "press the bumper, or let it go", bump),
        "obstacle": Command("CM|none", "hold something before the ultrasonic sensor", obstacle),
        "put": Command("CM [DEGREES]", "carry the robot to that distance from the wall, turned left", put),
        "sound": Command("LOUDNESS [AUDIBLE]", "0..1, of all the band and of what an ear hears", noise),
        "light": Command("REFLECTED [AMBIENT]", "0..1", light),
        "battery": Command("VOLTS", "of the battery", battery),
        "jam": Command("A|B|C [on|off]", "hold a motor fast, or let it go", jam),
        "state": Command("", "motors, place and sound", state),
    }


def _switch(text: str) -> bool:
    if text not in ("on", "off"):
        raise ValueError(text)
    return text == "on"


def _share(text: str, most: float) -> float:
    value = float(text)
    if not 0 <= value <= most:
        raise ValueError(text)
    return value
