"""From statements to jobs: a lobby's main job runs its statements in order; ``,`` starts background jobs."""

from __future__ import annotations

import contextlib
import itertools
import logging
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.compiler import CompiledUnit, compile_node, library
from urbihw.kernel.compiler.cache import UnitCache
from urbihw.kernel.compiler.unit import CompilerState
from urbihw.kernel.lobby.host_process import HostProcess
from urbihw.kernel.lobby.long_work import MAX_SHORT_TEXT, LongWork, end_of_slice
from urbihw.kernel.lobby.printing import show
from urbihw.kernel.lobby.program_files import compiled_file, is_kept
from urbihw.kernel.lobby.server_log import ServerLog
from urbihw.kernel.lobby.templates import TemplateCache, TemplateUse
from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.sched.arrivals import Arrivals, renewed
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.group import Group
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.signals import Interrupted, JobKilled, StopTag
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.syntax.chains import LongChain
from urbihw.kernel.syntax.location import Location
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.reader import Item, Statement, StatementReader, SyntaxProblem, parse_program

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")

HELPLESS = frozenset([b"", b"exit", b"quit", b"bye", b"help", b"?"])
"""Lines of somebody who does not see why nothing is answered; with a lease, an empty line keeps it."""
ENDLESS = re.compile(r"(every|loop)\b")
"""The word that begins a statement which goes on for ever."""
PIECES_PER_STEP = 16
"""Number of pieces of a long chain that are run at once; half a millisecond of work."""


