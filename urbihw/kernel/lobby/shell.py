"""From statements to jobs: a lobby's main job runs its statements in order, ``,`` makes background jobs."""

from __future__ import annotations

import itertools
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.compiler import compile_node, library
from urbihw.kernel.compiler.cache import UnitCache
from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.sched.group import Group
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.signals import Interrupted, StopTag
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.syntax.location import Location
from urbihw.kernel.syntax.reader import Item, Reader, Statement, StatementCache, SyntaxProblem, parse_program

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")


class Programs:
    """What all lobbies of a kernel share: caches of read and compiled statements, the verbs of generated code, and what
    the host says of itself (``name``, ``arguments``, ``listen_port``, ``quiet``; ``shutdown()`` ends the process,
    ``reboot()`` does so and starts it anew, None if it cannot)."""

    def __init__(self, world: World, ops: dict[str, Any]) -> None:
        self.world = world
        self.ops = ops
        self.read = StatementCache()
        self.units = UnitCache()
        self._lobbies = 0
        self.lobbies: dict[Lobby, None] = {}
        self.name = "urbi"
        self.arguments: list[str] = []
        self.quiet = True
        self.listen_port = -1
        self.shutdown: Callable[[], None] = lambda: None
        self.reboot: Callable[[], None] | None = None

    def lobby_name(self) -> str:
        """A name for the next connection's tag."""
        self._lobbies += 1
        return f"Lobby_{self._lobbies}"

    def function(self, statement: Statement) -> Callable[[Any], Any]:
        """A statement as a Python function of ``this``."""
        world = self.world
        try:
            unit = self.units.get(statement.text, statement.node, world.lazy_names, world.generic_floats)
        except errors.TooDeep as error:
            raise too_deep(error, statement) from None
        return unit.function(self.ops, statement.base)

    def evaluate(self, text: str, this: Any, file: str | None = None) -> Any:
        """Run a program (``eval``, ``load``): the value of its last statement.

        A syntax error anywhere means that nothing runs; it is raised as Exception.Syntax.  Must be called in a job.
        """
        return self._run(self._compiled(text, file), this, system=False)

    def load_library(self, text: str, file: str) -> None:
        """Run a part of the library with Global as ``this``; compiled code is kept on the disk.

        Its frames are not shown in call stacks.
        """
        key = library.key_of(file + "\n" + text, self.world.lazy_names)
        kept = library.load(key)
        if kept is not None:
            self._run(kept, self.world.global_, system=True)
            return
        made: list[library.Compiled] = []

        def remember() -> Iterator[library.Compiled]:
            for part in self._compiled(text, file):
                made.append(part)
                yield part

        self._run(remember(), self.world.global_, system=True)
        library.store(key, made)

    def _compiled(self, text: str, file: str | None) -> Iterator[library.Compiled]:
        items = parse_program(text, file)
        for item in items:
            if isinstance(item, SyntaxProblem):
                if not item.warning:
                    raise errors.Raised("Syntax", item.message, None, loc=str(item.location), input=text)
                self._warn(item)
        world = self.world
        for item in items:
            if isinstance(item, Statement):
                try:
                    unit = compile_node(item.node, world.lazy_names, generic=world.generic_floats)
                except errors.TooDeep as error:
                    raise too_deep(error, item) from None
                yield library.Compiled(unit, item.base, item.separator)

    def _warn(self, problem: SyntaxProblem) -> None:
        """Tell the lobby of the running job of a warning about a text, and who had the text evaluated."""
        context = self.world.scheduler.running().context
        if context is None:
            return
        stack = current_stack()
        context.output.line(f"!!! {problem.location}: {problem.message}", "warning")
        for place, name in ((stack.location, stack.routine), *stack.calls):
            context.output.line(f"!!!    called from: {place}: {name}", "warning")

    def _run(self, program: Iterable[library.Compiled], this: Any, system: bool) -> Any:
        scheduler = self.world.scheduler
        value = self.world.void
        with Group(scheduler) as background:
            for unit, base, separator in program:
                function = unit.function(self.ops, base, system)
                if separator == ",":
                    background.start(partial(function, this))
                else:
                    value = function(this)
                    if scheduler.ready:
                        scheduler.yield_()
        return value


