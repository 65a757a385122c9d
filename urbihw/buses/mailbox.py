"""The worker's end of the pipe to its parent: non-blocking in both directions.

A parent that hangs must block neither the wire nor the dead-man timer, so messages that do not fit into the pipe are
queued. States and replies keep their order; samples are merged into one message with the newest value of each item.
"""

from __future__ import annotations

import select
from collections import deque
from multiprocessing.connection import Connection

from urbihw.buses.messages import FromWorker, Samples, ToWorker

_KEPT = 1000


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
        self._send_waiting()
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
        """Send queued messages as far as the pipe takes them, and close."""
        self._send_waiting()
        self._pipe.close()

    def _send_waiting(self) -> None:
        while self._waiting and self._writable():
            self._send(self._waiting.popleft())
        if self._samples is not None and not self._waiting and self._writable():
            samples, self._samples = self._samples, None
            self._send(samples)

    def _writable(self) -> bool:
        # The kernel calls a socket writable when at least two thirds of its buffer (some 200 kB) are free, so a
        # message of a few kB never blocks.
        return bool(select.select((), (self._fd,), (), 0)[1])

    def _send(self, message: FromWorker) -> None:
        if self._peer_closed:
            return
        try:
            self._pipe.send(message)
        except OSError:
            # The parent's end is closed; further messages have no reader.
            self._peer_closed = True


def _merged(old: Samples, new: Samples) -> Samples:
    values = {device: {**old.values.get(device, {}), **items} for device, items in {**old.values, **new.values}.items()}
    return Samples(new.time, values, {**old.times, **new.times})
