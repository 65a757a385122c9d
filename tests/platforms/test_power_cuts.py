"""A servo without power for some hundredths of a second: it answers again at once, and has forgotten what was written.

Its speed on the way to a goal is that of a start then, the full one. The horns of simulated servos tell how fast.
"""

from __future__ import annotations

import pytest
from test_bounded_by_body import CHAINS, GRAIN, MARGIN, Chain

from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.feetech.servo import FeetechServo

_KINDS = (*CHAINS, "XL-320:6")


def _cut(lab: Chain, seconds: float) -> None:
    """All servos are without power for so long."""
    lab.kit.power_off(lab.bus_clock.now())
    lab.run(seconds)
    lab.kit.power_on(lab.bus_clock.now())


def _has_torque(lab: Chain, number: int) -> int:
    return lab.register(number, "torque" if isinstance(lab.kit[number], FeetechServo) else "torque_enable")


@pytest.mark.parametrize("chain", _KINDS)
@pytest.mark.parametrize(
    ("seconds", "go"), [(0.02, "motor#.val = -0.3|;"), (0.05, ""), (0.1, "motor#.val = 0.4 sin:4s ampli:0.6,")],
    ids=["moving", "standing", "swing"],
)  # fmt: skip
def test_a_servo_that_was_without_power_for_a_moment_is_no_faster_than_its_speed(
    chain: str, seconds: float, go: str
) -> None:
    lab = Chain.ready(chain)
    lab.say_all("motor#.load = 1|; motor#.speed = 1|;", 0.5)
    lab.say_all("motor#.val = 0.6|;", 1.2)
    if go:
        lab.say_all(go, 0.4)
        assert min(lab.fastest(0.2).values()) > 0.5
    _cut(lab, seconds)
    most = lab.fastest(0.6)
    lab.say_all("motor#.load = 1|;", 0.1)
    assert all(_has_torque(lab, number) for number in lab.numbers)
    lab.say_all("motor#.val = -1|;")
    most = {number: max(speed, most[number]) for number, speed in lab.fastest(1.5).items()}
    assert all(0.5 < speed <= MARGIN + GRAIN for speed in most.values()), most


def test_a_goal_that_is_written_at_the_end_of_a_power_cut_waits_for_the_registers() -> None:
    """The answer that was missing tells that something was wrong, before the first new reading of a register does."""
    lab = Chain.ready("AX-12:1")
    lab.say("motor1.load = 1|; motor1.speed = 1|;", 0.5)
    lab.kit.power_off(lab.bus_clock.now())
    lab.step()
    lab.step()
    lab.kit.power_on(lab.bus_clock.now())
    before = lab.place(1)
    lab.say("motor1.val = 1|;")
    for _ in range(3):
        lab.step()
        assert abs(lab.place(1) - before) < 0.01
    most = lab.fastest(0.5)[1]
    assert most <= MARGIN + GRAIN
    lab.say("motor1.val = 1|;", 1.5)
    assert abs(lab.place(1) - 1) < 0.03


def test_what_bounds_a_motion_is_given_back_after_a_power_cut() -> None:
    lab = Chain.ready("AX-12:1,XL330-M288:3")
    lab.say("motor1.torqueLimit = 0.5|; motor3.acceleration = 3|; motor3.goalPwm = 0.2|; motor3.pGain = 300|;", 0.5)

    def bounds() -> list[int]:
        named = (1, "torque_limit"), (3, "profile_acceleration"), (3, "goal_pwm"), (3, "position_p")
        return [lab.register(*each) for each in named]

    before = bounds()
    _cut(lab, 0.03)
    assert not set(bounds()) & set(before)
    # The interpreter does nothing meanwhile: the worker itself writes them.
    lab.stand_still(0.4)
    assert bounds() == before


def test_a_torque_that_an_alarm_takes_is_not_given_back_as_after_a_power_cut() -> None:
    """It stays off, and the servo is not lost: its registers are what they were."""
    lab = Chain.ready("XL330-M288:3")
    lab.say("motor3.load = 1|; motor3.speed = 1|; motor3.val = 1|;", 0.5)
    servo = lab.kit[3]
    assert isinstance(servo, XSeries)
    servo.overload()
    lab.run(1.0)
    assert lab.look("motor3.state") == '"alarm"'
    assert not _has_torque(lab, 3)


def test_a_servo_that_changes_its_mode_keeps_its_settings_and_has_not_started_anew() -> None:
    """It resets them by itself, as at a start; the worker itself writes them again."""
    lab = Chain.ready("XL330-M288:3")
    lab.say("motor3.speed = 1|; motor3.acceleration = 3|; motor3.goalPwm = 0.4|; motor3.pGain = 300|;", 0.5)
    names = "profile_velocity", "profile_acceleration", "goal_pwm", "position_p"
    before = [lab.register(3, name) for name in names]
    heard = lab.say('at (motor3.lost?) echo("it is lost");')
    for mode in ("velocity", "position"):
        heard += lab.say(f'motor3.load = 0|; motor3.mode = "{mode}"|; motor3.load = 1|;', 0.5)
        assert [lab.register(3, name) for name in names] == before
        assert lab.look("motor3.mode") == f'"{mode}"'
    assert not heard


def test_the_force_of_another_mode_is_written_anew_in_this_one() -> None:
    """What the register held as the goal of that mode, the servo has reset."""
    lab = Chain.ready("XL330-M288:3")
    lab.say('motor3.mode = "pwm"|; motor3.load = 1|; motor3.goalPwm = 0.2|;', 0.3)
    weak = lab.register(3, "goal_pwm")
    lab.say('motor3.load = 0|; motor3.mode = "position"|;', 0.3)
    assert lab.register(3, "goal_pwm") > weak
    lab.say("motor3.goalPwm = 0.2|;", 0.3)
    assert lab.register(3, "goal_pwm") == weak
