"""The wire: order of answers, speeds, group reads with somebody missing, timing."""

from __future__ import annotations

import pytest
from fake_talk import Talk, crc16, packet2

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.errors import NoSuchUnit, UnknownRequest


def _mixed() -> ServoBus:
    return ServoBus([Ax12(1), XSeries("XL430-W250", 1), XSeries("XL330-M288", 3)])


def test_both_protocols_on_one_bus() -> None:
    wire = Talk(_mixed())
    assert wire.p1(1, "02 00 02") == "00 0C 00"
    assert wire.p2(1, "02 00 00 02 00") == "00 24 04"
    assert wire.p1(3, "01") == ""


def test_units_hear_only_their_speed() -> None:
    bus = _mixed()
    wire = Talk(bus)
    bus.baud = 1_000_000
    assert wire.p1(1, "01") == "00"
    assert wire.p2(1, "01") == ""
    bus.baud = 57_600
    assert wire.p1(1, "01") == ""
    assert wire.p2(1, "01") != ""
    # 117 647 bps are near enough to 115 200, 222 222 are not near 200 000.
    bus.baud = None
    wire.p1(1, "03 04 10")
    bus.baud = 115_200
    assert wire.p1(1, "01") == "00"
    bus.baud = 222_222
    assert wire.p1(1, "01") == ""


def test_kits_are_set_to_a_speed() -> None:
    assert {unit.baud for unit in Bioloid(baud=500_000)} == {500_000}
    assert {unit.baud for unit in Bioloid.x_series(3, baud=4_000_000)} == {4_000_000}
    for wrong in (Bioloid, Bioloid.x_series):
        with pytest.raises(UnknownRequest, match="speed 4321000"):
            wrong(baud=4_321_000)


def test_broadcast_ping_answers_in_order_of_id_past_silent_units() -> None:
    bus = ServoBus([XSeries("XL430-W250", unit) for unit in (9, 2, 5)])
    wire = Talk(bus)
    request = packet2(254, "01").hex()
    assert [answer[12:14] for answer in wire.raw(request)] == ["02", "05", "09"]
    bus.faults.start("silence", 5)
    assert [answer[12:14] for answer in wire.raw(request)] == ["02", "09"]


@pytest.mark.parametrize("request_body", ["82 41 00 01 00 01 02 03", "92 01 41 00 01 00 02 41 00 01 00 03 41 00 01 00"])
@pytest.mark.parametrize("waits", [True, False])
def test_who_waits_for_a_silent_predecessor_stays_silent(request_body: str, waits: bool) -> None:
    bus = Bioloid.x_series(3, wait_for_predecessor=waits)
    wire = Talk(bus)
    request = packet2(254, request_body).hex()
    assert [answer[12:14] for answer in wire.raw(request)] == ["01", "02", "03"]
    bus.faults.start("silence", 2)
    assert [answer[12:14] for answer in wire.raw(request)] == (["01"] if waits else ["01", "03"])


def test_a_fast_read_is_cut_where_a_unit_is_missing() -> None:
    bus = Bioloid.x_series(3)
    request = packet2(254, "8A 84 00 04 00 01 02 03").hex()
    whole = bytes.fromhex("".join(Talk(bus).raw(request)))
    assert len(whole) == 8 + 3 * 8
    assert int.from_bytes(whole[-2:], "little") == crc16(whole[:-2])
    bus.faults.start("silence", 2)
    part = bytes.fromhex("".join(Talk(bus).raw(request)))
    assert part == whole[:16]
    assert int.from_bytes(part[-2:], "little") == crc16(part[:-2])


def test_a_wrong_block_of_a_fast_read_is_what_the_others_saw() -> None:
    bus = Bioloid.x_series(2)
    bus.faults.start("checksum", 1)
    data = bytes.fromhex("".join(Talk(bus).raw(packet2(254, "8A 84 00 04 00 01 02").hex())))
    assert int.from_bytes(data[14:16], "little") != crc16(data[:14])
    assert int.from_bytes(data[-2:], "little") == crc16(data[:-2])


def test_old_firmware_has_no_fast_read() -> None:
    bus = Bioloid.x_series(1)
    bus.x_servo(1).fast_reads = False
    assert Talk(bus).raw(packet2(254, "8A 84 00 04 00 01").hex()) == []


