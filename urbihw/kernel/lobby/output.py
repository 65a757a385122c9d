"""What a lobby says: ``[00001234:channel] text`` lines, gathered per scheduler round, bounded.

The server takes the bytes of a round by ``take()`` when told by ``wanted``, and says with ``handed_on`` how many of
those it could not deliver yet.  Both together are what waits for the other side to read (server protocol, section 7:
the original buffered without limit).  When half the limit waits, a job of the lobby that wants to say more is suspended
until there is room again, wherever it stands, so that a client that reads slowly gets everything.  Nobody else waits
for this client: when others, or no job at all, say so much to it that the limit is passed, it is given up.
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

    Attributes:
        limit: bytes that may wait to be read by the other side.
        sent: bytes that were written in all.
        open: whether anything can still be said.
        root: the output in which all that is said here ends up.
        unread: tells how many of the bytes taken still wait on this machine.
        give_up: called when the limit is passed; None while nobody takes what is written round by round, as in a
            kernel without a server, where nothing is bounded.
    """

    def __init__(self, scheduler: Scheduler, wanted: Callable[[], None], limit: int = 8 * 1024 * 1024) -> None:
        """``wanted`` is called once when there is something to take."""
        self._scheduler = scheduler
        self._wanted = wanted
        self._parts: list[bytes] = []
        self._waiting = 0
        """As many bytes as wait, or more: what the other side has read meanwhile is looked up when it counts."""
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
        """Send bytes as they are; silently nothing when closed.  May suspend a job of this lobby."""
        if not self.open or not data:
            return
        if self._waiting > self._high and not self._room(len(data)):
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
        if self._waiting > self._high and not self._room(len(text)):
            return
        tag = f":{channel}" if channel else ""
        self.write(f"[{stamp(self._scheduler.now)}{tag}] {text}\n".encode("latin-1", "replace"))

    def take(self) -> bytes:
        """All that was written since the last call."""
        data = b"".join(self._parts)
        self._parts.clear()
        self._waiting -= self._gathered
        self._gathered = 0
        return data

    def handed_on(self) -> None:
        """What was taken was sent as far as that goes, or more of it was read: who waits may go on if there is room."""
        self._waiting = self._gathered + self.unread()
        if self._writers and self._waiting <= self.low:
            self._writers.wake_all()

    @property
    def low(self) -> int:
        """With at most so many bytes waiting, writers go on."""
        return self.limit // 4

    def close(self) -> None:
        """Nothing more can be said.  Who waits for room goes on waiting until ``let_go``."""
        self.open = False
        self._parts.clear()
        self._waiting = self._gathered = 0

    def let_go(self) -> None:
        """Let those who wait for room go on, once it is closed and the jobs of the connection are ended.

        An endless loop that was woken before could not be ended any more: nothing makes it wait again.
        """
        self._writers.wake_all()

    def _room(self, size: int) -> bool:
        """Wait for room, or give the other side up; whether something can be said now."""
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
    """Where ends up what a lobby says; None for none."""
    return None if lobby is None else lobby.output.root
