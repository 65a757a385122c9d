"""Binary mode: what a remote sends after ``binaryMode(1, "tag")``, as frames instead of urbiscript.

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
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from urbihw.kernel.uobject.binary import UBinary, make_binary

SIZES = b"\x02\x04\x08\x08"
UPDATE, EMIT, RESULT, PROGRAM = 1, 2, 10, 11
BINARY, DICTIONARY, NUMBER, LIST, STRING, SLOT, VOID = 0, 1, 2, 3, 5, 6, 7

LIMIT = 64 << 20
"""The most bytes that a frame may have; an image of 4000 by 4000 pixels has 48 million."""
DEEPEST = 64
"""How deep lists may nest."""
MOST = 1 << 20
"""The most members of a list."""

_U16, _U32, _DOUBLE = struct.Struct(">H"), struct.Struct(">I"), struct.Struct("<d")


class BadFrame(ValueError):
    """The bytes are no frames; what follows cannot be understood either."""


class TooLong(ValueError):
    """A string is too long to be sent in binary mode."""


@dataclass(frozen=True, slots=True)
class SlotName:
    """An object, sent as the bare name under which ``uobjects`` has it."""

    name: str


@dataclass(frozen=True, slots=True)
class Update:
    """A variable has a value since ``stamp`` microseconds."""

    name: str
    value: Any
    stamp: int


@dataclass(frozen=True, slots=True)
class Emit:
    """An event is to be emitted."""

    name: str
    payload: list[Any]


@dataclass(frozen=True, slots=True)
class Result:
    """What a bound function gave."""

    ticket: str
    value: Any


@dataclass(frozen=True, slots=True)
class Program:
    """Some urbiscript."""

    text: str


Frame = Update | Emit | Result | Program


class _Short(Exception):
    """The frame goes on behind the bytes at hand; ``wanted`` is how many there have to be at least."""

    def __init__(self, wanted: int) -> None:
        self.wanted = wanted


# ---------------------------------------------------------------- reading


class Decoder:
    """Bytes, cut anywhere, to frames; values are Python values, UBinary and SlotName.

    ``skipped`` is called with each code byte that is unknown and was left out, as the original does.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._buffer = bytearray()
        self._wanted = 1
        self._begun = False
        self._limit = limit
        self.skipped: list[int] = []

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames that these bytes complete; raises BadFrame."""
        self._buffer += data
        while len(self._buffer) >= self._wanted:
            if not self._begun:
                if not self._begin():
                    return
                continue
            code = self._buffer[0]
            if code not in (UPDATE, EMIT, RESULT, PROGRAM):
                self.skipped.append(code)
                del self._buffer[0]
                self._wanted = 1
                continue
            reader = _Reader(self._buffer, self._limit)
            try:
                frame = reader.frame()
            except _Short as short:
                self._wanted = short.wanted
                if self._wanted > self._limit:
                    raise BadFrame(f"a frame of more than {self._limit} bytes") from None
                reader.close()
                continue
            reader.close()
            del self._buffer[: reader.at]
            self._wanted = 1
            yield frame

    def _begin(self) -> bool:
        """Skip what was left of the text, and the sizes; false if they are not there yet."""
        while self._buffer and self._buffer[0] in b"\r\n \t;":
            del self._buffer[0]
        if len(self._buffer) < len(SIZES):
            self._wanted = len(SIZES)
            return False
        if self._buffer[: len(SIZES)] != SIZES:
            sizes = self._buffer[: len(SIZES)].hex(" ")
            raise BadFrame(f"a sender with sizes {sizes} is not understood, only {SIZES.hex(' ')}")
        del self._buffer[: len(SIZES)]
        self._begun = True
        self._wanted = 1
        return True


class _Reader:
    """Reads one frame from the beginning of a buffer."""

    def __init__(self, buffer: bytearray, limit: int) -> None:
        self._view = memoryview(buffer)
        self._size = len(buffer)
        self._limit = limit
        self.at = 0

    def close(self) -> None:
        self._view.release()

    def frame(self) -> Frame:
        code = self._byte()
        if code == PROGRAM:
            return Program(self._string())
        if code == RESULT:
            return Result(self._string(), self._value())
        name = self._string()
        if code == EMIT:
            return Emit(name, self._values())
        value = self._value()
        low, high = self._u32(), self._u32()
        return Update(name, value, high << 32 | low)

    def _take(self, size: int) -> int:
        """Move on; where the bytes begin."""
        at, end = self.at, self.at + size
        if end > self._size:
            raise _Short(end)
        self.at = end
        return at

    def _byte(self) -> int:
        return self._view[self._take(1)]

    def _u32(self) -> int:
        at = self._take(4)
        return int(_U32.unpack_from(self._view, at)[0])

    def _bytes(self, size: int) -> bytes:
        at = self._take(size)
        return bytes(self._view[at : at + size])

    def _string(self) -> str:
        at = self._take(2)
        return self._bytes(_U16.unpack_from(self._view, at)[0]).decode("latin-1")

    def _values(self, deep: int = 0) -> list[Any]:
        count = self._u32()
        if count > MOST or deep > DEEPEST:
            raise BadFrame(f"a list of {count} members, {deep} deep")
        return [self._value(deep + 1) for _ in range(count)]

    def _value(self, deep: int = 0) -> Any:
        kind = self._byte()
        if kind == NUMBER:
            at = self._take(8)
            return _DOUBLE.unpack_from(self._view, at)[0]
        if kind == STRING:
            return self._string()
        if kind == BINARY:
            keywords = self._string()
            size = self._u32()
            if size > self._limit:
                raise BadFrame(f"a binary of {size} bytes")
            return make_binary(self._bytes(size), keywords.partition("\n")[0].replace(";", " "))
        if kind == LIST:
            return self._values(deep)
        if kind == DICTIONARY:
            count = self._u32()
            if count > MOST or deep > DEEPEST:
                raise BadFrame(f"a dictionary of {count} members, {deep} deep")
            return {self._string(): self._value(deep + 1) for _ in range(count)}
        if kind == SLOT:
            return SlotName(self._string())
        if kind == VOID:
            return None
        raise BadFrame(f"a value of unknown type {kind}")


# ---------------------------------------------------------------- writing


def encode(frame: Frame) -> list[bytes | memoryview]:
    """The bytes of a frame, in parts so that binaries are not copied; raises TooLong, and TypeError for a value that
    cannot travel."""
    parts: list[bytes | memoryview] = []
    if isinstance(frame, Update):
        parts.append(b"\x01" + _string(frame.name))
        _value(parts, frame.value)
        parts.append(_U32.pack(frame.stamp & 0xFFFFFFFF) + _U32.pack(frame.stamp >> 32 & 0xFFFFFFFF))
    elif isinstance(frame, Emit):
        parts.append(b"\x02" + _string(frame.name) + _U32.pack(len(frame.payload)))
        for value in frame.payload:
            _value(parts, value)
    elif isinstance(frame, Result):
        parts.append(b"\x0a" + _string(frame.ticket))
        _value(parts, frame.value)
    else:
        parts.append(b"\x0b" + _string(frame.text))
    return parts


def _string(text: str) -> bytes:
    data = latin(text)
    if len(data) > 0xFFFF:
        raise TooLong(f"a text of {len(data)} bytes; binary mode carries at most 65535")
    return _U16.pack(len(data)) + data


def latin(text: str) -> bytes:
    """The bytes of a text: one per character, or UTF-8 if it has others than latin-1."""
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
