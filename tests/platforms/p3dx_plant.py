"""A Pioneer: its random programs; see ``random_programs``."""

from __future__ import annotations

from p3dx_lab import BAUD, MOTION, Lab
from random_programs import Limit, Plant, Push, base_recipes

from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.world import World, box


class _P3dx(Lab):
    url = f"pipe://robot?baud={BAUD}"


def plant() -> Plant:
    """See ``random_programs``."""
    x, yaw = "P3dx.body.x.speed", "P3dx.body.yaw.speed"
    return Plant(
        make=lambda: _P3dx.ready(P3dx(World([*box(-1e4, -1e4, 1e4, 1e4)]))),
        devices={"robot": (0, 1)},
        recipes=base_recipes(x, yaw, 0.3, 0.5),
        zeros={"robot": f"{x} = 0 | {yaw} = 0;"},
        setup="P3dx.body.load = 1;",
        settle=1.8,
        more=(0.06, 0.3),
        end=lambda lab: lab.robot_line.end,
        device=lambda lab: lab.kit.robot,
        units={"robot": None},
        others=tuple(Push(other.go, {0: 0.3}) for other in MOTION.others.values()),
        limits={0: Limit("robot", 0.2), 1: Limit("robot", 0.3, "turn")},
    )
