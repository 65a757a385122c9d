"""Process: programs of the operating system, with their standard streams.

Source: manual, specs/process.  Threads read, write and wait (``pipe``); the kernel never does.
"""

from __future__ import annotations

import os
import subprocess
import threading
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.stdlib.path import failure, name_of, system
from urbihw.kernel.stdlib.pipe import PipeSink, PipeSource, in_background, pump_in
from urbihw.kernel.stdlib.stream import InputStreamObject, OutputStreamObject

PROCESS = Table("Process")
STATUS = Table("Process.Status")
TABLES = [PROCESS, STATUS]

NOTES = {
    "Process.Status": "What has become of a program: exitStatus or signal once it is over.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class ProcessObject(Obj):
    """An urbiscript Process."""

    __slots__ = ("args", "code", "ended", "inner", "name", "sink", "sources", "waiting")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.name = ""
        self.args: list[str] = []
        self.inner: subprocess.Popen[bytes] | None = None
        self.code: int | None = None
        self.ended = False
        self.sink = PipeSink()
        self.sources = (PipeSource(world.scheduler), PipeSource(world.scheduler))
        self.waiting = WaitQueue(world.scheduler)

    def clone(self) -> ProcessObject:
        """A process that does not run, of the same program."""
        made = ProcessObject(self.world, [self])
        made.name, made.args = self.name, list(self.args)
        return made

    def start(self, target: str | None = None) -> None:
        """Run the program, and let what it writes go to a file of this name; its threads end with it."""
        if self.inner is not None:
            raise errors.primitive("Process was already run")
        command = [system(part) for part in (self.name, *self.args)]
        pipe = subprocess.PIPE
        output = pipe if target is None else _made(target)
        try:
            inner = self.inner = subprocess.Popen(command, stdin=pipe, stdout=output, stderr=pipe)
        except OSError as error:
            raise failure(error, self.name) from error
        finally:
            if output != pipe:
                os.close(output)
        assert inner.stdin is not None
        readers = []
        for out, source in zip((inner.stdout, inner.stderr), self.sources, strict=True):
            if out is None:
                source.feed(b"")
            else:
                readers.append(in_background(pump_in, out, source, self.world.scheduler))
        in_background(self.sink.pump, inner.stdin)
        in_background(self._wait, inner, readers)
        self.world.scheduler.give_way(AIR)

    def _wait(self, inner: subprocess.Popen[bytes], readers: list[threading.Thread]) -> None:
        code = inner.wait()
        for reader in readers:
            reader.join(1.0)  # a child of the program may keep its streams open for ever
        self.world.scheduler.post(lambda: self._over(code))

    def _over(self, code: int) -> None:
        self.code = code
        self.ended = True
        self.sink.close()
        self.waiting.wake_all()


def _made(name: str) -> int:
    """A file to write to, empty whatever was there before."""
    try:
        return os.open(system(name), os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise failure(error, name) from error


CLASSES = {"Process": ProcessObject}

AIR = 0.002
"""Seconds after which others have a turn: starting a program takes some milliseconds."""


@PROCESS.primitive("init")
def init(world: World, this: ProcessObject, name: str, args: list[Any]) -> None:
    """A program, found along the PATH, and the List of its arguments; ``run`` starts it."""
    for member in args:
        if not isinstance(member, String):
            raise world.type_error(2, member, "String")
    this.name = name
    this.args = [member.s for member in args]


@PROCESS.primitive("asProcess")
def as_process(world: World, this: ProcessObject) -> Any:
    """This process itself."""
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
    """Start the program; once only."""
    this.start()


@PROCESS.primitive("runTo")
def run_to(world: World, this: ProcessObject, file: Any) -> None:
    """Start the program; what it writes to its standard output goes to a file (a String or a Path), which is made anew,
    and ``stdout`` is empty.  The manual names this function and says nothing of it."""
    this.start(name_of(world, file))


@PROCESS.primitive("join")
def join(world: World, this: ProcessObject) -> None:
    """Wait until the program is over; an error if it was not started."""
    if this.inner is None:
        raise errors.primitive("Process was not run")
    while not this.ended:
        this.waiting.wait()


@PROCESS.primitive("kill")
def kill(world: World, this: ProcessObject) -> None:
    """End the program by force, unless it is over; ``join`` waits for it."""
    if this.inner is not None and not this.ended:
        this.inner.kill()


@PROCESS.primitive("done")
def done(world: World, this: ProcessObject) -> bool:
    """Whether the program has run and is over."""
    return this.ended


@PROCESS.primitive("status")
def status(world: World, this: ProcessObject) -> Any:
    """An object that tells what became of the program: ``exitStatus`` or ``signal`` once it is over."""
    made = Plain(world, [world.classes["Process.Status"]])
    text = "not started" if this.inner is None else "running"
    if this.code is not None and this.code >= 0:
        text = f"exited with status {this.code}"
        made.slots["exitStatus"] = float(this.code)
    elif this.code is not None:
        text = f"killed by signal {-this.code}"
        made.slots["signal"] = float(-this.code)
    made.slots["text"] = world.string(text)
    return made


@STATUS.primitive("asString", "asPrintable")
def status_as_string(world: World, this: Obj) -> str:
    """``not started``, ``running``, ``exited with status N``, ``killed by signal N``."""
    return world.text(this.slots["text"]) if "text" in this.slots else "Status"


@PROCESS.primitive("stdin")
def stdin(world: World, this: ProcessObject) -> Any:
    """The OutputStream that the program reads."""
    return _stream(world, this, "stdin")


@PROCESS.primitive("stdout")
def stdout(world: World, this: ProcessObject) -> Any:
    """The InputStream of what the program writes."""
    return _stream(world, this, "stdout")


@PROCESS.primitive("stderr")
def stderr(world: World, this: ProcessObject) -> Any:
    """The InputStream of what the program writes to its standard error."""
    return _stream(world, this, "stderr")


def _stream(world: World, this: ProcessObject, name: str) -> Obj:
    """A stream of a process: made once, so that closing it closes it for all."""
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
