"""Changes of one servo: what the body of the fake has afterwards, what is refused, and that nothing moves."""

from __future__ import annotations

from pathlib import Path

import pytest

from urbihw.buses.servos import changes, registers_file
from urbihw.buses.servos.findings import findings
from urbihw.buses.servos.registers import Crowded, ServoError, ServoRegisters
from urbihw.buses.servos.registers_file import BadBackup, ServoBackup
from urbihw.buses.servos.survey import survey
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.catalogue import UNITS, make_servo
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

from .line_rig import LineRig, ax, xl


def stands(unit: Ax12 | XSeries) -> bool:
    """Whether it has no torque and does not turn."""
    speed = unit.speed if isinstance(unit, Ax12) else unit.motor.speed
    return unit.registers.get("torque_enable") == 0 and speed == 0.0


def test_the_only_servo_gets_an_id_and_loses_its_torque() -> None:
    servo = ax(1, torque_enable=1)
    rig = LineRig([servo])
    device = changes.set_id(rig.line.link, changes.find_one(rig.line.link), 7)
    assert (device.id, servo.id, device.name) == (7, 7, "AX-12A")
    assert stands(servo) and servo.position == 512.0


def test_an_x_servo_gets_an_id_and_a_speed() -> None:
    servo = xl(1)
    rig = LineRig([servo, xl(2)], 57_600)
    device = changes.set_id(rig.line.link, changes.find_one(rig.line.link, 1), 3)
    device = changes.set_baud(rig.line, device, 1_000_000)
    assert (servo.id, servo.baud, rig.line.baud, device.id) == (3, 1_000_000, 1_000_000, 3)
    assert rig.kit[2].baud == 57_600


def test_a_change_is_refused_while_it_is_not_clear_which_servo_is_meant() -> None:
    rig = LineRig([ax(1), ax(1), ax(2)])
    with pytest.raises(Crowded, match="more than one servo answers to id 1: unplug all of them but one"):
        changes.find_one(rig.line.link, 1)
    rig = LineRig([ax(1), ax(2)])
    with pytest.raises(ServoError, match=r"2 servos answer \(1, 2\): name one by --id, or plug in only one"):
        changes.find_one(rig.line.link)
    device = changes.find_one(rig.line.link, 1)
    with pytest.raises(ServoError, match="id 2 is taken at 1000000 bps"):
        changes.set_id(rig.line.link, device, 2)
    with pytest.raises(ServoError, match=r"an id of this servo is 0\.\.253, not 254"):
        changes.set_id(rig.line.link, device, 254)
    with pytest.raises(ServoError, match="no servo with id 9 answers at 1000000 bps; urbihw scan looks at all speeds"):
        changes.find_one(rig.line.link, 9)
    assert sorted(unit.id for unit in rig.kit) == [1, 2]


def test_two_that_answer_a_ping_as_one_are_noticed_by_their_registers() -> None:
    one, other = ax(1), ax(1, ccw_limit=700)
    rig = LineRig([one])
    device = changes.find_one(rig.line.link, 1)
    rig.kit.add(other)
    with pytest.raises(Crowded):
        changes.check_alone(rig.line.link, device)


def test_a_locked_eeprom_is_told_and_nothing_is_changed() -> None:
    servo = ax(1, lock=1)
    rig = LineRig([servo])
    with pytest.raises(ServoError, match="its EEPROM is locked until it loses power: switch it off and on"):
        changes.set_id(rig.line.link, changes.find_one(rig.line.link), 7)
    assert servo.id == 1


@pytest.mark.parametrize("level", [1, 2])
def test_speeds_are_set_where_the_servo_has_them(level: int) -> None:
    servo = ax(4, status_level=level)
    rig = LineRig([servo])
    device = changes.find_one(rig.line.link)
    with pytest.raises(ServoError, match="AX-12A has no speed of 4000000 bps"):
        changes.set_baud(rig.line, device, 4_000_000)
    changes.set_baud(rig.line, device, 57_600)
    assert servo.baud == 57_142 and rig.line.baud == 57_600
    changes.set_baud(rig.line, changes.find_one(rig.line.link, 4), 1_000_000)
    assert servo.baud == 1_000_000


