"""The traffic of an RMP, decoded, on the CAN bus and on its USB link; no I/O and no time.

Values are raw counts: what they are in SI units depends on the model (``README.md``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.trace import Chunk, Cut, Direction, FrameDecoder, StreamDecoder, TraceDecoder, TracedPacket, hex_of
from urbihw.platforms.segway import protocol, usb

_HEAD: Final = 0xF0
_CHANNEL_B: Final = 0xBB
_CONFIGURATIONS: Final = {number: name for name, (number, _) in protocol.CONFIGURATIONS.items()}


class CanDecoder(FrameDecoder):
    """Decodes frames of the CAN bus."""

    def decode(self, time: float, direction: Direction, identifier: int, data: bytes) -> TracedPacket:
        """Return the packet of a frame."""
        what, detail, problem = _content(identifier, data)
        return TracedPacket(time, direction, "", what, detail, "ok", problem, identifier.to_bytes(2, "big") + data)


class UsbDecoder(StreamDecoder):
    """Decodes the packets of the USB link."""

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin."""
        start = data.find(bytes((_HEAD,)))
        if start:
            return Cut(len(data) if start < 0 else start, noise=True)
        if len(data) > 1 and data[1] not in (0x55, 0):
            return Cut(1, noise=True)
        return Cut(usb.SIZE) if len(data) >= usb.SIZE else None

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        if not usb.is_intact(data):
            return [TracedPacket(time, direction, "", "?", hex_of(data), "bad", "the checksum is wrong", data)]
        own = data[2] in (0xAA, _CHANNEL_B)
        identifier = (data[4] << 3 | data[5] >> 5) if own else data[6] << 8 | data[7]
        what, detail, problem = _content(identifier, data[9:17])
        if data[2] == _CHANNEL_B:
            what += " (channel B)"
        return [TracedPacket(time, direction, "", what, detail, "ok", problem, data)]


class SegwayDecoder(TraceDecoder):
    """Decodes either: the first bytes tell which."""

    def __init__(self) -> None:
        self._inner: TraceDecoder | None = None

    def feed(self, chunk: Chunk) -> list[TracedPacket]:
        """Return the packets that this chunk completes."""
        if self._inner is None and chunk.data:
            self._inner = CanDecoder() if chunk.data[0] < 0x08 else UsbDecoder()
        return self._inner.feed(chunk) if self._inner is not None else []

    def flush(self) -> list[TracedPacket]:
        """Return what is left."""
        return self._inner.flush() if self._inner is not None else []


def segway(devices: Sequence[Mapping[str, Any]]) -> SegwayDecoder:
    """Return a decoder; the devices need not be known."""
    return SegwayDecoder()


def _content(identifier: int, data: bytes) -> tuple[str, str, str]:
    """Return what a frame is, its content, and what is wrong."""
    if len(data) != 8:
        return f"0x{identifier:04X}", hex_of(data), f"{len(data)} bytes instead of 8"
    if identifier == protocol.COMMAND:
        velocity, turn = (int.from_bytes(data[at : at + 2], "big", signed=True) for at in (0, 2))
        number, parameter = (int.from_bytes(data[at : at + 2], "big") for at in (4, 6))
        name = _CONFIGURATIONS.get(number, f"configuration {number}")
        return "command", f"velocity {velocity}, turn {turn}" + (f", {name} {parameter}" if number else ""), ""
    if identifier == protocol.SHUTDOWN:
        return "shutdown", "", "the base is off, or is told to switch off"
    values = protocol.decode(identifier, data)
    if not values:
        return f"0x{identifier:04X}", hex_of(data), ""
    detail = ", ".join(f"{name} {value}" for name, value in values.items())
    if identifier == protocol.STATUS:
        return "status", detail, protocol.fault_words(values["status1"], values["status2"])
    return f"monitor 0x{identifier:04X}", detail, ""