def test_group_writes_reach_those_that_are_there() -> None:
    bus = Bioloid.x_series(2)
    wire = Talk(bus)
    assert wire.p2(254, "83 41 00 01 00 01 01 07 01 02 01") == ""
    assert [bus[unit].registers.get("led") for unit in (1, 2)] == [1, 1]
    # The last place lacks its byte.
    assert wire.p2(254, "93 01 41 00 01 00 00 02 41 00 01 00") == ""
    assert [bus[unit].registers.get("led") for unit in (1, 2)] == [0, 1]


@pytest.mark.parametrize("body", ["82 41", "83 41 00", "92 01 41", "93 01", "8A 41 00 01", "9A 01"])
def test_group_requests_cut_short_do_nothing(body: str) -> None:
    assert Talk(Bioloid.x_series(2)).raw(packet2(254, body).hex()) == []


def test_broadcast_writes_of_protocol_2_are_obeyed_and_not_answered() -> None:
    bus = Bioloid.x_series(2)
    assert Talk(bus).p2(254, "03 41 00 01") == ""
    assert Talk(bus).p2(254, "02 41 00 01 00") == ""
    assert [bus[unit].registers.get("led") for unit in (1, 2)] == [1, 1]


def test_colliding_ids_of_protocol_2() -> None:
    wire = Talk(ServoBus([XSeries("XL430-W250", 1), XSeries("XL430-W250", 1)]))
    (answer,) = wire.raw(packet2(1, "01").hex())
    data = bytes.fromhex(answer)
    assert int.from_bytes(data[-2:], "little") != crc16(data[:-2])


def test_paced_answers_take_their_time_on_the_wire() -> None:
    bus = Bioloid()
    bus.pace(1_000_000)
    # 8 bytes of request have arrived at 0; 500 us of return delay; 14 bytes of answer.
    (answer,) = bus.feed(bytes.fromhex("FF FF 01 04 02 24 08 CC"), 0.0)
    assert answer.at == pytest.approx(500e-6 + 140e-6)
    bus.feed(bytes.fromhex("FF FF 01 04 03 05 00 F2"), 1.0)
    (answer,) = bus.feed(bytes.fromhex("FF FF 01 04 02 24 08 CC"), 2.0)
    assert answer.at == pytest.approx(2.0 + 140e-6)


def test_paced_group_answers_follow_each_other() -> None:
    bus = Bioloid.x_series(2, baud=1_000_000)
    bus.pace(1_000_000)
    first, second = bus.feed(packet2(254, "82 84 00 04 00 01 02"), 0.0)
    # 15 bytes each, and each unit's return delay before it.
    assert [first.at, second.at] == pytest.approx([650e-6, 1300e-6])
    first, second = bus.feed(packet2(254, "8A 84 00 04 00 01 02"), 1.0)
    # One joint packet: one return delay, 16 and 8 bytes.
    assert [first.at, second.at] == pytest.approx([1 + 660e-6, 1 + 740e-6])


def test_a_slow_paced_wire_does_not_tear_packets() -> None:
    bus = Bioloid.x_series(1)
    bus.pace(57_600)
    request = packet2(1, "01")
    half = 5 * bus.byte_time
    assert bus.feed(request[:5], half) == []
    assert len(bus.feed(request[5:], 2 * half)) == 1


def test_units_come_and_go() -> None:
    bus = Bioloid()
    unit = bus[7]
    bus.remove(unit)
    wire = Talk(bus)
    assert wire.p1(7, "01") == ""
    bus.add(unit)
    assert wire.p1(7, "01") == "00"
    with pytest.raises(NoSuchUnit, match="unit 42: not on this bus; there are 1, 2, 3"):
        bus[42]


def test_the_log_keeps_the_last_traffic() -> None:
    bus = ServoBus([Ax12(1)], log_size=3)
    bus.feed(bytes.fromhex("FF FF 01 02 01 FB"), 1.0)
    bus.feed(bytes.fromhex("FF FF 02 02 01 FA"), 2.0)
    assert [str(line) for line in bus.log] == [
        "[1.000000] > FF FF 01 02 01 FB",
        "[1.000000] < FF FF 01 02 00 FC",
        "[2.000000] > FF FF 02 02 01 FA",
    ]
    bus.feed(b"\x00", 3.0)
    assert len(bus.log) == 3
