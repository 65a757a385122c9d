"""Messages between a server and a UObject in another process: bytes to values and back, no sockets.

The server prints ``[00001234:channel] text`` lines.  On the channel ``__ExternalMessage__`` the text is a list, whose
first member is a ``Code``; a Binary in it is ``BIN size keywords``, a line feed, and the raw bytes.  What the remote
says is urbiscript (``literal`` writes its values) or frames (see ``frames``).  Source: remote UObject protocol.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from urbihw.kernel.uobject.binary import UBinary, make_binary
from urbihw.kernel.uremote.frames import LIMIT, SlotName, latin

CHANNEL = "__ExternalMessage__"


class Code(IntEnum):
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


class Garbage(ValueError):
    """The server says what no server says; the connection is of no use any more."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the server: when (milliseconds of its clock), on which channel, and the text or value.

    Lines on ``__ExternalMessage__`` and on channels whose values were asked for have a ``value``.
    """

    stamp: int
    channel: str
    text: str
    value: Any = None
    valid: bool = True


class _Short(Exception):
    """The value goes on behind the bytes at hand, which have to be this many at least."""

    def __init__(self, wanted: int) -> None:
        self.wanted = wanted


class _Bad(ValueError):
    """The text is no value."""


_HEAD = re.compile(rb"\[(\d{8,20})(?::([^\]\n]{0,200}))?\] ?")
_NUMBER = re.compile(rb"[-+]?(?:0x[0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|inf|nan)")
_STRING = re.compile(rb'"((?:[^"\\\n]|\\.)*)"', re.DOTALL)
_WORD = re.compile(rb"[A-Za-z_][\w.]*")
_BINARY = re.compile(rb"BIN (\d{1,10})[ ]?([^\n\r]*)\r?\n")
_BLANKS = re.compile(rb"[ \t\r]*")
_ESCAPE = re.compile(rb"\\(x[0-9a-fA-F]{2}|[0-7]{1,3}|.)", re.DOTALL)
_ESCAPES = {b"n": b"\n", b"t": b"\t", b"r": b"\r", b"a": b"\a", b"b": b"\b", b"f": b"\f", b"v": b"\v"}
_CONSTANTS = {b"nil": None, b"void": None, b"true": True, b"false": False}
_HEAD_SIZE = 256
_DEEPEST = 64


class Reader:
    """The server's bytes, cut anywhere, to lines.

    ``valued`` are the channels, beside ``__ExternalMessage__``, on which values are expected.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._buffer = bytearray()
        self._wanted = 1
        self._cut = False
        self._limit = limit
        self.valued: set[str] = set()

    def feed(self, data: bytes) -> Iterator[Line]:
        """The lines that these bytes complete; raises Garbage when one does not end."""
        self._buffer += data
        if self._cut and b"\n" not in data and len(self._buffer) <= self._limit:
            return  # without its end, a line is not worth reading from the beginning again
        while len(self._buffer) >= self._wanted:
            try:
                line, size = self._line(bytes(self._buffer) if len(self._buffer) < 65536 else self._buffer)
            except _Short as short:
                if max(short.wanted, len(self._buffer)) > self._limit:
                    raise Garbage(f"the server sends a line of more than {self._limit} bytes") from None
                self._wanted, self._cut = short.wanted, True
                return
            self._cut = False
            del self._buffer[:size]
            self._wanted = 1
            if line is not None:
                yield line

    def _line(self, buffer: bytes | bytearray) -> tuple[Line | None, int]:
        head = _HEAD.match(buffer)
        if head is None:
            end = self._end(buffer, 0)
            return None, end + 1
        channel = (head[2] or b"").decode("latin-1")
        if channel != CHANNEL and channel not in self.valued:
            end = self._end(buffer, head.end())
            return Line(int(head[1]), channel, buffer[head.end() : end].decode("latin-1")), end + 1
        if channel != CHANNEL and buffer.startswith(b"!!! ", head.end()):
            end = self._end(buffer, head.end())
            return Line(int(head[1]), channel, buffer[head.end() : end].decode("latin-1"), None, False), end + 1
        try:
            value, at = _value(buffer, head.end(), 0)
        except _Bad:
            end = self._end(buffer, head.end())
            text = buffer[head.end() : end].decode("latin-1")
            return Line(int(head[1]), channel, text, None, False), end + 1
        end = self._end(buffer, at)
        return Line(int(head[1]), channel, "", value), end + 1

    @staticmethod
    def _end(buffer: bytes | bytearray, at: int) -> int:
        end = buffer.find(b"\n", at)
        if end < 0:
            raise _Short(len(buffer) + 1)
        return end


