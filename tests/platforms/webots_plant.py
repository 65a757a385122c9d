"""Two wheels in a simulated world: their random programs; see ``random_programs``.

They are on blocks: the wheels of a robot on the ground turn each other.
"""

from __future__ import annotations

from pathlib import Path

from random_programs import INF, Limit, Plant, course, either_way, ramp, setter, steps
from webots_lab import Lab

MODEL = Path(__file__).with_name("webots_home") / "blocks.xml"


def plant() -> Plant:
    """See ``random_programs``."""
    speed = "joint[0].speed"
    return Plant(
        make=lambda: Lab.ready(MODEL),
        devices={"left wheel": (0,), "right wheel": (1,)},
        recipes=[
            setter(speed, {0: 3.0}, either_way(3)),
            setter("joint[1].speed", {1: 3.0}, either_way(3)),
            course(speed, "0", 3, 0, place=False, tail=INF, begins=3.0),
            ramp(speed, 0, 3.0, either_way(3), INF),
            *steps(speed, (3, -2), {0: 3.0}, INF, "joint[0].speed = 0;"),
        ],
        zeros={"left wheel": "joint[0].speed = 0;", "right wheel": "joint[1].speed = 0;"},
        setup="",
        settle=0.8,
        more=(0.1, 0.1),
        end=lambda lab: lab.plug,
        device=lambda lab: lab.plug,
        units={"left wheel": None, "right wheel": None},
        limits={0: Limit("left wheel", 2.0), 1: Limit("right wheel", 2.0)},
    )
