"""Every documented exchange, put to the fakes: same question, same bytes in answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from urbihw_fakes import captures
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.captures import Exchange
from urbihw_fakes.dynamixel import packet1, packet2
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.registers import Register
from urbihw_fakes.dynamixel.unit1 import Unit1
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.errors import UnknownRequest

EXCHANGES = captures.read("dynamixel")

GENERIC_TABLE = (
    Register("id", 3, 1),
    Register("baud", 4, 1, 1),
    Register("return_delay", 5, 1),
    Register("status_level", 16, 1, 2),
    Register("goal", 30, 2),
    Register("position", 36, 2),
    Register("registered", 44, 1),
)


class BulkUnit(Unit1):
    """A protocol 1.0 unit with firmware that knows BULK_READ, such as an MX."""

    answers_bulk_read = True


def _bulk() -> ServoBus:
    first, second = BulkUnit(1, GENERIC_TABLE), BulkUnit(2, GENERIC_TABLE)
    first.registers.put("goal", 0x8000)
    second.registers.put("position", 0x8000)
    return ServoBus([first, second])


def _alarmed() -> ServoBus:
    kit = Bioloid()
    kit.servo(1).heat(80.0)
    kit.servo(1).overload()
    return kit


def _loaded() -> ServoBus:
    kit = Bioloid()
    for name, value in (("position", 800), ("speed", 1024 + 100), ("load", 1024 + 200)):
        kit[1].pin_register(f"present_{name}", value)
    kit.servo(1).volts = 11.1
    kit.servo(1).heat(43.0)
    return kit


def _w210() -> ServoBus:
    units = [XSeries("XM430-W210", 1), XSeries("XM430-W210", 2)]
    for unit in units:
        unit.registers.put("firmware", 38)
    return ServoBus(units)


def _at(*places: tuple[int, float]) -> ServoBus:
    return ServoBus([XSeries("XM430-W350", unit, position=position) for unit, position in places])


def _bulk2() -> ServoBus:
    first, second = XSeries("XM430-W350", 1), XSeries("XM430-W350", 2)
    first.volts = 11.9
    second.heat(36.0)
    return ServoBus([first, second])


def _fast_bulk() -> ServoBus:
    bus = _at((3, 166.0), (7, 0.0), (4, 0.0))
    bus[7].pin_register("present_pwm", 421)
    bus[4].pin_register("present_temperature", 31)
    return bus


def _sensing() -> ServoBus:
    kit = Bioloid()
    kit.sensor().ir(12, 200, 3)
    kit.sensor().light(40, 45, 38)
    return kit


def _clapped() -> ServoBus:
    kit = Bioloid()
    kit.sensor().clap(-2.0, 2)
    kit.tick(-3.0)
    return kit


def _wheel() -> ServoBus:
    kit = Bioloid()
    kit.feed(EXCHANGES["ax12-wheel-mode"].sent[0], 0.0)
    return kit


def _moving_x() -> ServoBus:
    unit = XSeries("XM430-W350", 1)
    for name, value in (("current", -25), ("velocity", 100), ("position", -1500)):
        unit.pin_register(f"present_{name}", value)
    return ServoBus([unit])


SCENES: dict[str, Callable[[], ServoBus]] = {
    "p1-reset": lambda: ServoBus([Ax12(0)]),
    "p1-bulk-read": _bulk,
    "p2-ping": _w210,
    "p2-broadcast-ping": _w210,
    "p2-read-position": lambda: _at((1, 166.0)),
    "p2-sync-read": lambda: _at((1, 166.0), (2, 2079.0)),
    "p2-bulk-read": _bulk2,
    "p2-fast-sync-read": lambda: _at((3, 166.0), (7, 2079.0), (4, 1023.0)),
    "p2-fast-bulk-read": _fast_bulk,
    "p2-sync-read-present": _moving_x,
    "ax12-wheel-half-cw": _wheel,
    "ax12-read-present-loaded": _loaded,
    "axs1-read-ir-light": _sensing,
    "axs1-read-claps": _clapped,
}
ASKED = [exchange for exchange in EXCHANGES.values() if exchange.sent and exchange.name != "p2-write-stuffed"]


@pytest.mark.parametrize("exchange", ASKED, ids=lambda exchange: exchange.name)
def test_answers_as_documented(exchange: Exchange) -> None:
    scene = SCENES.get(exchange.name)
    bus = scene() if scene else (Bioloid.x_series(2) if exchange.name.startswith("p2") else Bioloid())
    answers = b"".join(answer.data for request in exchange.sent for answer in bus.feed(request, 0.0))
    assert answers.hex(" ") == b"".join(exchange.received).hex(" ")


def test_status_of_an_overloaded_and_overheated_servo() -> None:
    (answer,) = _alarmed().feed(EXCHANGES["p1-ping"].sent[0], 0.0)
    assert [answer.data] == EXCHANGES["p1-status-alarms"].received


def test_status_after_a_range_error() -> None:
    # Baud rate 255 is above its range.
    (answer,) = Bioloid().feed(bytes.fromhex("FF FF 01 04 03 04 FF F4"), 0.0)
    assert [answer.data] == EXCHANGES["p1-status-range"].received


def test_statuses_of_protocol_2() -> None:
    assert packet2.status(1, 0, bytes.fromhex("FF FF FD FF")) == EXCHANGES["p2-status-stuffed"].received[0]
    bus = Bioloid.x_series(1)
    # Writing the model number is an access error.
    (answer,) = bus.feed(bytes.fromhex("FF FF FD 00 01 07 00 03 00 00 01 02 55 5B"), 0.0)
    assert [answer.data] == EXCHANGES["p2-status-access"].received
    bus.x_servo(1).overload()
    (answer,) = bus.feed(bytes.fromhex("FF FF FD 00 01 06 00 03 41 00 01 CC E6"), 0.0)
    assert [answer.data] == EXCHANGES["p2-status-alert"].received


def test_a_stuffed_write_arrives_unstuffed() -> None:
    bus = Bioloid.x_series(1)
    # 00 FD FF FF is more than 256 turns: refused, but understood.
    (answer,) = bus.feed(EXCHANGES["p2-write-stuffed"].sent[0], 0.0)
    assert answer.data[8] == packet2.ERR_RANGE


def test_effects_of_the_unanswered_writes() -> None:
    kit = Bioloid(servos=(0, 1, 2, 3))
    kit.feed(EXCHANGES["p1-sync-write"].sent[0], 0.0)
    goals = [(kit[i].registers.get("goal_position"), kit[i].registers.get("moving_speed")) for i in (0, 1)]
    assert goals == [(0x010, 0x150), (0x220, 0x360)]
    kit.feed(EXCHANGES["ax12-sync-write-goals"].sent[0], 0.0)
    assert [kit[i].registers.get("goal_position") for i in (1, 2, 3)] == [512, 300, 700]
    kit.feed(EXCHANGES["ax12-torque-off-all"].sent[0], 0.0)
    assert [kit[i].registers.get("torque_enable") for i in (0, 1, 2, 3)] == [0, 0, 0, 0]
    x = ServoBus([XSeries("XM430-W350", 1), XSeries("XM430-W350", 2)])
    x.feed(EXCHANGES["p2-sync-write"].sent[0], 0.0)
    assert [x[i].registers.get("goal_position") for i in (1, 2)] == [150, 170]
    x.feed(EXCHANGES["p2-bulk-write"].sent[0], 0.0)
    assert (x[1].registers.get("max_voltage"), x[2].registers.get("temperature_limit")) == (160, 80)


def test_effects_of_the_answered_writes() -> None:
    kit = Bioloid()
    kit.feed(EXCHANGES["axs1-note"].sent[0], 0.0)
    kit.feed(EXCHANGES["axs1-melody"].sent[0], 0.1)
    assert [(sound.number, sound.melody) for sound in kit.sensor().played] == [(12, False), (3, True)]
    kit.feed(EXCHANGES["ax12-wheel-mode"].sent[0], 0.0)
    assert kit.servo(1).wheel
    other = ServoBus([Ax12(0)])
    other.feed(EXCHANGES["p1-reset"].sent[0], 0.0)
    assert other[1].registers.get("id") == 1


def test_every_packet_of_the_file_is_sound() -> None:
    for exchange in EXCHANGES.values():
        for packet in exchange.sent + exchange.received:
            if packet.startswith(packet2.HEADER):
                assert packet2.crc(packet[:-2]) == int.from_bytes(packet[-2:], "little"), exchange.name
            else:
                assert packet1.checksum(packet[2:-1]) == packet[-1], exchange.name


def test_a_missing_capture_is_named() -> None:
    with pytest.raises(UnknownRequest, match="nothing.hex"):
        captures.read("nothing")


def test_the_sensor_knows_its_kind() -> None:
    kit = Bioloid()
    assert isinstance(kit.sensor(), AxS1)
    with pytest.raises(UnknownRequest, match="not an AX-S1"):
        kit.sensor(1)
