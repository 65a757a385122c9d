"""A Segway RMP: its random programs; see ``random_programs``."""

from __future__ import annotations

from random_programs import Limit, Plant, Program, Push, base_recipes
from segway_lab import MOTION, Lab

from urbihw_fakes.segway.frames import TRACTOR
from urbihw_fakes.segway.rmp import SegwayRmp


def plant() -> Plant:
    """See ``random_programs``."""
    x, yaw = "rmp.forwardSpeed", "rmp.yawSpeed"
    return Plant(
        # One that balances falls when its power is cut.
        make=lambda: Lab.ready(SegwayRmp(mode=TRACTOR)),
        devices={"base": (0, 1)},
        recipes=[
            *base_recipes(x, yaw, 0.4, 0.5),
            lambda rng: Program(f'rmp.mode = "tractor"; {x} = 0.3;', {0: 0.3}, 0.0, form="plain"),
        ],
        zeros={"base": f"{x} = 0 | {yaw} = 0;"},
        setup="",
        settle=0.7,
        more=(0.1, 0.1),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"base": None},
        others=tuple(Push(other.go, {0: 0.4}, 0.5) for other in MOTION.others.values()),
        limits={0: Limit("base", 0.2), 1: Limit("base", 0.3, "turn")},
    )
