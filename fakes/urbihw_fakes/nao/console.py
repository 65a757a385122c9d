"""The words for a Nao at the console of `python -m urbihw_fakes nao`."""

from __future__ import annotations

import math
from collections.abc import Callable

from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.nao.device import Nao
from urbihw_fakes.nao.others import TOUCHES


def commands(robot: Nao, clock: Callable[[], float]) -> dict[str, Command]:
    """The table for one robot; `clock` gives the time that it lives in."""
    body = robot.body

    def touch(words: list[str]) -> str:
        if words[0] not in TOUCHES:
            raise UnknownRequest(f"touch {words[0]}: say one of {', '.join(TOUCHES)}")
        robot.memory.touch(words[0], float(words[1]) if len(words) > 1 else 1.0)
        return "ok"

    def sonar(words: list[str]) -> str:
        body.sonars[:] = float(words[0]), float(words[1])
        return "ok"

    def event(words: list[str]) -> str:
        robot.memory.raise_event(words[0], float(words[1]))
        return "ok"

    def push(words: list[str]) -> str:
        body.advance(clock())
        body.standing = True
        body.slack()
        body.advance(clock() + 0.01)
        return "ok"

    def battery(words: list[str]) -> str:
        body.charge = min(1.0, max(0.0, float(words[0]) / 100))
        return "ok"

    def where(words: list[str]) -> str:
        body.advance(clock())
        doing = "fallen" if body.fallen else "walking" if body.walking else "standing" if body.standing else "crouching"
        return f"{body.x:.3f} {body.y:.3f} {math.degrees(body.heading):.1f} {doing}"

    def said(words: list[str]) -> str:
        return "\n".join(robot.voice.said) or "nothing"

    def joints(words: list[str]) -> str:
        body.advance(clock())
        return "\n".join(
            f"{joint.name:16} {joint.angle:8.3f} stiffness {joint.stiffness:.2f}" for joint in body.joints.values()
        )

    return {
        "touch": Command("SENSOR [0|1]", "touch it, or no longer", touch),
        "sonar": Command("LEFT RIGHT", "what is ahead, in m", sonar),
        "event": Command("NAME NUMBER", "raise an event of ALMemory", event),
        "push": Command("", "let it fall", push),
        "battery": Command("PERCENT", "charge or drain it", battery),
        "where": Command("", "where it is, and what it does", where),
        "said": Command("", "what it has said", said),
        "joints": Command("", "angles and stiffnesses", joints),
    }