def test_a_speed_is_refused_where_the_id_is_taken_there() -> None:
    rig = LineRig([ax(4), ax(4, 500_000)])
    with pytest.raises(ServoError, match="id 4 is taken at 500000 bps"):
        changes.set_baud(rig.line, changes.find_one(rig.line.link, 4), 500_000)
    assert sorted(unit.baud for unit in rig.kit) == [500_000, 1_000_000]


def test_a_servo_that_does_not_take_its_new_speed_is_found_at_the_old_one() -> None:
    servo = ax(4)
    rig = LineRig([servo])
    device = changes.find_one(rig.line.link)
    servo.pin_register("torque_enable", 0)
    servo.written = lambda register, value, before: (  # type: ignore[method-assign]
        servo.registers.put("baud", 1) if register.name == "baud" else None
    )
    with pytest.raises(ServoError, match="servo 4 has kept its speed of 1000000 bps: nothing is changed, try again"):
        changes.set_baud(rig.line, device, 57_600)
    assert changes.find_one(rig.line.link).id == 4


def test_a_reset_keeps_id_and_speed_and_forgets_the_rest() -> None:
    servo = ax(9, 500_000, cw_limit=300, torque_enable=1)
    rig = LineRig([servo, ax(2, 500_000)], 500_000)
    changes.reset(rig.line, changes.find_one(rig.line.link, 9))
    assert (servo.id, servo.baud, servo.registers.get("cw_limit"), rig.line.baud) == (9, 500_000, 0, 500_000)
    assert stands(servo)
    other = xl(5)
    other.registers.put("min_position", 1000)
    rig = LineRig([other], 57_600)
    changes.reset(rig.line, changes.find_one(rig.line.link, 5))
    assert (other.id, other.baud, other.registers.get("min_position")) == (5, 57_600, 0)


def test_a_reset_of_an_mx_is_followed_to_its_own_factory_speed() -> None:
    servo = make_servo("MX-28", 9)
    servo.set_baud(1_000_000)
    servo.registers.put("return_delay", 0)
    rig = LineRig([servo])
    changes.reset(rig.line, changes.find_one(rig.line.link))
    assert (servo.id, servo.baud, servo.registers.get("return_delay")) == (9, 1_000_000, 250)


@pytest.mark.parametrize("model", sorted(UNITS))
def test_every_model_is_read_whole_set_up_and_restored(model: str) -> None:
    unit = make_servo(model, 1)
    unit.set_baud(1_000_000)
    rig = LineRig([unit])
    (servo,) = survey(rig.line, [1_000_000]).servos
    assert not any("hardware error" in finding.text or "outside" in finding.text for finding in findings(servo))
    device = changes.set_id(rig.line.link, changes.find_one(rig.line.link), 7)
    backup = changes.back_up(rig.line.link, device)
    assert unit.id == 7 and backup.registers["model_number"] == device.model
    registers_of(rig, 7).write("return_delay_time", 3)
    assert list(changes.changes_to(rig.line.link, device, backup)) == ["return_delay_time"]
    assert changes.restore(rig.line.link, device, backup) == []
    assert changes.changes_to(rig.line.link, device, backup) == {}
    changes.set_baud(rig.line, device, 57_600)
    assert unit.accepts_baud(57_600)


def test_a_reset_is_refused_where_the_factory_id_is_taken() -> None:
    servo = ax(9, cw_limit=300)
    rig = LineRig([servo, ax(1)])
    with pytest.raises(ServoError, match="id 1 is taken at 1000000 bps"):
        changes.reset(rig.line, changes.find_one(rig.line.link, 9))
    assert (servo.id, servo.registers.get("cw_limit")) == (9, 300)


def test_a_reboot_clears_an_alert_and_an_ax_has_none() -> None:
    servo = xl(5)
    servo.registers.put("hardware_error", 0x20)
    rig = LineRig([servo], 57_600)
    changes.reboot(rig.line.link, changes.find_one(rig.line.link))
    assert servo.registers.get("hardware_error") == 0
    rig = LineRig([ax(1)])
    with pytest.raises(ServoError, match="AX-12A has no reboot: switch it off and on"):
        changes.reboot(rig.line.link, changes.find_one(rig.line.link))


