"""An SO-101: its random programs; see ``random_programs``."""

from __future__ import annotations

import math

from random_programs import INF, LATE, TICK, Limit, Plant, Push, between, course, either_way, setter
from servo_hands import hand_at
from so101_lab import MOTION, Lab

JOINT = 1.5
"""rad/s of a joint on its way to a goal."""
_WAY = 3.6 / JOINT + LATE


class _Arm(Lab):
    tick = TICK


def plant() -> Plant:
    """See ``random_programs``."""
    joint, wheel = "shoulder_pan.val", "wrist_roll.speed"
    return Plant(
        make=_Arm.ready,
        devices={1: (0,), 5: (4,)},
        recipes=[
            setter(joint, {0: JOINT}, between(-1.5, 1.5), _WAY),
            course(joint, "0", 0.3, 0, place=True, tail=1.0, begins=JOINT),
            setter(wheel, {4: 3.0}, either_way(3.0)),
            course(wheel, "0", 2.0, 4, place=False, tail=INF, begins=2.0),
        ],
        zeros={5: "wrist_roll.speed = 0;"},
        setup='shoulder_pan.speed = 1.5; wrist_roll.mode = "wheel";',
        settle=0.5,
        more=(0.15,) * 6,
        end=lambda lab: lab.end,
        device=lambda lab: lab.kit,
        units={1: 1, 5: 5},
        hands={1: hand_at(1, math.pi, JOINT)},
        others=tuple(Push(other.go, {0: JOINT}, 8.0) for other in MOTION.others.values()),
        limits={0: Limit("shoulder_pan", 1.0), 4: Limit("wrist_roll", 2.0)},
    )