class Programs:
    """Shared by all lobbies of a kernel: caches of parsed and compiled statements, the verbs of generated code, and the
    process they run in.

    Attributes:
        process: name, arguments, shutdown and reboot of the process.
        exit_status: the exit code that a program requests, None for that of the process.
        listen_port: the TCP port for clients, -1 for none.
        quiet: whether connections get no banner and no advice behind an error.
        log: the last lines of the process's log.
    """

    def __init__(self, world: World, ops: dict[str, Any], process: HostProcess) -> None:
        self.world = world
        self.ops = ops
        self.process = process
        self.log = ServerLog(world)
        self.read = TemplateCache()
        self.units = UnitCache()
        self.long_work = LongWork(world.scheduler)
        self._lobbies = 0
        self.lobbies: dict[Lobby, None] = {}
        self.quiet = True
        self.listen_port = -1
        self.exit_status: int | None = None

    def exit(self, status: int) -> None:
        """Shut down the process with an exit code from 0 to 255."""
        self.exit_status = status & 0xFF
        self.process.shutdown()

    def lobby_name(self) -> str:
        """A name for the next connection's tag."""
        self._lobbies += 1
        return f"Lobby_{self._lobbies}"

    def function(self, statement: Statement) -> Callable[[Any], Any]:
        """A statement as a Python function of ``this``."""
        world, node = self.world, statement.node
        if isinstance(node, LongChain):
            return partial(self._run_chain, node.pieces)
        if isinstance(node, TemplateUse):
            return node.template.unit(world, statement.text, node.values).function(self.ops, statement.base)
        names = world.lazy_names
        state, own = (names.shared, world.generic_floats), names.own_in(statement.text)
        unit = self.units.get(statement.text, state, own, partial(self.unit, statement))
        return unit.function(self.ops, statement.base)

    def _run_chain(self, pieces: list[Statement], this: Any) -> Any:
        """Run the pieces of a long chain; between them, others get their turn if they have waited for long.

        Returns the value of the last piece.
        """
        value = self.world.void
        for index, piece in enumerate(pieces):
            if not index % PIECES_PER_STEP:
                self.long_work.give_way()
            value = self.function(piece)(this)
        return value

    def unit(self, statement: Statement) -> CompiledUnit:
        """The compiled statement.  A long one is compiled in steps, and must be compiled in a job."""
        world, use = self.world, self.read.use(statement.text)
        if use is not None:
            return use.template.unit(world, statement.text, use.values)
        return self.compile_statement(statement)

    @property
    def compiler_state(self) -> CompilerState:
        """The state on which the code of the running job's client depends: the names known to belong to lazy functions,
        and whether arithmetic is generic.
        """
        return self.world.lazy_names.known(), self.world.generic_floats

    def compile_statement(self, statement: Statement) -> CompiledUnit:
        """Compile a statement without templates and caches.  A long one must be compiled in a job."""
        lazy_names, generic = self.compiler_state
        make = partial(compile_node, statement.node, lazy_names, generic=generic)
        try:
            return make() if len(statement.text) <= MAX_SHORT_TEXT else self.long_work.run(lambda pace: make(pace=pace))
        except (errors.TooDeep, errors.StatementTooLong) as error:
            place = Location.of(statement.node.span, statement.base)
            raise errors.Raised("Syntax", error.message, None, loc=str(place), input=statement.text) from None

    def evaluate(self, text: str, this: Any, file: str | None = None) -> Any:
        """Run a program (``eval``, ``load``) and return the value of its last statement.

        A syntax error anywhere means that nothing runs; it is raised as Exception.Syntax.  Must be called in a job.
        """
        if file is not None and is_kept(text):
            return self._run(compiled_file(self, text, file), this, system=False)
        return self._run(self.compiled(self.parse(text, file), text, self.unit), this, system=False)

    def parse(self, text: str, file: str | None = None) -> list[Item]:
        """Parse a whole program.  A long one is parsed in steps, and must be parsed in a job."""
        return parse_program(text, file) if len(text) <= MAX_SHORT_TEXT else self.long_work.read(text, file)

    def load_library(self, text: str, file: str) -> None:
        """Run a part of the library with Global as ``this``; its compiled code is cached on disk.

        Its frames are not shown in call stacks.
        """
        key = library.key_of(file + "\n" + text, self.world.lazy_names.shared)
        kept = library.load(key)
        if kept is not None:
            self._run(kept, self.world.global_, system=True)
            return
        made: list[library.Compiled] = []

        def remember() -> Iterator[library.Compiled]:
            for part in self.compiled(parse_program(text, file), text, self._library_unit):
                made.append(part)
                yield part

        self._run(remember(), self.world.global_, system=True)
        library.store(key, made)

    def _library_unit(self, statement: Statement) -> CompiledUnit:
        """Compile a statement of the library, without pauses, as there are no clients yet; its functions are not
        cut.
        """
        lazy_names, generic = self.compiler_state
        return compile_node(statement.node, lazy_names, generic=generic)

    def compiled(
        self, items: list[Item], text: str, make: Callable[[Statement], CompiledUnit]
    ) -> Iterator[library.Compiled]:
        """The statements of a program, each compiled by ``make`` when the one before it has been run.

        Raises Exception.Syntax, before the first statement, for an error in any statement.
        """
        for item in items:
            if isinstance(item, SyntaxProblem):
                if not item.warning:
                    raise errors.Raised("Syntax", item.message, None, loc=str(item.location), input=text)
                self._warn(item)
        items.reverse()
        while items:  # free the statements that have run
            item = items.pop()
            if isinstance(item, Statement):
                yield library.Compiled(make(item), item.base, item.separator)

    def _warn(self, problem: SyntaxProblem) -> None:
        """Report a warning about a text to the lobby of the running job, with the call that evaluated the text."""
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
                    elif not system:
                        self.long_work.give_way()
        return value