def too_deep(error: errors.TooDeep, statement: Statement) -> errors.Raised:
    """The syntax error that tells of a statement that nests too deep, and where it stands."""
    place = Location.of(statement.node.span, statement.base)
    return errors.Raised("Syntax", error.message, None, loc=str(place), input=statement.text)


class Shell:
    """The main job of one lobby."""

    def __init__(self, lobby: Lobby, name: str) -> None:
        self._lobby = lobby
        self._scheduler = lobby.world.scheduler
        self._reader = Reader(cache=lobby.programs.read)
        self._items: deque[Item] = deque()
        self._more = WaitQueue(self._scheduler)
        self._numbers = itertools.count(1)
        self._when_idle: Callable[[], None] | None = None
        self._job = self._scheduler.spawn(self._run, name, context=lobby)

    def feed(self, data: bytes) -> None:
        """Bytes from the client."""
        items = self._reader.feed(data)
        if items:
            self._items.extend(items)
            self._more.wake_one()

    def close(self) -> None:
        """End the main job; what was not yet run is dropped."""
        self._items.clear()
        self._scheduler.kill(self._job)

    def is_running(self) -> bool:
        """Whether the statement in the foreground holds the interpreter."""
        return self._scheduler.current is self._job

    def interrupt(self) -> None:
        """Kill the statement in the foreground and drop what waits behind it, the half of a statement too.

        Nothing happens when there is none.  To be called outside any job (``Kernel.post``).
        """
        if not self._more:
            self._scheduler.throw(self._job, Interrupted())

    def next_name(self) -> str:
        """A name for the next job: statements and what they detach are numbered in one row."""
        return f"shell_{next(self._numbers)}"

    def when_idle(self, action: Callable[[], None]) -> None:
        """Call ``action`` once all statements received so far were run."""
        self._when_idle = action
        self._more.wake_one()

    def _run(self) -> None:
        while True:
            try:
                self._serve()
            except Interrupted:
                self._items.clear()
                self._reader = Reader(cache=self._lobby.programs.read)
                self._lobby.output.line("!!! received interruption, killing foreground job.", "error")

    def _serve(self) -> None:
        while True:
            while not self._items:
                if self._when_idle is not None:
                    self._when_idle()
                self._more.wait()
            item = self._items.popleft()
            if isinstance(item, SyntaxProblem):
                self._complain(item)
            elif item.separator == ",":
                self._background(item)
            else:
                self._foreground(item)
                if self._scheduler.ready:
                    self._scheduler.yield_()

    def _complain(self, problem: SyntaxProblem) -> None:
        if problem.warning:
            self._lobby.output.line(f"!!! {problem.location}: warning: {problem.message}", "warning")
        else:
            self._lobby.output.line(f"!!! {problem.location}: syntax error: {problem.message}", "error")

    def _foreground(self, statement: Statement) -> None:
        lobby = self._lobby
        self._job.name = self.next_name()
        self._job.renew()
        passage = lobby.tag.open()
        try:
            passage.enter()
            self.show(lobby.programs.function(statement)(lobby))
        except StopTag as signal:
            if not passage.owns(signal):
                raise
        except Exception as error:
            lobby.report(error)
        finally:
            passage.exit()

    def show(self, value: Any) -> None:
        """Print the value of a top-level statement; void and nil are silent.

        A lobby may have a ``topLevel`` of its own.
        """
        world = self._lobby.world
        channel = self._lobby.slots.get("topLevel")
        if channel is not None:
            if value is not world.void:
                world.send(channel, "<<", value)
        elif value is not world.void and value is not world.nil:
            self._lobby.output.line(world.text(world.ops.send0(value, "asToplevelPrintable")))

    def _background(self, statement: Statement) -> None:
        lobby = self._lobby

        def run() -> None:
            passage = lobby.tag.open()
            try:
                passage.enter()
                lobby.programs.function(statement)(lobby)
            except StopTag as signal:
                if not passage.owns(signal):
                    raise
            finally:
                passage.exit()

        job = self._scheduler.spawn(run, self.next_name(), context=lobby)
        self._scheduler.start_now(job)


def report_failure(job: Job, error: Exception) -> None:
    """What the scheduler does with an error that ends a job: tell the lobby the job speaks to."""
    if job.context is not None:
        job.context.report(error)
    else:
        log.error("job %s failed: %s", job.name, error)
