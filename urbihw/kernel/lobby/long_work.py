"""Reading and compiling long programs without delaying other connections.

The job that needs the program does the work, and yields to other jobs and to the sockets after each ``MAX_HOLD_S``.
Short texts are handled at once, as a statement within ``|`` must be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from urbihw.kernel import errors
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.coro import Steps
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.reader import Item, Statement, StatementReader

T = TypeVar("T")

MAX_HOLD_S = 0.002
"""Seconds after which long work yields.  A client is answered after at most three such periods."""
READ_SIZE = 4096
"""Number of bytes that are read at once."""
MAX_PROGRAM_TOKENS = 500_000
"""Maximum number of tokens of a program for ``load`` or ``eval``.  The program is read before it runs, which takes 150
MB for so many tokens."""
MAX_SHORT_TEXT = 500
"""Maximum length of a text that is read and compiled without a pause, in characters; takes 5 ms at most."""


class LongWork:
    """Long work of the jobs of one kernel; the existing objects are frozen for Python's collector meanwhile."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler

    def pause(self) -> None:
        """Yield if it is time, between two steps of long work.  Raises the errors that are thrown into the job."""
        COLLECTOR.freeze_existing()
        self.give_way()

    def give_way(self) -> None:
        """Let the sockets and other jobs have their turn if this round has lasted long enough."""
        self._scheduler.give_way(MAX_HOLD_S)

    def run(self, work: Callable[[StepPace], T]) -> T:
        """Do work that pauses by a pace."""
        steps = Steps(lambda pause: work(StepPace(pause)))
        with COLLECTOR:
            try:
                while steps.step():
                    self.pause()
            finally:
                steps.end()
        return steps.result

    def read(self, text: str, file: str | None) -> list[Item]:
        """Parse a whole program, as ``parse_program`` does.  Raises Exception.Syntax if it is too long."""
        reader, pace = StatementReader(file), StepPace(self.pause)
        items: list[Item] = []
        with COLLECTOR:
            for at in range(0, len(text), READ_SIZE):
                items += reader.feed(text[at : at + READ_SIZE].encode("latin-1"), pace)
                self.pause()
                if reader.total > MAX_PROGRAM_TOKENS:
                    place = items[-1].base if isinstance(items[-1], Statement) else items[-1].location
                    message = f"program too long (more than {MAX_PROGRAM_TOKENS} words and signs): make several of it"
                    raise errors.Raised("Syntax", message, None, loc=str(place), input=text)
            return items + reader.finish(pace)


def end_of_slice(data: bytearray) -> int:
    """The number of pending bytes to read at once: whole lines or, as far as this can be told, whole statements.

    The cache of statements finds a statement only when all of its text is there.
    """
    if len(data) <= READ_SIZE:
        return len(data)
    return (data.rfind(b"\n", 0, READ_SIZE) + 1) or (data.rfind(b";", 0, READ_SIZE) + 1) or READ_SIZE
