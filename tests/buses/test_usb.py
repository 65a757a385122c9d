"""What is particular to links over USB: packets, several devices, and what can be wrong."""

from __future__ import annotations

import errno
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import usb.core  # type: ignore[import-untyped]

from urbihw import buses
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Context
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.usb_backend import Bus
from urbihw_fakes.nxt.usb_endpoint import UsbEndpoint

BATTERY = bytes.fromhex("00 0b")
MILLIVOLTS = bytes.fromhex("02 0b 00 d2 1e")


@pytest.fixture
def end(tmp_path: Path) -> Iterator[UsbEndpoint]:
    with UsbEndpoint(NxtDevice(), str(tmp_path / "bus")) as endpoint:
        endpoint.start()
        yield endpoint


def test_a_read_gives_at_most_one_packet(end: UsbEndpoint) -> None:
    with buses.open_link(end.url) as link:
        assert link.packets and link.baud == 12_000_000
        link.write(BATTERY)
        link.write(BATTERY)
        deadline = link.clock.now() + 5
        assert [link.read(64, deadline), link.read(64, deadline)] == [MILLIVOLTS, MILLIVOLTS]


def test_spying_keeps_packets(end: UsbEndpoint, capsys: pytest.CaptureFixture[str]) -> None:
    with buses.open_link(f"spy://{end.url}") as link:
        assert link.packets
        link.write(BATTERY)
        link.read(64, link.clock.now() + 5)
    assert "> 00 0B" in capsys.readouterr().err


def test_unplugged_and_back(end: UsbEndpoint) -> None:
    link = buses.open_link(end.url)
    end.unplug()
    with pytest.raises(LinkGone, match="was it unplugged"):
        link.write(BATTERY)
    link.close()
    with pytest.raises(Unavailable, match="no USB device 0694:0002; is it plugged in and switched on"):
        buses.open(end.url)
    end.plug()
    with buses.open_link(end.url) as again:
        again.write(BATTERY)
        assert again.read(64, again.clock.now() + 5) == MILLIVOLTS


def test_several_are_told_apart_by_their_serial_number(end: UsbEndpoint) -> None:
    device = NxtDevice()
    device.brick.address = "00165311223300"
    with UsbEndpoint(device, end.folder) as second:
        second.start()
        with pytest.raises(Unavailable, match=r"name one with \?serial= \(there are: 001653010203, 001653112233\)"):
            buses.open(end.url)
        with buses.open(f"{end.url}&serial=001653112233") as port:
            assert port.is_open
    with pytest.raises(Unavailable, match="and serial number 001653112233"):
        buses.open(f"{end.url}&serial=001653112233")


def test_in_use(end: UsbEndpoint) -> None:
    with buses.open(end.url), pytest.raises(Unavailable, match="in use by another program"):
        buses.open(end.url)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.EACCES, "urbihw/share/99-urbihw.rules and add yourself to the group dialout"),
        (errno.EIO, "cannot open USB device"),
    ],
)
def test_what_cannot_be_opened(end: UsbEndpoint, monkeypatch: pytest.MonkeyPatch, number: int, words: str) -> None:
    def refuse(*_: Any) -> None:
        raise usb.core.USBError("Access denied", -3, number)

    monkeypatch.setattr(Bus, "open_device", refuse)
    with pytest.raises(Unavailable, match=words):
        buses.open(end.url)


def test_no_libusb(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("libusb1", "libusb0", "openusb"):
        monkeypatch.setattr(importlib.import_module(f"usb.backend.{name}"), "get_backend", lambda *_, **__: None)
    with pytest.raises(Unavailable, match="libusb is missing.*apt install libusb-1.0-0"):
        buses.open("usb://0694:0002")


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("usb://nxt", "write usb://VENDOR:PRODUCT in hex"),
        ("usb://0694:0002?speed=1", "speed: no such parameter; there are: serial, backend, at"),
        ("usb://0694:0002?backend=nowhere:bus", "cannot make the backend 'nowhere:bus'"),
        ("usb://0694:0002?backend=math:bus", "cannot make the backend 'math:bus'"),
    ],
)
def test_bad_urls(url: str, words: str) -> None:
    with pytest.raises(BadUrl, match=words):
        buses.port_for(url, Context()).open()
