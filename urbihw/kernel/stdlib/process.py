"""Process: programs of the operating system, with their standard streams.

Source: manual, specs/process.  A thread reads and writes the streams (``pipe``) and observes the end (``child``); the
kernel never blocks.
"""

from __future__ import annotations

import io
import os
import subprocess
import weakref
from functools import partial
from typing import IO, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import holdings_of
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.stdlib.child import Child
from urbihw.kernel.stdlib.path import failure, name_of, system
from urbihw.kernel.stdlib.pipe import PipeSink, PipeSource, pipes_of
from urbihw.kernel.stdlib.stream import InputStreamObject, OutputStreamObject
from urbihw.kernel.value import Value

PROCESS = Table("Process")
STATUS = Table("Process.Status")
TABLES = [PROCESS, STATUS]

NOTES = {
    "Process.Status": "The state of a program: exitStatus or signal after its end.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class ProcessObject(Obj):
    """An urbiscript Process, with its program."""

    __slots__ = ("_late", "args", "begun", "child", "ended", "name", "sink", "sources", "waiting")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.name = ""
        self.args: list[str] = []
        self.begun = False
        self.child: Child | None = None
        self.ended = False
        self._late: Timer | None = None
        pipes = pipes_of(world)
        self.sink = PipeSink(pipes)
        self.sources = (PipeSource(pipes), PipeSource(pipes))
        self.waiting = WaitQueue(world.scheduler)

    def clone(self) -> ProcessObject:
        """A Process of the same program that is not running."""
        made = ProcessObject(self.world, [self])
        made.name, made.args = self.name, list(self.args)
        return made

    def start(self, target: str | None = None) -> None:
        """Run the program, with its standard output redirected to a file of this name if one is given.  The program
        ends with the connection.
        """
        if self.begun:
            raise errors.primitive("Process was already run")
        command = [system(part) for part in (self.name, *self.args)]
        self.begun = True
        try:
            self.child = made = Child(self.world, partial(_started, command, target))
        except BaseException as error:
            self.begun = False
            if isinstance(error, OSError):
                raise failure(error, self.name) from error
            raise
        made.on_end, made.on_close = self._exited, self._hung_up
        backlog = pipes_of(self.world).backlog(holdings_of(self.world))
        for out, source in zip((made.inner.stdout, made.inner.stderr), self.sources, strict=True):
            if out is None:
                source.finish()
            else:
                source.start(_detached(out), backlog)
        assert made.inner.stdin is not None
        self.sink.start(_detached(made.inner.stdin))
        weakref.finalize(self, _release, self.world.scheduler, self.sources)

    def _hung_up(self) -> None:
        """Close the streams because the connection has ended."""
        self.sink.drop()
        for source in self.sources:
            source.close()

    def _exited(self) -> None:
        """Called when the program has ended; its output may not have been read completely."""
        self.sink.drop()
        for source in self.sources:
            source.on_end = self._drained
        self._drained()
        # A child of the program may keep its streams open for ever.
        if not self.ended:
            scheduler = self.world.scheduler
            self._late = scheduler.call_at(scheduler.clock.now() + DRAIN_TIMEOUT_S, self._over)

    def _drained(self) -> None:
        if all(source.ended for source in self.sources):
            self._over()

    def _over(self) -> None:
        self.ended = True
        if self._late is not None:
            self._late.cancel()
        # An unreferenced process and its unread output are freed at once.
        assert self.child is not None
        for source in self.sources:
            source.on_end = _nothing
        self.child.on_end = self.child.on_close = _nothing
        self.waiting.wake_all()


def _nothing() -> None:
    """Default of the callbacks: no operation."""


def _detached(pipe: IO[bytes]) -> int:
    """The descriptor of a pipe, which belongs to the caller from now on and does not block."""
    assert isinstance(pipe, io.FileIO)
    descriptor = os.dup(pipe.fileno())
    pipe.close()
    os.set_blocking(descriptor, False)
    return descriptor


def _started(command: list[bytes], target: str | None, group: int | None) -> subprocess.Popen[bytes]:
    """Start a program with pipes, and with standard output redirected to a file of this name if one is given."""
    pipe = subprocess.PIPE
    output = pipe if target is None else _made(target)
    try:
        return subprocess.Popen(command, stdin=pipe, stdout=output, stderr=pipe, bufsize=0, process_group=group)
    finally:
        if output != pipe:
            os.close(output)


def _made(name: str) -> int:
    """Open a file for writing, and truncate it."""
    try:
        return os.open(system(name), os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise failure(error, name) from error


def _release(scheduler: Scheduler, sources: tuple[PipeSource, ...]) -> None:
    """Discard the unread output of an unreferenced process, from any thread."""
    for source in sources:
        scheduler.post(source.close)


CLASSES = {"Process": ProcessObject}

DRAIN_TIMEOUT_S: Final = 1.0
"""Time in seconds for reading the remaining output of a program after its end."""


@PROCESS.primitive("init")
def init(world: World, this: ProcessObject, name: str, args: list[Value]) -> None:
    """Make a Process for a program, found along the PATH, and the List of its arguments; ``run`` starts it."""
    for member in args:
        if not isinstance(member, String):
            raise world.type_error(2, member, "String")
    this.name = name
    this.args = [member.s for member in args]


@PROCESS.primitive("asProcess")
def as_process(world: World, this: ProcessObject) -> Value:
    """Returns this Process itself."""
    return this


@PROCESS.primitive("asString", "asPrintable")
def as_string(world: World, this: ProcessObject) -> str:
    """``Process`` and the name of the program."""
    return f"Process {os.path.basename(this.name)}"


@PROCESS.primitive("name")
def name(world: World, this: ProcessObject) -> str:
    """The name of the program, without directories."""
    return os.path.basename(this.name)


@PROCESS.primitive("run")
def run(world: World, this: ProcessObject) -> None:
    """Start the program; it can be started once."""
    this.start()


@PROCESS.primitive("runTo")
def run_to(world: World, this: ProcessObject, file: Value) -> None:
    """Start the program with its standard output redirected to a file (a String or a Path), which is replaced;
    ``stdout`` is empty.  The manual names this function without a description."""
    this.start(name_of(world, file))


@PROCESS.primitive("join")
def join(world: World, this: ProcessObject) -> None:
    """Wait until the program has ended.  Raises an error if it was not started."""
    if this.child is None:
        raise errors.primitive("Process was not run")
    while not this.ended:
        this.waiting.wait()


@PROCESS.primitive("kill")
def kill(world: World, this: ProcessObject) -> None:
    """Kill the program, unless it has ended; ``join`` waits for its end."""
    if this.child is not None:
        this.child.kill()


@PROCESS.primitive("done")
def done(world: World, this: ProcessObject) -> bool:
    """Whether the program was started and has ended."""
    return this.ended


@PROCESS.primitive("status")
def status(world: World, this: ProcessObject) -> Value:
    """An object that describes the state of the program; it has ``exitStatus`` or ``signal`` after the end."""
    made = Plain(world, [world.classes["Process.Status"]])
    text = "not started" if this.child is None else "running"
    code = this.child.code if this.child is not None and this.ended else None
    if code is not None and code >= 0:
        text = f"exited with status {code}"
        made.slots["exitStatus"] = float(code)
    elif code is not None:
        text = f"killed by signal {-code}"
        made.slots["signal"] = float(-code)
    made.slots["text"] = world.string(text)
    return made


@STATUS.primitive("asString", "asPrintable")
def status_as_string(world: World, this: Obj) -> str:
    """``not started``, ``running``, ``exited with status N``, ``killed by signal N``."""
    return world.text(this.slots["text"]) if "text" in this.slots else "Status"


@PROCESS.primitive("stdin")
def stdin(world: World, this: ProcessObject) -> Value:
    """The OutputStream to the program's standard input."""
    return _stream(world, this, "stdin")


@PROCESS.primitive("stdout")
def stdout(world: World, this: ProcessObject) -> Value:
    """The InputStream of the program's standard output."""
    return _stream(world, this, "stdout")


@PROCESS.primitive("stderr")
def stderr(world: World, this: ProcessObject) -> Value:
    """The InputStream of the program's standard error."""
    return _stream(world, this, "stderr")


def _stream(world: World, this: ProcessObject, name: str) -> Obj:
    """A stream of a process, made once, so that closing it closes it for all users."""
    slot = f"_{name}"
    made = this.slots.get(slot)
    if made is None:
        if name == "stdin":
            made = OutputStreamObject(world, [world.classes["OutputStream"]], this.sink)
        else:
            source = this.sources[name == "stderr"]
            made = InputStreamObject(world, [world.classes["InputStream"]], source)
        this.slots[slot] = made
    assert isinstance(made, Obj)
    return made
