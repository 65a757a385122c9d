"""Values of variables by RTP: packets that may be lost, and never keep anybody waiting.

A packet is an RTP header (RFC 3550, section 5.1: version 2, a sequence number, a time stamp of 90 kHz, the number of
the stream), the secret of the link, and a piece of a message: the number of the message, the place of the piece, the
size of the whole.  A message is one ``Update`` frame (see ``frames``).  Each variable with binary values has a stream
of its own, all others share one (manual, section 3.15.2).  A message of which a piece is missing when a later one of
its stream begins is dropped; what comes late or twice is dropped too.

The payload is ours: the original's RTP module is not spoken.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from urbihw.kernel.uobject.binary import UBinary
from urbihw.kernel.uobject.frames import LIMIT, SIZES, BadFrame, Decoder, TooLong, Update, encode

HEADER = struct.Struct(">BBHII")
PIECE = struct.Struct(">8sIII")
HEAD_SIZE = HEADER.size + PIECE.size
VERSION, PAYLOAD_TYPE = 0x80, 96
SECRET_SIZE = 8
SHARED = 1
"""The stream of all that is not binary."""
MOST_STREAMS = 256
SMALL, LARGE = 1200, 32000
"""Bytes of a message in a packet: what passes every network whole, and what the machine's own loopback takes."""


class Sender:
    """Messages to packets.  ``secret`` is known to both sides, ``size`` is that of a piece."""

    def __init__(self, secret: bytes, size: int = SMALL) -> None:
        self._secret = secret
        self._size = size
        self._packets = 0
        self._messages = 0

    def packets(self, update: Update, now: float) -> list[bytes]:
        """The packets of a value; raises TooLong and TypeError as ``encode`` does."""
        data = b"".join(encode(update))
        if len(data) > LIMIT:
            raise TooLong(f"a value of {len(data)} bytes")
        stream = stream_of(update)
        self._messages = (self._messages + 1) & 0xFFFFFFFF
        time = int(now * 90000) & 0xFFFFFFFF
        made = []
        for at in range(0, len(data), self._size):
            last = at + self._size >= len(data)
            self._packets = (self._packets + 1) & 0xFFFF
            head = HEADER.pack(VERSION, PAYLOAD_TYPE | (0x80 if last else 0), self._packets, time, stream)
            made.append(head + PIECE.pack(self._secret, self._messages, at, len(data)) + data[at : at + self._size])
        return made


def stream_of(update: Update) -> int:
    """The number of the stream of a value."""
    if not isinstance(update.value, UBinary):
        return SHARED
    return zlib.crc32(update.name.encode("utf-8")) | 2


class _Stream:
    """The message that is being put together."""

    __slots__ = ("content", "delivered", "message", "missing", "seen")

    def __init__(self) -> None:
        self.message = -1
        self.delivered = -1
        self.content = bytearray()
        self.missing = 0
        self.seen: set[int] = set()

    def begin(self, message: int, size: int) -> None:
        self.message = message
        self.content = bytearray(size)
        self.missing = size
        self.seen = set()


class Receiver:
    """Packets to values; ``lost`` counts the messages of which something did not arrive."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret
        self._streams: dict[int, _Stream] = {}
        self.lost = 0

    def feed(self, packet: bytes) -> Iterator[Update]:
        """The values that a packet completes; what is no packet of ours is left out."""
        if len(packet) < HEAD_SIZE or packet[0] != VERSION or packet[1] & 0x7F != PAYLOAD_TYPE:
            return
        number = HEADER.unpack_from(packet)[4]
        secret, message, at, size = PIECE.unpack_from(packet, HEADER.size)
        piece = packet[HEAD_SIZE:]
        if secret != self._secret or size > LIMIT or at + len(piece) > size or not piece:
            return
        stream = self._streams.get(number)
        if stream is None:
            if len(self._streams) >= MOST_STREAMS:
                return
            stream = self._streams[number] = _Stream()
        if message != stream.message:
            if not _later(message, max(stream.message, stream.delivered)):
                return
            self.lost += stream.missing > 0
            stream.begin(message, size)
        if size != len(stream.content) or at in stream.seen or not stream.missing:
            return
        stream.seen.add(at)
        stream.content[at : at + len(piece)] = piece
        stream.missing -= len(piece)
        if stream.missing <= 0:
            stream.delivered, stream.missing = message, 0
            content, stream.content = bytes(stream.content), bytearray()
            yield from _decoded(content)


def _later(message: int, than: int) -> bool:
    """Whether a message number comes after another, going round at 32 bits."""
    return than < 0 or 0 < (message - than) & 0xFFFFFFFF < 0x80000000


def _decoded(content: bytes) -> Iterator[Update]:
    try:
        for frame in Decoder().feed(SIZES + content):
            if isinstance(frame, Update):
                yield frame
    except BadFrame:
        return
