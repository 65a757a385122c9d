"""Bytes of TCPROS: the header of a connection, and frames with a length before them.

A header is a length (u32) and fields, each a length (u32) and ``name=value`` in UTF-8; all integers are little-endian::

    2a 00 00 00  16 00 00 00  t o p i c = / c h a t t e r ...

Source: wiki.ros.org/ROS/Connection Header and ROS/TCPROS.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Final

from urbihw.ros.errors import PeerError

MAX_HEADER_BYTES: Final = 1 << 20
"""Maximum size of a header: it may hold the definition of a message."""
MAX_FRAME_BYTES: Final = 64 << 20
"""Maximum size of a message; the length comes from the other side, and is checked before memory is taken."""
MAX_FIELDS: Final = 64
_LENGTH: Final = struct.Struct("<I")


def frame(data: bytes | memoryview) -> bytes:
    """A message with its length before it."""
    return _LENGTH.pack(len(data)) + data


def length_of(data: bytes, limit: int) -> int:
    """The length in four bytes.  Raises PeerError above the limit."""
    length: int = _LENGTH.unpack(data)[0]
    if length > limit:
        raise PeerError(f"a peer announces {length} bytes, more than the {limit} that are taken")
    return length


def encode_header(fields: Mapping[str, str]) -> bytes:
    """The bytes of a header, with its length."""
    return frame(b"".join(frame(f"{name}={value}".encode()) for name, value in fields.items()))


def decode_header(data: bytes) -> dict[str, str]:
    """The fields of a header, given without its length.  Raises PeerError for other bytes."""
    fields: dict[str, str] = {}
    at = 0
    while at < len(data):
        if len(data) - at < 4:
            raise PeerError("a header ends inside a length")
        length = length_of(data[at : at + 4], len(data) - at - 4)
        name, found, value = data[at + 4 : at + 4 + length].partition(b"=")
        if not found or len(fields) >= MAX_FIELDS:
            raise PeerError("a header has a field without '='" if not found else "a header has too many fields")
        try:
            fields[name.decode()] = value.decode()
        except UnicodeDecodeError as error:
            raise PeerError("a header is not UTF-8 text") from error
        at += 4 + length
    return fields
