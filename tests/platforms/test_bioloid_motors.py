"""AX-12 servos as urbiscript objects, down to the registers of the fake."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from bioloid_lab import BAUD, Lab

from urbihw.buses import messages as m
from urbihw_fakes.bioloid import Bioloid as Kit


@pytest.fixture
def lab() -> Iterator[Lab]:
    yield Lab.ready(Kit(servos=(5, 6, 7), baud=BAUD))


def goal(degrees: float) -> int:
    return round((degrees + 150) * 1023 / 300)


def test_starting_moves_nothing(lab: Lab) -> None:
    lab.run(2)
    assert lab.sent(m.Targets) == []
    assert {lab.register(number, "torque_enable") for number in (5, 6, 7)} == {0}


def test_val_is_measured_when_read_and_a_goal_when_written(lab: Lab) -> None:
    assert lab.number("motor6.val") == pytest.approx(0.0026, abs=1e-4)
    assert lab.say("motor6.val = 90deg;", 0.03) == "1.5708"
    assert lab.register(6, "goal_position") == goal(90)
    assert lab.register(6, "torque_enable") == 1
    moving = lab.number("motor6.val")
    assert 0 < moving < 1.5
    lab.run(1)
    assert lab.number("motor6.val") == pytest.approx(math.pi / 2, abs=0.02)


def test_time_moves_evenly_in_the_time_given(lab: Lab) -> None:
    assert lab.say("motor6.val = 90deg time:2s; echo(\"there\");", 1) == ""
    assert lab.number("motor6.val") == pytest.approx(math.pi / 4, abs=0.1)
    lab.run(0.9)
    assert lab.heard() == ""
    lab.run(0.15)
    assert lab.heard() == "*** there"
    lab.run(0.2)
    assert lab.number("motor6.val") == pytest.approx(math.pi / 2, abs=0.02)


def test_ticking_clock_of_the_manual_ticks_once_a_second_until_its_tag_is_stopped(lab: Lab) -> None:
    lab.say('at (motor6.val > 0) echo("tick") onleave echo("tack");')
    lab.run(0.1)
    lab.heard()
    heard = lab.say("clock: motor6.val = 0 sin:1s ampli:20deg,", 4.0).splitlines()
    assert heard.count("*** tick") == 4 - (heard[0] == "*** tack")
    assert all(one != two for one, two in zip(heard, heard[1:], strict=False))
    lab.say("clock.stop;", 0.5)
    assert lab.say("", 3) == ""


def test_limits_clamp_val_visibly(lab: Lab) -> None:
    assert lab.say("motor6.val->rangemax == motor6.ccwLimit; motor6.val->rangemin == motor6.cwLimit;") == "true\ntrue"
    assert lab.say("motor6.val = 1000deg;", 0.02) == "2.61799"
    assert lab.register(6, "goal_position") == 1023
    lab.say("motor6.ccwLimit = 1 | motor6.cwLimit = -1;", 0.05)
    assert lab.register(6, "ccw_limit") == pytest.approx(511.5 + 1 / 0.0051183, abs=1)
    assert lab.number("motor6.val->rangemax") == pytest.approx(1, abs=0.003)
    lab.say("motor6.val = 2;", 0.05)
    assert lab.register(6, "goal_position") == lab.register(6, "ccw_limit")


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ('motor6.val = "far";', "val: this slot takes a number"),
        ("motor6.val = nan;", "val: takes a finite number, not nan"),
        ("motor6.temperature = 3;", "temperature: this slot can only be read"),
        ("motors[77];", "no motor 77; there are: 5, 6, 7"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words_and_breaks_nothing(lab: Lab, text: str, answer: str) -> None:
    assert answer in lab.say(text)
    lab.say("motor6.val = 30deg;", 0.02)
    assert lab.register(6, "goal_position") == goal(30)


def test_speed_of_a_joint_is_that_of_following_goals(lab: Lab) -> None:
    lab.say("motor6.speed = 2;", 0.02)
    assert lab.register(6, "moving_speed") == round(2 / math.radians(0.666))
    lab.say("motor6.val = 90deg;", 0.4)
    assert lab.number("motor6.speed") == pytest.approx(2, abs=0.2)


def test_wheel_mode_of_the_manual(lab: Lab) -> None:
    lab.say("motor6.speed = 2; motor6.val = 30deg;", 1)
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0; motor6.speed = 1;", 0.1)
    assert (lab.register(6, "cw_limit"), lab.register(6, "ccw_limit")) == (0, 0)
    assert lab.say("motor6.wheel;") == "true"
    full = 59 * math.tau / 60
    assert lab.register(6, "moving_speed") == round(1023 / full)
    lab.run(0.3)
    assert lab.number("motor6.speed") == pytest.approx(1, abs=0.2)
    lab.say("motor6.speed = -1;", 0.05)
    assert lab.register(6, "moving_speed") == round(1023 / full) | 1024
    lab.sent(m.Targets)
    lab.say("motor6.val = 1;", 0.05)
    assert lab.sent(m.Targets) == []


def test_a_wheel_may_be_told_to_turn_clockwise_in_the_breath_that_makes_it_one(lab: Lab) -> None:
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0| motor6.speed = -1;", 0.2)
    assert lab.register(6, "moving_speed") & 1024


def test_a_joint_that_becomes_a_wheel_does_not_turn_with_the_joints_speed(lab: Lab) -> None:
    lab.say("motor6.speed = 5;", 0.05)
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0;", 0.2)
    assert lab.register(6, "moving_speed") == 0


def test_a_wheel_that_becomes_a_joint_again_has_its_speed_back(lab: Lab) -> None:
    lab.say("motor6.speed = 2; motor6.cwLimit = motor6.ccwLimit = 0; motor6.speed = 1;", 0.2)
    lab.say("motor6.cwLimit = -150deg | motor6.ccwLimit = 150deg;", 0.2)
    assert lab.say("motor6.wheel;") == "false"
    assert lab.register(6, "moving_speed") == round(2 / math.radians(0.666))


def test_load_0_switches_off_and_no_goal_switches_on_again(lab: Lab) -> None:
    lab.say("motor6.val = 0 sin:1s ampli:20deg,", 0.5)
    lab.say("motor6.load = 0;", 0.1)
    assert lab.register(6, "torque_enable") == 0
    lab.run(0.5)
    assert lab.register(6, "torque_enable") == 0
    assert lab.number("motor6.load") == 0
    lab.say("motor6.load = 1;", 0.1)
    assert lab.register(6, "torque_enable") == 1


def test_load_1_holds_where_the_motor_is_and_ends_an_alarm(lab: Lab) -> None:
    lab.say("motor6.val = 60deg;", 1)
    lab.say("motor6.load = 0;", 0.1)
    servo = lab.kit.servo(6)
    servo.load = -0.5
    lab.run(0.3)
    servo.load = 0.0
    servo.registers.put("torque_limit", 0)
    lab.run(0.3)
    before = lab.number("motor6.val")
    assert before < math.radians(50)
    lab.say("motor6.load = 1;", 0.5)
    assert lab.register(6, "torque_limit") == 1023
    assert lab.number("motor6.load") == 1
    assert lab.number("motor6.val") == pytest.approx(before, abs=0.03)


def test_torque_is_in_newton_metres(lab: Lab) -> None:
    lab.say("motor6.val = 0;", 0.5)
    lab.kit.servo(6).load = 0.2
    lab.run(0.5)
    assert lab.number("motor6.torque") == pytest.approx(-0.2 * 1.5, abs=0.1)
    assert lab.number("motor6.torqueLimit") == pytest.approx(1.5)
    lab.say("motor6.torqueLimit = 0.75;", 0.05)
    assert lab.register(6, "torque_limit") == round(1023 / 2)


def test_settings_reach_their_registers(lab: Lab) -> None:
    lab.say("motor6.led = true | motor6.cwComplianceSlope = 64 | motor6.ccwComplianceMargin = 2deg;", 0.05)
    assert lab.register(6, "led") == 1
    assert lab.register(6, "cw_slope") == 64
    assert lab.register(6, "ccw_margin") == 7
    lab.run(1.2)
    assert lab.number("motor6.led") == 1
    assert lab.number("motor6.ccwComplianceMargin") == pytest.approx(math.radians(2), abs=0.003)


def test_what_wears_out_is_written_only_when_it_changes(lab: Lab) -> None:
    lab.sent(m.Request)
    lab.say("motor6.temperatureLimit = 70; motor6.maxTorque = 1.5; motor6.ccwLimit = motor6.ccwLimit;", 0.1)
    assert lab.sent(m.Request) == []
    lab.say("motor6.temperatureLimit = 65;", 0.1)
    assert lab.register(6, "temperature_limit") == 65
    assert lab.number("motor6.temperatureLimit") == 65


def test_a_round_is_one_message(lab: Lab) -> None:
    lab.sent(m.Targets)
    lab.say("for| (var m : motors) m.val = 0.1;", 0.02)
    (targets,) = lab.sent(m.Targets)
    assert {number for number, _ in targets.values} == {5, 6, 7}


def test_changed_fires_with_the_measured_value(lab: Lab) -> None:
    lab.say('var n = 0| at (motor6.val->changed?) n++; motor6.val = 20deg;', 1)
    assert float(lab.say("n;")) > 5


def test_other_readings(lab: Lab) -> None:
    answers = lab.say("motor6.voltage; motor6.id; motor6.model; motor6.modelName; motor6.state; motor6.stale;")
    assert answers.splitlines() == ["12", "6", "12", '"AX-12A"', '"ok"', "false"]
    assert lab.number("motor6.temperature") == pytest.approx(32, abs=1)
    assert lab.number("motor6.age") <= 0.02
    assert lab.say("motor6.moving;") == "false"
    lab.say("motor6.speed = 1 | motor6.val = 90deg;", 0.3)
    assert lab.say("motor6.moving;") == "true"


def test_each_value_knows_its_age(lab: Lab) -> None:
    lab.run(2)
    assert lab.number('motor6.getSlot("val").age') <= 0.02
    assert 0.02 < lab.number('motor6.getSlot("voltage").age') <= 1.02


def test_alarm_says_what_is_wrong(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.kit.servo(6).heat(80)
    lab.run(0.2)
    assert lab.say("motor6.alarm;") == '"overheating"'
    assert "motor 6: overheating" in caplog.text


def test_a_refused_write_is_told(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.say("at (bioloid.refused?(var d, var slot, var why)) echo(slot);")
    lab.kit.faults.start("silence", 6)
    assert lab.say("motor6.torqueLimit = 1;", 0.2).splitlines()[-1] == "*** torqueLimit"
    assert "motor 6: torqueLimit not written" in caplog.text


SETTINGS = [
    ("led", "1", "1"),
    ("returnDelay", "0.0004", "0.0004"),
    ("torqueLimit", "0.75", "0.750733"),
    ("maxTorque", "0.75", "0.750733"),
    ("cwComplianceSlope", "64", "64"),
    ("temperatureLimit", "60", "60"),
    ("cwLimit", "-1", "-1"),
    ("ccwLimit", "1", "1"),
    ("load", "1", "1"),
]


@pytest.mark.parametrize(("slot", "written", "read"), SETTINGS)
def test_a_setting_reads_back_at_once_as_wanted(lab: Lab, slot: str, written: str, read: str) -> None:
    lab.say(f"var Global.seen = []; at (motor6.{slot}->changed?) seen << motor6.{slot};")
    assert lab.say(f"motor6.{slot} = {written}; motor6.{slot};").splitlines()[-1] == read
    lab.run(2.0)
    assert lab.number(f"motor6.{slot}") == pytest.approx(float(read), abs=0.003)
    # A reading that was made before the write never shows.
    changes = lab.say("seen;").strip("[]").split(", ")
    assert [float(value) for value in changes] == pytest.approx([float(read)] * len(changes), abs=0.003)


def test_a_setting_that_is_not_executed_reads_as_it_was(lab: Lab) -> None:
    lab.kit.faults.start("silence", 6)
    lab.say("motor6.temperatureLimit = 55; motor6.cwLimit = -1; motor6.load = 1;")
    assert lab.say("motor6.temperatureLimit;") == "55"
    lab.run(2.0)
    assert lab.number("motor6.temperatureLimit") == 70
    assert lab.number("motor6.cwLimit") == pytest.approx(-2.618, abs=0.01)
    assert lab.number("motor6.load") == 0
    assert lab.number("motor6.age") > 1.5
