"""Feetech servos on the servo bus: packets, tables, identification, both byte orders, sync read, EEPROM, safe stop."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import packet, tables, units
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.eeprom import write_register
from urbihw.buses.servos.item import ControlTable
from urbihw.buses.servos.scan import scan
from urbihw.buses.servos.status import FEETECH, Status, state_words
from urbihw.buses.servos.stop import safe_stop, stop_what_moves
from urbihw_fakes import captures
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

from .conftest import Rig, both_back_ends
from .test_cycle import run

PAGES = captures.read("feetech")
STS = tables.table_named("STS3215")
SCS = tables.table_named("SCS")


@pytest.fixture
def feetech(make_rig: Callable[[FeetechBus], Rig]) -> Callable[..., Rig]:
    def make(*servos: FeetechServo | Ax12) -> Rig:
        bus = FeetechBus(servos)
        return make_rig(bus)

    return make


def _sts(count: int = 6) -> list[FeetechServo]:
    return [FeetechServo("STS3215", number) for number in range(1, count + 1)]


def _cycle(rig: Rig, items: tuple[str, ...] = ("present_position", "present_speed", "present_load")) -> Cycle:
    cycle = Cycle(rig.bus("auto"), scan(rig.bus("auto")).devices, 0.01)
    for number in cycle.members:
        cycle.watch(number, items, 0.0, rig.clock.now())
    rig.sent()
    return cycle


def _torque(rig: Rig) -> None:
    for unit in rig.kit:
        unit.registers.put("torque", 1)


# Packets and tables against documented bytes.


def _write(device: int, table: ControlTable, **values: int) -> bytes:
    items = [table.item(name) for name in values]
    data = b"".join(item.pack(values[item.name]) for item in items)
    return packet.write_packet(FEETECH, device, items[0].address, data)


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("ping", [packet.ping_packet(FEETECH, 1)]),
        ("sts-position", [packet.read_packet(FEETECH, 1, 56, 2)]),
        ("sts-goal", [_write(1, STS, goal_position=2048)]),
        ("sts-goal-speed", [_write(1, STS, goal_position=2048, goal_pwm=0, moving_speed=1000)]),
        ("sts-goal-all", [_write(1, STS, acceleration=50, goal_position=2048, goal_pwm=0, moving_speed=1000)]),
        ("scs-goal", [_write(1, SCS, goal_position=512, goal_pwm=0, moving_speed=300)]),
        ("torque-on", [_write(1, STS, torque_enable=1)]),
        ("torque-off", [_write(1, SCS, torque_enable=0)]),
        ("scs-unlock", [_write(1, SCS, lock=0)]),
        ("sts-new-id", [_write(1, STS, lock=0), _write(1, STS, id=5), _write(5, STS, lock=1)]),
        ("sts-offset", [_write(1, STS, homing_offset=-100)]),
        ("sts-wheel", [_write(1, STS, moving_speed=-500)]),
        ("sync-read", [packet.sync_read_packet(56, 8, range(1, 7), protocol=FEETECH)]),
        (
            "sync-write",
            [packet.sync_write_packet(FEETECH, 42, {1: b"\x00\x08", 2: b"\x00\x04", 3: b"\x00\x0c"})],
        ),
    ],
)
def test_packets_are_the_documented_ones(name: str, made: list[bytes]) -> None:
    assert [each.hex(" ") for each in made] == [each.hex(" ") for each in PAGES[name].sent]


def test_a_documented_answer_with_all_values() -> None:
    (status,) = packet.decoder(FEETECH).feed(PAGES["sts-all"].received[0])
    got = {
        name: STS.item(name).unpack(status.params[STS.item(name).address - 56 : STS.item(name).end - 56])
        for name in ("present_position", "present_speed", "present_load", "present_voltage", "present_current")
    }
    assert got == {
        "present_position": 2050,
        "present_speed": -120,
        "present_load": -85,
        "present_voltage": 74,
        "present_current": 40,
    }
    assert units.to_si(STS.item("present_current"), 40) == pytest.approx(0.26)
    assert units.to_si(STS.item("present_speed"), -120) == pytest.approx(-120 * 0.0015340, rel=1e-4)


def test_the_high_byte_comes_first_in_an_scs() -> None:
    (status,) = packet.decoder(FEETECH).feed(PAGES["scs-position"].received[0])
    assert SCS.item("present_position").unpack(status.params) == 512


def test_all_bits_of_an_error_byte_are_states() -> None:
    (status,) = packet.decoder(FEETECH).feed(PAGES["overload"].received[0])
    assert status == Status(1, 0x20, b"", FEETECH)
    assert (status.refusal, state_words(status.state, FEETECH)) == (0, "overload")
    assert state_words(0x0A, FEETECH) == "position sensor, overcurrent"


# Rows by hand: name -> (address, size).
_BY_HAND = {
    "STS3215": {
        "model_number": (3, 2), "id": (5, 1), "baud_rate": (6, 1), "return_delay_time": (7, 1),
        "response_level": (8, 1),
        "min_position_limit": (9, 2), "max_position_limit": (11, 2), "max_torque": (16, 2), "phase": (18, 1),
        "protection_current": (28, 2), "homing_offset": (31, 2), "operating_mode": (33, 1), "overload_torque": (36, 1),
        "torque_enable": (40, 1), "acceleration": (41, 1), "goal_position": (42, 2), "moving_speed": (46, 2),
        "torque_limit": (48, 2), "lock": (55, 1), "present_position": (56, 2), "present_speed": (58, 2),
        "present_load": (60, 2), "present_voltage": (62, 1), "present_temperature": (63, 1), "moving": (66, 1),
        "present_current": (69, 2),
    },
    "SCS": {
        "model_number": (3, 2), "id": (5, 1), "torque_enable": (40, 1), "goal_position": (42, 2), "goal_pwm": (44, 2),
        "moving_speed": (46, 2), "lock": (48, 1), "present_position": (56, 2), "present_load": (60, 2),
    },
}  # fmt: skip


@pytest.mark.parametrize("name", _BY_HAND)
def test_tables_against_rows_typed_by_hand(name: str) -> None:
    table = tables.table_named(name)
    assert {row: (table.item(row).address, table.item(row).size) for row in _BY_HAND[name]} == _BY_HAND[name]


def test_a_value_that_does_not_fit_is_refused_and_not_masked() -> None:
    with pytest.raises(BadValue, match="homing_offset takes -2047..2047, not 2048"):
        STS.item("homing_offset").pack(2048)
    assert [STS.item("homing_offset").pack(value).hex() for value in (-100, -2047)] == ["6408", "ff0f"]
    assert STS.item("goal_position").unpack(b"\x00\x80") == 0, "minus zero"


# Identification.


@both_back_ends
def test_a_chain_of_both_byte_orders_is_identified(feetech: Callable[..., Rig]) -> None:
    rig = feetech(FeetechServo("STS3215", 1), FeetechServo("SCS0009", 7), FeetechServo("SM8512BL", 9))
    found = scan(rig.bus("auto")).devices
    assert [(d.id, d.name, d.firmware, d.protocol) for d in found] == [
        (1, "STS3215", 310, FEETECH),
        (7, "SCS0009", 207, FEETECH),
        (9, "SM8512BL", 310, FEETECH),
    ]
    assert [d.mode and d.mode.name for d in found] == ["position"] * 3
    assert all(d.is_complete for d in found)


@both_back_ends
def test_every_id_tells_feetech_and_dynamixel_apart(feetech: Callable[..., Rig]) -> None:
    # The low byte of a model number, a return delay or a baud rate may be the ID by chance.
    for number in (1, 3, 4, 5, 9, 12, 250):
        dynamixel = Ax12(number + 1)
        rig = feetech(FeetechServo("STS3215", number), dynamixel, FeetechServo("SCS0009", number + 2))
        dynamixel.registers.put("return_delay", number + 1)
        found = scan(rig.bus("auto")).devices
        assert [d.name for d in found] == ["STS3215", "AX-12A", "SCS0009"], number


def test_an_unknown_model_is_shown_and_nothing_of_it_is_known_but_its_first_registers(
    feetech: Callable[..., Rig],
) -> None:
    servo = FeetechServo("STS3215", 4)
    servo.registers.put("model", 1060)
    (found,) = scan(feetech(servo).bus("auto")).devices
    assert (found.name, found.protocol, found.mode) == ("unknown model 1060", FEETECH, None)
    assert found.table is not None
    assert "goal_position" not in found.table.items


@both_back_ends
def test_a_servo_that_does_not_answer_writes(feetech: Callable[..., Rig]) -> None:
    servo = FeetechServo("STS3215", 4)
    servo.registers.put("response_level", 0)
    (found,) = scan(feetech(servo).bus("auto")).devices
    assert not found.answers_writes


# The cycle.


@both_back_ends
def test_sts_servos_are_read_together_and_scs_servos_one_by_one(feetech: Callable[..., Rig]) -> None:
    rig = feetech(*_sts(3), FeetechServo("SCS0009", 7, position=300), FeetechServo("SCS0009", 8))
    cycle = _cycle(rig)
    tick = cycle.tick(rig.clock.now())
    assert [line.split()[4] for line in rig.sent()] == ["02", "02", "82"]
    assert tick.values[1]["present_position"] == 2048
    assert tick.values[7]["present_position"] == 300
    assert sorted(tick.values) == [1, 2, 3, 7, 8]


@both_back_ends
def test_one_tick_writes_both_byte_orders(feetech: Callable[..., Rig]) -> None:
    servos = [*_sts(2), FeetechServo("SCS0009", 7)]
    rig = feetech(*servos)
    _torque(rig)
    cycle = _cycle(rig)
    cycle.set_target(1, "goal_position", 2100)
    cycle.set_target(2, "goal_position", -5)
    cycle.set_target(7, "goal_position", 600)
    cycle.tick(rig.clock.now())
    rig.clock.sleep_until(rig.clock.now() + 0.01)
    assert [servo.registers.get("goal_position") for servo in servos] == [2100, -5, 600]


@both_back_ends
def test_with_two_of_six_silent_the_others_lose_nothing(feetech: Callable[..., Rig]) -> None:
    rig = feetech(*_sts())
    cycle = _cycle(rig)
    for number in (2, 5):
        rig.kit.faults.start("silence", number)
    ticks, late = run(rig, cycle, 1.0)
    # Only the first misses take a whole time-out.
    assert late <= 3
    assert all({1, 3, 4, 6} <= tick.values.keys() for _, tick in ticks)
    assert {n for _, tick in ticks for n, c in tick.changes if c.new == "lost"} == {2, 5}
    rig.kit.faults.stop()
    ticks, _ = run(rig, cycle, 1.0)
    assert {n for _, tick in ticks for n, c in tick.changes if c.new == "back"} == {2, 5}


@both_back_ends
def test_a_servo_comes_back_as_one_of_another_maker(feetech: Callable[..., Rig]) -> None:
    servos = _sts(2)
    rig = feetech(*servos)
    cycle = _cycle(rig, ("present_position",))
    rig.kit.remove(servos[1])
    run(rig, cycle, 0.2)
    rig.kit.add(Ax12(2))
    run(rig, cycle, 1.0)
    assert cycle.members[2].device.name == "AX-12A"
    assert cycle.tick(rig.clock.now()).values.keys() >= {1}


@both_back_ends
def test_an_alarm_is_a_state_and_the_data_is_good(feetech: Callable[..., Rig]) -> None:
    servos = _sts(2)
    rig = feetech(*servos)
    cycle = _cycle(rig)
    servos[0].volts = 12.0
    tick = cycle.tick(rig.clock.now())
    assert tick.values[1]["state"] == 1
    assert tick.values[1]["present_position"] == 2048
    assert cycle.bus.counters.refused == 0


# EEPROM.


def _device(rig: Rig, number: int) -> ServoDevice:
    return next(device for device in scan(rig.bus("auto")).devices if device.id == number)


def _cut_power(rig: Rig) -> None:
    rig.kit.power_off(rig.clock.now())
    rig.kit.power_on(rig.clock.now())


@both_back_ends
@pytest.mark.parametrize("model", ["STS3215", "SCS0009"])
def test_a_write_of_the_eeprom_is_kept_and_the_lock_closed(feetech: Callable[..., Rig], model: str) -> None:
    servo = FeetechServo(model, 3)
    rig = feetech(servo)
    bus, device = rig.bus("auto"), _device(rig, 3)
    bus.protocols[3] = FEETECH
    assert device.table is not None
    write_register(bus, device, device.table.item("max_position_limit"), 900)
    _cut_power(rig)
    assert servo.registers.get("max_angle") == 900
    assert servo.registers.get("lock") == 1


@both_back_ends
def test_a_new_id_is_kept_and_the_servo_locked_under_it(feetech: Callable[..., Rig]) -> None:
    servo = FeetechServo("STS3215", 1)
    rig = feetech(servo)
    bus, device = rig.bus("auto"), _device(rig, 1)
    bus.protocols[1] = FEETECH
    rig.sent()
    write_register(bus, device, STS.item("id"), 5)
    assert rig.sent()[1:] == [sent.hex(" ").upper() for sent in PAGES["sts-new-id"].sent]
    _cut_power(rig)
    assert (servo.id, servo.registers.get("lock")) == (5, 1)


@both_back_ends
def test_the_eeprom_is_not_written_while_the_torque_is_on(feetech: Callable[..., Rig]) -> None:
    servo = FeetechServo("STS3215", 1)
    rig = feetech(servo)
    bus, device = rig.bus("auto"), _device(rig, 1)
    servo.registers.put("torque", 1)
    with pytest.raises(BadValue, match="operating_mode of servo 1 can only be written while its torque is off"):
        write_register(bus, device, STS.item("operating_mode"), 1)
    assert servo.registers.get("mode") == 0


# Safe stop.


def _moving(rig: Rig, cycle: Cycle, **targets: int) -> None:
    for name, raw in targets.items():
        cycle.set_target(1, name, raw)
    run(rig, cycle, 0.3)


@both_back_ends
@pytest.mark.parametrize(
    ("mode", "targets"),
    [
        (0, {"goal_position": 4000, "moving_speed": 800}),
        (1, {"moving_speed": -800}),
        (2, {"goal_pwm": 300}),
        (3, {"goal_position": 1500, "moving_speed": 800}),
    ],
)
def test_the_safe_stop_in_each_mode(feetech: Callable[..., Rig], mode: int, targets: dict[str, int]) -> None:
    (servo,) = _sts(1)
    servo.registers.put("mode", mode)
    rig = feetech(servo)
    _torque(rig)
    cycle = _cycle(rig)
    _moving(rig, cycle, **targets)
    assert abs(servo.motor.speed) > 300
    before = servo.motor.angle
    safe_stop(cycle)
    run(rig, cycle, 1.0)
    assert servo.motor.speed == 0
    assert abs(servo.motor.angle - before) < 60
    assert servo.registers.get("torque") == 1


@both_back_ends
def test_an_scs_without_limits_turns_and_is_stopped(feetech: Callable[..., Rig]) -> None:
    servo = FeetechServo("SCS0009", 1, position=100)
    servo.motor.stops = (-1e9, 1e9)
    servo.registers.put("min_angle", 0)
    servo.registers.put("max_angle", 0)
    rig = feetech(servo)
    _torque(rig)
    cycle = _cycle(rig)
    assert cycle.members[1].device.mode == SCS.mode_named("pwm")
    _moving(rig, cycle, goal_pwm=400)
    assert servo.motor.speed > 100
    safe_stop(cycle)
    run(rig, cycle, 0.5)
    assert servo.motor.speed == 0


@both_back_ends
def test_a_servo_of_many_turns_is_held_where_it_is(feetech: Callable[..., Rig]) -> None:
    (servo,) = _sts(1)
    for name, value in (("min_angle", 0), ("max_angle", 0), ("phase", 28)):
        servo.registers.put(name, value)
    servo.motor.angle = 6000
    servo.written(servo.registers.row("torque"), 0, 0)
    rig = feetech(servo)
    _torque(rig)
    cycle = _cycle(rig)
    assert cycle.members[1].device.mode == STS.mode_named("multi-turn")
    _moving(rig, cycle, goal_position=9000, moving_speed=800)
    before = servo.motor.angle
    assert before > 6100
    safe_stop(cycle)
    run(rig, cycle, 1.0)
    assert abs(servo.motor.angle - before) < 60


@both_back_ends
def test_a_wheel_that_turns_at_the_start_is_stopped(feetech: Callable[..., Rig]) -> None:
    (servo,) = _sts(1)
    servo.registers.put("mode", 1)
    servo.registers.put("goal_speed", 700)
    rig = feetech(servo)
    _torque(rig)
    cycle = _cycle(rig)
    assert stop_what_moves(cycle) == (1,)
    run(rig, cycle, 0.3)
    assert servo.motor.speed == 0


@both_back_ends
def test_lost_answers_and_damage_do_not_stop_the_data(feetech: Callable[..., Rig]) -> None:
    rig = feetech(*_sts())
    cycle = _cycle(rig)
    for word in ("checksum", "cut", "noise", "late"):
        rig.kit.faults.start(word, 3, times=1)
        ticks, _ = run(rig, cycle, 0.2)
        assert all({1, 2, 4, 5, 6} <= tick.values.keys() for _, tick in ticks[1:]), word
        assert cycle.members[3].health.state == "ok"
