"""A chain of mixed servos: modes, efforts, registers, down to the body of the fake."""

from __future__ import annotations

import math

import pytest
from chain_lab import Lab

X = "XL330-M288:3,XL330-M288:4"


@pytest.fixture
def lab() -> Lab:
    return Lab.ready("AX-12:1,XL330-M288:3,XL430-W250:5")


def test_servos_of_both_protocols_are_motors_with_the_slots_that_their_tables_have(lab: Lab) -> None:
    assert lab.say("motors.keys; motor1.modelName; motor3.modelName; motor5.modelName;") == (
        '[1, 3, 5]\n"AX-12A"\n"XL330-M288"\n"XL430-W250"'
    )
    has = 'var s = {0}.localSlotNames | ["punch" in s, "goalCurrent" in s, "goalPwm" in s, "pGain" in s];'
    assert lab.say(f"{{ {has.format('motor1')} }};") == "[true, false, false, false]"
    assert lab.say(f"{{ {has.format('motor3')} }};") == "[false, true, true, true]"
    assert lab.say(f"{{ {has.format('motor5')} }};") == "[false, false, true, true]"


def test_starting_moves_nothing_and_switches_nothing_on(lab: Lab) -> None:
    lab.run(2)
    assert [lab.register(number, "torque_enable") for number in (1, 3, 5)] == [0, 0, 0]


def test_a_joint_moves_by_its_angle(lab: Lab) -> None:
    lab.say("motor1.val = motor3.val = motor5.val = 45deg;", 1.5)
    assert [lab.place(number) for number in (1, 3, 5)] == pytest.approx([math.pi / 4] * 3, abs=0.02)


# ---------------------------------------------------------------- modes


@pytest.mark.parametrize("motor", [1, 3, 5])
def test_velocity_turns_any_of_them(lab: Lab, motor: int) -> None:
    lab.say(f'motor{motor}.mode = "velocity"; motor{motor}.speed = 2;', 1)
    assert lab.look(f"motor{motor}.wheel") == "true"
    assert lab.pace(motor) == pytest.approx(2, abs=0.1)
    lab.say(f'motor{motor}.mode = "position";', 0.5)
    assert lab.pace(motor) == 0
    assert lab.look(f"motor{motor}.wheel") == "false"
    here = lab.place(motor)
    lab.run(1)
    assert lab.place(motor) == pytest.approx(here, abs=0.01)


def test_current_drives_it_and_zero_lets_it_stand(lab: Lab) -> None:
    lab.say("motor3.val = 0;", 0.5)
    lab.say('motor3.mode = "current";', 0.5)
    assert lab.pace(3) == 0, "after power on the goal of the current is its limit"
    lab.say("motor3.goalCurrent = 0.3;", 0.5)
    assert lab.pace(3) > 1
    assert lab.number("motor3.current") == pytest.approx(0.3, abs=0.3)
    lab.say("motor3.goalCurrent = 0;", 0.5)
    assert lab.pace(3) == 0


def test_a_servo_found_in_current_mode_after_power_on_does_not_run_away() -> None:
    lab = Lab(X)
    unit = lab.kit[3]
    unit.registers.put("operating_mode", 0)
    unit.registers.put("goal_current", unit.registers.get("current_limit"))
    lab.until(lambda: bool(lab.opened))
    lab.run(1.5)
    assert lab.look("motor3.mode") == '"current"'
    lab.say("motor3.load = 1;", 1)
    assert (lab.register(3, "torque_enable"), lab.pace(3)) == (1, 0)


def test_pwm_drives_it_and_its_limit_is_back_in_position_mode(lab: Lab) -> None:
    lab.say('motor5.mode = "pwm"; motor5.goalPwm = -0.2;', 0.5)
    assert lab.pace(5) < -0.5
    lab.say("motor5.goalPwm = 0;", 0.3)
    assert lab.pace(5) == 0
    lab.say('motor5.mode = "position"; motor5.val = 30deg;', 2)
    assert lab.register(5, "goal_pwm") == 885
    assert lab.place(5) == pytest.approx(math.pi / 6, abs=0.02)


def test_extended_position_goes_beyond_a_turn(lab: Lab) -> None:
    lab.say('motor3.mode = "extended"; motor3.val = 500deg;', 3)
    assert lab.look("motor3.mode") == '"extended position"'
    assert lab.place(3) == pytest.approx(math.radians(500), abs=0.02)
    assert lab.number("motor3.val") == pytest.approx(math.radians(500), abs=0.02)


def test_current_based_position_holds_with_the_current_that_was_set(lab: Lab) -> None:
    lab.say('motor3.mode = "current-based position"; motor3.goalCurrent = 0.5; motor3.val = 90deg;', 1.5)
    assert lab.register(3, "goal_current") == 500
    assert lab.place(3) == pytest.approx(math.pi / 2, abs=0.02)


def test_an_unknown_mode_is_an_error_with_those_there_are(lab: Lab) -> None:
    assert "no mode \"torque\"; there are: velocity, position, extended position, pwm" in lab.say(
        'motor5.mode = "torque";'
    ).replace("'", '"')
    assert "this slot takes the name of a mode" in lab.say("motor5.mode = 3;")


def test_a_stop_ends_a_drive_by_current(lab: Lab) -> None:
    lab.say('motor3.mode = "current"; motor3.goalCurrent = 0.3;', 0.5)
    lab.say("robot.stop;", 0.3)
    assert lab.pace(3) == 0
    lab.run(1)
    assert lab.pace(3) == 0


def test_a_value_written_behind_a_switch_that_a_stop_overtakes_does_not_move_it(lab: Lab) -> None:
    lab.say("motor3.val = 0;", 0.5)
    lab.say('motor3.mode = "current"; motor3.goalCurrent = 0.3;', 0)
    lab.look("robot.stop")
    lab.run(2)
    assert lab.pace(3) == 0


