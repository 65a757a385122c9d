"""The traffic of a QiMessaging connection, decoded: heads of messages, without their content; no I/O and no time.

The content is not shown: it is values of types that only the service knows, and in a login it is a secret.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.trace import Cut, Direction, StreamDecoder, TracedPacket
from urbihw_nao.qimessaging.frames import CALL, CANCELLED, ERROR, HEADER, LARGEST, MAGIC

_TYPES: Final = ("call", "reply", "error", "post", "event", "capability", "cancel", "cancelled")
_SERVICES: Final = {0: "server", 1: "service directory"}


class QiDecoder(StreamDecoder):
    """Decodes the heads of messages."""

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin."""
        start = data.find(MAGIC[:1])
        if start:
            return Cut(len(data) if start < 0 else start, noise=True)
        if not data.startswith(MAGIC[: len(data)]):
            return Cut(1, noise=True)
        if len(data) < HEADER.size:
            return None
        _, _, size, version, kind, *_ = HEADER.unpack_from(data)
        if version or not CALL <= kind <= CANCELLED or size > LARGEST:
            return Cut(len(MAGIC), noise=True)
        return Cut(HEADER.size + size) if len(data) >= HEADER.size + size else None

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        """Return the packet of a message."""
        _, number, size, _, kind, flags, service, object_, action = HEADER.unpack_from(data)
        who = _SERVICES.get(service, f"service {service}")
        detail = f"id {number}, object {object_}, action {action}, {size} bytes" + (", dynamic" if flags & 1 else "")
        problem = "the call failed" if kind == ERROR else ""
        return [TracedPacket(time, direction, who, _TYPES[kind - 1], detail, problem=problem, data=data[: HEADER.size])]


def qi(devices: Sequence[Mapping[str, Any]]) -> QiDecoder:
    """Return a decoder; the devices need not be known."""
    return QiDecoder()
