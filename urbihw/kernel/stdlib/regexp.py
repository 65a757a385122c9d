"""Regexp: Perl's regular expressions.

Source: manual, specs/regexp.  Python's ``re`` does the work; ``perl`` tells it what it would read otherwise.

A match that is over within ``QUICK`` is made on the spot.  Any other is made by another process, so that others are
answered meanwhile, and is an error when it takes more than ``LIMIT``: what an expression costs may double with each
character of the text.  So a match that is not quick gives way to others, inside ``|`` too.
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
from urbihw.kernel.stdlib.aside import Aside
from urbihw.kernel.stdlib.matcher import Matcher
from urbihw.kernel.stdlib.perl import NotPerl, to_python

TABLE = Table("Regexp")
PROTOS = {"Regexp": ("Container", "Object")}
EMPTY: Final = re.compile("")
QUICK: Final = 0.003
"""Seconds of processor time that a match may take while the others wait."""
SHORT: Final = 4000
"""Characters of a text with which a match is tried on the spot: in each place where it may begin, ``re`` goes through
the text once before it looks at the time."""
LIMIT: Final = 1.0
"""Seconds that a match may take."""
LONGEST: Final = 1000
"""Characters of an expression: it is compiled while the others wait, within some 50 ms."""
SHOWN: Final = 60
"""Characters of an expression that an error shows."""


class RegexpObject(Obj):
    """An urbiscript Regexp; ``text`` as it was written, ``found`` are the groups of the latest match."""

    __slots__ = ("compiled", "found", "text")

    def __init__(self, world: World, protos: list[Obj], text: str = "", compiled: re.Pattern[str] = EMPTY) -> None:
        super().__init__(world, protos)
        self.text = text
        self.compiled = compiled
        self.found: list[str] = []

    def clone(self) -> RegexpObject:
        """The same expression, not matched yet."""
        return RegexpObject(self.world, [self], self.text, self.compiled)


CLASSES = {"Regexp": RegexpObject}


class _TakesLong(Exception):
    """A match that was to be quick is not over."""


def _ring(number: int, frame: FrameType | None) -> None:
    """The alarm: leaves ``search_quickly`` and nothing else."""
    for _ in range(3):
        if frame is None:
            return
        if frame.f_code is search_quickly.__code__:
            raise _TakesLong
        frame = frame.f_back


def groups(match: re.Match[str] | None) -> list[str] | None:
    """The whole and each group of a match."""
    return None if match is None else [match[0], *(group or "" for group in match.groups())]


def search_quickly(compiled: re.Pattern[str], text: str) -> list[str] | None:
    """The first match, in the main thread, with ``_ring`` for a handler.  Raises _TakesLong after ``QUICK``.

    ``re`` lets the handlers of signals run now and then, and gives up when one raises.
    """
    try:
        signal.setitimer(signal.ITIMER_PROF, QUICK)
        return groups(compiled.search(text))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


class Searching:
    """What all Regexps of a world share: the process for what is not quick, and the queue before it."""

    def __init__(self, world: World) -> None:
        self._scheduler = world.scheduler
        self._matcher = Matcher()
        self._aside = Aside(world, self._matcher.close)
        self._has_alarm = False

    def search(self, this: RegexpObject, text: str) -> bool:
        """Look for an expression anywhere in a text.  Raises an error that says why it could not be told."""
        try:
            found = self._search(this.compiled, text)
        except TimeoutError:
            raise self._failure(this, f"took more than {LIMIT:g} s") from None
        except ValueError as error:
            raise self._failure(this, str(error)) from None
        this.found = [] if found is None else found
        return found is not None

    def _search(self, compiled: re.Pattern[str], text: str) -> list[str] | None:
        if len(text) <= SHORT and threading.current_thread() is threading.main_thread():
            if not self._has_alarm:
                signal.signal(signal.SIGPROF, _ring)
                self._has_alarm = True
            with contextlib.suppress(_TakesLong):
                return search_quickly(compiled, text)

        def work() -> list[str] | None:
            return self._matcher.search(compiled.pattern, text, LIMIT)

        if self._scheduler.current is None or isinstance(self._scheduler.clock, SimClock):
            return work()  # no job that could wait, or no time that passes
        return self._aside.do(work)

    @staticmethod
    def _failure(this: RegexpObject, reason: str) -> errors.Raised:
        shown = this.text if len(this.text) <= SHOWN else this.text[:SHOWN] + "..."
        return errors.primitive(f"regular expression `{shown}' {reason}")


@TABLE.primitive("init")
def init(world: World, this: RegexpObject, expression: str) -> None:
    """Compile an expression; an error if there is something wrong with it."""
    if not expression:
        raise errors.primitive("invalid regular expression `': Empty expression")
    try:
        if len(expression) > LONGEST:
            raise OverflowError
        this.compiled = re.compile(to_python(expression), re.ASCII)
    except (re.error, NotPerl, RecursionError, OverflowError) as error:
        reason = "too complex" if isinstance(error, (RecursionError, OverflowError)) else getattr(error, "msg", error)
        shown = expression if len(expression) <= LONGEST else expression[:SHOWN] + "..."
        raise errors.primitive(f"invalid regular expression `{shown}': {reason}") from error
    this.text = expression


@TABLE.primitive("asString")
def as_string(world: World, this: RegexpObject) -> str:
    """The expression."""
    return this.text


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: RegexpObject) -> str:
    """``Regexp`` and the expression as a literal."""
    return f"Regexp({escaped(this.text)})"


@TABLE.primitive("matches")
def matches(world: World, this: RegexpObject) -> Any:
    """What the latest ``match`` found: the whole, then each group; empty if it found nothing."""
    return world.new_list([world.string(group) for group in this.found])


@TABLE.primitive("[]")
def get_item(world: World, this: RegexpObject, index: float) -> Any:
    """``matches[index]``."""
    if not 0 <= index < len(this.found) or index != int(index):
        raise errors.primitive(f"out of bound index: {world.text(index)}")
    return world.string(this.found[int(index)])


def install(world: World, programs: Any) -> None:
    """What matches shares a process."""
    searching = Searching(world)
    table = Table("Regexp")

    @table.primitive("match", "has")
    def match(world: World, this: RegexpObject, text: str) -> bool:
        """Whether the expression is found anywhere in a string; ``matches`` tells what was found."""
        return searching.search(this, text)

    @table.primitive("hasNot")
    def has_not(world: World, this: RegexpObject, text: str) -> bool:
        """Whether the expression is nowhere in a string."""
        return not searching.search(this, text)

    table.install(world, world.classes["Regexp"])
