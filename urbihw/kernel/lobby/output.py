"""The output of a lobby: lines ``[00001234:channel] text``, collected for each scheduler round, of bounded size.

The server takes the bytes of a round with ``take_bytes`` after ``wanted`` was called, and calls ``update_unread`` when
some of them were sent.  Both the bytes not taken and the bytes not sent count as unread (server protocol, section 7:
the original buffered without limit).  When the unread bytes exceed half of the limit, a job of this lobby that writes
is suspended until there is room again, so that a client that reads slowly gets all output.  Other jobs do not wait for
this client: when the output of others exceeds the limit, the connection is given up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.waiting import WaitQueue


def stamp(now: float) -> str:
    """The time stamp of a round: milliseconds, at least eight digits."""
    return f"{int(now * 1000 + 1e-6):08d}"


class Output:
    """The outgoing side of a lobby.

    Attributes: limit: maximum number of unread bytes. sent: total number of written bytes. open: whether the output
    accepts data. root: the output to which the data of this one finally goes. unread: returns the number of taken bytes
    that are still waiting on this machine. give_up: called when the limit is exceeded; None in a kernel without a
    server, where the output is not bounded.
    """

    def __init__(self, scheduler: Scheduler, wanted: Callable[[], None], limit: int = 8 * 1024 * 1024) -> None:
        """``wanted`` is called when there are bytes to take, once until they are taken."""
        self._scheduler = scheduler
        self._wanted = wanted
        self._parts: list[bytes] = []
        self._waiting = 0
        """The number of unread bytes, or a larger one: it is updated when the limit matters."""
        self._gathered = 0
        self._writers = WaitQueue(scheduler)
        self._high = limit // 2
        self.limit = limit
        self.sent = 0
        self.open = True
        self.root: Any = self
        self.unread: Callable[[], int] = lambda: 0
        self.give_up: Callable[[int], None] | None = None

    def write(self, data: bytes) -> None:
        """Write bytes as they are; does nothing when closed.  May suspend a job of this lobby."""
        if not self.open or not data:
            return
        if self._waiting > self._high and not self._wait_for_room(len(data)):
            return
        if not self._parts:
            self._wanted()
        self._parts.append(data)
        size = len(data)
        self._waiting += size
        self._gathered += size
        self.sent += size

    def line(self, text: str, channel: str = "") -> None:
        """Send one line with the time stamp; ``text`` has one character per byte and may contain line ends."""
        if self._waiting > self._high and not self._wait_for_room(len(text)):
            return
        tag = f":{channel}" if channel else ""
        self.write(f"[{stamp(self._scheduler.now)}{tag}] {text}\n".encode("latin-1", "replace"))

    def take_bytes(self) -> bytes:
        """The bytes that were written since the last call."""
        data = b"".join(self._parts)
        self._parts.clear()
        self._waiting -= self._gathered
        self._gathered = 0
        return data

    def update_unread(self) -> None:
        """Update the number of unread bytes after sending; waiting writers go on if there is room."""
        self._waiting = self._gathered + self.unread()
        if self._writers and self._waiting <= self.low_mark:
            self._writers.wake_all()

    @property
    def backlog(self) -> int:
        """The number of unread bytes now; 0 in a kernel without a server."""
        return 0 if self.give_up is None else self._gathered + self.unread()

    @property
    def low_mark(self) -> int:
        """The number of unread bytes at which waiting writers go on."""
        return self.limit // 4

    def close(self) -> None:
        """Refuse further data.  Waiting writers go on waiting until ``release_writers``."""
        self.open = False
        self._parts.clear()
        self._waiting = self._gathered = 0

    def release_writers(self) -> None:
        """Let waiting writers go on, after the output was closed and the jobs of the connection were ended.

        An endless loop that went on earlier could not be ended any more, since no write would make it wait.
        """
        self._writers.wake_all()

    def _wait_for_room(self, size: int) -> bool:
        """Wait for room or give up the connection; return whether the output accepts data."""
        if self.give_up is None:
            return self.open
        self._waiting = self._gathered + self.unread()
        job = self._scheduler.current
        mine = job is not None and not job.done and _root(job.context) is self
        if mine:
            while self.open and self._waiting > self._high:
                self._writers.wait()
        elif self._waiting + size > self.limit:
            waiting = self._waiting
            self.close()
            self.give_up(waiting)
        return self.open


def _root(lobby: Any) -> Any:
    """The output to which the output of a lobby finally goes; None without a lobby."""
    return None if lobby is None else lobby.output.root
