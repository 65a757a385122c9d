"""A device that an alarm keeps from moving says so everywhere, with the command that helps; each alarm comes twice."""

from __future__ import annotations

from typing import Any

from bioloid_lab import BAUD, Lab
from cia402_lab import Lab as Drives
from so101_lab import Lab as Arm

from urbihw.buses import messages as m
from urbihw.buses.servos import status
from urbihw.buses.servos.alarms import remedy
from urbihw.buses.servos.tables import all_tables
from urbihw_fakes.bioloid import Bioloid as Kit


def assert_told(lab: Any, motor: str, *words: str) -> None:
    """The device, the list of problems, and who writes to it, are told."""
    warned = lab.say(f"{motor}.val = 0.4|;", 0.3)
    problems, why, state = (lab.look(slot) for slot in ("robot.problems", f"{motor}.why", f"{motor}.state"))
    assert state == '"alarm"'
    for word in words:
        assert word in problems and word in why, (word, problems, why)
    assert warned == "" or words[-1] in warned


def assert_obeys(lab: Any, motor: str) -> None:
    assert lab.look(f"[{motor}.state, robot.problems]") == '["ok", []]'
    before = lab.number(f"{motor}.val")
    goal = 0.3 if before < 0 else -0.3
    assert "!!!" not in lab.say(f"{motor}.val = {goal}|;", 1.0)
    assert abs(lab.number(f"{motor}.val") - goal) < 0.1 < abs(before - goal)


def test_an_x_servo_that_overheats_twice() -> None:
    lab: Any = Lab.ready(Kit.x_series(1, baud=BAUD))
    for _ in range(2):
        lab.say("motor1.load = 1|;", 0.5)
        lab.kit[1].heat(90)
        lab.run(1.5)
        # The command that does not help leads to the one that does, also the second time.
        for _ in range(2):
            assert_told(lab, "motor1", "overheating", "let it cool", "motor1.reboot")
            told = lab.say("motor1.load = 1|;", 0.5)
            assert told == "" or "motor1.reboot" in told and "code" not in told
        lab.kit[1].heat(30)
        lab.say("motor1.reboot|;", 3.0)
        lab.say("motor1.load = 1|;", 1.0)
        assert_obeys(lab, "motor1")
        lab.run(10)


def test_an_ax_servo_that_overheats_twice() -> None:
    lab: Any = Lab.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    for _ in range(2):
        lab.say("motor6.load = 1|;", 0.5)
        lab.kit[6].heat(90)
        lab.run(1.5)
        assert_told(lab, "motor6", "overheating", "let it cool", "motor6.load = 1")
        lab.kit[6].heat(30)
        lab.run(1.5)
        assert_told(lab, "motor6", "its torque limit is 0", "motor6.load = 1")
        lab.say("motor6.load = 1|;", 1.0)
        assert_obeys(lab, "motor6")
        lab.run(10)


def test_a_feetech_servo_that_overheats_twice() -> None:
    lab: Any = Arm.ready()
    for _ in range(2):
        lab.say("motor2.load = 1|;", 0.5)
        lab.kit[2].heat(90)
        lab.run(1.5)
        assert_told(lab, "motor2", "overheating", "let it cool", "motor2.load = 1")
        lab.kit[2].heat(30)
        lab.say("motor2.load = 1|;", 1.5)
        assert_obeys(lab, "motor2")
        lab.run(10)


def test_a_drive_in_fault_twice() -> None:
    lab = Drives.ready()
    for _ in range(2):
        lab.say("drive5.load = 1|;", 1.0)
        lab.drive.fault(0x4310)
        lab.run(0.5)
        helps = "mend the cause, then drive5.resetFault and drive5.load = 1"
        assert helps in lab.look("robot.problems") and helps in lab.look("drive5.val = 1")
        assert helps in lab.say("drive5.load = 1|;", 1.0)
        lab.say("drive5.resetFault|;", 1.0)
        assert lab.look("robot.problems") == "[]"
        assert "!!!" not in lab.say("drive5.load = 1|; sleep(1s); drive5.val = 0|;", 12.0)


def test_a_lost_drive_claims_no_speed_twice() -> None:
    lab = Drives.ready()
    for _ in range(2):
        lab.say("drive5.load = 1|; sleep(1s); drive5.speed = 2|;", 3.0)
        assert lab.number("drive5.speed") > 1.5
        lab.end.unplug()
        lab.run(1.0)
        assert lab.look("[drive5.stale, drive5.speed, drive5.state]") == '[true, nan, "lost"]'
        lab.end.replug()
        lab.run(4.0)
        assert lab.look("[drive5.stale, drive5.state]") == '[false, "ok"]'
        assert abs(lab.number("drive5.speed")) < 0.1


def test_two_servos_with_one_id_are_told_with_what_helps_twice() -> None:
    lab: Any = Lab.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD))
    for _ in range(2):
        lab.robot._handle_message(m.Found(tuple(lab.robot._infos.values()), (9,)))
        lab.run(0.2)
        assert "several devices answer to id 9" in lab.look("robot.problems")
        assert "urbihw servo set-id" in lab.look("robot.problems")
        assert any("several devices answer to id 9" in each for each in lab.findings())
        lab.robot._handle_message(m.Found(tuple(lab.robot._infos.values())))
        lab.run(0.2)
        assert lab.look("robot.problems") == "[]"
        assert lab.findings() == []


def test_every_alarm_of_every_model_has_a_remedy() -> None:
    causes = {word for table in all_tables() for word in table.hardware_errors.values()}
    causes |= {*status.STATE_BITS_1.values(), *status.STATE_BITS_FEETECH.values()}
    assert [cause for cause in sorted(causes) if remedy(cause) == remedy("another")] == []
    assert len(causes) > 8
