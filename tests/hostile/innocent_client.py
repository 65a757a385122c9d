"""The innocent neighbour: asks ``1+1;`` every 10 ms and looks at each answer.  A program of its own: PORT [MOST].

It asks on time whether the last answer has come or not, so that a server which is silent for a second makes a hundred
late answers, as it would for a hundred neighbours.  With MOST it asks nothing while so many answers are owed: a slow
machine is asked less.  A line on its input ends it; then it prints what it saw, as JSON.
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

PERIOD = 0.01
"""Seconds between two questions."""
QUESTION = b"1+1;\n"
ANSWER = "2"
TIMEOUT_S = 30.0
"""Seconds after the end for which answers that are owed are waited for."""
SHOWN = 3
"""So many wrong answers are kept."""


@dataclass
class Seen:
    """What the neighbour saw; times in seconds.  A question without an answer counts as long as it has waited."""

    asked: int = 0
    answered: int = 0
    wrong: int = 0
    examples: list[str] = field(default_factory=list)
    told: int = 0
    closed: bool = False
    p50: float = 0.0
    p99: float = 0.0
    worst: float = 0.0


class Neighbour:
    """One connection that asks."""

    def __init__(self, port: int, most_owed: int = sys.maxsize) -> None:
        """``most_owed``: so many answers may be owed when it asks again."""
        self._most_owed = most_owed
        self._socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._rest = b""
        self._owed: deque[float] = deque()
        self._times: list[float] = []
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
        now = time.monotonic()
        self._times += [now - since for since in self._owed]
        ordered = sorted(self._times) or [0.0]
        seen.p50, seen.p99 = ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100]
        seen.worst = ordered[-1]
        return seen

    def _ask(self, due: float) -> None:
        try:
            self._socket.sendall(QUESTION)
        except BlockingIOError:
            pass  # so many answers are owed that nothing more can be said; this one counts, too
        except OSError:
            self.seen.closed = True
            return
        self.seen.asked += 1
        self._owed.append(due)

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
            self._times.append(time.monotonic() - self._owed.popleft())
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
