"""The words at the console that every base on wheels in a world has."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from urbihw_fakes.bodies.scene import scene_word
from urbihw_fakes.bodies.wheels import Wheels
from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest


class OnWheels(Protocol):
    """A robot in a world."""

    base: Wheels

    def put(self, x: float, y: float, heading: float) -> None:
        """Put the robot at a place, standing."""


def world_words(robot: OnWheels, advance: Callable[[], None]) -> dict[str, Command]:
    """The words; ``advance`` brings the robot up to the present time."""
    simulation = robot.base.simulation

    def place(words: list[str]) -> str:
        x, y, degrees = (float(word) for word in words[:3])
        advance()
        robot.put(x, y, math.radians(degrees))
        return "ok"

    def where(_: list[str]) -> str:
        advance()
        x, y, heading = robot.base.pose
        return f"{x:.3f} {y:.3f} {math.degrees(heading):.1f}"

    def friction(words: list[str]) -> str:
        robot.base.set_friction(float(words[0]))
        return "ok"

    def box(words: list[str]) -> str:
        x, y, *size = (float(word) for word in words[:3])
        simulation.add_crate(x, y, *size)
        return "ok"

    def unbox(_: list[str]) -> str:
        if not simulation.crates:
            raise UnknownRequest("unbox: there is no crate to take away")
        simulation.remove_crate()
        return "ok"

    return scene_word(simulation, advance) | {
        "place": Command("X Y DEGREES", "put the robot somewhere in its world", place),
        "where": Command("", "show where it is: m, m, degrees", where),
        "friction": Command("VALUE", FRICTION_HELP, friction),
        "box": Command("X Y [SIZE]", "add a crate to the world", box),
        "unbox": Command("", "remove the crate that was added last", unbox),
    }


FRICTION_HELP = "set the friction of the wheels on the floor: 0.7 is a hard floor, 0.05 ice"
