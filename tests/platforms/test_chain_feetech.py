"""Feetech servos on a chain: both byte orders on one wire, their modes, and models without a table."""

from __future__ import annotations

import pytest
from so101_lab import STEP
from so101_lab import Lab as Wire

from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo


class Lab(Wire):
    """A chain of Feetech servos."""

    platform = "chain"

    def servo(self, number: int) -> FeetechServo:
        """A servo of the fake, now."""
        self.bus.tick(self.bus_clock.now())
        assert isinstance(self.bus, FeetechBus)
        return self.bus.servo(number)


def _chain() -> Lab:
    servos = [FeetechServo("STS3215", 1), FeetechServo("SCS0009", 7, position=512), FeetechServo("SCS15", 8)]
    return Lab.ready(FeetechBus(servos))


def test_both_byte_orders_move_to_a_place_in_rad() -> None:
    lab = _chain()
    assert lab.look("motors") == "Group [motor1, motor7]"
    lab.say("motor1.val = 0.5; motor7.val = 0.5;", 1.5)
    assert lab.servo(1).motor.angle == pytest.approx(2048 + 0.5 / STEP, abs=2)
    # 300 degrees in 1024 steps.
    assert lab.servo(7).motor.angle == pytest.approx(512 + 0.5 / 0.0051133, abs=3)
    assert lab.number("motor7.val") == pytest.approx(0.5, abs=0.015)


def test_a_model_without_a_table_has_its_first_registers_only() -> None:
    lab = _chain()
    assert lab.look("device8.model") == "1540"
    lab.say("motors.load = 1;", 0.5)
    assert lab.servo(8).registers.get("torque") == 0
    lab.say("motors.load = 0;", 0.5)
    assert lab.say('device8.readRegister("end");', 0.3) == "1"


def test_the_drive_of_pwm_mode_is_gone_in_the_next_mode() -> None:
    lab = _chain()
    lab.say('motor1.mode = "pwm";', 0.5)
    lab.say("motor1.goalPwm = 0.3;", 0.5)
    assert lab.servo(1).motor.drive == pytest.approx(0.3)
    lab.say('motor1.mode = "position";', 0.5)
    assert lab.servo(1).registers.get("goal_pwm") == 0, "in position mode the register is a time"
    assert lab.servo(1).motor.speed == 0


def test_a_wheel_and_a_servo_of_many_turns() -> None:
    lab = _chain()
    lab.say('motor1.mode = "wheel";', 0.5)
    lab.say("motor1.speed = -1;", 1.0)
    assert lab.servo(1).motor.speed * STEP == pytest.approx(-1, abs=0.01)
    lab.say("chain.stop;", 0.3)
    assert lab.servo(1).motor.speed == 0
    lab.say('motor1.mode = "multi-turn";', 0.5)
    assert [lab.servo(1).registers.kept[name] for name in ("mode", "min_angle", "max_angle")] == [0, 0, 0]


def test_a_servo_in_step_mode_is_not_moved_by_a_stop() -> None:
    servo = FeetechServo("STS3215", 1)
    servo.registers.put("mode", 3)
    servo.registers.put("torque", 1)
    lab = Lab.ready(FeetechBus([servo]))
    assert lab.look("motor1.mode") == '"step"'
    lab.say('motor1.writeRegister("goal_position", 300)|;', 1.0)
    assert lab.servo(1).motor.angle == pytest.approx(2348, abs=2)
    lab.say("chain.stop;", 1.0)
    assert lab.servo(1).motor.angle == pytest.approx(2348, abs=2)


def test_a_register_of_the_eeprom_is_kept() -> None:
    lab = _chain()
    lab.say('motor1.writeRegister("overload_torque", 40)|;', 0.5)
    assert lab.servo(1).registers.kept["overload_torque"] == 40
    assert lab.servo(1).registers.get("lock") == 1
    lab.say("motor1.load = 1;", 0.5)
    told = lab.say('motor1.writeRegister("overload_torque", 50);', 0.5)
    assert "overload_torque of servo 1 can only be written while its torque is off" in told
