"""Who writes a speed has the base from then on: it ends go, turn and moveTo, and the other speed is zero.

On all bases, in simulated time; what is looked at is the body of the fake.
"""

from __future__ import annotations

import pytest
from motions import Motion
from nxt_lab import MOTION as NXT
from p3dx_lab import MOTION as PIONEER
from segway_lab import MOTION as SEGWAY

TURN_TIME = 2.0
"""Seconds in which every base turns or drives at its speed."""


def speeds(motion: Motion, lab) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Forward and to the left, m/s and rad/s, of a body; for the NXT from its wheels."""
    parts, _ = motion.look(lab)
    if motion is NXT:
        left, right = parts[2], parts[0]
        return (left + right) / 2, right - left
    return parts[0], parts[1]


BASES = {"segway": SEGWAY, "p3dx": PIONEER, "nxt": NXT}
FORWARD = {"segway": "rmp.forwardSpeed = 0.1;", "p3dx": "P3dx.body.x.speed = 0.1;", "nxt": "wheels.speed = 20;"}
WRITES = [
    *((base, "robot.xSpeed = 0.1;") for base in BASES),
    *FORWARD.items(),
    ("segway", "robot.body.x.speed = 0.1;"),
]


def moving(base: str, text: str):  # type: ignore[no-untyped-def]
    """A lab whose robot executes a statement, with its events printed."""
    motion = BASES[base]
    lab = motion.make()
    if motion.revive:
        lab.say(f"{motion.revive}|;", 1.0)
    lab.say('at (robot.aborted?) echo("aborted"); at (robot.finished?) echo("finished");')
    lab.say(text, TURN_TIME)
    return motion, lab


@pytest.mark.parametrize(("base", "written"), WRITES)
def test_a_speed_ahead_ends_a_turn(base: str, written: str) -> None:
    motion, lab = moving(base, 'robot.turn(3000deg); echo("back");')
    assert speeds(motion, lab)[1] < -0.1
    lab.look(written.rstrip(";"))
    said = lab.say("", TURN_TIME)
    assert "aborted" in said and "back" in said and "finished" not in said
    ahead, turn = speeds(motion, lab)
    assert ahead > 0.02
    assert abs(turn) < 0.02


@pytest.mark.parametrize(("base", "written"), [
    *((base, "robot.yawSpeed = 0.2;") for base in BASES),
    ("segway", "rmp.yawSpeed = 0.2;"), ("p3dx", "P3dx.body.yaw.speed = 0.2;"),
])  # fmt: skip
def test_a_speed_of_rotation_ends_a_way(base: str, written: str) -> None:
    motion, lab = moving(base, 'robot.go(50); echo("back");')
    assert speeds(motion, lab)[0] > 0.1
    lab.look(written.rstrip(";"))
    said = lab.say("", TURN_TIME)
    assert "aborted" in said and "back" in said
    ahead, turn = speeds(motion, lab)
    assert abs(ahead) < 0.02
    assert turn > 0.1


@pytest.mark.parametrize("base", BASES)
def test_a_movement_of_another_client_takes_its_place(base: str) -> None:
    motion, lab = moving(base, 'robot.go(50); echo("back");')
    lab.kernel.feed(lab.observer, b"robot.go(-20);")
    said = lab.say("", TURN_TIME)
    assert "aborted" in said and "back" in said
    assert speeds(motion, lab)[0] < -0.1


def test_other_parts_may_move_meanwhile() -> None:
    motion, lab = moving("nxt", "robot.go(50);")
    lab.look("claw.speed = 30")
    assert "aborted" not in lab.say("", 0.5)
    assert speeds(motion, lab)[0] > 0.1


@pytest.mark.parametrize("base", BASES)
def test_a_stop_answers_nothing(base: str) -> None:
    motion, lab = moving(base, "robot.go(50);")
    assert lab.look("robot.stop") == ""
    lab.run(motion.standstill)
    assert abs(speeds(motion, lab)[0]) < 0.02
    assert lab.look("robot.stop") == ""
