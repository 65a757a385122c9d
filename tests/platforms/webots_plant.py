"""A Pioneer in a simulated world: its random programs; see ``random_programs``."""

from __future__ import annotations

from random_programs import INF, Plant, course, either_way, ramp, setter, steps
from webots_lab import Lab


def plant() -> Plant:
    """See ``random_programs``."""
    speed = "wheelL.speed"
    return Plant(
        make=Lab.ready,
        devices={"left wheel": (0,), "right wheel": (1,)},
        recipes=[
            setter(speed, {0: 3.0}, either_way(3)),
            course(speed, "0", 3, 0, place=False, tail=INF, begins=3.0),
            ramp(speed, 0, 3.0, either_way(3), INF),
            *steps(speed, (3, -2), {0: 3.0}, INF, "wheelL.speed = 0;"),
        ],
        zeros={"left wheel": "wheelL.speed = 0;", "right wheel": "wheelR.speed = 0;"},
        setup="",
        settle=0.8,
        more=(0.1, 0.1),
        end=lambda lab: lab.plug,
        device=lambda lab: None,
        units={"left wheel": None, "right wheel": None},
    )
