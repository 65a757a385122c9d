"""The innocent neighbour: asks ``1+1;`` every 10 ms and looks at each answer.

A program of its own: PORT SERVER [MOST].

It asks on time whether the last answer has come or not, so that a server which is silent for a second makes a hundred
late answers, as it would for a hundred neighbours.  With MOST it asks nothing while so many answers are owed: a slow
machine is asked less.  A line on its input ends it; then it prints what it saw, as JSON.

SERVER is the process of the server.  The processor time that it used while an answer was owed tells what the server did
to the neighbour; the time by the clock also tells what else the machine had to do.
"""

from __future__ import annotations

import json
import os
import select
import socket
import sys
import time
from collections import deque
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

PERIOD = 0.01
"""Seconds between two questions."""
QUESTION = b"1+1;\n"
ANSWER = "2"
TIMEOUT_S = 30.0
"""Seconds after the end for which answers that are owed are waited for."""
SHOWN = 3
"""So many wrong answers are kept."""
HOLD = 0.05
"""Seconds of processor time without an answer that is owed, from which on the server was held."""


@dataclass
class Seen:
    """What the neighbour saw; times in seconds.  A question without an answer counts as long as it has waited.

    Attributes:
        p50, p99, worst: of the times until an answer came.
        busy_p99: of the processor time of the server until an answer came, which is at most the time by the clock.
        longest_hold: the most processor time of the server in which no answer came though one was owed.
        holds: those times that were longer than ``HOLD``.
    """

    asked: int = 0
    answered: int = 0
    wrong: int = 0
    examples: list[str] = field(default_factory=list)
    told: int = 0
    closed: bool = False
    p50: float = 0.0
    p99: float = 0.0
    worst: float = 0.0
    busy_p99: float = 0.0
    longest_hold: float = 0.0
    holds: list[float] = field(default_factory=list)


class ProcessorTime:
    """The processor time of another process, in seconds (``clock_getcpuclockid(3)``); stands still at its end."""

    def __init__(self, pid: int) -> None:
        self._clock = (~pid << 3) | 2
        self._last = 0.0

    def __call__(self) -> float:
        try:
            self._last = time.clock_gettime(self._clock)
        except OSError:
            pass
        return self._last


class Moment(NamedTuple):
    """When something was seen: by the clock, and in processor time of the server."""

    time: float
    busy: float


class Neighbour:
    """One connection that asks."""

    def __init__(self, port: int, server: int, most_owed: int = sys.maxsize) -> None:
        """``server`` is a process.  ``most_owed``: so many answers may be owed when it asks again."""
        self._most_owed = most_owed
        self._processor_time = ProcessorTime(server)
        self._socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._rest = b""
        self._owed: deque[Moment] = deque()
        self._waits: list[Moment] = []
        self._heard = Moment(0.0, 0.0)
        self.seen = Seen()

    def ask_until(self, ends: int) -> Seen:
        """Ask until there is something to read at the descriptor ``ends``."""
        seen = self.seen
        due = time.monotonic()
        while not seen.closed:
            wait = max(0.0, due - time.monotonic())
            ready, _, _ = select.select([self._socket.fileno(), ends], [], [], wait)
            if self._socket.fileno() in ready:
                self._listen()
            if ends in ready:
                break
            if time.monotonic() >= due:
                if len(self._owed) < self._most_owed:
                    self._ask(due)
                due += PERIOD
        end = time.monotonic() + TIMEOUT_S
        while self._owed and not seen.closed and time.monotonic() < end:
            if select.select([self._socket], [], [], 0.1)[0]:
                self._listen()
        if self._owed:
            self._note_hold(self._now())
        for since in self._owed:
            self._waits.append(self._since(since))
        times = sorted(wait.time for wait in self._waits) or [0.0]
        seen.p50, seen.p99, seen.worst = times[len(times) // 2], times[len(times) * 99 // 100], times[-1]
        seen.busy_p99 = sorted(wait.busy for wait in self._waits)[len(times) * 99 // 100] if self._waits else 0.0
        return seen

    def _now(self) -> Moment:
        return Moment(time.monotonic(), self._processor_time())

    def _since(self, then: Moment) -> Moment:
        """The time since then.  Several threads of the server may use more processor time than there is time."""
        now = self._now()
        passed = now.time - then.time
        return Moment(passed, min(passed, now.busy - then.busy))

    def _note_hold(self, now: Moment) -> None:
        """An answer has come, or none will: the time since the last one, or since the question, was a hold if long."""
        began = max(self._owed[0], self._heard)
        hold = min(now.time - began.time, now.busy - began.busy)
        self.seen.longest_hold = max(self.seen.longest_hold, hold)
        if hold > HOLD:
            self.seen.holds.append(hold)

    def _ask(self, due: float) -> None:
        try:
            self._socket.sendall(QUESTION)
        except BlockingIOError:
            pass  # so many answers are owed that nothing more can be said; this one counts, too
        except OSError:
            self.seen.closed = True
            return
        self.seen.asked += 1
        self._owed.append(Moment(due, self._processor_time()))

    def _listen(self) -> None:
        try:
            data = self._socket.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.seen.closed = True
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._take(line.decode("latin-1").partition("] ")[2])

    def _take(self, line: str) -> None:
        """One line, without its time stamp."""
        seen = self.seen
        if line.startswith(("!!!    called from", "***")):
            seen.told += 1
            return
        if not self._owed:
            line = f"not asked for: {line}"
        else:
            now = self._now()
            self._note_hold(now)
            self._heard = now
            self._waits.append(self._since(self._owed.popleft()))
            seen.answered += 1
        if line != ANSWER:
            seen.wrong += 1
            if len(seen.examples) < SHOWN:
                seen.examples.append(line)


def main() -> None:
    """Ask at a port until told to end, and print what was seen."""
    seen = Neighbour(*map(int, sys.argv[1:])).ask_until(sys.stdin.fileno())
    print(json.dumps(asdict(seen)), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
