"""InputStream and OutputStream: files and pipes, byte by byte.

Source: manual, specs/input-stream and specs/output-stream.  A stream stands on a ``Source`` or a ``Sink``: a file's is
here, that of whatever may let wait in ``pipe``.  A stream that is forgotten is closed.
"""

from __future__ import annotations

import io
import os
import stat
import weakref
from collections.abc import Callable
from functools import partial
from typing import Any, BinaryIO, Final, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holding, holdings_of
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.stdlib.file import AIR, MOST_STREAMS, STREAMS, FileObject, lets_wait, open_to_write
from urbihw.kernel.stdlib.path import failure, system
from urbihw.kernel.stdlib.pipe import LONGEST_LINE, OPENED, PipeSink, PipeSource, pipes_of
from urbihw.kernel.stdlib.support import check_descriptors

__breakable__ = True

INPUT = Table("InputStream")
OUTPUT = Table("OutputStream")
TABLES = [INPUT, OUTPUT]

LAST_WORDS: Final = 10.0
"""Seconds for which what was written is still delivered when the connection has ended."""

NOTES = {
    "InputStream": "What is read byte by byte or line by line: a file, the output of a Process.",
    "OutputStream": "What is written to: a file, the input of a Process.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class Source(Protocol):
    """Where bytes come from; may park the running job until there are some."""

    def byte(self) -> bytes:
        """The next byte; empty at the end."""
        ...

    def line(self) -> bytes:
        """The rest of the line with its end; empty at the end."""
        ...

    def close(self) -> None:
        """No more is wanted."""
        ...


class Sink(Protocol):
    """Where bytes go to."""

    def write(self, data: bytes) -> object:
        """Take some bytes."""
        ...

    def flush(self) -> object:
        """Deliver what was taken."""
        ...

    def close(self) -> object:
        """Deliver it; no more will come."""
        ...


class FileSource:
    """The bytes of an open file."""

    __slots__ = ("_file",)

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def byte(self) -> bytes:
        """The next byte."""
        return self._file.read(1)

    def line(self) -> bytes:
        """The rest of the line.  One that is too long comes in pieces."""
        return self._file.readline(LONGEST_LINE)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class InputStreamObject(Obj):
    """An urbiscript InputStream; ``source`` None when closed."""

    __slots__ = ("source",)

    def __init__(self, world: World, protos: list[Obj], source: Source | None = None) -> None:
        super().__init__(world, protos)
        self.source = source

    def clone(self) -> InputStreamObject:
        """A closed stream."""
        return InputStreamObject(self.world, [self])

    def opened(self) -> Source:
        """The source; raises when it is closed."""
        if self.source is None:
            raise errors.primitive("stream is closed")
        return self.source


class OutputStreamObject(Obj):
    """An urbiscript OutputStream; ``sink`` None when closed."""

    __slots__ = ("sink",)

    def __init__(self, world: World, protos: list[Obj], sink: Sink | None = None) -> None:
        super().__init__(world, protos)
        self.sink = sink

    def clone(self) -> OutputStreamObject:
        """A closed stream."""
        return OutputStreamObject(self.world, [self])

    def opened(self) -> Sink:
        """The sink; raises when it is closed."""
        if self.sink is None:
            raise errors.primitive("stream is closed")
        return self.sink


CLASSES = {"InputStream": InputStreamObject, "OutputStream": OutputStreamObject}


def _forget(scheduler: Scheduler, close: Callable[[], object]) -> None:
    """A stream is forgotten, in whichever thread: close what it stands on."""
    scheduler.post(close)  # type: ignore[arg-type]


# ---------------------------------------------------------------- InputStream


@INPUT.primitive("init")
def init_input(world: World, this: InputStreamObject, file: FileObject) -> None:
    """Read a File from its beginning.  One that is no plain file (a FIFO, a device) is read as things come."""
    check_descriptors()
    try:
        descriptor = os.open(system(file.path), os.O_RDONLY | OPENED)
    except OSError as error:
        raise failure(error, file.path) from error
    mode = os.fstat(descriptor).st_mode
    source: FileSource | PipeSource
    if stat.S_ISREG(mode):
        source = FileSource(io.BufferedReader(io.FileIO(descriptor)))
    else:
        source = PipeSource(pipes_of(world))
        _hold(world, source, source, descriptor)
        source.start(descriptor, pipes_of(world).backlog(holdings_of(world)), stat.S_ISFIFO(mode))
    weakref.finalize(this, _forget, world.scheduler, source.close)
    this.source = source


def _hold(world: World, stream: PipeSource | PipeSink, holding: Holding, descriptor: int) -> None:
    """Let a stream belong to the running job's connection until it ends; otherwise close the file, and raise."""
    holdings = holdings_of(world)
    try:
        holdings.own(holding, STREAMS, MOST_STREAMS)
    except errors.Raised:
        os.close(descriptor)
        raise
    stream.on_end = partial(holdings.disown, holding)


@INPUT.primitive("get")
def get(world: World, this: InputStreamObject) -> Any:
    """The next byte as a number; void at the end."""
    found = this.opened().byte()
    return float(found[0]) if found else world.void


@INPUT.primitive("getChar")
def get_char(world: World, this: InputStreamObject) -> Any:
    """The next byte as a String; void at the end."""
    found = this.opened().byte()
    return world.from_python(found) if found else world.void


@INPUT.primitive("getLine")
def get_line(world: World, this: InputStreamObject) -> Any:
    """The next line as a String, without its end; void at the end."""
    found = this.opened().line()
    return world.from_python(_trimmed(found)) if found else world.void


@INPUT.primitive("asList")
def as_list(world: World, this: InputStreamObject) -> Any:
    """The list of all lines to come, without their ends."""
    source = this.opened()
    found = []
    line = source.line()
    while line:
        found.append(world.from_python(_trimmed(line)))
        world.scheduler.give_way(AIR)
        line = source.line()
    return world.new_list(found)


def _trimmed(line: bytes) -> bytes:
    return line.removesuffix(b"\n").removesuffix(b"\r")


@INPUT.primitive("close")
def close_input(world: World, this: InputStreamObject) -> None:
    """Close the stream; an error if it is closed already."""
    this.opened().close()
    this.source = None


# ---------------------------------------------------------------- OutputStream


class _Delivered:
    """A sink of a connection: when that ends, the other side may take what was said for a while."""

    def __init__(self, scheduler: Scheduler, sink: PipeSink) -> None:
        self._scheduler = scheduler
        self._sink = sink

    def close(self) -> None:
        """The connection has ended."""
        self._sink.close()
        self._scheduler.call_at(self._scheduler.clock.now() + LAST_WORDS, self._sink.drop)


@OUTPUT.primitive("init")
def init_output(world: World, this: OutputStreamObject, file: FileObject) -> None:
    """Write to the end of a File.  To one that is no plain file (a FIFO, a device) is written in a thread."""
    check_descriptors()
    sink: io.BufferedWriter | PipeSink
    try:
        if lets_wait(file.path):
            descriptor = open_to_write(world, file.path)
            sink = PipeSink(pipes_of(world))
            _hold(world, sink, _Delivered(world.scheduler, sink), descriptor)
            sink.start(descriptor)
        else:
            sink = io.BufferedWriter(io.FileIO(system(file.path), "a"))
    except OSError as error:
        raise failure(error, file.path) from error
    weakref.finalize(this, _forget, world.scheduler, sink.close)
    this.sink = sink


def _do(action: Any, *args: Any) -> None:
    try:
        action(*args)
    except OSError as error:
        raise errors.primitive(error.strerror or str(error)) from error


@OUTPUT.primitive("<<")
def put_text(world: World, this: OutputStreamObject, value: Any) -> Any:
    """Write the ``asString`` of a value; gives this stream."""
    _do(this.opened().write, world.text(value).encode("latin-1", "replace"))
    return this


@OUTPUT.primitive("put")
def put(world: World, this: OutputStreamObject, byte: float) -> Any:
    """Write one byte, 0 to 255; gives this stream."""
    sink = this.opened()
    wrong = (
        "overflow or non empty fractional part" if byte != byte or byte % 1
        else "negative overflow" if byte < 0
        else "positive overflow" if byte > 255
        else ""
    )
    if wrong:
        raise errors.primitive(f"bad numeric conversion: {wrong}: {world.text(byte)}")
    _do(sink.write, bytes([int(byte)]))
    _do(sink.flush)
    return this


@OUTPUT.primitive("flush")
def flush(world: World, this: OutputStreamObject) -> None:
    """Deliver what was written so far."""
    _do(this.opened().flush)


@OUTPUT.primitive("close")
def close_output(world: World, this: OutputStreamObject) -> None:
    """Deliver what was written and close the stream; an error if it is closed already."""
    _do(this.opened().close)
    this.sink = None
