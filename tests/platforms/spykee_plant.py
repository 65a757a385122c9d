"""A Spykee: its random programs; see ``random_programs``."""

from __future__ import annotations

from random_programs import INF, Limit, Plant, Program, Push, course, either_way, ramp, setter, steps
from spykee_lab import MOTION, Lab

MOST = 0.42
"""m/s of a track at 100."""


def plant() -> Plant:
    """See ``random_programs``."""
    left, right = "trackL.val", "trackR.val"
    both = {0: 0.25, 1: 0.25}
    return Plant(
        make=Lab.ready,
        devices={"trackL": (0,), "trackR": (1,)},
        recipes=[
            setter(left, {0: MOST}, either_way(100)),
            setter(right, {1: MOST}, either_way(100)),
            course(left, "0", 60, 0, place=False, tail=INF, begins=MOST),
            ramp(right, 1, MOST, either_way(100), INF),
            *steps(left, (60, -40), {0: 0.6 * MOST}, INF, "trackL.val = 0;"),
            *steps(right, (60, -40), {1: 0.6 * MOST}, INF, "trackR.val = 0;"),
            lambda rng: Program(f"robot.go({rng.uniform(-0.6, 0.6):.2f});", both, 12.0, rests=True, steered=True),
            lambda rng: Program(f"robot.turn({rng.uniform(-3, 3):.2f});", both, 16.0, rests=True, steered=True),
        ],
        zeros={"trackL": "trackL.val = 0;", "trackR": "trackR.val = 0;"},
        setup="",
        settle=0.8,
        more=(0.05, 0.05),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"trackL": None},
        others=tuple(Push(other.go, {0: 0.6 * MOST, 1: 0.6 * MOST}) for other in MOTION.others.values()),
        limits={part: Limit(track, 40, unit=MOST / 100) for part, track in ((0, "trackL"), (1, "trackR"))},
    )
