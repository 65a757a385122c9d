"""Raw registers: what the body does under limits when programs write the registers of a servo by name."""

from __future__ import annotations

import math

import pytest
from chain_lab import Lab

from urbihw.buses import messages as m

LIMITS = {"speed": 0.5, "position": [-0.5, 0.5]}
SPEED = 0.6
"""rad/s: what a speed limit of 0.5 allows, with the noise of a start."""
PLACE = 0.55


def chain(servos: str, **limits: object) -> Lab:
    """A chain whose servos all have the limits."""
    return Lab.ready(servos, limits=limits or LIMITS)


def extremes(lab: Lab, unit: int, seconds: float) -> tuple[float, float]:
    """Return the largest speed and distance from the middle of a horn over some time: rad/s, rad."""
    speed = place = 0.0
    for _ in range(round(seconds / lab.tick)):
        lab.step()
        speed, place = max(speed, abs(lab.pace(unit))), max(place, abs(lab.place(unit)))
    return speed, place


def stays(lab: Lab, unit: int, seconds: float = 2.0, place: float = PLACE) -> None:
    """Assert that a horn keeps the limits for some time."""
    fastest, farthest = extremes(lab, unit, seconds)
    assert fastest < SPEED
    assert farthest < place


@pytest.mark.parametrize("name, raw", [("id", 9), ("id", 2), ("baud_rate", 34), ("status_return_level", 0)])
def test_a_turning_servo_stays_on_the_line_and_stops(name: str, raw: int) -> None:
    lab = Lab.ready("AX-12:1,AX-12:2")
    lab.say("motor1.cwLimit = motor1.ccwLimit = 0|; sleep(0.3s); motor1.speed = 3|;", 1.0)
    assert lab.pace(1) > 1
    assert f"{name} would take the servo off the line" in lab.say(f'motor1.writeRegister("{name}", {raw});', 0.5)
    lab.say("robot.stop;", 0.5)
    assert lab.pace(1) == 0


@pytest.mark.parametrize("name, raw", [("secondary_id", 7), ("protocol_type", 1), ("baud_rate", 2), ("id", 9)])
def test_an_x_servo_without_torque_is_not_taken_off_the_line_either(name: str, raw: int) -> None:
    lab = Lab.ready("XL330-M288:3")
    lab.say("motor3.load = 0;", 0.3)
    assert "use urbihw servo" in lab.say(f'motor3.writeRegister("{name}", {raw});', 0.5)
    assert "motor3" in lab.look("motors")


def test_raw_angle_limits_make_no_wheel_of_a_limited_joint() -> None:
    lab = chain("AX-12:1")
    lab.say('motor1.val = 0|; sleep(0.5s); motor1.writeRegister("moving_speed", 1023)|;', 1.0)
    lab.say('motor1.writeRegister("cw_angle_limit", 0)|;')
    told = lab.say('motor1.writeRegister("ccw_angle_limit", 0);', 0.2)
    assert "would change the mode while limits.speed holds" in told or "while limits.position holds" in told
    stays(lab, 1)


@pytest.mark.parametrize("model", ["XL330-M288", "XM430-W350"])
@pytest.mark.parametrize("raw", [1, 5])
def test_a_joint_is_not_reversed_while_only_its_speed_is_limited(model: str, raw: int) -> None:
    """Its count jumped by a turn, and it ran there at 8 to 10 rad/s."""
    lab = chain(f"{model}:1", speed=1.0)
    lab.say("motor1.load = 0|; sleep(0.3s);", 0.5)
    assert "while limits.speed holds" in lab.say(f'motor1.writeRegister("drive_mode", {raw});', 0.5)
    lab.say("motor1.load = 1|; motor1.val = 0.5|;")
    fastest, _ = extremes(lab, 1, 2.0)
    assert fastest < 1.1
    assert lab.place(1) == pytest.approx(0.5, abs=0.02)


def test_a_limited_wheel_stays_within_its_speed_with_raw_speeds_and_is_made_no_joint() -> None:
    lab = chain("AX-12:1", speed=0.5)
    lab.say("motor1.cwLimit = motor1.ccwLimit = 0|; sleep(0.3s);", 0.5)
    for raw in (1023, 2047):
        lab.say(f'motor1.writeRegister("moving_speed", {raw})|;', 0.1)
        stays(lab, 1, place=9.0)
    lab.say('motor1.writeRegister("goal_position", 1023)|;', 0.1)
    assert "would change the mode" in lab.say('motor1.writeRegister("ccw_angle_limit", 1023);', 0.1)
    stays(lab, 1, place=9.0)


