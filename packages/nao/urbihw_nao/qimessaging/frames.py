"""The header of a message, and messages out of a stream of bytes (fact sheet, section 4).

Offsets, all u32 and little-endian but 12 to 15::

    0 magic 42 DE AD 42   4 id   8 payload size   12 version (u16)   14 type   15 flags
    16 service   20 object   24 action
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

MAGIC: Final = b"\x42\xde\xad\x42"
HEADER: Final = Struct("<4sIIHBBIII")
LARGEST: Final = 16 << 20
"""Bytes of a payload: a picture of 2560 x 1920 in three bytes fits."""
CALL, REPLY, ERROR, POST, EVENT, CAPABILITY, CANCEL, CANCELLED = range(1, 9)
DYNAMIC: Final = 1
"""Flag: the payload is a dynamic value, whatever the signature says."""


@frozen
class QiMessage:
    """A message; ``type`` is one of CALL ... CANCELLED."""

    type: int
    id: int
    service: int
    object: int
    action: int
    payload: bytes = b""
    flags: int = 0

    def __bytes__(self) -> bytes:
        head = HEADER.pack(
            MAGIC, self.id, len(self.payload), 0, self.type, self.flags, self.service, self.object, self.action
        )
        return head + self.payload


class QiFramer:
    """Splits a stream into messages.

    Attributes:
        largest: bytes of a payload at most.
    """

    def __init__(self, largest: int = LARGEST) -> None:
        self.largest = largest
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[QiMessage]:
        """The messages that are complete with these bytes.

        Raises BadFrame at an invalid header: after it nothing in the stream can be believed.
        """
        buffer = self._buffer
        buffer += data
        found: list[QiMessage] = []
        at = 0
        while len(buffer) - at >= HEADER.size:
            magic, number, size, version, kind, flags, service, object_, action = HEADER.unpack_from(buffer, at)
            if magic != MAGIC or version != 0 or not CALL <= kind <= CANCELLED:
                raise BadFrame("what came is no message of QiMessaging")
            if size > self.largest:
                raise BadFrame(f"a message of {size} bytes; at most {self.largest} are accepted")
            end = at + HEADER.size + size
            if end > len(buffer):
                break
            payload = bytes(buffer[at + HEADER.size : end])
            found.append(QiMessage(kind, number, service, object_, action, payload, flags))
            at = end
        del buffer[:at]
        if not MAGIC.startswith(buffer[: len(MAGIC)]):
            # Some strangers say less than a header, and then wait.
            raise BadFrame("what came is no message of QiMessaging")
        return found
