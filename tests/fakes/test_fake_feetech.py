"""Feetech servos: documented exchanges, registers, EEPROM, modes, alarms, calibration, sync read."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from fake_talk import Talk, packet1

from urbihw_fakes import captures
from urbihw_fakes.__main__ import robots
from urbihw_fakes.console import Console
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo
from urbihw_fakes.serving import Endpoint

PAGES = captures.read("feetech")


def _talk(*servos: FeetechServo) -> Talk:
    return Talk(FeetechBus(servos or (FeetechServo(),)))


def _bus(wire: Talk) -> FeetechBus:
    assert isinstance(wire.device, FeetechBus)
    return wire.device


def _hex(data: bytes) -> str:
    return data.hex(" ").upper()


def _play(wire: Talk, name: str) -> list[str]:
    return [answer for sent in PAGES[name].sent for answer in wire.raw(sent.hex())]


def _later(wire: Talk, seconds: float) -> None:
    wire.now += seconds
    wire.device.tick(wire.now)


# Documented bytes.


@pytest.mark.parametrize("name", ["ping", "sts-position", "sts-goal"])
def test_documented_exchanges(name: str) -> None:
    assert _play(_talk(), name) == [_hex(each) for each in PAGES[name].received]


def test_an_scs_servo_sends_the_high_byte_first() -> None:
    wire = _talk(FeetechServo("SCS0009", position=512))
    assert _play(wire, "scs-position") == [_hex(each) for each in PAGES["scs-position"].received]
    _play(wire, "scs-goal")
    servo = _bus(wire).servo(1)
    assert (servo.registers.get("goal_position"), servo.registers.get("goal_speed")) == (512, 300)
    _play(wire, "scs-unlock")
    assert servo.registers.get("lock") == 0


def test_all_values_in_one_read() -> None:
    servo = FeetechServo(position=2050)
    for name, value in (("speed", -120), ("load", -85), ("voltage", 74), ("temperature", 31), ("current", 40)):
        servo.pin_register(f"present_{name}", value)
    servo.pin_register("moving", 1)
    assert _play(_talk(servo), "sts-all") == [_hex(each) for each in PAGES["sts-all"].received]


def test_goal_with_acceleration_and_speed() -> None:
    wire = _talk()
    _play(wire, "sts-goal-all")
    get = _bus(wire).servo(1).registers.get
    assert [get(n) for n in ("acceleration", "goal_position", "goal_pwm", "goal_speed")] == [50, 2048, 0, 1000]
    _play(wire, "torque-on")
    assert get("torque") == 1
    _play(wire, "torque-off")
    assert get("torque") == 0
    _play(wire, "sts-offset")
    assert get("offset") == -100
    _play(wire, "sts-wheel")
    assert get("goal_speed") == -500


def test_overload_in_the_answer() -> None:
    servo = FeetechServo()
    servo.overload()
    assert _talk(servo).raw("FF FF 01 02 01 FB") == [_hex(PAGES["overload"].received[0])]


# Registers.


def test_the_number_of_a_model_is_where_a_dynamixel_has_its_id() -> None:
    wire = _talk(FeetechServo("STS3215", 1), FeetechServo("SCS0009", 7))
    assert wire.p1(1, "02 00 06") == "00 03 0A 00 09 03 01"
    assert wire.p1(7, "02 00 06") == "00 02 07 01 05 04 07"


def test_an_eeprom_write_is_kept_only_while_unlocked() -> None:
    wire = _talk()
    bus = wire.device
    wire.p1(1, "03 15 10")
    assert wire.p1(1, "02 15 01") == "00 10"
    bus.power_off(0.0)
    bus.power_on(0.0)
    assert wire.p1(1, "02 15 01") == "00 20"
    wire.p1(1, "03 37 00")
    wire.p1(1, "03 15 10")
    bus.power_off(0.0)
    bus.power_on(0.0)
    assert wire.p1(1, "02 15 01") == "00 10"
    assert wire.p1(1, "02 37 01") == "00 01", "locked at power-on"


def test_a_new_id_is_in_force_at_once() -> None:
    wire = _talk()
    assert _play(wire, "sts-new-id") == ["FF FF 01 02 00 FC", "FF FF 01 02 00 FC", "FF FF 05 02 00 F8"]
    assert wire.p1(1, "01") == ""
    assert _bus(wire)[5].id == 5


def test_speeds_by_the_codes_of_the_vendor() -> None:
    wire = _talk()
    wire.device.baud = 1_000_000
    assert wire.p1(1, "03 06 05") == "00"
    assert wire.p1(1, "01") == ""
    wire.device.baud = 76_800
    assert wire.p1(1, "01") == "00"
    servo = FeetechServo()
    servo.set_baud(57_600)
    assert servo.registers.get("baud") == 6
    with pytest.raises(UnknownRequest, match="speed 19200"):
        servo.set_baud(19_200)


def test_return_delay_and_response_level() -> None:
    wire = _talk()
    wire.device.pace(1_000_000)
    wire.p1(1, "03 07 FA")
    (answer,) = wire.device.feed(packet1(1, "01"), wire.now)
    assert answer.at == pytest.approx(60e-6 + 500e-6)
    wire.p1(1, "03 08 00")
    assert wire.p1(1, "03 28 01") == ""
    assert wire.p1(1, "02 28 01") == "00 01"


def test_a_damaged_or_unknown_request_is_not_answered() -> None:
    wire = _talk()
    assert wire.raw("FF FF 01 02 01 FA") == []
    assert wire.p1(1, "77") == ""


def test_a_value_out_of_range_changes_nothing_and_is_no_error() -> None:
    wire = _talk()
    assert wire.p1(1, "03 21 09") == "00"
    assert wire.p1(1, "02 21 01") == "00 00"
    assert wire.p1(1, "03 38 00 01") == "00", "read only"
    assert wire.p1(1, "02 38 02") == "00 00 08"


def test_reg_write_waits_for_action() -> None:
    wire = _talk()
    assert _play(wire, "reg-write")[0] == "FF FF 01 02 00 FC"
    assert _bus(wire).servo(1).registers.get("goal_speed") == 1000
    wire.p1(1, "04 2A 00 04")
    assert wire.p1(1, "02 40 01") == "00 01"
    assert wire.p1(1, "05") == "00"
    assert wire.p1(1, "02 2A 02") == "00 00 04"


def test_reset_restores_the_factory_values_and_keeps_the_id() -> None:
    wire = _talk(FeetechServo("STS3215", 3))
    wire.p1(3, "03 37 00")
    wire.p1(3, "03 15 10")
    wire.p1(3, "06")
    assert wire.p1(3, "02 15 01") == "00 20"


def test_two_servos_with_one_id_collide() -> None:
    wire = _talk(FeetechServo(), FeetechServo(position=1000))
    (answer,) = wire.raw("FF FF 01 04 02 38 02 BE")
    assert answer != "FF FF 01 04 00 00 08 F2"
    assert len(bytes.fromhex(answer)) == 9


# Group instructions.


def test_sync_read_is_answered_by_sts_in_order() -> None:
    wire = _talk(*(FeetechServo("STS3215", number) for number in range(1, 7)))
    answers = _play(wire, "sync-read")
    assert [answer[6:8] for answer in answers] == ["01", "02", "03", "04", "05", "06"]
    assert answers[0] == "FF FF 01 0A 00 00 08 00 00 00 00 4A 1E 84"


def test_sync_read_is_not_answered_by_scs() -> None:
    assert _play(_talk(FeetechServo("SCS0009", 1)), "sync-read") == []


def test_a_silent_servo_silences_those_behind_it_in_a_sync_read() -> None:
    wire = _talk(*(FeetechServo("STS3215", number) for number in range(1, 7)))
    wire.device.faults.start("silence", 3)
    assert [answer[6:8] for answer in _play(wire, "sync-read")] == ["01", "02"]
    _bus(wire).wait_for_predecessor = False
    assert [answer[6:8] for answer in _play(wire, "sync-read")] == ["01", "02", "04", "05", "06"]


def test_sync_write_and_both_byte_orders_on_one_wire() -> None:
    servos = [*(FeetechServo("STS3215", number) for number in (1, 2)), FeetechServo("SCS0009", 3)]
    wire = _talk(*servos)
    _play(wire, "sync-write")
    # 00 0C is 3072 for an STS and 12 for an SCS.
    assert [servo.registers.get("goal_position") for servo in servos] == [2048, 1024, 12]


def test_an_ax_12_beside_it_takes_no_part_in_a_sync_read() -> None:
    wire = Talk(FeetechBus([FeetechServo("STS3215", 1), Ax12(2)]))
    assert [answer[6:8] for answer in _play(wire, "sync-read")] == ["01"]
    assert wire.p1(2, "02 00 02") == "00 0C 00"


# Motion.


def test_a_goal_without_torque_moves_nothing() -> None:
    wire = _talk()
    wire.p1(1, "03 2A 00 0C")
    _later(wire, 2.0)
    assert _bus(wire).servo(1).motor.angle == 2048


def test_goal_speed_and_acceleration() -> None:
    wire = _talk()
    servo = _bus(wire).servo(1)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2A 00 0C 00 00 E8 03")
    _later(wire, 0.5)
    assert servo.motor.angle == pytest.approx(2548, abs=5)
    assert wire.p1(1, "02 3A 02") == "00 E8 03"
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(3072, abs=2)
    # Acceleration 10 is 1000 step/s2: 125 steps after half a second.
    wire.p1(1, "03 29 0A 00 08 00 00 E8 03")
    _later(wire, 0.5)
    assert servo.motor.angle == pytest.approx(3072 - 125, abs=5)


def test_speed_zero_means_full_speed_or_stop_by_phase_bit_3() -> None:
    wire = _talk()
    servo = _bus(wire).servo(1)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2A 00 0C")
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(3072, abs=2)
    servo.registers.put("phase", 4)
    wire.p1(1, "03 2A 00 08")
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(3072, abs=2)


def test_phase_bit_2_is_the_unit_of_speed() -> None:
    wire = _talk()
    servo = _bus(wire).servo(1)
    servo.registers.put("phase", 8)
    servo.registers.put("mode", 1)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2E 0A 00")
    _later(wire, 1.0)
    assert servo.motor.speed == pytest.approx(500, abs=2)
    assert wire.p1(1, "02 3A 02") == "00 0A 00"


def test_wheel_pwm_and_step_mode() -> None:
    wire = _talk()
    servo = _bus(wire).servo(1)
    servo.registers.put("mode", 1)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2E F4 81")
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(2048 - 500, abs=3)
    servo.registers.put("mode", 2)
    wire.p1(1, "03 2C F4 01")
    _later(wire, 0.1)
    assert servo.motor.drive == 0.5
    assert servo.motor.speed > 1000
    servo.registers.put("mode", 3)
    before = servo.motor.angle
    wire.p1(1, "03 2E 00 00")
    wire.p1(1, "03 2A 64 80")
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(before - 100, abs=2)


def test_a_goal_outside_the_limits_is_gone_to_up_to_the_limit() -> None:
    wire = _talk()
    servo = _bus(wire).servo(1)
    servo.registers.put("max_angle", 2500)
    wire.p1(1, "03 28 01")
    assert wire.p1(1, "03 2A 00 0C") == "00"
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(2500, abs=2)


def test_phase_bit_4_shows_many_turns() -> None:
    servo = FeetechServo(position=5000)
    wire = _talk(servo)
    assert wire.p1(1, "02 38 02") == "00 88 03"
    servo.registers.put("phase", 28)
    assert wire.p1(1, "02 38 02") == "00 88 13"


def test_the_middle_is_taken_with_128_and_kept() -> None:
    servo = FeetechServo(position=3000)
    wire = _talk(servo)
    _play(wire, "sts-middle")
    assert servo.registers.get("offset") == 952
    assert wire.p1(1, "02 38 02") == "00 00 08"
    wire.device.power_off(0.0)
    wire.device.power_on(0.0)
    assert wire.p1(1, "02 38 02") == "00 00 08"


def test_an_scs_moves_in_a_given_time_and_turns_without_limits() -> None:
    servo = FeetechServo("SCS0009", 1, position=512)
    wire = _talk(servo)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2A 02 64 03 E8 00 00")
    _later(wire, 0.5)
    assert servo.motor.angle == pytest.approx(562, abs=3)
    _later(wire, 0.6)
    assert servo.motor.angle == pytest.approx(612, abs=3)
    servo.registers.put("min_angle", 0)
    servo.registers.put("max_angle", 0)
    wire.p1(1, "03 2C 05 F4")
    _later(wire, 0.1)
    assert servo.motor.drive == -0.5


# Alarms.


def test_an_overload_lowers_the_output_until_a_new_command() -> None:
    servo = FeetechServo()
    servo.motor.stops = (0, 2200)
    wire = _talk(servo)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2A 00 0C")
    _later(wire, 1.5)
    assert servo.motor.angle == 2200
    assert servo.motor.drive == 1.0
    assert wire.p1(1, "01") == "00"
    _later(wire, 1.5)
    assert wire.p1(1, "01") == "20"
    assert servo.motor.drive == 0.2
    wire.p1(1, "03 2A 00 08")
    _later(wire, 0.5)
    assert wire.p1(1, "01") == "00"
    assert servo.motor.angle == pytest.approx(2048, abs=2)


def test_current_heat_and_voltage() -> None:
    servo = FeetechServo()
    servo.motor.stops = (0, 2200)
    servo.registers.put("protection_current", 250)
    servo.registers.put("overload_torque", 100)
    wire = _talk(servo)
    wire.p1(1, "03 28 01")
    wire.p1(1, "03 2A 00 0C")
    _later(wire, 2.5)
    assert wire.p1(1, "01") == "08"
    assert servo.motor.drive == 0.0
    wire.p1(1, "03 28 01")
    assert wire.p1(1, "01") == "00"
    servo.heat(75)
    _later(wire, 0.1)
    assert wire.p1(1, "01") == "04"
    assert servo.motor.drive == 0.0
    servo.heat(None)
    servo.volts = 12.0
    assert int(wire.p1(1, "01"), 16) & 1 == 1, "a 7.4 V servo at 12 V says so in every answer"


def test_a_servo_without_torque_is_turned_by_its_load() -> None:
    servo = FeetechServo()
    servo.motor.load = 0.1
    wire = _talk(servo)
    _later(wire, 1.0)
    assert servo.motor.angle > 2100
    wire.p1(1, "03 28 01")
    held = servo.motor.angle
    _later(wire, 1.0)
    assert servo.motor.angle == pytest.approx(held, abs=20)


# As a process: its options, and what is typed.


def _started(tmp_path: Path, robot: str, *arguments: str) -> tuple[Endpoint, Console]:
    start = robots()[robot]
    parser = argparse.ArgumentParser()
    start.options(parser)
    endpoint, words = start.start(parser.parse_args(["--pty", str(tmp_path / "robot"), *arguments]))
    return endpoint, Console(endpoint, words)


def test_the_servos_are_chosen_by_model_and_id(tmp_path: Path) -> None:
    endpoint, console = _started(tmp_path, "feetech", "--servos", "STS3250:4, SCS15:9", "--baud", "500000")
    with endpoint:
        assert [(unit.id, unit.baud) for unit in endpoint.device] == [(4, 500_000), (9, 500_000)]  # type: ignore[attr-defined]
        assert console.line("state").startswith("4 STS3250 present_position=2048")
        assert console.line("turn 9 30") == "ok"
        assert "present_position=614" in console.line("state 9")
        assert console.line("load 4 0.5") == "ok"
        assert console.line("voltage 5") == "ok"
        assert console.line("temperature 4 60") == "ok"
        assert "present_temperature=60" in console.line("state 4")
        assert console.line("turn 7 1") == "error: unit 7: not on this bus; there are 4, 9"


@pytest.mark.parametrize(
    ("servos", "told"),
    [("STS3215", "servo 'STS3215': write MODEL:ID"), ("AX-12:1", "model 'AX-12': not simulated; there are STS3215")],
)
def test_a_wrong_list_of_servos_is_told(tmp_path: Path, servos: str, told: str) -> None:
    with pytest.raises(UnknownRequest, match=told):
        _started(tmp_path, "feetech", "--servos", servos)


def test_a_joint_of_the_arm_is_turned_by_hand_as_far_as_its_stop(tmp_path: Path) -> None:
    endpoint, console = _started(tmp_path, "so101", "--calibrated")
    with endpoint:
        assert console.line("turn shoulder_pan 45") == "ok"
        assert "1 shoulder_pan present_position=2560" in console.line("state")
        assert console.line("turn shoulder_pan 180") == "ok"
        assert f"1 shoulder_pan present_position={2048 + 1250}" in console.line("state")
