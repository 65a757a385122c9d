"""The commands of a Pioneer at the console of `python -m urbihw_fakes p3dx`."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Protocol

from urbihw_fakes.bodies.pioneer import SimulatedBody
from urbihw_fakes.bodies.scene import scene_word
from urbihw_fakes.bodies.words import FRICTION_HELP
from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.p3dx.kit import P3dx


class Cable(Protocol):
    """A cable that can be unplugged."""

    def unplug(self) -> None:
        """Unplug the cable of the robot."""

    def plug(self) -> None:
        """Plug the cable in again."""


def commands(kit: P3dx, clock: Callable[[], float], laser_line: Cable) -> dict[str, Command]:
    """Return the commands of one robot; `clock` gives its simulated time in seconds."""
    actions = _Actions(kit, clock)
    return {
        "box": Command("X Y [SIZE]", "add a crate to the world", actions.add_crate),
        "unbox": Command("", "remove the crate that was added last", actions.remove_crate),
        "place": Command("X Y DEGREES", "move the robot; its odometry does not notice", actions.place),
        "where": Command("", "show the true position, and that of the odometry", actions.where),
        "volts": Command("VOLTS", "set the voltage of the battery", _number(partial(setattr, kit.body, "volts"))),
        **_grip(kit),
        "button": Command("on|off", "press or release the STOP button", _switch(kit.robot.press_stop_button)),
        "dirty": Command("on|off", "soil or clean the laser's window", _switch(partial(setattr, kit.laser, "dirty"))),
        "unplug-laser": Command("", "unplug the laser's cable", _simple(laser_line.unplug)),
        "plug-laser": Command("", "plug the laser's cable", _simple(laser_line.plug)),
        "map": Command("FILE", "save this world as a map in ARIA's format", actions.save_map),
    }  # fmt: skip


def _grip(kit: P3dx) -> dict[str, Command]:
    """How much the wheels slip, in the words of its world, and how that looks."""
    if isinstance(kit.body, SimulatedBody):
        return {
            # Its reports move it on.
            **scene_word(kit.body.base.simulation, lambda: None),
            "friction": Command("VALUE", FRICTION_HELP, _number(kit.body.base.set_friction)),
        }
    help = "set the share 0..1 of each turn that is lost to slip"
    return {"slip": Command("SHARE", help, _number(partial(setattr, kit.body, "slip")))}


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, kit: P3dx, clock: Callable[[], float]) -> None:
        self._kit = kit
        self._clock = clock
        self._crates = 0

    def add_crate(self, words: list[str]) -> str:
        x, y, *size = (float(word) for word in words[:3])
        with self._kit.lock:
            self._kit.world.add_crate(x, y, *size)
        self._crates += 1
        return "ok"

    def remove_crate(self, words: list[str]) -> str:
        if not self._crates:
            raise UnknownRequest("unbox: there is no crate to take away")
        with self._kit.lock:
            self._kit.world.remove_crate()
        self._crates -= 1
        return "ok"

    def place(self, words: list[str]) -> str:
        x, y, degrees = (float(word) for word in words[:3])
        with self._kit.lock:
            self._kit.body.set_pose(x, y, math.radians(degrees))
        return "ok"

    def where(self, words: list[str]) -> str:
        with self._kit.lock:
            self._kit.body.advance(self._clock())
            (x, y, heading), (ox, oy, oh) = self._kit.body.pose, self._kit.body.odometry
        truth = f"{x:.3f} {y:.3f} {math.degrees(heading):.1f}"
        return f"{truth}, believes {ox:.3f} {oy:.3f} {math.degrees(oh):.1f}"

    def save_map(self, words: list[str]) -> str:
        Path(words[0]).write_text(self._kit.world.as_map(), "ascii")
        return "ok"


def _number(action: Callable[[float], None]) -> Callable[[list[str]], str]:
    def run(words: list[str]) -> str:
        action(float(words[0]))
        return "ok"

    return run


def _switch(action: Callable[[bool], None]) -> Callable[[list[str]], str]:
    def run(words: list[str]) -> str:
        if words[0] not in ("on", "off"):
            raise ValueError(words)
        action(words[0] == "on")
        return "ok"

    return run


def _simple(action: Callable[[], None]) -> Callable[[list[str]], str]:
    def run(words: list[str]) -> str:
        action()
        return "ok"

    return run
