"""A drive after CiA 402: its random programs; see ``random_programs``."""

from __future__ import annotations

from random import Random

from cia402_lab import MOTION, LivingLab
from random_programs import INF, TICK, Limit, Plant, Program, Push, course, setter, steps


class _Drives(LivingLab):
    tick = TICK


def plant() -> Plant:
    """See ``random_programs``."""
    speed, place = "drive5.speed", "drive5.val"
    back = "-drive5.val.sign"

    def near(rng: Random) -> str:
        return f"{place} + {rng.uniform(2, 10):.1f} * ({back})"

    return Plant(
        make=_Drives.ready,
        devices={5: (0,)},
        recipes=[
            setter(speed, {0: 6.0}, lambda rng: f"6 * ({back})"),
            setter(place, {0: 12.6}, near, 3.0),
            course(speed, "0", 5.0, 0, place=False, tail=INF, begins=5.0),
            course(place, place, 2.0, 0, place=True, tail=3.0, begins=12.6),
            *steps(speed, (6.0, -6.0), {0: 6.0}, INF, "drive5.speed = 0;"),
            lambda rng: Program(f"{place} = {near(rng)}; {speed} = 6 * ({back});", {0: 12.6}, 0.0, form="plain"),
        ],
        zeros={5: "drive5.speed = 0;"},
        setup="drive5.load = 1;",
        settle=0.6,
        more=(1.5,),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={5: None},
        others=(Push(MOTION.others["drive that is on"].go, {0: 6.3}),),
        limits={0: Limit("drive5", 4.0)},
        drift=0.02,
        # What is damaged on a CAN bus is lost.
        garbage=("silence",),
    )