@pytest.mark.parametrize(
    "servo, register, wheel",
    [
        ("AX-12", "moving_speed", "wheel"),
        ("XL330-M288", "goal_velocity", "velocity"),
        ("STS3215", "moving_speed", "wheel"),
    ],
)
def test_a_raw_speed_right_behind_a_change_of_mode_is_limited(servo: str, register: str, wheel: str) -> None:
    lab = chain(f"{servo}:1", speed=0.5)
    lab.say("motor1.load = 1;", 0.5)
    lab.kernel.feed(lab.lobby, f'motor1.mode = "{wheel}"; motor1.writeRegister("{register}", 400),'.encode())
    lab.say(f'motor1.writeRegister("{register}", 401),', 0.0)
    stays(lab, 1, place=9.0)
    for _ in range(10):
        lab.say(f'motor1.writeRegister("{register}", 402),', 0.02)
    stays(lab, 1, place=9.0)


@pytest.mark.parametrize("servo, raw", [("XL330-M288", 2300), ("AX-12", 600), ("STS3215", 2300)])
def test_a_raw_goal_is_reached_at_the_speed_that_is_allowed_and_not_beyond_the_place(servo: str, raw: int) -> None:
    lab = chain(f"{servo}:1")
    lab.say("motor1.load = 1|; motor1.val = 0.2;", 1.5)
    lab.say("motor1.val = -0.4;", 2.5)
    lab.say(f'motor1.writeRegister("goal_position", {raw}),')
    stays(lab, 1)
    assert lab.place(1) > 0.2
    lab.say('motor1.writeRegister("goal_position", 1000),')
    stays(lab, 1)


def test_a_raw_profile_does_not_make_it_faster() -> None:
    lab = chain("XL330-M288:3")
    lab.say("motor3.load = 1|; motor3.val = -0.4;", 2.0)
    lab.say('motor3.writeRegister("profile_velocity", 0),', 0.2)
    lab.say("motor3.val = 0.4,")
    stays(lab, 3)


def test_step_mode_cannot_keep_limits(caplog: pytest.LogCaptureFixture) -> None:
    lab = chain("STS3215:1")
    lab.say("motor1.load = 1|; motor1.val = 0.1;", 1.0)
    lab.say('motor1.mode = "step";', 0.5)
    assert 'cannot be kept in the mode "step"' in caplog.text
    for _ in range(3):
        lab.say('motor1.writeRegister("goal_position", 1800),')
    stays(lab, 1)


def test_a_servo_found_in_step_mode_takes_no_raw_goals_under_a_limit() -> None:
    lab = Lab("STS3215:1", limits=LIMITS)
    unit = lab.kit[1]
    unit.registers.put("mode", 3)
    unit.registers.put("torque", 1)
    lab.run(1.0)
    assert lab.look("motor1.mode") == '"step"'
    told = [lab.say('motor1.writeRegister("goal_position", 1800);', 0.3) for _ in range(3)]
    assert 'in the mode "step" nothing keeps it within limits' in told[-1]
    stays(lab, 1)


@pytest.mark.parametrize("mode, slot", [("pwm", "goalPwm"), ("current", "goalCurrent")])
def test_modes_without_a_place_or_a_speed_are_refused_under_a_limit(
    mode: str, slot: str, caplog: pytest.LogCaptureFixture
) -> None:
    lab = chain("XL330-M288:3")
    lab.say("motor3.load = 1|; motor3.val = 0.1;", 1.0)
    lab.say(f'motor3.mode = "{mode}";', 0.5)
    assert f'cannot be kept in the mode "{mode}"' in caplog.text
    assert lab.look("motor3.mode") == '"position"'
    lab.say(f"motor3.{slot} = 0.5,")
    stays(lab, 3)


