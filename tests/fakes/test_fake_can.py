"""The adapters between a simulated CAN node and a wire of bytes."""

from __future__ import annotations

import struct

import pytest

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.can.records import Records
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.usb import UsbLink


def test_an_slcan_adapter_opens_and_passes_frames_both_ways() -> None:
    adapter = Slcan()
    assert adapter.encode(CanFrame(0x401, b"\x01")) == b""
    # What python-can sends when it opens.
    assert adapter.decode(b"C\rS6\r\rO\rO\r") == ([], b"\r" * 5)
    assert adapter.decode(b"t4138014C004E00000000\r") == ([CanFrame(0x413, bytes.fromhex("014C004E00000000"))], b"\r")
    assert adapter.encode(CanFrame(0x401, bytes.fromhex("FFF9000FFFFF0009"))) == b"t4018FFF9000FFFFF0009\r"
    assert adapter.decode(b"V\r") == ([], b"V1013\r")
    adapter.decode(b"C\r")
    assert adapter.decode(b"t4130\r") == ([], b"\a")


def test_text_that_comes_in_pieces_is_put_together() -> None:
    adapter = Slcan()
    assert adapter.decode(b"O\rt41") == ([], b"\r")
    assert adapter.decode(b"30\r") == ([CanFrame(0x413, b"")], b"\r")


LINES = (b"t9990", b"t4132AA", b"t4139", b"t413x", b"tGGG0", b"t4131\xff\xff", b"T000004130", b"?")


@pytest.mark.parametrize("line", LINES)
def test_what_is_no_command_is_answered_by_a_bell(line: bytes) -> None:
    adapter = Slcan()
    adapter.decode(b"O\r")
    assert adapter.decode(line + b"\r") == ([], b"\a")


def test_an_endless_line_is_dropped() -> None:
    adapter = Slcan()
    adapter.decode(b"O\r")
    for _ in range(1000):
        adapter.decode(b"x" * 100)
    assert adapter.decode(b"\rt4130\r")[0] == [CanFrame(0x413, b"")]


def test_records_are_those_of_linux() -> None:
    records = Records()
    frame = CanFrame(0x401, b"\x01\x02")
    data = records.encode(frame)
    assert data == struct.pack("=IB3x8s", 0x401, 2, b"\x01\x02")
    assert records.decode(data[:5]) == ([], b"")
    assert records.decode(data[5:] + data) == ([frame, frame], b"")
    assert records.decode(struct.pack("=IB3x8s", 0x80000401, 2, b"")) == ([], b"")
    assert records.decode(struct.pack("=IB3x8s", 0x401, 9, b"")) == ([], b"")


def test_faults_strike_what_the_base_says() -> None:
    device = CanDevice(SegwayRmp(), UsbLink(both=False))
    device.tick(0.0)
    device.faults.start("silence")
    assert device.tick(0.01) == []
    device.faults.stop()
    device.faults.start("checksum", times=1)
    first, *rest = device.tick(0.02)
    assert (len(first.data), len(rest)) == (18, 9)
    assert sum(first.data[:17]) != 0
    assert UsbLink().decode(first.data)[0] == []


def test_both_channels_come_through_on_usb() -> None:
    device = CanDevice(SegwayRmp(), UsbLink())
    first = device.tick(0.0)[0].data
    assert (len(first), first[2], first[20]) == (36, 0xAA, 0xBB)


def test_power_is_cut_and_given_back() -> None:
    base = SegwayRmp()
    device = CanDevice(base, Records())
    device.tick(0.0)
    device.power_off(0.1)
    assert not base.powered
    device.power_on(0.2)
    assert base.powered
