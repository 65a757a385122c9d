"""Binary mode: the frames that a remote sends instead of urbiscript after ``binaryMode(1, "tag")``.

One code byte and its fields, no length, no end mark.  Integers are big-endian, doubles little-endian IEEE, a string is
its length in 16 bits and its bytes.  The stream begins with the sender's sizes, ``02 04 08 08``.  Source: remote
UObject protocol, section 7.

======  ===========================================================  ===========
code    fields                                                       meaning
======  ===========================================================  ===========
1       name, value, low and high word of the stamp in microseconds  Update
2       name, count, values                                          Emit
10      ticket, value                                                Result
11      text                                                         Program
======  ===========================================================  ===========
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator
from typing import Any

from urbihw.frozen import frozen
from urbihw.kernel.uobject.binary import UBinary, make_binary

SIZES = b"\x02\x04\x08\x08"
UPDATE, EMIT, RESULT, PROGRAM = 1, 2, 10, 11
BINARY, DICTIONARY, NUMBER, LIST, STRING, SLOT, VOID = 0, 1, 2, 3, 5, 6, 7

MAX_FRAME_SIZE = 64 << 20
"""Maximum size of a frame in bytes; an image of 4000 by 4000 pixels has 48 million."""
MAX_DEPTH = 64
"""Maximum depth of nested lists."""
MAX_VALUES = 1 << 17
"""Maximum number of values in all lists of a frame; larger data, such as a point cloud, must be a Binary."""
VALUES_PER_STEP = 1024
"""Number of values that are decoded or converted in one step, which takes one or two milliseconds."""

_U16, _U32, _DOUBLE = struct.Struct(">H"), struct.Struct(">I"), struct.Struct("<d")


class BadBinaryFrame(ValueError):
    """The bytes are no valid frames, so that the rest of the stream cannot be decoded either."""


class StringTooLong(ValueError):
    """A string is too long to be sent in binary mode."""


@frozen
class SlotName:
    """An object, sent as its unquoted name in ``uobjects``."""

    name: str


@frozen
class Update:
    """A variable has a value since ``stamp`` (in microseconds)."""

    name: str
    value: Any
    stamp: int


@frozen
class EmitRequest:
    """A request to emit an event."""

    name: str
    payload: list[Any]


@frozen
class Result:
    """The result of a bound function."""

    ticket: str
    value: Any


@frozen
class ProgramText:
    """An urbiscript program to be run."""

    text: str


Frame = Update | EmitRequest | Result | ProgramText


# ---------------------------------------------------------------- reading


class BinaryDecoder:
    """Decodes bytes, in pieces of any size, to frames; values are Python values, UBinary and SlotName.

    A partial frame is not decoded again when more bytes arrive, and ``next`` decodes a limited number of values at a
    time, so that no sender can block the reader.

    Attributes:
        skipped: unknown code bytes that were ignored, as in the original.
        paused: whether ``next`` has stopped for a pause, and not because more bytes are needed.
    """

    def __init__(self, limit: int = MAX_FRAME_SIZE, most: int = MAX_VALUES) -> None:
        """``limit`` is the maximum size of a frame in bytes, ``most`` the maximum number of values in its lists."""
        self._buffer = bytearray()
        self._at = 0
        self._limit = limit
        self._most = most
        self._values = 0
        self._read = 0
        self._frames = self._run()
        self.skipped: list[int] = []
        self.paused = False

    @property
    def waiting(self) -> int:
        """Number of bytes that are undecoded or belong to an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames completed by these bytes.  Raises BadBinaryFrame."""
        self.add(data)
        while True:
            frame = self.next()
            if frame is not None:
                yield frame
            elif not self.paused:
                return

    def add(self, data: bytes) -> None:
        """Add bytes, which ``next`` will decode."""
        self._buffer += data

    def next(self) -> Frame | None:
        """The next frame, None if there is none yet (see ``paused``).  Raises BadBinaryFrame."""
        self.paused, self._read = False, 0
        return next(self._frames, None)

    def _run(self) -> Iterator[Frame | None]:
        """The frames in order; None when more bytes are needed or a pause is due."""
        yield from self._begin()
        while True:
            yield from self._need(1)
            code = self._buffer[0]
            if code in (UPDATE, EMIT, RESULT, PROGRAM):
                self._at, self._values = 1, 0
                frame = yield from self._frame(code)
                del self._buffer[: self._at]
                self._at = 0
                yield frame
            else:
                self.skipped.append(code)
                del self._buffer[0]
                yield from self._pause()

    def _begin(self) -> Iterator[None]:
        """Skip the rest of the text, and read the sizes."""
        yield from self._need(1)
        while self._buffer[0] in b"\r\n \t;":
            del self._buffer[0]
            yield from self._pause()
            yield from self._need(1)
        yield from self._need(len(SIZES))
        if self._buffer[: len(SIZES)] != SIZES:
            sizes = self._buffer[: len(SIZES)].hex(" ")
            raise BadBinaryFrame(f"a sender with sizes {sizes} is not understood, only {SIZES.hex(' ')}")
        del self._buffer[: len(SIZES)]

    def _need(self, size: int) -> Iterator[None]:
        """Wait until there are ``size`` undecoded bytes."""
        if self._at + size > self._limit:
            raise BadBinaryFrame(f"a frame of more than {self._limit} bytes")
        while len(self._buffer) < self._at + size:
            yield None

    def _pause(self) -> Iterator[None]:
        """Pause if many values were decoded in this step."""
        self._read += 1
        if self._read >= VALUES_PER_STEP:
            self.paused = True
            yield None

    def _frame(self, code: int) -> Generator[None, None, Frame]:
        if code == PROGRAM:
            return ProgramText((yield from self._string()))
        name = yield from self._string()
        if code == EMIT:
            return EmitRequest(name, (yield from self._list(0)))
        value = yield from self._value(0)
        if code == RESULT:
            return Result(name, value)
        low = yield from self._u32()
        high = yield from self._u32()
        return Update(name, value, high << 32 | low)

    def _u32(self) -> Generator[None, None, int]:
        yield from self._need(4)
        self._at += 4
        return int(_U32.unpack_from(self._buffer, self._at - 4)[0])

    def _bytes(self, size: int) -> Generator[None, None, bytes]:
        yield from self._need(size)
        self._at += size
        with memoryview(self._buffer) as view:
            return bytes(view[self._at - size : self._at])

    def _string(self) -> Generator[None, None, str]:
        yield from self._need(2)
        self._at += 2
        size = int(_U16.unpack_from(self._buffer, self._at - 2)[0])
        return (yield from self._bytes(size)).decode("latin-1")

    def _count(self, deep: int, what: str) -> Generator[None, None, int]:
        """The number of members of a list or a dictionary."""
        count = yield from self._u32()
        self._values += count
        if self._values > self._most or deep > MAX_DEPTH:
            raise BadBinaryFrame(f"a {what} of {count} members, {deep} deep, {self._values} values in all")
        return count

    def _list(self, deep: int) -> Generator[None, None, list[Any]]:
        count = yield from self._count(deep, "list")
        found: list[Any] = []
        buffer = self._buffer
        while len(found) < count:
            at = self._at
            if len(buffer) >= at + 9 and buffer[at] == NUMBER:  # the most frequent type: no generator needed
                self._at += 9
                found.append(_DOUBLE.unpack_from(buffer, at + 1)[0])
            else:
                found.append((yield from self._value(deep + 1)))
            yield from self._pause()
        return found

    def _value(self, deep: int) -> Generator[None, None, Any]:
        yield from self._need(1)
        kind = self._buffer[self._at]
        self._at += 1
        if kind == NUMBER:
            yield from self._need(8)
            self._at += 8
            return _DOUBLE.unpack_from(self._buffer, self._at - 8)[0]
        if kind == STRING:
            return (yield from self._string())
        if kind == BINARY:
            keywords = yield from self._string()
            size = yield from self._u32()
            return make_binary((yield from self._bytes(size)), keywords.partition("\n")[0].replace(";", " "))
        if kind == LIST:
            return (yield from self._list(deep))
        if kind == DICTIONARY:
            count = yield from self._count(deep, "dictionary")
            members: dict[str, Any] = {}
            for _ in range(count):
                key = yield from self._string()
                members[key] = yield from self._value(deep + 1)
                yield from self._pause()
            return members
        if kind == SLOT:
            return SlotName((yield from self._string()))
        if kind == VOID:
            return None
        raise BadBinaryFrame(f"a value of unknown type {kind}")


# ---------------------------------------------------------------- writing


def encode(frame: Frame) -> list[bytes | memoryview]:
    """Encode a frame, in parts so that binaries are not copied.  Raises StringTooLong, and TypeError for a value that
    cannot be sent."""
    parts: list[bytes | memoryview] = []
    if isinstance(frame, Update):
        parts.append(b"\x01" + _string(frame.name))
        _value(parts, frame.value)
        parts.append(_U32.pack(frame.stamp & 0xFFFFFFFF) + _U32.pack(frame.stamp >> 32 & 0xFFFFFFFF))
    elif isinstance(frame, EmitRequest):
        parts.append(b"\x02" + _string(frame.name) + _U32.pack(len(frame.payload)))
        for value in frame.payload:
            _value(parts, value)
    elif isinstance(frame, Result):
        parts.append(b"\x0a" + _string(frame.ticket))
        _value(parts, frame.value)
    else:
        parts.append(b"\x0b" + _string(frame.text))
    return parts


def members_of(value: Any) -> int:
    """The number of values in the lists and dictionaries of a value."""
    if isinstance(value, list | tuple):
        return len(value) + sum(map(members_of, value))
    if isinstance(value, dict):
        return len(value) + sum(map(members_of, value.values()))
    return 0


def _string(text: str) -> bytes:
    data = latin(text)
    if len(data) > 0xFFFF:
        raise StringTooLong(f"a text of {len(data)} bytes; binary mode carries at most 65535")
    return _U16.pack(len(data)) + data


def latin(text: str) -> bytes:
    """The bytes of a text: one byte per character, or UTF-8 if a character is not in latin-1."""
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError:
        return text.encode("utf-8")


def _value(parts: list[bytes | memoryview], value: Any) -> None:
    if value is None:
        parts.append(b"\x07")
    elif isinstance(value, bool | int | float):
        parts.append(b"\x02" + _DOUBLE.pack(value))
    elif isinstance(value, str):
        parts.append(b"\x05" + _string(value))
    elif isinstance(value, UBinary):
        parts.append(b"\x00" + _string(value.keywords) + _U32.pack(len(value)))
        parts.append(memoryview(value.data).cast("B") if not isinstance(value.data, bytes) else value.data)
    elif isinstance(value, list | tuple):
        parts.append(b"\x03" + _U32.pack(len(value)))
        for member in value:
            _value(parts, member)
    elif isinstance(value, dict):
        parts.append(b"\x01" + _U32.pack(len(value)))
        for key, member in value.items():
            parts.append(_string(str(key)))
            _value(parts, member)
    elif isinstance(value, SlotName):
        parts.append(b"\x06" + _string(value.name))
    else:
        raise TypeError(f"a {type(value).__name__} cannot be sent to another process")
