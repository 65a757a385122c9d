"""Telegrams of SICK lasers of the LMS1xx and TiM families, CoLa A and CoLa B; bytes only.

    CoLa A   02 content 03: words, and numbers in hexadecimal, between spaces
    CoLa B   02 02 02 02, length (u32 BE), content: words and numbers (BE), check sum: exclusive or of the content

Source: SICK, "Telegram Listing LiDAR sensors LMS1xx, LMS5xx, TiM2xx, TiM5xx, TiM7xx ...", 8014631 (2020).
"""

from __future__ import annotations

import struct
from functools import reduce
from itertools import accumulate
from operator import xor
from typing import Final, Protocol

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

STX, ETX = b"\x02", b"\x03"
_BINARY: Final = b"\x02\x02\x02\x02"
LONGEST: Final = 60000
"""Bytes of a telegram; a longer one is damaged."""
MOST_READINGS: Final = 4000
_MOST_BLOCKS: Final = 16
"""Encoders or channels of a scan; more make no sense."""
FIRST_VALID: Final = 16
"""Smaller distances are codes: no echo, dazzled, and reserved ones."""
POLLUTED: Final = 0b110
"""Bits of the second byte of the device status (UNCONFIRMED for TiM)."""

LOGIN: Final = "SetAccessMode 03 F4724744"
"""Log in as an authorized client, with the password from the factory; in CoLa B the numbers are binary."""
_LOGIN_B: Final = b"SetAccessMode \x03\xf4\x72\x47\x44"


def telegram(kind: str, text: str, *, binary: bool) -> bytes:
    """A telegram: ``kind`` is sRN (read), sMN (call) or sEN (event); ``text``: a name, a name and a digit, or LOGIN."""
    if not binary:
        return STX + f"{kind} {text}".encode("ascii") + ETX
    name, space, digit = text.partition(" ")
    body = _LOGIN_B if text == LOGIN else name.encode("ascii") + (b" " + bytes((int(digit),)) if space else b"")
    content = kind.encode("ascii") + b" " + body
    return _BINARY + struct.pack(">I", len(content)) + content + bytes((reduce(xor, content),))


@frozen
class Telegram:
    """A telegram of the laser: ``kind`` sRA, sAN, sEA, sSN or sFA, its ``name``, and the ``data`` behind the name."""

    kind: str
    name: str
    data: bytes
    binary: bool


class ColaFramer:
    """Splits a stream into telegrams of both kinds.

    Attributes:
        damaged: number of telegrams with a wrong check sum or length.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = b""
        self._sums: list[int] = []

    def feed(self, data: bytes) -> list[Telegram]:
        """Process received bytes; returns the telegrams that are complete now."""
        self._buffer += data
        self._sums = []
        found: list[Telegram] = []
        at = 0
        while (start := self._buffer.find(STX, at)) >= 0:
            size = self._take_binary(start, found) if self._is_binary(start) else self._take_text(start, found)
            if not size:
                break
            at = start + size
        self._buffer = self._buffer[start:] if start >= 0 else b""
        return found

    def _is_binary(self, at: int) -> bool:
        """Whether the telegram at this place begins like CoLa B; text never begins with a second STX."""
        return self._buffer[at + 1 : at + 2] in (b"", STX)

    def _take_text(self, at: int, found: list[Telegram]) -> int:
        """Take a telegram of CoLa A; returns how many bytes are done with, 0 to wait for more."""
        again = self._buffer.find(STX, at + 1, at + LONGEST)
        end = self._buffer.find(ETX, at, again if again >= 0 else at + LONGEST)
        if end >= 0:
            self._add(self._buffer[at + 1 : end], found, binary=False)
            return end + 1 - at
        if again >= 0 or len(self._buffer) - at >= LONGEST:
            self.damaged += 1
            return again - at if again >= 0 else LONGEST
        return 0

    def _take_binary(self, at: int, found: list[Telegram]) -> int:
        """The same for CoLa B."""
        head = self._buffer[at : at + 8]
        if len(head) < 8:
            return 0 if _BINARY.startswith(head[:4]) else 1
        size = int.from_bytes(head[4:], "big")
        if not head.startswith(_BINARY) or not 4 <= size <= LONGEST:
            self.damaged += 1
            return 1
        if len(self._buffer) < at + 9 + size:
            return 0
        if self._check_sum(at + 8, at + 8 + size) != self._buffer[at + 8 + size]:
            self.damaged += 1
            return 1
        self._add(self._buffer[at + 8 : at + 8 + size], found, binary=True)
        return 9 + size

    def _check_sum(self, first: int, end: int) -> int:
        """The exclusive or of some bytes, from the sums of all beginnings of the buffer: damaged headers may promise
        long telegrams that overlap, and to add up each of them would take seconds."""
        self._sums = self._sums or list(accumulate(self._buffer, xor, initial=0))
        return self._sums[end] ^ self._sums[first]

    def _add(self, content: bytes, found: list[Telegram], *, binary: bool) -> None:
        kind, _, rest = content.partition(b" ")
        name, _, data = rest.partition(b" ")
        if len(kind) == 3:
            found.append(Telegram(kind.decode("latin-1"), name.decode("latin-1"), data, binary))
        else:
            self.damaged += 1


class Numbers(Protocol):
    """The numbers of a telegram, one after the other.  Each method raises BadFrame at the end, or for no number."""

    def unsigned(self, size: int) -> int:
        """A number of ``size`` bytes."""
        ...

    def word(self, size: int) -> str:
        """A text of ``size`` characters."""
        ...


class TextNumbers:
    """Reads the numbers of CoLa A, which are text."""

    def __init__(self, data: bytes) -> None:
        self._words = iter(data.split())

    def unsigned(self, size: int) -> int:
        """See ``Numbers``.  A sign means decimal."""
        word = next(self._words, b"")
        try:
            return int(word, 10 if word[:1] in (b"+", b"-") else 16) & ((1 << 8 * size) - 1)
        except ValueError as error:
            raise BadFrame(f"{word[:20]!r} is no number") from error

    def word(self, size: int) -> str:
        return next(self._words, b"").decode("latin-1")


class BinaryNumbers:
    """Reads the numbers of CoLa B, which are binary."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def unsigned(self, size: int) -> int:
        return int.from_bytes(self._take(size), "big")

    def word(self, size: int) -> str:
        return self._take(size).decode("latin-1")

    def _take(self, size: int) -> bytes:
        data = self._data[self._at : self._at + size]
        if len(data) < size:
            raise BadFrame(f"a telegram of {len(self._data)} bytes ends early")
        self._at += size
        return data