def registers_of(rig: LineRig, number: int) -> ServoRegisters:
    return ServoRegisters(rig.line.link, changes.find_one(rig.line.link, number))


@pytest.mark.parametrize(
    ("name", "raw"), [("goal_position", 600), ("torque_enable", 1), ("moving_speed", 100), ("id", 3), ("baud_rate", 3)]
)
def test_what_moves_or_has_its_own_command_is_not_written(name: str, raw: int) -> None:
    servo = ax(1, cw_limit=0, ccw_limit=0)
    rig = LineRig([servo])
    with pytest.raises(ServoError, match=f"{name} is not written"):
        registers_of(rig, 1).write(name, raw)
    rig.kit.tick(rig.clock.now() + 1.0)
    assert stands(servo) and (servo.id, servo.baud, servo.position) == (1, 1_000_000, 512.0)


def test_writes_switch_the_torque_off_first_and_are_checked() -> None:
    servo = ax(1, torque_enable=1, goal_position=800, torque_limit=0)
    rig = LineRig([servo])
    registers = registers_of(rig, 1)
    registers.write("torque_limit", 1023)
    rig.kit.tick(rig.clock.now() + 1.0)
    assert registers.torque_was_on and stands(servo) and servo.position == 512.0
    registers.write("return_delay_time", 0)
    registers.write("status_return_level", 1)
    registers.write("status_return_level", 2)
    assert servo.registers.get("return_delay") == 0
    with pytest.raises(ServoError, match="present_position can only be read"):
        registers.write("present_position", 0)
    with pytest.raises(ValueError, match=r"takes 0\.\.254, not 300"):
        registers.write("return_delay_time", 300)
    servo.pin_register("punch", 32)
    servo.written = lambda register, value, before: servo.registers.put("punch", 32)  # type: ignore[method-assign]
    with pytest.raises(ServoError, match="servo 1: punch is 32 after writing 50"):
        registers.write("punch", 50)


def test_reading_all_registers_changes_nothing() -> None:
    sensor = AxS1(100)
    sensor.remocon(0x1234)
    rig = LineRig([sensor])
    values = registers_of(rig, 100).read()
    assert "remocon_rx" not in values and values["model_number"] == 13
    assert sensor.registers.get("remocon_arrived") != 0


def test_a_backup_is_written_read_and_restored(tmp_path: Path) -> None:
    servo, x = ax(3, return_delay=0, cw_limit=100, ccw_limit=900, torque_enable=1), xl(4, 1_000_000)
    rig = LineRig([servo, x])
    link = rig.line.link
    backups = [changes.back_up(link, device) for device in changes.find_all(link).devices]
    path = tmp_path / "robot.toml"
    registers_file.save(path, backups, "the left leg")
    text = path.read_text()
    assert text.startswith("# the left leg") and "model = 12  # AX-12A" in text
    assert "return_delay_time = 0  # 0 s" in text and "cw_angle_limit = 100  # -2.10617 rad" in text
    kept = registers_file.load(path)
    assert list(kept) == [3, 4] and list(kept.values()) == backups

    # Lower above upper in between: limits are written in the order that the servo takes.
    servo.registers.put("cw_limit", 950)
    servo.registers.put("ccw_limit", 1000)
    x.registers.put("min_position", 3000)
    device = changes.find_one(link, 3)
    assert changes.changes_to(link, device, kept[3]) == {"cw_angle_limit": (950, 100), "ccw_angle_limit": (1000, 900)}
    assert changes.restore(link, device, kept[3]) == []
    assert changes.restore(link, changes.find_one(link, 4), kept[4]) == []
    assert (servo.registers.get("cw_limit"), servo.registers.get("ccw_limit")) == (100, 900)
    assert x.registers.get("min_position") == 0
    assert stands(servo)
    with pytest.raises(ServoError, match="servo 3 is of model AX-12A, but the backup is of model XL430-W250"):
        changes.restore(link, device, kept[4])


