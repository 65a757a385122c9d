"""A Nao: its random programs; see ``random_programs``."""

from __future__ import annotations

from nao_lab import MOTION, Lab
from random_programs import INF, LATE, Limit, Plant, Program, Push, between, course, either_way, ramp, setter, steps

YAW, PITCH, SHOULDER, WALK, TURN = 0, 1, 2, 26, 27
"""Parts of the body."""
HEAD, LIFT = 8.3, 7.2
"""rad/s of two motors."""
_WAY = 4.2 / LIFT + LATE


def plant() -> Plant:
    """See ``random_programs``."""
    yaw, pitch = "headYaw.val", "headPitch.val"
    x, turn = "naoWalk.xSpeed", "naoWalk.yawSpeed"
    both = {WALK: 0.13, TURN: 0.65}
    return Plant(
        make=Lab.ready,
        devices={"HeadYaw": (YAW,), "HeadPitch": (PITCH,), "LShoulderPitch": (SHOULDER,), "walk": (WALK, TURN)},
        recipes=[
            setter(yaw, {YAW: HEAD}, between(-2, 2), _WAY),
            setter(pitch, {PITCH: LIFT}, between(-0.6, 0.5), _WAY),
            setter("shoulderPitchL.val", {SHOULDER: HEAD}, between(-2, 2), _WAY),
            course(yaw, "0", 0.3, YAW, place=True, tail=1.0, begins=HEAD),
            ramp(yaw, YAW, HEAD, between(-2, 2), _WAY),
            *steps(pitch, (0.4, -0.4), {PITCH: LIFT}, _WAY),
            setter(x, {WALK: 0.13, TURN: 0.65}, either_way(0.1)),
            setter(turn, both, either_way(0.5)),
            ramp(turn, TURN, 0.65, either_way(0.5), INF),
            *steps(x, (0.1, -0.05), both, INF, f"{x} = 0;"),
            lambda rng: Program(f"robot.go({rng.uniform(-0.4, 0.4):.2f});", both, 14.0, rests=True, steered=True),
            lambda rng: Program(f"robot.turn({rng.uniform(-2, 2):.2f});", both, 16.0, rests=True, steered=True),
        ],
        zeros={"walk": f"{x} = 0 | {turn} = 0;"},
        setup="motors.load = 1;",
        settle=1.0,
        more=(0.05,) * 28,
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"HeadYaw": None},
        others=(
            Push(MOTION.others["joint"].go, {YAW: HEAD}, 4.0),
            Push(MOTION.others["walk"].go, {WALK: 0.13, TURN: 0.65}),
        ),
        limits={
            YAW: Limit("HeadYaw", 2.0),
            PITCH: Limit("HeadPitch", 2.0),
            WALK: Limit("walk", 0.06),
            TURN: Limit("walk", 0.3, "turn"),
        },
        drift=0.02,
        # The last byte of an answer cannot be wrong: TCP has a sum of its own.
        garbage=("noise", "cut", "raw"),
    )
