"""Regexp: Perl's regular expressions.

Source: manual, specs/regexp.  Python's ``re`` does the matching; ``perl`` translates the syntax that differs.

A match that ends within ``QUICK_TIMEOUT_S`` is made in the kernel's thread.  Any other match is made by another
process, so that other jobs continue meanwhile, and raises an error if it takes more than ``MATCH_TIMEOUT_S``: the time
for an expression may double with each character of the text.  A match that is not quick therefore gives other jobs
turns, even inside ``|``.
"""

from __future__ import annotations

import contextlib
import re
import signal
import threading
from types import FrameType
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.stdlib.matcher import Matcher
from urbihw.kernel.stdlib.perl import NotPerl, to_python
from urbihw.kernel.stdlib.worker_thread import WorkerThread
from urbihw.kernel.value import Value

TABLE = Table("Regexp")
PROTOS = {"Regexp": ("Container", "Object")}
EMPTY: Final = re.compile("")
QUICK_TIMEOUT_S: Final = 0.003
"""Maximum processor time, in seconds, of a match in the kernel's thread."""
MAX_QUICK_LENGTH: Final = 4000
"""Maximum length, in characters, of a text that is matched in the kernel's thread: for each start position, ``re``
scans the text once before it checks for signals."""
MATCH_TIMEOUT_S: Final = 1.0
"""Maximum duration of a match, in seconds."""
MAX_EXPRESSION_LENGTH: Final = 1000
"""Maximum length of an expression, in characters: it is compiled in the kernel's thread, within about 50 ms."""
MAX_SHOWN_LENGTH: Final = 60
"""Maximum number of characters of an expression in an error message."""


class RegexpObject(Obj):
    """An urbiscript Regexp; ``text`` is the expression as written, ``found`` are the groups of the latest match."""

    __slots__ = ("compiled", "found", "text")

    def __init__(self, world: World, protos: list[Obj], text: str = "", compiled: re.Pattern[str] = EMPTY) -> None:
        super().__init__(world, protos)
        self.text = text
        self.compiled = compiled
        self.found: list[str] = []

    def clone(self) -> RegexpObject:
        """A Regexp with the same expression, not matched yet."""
        return RegexpObject(self.world, [self], self.text, self.compiled)


CLASSES = {"Regexp": RegexpObject}


class _QuickTimeout(Exception):
    """A quick match has exceeded its time limit."""


def _raise_timeout(number: int, frame: FrameType | None) -> None:
    """The signal handler of the alarm: leaves ``search_quickly`` and nothing else."""
    for _ in range(3):
        if frame is None:
            return
        if frame.f_code is search_quickly.__code__:
            raise _QuickTimeout
        frame = frame.f_back


def groups(match: re.Match[str] | None) -> list[str] | None:
    """The whole match and its groups."""
    return None if match is None else [match[0], *(group or "" for group in match.groups())]


def search_quickly(compiled: re.Pattern[str], text: str) -> list[str] | None:
    """The first match, searched in the main thread, with ``_raise_timeout`` as the signal handler.  Raises
    _QuickTimeout after ``QUICK_TIMEOUT_S``.

    ``re`` calls the handlers of signals from time to time, and stops when one raises.
    """
    try:
        signal.setitimer(signal.ITIMER_PROF, QUICK_TIMEOUT_S)
        return groups(compiled.search(text))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


class RegexpSearch:
    """State shared by all Regexps of a world: the process for matches that are not quick, and its queue."""

    def __init__(self, world: World) -> None:
        self._scheduler = world.scheduler
        self._matcher = Matcher()
        self._worker = WorkerThread(world, self._matcher.close)
        self._has_alarm = False

    def search(self, this: RegexpObject, text: str) -> bool:
        """Search for an expression anywhere in a text.  Raises an error with the reason if the search fails."""
        try:
            found = self._search(this.compiled, text)
        except TimeoutError:
            raise self._failure(this, f"took more than {MATCH_TIMEOUT_S:g} s") from None
        except ValueError as error:
            raise self._failure(this, str(error)) from None
        this.found = [] if found is None else found
        return found is not None

    def _search(self, compiled: re.Pattern[str], text: str) -> list[str] | None:
        if len(text) <= MAX_QUICK_LENGTH and threading.current_thread() is threading.main_thread():
            if not self._has_alarm:
                signal.signal(signal.SIGPROF, _raise_timeout)
                self._has_alarm = True
            with contextlib.suppress(_QuickTimeout):
                return search_quickly(compiled, text)

        def work() -> list[str] | None:
            return self._matcher.search(compiled.pattern, text, MATCH_TIMEOUT_S)

        if self._scheduler.current is None or isinstance(self._scheduler.clock, SimClock):
            return work()  # there is no job that could wait, or the clock is simulated
        return self._worker.run_work(work)

    @staticmethod
    def _failure(this: RegexpObject, reason: str) -> errors.Raised:
        shown = this.text if len(this.text) <= MAX_SHOWN_LENGTH else this.text[:MAX_SHOWN_LENGTH] + "..."
        return errors.primitive(f"regular expression `{shown}' {reason}")


@TABLE.primitive("init")
def init(world: World, this: RegexpObject, expression: str) -> None:
    """Compile an expression.  Raises an error if it is invalid."""
    if not expression:
        raise errors.primitive("invalid regular expression `': Empty expression")
    try:
        if len(expression) > MAX_EXPRESSION_LENGTH:
            raise OverflowError
        this.compiled = re.compile(to_python(expression), re.ASCII | re.MULTILINE)
    except (re.error, NotPerl, RecursionError, OverflowError) as error:
        reason = "too complex" if isinstance(error, (RecursionError, OverflowError)) else getattr(error, "msg", error)
        shown = expression if len(expression) <= MAX_EXPRESSION_LENGTH else expression[:MAX_SHOWN_LENGTH] + "..."
        raise errors.primitive(f"invalid regular expression `{shown}': {reason}") from error
    this.text = expression


@TABLE.primitive("asString")
def as_string(world: World, this: RegexpObject) -> str:
    """The expression, as a String."""
    return this.text


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: RegexpObject) -> str:
    """``Regexp`` and the expression, as a literal."""
    return f"Regexp({escaped(this.text)})"


@TABLE.primitive("matches")
def matches(world: World, this: RegexpObject) -> Value:
    """The result of the latest ``match``: the whole match, then each group; empty if there was no match."""
    return world.new_list([world.string(group) for group in this.found])


@TABLE.primitive("[]")
def get_item(world: World, this: RegexpObject, index: float) -> Value:
    """The result of ``matches[index]``."""
    if not 0 <= index < len(this.found) or index != int(index):
        raise errors.primitive(f"out of bound index: {world.text(index)}")
    return world.string(this.found[int(index)])


def install(world: World, programs: Any) -> None:
    """Install the functions that share a worker process."""
    searching = RegexpSearch(world)
    table = Table("Regexp")

    @table.primitive("match", "has")
    def match(world: World, this: RegexpObject, text: str) -> bool:
        """Whether the expression matches anywhere in a string; ``matches`` has the result."""
        return searching.search(this, text)

    @table.primitive("hasNot")
    def has_not(world: World, this: RegexpObject, text: str) -> bool:
        """Whether the expression does not match anywhere in a string."""
        return not searching.search(this, text)

    table.install(world, world.classes["Regexp"])
