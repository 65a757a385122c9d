"""Bytes of the host -> requests."""

from __future__ import annotations

from urbihw_fakes.dynamixel import packet2
from urbihw_fakes.dynamixel.framer import Framer, Request

PING1 = bytes.fromhex("FF FF 01 02 01 FB")
PING2 = bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E")


def _feed(framer: Framer, data: bytes, at: float = 0.0) -> list[Request]:
    return framer.feed(data, at, at)


def test_both_protocols_on_one_wire() -> None:
    assert _feed(Framer(), PING1 + PING2 + PING1) == [
        Request(1, 1, 1, b"", True),
        Request(2, 1, 1, b"", True),
        Request(1, 1, 1, b"", True),
    ]


def test_byte_by_byte() -> None:
    for packet, protocol in ((PING1, 1), (PING2, 2)):
        framer = Framer()
        found = [request for i in range(len(packet)) for request in _feed(framer, packet[i : i + 1])]
        assert found == [Request(protocol, 1, 1, b"", True)]


def test_garbage_before_a_packet_is_skipped() -> None:
    # The last one is a header too many: FF FF FF is not an ID.
    for garbage in ("00 12 34", "FF 00", "FF FF 01 00", "FF FF FD 01", "FF"):
        assert _feed(Framer(), bytes.fromhex(garbage) + PING1)[-1:] == [Request(1, 1, 1, b"", True)], garbage


def test_wrong_checksum_and_crc_are_told() -> None:
    assert _feed(Framer(), PING1[:-1] + b"\x00") == [Request(1, 1, 1, b"", False)]
    assert _feed(Framer(), PING2[:-1] + b"\x00") == [Request(2, 1, 1, b"", False)]


def test_half_a_packet_is_forgotten_after_100_ms_in_protocol_1() -> None:
    framer = Framer()
    _feed(framer, PING1[:4], 0.0)
    assert len(_feed(framer, PING1[4:], 0.1)) == 1
    _feed(framer, PING1[:4], 1.0)
    assert _feed(framer, PING1[4:], 1.101) == []
    assert len(_feed(framer, PING1, 1.102)) == 1


def test_half_a_packet_is_forgotten_after_1_5_ms_in_protocol_2() -> None:
    framer = Framer()
    _feed(framer, PING2[:4], 0.0)
    assert len(_feed(framer, PING2[4:], 0.0015)) == 1
    _feed(framer, PING2[:4], 1.0)
    assert _feed(framer, PING2[4:], 1.0016) == []


def test_the_pause_counts_from_byte_to_byte_on_a_slow_wire() -> None:
    framer = Framer()
    # 5 bytes at 57 600 bps take 0.87 ms: they begin where the first half ended.
    framer.feed(PING2[:5], 0.0, 0.00087)
    assert len(framer.feed(PING2[5:], 0.00087, 0.00174)) == 1


def test_status_packets_are_no_instructions() -> None:
    assert _feed(Framer(), packet2.status(1, 0, b"abc")) == []


def test_stuffing_and_back() -> None:
    for data in ("FF FF FD", "FF FF FD FF FD FD", "FF FF FD FF FF FD", "FF FF FF FD FD", "00"):
        body = bytes.fromhex(data)
        assert packet2.unstuff(packet2.stuff(body)) == body
    assert packet2.stuff(bytes.fromhex("FF FF FD 00")).hex() == "fffffdfd00"


def test_crc_of_the_catalogue() -> None:
    assert packet2.crc(b"123456789") == 0xFEE8
    assert packet2.crc(b"6789", packet2.crc(b"12345")) == 0xFEE8
