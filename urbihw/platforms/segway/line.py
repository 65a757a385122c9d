"""The way to the base, whichever it is: frames out, frames in, never waiting."""

from __future__ import annotations

from typing import Protocol

from urbihw.buses.can.frame import Frame
from urbihw.buses.can.port import CanPort
from urbihw.buses.link import Link, Port, byte_link
from urbihw.platforms.segway.usb import UsbReader, packet

_MOST_FRAMES = 1000
"""Taken at one time: about a second of them."""
_CHUNK = 65536


class Line(Protocol):
    """Frames over a port; both raise LinkGone, `send` also BusTimeout."""

    def send(self, frame: Frame) -> None:
        """Send a frame."""
        ...

    def receive(self) -> list[Frame]:
        """What has come."""
        ...

    @property
    def damaged(self) -> int:
        """How much came that was no frame."""
        ...


class CanLine:
    """Over a CAN bus."""

    def __init__(self, port: CanPort) -> None:
        self._port = port

    def send(self, frame: Frame) -> None:
        """See `Line`."""
        self._port.send(frame)

    def receive(self) -> list[Frame]:
        """See `Line`."""
        return self._port.receive(_MOST_FRAMES, 0.0)

    @property
    def damaged(self) -> int:
        """See `Line`."""
        return self._port.damaged


class UsbLine:
    """Over the USB link."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._reader = UsbReader()

    def send(self, frame: Frame) -> None:
        """See `Line`."""
        self._link.write(packet(frame))

    def receive(self) -> list[Frame]:
        """See `Line`."""
        return self._reader.feed(self._link.read(_CHUNK, 0.0))

    @property
    def damaged(self) -> int:
        """See `Line`."""
        return self._reader.damaged


def line_over(port: Port) -> Line:
    """Frames as they are over CAN, in the maker's packets over everything that moves bytes."""
    return CanLine(port) if isinstance(port, CanPort) else UsbLine(byte_link(port))
