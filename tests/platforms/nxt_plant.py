"""An NXT: its random programs; see ``random_programs``."""

from __future__ import annotations

from nxt_lab import Lab
from random_programs import INF, TICK, Limit, Plant, Program, Push, between, course, either_way, setter, steps

from urbihw_fakes.nxt.tribot import TriBot


class _Nxt(Lab):
    tick = TICK


def _run_wheels(lab: Lab) -> None:
    """Another computer at the brick; it leaves the claw alone, whose goals would be far away then."""
    for port in "AC":
        lab.brick.motor(port).set_output(50, 1, 0, 0, 0x20, 0)


def plant() -> Plant:
    """See ``random_programs``."""
    speed, claw = "wheels.speed", "claw.val"
    both = {0: 8.0, 2: 8.0}
    return Plant(
        make=lambda: _Nxt.ready(TriBot(10_000.0)),
        devices={"A": (0,), "B": (1,), "C": (2,)},
        recipes=[
            setter("wheelL.speed", {2: 8.0}, either_way(50)),
            setter("wheelR.speed", {0: 8.0}, either_way(50)),
            setter(speed, both, either_way(50)),
            setter(claw, {1: 12.0}, between(-200, 200), 5.0),
            course("wheelL.speed", "0", 40, 2, place=False, tail=INF, begins=6.3),
            course(claw, "0", 150, 1, place=True, tail=1.5, begins=12.0),
            *steps(speed, (50, -30), both, INF, "wheels.speed = 0;"),
            *steps(claw, (60, -60), {1: 12.0}, 3.0),
            lambda rng: Program(f"robot.go({rng.uniform(-0.6, 0.6):.2f});", both, 8.0, rests=True, steered=True),
            lambda rng: Program(f"robot.turn({rng.uniform(-3, 3):.2f});", both, 12.0, rests=True, steered=True),
        ],
        zeros={"A": "wheelR.speed = 0;", "C": "wheelL.speed = 0;"},
        setup="",
        settle=0.7,
        more=(1.0, 1.0, 1.0),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"A": None},
        others=(Push(_run_wheels, {0: 8.0, 2: 8.0}),),
        limits={part: Limit(port, 30, unit=8.0 / 50) for port, part in (("A", 0), ("B", 1), ("C", 2))},
    )