@frozen
class Distances:
    """The channel DIST1 of a scan: ``raw`` counts of ``unit`` m, angles in degrees; ``dirty``: a polluted window."""

    raw: tuple[int, ...]
    unit: float
    first: float
    step: float
    dirty: bool


def parse_scan(message: Telegram) -> Distances:
    """The distances of LMDscandata.  Raises BadFrame."""
    read: Numbers = BinaryNumbers(message.data) if message.binary else TextNumbers(message.data)
    for size in (2, 2, 4, 1):  # version, device, serial number, first byte of the status
        read.unsigned(size)
    status = read.unsigned(1)
    for size in (2, 2, 4, 4, 1, 1, 1, 1, 2, 4, 4):  # counters, times, inputs, outputs, layer, two frequencies
        read.unsigned(size)
    for _ in range(_count(read, _MOST_BLOCKS)):
        read.unsigned(4), read.unsigned(2)  # position and speed of an encoder
    for _ in range(_count(read, _MOST_BLOCKS)):
        name = read.word(5)
        scale, offset, first, step = (read.unsigned(size) for size in (4, 4, 4, 2))
        raw = tuple(read.unsigned(2) for _ in range(_count(read, MOST_READINGS)))
        if name == "DIST1":
            return _distances(raw, scale, offset, first, step, status)
    raise BadFrame("a scan without distances")


def _count(read: Numbers, most: int) -> int:
    count = read.unsigned(2)
    if count > most:
        raise BadFrame(f"a scan says {count} values of a kind; {most} is the most")
    return count


def _distances(raw: tuple[int, ...], scale: int, offset: int, first: int, step: int, status: int) -> Distances:
    factor, shift = (struct.unpack(">f", value.to_bytes(4, "big"))[0] for value in (scale, offset))
    signed = first - (1 << 32) if first >> 31 else first
    # A NaN fails the comparison too.
    if not 0.001 <= factor <= 1000 or shift != 0 or not raw or not 0 < step * (len(raw) - 1) <= 3600000:
        raise BadFrame(f"a scan with the scale {factor}, the offset {shift} and {len(raw)} steps of {step}")
    if not -3600000 <= signed <= 3600000:
        raise BadFrame(f"a scan that begins at {signed / 10000} degrees")
    return Distances(raw, factor / 1000, signed / 10000, step / 10000, bool(status & POLLUTED))


def parse_name(message: Telegram) -> str:
    """The name of the device in the answer to DeviceIdent, "" if it is not there."""
    if message.binary:
        size = int.from_bytes(message.data[:2], "big")
        return message.data[2 : 2 + size].decode("latin-1")
    word, _, text = message.data.partition(b" ")
    try:
        return text[: max(0, int(word, 16))].decode("latin-1")
    except ValueError:
        return ""
