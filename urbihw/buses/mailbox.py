"""The worker's end of the pipe to its parent: non-blocking in both directions.

A parent that hangs must block neither the wire nor the dead-man timer, so messages that do not fit into the pipe are
queued. States and replies keep their order; samples are merged into one message with the newest value of each item.

A message that might not fit into the pipe, such as a picture, is cut into pieces that do, which the parent's ``Joiner``
puts together again; whatever is posted behind it waits for its last piece.
"""

from __future__ import annotations

import pickle
import select
import time
from collections import deque
from multiprocessing.connection import Connection
from typing import Final

from urbihw.buses.messages import FromWorker, Samples, ToWorker
from urbihw.frozen import frozen

_KEPT = 1000
_LAST_WORDS_S = 0.5
"""Seconds for the parent to read what is queued when the worker ends."""
PIECE_BYTES: Final = 65_536
"""Bytes of one piece of a large message: as many as a pipe takes whenever it is writable."""


@frozen
class Piece:
    """A part of a pickled message; `last` for the one that completes it."""

    data: bytes
    last: bool


class Joiner:
    """The parent's side: gives whole messages."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def add(self, arrived: FromWorker | Piece) -> FromWorker | None:
        """Return the message that is complete with what arrived, None if there is none."""
        if not isinstance(arrived, Piece):
            return arrived
        self._parts.append(arrived.data)
        if not arrived.last:
            return None
        parts, self._parts = self._parts, []
        whole: FromWorker = pickle.loads(b"".join(parts))
        return whole


class Mailbox:
    """Messages over a duplex `multiprocessing.Pipe`.

    Attributes:
        ended: the parent has closed its end.
        fd: the file descriptor to wait on for messages.
    """

    def __init__(self, pipe: Connection) -> None:
        self.ended = False
        self.fd = pipe.fileno()
        self._pipe = pipe
        self._fd = self.fd
        self._waiting: deque[FromWorker] = deque(maxlen=_KEPT)
        self._samples: Samples | None = None
        self._pieces: deque[Piece] = deque()
        self._peer_closed = False
        self._dropped = 0

    def receive_messages(self) -> list[ToWorker]:
        """Return the messages that have arrived."""
        messages: list[ToWorker] = []
        try:
            while not self.ended and select.select((self._fd,), (), (), 0)[0]:
                messages.append(self._pipe.recv())
        except (EOFError, OSError):
            self.ended = True
        return messages

    def post(self, message: FromWorker) -> None:
        """Send a message, or queue it when the pipe is full."""
        self.flush()
        if not self._waiting and self._samples is None and self._writable():
            self._send(message)
        elif not isinstance(message, Samples):
            self._waiting.append(message)
        elif self._samples is None:
            self._samples = message
        else:
            self._samples = _merged(self._samples, message)
            self._dropped += 1

    def pop_dropped_count(self) -> int:
        """Return how many samples were merged into later ones since the last call."""
        dropped, self._dropped = self._dropped, 0
        return dropped

    def close(self) -> None:
        """Send queued messages, but no more samples, as far as the parent reads them soon, and close."""
        self._samples = None
        end = time.monotonic() + _LAST_WORDS_S
        self.flush()
        while (self._pieces or self._waiting) and (left := end - time.monotonic()) > 0:
            select.select((), (self._fd,), (), left)
            self.flush()
        self._pipe.close()

    def flush(self) -> None:
        """Send queued messages as far as the pipe takes them."""
        self._send_pieces()
        while self._waiting and self._writable():
            self._send(self._waiting.popleft())
        if self._samples is not None and not self._waiting and self._writable():
            samples, self._samples = self._samples, None
            self._send(samples)

    def _writable(self) -> bool:
        """Whether another message may be sent now."""
        self._send_pieces()
        return not self._pieces and self._has_room()

    def _send_pieces(self) -> None:
        while self._pieces and self._has_room():
            self._put(self._pieces.popleft())

    def _has_room(self) -> bool:
        # The kernel calls a socket writable when at least two thirds of its buffer (some 200 kB) are free, so a piece
        # never blocks.
        return bool(select.select((), (self._fd,), (), 0)[1])

    def _send(self, message: FromWorker) -> None:
        if self._peer_closed:
            return
        data = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
        if len(data) <= PIECE_BYTES:
            self._put_bytes(data)
            return
        ends = range(PIECE_BYTES, len(data) + PIECE_BYTES, PIECE_BYTES)
        self._pieces.extend(Piece(data[end - PIECE_BYTES : end], end >= len(data)) for end in ends)
        self._send_pieces()

    def _put(self, piece: Piece) -> None:
        self._put_bytes(pickle.dumps(piece, pickle.HIGHEST_PROTOCOL))

    def _put_bytes(self, data: bytes) -> None:
        try:
            self._pipe.send_bytes(data)
        except OSError:
            # The parent's end is closed; further messages have no reader.
            self._peer_closed = True
            self._pieces.clear()


def _merged(old: Samples, new: Samples) -> Samples:
    values = {device: {**old.values.get(device, {}), **items} for device, items in {**old.values, **new.values}.items()}
    return Samples(new.time, values, {**old.times, **new.times})
