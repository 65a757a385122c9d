"""Messages between a server and a UObject in another process: conversion between bytes and values, without sockets.

The server prints lines (see ``urbihw.client.lines``).  On the channel ``__ExternalMessage__`` the text is a list, whose
first member is a ``Code``.  The remote sends urbiscript (``literal`` formats values) or frames (see ``frames``).
Source: remote UObject protocol.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

from urbihw.client.lines import BadLine, Binary, Line, Lines
from urbihw.client.values import NotAValue, value_of
from urbihw.frozen import frozen
from urbihw.kernel.uobject.binary import UBinary, make_binary
from urbihw.kernel.uremote.frames import MAX_FRAME_SIZE, SlotName, latin

CHANNEL = "__ExternalMessage__"


class MessageCode(IntEnum):
    """The first member of a message of the server."""

    CALL = 0
    CHANGED = 1
    EVENT = 2
    EVENT_END = 3
    NEW = 4
    DELETE = 5
    NO_RTP = 8
    RTP = 9
    LOCAL = 12


class ProtocolError(ValueError):
    """The server's output is invalid; the connection cannot be used any more."""


@frozen
class ServerLine:
    """A line of the server: time stamp (milliseconds of its clock), channel, and text or value.

    Lines on ``__ExternalMessage__`` and on channels of requested values have a ``value``, or are not ``valid``.
    """

    stamp: int
    channel: str
    text: str
    value: Any = None
    valid: bool = True


class ServerReader:
    """Decodes the server's bytes, in pieces of any size, to messages.

    ``valued`` are the channels, in addition to ``__ExternalMessage__``, on which values are expected.
    """

    def __init__(self, limit: int = MAX_FRAME_SIZE) -> None:
        """``limit`` is the maximum length of a line in bytes."""
        self._lines = Lines(limit, self._has_values)
        self.valued: set[str] = set()

    def feed(self, data: bytes) -> Iterator[ServerLine]:
        """The messages completed by these bytes.  Raises ProtocolError if a line is too long."""
        try:
            lines = self._lines.feed(data)
        except BadLine as error:
            raise ProtocolError(str(error)) from error
        for line in lines:
            if line.stamp is not None:
                yield self._message(line, line.stamp)

    def _has_values(self, channel: str) -> bool:
        return channel == CHANNEL or channel in self.valued

    def _message(self, line: Line, stamp: int) -> ServerLine:
        channel = line.channel
        if not self._has_values(channel):
            return ServerLine(stamp, channel, line.text.decode("latin-1"))
        if channel == CHANNEL or not line.is_error:
            try:
                return ServerLine(stamp, channel, "", value_of(line, _binary, SlotName))
            except NotAValue:
                pass
        return ServerLine(stamp, channel, line.text.decode("latin-1"), None, False)


def _binary(found: Binary) -> UBinary:
    return make_binary(found.data, found.keywords.rstrip(" ;"))


# ---------------------------------------------------------------- writing


def quoted(text: str) -> str:
    """A string literal of urbiscript, with one character per byte."""
    parts = []
    for byte in latin(text):
        if byte in (0x22, 0x5C):
            parts.append("\\" + chr(byte))
        elif byte == 0x0A:
            parts.append("\\n")
        elif byte == 0x09:
            parts.append("\\t")
        elif 0x20 <= byte < 0x7F:
            parts.append(chr(byte))
        else:
            parts.append(f"\\x{byte:02x}")
    return '"' + "".join(parts) + '"'


def literal(value: Any) -> bytes:
    """A value as urbiscript text.  Raises TypeError for a value that cannot be sent."""
    if value is None:
        return b"nil"
    if isinstance(value, bool):
        return b"1" if value else b"0"
    if isinstance(value, int | float):
        return number_text(float(value)).encode()
    if isinstance(value, str):
        return quoted(value).encode("latin-1")
    if isinstance(value, UBinary):
        head = f'Global.Binary.new({quoted(value.keywords)}, "\\B({len(value)})('
        return b"".join((head.encode("latin-1"), value.data, b')")'))
    if isinstance(value, list | tuple):
        return b"[" + b", ".join(literal(member) for member in value) + b"]"
    if isinstance(value, dict):
        if not value:
            return b"[=>]"
        return b"[" + b",".join(
            quoted(str(key)).encode("latin-1") + b"=>" + literal(member) for key, member in value.items()
        ) + b"]"
    if isinstance(value, SlotName):
        return value.name.encode("latin-1")
    raise TypeError(f"a {type(value).__name__} cannot be sent to another process")


def number_text(value: float) -> str:
    """A number as text, with all digits."""
    if math.isinf(value) or math.isnan(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    text = repr(value)
    return text.removesuffix(".0")
