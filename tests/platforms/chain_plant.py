"""A chain of servos: its random programs; see ``random_programs``."""

from __future__ import annotations

from chain_lab import MOTION, Lab
from random_programs import INF, LATE, TICK, Limit, Plant, Program, Push, between, course, either_way, setter
from servo_hands import hand_at

JOINT = 1.5
"""rad/s of a joint on its way to a goal."""
_WAY = 300 / 57.3 / JOINT + LATE
_OTHER = 3.2
"""rad/s of a servo that switches its mode: for a moment a speed of one mode may be taken for one of the other."""
_SERVOS = "AX-12:1,XL330-M288:3,XL330-M288:4"


class _Chain(Lab):
    tick = TICK


def plant() -> Plant:
    """See ``random_programs``."""
    joint, wheel = "motor1.val", "motor3.speed"
    to_wheel = 'motor4.mode = "velocity"; motor4.speed = 1.5;'
    to_joint = 'motor4.mode = "position"; motor4.speed = 1.5; motor4.val = {};'
    return Plant(
        make=lambda: _Chain.ready(_SERVOS),
        devices={1: (0,), 3: (1,), 4: (2,)},
        recipes=[
            setter(joint, {0: JOINT}, between(-2, 2), _WAY),
            course(joint, "0", 0.3, 0, place=True, tail=1.0, begins=JOINT),
            setter(wheel, {1: 3.0}, either_way(3.0)),
            course(wheel, "0", 2.0, 1, place=False, tail=INF, begins=2.0),
            lambda rng: Program(to_wheel, {2: _OTHER}, 0.0, form="plain"),
            lambda rng: Program(to_joint.format(rng.uniform(-2, 2)), {2: _OTHER}, 0.0, _WAY, form="plain"),
        ],
        zeros={3: "motor3.speed = 0;"},
        setup='motor1.speed = motor4.speed = 1.5; motor3.mode = "velocity";',
        settle=0.5,
        more=(0.15, 0.1, 0.15),
        end=lambda lab: lab.end,
        device=lambda lab: lab.kit,
        units={1: 1, 3: 3, 4: 4},
        hands={1: hand_at(1, 0.0, JOINT), 4: hand_at(4, 0.0)},
        others=(Push(MOTION.others["X wheel"].go, {1: 2.5}),),
        limits={0: Limit("motor1", 1.0), 1: Limit("motor3", 2.0), 2: Limit("motor4", 1.2)},
    )