def test_a_replacement_takes_the_place_of_its_predecessor() -> None:
    old = ax(3, 500_000, return_delay=0, cw_limit=200)
    rig = LineRig([ax(1, 500_000), old], 500_000)
    backup = changes.back_up(rig.line.link, changes.find_one(rig.line.link, 3))
    rig.kit.remove(old)
    new = ax(1)  # as it comes from the factory: the id of another servo, at another speed
    rig.kit.add(new)
    rig.line.set_speed(1_000_000)
    assert changes.adopt(rig.line, changes.find_one(rig.line.link), backup) == []
    get = new.registers.get
    assert (new.id, new.baud, get("return_delay"), get("cw_limit")) == (3, 500_000, 0, 200)
    assert sorted(device.id for device in changes.find_all(rig.line.link).devices) == [1, 3]


def test_a_speed_that_the_replacement_does_not_have_changes_nothing() -> None:
    new = ax(1)
    rig = LineRig([new])
    device = changes.find_one(rig.line.link)
    with pytest.raises(ServoError, match="servo 1: AX-12A has no speed of 4000000 bps"):
        changes.adopt(rig.line, device, ServoBackup(3, 12, 1, 24, 4_000_000, {"cw_angle_limit": 200}))
    rig.line.has_speed = False
    with pytest.raises(ServoError, match="its speed is not set from here"):
        changes.adopt(rig.line, device, ServoBackup(3, 12, 1, 24, 57_600, {"cw_angle_limit": 200}))
    assert (new.id, new.baud, new.registers.get("cw_limit"), rig.line.baud) == (1, 1_000_000, 0, 1_000_000)


def test_a_backup_cannot_make_its_servo_silent() -> None:
    """At status return level 0 it would answer pings only; all else is restored, and that one is reported."""
    new = ax(1)
    rig = LineRig([new])
    device = changes.find_one(rig.line.link)
    wanted = {"status_return_level": 0, "return_delay_time": 5}
    backup = ServoBackup(7, device.model, device.protocol, device.firmware, 1_000_000, wanted)
    (problem,) = changes.adopt(rig.line, device, backup)
    assert "status_return_level 0 is not written: it would answer pings only" in problem
    found = ServoRegisters(rig.line.link, changes.find_one(rig.line.link, 7)).read(wanted)
    assert found == {"status_return_level": 2, "return_delay_time": 5}
    assert (new.id, stands(new)) == (7, True)
    x = xl(8, 1_000_000)
    rig.kit.add(x)
    with pytest.raises(ServoError, match="servo 8: status_return_level 0 is not written"):
        ServoRegisters(rig.line.link, changes.find_one(rig.line.link, 8)).write("status_return_level", 0)
    assert x.registers.get("status_level") == 2


class Cut(Exception):
    """The tool was killed."""


@pytest.mark.parametrize("writes", range(1, 8))
def test_a_tool_that_dies_half_way_leaves_the_servo_reachable_and_still(writes: int) -> None:
    servo, other = ax(1, 57_142, torque_enable=1, goal_position=512), ax(2)
    rig = LineRig([servo, other], 57_600)
    wanted = {"cw_angle_limit": 100, "ccw_angle_limit": 900, "return_delay_time": 0}
    backup = ServoBackup(9, 12, 1, 24, 1_000_000, wanted)
    device = changes.find_one(rig.line.link, 1)
    count = 0

    def receive(data: bytes, at: float) -> None:
        nonlocal count
        count += data[4] == 3 and not data.startswith(b"\xff\xff\xfd")  # WRITE
        if count == writes:
            raise Cut
        rig.receive(data, at)

    rig.end.on_receive = receive
    try:
        changes.adopt(rig.line, device, backup)
        assert writes > 5, "all was done before"
    except Cut:
        rig.end.on_receive = rig.receive
    rig.kit.tick(rig.clock.now() + 1.0)
    assert servo.position == 512.0 and servo.speed == 0.0
    found = {(servo.baud, servo.device.id) for servo in survey(rig.line).servos}
    assert (1_000_000, 2) in found and len(found) == 2
    assert found <= {(1_000_000, 2), (57_600, 1), (57_600, 9), (1_000_000, 9)}


