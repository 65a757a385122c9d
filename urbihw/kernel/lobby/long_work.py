"""Reading and compiling what is long, without keeping others waiting.

Both are done by the job that needs them, and give way after each ``AIR`` seconds: to other jobs, and to the sockets.
What is short is done at once, as a statement within ``|`` must be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from urbihw.kernel import errors
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.coro import Steps
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.syntax.pace import Pace
from urbihw.kernel.syntax.reader import Item, Reader, Statement

T = TypeVar("T")

AIR = 0.002
"""Seconds after which long work gives way.  Who comes meanwhile is answered after three such turns at the most."""
SLICE = 4096
"""How many bytes are read at once."""
MOST_OF_A_PROGRAM = 500_000
"""How many words and signs a program for ``load`` or ``eval`` may have; all of it is read before any of it runs, which
takes 150 MB for as many."""
SHORT = 500
"""Texts of so many characters are read, or compiled, in one go: 5 ms at the most."""


class LongWork:
    """The long work of one kernel, for its jobs; Python's collector leaves alone what exists meanwhile."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler

    def pause(self) -> None:
        """Between two steps of long work: give way if it is time.  Raises what is thrown at the job."""
        COLLECTOR.leave_alone()
        self.give_way()

    def give_way(self) -> None:
        """Let the sockets and other jobs have their turn if this round has lasted long enough."""
        self._scheduler.give_way(AIR)

    def run(self, work: Callable[[Pace], T]) -> T:
        """Do some work that pauses by a pace."""
        steps = Steps(lambda pause: work(Pace(pause)))
        with COLLECTOR:
            try:
                while steps.step():
                    self.pause()
            finally:
                steps.end()
        return steps.result

    def read(self, text: str, file: str | None) -> list[Item]:
        """All of a program, as ``parse_program`` does it.  Raises Exception.Syntax for one that is too long."""
        reader, pace = Reader(file), Pace(self.pause)
        items: list[Item] = []
        with COLLECTOR:
            for at in range(0, len(text), SLICE):
                items += reader.feed(text[at : at + SLICE].encode("latin-1"), pace)
                self.pause()
                if reader.total > MOST_OF_A_PROGRAM:
                    place = items[-1].base if isinstance(items[-1], Statement) else items[-1].location
                    message = f"program too long (more than {MOST_OF_A_PROGRAM} words and signs): make several of it"
                    raise errors.Raised("Syntax", message, None, loc=str(place), input=text)
            return items + reader.finish(pace)


def end_of_slice(data: bytearray) -> int:
    """How much to read at once of what waits: whole lines, or whole statements, as far as can be told.

    A statement is found among the known ones only if all of it has come.
    """
    if len(data) <= SLICE:
        return len(data)
    return (data.rfind(b"\n", 0, SLICE) + 1) or (data.rfind(b";", 0, SLICE) + 1) or SLICE