def _value(buffer: bytes | bytearray, at: int, deep: int) -> tuple[Any, int]:
    at = _BLANKS.match(buffer, at).end()  # type: ignore[union-attr]
    first = buffer[at : at + 1]
    if not first:
        raise _Short(len(buffer) + 1)
    if first == b"[":
        return _list(buffer, at + 1, deep)
    if first == b'"':
        return _string(buffer, at)
    if first in b"+-.0123456789" or buffer.startswith((b"inf", b"nan"), at):
        return _number(buffer, at)
    if buffer.startswith(b"BIN ", at):
        return _binary(buffer, at)
    word = _WORD.match(buffer, at)
    if word is None:
        raise _Bad
    if word.end() == len(buffer):
        raise _Short(len(buffer) + 1)
    return _CONSTANTS.get(word[0], SlotName(word[0].decode("latin-1"))), word.end()


def _number(buffer: bytes | bytearray, at: int) -> tuple[float, int]:
    number = _NUMBER.match(buffer, at)
    if number is not None and number.end() < len(buffer):
        return (float(int(number[0], 16)) if b"x" in number[0] else float(number[0])), number.end()
    if len(buffer) - at > _HEAD_SIZE:
        raise _Bad
    if number is None and b"\n" in buffer[at:]:
        raise _Bad
    raise _Short(len(buffer) + 1)


def _string(buffer: bytes | bytearray, at: int) -> tuple[str, int]:
    found = _STRING.match(buffer, at)
    if found is None:
        if buffer.find(b"\n", at) >= 0:
            raise _Bad
        raise _Short(len(buffer) + 1)
    text = bytes(found[1])
    if b"\\" in text:
        text = _ESCAPE.sub(_unescaped, text)
    return text.decode("latin-1"), found.end()


def _unescaped(match: re.Match[bytes]) -> bytes:
    what = match[1]
    if what[:1] == b"x" and len(what) == 3:
        return bytes([int(what[1:], 16)])
    if what.isdigit():
        return bytes([int(what, 8) & 0xFF])
    return _ESCAPES.get(what, what)


def _binary(buffer: bytes | bytearray, at: int) -> tuple[UBinary, int]:
    head = _BINARY.match(buffer, at)
    if head is None:
        if buffer.find(b"\n", at) >= 0 or len(buffer) - at > 4096:
            raise _Bad
        raise _Short(len(buffer) + 1)
    end = head.end() + int(head[1])
    if end >= len(buffer):
        raise _Short(end + 1)
    return make_binary(bytes(memoryview(buffer)[head.end() : end]), head[2].decode("latin-1").rstrip(" ;")), end


def _list(buffer: bytes | bytearray, at: int, deep: int) -> tuple[Any, int]:
    """A list, or a dictionary: its members have ``=>`` in them."""
    if deep > _DEEPEST:
        raise _Bad
    found: list[Any] = []
    keyed: dict[str, Any] = {}
    while True:
        at = _BLANKS.match(buffer, at).end()  # type: ignore[union-attr]
        mark = bytes(buffer[at : at + 2])
        if len(mark) < 2:
            raise _Short(len(buffer) + 1)
        if mark == b"=>":
            at = _BLANKS.match(buffer, at + 2).end()  # type: ignore[union-attr]
            if not found:
                if buffer[at : at + 1] == b"]":
                    return {}, at + 1
                raise _Bad
            keyed[str(found.pop())], at = _value(buffer, at, deep + 1)
        elif mark[:1] == b"]":
            return (keyed if keyed else found), at + 1
        elif mark[:1] == b",":
            at += 1
        else:
            value, at = _value(buffer, at, deep + 1)
            found.append(value)


# ---------------------------------------------------------------- writing


def quoted(text: str) -> str:
    """A string literal of urbiscript, one character per byte."""
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
    """A value as urbiscript text; raises TypeError for one that cannot travel."""
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
    """A number with all its digits."""
    if math.isinf(value) or math.isnan(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    text = repr(value)
    return text.removesuffix(".0")
