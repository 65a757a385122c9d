"""The traffic of a Spykee, decoded; no I/O and no time.  Names and passwords of a login are never shown."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.trace import Cut, Direction, StreamDecoder, TracedPacket, hex_of
from urbihw.platforms.spykee import protocol as p

_HEADER: Final = struct.Struct(">2sBH")
_MAGIC: Final = b"PK"
_NAMES: Final = {
    p.AUDIO: "audio", p.VIDEO: "picture", p.POWER: "power", p.LED: "led", p.MOVE: "move", p.FILE: "file",
    p.PLAY: "play", p.STOP: "stop sound", p.VOLUME: "volume", p.LOGIN: "login", p.LOGIN_REPLY: "login reply",
    p.CONFIGURATION: "configuration", p.NETWORKS: "networks", p.STREAM: "stream", p.ENGINE: "engine", p.LOG: "log",
}  # fmt: skip
_ENGINE: Final = {p.UNDOCK: "undock", p.DOCK: "dock", p.CANCEL: "cancel"}
_STREAMS: Final = {p.CAMERA: "camera", p.MICROPHONE: "microphone", p.LOUDSPEAKER: "loudspeaker"}
_SECRET: Final = {p.LOGIN, p.CONFIGURATION, p.NETWORKS}
"""Types whose content may be a password."""


class SpykeeDecoder(StreamDecoder):
    """Decodes the packets of the control connection."""

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin."""
        start = data.find(_MAGIC[:1])
        if start:
            return Cut(len(data) if start < 0 else start, noise=True)
        if len(data) > 1 and data[1:2] != _MAGIC[1:]:
            return Cut(1, noise=True)
        if len(data) < _HEADER.size:
            return None
        size = _HEADER.size + int.from_bytes(data[3:5], "big")
        return Cut(size) if len(data) >= size else None

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        kind, payload = data[2], data[_HEADER.size :]
        detail, problem = _content(kind, direction, payload)
        shown = data[: _HEADER.size] if kind in _SECRET else data
        return [
            TracedPacket(time, direction, "", _NAMES.get(kind, f"type {kind}"), detail, problem=problem, data=shown)
        ]


def spykee(devices: Sequence[Mapping[str, Any]]) -> SpykeeDecoder:
    """Return a decoder; the devices need not be known."""
    return SpykeeDecoder()


def _content(kind: int, direction: Direction, payload: bytes) -> tuple[str, str]:
    """Return the content of a packet, and what is wrong."""
    if kind == p.MOVE and len(payload) == 2:
        left, right = struct.unpack("bb", payload)
        return f"left {left} %, right {right} %", ""
    if kind == p.LOGIN:
        return f"{len(payload)} bytes, not shown", ""
    if kind == p.LOGIN_REPLY:
        found = p.read_login_reply(payload)
        if found is None:
            return "", "the login is refused"
        return f"{found.names[0]}, firmware {found.firmware}, {'docked' if found.docked else 'not docked'}", ""
    if kind == p.POWER and len(payload) == 1:
        level = p.read_power(payload)
        return (f"{level} %" if level >= 0 else f"{level} (charging)"), ""
    if kind == p.STREAM and len(payload) == 2:
        return f"{_STREAMS.get(payload[0], payload[0])} {'on' if payload[1] else 'off'}", ""
    if kind == p.ENGINE and len(payload) == 1 and direction == ">":
        return _ENGINE.get(payload[0], str(payload[0])), ""
    if kind == p.ENGINE and len(payload) == 1:
        return {p.IS_UNDOCKED: "undocked", p.IS_DOCKED: "docked"}.get(payload[0], str(payload[0])), ""
    if kind in (p.CONFIGURATION, p.NETWORKS):
        return f"{len(payload)} bytes, not shown", ""
    if kind == p.LOG:
        return " / ".join(p.read_log(payload)), ""
    return (f"{len(payload)} bytes" if len(payload) > 16 else hex_of(payload)), ""
