"""Values of variables by RTP: packets may be lost, but never block the sender or the receiver.

A packet consists of an RTP header (RFC 3550, section 5.1: version 2, a sequence number, a time stamp of 90 kHz, the
number of the source), the secret of the link, and a piece of a message: the number of its stream, the number of the
message, the offset of the piece, the size of the whole message.  A message is one ``Update`` frame (see ``frames``).
Each variable with binary values has a stream of its own; all others share one (manual, section 3.15.2).  An incomplete
message is dropped when a later one of its stream begins; late and duplicate pieces are dropped too.

The secret and the numbers of both sources are exchanged on the connection; packets with other ones are counted and
dropped.  The incomplete messages have together at most ``MAX_FRAME_SIZE`` bytes, counted by received and not by
announced bytes.

The payload format is our own: the packets of the original's RTP module are not supported.
"""

from __future__ import annotations

import secrets
import struct
import zlib
from collections.abc import Iterator

from urbihw.kernel.uobject.binary import UBinary
from urbihw.kernel.uremote.frames import (
    MAX_FRAME_SIZE,
    SIZES,
    BadBinaryFrame,
    BinaryDecoder,
    StringTooLong,
    Update,
    encode,
    members_of,
)

HEADER = struct.Struct(">BBHII")
PIECE = struct.Struct(">8sIIII")
HEAD_SIZE = HEADER.size + PIECE.size
VERSION, PAYLOAD_TYPE = 0x80, 96
SECRET_SIZE = 8
SHARED_STREAM = 1
"""The stream of all values that are not binary."""
MAX_STREAMS = 256
MAX_VALUES = 4096
"""Maximum number of values in the lists of a message: it is decoded in one step of a few milliseconds.  Larger values
are not sent by RTP."""
SMALL_PIECE_SIZE, LARGE_PIECE_SIZE = 1200, 32000
"""Number of message bytes in a packet: a size that fits into one packet on any network, and one for the loopback
interface.
"""


class Sender:
    """Splits messages into packets.  ``secret`` and ``source`` are known to both sides; ``size`` is that of a piece."""

    def __init__(self, secret: bytes, source: int, size: int = SMALL_PIECE_SIZE) -> None:
        self._secret = secret
        self._source = source
        self._size = size
        self._packets = 0
        self._messages = 0

    def packets(self, update: Update, now: float) -> list[bytes]:
        """The packets of a value.  Raises StringTooLong and TypeError like ``encode``."""
        if members_of(update.value) > MAX_VALUES:
            raise StringTooLong(f"a value with more than {MAX_VALUES} members")
        data = b"".join(encode(update))
        if len(data) > MAX_FRAME_SIZE:
            raise StringTooLong(f"a value of {len(data)} bytes")
        stream = stream_of(update)
        self._messages = (self._messages + 1) & 0xFFFFFFFF
        time = int(now * 90000) & 0xFFFFFFFF
        made = []
        for at in range(0, len(data), self._size):
            last = at + self._size >= len(data)
            self._packets = (self._packets + 1) & 0xFFFF
            head = HEADER.pack(VERSION, PAYLOAD_TYPE | (0x80 if last else 0), self._packets, time, self._source)
            piece = PIECE.pack(self._secret, stream, self._messages, at, len(data))
            made.append(head + piece + data[at : at + self._size])
        return made


def stream_of(update: Update) -> int:
    """The number of the stream of a value."""
    if not isinstance(update.value, UBinary):
        return SHARED_STREAM
    return zlib.crc32(update.name.encode("utf-8")) | 2


class _PartialMessage:
    """The incomplete message of a stream."""

    __slots__ = ("message", "missing", "pieces", "size")

    def __init__(self) -> None:
        self.message = -1
        self.size = 0
        self.missing = 0
        self.pieces: dict[int, bytes] = {}

    def begin(self, message: int, size: int) -> int:
        """Start a new message; returns the number of dropped bytes of the former one."""
        dropped = self.size - self.missing if self.pieces else 0
        self.message, self.size, self.missing = message, size, size
        self.pieces = {}
        return dropped

    def whole(self) -> bytes:
        """The complete message; empty if its pieces do not fit together."""
        at, parts = 0, []
        for place, piece in sorted(self.pieces.items()):
            if place != at:
                return b""
            parts.append(piece)
            at += len(piece)
        return b"".join(parts)


class RtpReceiver:
    """Joins packets to values.

    Attributes:
        lost: number of incomplete messages.
        refused: number of packets that do not belong to the link.
    """

    def __init__(self, secret: bytes, source: int) -> None:
        self._secret = secret
        self._source = source
        self._streams: dict[int, _PartialMessage] = {}
        self._held = 0
        self.lost = 0
        self.refused = 0

    def feed(self, packet: bytes) -> Iterator[Update]:
        """The values completed by a packet; a packet of another source is counted and ignored."""
        if len(packet) <= HEAD_SIZE or packet[0] != VERSION or packet[1] & 0x7F != PAYLOAD_TYPE:
            self.refused += 1
            return
        source = HEADER.unpack_from(packet)[4]
        secret, number, message, at, size = PIECE.unpack_from(packet, HEADER.size)
        piece = packet[HEAD_SIZE:]
        end = at + len(piece)
        # Pieces, except the last one, have a minimum size: otherwise a message could have millions of them.
        fits = end == size or (end < size and len(piece) >= SMALL_PIECE_SIZE)
        known = secrets.compare_digest(secret, self._secret) and source == self._source
        if not known or size > MAX_FRAME_SIZE or not fits:
            self.refused += 1
            return
        stream = self._streams.get(number)
        if stream is None:
            if len(self._streams) >= MAX_STREAMS:
                self.refused += 1
                return
            stream = self._streams[number] = _PartialMessage()
        if message != stream.message:
            if not _later(message, stream.message):
                return
            self.lost += stream.missing > 0
            self._held -= stream.begin(message, size)
        if size != stream.size or at in stream.pieces or len(piece) > stream.missing:
            return
        stream.pieces[at] = piece
        stream.missing -= len(piece)
        self._held += len(piece)
        if stream.missing == 0:
            content = stream.whole()
            self._held -= stream.size
            stream.pieces = {}
            yield from _decoded(content)
        elif self._held > MAX_FRAME_SIZE:
            self._drop_others(stream)

    def _drop_others(self, kept: _PartialMessage) -> None:
        """Drop the incomplete messages of all streams but one, because they hold too many bytes."""
        for stream in self._streams.values():
            if stream.pieces and stream is not kept:
                self.lost += 1
                stream.pieces, stream.missing = {}, 0
        self._held = kept.size - kept.missing


def _later(message: int, than: int) -> bool:
    """Whether a message number comes after another, modulo 2**32."""
    return than < 0 or 0 < (message - than) & 0xFFFFFFFF < 0x80000000


def _decoded(content: bytes) -> Iterator[Update]:
    try:
        for frame in BinaryDecoder(most=MAX_VALUES).feed(SIZES + content):
            if isinstance(frame, Update):
                yield frame
    except BadBinaryFrame:
        return