def test_a_place_that_is_taken_is_not_given_away() -> None:
    rig = LineRig([ax(3), ax(1)])
    backup = changes.back_up(rig.line.link, changes.find_one(rig.line.link, 3))
    with pytest.raises(ServoError, match="id 3 is taken"):
        changes.adopt(rig.line, changes.find_one(rig.line.link, 1), backup)


def test_a_feetech_servo_is_unlocked_for_a_change_and_locked_again() -> None:
    servo, other = FeetechServo("STS3215", 1), FeetechServo("SCS0009", 2)
    rig = LineRig([], kit=FeetechBus([servo, other]))
    servo.registers.put("torque", 1)
    device = changes.set_id(rig.line.link, changes.find_one(rig.line.link, 1), 7)
    assert (device.id, servo.id, device.name, servo.registers.get("lock")) == (7, 7, "STS3215", 1)
    assert servo.registers.get("torque") == 0
    changes.set_baud(rig.line, device, 500_000)
    assert (servo.baud, servo.registers.get("lock"), rig.line.baud) == (500_000, 1, 500_000)
    rig.line.set_speed(1_000_000)
    registers_of(rig, 2).write("max_position_limit", 900)
    rig.kit.power_off(rig.clock.now())
    rig.kit.power_on(rig.clock.now())
    assert registers_of(rig, 2).read_one("max_position_limit") == 900
    assert (servo.id, servo.baud) == (7, 500_000)
    with pytest.raises(ServoError, match="what a reset does to SCS0009 is not documented; restore a backup"):
        changes.reset(rig.line, changes.find_one(rig.line.link, 2))


def test_a_lock_that_was_found_open_is_closed_after_a_write() -> None:
    servo = FeetechServo("STS3215", 1)
    servo.registers.put("lock", 0)
    rig = LineRig([], kit=FeetechBus([servo]))
    registers_of(rig, 1).write("max_position_limit", 900)
    assert (servo.registers.get("max_angle"), servo.registers.get("lock")) == (900, 1)


AX_HEAD = "[servo.1]\nmodel = 12\nprotocol = 1\nfirmware = 24\nbaud = 1000000\n[servo.1.registers]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[", "this is no TOML"),
        ("a = 1", "tables such as"),
        ("[servo.x]", "servo.x: the id is a number"),
        ("[servo.1]\nmodel = 12", "model, protocol, firmware, baud and a table registers"),
        ("[servo.1]\nmodel=12\nprotocol=1\nfirmware=1\nbaud='x'\nregisters={}", "baud is a whole number, not 'x'"),
        ("[servo.1]\nmodel=12\nprotocol=1\nfirmware=1\nbaud=7\nregisters={}", "baud is 300..10500000, not 7"),
        ("[servo.1]\nmodel=12\nprotocol=1\nfirmware=1\nbaud=0\nregisters={}", "baud is 300..10500000, not 0"),
        (f"[servo.1]\nmodel = 1{'0' * 5000}", "this is no TOML"),
        (f"{AX_HEAD}no_such = 3", "servo.1: AX-12A has no register 'no_such': correct or remove that line"),
        (f'{AX_HEAD}"@30:2" = 900', "AX-12A has no register '@30:2'"),
        (f'{AX_HEAD}"\\u001b[31mEVIL\\n" = 3', r"AX-12A has no register '\x1b[31mEVIL\n'"),
    ],
)
def test_a_wrong_backup_is_told_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(BadBackup) as caught:
        registers_file.load(path)
    assert words in str(caught.value) and str(caught.value).startswith(str(path))


def test_a_backup_of_an_unknown_model_is_kept_readable(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    backup = ServoBackup(1, 9999, 2, 1, 57_600, {"model_number": 9999})
    registers_file.save(path, [backup], "test")
    assert registers_file.load(path) == {1: backup}
    assert registers_file.save(path, [backup], "test") == tmp_path / "robot.toml.1"