class Shell:
    """The main job of one lobby."""

    def __init__(self, lobby: Lobby, name: str) -> None:
        self._lobby = lobby
        self._scheduler = lobby.world.scheduler
        self._reader = StatementReader(cache=lobby.programs.read)
        self._pace = StepPace(self._pause)
        self._input = bytearray()
        self._arrivals = Arrivals()
        self._items: deque[tuple[Item, int]] = deque()
        """What is read, and when it was ordered (``Job.ordered``)."""
        self._begun: int | None = None
        """When the first byte of the incomplete statement was ordered, None if there is none."""
        self._more = WaitQueue(self._scheduler)
        self._numbers = itertools.count(1)
        self._when_idle: Callable[[], None] | None = None
        self._is_endless = False
        """Whether the statement in the foreground goes on for ever, if nothing ends it."""
        self._open = True
        self._job = self._scheduler.spawn(self._run, name, context=lobby)
        self._last = self._job
        """The job of the statement that was begun last: what is pending stands behind that one."""
        self.turn = 0
        """Counts the statements that have begun in the foreground, and those that were interrupted."""

    def feed(self, data: bytes, ordered: int) -> None:
        """Handle bytes that were ``ordered`` then (``Job.ordered``), by the client or by a program.

        Short input is read at once, unless other input is pending.
        """
        line = data.strip()
        if self._is_endless and line:
            self._explain_wait()
        if self._input or self._items or self._reader.pending + len(data) > MAX_SHORT_TEXT:
            self._input += data
            self._arrivals.add(len(data), ordered)
            self._more.wake_one()
            return
        self._read(data, ordered)
        if self._items:
            self._more.wake_one()
        elif line in HELPLESS and (line or not self._lobby.lease.seconds):  # with a lease, it is a sign of life
            self._lobby.advise(self._reader.describe_rest())

    def _explain_wait(self) -> None:
        """Tell a client that waits for the end of an endless statement."""
        self._is_endless = False
        self._lobby.advise("this waits: every and loop never end; Ctrl-C ends them, a comma behind them lets go on")

    def order_anew(self, job: Job, since: int) -> None:
        """A job has released an emergency stop: let the pending input behind its statement count as ordered now, if it
        was ordered at ``since`` or later.

        No input stands behind a program that has gone on in the background: what is pending may have been sent before
        the stop, and not with its release in mind.
        """
        if not job.is_part_of(self._last):
            return
        now = self._scheduler.era
        self._arrivals.renew(since, now)
        self._items = deque((item, renewed(ordered, since, now)) for item, ordered in self._items)
        if self._begun is not None:
            self._begun = renewed(self._begun, since, now)
        self._lobby.unread.renew(since, now)

    @property
    def waiting(self) -> int:
        """The number of bytes that are not read yet, because earlier statements are running."""
        return len(self._input)

    def close(self) -> None:
        """End the main job and discard the pending input."""
        self._open = False
        self._discard_pending()
        self._scheduler.kill(self._job)

    def serves(self, job: Job) -> bool:
        """Whether a job is the main job, which runs the client's statements and ends with the connection."""
        return job is self._job

    def is_running(self) -> bool:
        """Whether the statement in the foreground is running now."""
        return self._scheduler.current is self._job

    def interrupt(self, turn: int | None = None) -> None:
        """Kill the statement in the foreground, and discard the pending input, including an incomplete statement.

        Does nothing without one, or when the given ``turn`` is over.  May be called by the statement itself and from
        outside any job.
        """
        if turn is not None and turn != self.turn:
            return
        if self._job.started and not self._more:
            self._scheduler.throw(self._job, Interrupted())

    def next_name(self) -> str:
        """A name for the next job: statements and detached jobs are numbered together."""
        return f"shell_{next(self._numbers)}"

    def when_idle(self, action: Callable[[], None]) -> None:
        """Call ``action`` when all statements received so far have run."""
        self._when_idle = action
        self._more.wake_one()

    def _run(self) -> None:
        while self._open:
            try:
                self._serve()
            except StopTag:
                pass  # of a statement that was over already
            except (Interrupted, JobKilled) as signal:
                if not self._open:
                    raise
                self.turn += 1
                self._discard_pending()
                if isinstance(signal, Interrupted) and signal.told:
                    continue
                self._lobby.output.line("!!! received interruption, killing foreground job.", "error")

    def _serve(self) -> None:
        while self._open:
            while not self._items:
                if self._input:
                    self._read_pending()
                    continue
                if self._when_idle is not None:
                    self._when_idle()
                self._more.wait()
            self._run_item(*self._items.popleft())
            self._lobby.served = True

    def _run_item(self, item: Item, ordered: int) -> None:
        by_lobby = self._lobby.ordered
        if by_lobby is not None:
            ordered = min(ordered, by_lobby)
        if isinstance(item, SyntaxProblem):
            self._complain(item)
        elif item.separator == ",":
            self._background(item, ordered)
        else:
            self._foreground(item, ordered)
            if self._scheduler.ready:
                self._scheduler.yield_()
                return
        if self._items:
            self._lobby.programs.long_work.give_way()

    def _read_pending(self) -> None:
        """Read the pending input up to the next statement."""
        with COLLECTOR:
            while self._input and not self._items:
                size = min(end_of_slice(self._input), self._arrivals.together)
                self._read(bytes(self._input[:size]), self._arrivals.take(size), self._pace)
                del self._input[:size]
                self._pause()

    def _read(self, data: bytes, ordered: int, pace: StepPace | None = None) -> None:
        """Read bytes; a statement is as old as the first of its bytes, which may have come with earlier ones."""
        begun, self._begun = self._begun, None
        items = self._reader.feed(data, pace)
        first = ordered if begun is None else min(begun, ordered)
        self._items.extend((item, ordered if at else first) for at, item in enumerate(items))
        if self._reader.pending:
            self._begun = ordered if items else first

    def _pause(self) -> None:
        """Let other jobs have a turn while a long text is being read."""
        with contextlib.suppress(StopTag):  # of a statement that was over already
            self._lobby.programs.long_work.pause()

    def _discard_pending(self) -> None:
        """Discard the pending input, including an incomplete statement."""
        self._items.clear()
        self._input.clear()
        self._arrivals.clear()
        self._begun = None
        self._reader = StatementReader(cache=self._lobby.programs.read)

    def _complain(self, problem: SyntaxProblem) -> None:
        if problem.warning:
            self._lobby.output.line(f"!!! {problem.location}: {problem.message}", "warning")
        elif self._lobby.programs.quiet or not problem.follows:
            self._lobby.output.line(f"!!! {problem.location}: syntax error: {problem.message}", "error")
            self._lobby.advise(problem.advice)

    def _foreground(self, statement: Statement, ordered: int) -> None:
        lobby = self._lobby
        self._job.name = self.next_name()
        self._job.begin_statement(ordered)
        self.turn += 1
        scope = lobby.tag.open()
        variables = len(lobby.slots)
        self._is_endless = ENDLESS.match(statement.text) is not None
        try:
            scope.enter()
            self.show(lobby.programs.function(statement)(lobby))
            lobby.advise_hiding(variables)
        except StopTag as signal:
            if not scope.owns(signal):
                raise
        except Exception as error:
            lobby.report(error, statement)
        finally:
            self._is_endless = False
            scope.exit()

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
            show(self._lobby, value)

    def _background(self, statement: Statement, ordered: int) -> None:
        lobby = self._lobby

        def run() -> None:
            scope = lobby.tag.open()
            variables = len(lobby.slots)
            try:
                scope.enter()
                lobby.programs.function(statement)(lobby)
                lobby.advise_hiding(variables)
            except StopTag as signal:
                if not scope.owns(signal):
                    raise
            finally:
                scope.exit()

        job = self._scheduler.spawn(run, self.next_name(), context=lobby)
        job.begin_statement(ordered)
        self._last = job
        try:
            self._scheduler.start_now(job)
        finally:
            self._last = self._job


def report_failure(job: Job, error: Exception) -> None:
    """Report an error that ended a job to the job's lobby."""
    if job.context is not None:
        job.context.report(error)
    else:
        log.error("job %s failed: %s", job.name, error)
