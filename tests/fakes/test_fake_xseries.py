"""X series: protocol 2.0 rules, modes, profiles, watchdog, hardware errors, indirect addresses."""

from __future__ import annotations

import pytest
from fake_talk import Talk

from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.xseries import VELOCITY_STEP, XSeries
from urbihw_fakes.errors import UnknownRequest

ON, OFF = "03 40 00 01", "03 40 00 00"


@pytest.fixture
def servo() -> XSeries:
    return XSeries("XM430-W350", 1)


@pytest.fixture
def wire(servo: XSeries) -> Talk:
    return Talk(ServoBus([servo]))


def _seen(wire: Talk, name: str) -> int:
    servo = wire.device[1]  # type: ignore[index]
    row = servo.registers.by_name[name]
    data = bytes.fromhex(wire.p2(1, f"02 {row.address:02X} 00 {row.size:02X} 00"))
    assert len(data) == row.size + 1
    return int.from_bytes(data[1:], "little", signed=row.signed)


def _goal(position: int) -> str:
    return "03 74 00 " + position.to_bytes(4, "little", signed=True).hex()


@pytest.mark.parametrize(
    ("model", "number", "limits"),
    [
        ("XL330-M288", "B0 04", "46 46 00 23 00 75 03 D6 06"),
        ("XL430-W250", "24 04", "48 8C 00 3C 00 75 03 00 00"),
        ("XM430-W350", "FC 03", "50 A0 00 5F 00 75 03 A9 04"),
    ],
)
def test_factory_values(model: str, number: str, limits: str) -> None:
    wire = Talk(ServoBus([XSeries(model, 1)]))
    assert wire.p2(1, "01")[:8] == f"00 {number}"
    assert wire.p2(1, "02 07 00 07 00") == "00 01 01 FA 00 03 FF 02"
    assert wire.p2(1, "02 1F 00 09 00") == f"00 {limits}"


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(UnknownRequest, match="'AX-12'"):
        XSeries("AX-12")


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ("20 01", "02"),  # backup is not modelled
        ("05", "02"),  # ACTION with nothing registered
        ("03 00 00 01 00", "07"),  # model number is read only
        ("03 42 00 01", "07"),  # 66 does not exist
        ("02 00 04 01 00", "07"),  # far outside the table
        ("03 74 00 00 08", "05"),  # half a goal
        ("03 40 00 02", "04"),  # torque enable 2
        ("03 74 00 00 10 00 00", "06"),  # goal 4096, limit 4095
        ("03 68 00 5F 01 00 00", "06"),  # velocity 351, limit 350
        ("03 0B 00 02", "04"),  # there is no mode 2
        ("06 03", "04"),  # no such extent of a factory reset
    ],
)
def test_errors(wire: Talk, body: str, error: str) -> None:
    assert wire.p2(1, body) == error


def test_wrong_crc(wire: Talk) -> None:
    (answer,) = wire.raw("FF FF FD 00 01 03 00 01 19 4F")
    assert answer.startswith("FF FF FD 00 01 04 00 55 03")
    assert wire.raw("FF FF FD 00 FE 03 00 01 31 43") == []


def test_torque_closes_the_eeprom(wire: Talk) -> None:
    assert wire.p2(1, "03 09 00 00") == "00"
    assert wire.p2(1, ON) == "00"
    assert wire.p2(1, "03 09 00 01") == "07"
    assert wire.p2(1, OFF) == "00"
    assert wire.p2(1, "03 09 00 01") == "00"


def test_reg_write_waits_for_action(wire: Talk, servo: XSeries) -> None:
    assert wire.p2(1, "04 41 00 01") == "00"
    assert _seen(wire, "registered") == 1
    assert wire.p2(1, "05") == "00"
    assert (_seen(wire, "led"), _seen(wire, "registered")) == (1, 0)


