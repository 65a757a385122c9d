"""Servos of all families on a chain: each moves, turns, stops and holds by the slots that its table gives it."""

from __future__ import annotations

import pytest
from chain_lab import Lab

from urbihw.kernel.uobject import RobotSettings

JOINTS = [
    "AX-12", "RX-28", "RX-64", "EX-106+", "MX-12W", "MX-28", "MX-64", "MX-106", "XL-320", "XL330-M288", "XL430-W250",
    "XM430-W350", "PH54-200-S500-R", "H54-200-S500-R", "YM070-210-R099-RH", "STS3215", "SCS0009",
]  # fmt: skip
WHEELS = [model for model in JOINTS if model not in ("SCS0009",)]
OPEN_LOOP = ("AX-12", "RX-28", "RX-64", "EX-106+", "XL-320")
"""Wheels without control of their speed: a share of the drive, and what that gives depends on the voltage."""
SHARE = 0.25
EFFORTS = ["XL330-M288", "XM430-W350", "PH54-200-S500-R", "STS3215", "SCS0009"]
"""Servos with a mode in which a PWM drives them."""


@pytest.mark.parametrize("model", JOINTS)
def test_a_joint_moves_to_its_goal_and_starting_moves_nothing(model: str) -> None:
    lab = Lab.ready(f"{model}:1")
    start = lab.place(1)
    lab.run(0.5)
    assert lab.place(1) == start
    lab.say("motor1.val = 0.5;", 3)
    assert lab.number("motor1.val") == pytest.approx(0.5, abs=0.02)
    assert lab.place(1) == pytest.approx(0.5, abs=0.02)
    assert lab.number("motor1.load") == 1


@pytest.mark.parametrize("model", WHEELS)
def test_a_wheel_turns_both_ways_stops_and_is_a_joint_again(model: str) -> None:
    lab = Lab.ready(f"{model}:1")
    lab.say('motor1.mode = "velocity"; motor1.speed = 1;', 1.5)
    assert lab.look("motor1.wheel") == "true"
    assert lab.pace(1) == pytest.approx(1, abs=SHARE if model in OPEN_LOOP else 0.05)
    assert lab.number("motor1.speed") == pytest.approx(1, abs=0.15 if model in OPEN_LOOP else 0.05)
    lab.say("motor1.speed = -1;", 1)
    assert lab.pace(1) == pytest.approx(-1, abs=SHARE if model in OPEN_LOOP else 0.05)
    lab.say("robot.stop;", 0.5)
    assert lab.pace(1) == 0
    lab.say('motor1.mode = "position";', 0.5)
    here = lab.place(1)
    lab.run(1)
    assert lab.place(1) == pytest.approx(here, abs=0.02), "it holds where it is"
    assert lab.look("motor1.wheel") == "false"


@pytest.mark.parametrize("model", EFFORTS)
def test_a_pwm_drives_it_and_is_gone_when_it_is_a_joint_again(model: str) -> None:
    lab = Lab.ready(f"{model}:1")
    lab.say("motor1.val = 0;", 1)
    lab.say('motor1.mode = "pwm";', 0.5)
    assert lab.pace(1) == 0
    lab.say("motor1.goalPwm = 0.3;", 0.5)
    assert lab.pace(1) > 0.1
    lab.say("motor1.goalPwm = 0;", 0.5)
    assert lab.pace(1) == 0
    lab.say('motor1.mode = "position";', 0.5)
    here = lab.number("motor1.val")
    lab.say(f"motor1.val = {here} - 0.2;", 2)
    assert lab.number("motor1.val") == pytest.approx(here - 0.2, abs=0.02)


def test_all_dynamixel_families_share_a_chain() -> None:
    models = [model for model in JOINTS if not model.startswith(("STS", "SCS"))]
    lab = Lab.ready(",".join(f"{model}:{number}" for number, model in enumerate(models, 1)))
    assert lab.number("motors.size") == len(models)
    lab.say("motors.val = 0.3;", 3)
    assert [lab.place(number) for number in range(1, len(models) + 1)] == pytest.approx([0.3] * len(models), abs=0.02)


def test_sts_and_scs_share_a_chain() -> None:
    lab = Lab.ready("STS3215:1,SCS0009:7")
    lab.say("motors.val = 0.3;", 2)
    assert (lab.place(1), lab.place(7)) == pytest.approx((0.3, 0.3), abs=0.02)


@pytest.mark.parametrize("model", ["STS3215", "SCS0009"])
def test_a_write_that_waits_for_a_switch_and_does_not_fit_the_mode_is_told_to_its_writer(model: str) -> None:
    lab = Lab.ready(f"{model}:1")
    lab.say("motor1.load = 1;", 0.5)
    heard = lab.say("motor1.cwLimit = -1; motor1.goalPwm = 0.1;", 1)
    assert "goalPwm of motor 1 not written: it is for the mode pwm: set mode first" in heard
    assert lab.place(1) == pytest.approx(lab.number("motor1.val"), abs=0.02)


TORQUE_LIMITS = dict.fromkeys(("AX-12", "MX-28", "STS3215"), "torque_limit")
TORQUE_LIMITS |= dict.fromkeys(("XL330-M288", "XL430-W250", "XM430-W350", "PH54-200-S500-R"), "goal_pwm")
"""A model of each family with a torque limit, and its register."""


@pytest.mark.parametrize("model", TORQUE_LIMITS)
def test_the_torque_limit_of_the_settings_and_of_a_program_reaches_the_servo(model: str) -> None:
    lab = Lab.ready(f"{model}:1", limits={"torque": 0.3})
    before = Lab.ready(f"{model}:1").register(1, TORQUE_LIMITS[model])
    lab.run(0.5)
    limited = lab.register(1, TORQUE_LIMITS[model])
    assert limited not in (0, before)
    lab.say("motor1.torqueLimit = 0.15;", 1)
    assert 0 < lab.register(1, TORQUE_LIMITS[model]) < limited


def test_what_a_client_cannot_set_under_an_emergency_stop_is_refused_to_it() -> None:
    lab = Lab.ready("XL330-M288:1")
    before = lab.register(1, "goal_pwm")
    lab.look("chain.estop = true")
    assert "release it first" in lab.say("motor1.torqueLimit = 0.1;", 1)
    assert lab.register(1, "goal_pwm") == before


@pytest.mark.parametrize("model", TORQUE_LIMITS)
def test_a_torque_limit_that_is_reloaded_under_an_emergency_stop_holds_from_the_release_on(model: str) -> None:
    lab = Lab.ready(f"{model}:1")
    before = lab.register(1, TORQUE_LIMITS[model])
    lab.look("chain.estop = true")
    lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, limits={"torque": 0.3}))
    lab.run(1.0)
    lab.look("chain.estop = false")
    lab.run(1.0)
    assert lab.register(1, TORQUE_LIMITS[model]) not in (0, before)