def test_a_servo_found_in_pwm_mode_is_not_driven_under_a_limit(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab("XL330-M288:3", limits=LIMITS)
    lab.kit[3].registers.put("operating_mode", 16)
    lab.run(1.0)
    assert lab.look("motor3.mode") == '"pwm"'
    lab.say("motor3.load = 1,", 0.3)
    lab.say("motor3.goalPwm = 1;", 0.5)
    assert 'in the mode "pwm" nothing keeps it within limits' in caplog.text
    stays(lab, 3)
    lab.say('motor3.load = 0|; sleep(0.3s); motor3.writeRegister("goal_pwm", 800),')
    lab.say('motor3.writeRegister("torque_enable", 1),')
    stays(lab, 3)


def test_a_joint_that_was_elsewhere_begins_where_it_is() -> None:
    lab = chain("XL330-M288:3")
    lab.say("motor3.load = 1|; motor3.val = -0.2;", 2.0)
    lab.say('motor3.load = 0|; motor3.mode = "velocity"|; sleep(0.3s); motor3.load = 1|; motor3.speed = 5,', 3.0)
    lab.say('motor3.speed = 0|; motor3.mode = "position"|; sleep(0.3s);', 1.0)
    lab.say("motor3.load = 1;", 1.0)
    assert lab.place(3) > 0.5
    lab.say("motor3.val = 0.4,")
    assert extremes(lab, 3, 3.0)[0] < SPEED
    assert lab.place(3) == pytest.approx(0.4, abs=0.05)


class Impatient(Lab):
    """A chain whose master asks for a stop while the bus is searched."""

    searched = 0

    def _receive(self, data: bytes, at: float) -> None:
        if self.worker is not None and not any(unit.powered for unit in self.kit):
            self.searched += 1
            if self.searched % 100 == 0:
                self.worker.send(m.Stop(self.searched))
        super()._receive(data, at)


def test_a_stop_ends_the_search_of_an_empty_chain_which_is_made_again_later() -> None:
    lab = Impatient("AX-12:1,AX-12:2")
    for unit in lab.kit:
        unit.powered = False
    lab.run(8.0)
    assert lab.searched > 300, "it was searched several times"
    for unit in lab.kit:
        unit.powered = True
    lab.run(8.0)
    assert lab.look("motors") == "Group [motor1, motor2]"


def test_a_raw_goal_on_its_way_is_ended_by_a_stop_and_by_the_end_of_its_connection() -> None:
    lab = chain("XL330-M288:3")
    other = lab.kernel.open_lobby()
    lab.say("motor3.load = 1|; motor3.val = -0.4;", 2.5)
    lab.kernel.feed(other, b'motor3.writeRegister("goal_position", 2300),')
    lab.run(0.6)
    assert lab.pace(3) == pytest.approx(0.5, abs=0.1)
    lab.say("robot.stop;", 0.3)
    assert lab.pace(3) == pytest.approx(0, abs=0.01)
    lab.kernel.feed(other, b'motor3.writeRegister("goal_position", 2300),')
    lab.run(0.6)
    assert lab.pace(3) == pytest.approx(0.5, abs=0.1)
    other.close()
    lab.run(0.3)
    assert lab.pace(3) == pytest.approx(0, abs=0.01)
    assert lab.place(3) < 0.3


def test_a_raw_speed_of_a_wheel_keeps_the_limit_of_its_acceleration() -> None:
    lab = chain("XL330-M288:3", speed=2.0, acceleration=1.0)
    lab.say('motor3.mode = "velocity"|; sleep(0.3s); motor3.load = 1;', 0.6)
    lab.say('motor3.writeRegister("goal_velocity", 80),')
    assert extremes(lab, 3, 0.5)[0] < 0.6
    assert extremes(lab, 3, 2.0)[0] == pytest.approx(80 * 0.229 * math.tau / 60, abs=0.1)


def test_registers_that_say_what_a_position_is_stay_under_a_limit_of_the_position() -> None:
    lab = chain("XL330-M288:3", position=[-0.5, 0.5])
    lab.say("motor3.load = 0;", 0.3)
    assert "changes what a position is" in lab.say('motor3.writeRegister("homing_offset", 1000);', 0.3)
    free = Lab.ready("XL330-M288:3")
    free.say("motor3.load = 0;", 0.3)
    assert free.say('motor3.writeRegister("homing_offset", 1000) | 7;', 0.3) == "7"


@pytest.mark.parametrize("servo", ["AX-12", "STS3215"])
def test_raw_torque_does_not_send_a_limp_joint_to_an_old_goal(servo: str) -> None:
    lab = chain(f"{servo}:1")
    lab.say("motor1.load = 1|; motor1.val = -0.4;", 2.5)
    lab.say("motor1.load = 0;", 0.5)
    assert "use load = 1" in lab.say('motor1.writeRegister("torque_enable", 1);', 0.5)
    stays(lab, 1)
    assert lab.look("motor1.load") == "0"


def test_a_place_without_a_name_is_not_written_under_a_limit() -> None:
    lab = chain("AX-12:1")
    assert "what @45:1 moves is unknown" in lab.say('motor1.writeRegister("@45:1", 1);', 0.3)