@pytest.mark.parametrize(("level", "answers"), [(0, ["00 FC 03 2D", "", ""]), (1, ["00 FC 03 2D", "00 00", ""])])
def test_status_return_level(wire: Talk, level: int, answers: list[str]) -> None:
    assert wire.p2(1, f"03 44 00 {level:02X}") == "00"
    assert [wire.p2(1, "01"), wire.p2(1, "02 41 00 01 00"), wire.p2(1, "03 41 00 00")] == answers


def test_a_secondary_id_is_obeyed_and_not_answered(wire: Talk) -> None:
    wire.p2(1, "03 0C 00 09")
    assert wire.p2(9, "03 41 00 01") == ""
    assert _seen(wire, "led") == 1
    assert wire.p2(9, "01") == ""


def test_position_mode_goes_and_stays_limp_without_torque(wire: Talk) -> None:
    assert wire.p2(1, _goal(1000)) == "00"
    wire.now = 1.0
    assert _seen(wire, "present_position") == 2048
    wire.p2(1, ON)
    # Torque on starts from where it stands.
    assert _seen(wire, "goal_position") == 2048
    wire.p2(1, _goal(1000))
    wire.now = 1.1
    assert _seen(wire, "moving") == 1
    wire.now = 2.0
    assert abs(_seen(wire, "present_position") - 1000) <= 2
    assert _seen(wire, "moving") == 0


def test_profile_velocity_and_acceleration_make_a_trapezoid(wire: Talk) -> None:
    wire.p2(1, ON)
    # Velocity 50 (781.7 steps/s), acceleration 8 (1953 steps/s2): 0.4 s to get going.
    wire.p2(1, "03 6C 00 08 00 00 00 32 00 00 00")
    wire.p2(1, _goal(3500))
    wire.now = 0.2
    assert _seen(wire, "velocity_trajectory") == pytest.approx(25, abs=1)
    wire.now = 1.0
    assert _seen(wire, "present_velocity") == pytest.approx(50, abs=1)
    # 1452 steps: 0.4 s up, 1.457 s of cruise, 0.4 s down.
    wire.now = 2.2
    assert _seen(wire, "velocity_trajectory") != 0
    wire.now = 2.35
    assert _seen(wire, "velocity_trajectory") == 0
    assert _seen(wire, "present_position") == pytest.approx(3500, abs=2)


def test_a_time_based_profile_takes_its_time(wire: Talk) -> None:
    wire.p2(1, "03 0A 00 04")
    wire.p2(1, ON)
    # 200 ms of acceleration within 1000 ms.
    wire.p2(1, "03 6C 00 C8 00 00 00 E8 03 00 00")
    wire.p2(1, _goal(3048))
    wire.now = 0.5
    assert _seen(wire, "present_position") == pytest.approx(2548, abs=45)
    wire.now = 0.9
    assert _seen(wire, "velocity_trajectory") != 0
    wire.now = 1.05
    assert _seen(wire, "present_position") == pytest.approx(3048, abs=2)


def test_velocity_mode_is_signed(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, "03 0B 00 01")
    wire.p2(1, ON)
    assert wire.p2(1, "03 68 00 9C FF FF FF") == "00"
    wire.now = 0.5
    assert _seen(wire, "present_velocity") == pytest.approx(-100, abs=1)
    first = _seen(wire, "present_position")
    wire.now = 2.5
    assert _seen(wire, "present_position") - first == pytest.approx(-200 * VELOCITY_STEP, rel=0.01)
    # Against a load it keeps the velocity and needs more current.
    servo.motor.load = 0.3
    wire.now = 3.0
    assert _seen(wire, "present_velocity") == pytest.approx(-100, abs=1)
    assert _seen(wire, "present_current") < -200


