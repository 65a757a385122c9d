"""A Bioloid: its random programs; see ``random_programs``."""

from __future__ import annotations

import math

from bioloid_lab import BAUD, MOTION, Lab
from random_programs import (
    INF,
    LATE,
    TICK,
    Limit,
    Plant,
    Program,
    Push,
    between,
    course,
    either_way,
    ramp,
    setter,
    steps,
)
from servo_hands import hand_at

from urbihw_fakes.bioloid import Bioloid

JOINT = 1.5
"""rad/s of a joint on its way to a goal."""
_WAY = 300 / 57.3 / JOINT + LATE
_OTHER = 3.2
"""rad/s of a servo that switches its mode: for a moment a speed of one mode may be taken for one of the other."""


class _Bioloid(Lab):
    tick = TICK


def plant() -> Plant:
    """See ``random_programs``."""
    wheel, joint = "motor7.speed", "motor6.val"
    to_wheel = "motor8.cwLimit = motor8.ccwLimit = 0; motor8.speed = 1.5;"
    to_joint = "motor8.cwLimit = -150deg; motor8.ccwLimit = 150deg; motor8.speed = 1.5; motor8.val = {};"
    return Plant(
        make=lambda: _Bioloid.ready(Bioloid(servos=(6, 7, 8), sensors=(), baud=BAUD)),
        devices={6: (0,), 7: (1,), 8: (2,)},
        recipes=[
            setter(joint, {0: JOINT}, between(-2, 2), _WAY),
            course(joint, "0", 0.3, 0, place=True, tail=1.0, begins=JOINT),
            ramp(joint, 0, JOINT, between(-2, 2), _WAY),
            *steps(joint, (0.5, -0.5), {0: JOINT}, _WAY),
            setter(wheel, {1: 3.0}, either_way(3.0)),
            course(wheel, "0", 2.0, 1, place=False, tail=INF, begins=2.0),
            ramp(wheel, 1, 3.0, either_way(3.0), INF),
            *steps(wheel, (2.0, -1.0), {1: 2.0}, INF, "motor7.speed = 0;"),
            lambda rng: Program(to_wheel, {2: _OTHER}, 0.0, form="plain"),
            lambda rng: Program(to_joint.format(rng.uniform(-2, 2)), {2: _OTHER}, 0.0, _WAY, form="plain"),
            lambda rng: Program(f"{to_wheel} sleep(0.3s); {to_joint.format(1)} sleep(0.2s);", {2: _OTHER}, 0.5),
        ],
        zeros={7: "motor7.speed = 0;"},
        setup="motor6.speed = motor8.speed = 1.5; motor7.cwLimit = motor7.ccwLimit = 0;",
        settle=0.5,
        more=(0.15, 0.1, 0.15),
        end=lambda lab: lab.end,
        device=lambda lab: lab.kit,
        units={6: 6, 7: 7, 8: 8},
        hands={number: hand_at(number, math.radians(150), springs) for number, springs in ((6, JOINT), (8, _OTHER))},
        others=(
            Push(MOTION.others["joint"].go, {0: JOINT}, _WAY),
            Push(MOTION.others["wheel"].go, {1: 2.4}),
        ),
        limits={0: Limit("motor6", 1.0), 1: Limit("motor7", 2.0), 2: Limit("motor8", 1.2)},
    )
