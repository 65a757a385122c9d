"""A link that comes back: what moves without an order of this daemon is stopped, and an earlier order is dead.

In simulated time; what is looked at is the body of the fake.
"""

from __future__ import annotations

import pytest
from motions import Motion
from nxt_lab import MOTION as NXT
from p3dx_lab import MOTION as PIONEER
from segway_lab import MOTION as SEGWAY
from spykee_lab import MOTION as SPYKEE

from urbihw_fakes.nxt import codes

BASES = {"segway": SEGWAY, "p3dx": PIONEER, "nxt": NXT, "spykee": SPYKEE}


def moves(motion: Motion, lab) -> float:  # type: ignore[no-untyped-def]
    return max(map(abs, motion.look(lab)[0]))


@pytest.fixture(params=BASES)
def base(request: pytest.FixtureRequest):  # type: ignore[no-untyped-def]
    motion = BASES[request.param]
    lab = motion.make()
    if motion.revive:
        lab.say(f"{motion.revive}|;", 1.0)
    return motion, lab


def lose_link(motion: Motion, lab, seconds: float) -> None:  # type: ignore[no-untyped-def]
    motion.unplug(lab)
    lab.run(seconds)
    motion.plug(lab)
    lab.run(3)
    assert lab.look("robot.controller.link") == "true"
    if motion.revive:
        lab.say(f"{motion.revive}|;", 1.0)


@pytest.mark.parametrize("seconds", [0.5, 2.5])
def test_an_order_of_before_is_dead_and_the_same_order_is_sent_again(base, seconds: float) -> None:  # type: ignore[no-untyped-def]
    motion, lab = base
    lab.say("robot.xSpeed = 0.1;", 2)
    assert moves(motion, lab) > 0.05
    lose_link(motion, lab, seconds)
    assert moves(motion, lab) < 0.02
    assert lab.look("robot.moving") == "false"
    assert lab.look("robot.speed") == "[0, 0, 0, 0, 0, 0]"
    assert lab.look("robot.xSpeed = 0.1") == "0.1"
    lab.run(2)
    assert moves(motion, lab) > 0.05
    assert lab.look("robot.moving") == "true"


def test_an_order_while_the_link_is_down_is_dead(base) -> None:  # type: ignore[no-untyped-def]
    motion, lab = base
    motion.unplug(lab)
    lab.run(1)
    lab.look("robot.xSpeed = 0.1")
    motion.plug(lab)
    lab.run(4)
    assert moves(motion, lab) < 0.02
    assert lab.look("robot.moving") == "false"


def test_a_way_that_was_cut_does_not_go_on(base) -> None:  # type: ignore[no-untyped-def]
    motion, lab = base
    lab.say("robot.go(50),", 2)
    assert moves(motion, lab) > 0.05
    lose_link(motion, lab, 1.0)
    lab.run(3)
    assert moves(motion, lab) < 0.02
    assert lab.look("robot.moving") == "false"


def test_a_base_that_was_silent_stands_and_says_so() -> None:
    lab = SEGWAY.make()
    lab.say("robot.xSpeed = 0.3;", 2)
    lab.device.faults.start("silence")
    lab.run(1)
    assert lab.look("robot.moving") == "false"
    lab.device.faults.stop()
    lab.run(2)
    assert lab.look("robot.speed") == "[0, 0, 0, 0, 0, 0]"
    lab.say("robot.xSpeed = 0.3;", 2)
    assert moves(SEGWAY, lab) > 0.2


def test_a_brick_that_runs_when_the_link_is_back_is_stopped_though_this_daemon_has_not_moved_it() -> None:
    lab = NXT.make()
    lab.say('at (nxt.stopped?(var why)) echo("stopped: " + why);')
    lab.unplug()
    lab.run(0.5)
    # Another brick is at the link, or another program has had it meanwhile.
    lab.brick.motor("B").set_output(23, codes.MOTOR_ON | codes.BRAKE | codes.REGULATED, 1, 0, codes.RUNNING, 0)
    lab.run(0.5)
    assert moves(NXT, lab) > 1
    lab.end.replug()
    lab.run(2)
    assert lab.brick.motor("B").power == 0
    assert moves(NXT, lab) < 0.02
    assert "stopped: B moved when the link was opened" in lab.heard()