def test_a_change_of_the_mode_resets_gains_profile_and_efforts(wire: Talk) -> None:
    """E-manual, xl430-w250, "Operating Mode"; the same mode again resets nothing."""
    names = "position_p", "profile_velocity", "profile_acceleration", "goal_pwm"
    before = [_seen(wire, name) for name in names]
    for command in ("03 54 00 2C 01", "03 70 00 29 00 00 00", "03 6C 00 05 00 00 00", "03 64 00 64 00"):
        assert wire.p2(1, command) == "00"
    wire.p2(1, "03 0B 00 03")
    assert [_seen(wire, name) for name in names] == [300, 41, 5, 100]
    wire.p2(1, "03 0B 00 01")
    assert [_seen(wire, name) for name in names] == before


def test_pwm_mode_drives_open_loop(wire: Talk) -> None:
    wire.p2(1, "03 0B 00 10")
    wire.p2(1, ON)
    assert wire.p2(1, "03 64 00 BA 01") == "00"
    wire.now = 0.5
    assert _seen(wire, "present_pwm") == 442
    # Half the drive, less friction: about half of full speed (350).
    assert _seen(wire, "present_velocity") == pytest.approx(0.49 * 350, abs=3)


def test_current_mode_pushes_with_a_force(wire: Talk) -> None:
    wire.p2(1, "03 0B 00 00")
    wire.p2(1, ON)
    assert wire.p2(1, "03 66 00 9C FF") == "00"
    wire.now = 0.5
    assert _seen(wire, "present_velocity") < 0
    assert Talk(ServoBus([XSeries("XL430-W250", 1)])).p2(1, "03 0B 00 00") == "04"


def test_extended_position_counts_turns_and_clear_takes_them_off(wire: Talk) -> None:
    wire.p2(1, "03 0B 00 04")
    wire.p2(1, ON)
    assert wire.p2(1, _goal(-9000)) == "00"
    wire.now = 5.0
    assert _seen(wire, "present_position") == pytest.approx(-9000, abs=2)
    assert wire.p2(1, "10 01 44 58 4C 22") == "00"
    assert _seen(wire, "present_position") == pytest.approx(-9000 + 3 * 4096, abs=2)
    wire.p2(1, _goal(100_000))
    wire.now = 5.2
    # It moves: the result fails.
    assert wire.p2(1, "10 01 44 58 4C 22") == "01"
    assert wire.p2(1, "10 01 44 58 4C 23") == "01"


def test_reverse_and_homing_offset(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, "03 14 00 64 00 00 00")
    assert _seen(wire, "present_position") == 2148
    wire.p2(1, "03 0A 00 01")
    assert _seen(wire, "present_position") == -2048 + 100
    wire.p2(1, "03 0B 00 04")
    wire.p2(1, ON)
    wire.p2(1, _goal(-1000))
    wire.now = 2.0
    assert _seen(wire, "present_position") == pytest.approx(-1000, abs=2)
    assert servo.motor.position == pytest.approx(1100, abs=2)


def test_a_load_makes_it_sag(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, ON)
    servo.motor.load = -0.2
    wire.now = 1.0
    # 0.2 of full drive are 177 PWM steps, at a P gain of 800/128 a step: 28 steps, less friction.
    assert 2048 - _seen(wire, "present_position") == pytest.approx(28, abs=3)
    assert _seen(wire, "present_current") == pytest.approx(0.2 * 855, abs=12)


def test_the_bus_watchdog_stops_and_refuses_goals(wire: Talk) -> None:
    wire.p2(1, "03 0B 00 01")
    wire.p2(1, ON)
    wire.p2(1, "03 62 00 05")
    wire.p2(1, "03 68 00 64 00 00 00")
    # Traffic within 100 ms keeps it running.
    for tick in range(1, 10):
        wire.now = 0.09 * tick
        wire.p2(1, "01")
    assert _seen(wire, "present_velocity") == pytest.approx(100, abs=1)
    wire.now += 0.3
    assert wire.p2(1, "02 62 00 01 00") == "00 FF"
    assert _seen(wire, "present_velocity") == 0
    assert wire.p2(1, "03 68 00 64 00 00 00") == "04"
    assert wire.p2(1, "03 62 00 00") == "00"
    assert wire.p2(1, "03 68 00 64 00 00 00") == "00"


