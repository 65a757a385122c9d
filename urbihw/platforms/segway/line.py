"""Frames to and from the base over either port, without waiting."""

from __future__ import annotations

from typing import Protocol

from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort
from urbihw.buses.link import Link, Port, byte_link
from urbihw.platforms.segway.usb import UsbReader, packet

_MOST_FRAMES = 1000
"""Frames read at one time at most: those of about a second."""
_CHUNK = 65536


class RmpLine(Protocol):
    """Frames over a port; both raise LinkGone, `send` also BusTimeout."""

    def send(self, frame: CanFrame) -> None:
        """Send one frame to the base."""
        ...

    def receive(self) -> list[CanFrame]:
        """Return the frames received so far."""
        ...

    @property
    def damaged(self) -> int:
        """The number of damaged frames or packets."""
        ...


class CanLine:
    """Over a CAN bus."""

    def __init__(self, port: CanPort) -> None:
        self._port = port

    def send(self, frame: CanFrame) -> None:
        """Send a frame as it is."""
        self._port.send(frame)

    def receive(self) -> list[CanFrame]:
        """Return the frames received so far, _MOST_FRAMES at most."""
        return self._port.receive(_MOST_FRAMES, 0.0)

    @property
    def damaged(self) -> int:
        """The number of damaged frames that the port has counted."""
        return self._port.damaged


class UsbLine:
    """Over the USB link."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._reader = UsbReader()

    def send(self, frame: CanFrame) -> None:
        """Send a frame in a packet of the maker."""
        self._link.write(packet(frame))

    def receive(self) -> list[CanFrame]:
        """Return the frames that the received bytes complete."""
        return self._reader.feed(self._link.read(_CHUNK, 0.0))

    @property
    def damaged(self) -> int:
        """The number of damaged packets since the link was opened."""
        return self._reader.damaged


def line_over(port: Port) -> RmpLine:
    """Return the line for a port: plain frames over CAN, the maker's packets over a byte link."""
    return CanLine(port) if isinstance(port, CanPort) else UsbLine(byte_link(port))