def test_the_torque_limit_is_no_drive_in_pwm_mode(lab: Lab) -> None:
    lab.say('motor5.mode = "pwm";', 0.5)
    assert "write goalPwm" in lab.say("motor5.torqueLimit = 1;", 0.3)
    assert lab.pace(5) == 0


def test_limits_hold_for_efforts() -> None:
    lab = Lab.ready(X, limits={"motor3": {"torque": 0.1}})
    lab.say('motor3.mode = "pwm"; motor3.goalPwm = 1;', 0.5)
    assert lab.register(3, "goal_pwm") == int(0.1 / 0.52 * 885)
    lab.say("motor3.goalPwm = -1;", 0.5)
    assert lab.register(3, "goal_pwm") == -int(0.1 / 0.52 * 885)


def test_gains_are_settings_that_a_returned_servo_gets_again(lab: Lab) -> None:
    lab.say("motor3.pGain = 700; motor3.feedForward1 = 20;", 0.5)
    assert (lab.register(3, "position_p"), lab.register(3, "feedforward_1")) == (700, 20)
    lab.kit.power_off(lab.bus_clock.now(), 3)
    lab.run(2)
    assert lab.look("motor3.state") == '"lost"'
    lab.kit.power_on(lab.bus_clock.now(), 3)
    lab.run(3)
    assert (lab.register(3, "position_p"), lab.register(3, "feedforward_1")) == (700, 20)


def test_an_effort_is_not_restored_as_a_drive(lab: Lab) -> None:
    lab.say('motor3.mode = "current-based position"; motor3.goalCurrent = 0.5;', 0.5)
    lab.say('motor3.mode = "current"; motor3.goalCurrent = 0.3;', 0.5)
    lab.kit.power_off(lab.bus_clock.now(), 3)
    lab.run(2)
    lab.kit.power_on(lab.bus_clock.now(), 3)
    lab.run(3)
    assert lab.pace(3) == 0


# ---------------------------------------------------------------- registers


def test_registers_are_read_and_written_by_name(lab: Lab) -> None:
    assert lab.say('motor3.readRegister("position_p_gain");', 0.1) == "400"
    lab.say('motor3.writeRegister("position_p_gain", 32);', 0.1)
    assert lab.register(3, "position_p") == 32
    lab.run(1.2)
    assert lab.number("motor3.pGain") == 32
    assert lab.say('motor3.writeRegister("position_p_gain", 500) | motor3.pGain;', 0.1) == "500"
    assert lab.look('"goal_current" in motor3.registers') == "true"


def test_a_register_can_be_named_by_its_place(lab: Lab) -> None:
    lab.kit[1].registers.put("led", 1)
    assert lab.say('motor3.readRegister("@86:1");', 0.1) == "0"


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ('motor3.readRegister("gain")', "XL330 has no item 'gain'"),
        ('motor3.writeRegister("present_position", 1)', "present_position can only be read"),
        ('motor3.writeRegister("led", 2)', "led takes 0..1, not 2"),
    ],
)
def test_a_wrong_register_is_an_error(lab: Lab, text: str, answer: str) -> None:
    assert answer in lab.say(f"{text};", 0.2)


def test_reading_a_register_holds_up_nobody_else(lab: Lab) -> None:
    lab.kit.power_off(lab.bus_clock.now(), 3)
    assert lab.say('{ motor3.readRegister("id"); echo("read") }, echo("at once");') == "*** at once"
    lab.run(1)
    answer = lab.heard()
    assert "readRegister" in answer and "*** read" not in answer


def test_a_goal_in_a_raw_register_obeys_limits_and_the_emergency_stop() -> None:
    lab = Lab.ready(X, limits={"motor3": {"position": [-0.5, 0.5]}})
    lab.say("motor3.val = 0;", 0.5)
    lab.say('motor3.writeRegister("goal_position", 4000);', 1)
    assert lab.place(3) == pytest.approx(0.5, abs=0.01)
    lab.look("chain.estop = true")
    lab.run(0.1)
    assert "emergency stop" in lab.say('motor3.writeRegister("goal_position", 2048);', 1)
    assert lab.place(3) == pytest.approx(0.5, abs=0.01)


def test_a_raw_goal_ends_with_the_connection_that_wrote_it(lab: Lab) -> None:
    lab.say("motor3.speed = 0.5; motor3.val = 0;", 0.5)
    other = lab.kernel.open_lobby()
    lab.kernel.feed(other, b'motor3.writeRegister("goal_position", 3500);')
    lab.run(0.5)
    assert lab.pace(3) == pytest.approx(0.5, abs=0.05)
    other.close()
    lab.run(0.3)
    assert lab.pace(3) == pytest.approx(0, abs=0.01)


def test_a_raw_write_that_began_before_a_stop_does_not_move(lab: Lab) -> None:
    lab.say("motor3.val = 0;", 0.5)
    lab.say('{ sleep(1s); motor3.writeRegister("goal_position", 3000) },', 0.2)
    lab.look("robot.stop")
    lab.run(2)
    assert "was stopped after this statement had begun" in lab.heard()
    assert lab.place(3) == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize("before", ["load = 1", "val = 0"])
def test_a_mode_written_behind_what_switches_it_on_is_selected(before: str) -> None:
    lab = Lab.ready("XL330-M288:1")
    answer = lab.say(f'motor1.{before}|; motor1.mode = "velocity"|; motor1.speed = 1|;', 1.5)
    assert (answer, lab.look("motor1.mode")) == ("", '"velocity"')
    assert lab.pace(1) == pytest.approx(1, abs=0.05)