def test_overload_cuts_the_torque_until_reboot(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, ON)
    servo.motor.load = -1.5
    wire.now = 0.5
    assert wire.p2(1, "01")[:2] == "00"
    wire.now = 1.5
    # The alert bit, in every answer.
    assert wire.p2(1, "01")[:2] == "80"
    assert wire.p2(1, "02 46 00 01 00") == "80 20"
    assert wire.p2(1, "02 40 00 01 00") == "80 00"
    assert wire.p2(1, ON) == "87"
    servo.motor.load = 0.0
    assert wire.p2(1, "08") == "00"
    assert wire.p2(1, ON) == "00"


def test_heat_and_voltage_are_hardware_errors(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, ON)
    servo.volts = 9.0
    wire.now = 0.1
    # Voltage is not in Shutdown (52) as shipped: told, torque stays.
    assert wire.p2(1, "02 46 00 01 00") == "80 01"
    assert wire.p2(1, "02 40 00 01 00") == "80 01"
    servo.heat(81.0)
    wire.now = 0.2
    assert wire.p2(1, "02 46 00 01 00") == "80 05"
    assert wire.p2(1, "02 40 00 01 00") == "80 00"


@pytest.mark.parametrize(("extent", "answers_at", "baud"), [("FF", 1, 1), ("01", 5, 1), ("02", 5, 3)])
def test_factory_reset(wire: Talk, extent: str, answers_at: int, baud: int) -> None:
    wire.p2(1, "03 07 00 05 03 00")
    assert wire.p2(5, f"06 {extent}") == "00"
    assert wire.p2(answers_at, "02 08 00 02 00") == f"00 0{baud} FA"


def test_a_full_factory_reset_of_all_is_ignored(wire: Talk) -> None:
    wire.p2(1, "03 07 00 05")
    assert wire.p2(254, "06 FF") == ""
    assert wire.p2(5, "01")[:2] == "00"


def test_torque_on_by_goal_update(wire: Talk) -> None:
    wire.p2(1, "03 0A 00 08")
    wire.p2(1, _goal(1500))
    assert _seen(wire, "torque_enable") == 1
    wire.now = 1.0
    assert _seen(wire, "present_position") == pytest.approx(1500, abs=2)


@pytest.mark.parametrize(("model", "data"), [("XM430-W350", "E0"), ("XL330-M288", "D0")])
def test_indirect_addresses(model: str, data: str) -> None:
    wire = Talk(ServoBus([XSeries(model, 1)]))
    # Entries 1..5: present temperature, and the four bytes of the goal position.
    assert wire.p2(1, "03 A8 00 92 00 74 00 75 00 76 00 77 00") == "00"
    assert wire.p2(1, f"02 {data} 00 05 00") == "00 1E 00 08 00 00"
    goal = f"{int(data, 16) + 1:02X}"
    assert wire.p2(1, f"03 {goal} 00 64 00 00 00") == "00"
    assert _seen(wire, "goal_position") == 100
    # Through the window the rules are the same: half a goal, and a read-only register.
    assert wire.p2(1, f"03 {goal} 00 64 00") == "05"
    assert wire.p2(1, f"03 {data} 00 00") == "07"


def test_power_off_forgets_turns_and_torque(wire: Talk, servo: XSeries) -> None:
    wire.p2(1, "03 0B 00 04")
    wire.p2(1, ON)
    wire.p2(1, _goal(5000))
    wire.now = 2.0
    assert _seen(wire, "present_position") == pytest.approx(5000, abs=2)
    servo.power_off(2.0)
    assert wire.p2(1, "01") == ""
    servo.power_on(3.0)
    wire.now = 4.0
    assert _seen(wire, "present_position") == pytest.approx(5000 - 4096, abs=2)
    assert (_seen(wire, "torque_enable"), _seen(wire, "operating_mode")) == (0, 4)
