"""The words for a Pioneer at the console of `python -m urbihw_fakes p3dx`."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.world import add_box, without


class Cable(Protocol):
    """What can be pulled and put back."""

    def unplug(self) -> None:
        """Pull it."""

    def plug(self) -> None:
        """Put it back."""


def commands(kit: P3dx, clock: Callable[[], float], laser_line: Cable) -> dict[str, Command]:
    """The table for one robot; `clock` gives the time that it lives in."""
    crates = [0]

    def box(words: list[str]) -> str:
        x, y = float(words[0]), float(words[1])
        with kit.lock:
            add_box(kit.world, x, y, float(words[2]) if len(words) > 2 else 0.4)
        crates[0] += 1
        return "ok"

    def unbox(words: list[str]) -> str:
        if not crates[0]:
            raise UnknownRequest("unbox: there is no crate to take away")
        with kit.lock:
            kit.world.walls = without(kit.world.walls, 4)
        crates[0] -= 1
        return "ok"

    def place(words: list[str]) -> str:
        x, y, degrees = (float(word) for word in words[:3])
        with kit.lock:
            kit.body.place(x, y, math.radians(degrees))
        return "ok"

    def where(words: list[str]) -> str:
        with kit.lock:
            kit.body.advance(clock())
            (x, y, heading), (ox, oy, oh) = kit.body.pose, kit.body.odometry
        truth = f"{x:.3f} {y:.3f} {math.degrees(heading):.1f}"
        return f"{truth}, believes {ox:.3f} {oy:.3f} {math.degrees(oh):.1f}"

    def number(set_it: Callable[[float], None]) -> Callable[[list[str]], str]:
        def run(words: list[str]) -> str:
            set_it(float(words[0]))
            return "ok"

        return run

    def switch(set_it: Callable[[bool], None]) -> Callable[[list[str]], str]:
        def run(words: list[str]) -> str:
            if words[0] not in ("on", "off"):
                raise ValueError(words)
            set_it(words[0] == "on")
            return "ok"

        return run

    def cable(action: Callable[[], None]) -> Callable[[list[str]], str]:
        def run(words: list[str]) -> str:
            action()
            return "ok"

        return run

    def world_map(words: list[str]) -> str:
        Path(words[0]).write_text(kit.world.as_map(), "ascii")
        return "ok"

    return {
        "box": Command("X Y [SIZE]", "put a crate into the world", box),
        "unbox": Command("", "take the last crate away", unbox),
        "place": Command("X Y DEGREES", "carry the robot; its odometry does not notice", place),
        "where": Command("", "where it is, and where it believes to be", where),
        "volts": Command("VOLTS", "the battery", number(lambda volts: setattr(kit.body, "volts", volts))),
        "slip": Command("SHARE", "of all turning is lost", number(lambda share: setattr(kit.body, "slip", share))),
        "button": Command("on|off", "press the STOP button, let it go", switch(kit.robot.press)),
        "dirty": Command("on|off", "the laser's window", switch(lambda on: setattr(kit.laser, "dirty", on))),
        "unplug-laser": Command("", "pull the laser's cable", cable(laser_line.unplug)),
        "plug-laser": Command("", "put it back", cable(laser_line.plug)),
        "map": Command("FILE", "write this world as a map in ARIA's format", world_map),
    }
