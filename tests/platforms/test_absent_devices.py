"""What is written while the link, a device or its power is lost: nothing moves, and who wrote reads why, once."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives
from lab import RobotLab
from motions import Motion
from nxt_lab import MOTION as NXT
from p3dx_lab import MOTION as PIONEER
from segway_lab import MOTION as SEGWAY
from segway_lab import Lab as Segway
from spykee_lab import MOTION as SPYKEE

DOWN = "warning: the link to the robot is down"
BASES = {"segway": SEGWAY, "nxt": NXT, "spykee": SPYKEE}
WRITES = {"segway": "rmp.forwardSpeed = 0.3", "nxt": "wheels.speed = 40", "spykee": "trackL.val = 40"}


def unplugged(motion: Motion) -> RobotLab:
    """A lab whose link is lost."""
    lab: RobotLab = motion.make()
    motion.unplug(lab)
    lab.until(lambda: lab.look(f"{motion.slot}.link") == "false")
    return lab


@pytest.mark.parametrize("base", BASES)
def test_a_write_to_a_robot_that_is_unplugged(base: str) -> None:
    lab = unplugged(BASES[base])
    said = lab.say(f"{WRITES[base]}|;", 0.2)
    assert said.count(DOWN) == 1
    assert lab.look(f"{WRITES[base]}|").count(DOWN) == 1


@pytest.mark.parametrize("base", BASES)
def test_a_loop_is_told_once_for_each_loss(base: str) -> None:
    motion = BASES[base]
    lab = unplugged(motion)
    assert lab.say(f"loop {{ {WRITES[base]}; sleep(20ms) }},", 2.0).count(DOWN) == 1
    motion.plug(lab)
    lab.until(lambda: lab.look(f"{motion.slot}.link") == "true")
    lab.run(1.0)
    lab.heard()
    motion.unplug(lab)
    lab.until(lambda: lab.look(f"{motion.slot}.link") == "false")
    lab.heard()
    assert lab.say(f"{WRITES[base]}|;", 0.5).count(DOWN) == 1


def test_a_motor_of_a_kit_that_is_unplugged() -> None:
    lab = Bioloid.small(3)
    lab.end.unplug()
    lab.run(0.5)
    assert lab.say("motor3.val = 1|; motor3.val = 0.9|;", 0.2).count(DOWN) == 1
    assert lab.number("motor3.requested") == 0.9


def test_a_motor_that_does_not_answer() -> None:
    lab = Bioloid.small(6, 7)
    lab.kit.power_off(lab.bus_clock.now(), 6)
    lab.run(0.5)
    assert "!!! 1.1-10: warning: device 6 is lost: " in lab.say("motor6.val = 0.5|; motor6.val = 0.4|;", 0.2)
    assert "warning" not in lab.say("motor6.val = 0.5|;", 0.2)
    assert "warning" not in lab.say("motor7.val = 0.5|;", 0.2)
    lab.kit.power_on(lab.bus_clock.now(), 6)
    lab.until(lambda: lab.look("motor6.state") == '"ok"')
    assert "warning" not in lab.say("motor6.val = 0.4|;", 0.2)


def test_a_movement_that_goes_on_when_the_link_is_back_is_no_mistake() -> None:
    lab = Bioloid.small(6)
    lab.say("motor6.val = 0 sin:1s ampli:20deg,", 1)
    lab.end.unplug()
    lab.run(1)
    assert "warning" not in lab.heard()


def test_a_movement_says_of_the_loss_itself() -> None:
    lab = Segway.ready()
    lab.say("robot.go(5);", 1.0)
    lab.end.unplug()
    lab.run(4)
    said = lab.heard()
    assert said.count("the link was lost") == 1 and "warning" not in said


def test_the_segways_modes_after_a_loss() -> None:
    lab = Segway.ready()
    lab.say('rmp.mode = "disabled"|;', 1.0)
    assert "mode disabled" in lab.say("rmp.forwardSpeed = 0.2|;", 0.2)
    lab.end.unplug()
    lab.run(0.5)
    lab.end.replug()
    lab.until(lambda: lab.look("segway.state") == '"ok"')
    lab.run(0.5)
    lab.heard()
    assert "mode disabled" in lab.say("rmp.forwardSpeed = 0.2|;", 0.2)


def test_a_segway_that_is_lost_has_no_speed() -> None:
    lab = Segway.ready()
    lab.say("rmp.forwardSpeed = 0.4;", 1.0)
    assert lab.number("rmp.forwardSpeed") == pytest.approx(0.4, abs=0.02)
    lab.end.unplug()
    lab.run(1.0)
    assert abs(lab.base.body.speed) < 0.01
    for slot in ("forwardSpeed", "yawSpeed", "leftSpeed", "rightSpeed"):
        assert math.isnan(lab.number(f"rmp.{slot}"))


def test_a_pioneer_that_is_unplugged_names_the_link_not_the_motors() -> None:
    lab = unplugged(PIONEER)
    said = lab.say("P3dx.body.x.speed = 0.3;", 0.2)
    assert "the link to the robot is down" in said and "motors" not in said and "warning" not in said


def test_a_drive_that_does_not_switch_on() -> None:
    lab = Drives.ready()
    lab.say("drive5.load = 1|;", 0.5)
    lab.drive.machine.fault(0x4310)
    lab.run(0.3)
    said = lab.say("drive5.load = 1|; sleep(300ms); drive5.load = 1|;", 1.0)
    assert said.count("warning: drive 5: load not done") == 1
    lab.end.unplug()
    lab.run(0.5)
    assert "warning: drive 5: load not done" in lab.say("drive5.load = 1|;", 0.5)


def test_a_homing_that_the_drive_refuses() -> None:
    lab = Drives.ready()
    lab.say("drive5.load = 1|;", 0.5)
    assert "warning: drive 5: home not done" in lab.say("drive5.home(99);", 3.0)


def test_a_blocked_robot_says_so(tmp_path: Path) -> None:
    lab = PIONEER.make()
    lab.say("P3dx.body.load = 1|;", 1.0)
    said = lab.say("robot.go(50);", 60)
    assert "*** the robot is blocked after" in said and "of 50 m: the movement has ended" in said
