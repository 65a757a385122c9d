"""InputStream and OutputStream: access to files and pipes, byte by byte.

Source: manual, specs/input-stream and specs/output-stream.  A stream uses a ``ByteSource`` or a ``Sink``: those of
regular files are here, those of files that may block in ``pipe``.  An unreferenced stream is closed.
"""

from __future__ import annotations

import io
import os
import stat
import weakref
from collections.abc import Callable
from functools import partial
from typing import BinaryIO, Final, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holding, holdings_of
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.stdlib.file import MAX_STREAMS, STREAMS, TIME_SLICE_S, FileObject, is_special_file, open_for_writing
from urbihw.kernel.stdlib.path import failure, system
from urbihw.kernel.stdlib.pipe import MAX_LINE_LENGTH, OPEN_FLAGS, PipeSink, PipeSource, pipes_of
from urbihw.kernel.stdlib.support import check_descriptors
from urbihw.kernel.value import Value

__breakable__ = True

INPUT = Table("InputStream")
OUTPUT = Table("OutputStream")
TABLES = [INPUT, OUTPUT]

DRAIN_TIMEOUT_S: Final = 10.0
"""Time in seconds for writing the remaining data after the end of the connection."""

NOTES = {
    "InputStream": "A stream that is read byte by byte or line by line: a file, the output of a Process.",
    "OutputStream": "A stream that is written to: a file, the input of a Process.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class ByteSource(Protocol):
    """A source of bytes; its methods may suspend the running job until there are some."""

    def read_byte(self) -> bytes:
        """The next byte; empty at the end."""
        ...

    def read_line(self) -> bytes:
        """The rest of the line with its line end; empty at the end."""
        ...

    def close(self) -> None:
        """Stop reading and release the file."""
        ...


class Sink(Protocol):
    """A destination of bytes."""

    def write(self, data: bytes) -> object:
        """Accept bytes for writing."""
        ...

    def flush(self) -> object:
        """Write the accepted bytes."""
        ...

    def close(self) -> object:
        """Write the accepted bytes, and close the file."""
        ...


class FileSource:
    """The bytes of an open regular file."""

    __slots__ = ("_file",)

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read_byte(self) -> bytes:
        """The next byte; empty at the end."""
        return self._file.read(1)

    def read_line(self) -> bytes:
        """The rest of the line; a line above the limit is returned in pieces."""
        return self._file.readline(MAX_LINE_LENGTH)

    def close(self) -> None:
        self._file.close()


class InputStreamObject(Obj):
    """An urbiscript InputStream; ``source`` is None when closed."""

    __slots__ = ("source",)

    def __init__(self, world: World, protos: list[Obj], source: ByteSource | None = None) -> None:
        super().__init__(world, protos)
        self.source = source

    def clone(self) -> InputStreamObject:
        return InputStreamObject(self.world, [self])

    def opened(self) -> ByteSource:
        """The source.  Raises an error if the stream is closed."""
        if self.source is None:
            raise errors.primitive("stream is closed")
        return self.source


class OutputStreamObject(Obj):
    """An urbiscript OutputStream; ``sink`` is None when closed."""

    __slots__ = ("sink",)

    def __init__(self, world: World, protos: list[Obj], sink: Sink | None = None) -> None:
        super().__init__(world, protos)
        self.sink = sink

    def clone(self) -> OutputStreamObject:
        return OutputStreamObject(self.world, [self])

    def opened(self) -> Sink:
        """The sink.  Raises an error if the stream is closed."""
        if self.sink is None:
            raise errors.primitive("stream is closed")
        return self.sink


CLASSES = {"InputStream": InputStreamObject, "OutputStream": OutputStreamObject}


def _close_unreferenced(scheduler: Scheduler, close: Callable[[], object]) -> None:
    """Close the source or the sink of an unreferenced stream, from any thread."""
    scheduler.post(close)  # type: ignore[arg-type]


# ---------------------------------------------------------------- InputStream


@INPUT.primitive("init")
def init_input(world: World, this: InputStreamObject, file: FileObject) -> None:
    """Read a File from its beginning.  A special file (a FIFO, a device) is read as its data arrives."""
    check_descriptors()
    try:
        descriptor = os.open(system(file.path), os.O_RDONLY | OPEN_FLAGS)
    except OSError as error:
        raise failure(error, file.path) from error
    mode = os.fstat(descriptor).st_mode
    source: FileSource | PipeSource
    if stat.S_ISREG(mode):
        source = FileSource(io.BufferedReader(io.FileIO(descriptor)))
    else:
        source = PipeSource(pipes_of(world))
        _register_stream(world, source, source, descriptor)
        source.start(descriptor, pipes_of(world).backlog(holdings_of(world)), stat.S_ISFIFO(mode))
    weakref.finalize(this, _close_unreferenced, world.scheduler, source.close)
    this.source = source


def _register_stream(world: World, stream: PipeSource | PipeSink, holding: Holding, descriptor: int) -> None:
    """Register a stream with the running job's connection until the stream ends; if that fails, close the file and
    raise the error.
    """
    holdings = holdings_of(world)
    try:
        holdings.register(holding, STREAMS, MAX_STREAMS)
    except errors.Raised:
        os.close(descriptor)
        raise
    stream.on_end = partial(holdings.unregister, holding)


@INPUT.primitive("get")
def get(world: World, this: InputStreamObject) -> Value:
    """The next byte as a number; void at the end."""
    found = this.opened().read_byte()
    return float(found[0]) if found else world.void


@INPUT.primitive("getChar")
def get_char(world: World, this: InputStreamObject) -> Value:
    """The next byte as a String; void at the end."""
    found = this.opened().read_byte()
    return world.from_python(found) if found else world.void


@INPUT.primitive("getLine")
def get_line(world: World, this: InputStreamObject) -> Value:
    """The next line as a String, without its line end; void at the end."""
    found = this.opened().read_line()
    return world.from_python(_trimmed(found)) if found else world.void


@INPUT.primitive("asList")
def as_list(world: World, this: InputStreamObject) -> Value:
    """The list of all remaining lines, without their line ends."""
    source = this.opened()
    found = []
    line = source.read_line()
    while line:
        found.append(world.from_python(_trimmed(line)))
        world.scheduler.give_way(TIME_SLICE_S)
        line = source.read_line()
    return world.new_list(found)


def _trimmed(line: bytes) -> bytes:
    return line.removesuffix(b"\n").removesuffix(b"\r")


@INPUT.primitive("close")
def close_input(world: World, this: InputStreamObject) -> None:
    """Close the stream.  Raises an error if it is already closed."""
    this.opened().close()
    this.source = None


# ---------------------------------------------------------------- OutputStream


class _Delivered:
    """A sink held by a connection: after the end of the connection, queued bytes are still written for some seconds."""

    def __init__(self, scheduler: Scheduler, sink: PipeSink) -> None:
        self._scheduler = scheduler
        self._sink = sink

    def close(self) -> None:
        """Called when the connection has ended."""
        self._sink.close()
        self._scheduler.call_at(self._scheduler.clock.now() + DRAIN_TIMEOUT_S, self._sink.drop)


@OUTPUT.primitive("init")
def init_output(world: World, this: OutputStreamObject, file: FileObject) -> None:
    """Append to a File.  Data for a special file (a FIFO, a device) is written in a thread."""
    check_descriptors()
    sink: io.BufferedWriter | PipeSink
    try:
        if is_special_file(file.path):
            descriptor = open_for_writing(world, file.path)
            sink = PipeSink(pipes_of(world))
            _register_stream(world, sink, _Delivered(world.scheduler, sink), descriptor)
            sink.start(descriptor)
        else:
            sink = io.BufferedWriter(io.FileIO(system(file.path), "a"))
    except OSError as error:
        raise failure(error, file.path) from error
    weakref.finalize(this, _close_unreferenced, world.scheduler, sink.close)
    this.sink = sink


def _raise_os_errors(action: Value, *args: Value) -> None:
    try:
        action(*args)
    except OSError as error:
        raise errors.primitive(error.strerror or str(error)) from error


@OUTPUT.primitive("<<")
def put_text(world: World, this: OutputStreamObject, value: Value) -> Value:
    """Write the ``asString`` of a value; returns this stream."""
    _raise_os_errors(this.opened().write, world.text(value).encode("latin-1", "replace"))
    return this


@OUTPUT.primitive("put")
def put(world: World, this: OutputStreamObject, byte: float) -> Value:
    """Write one byte, 0 to 255; returns this stream."""
    sink = this.opened()
    wrong = (
        "overflow or non empty fractional part" if byte != byte or byte % 1
        else "negative overflow" if byte < 0
        else "positive overflow" if byte > 255
        else ""
    )
    if wrong:
        raise errors.primitive(f"bad numeric conversion: {wrong}: {world.text(byte)}")
    _raise_os_errors(sink.write, bytes([int(byte)]))
    _raise_os_errors(sink.flush)
    return this


@OUTPUT.primitive("flush")
def flush(world: World, this: OutputStreamObject) -> None:
    """Write all queued bytes."""
    _raise_os_errors(this.opened().flush)


@OUTPUT.primitive("close")
def close_output(world: World, this: OutputStreamObject) -> None:
    """Write all queued bytes and close the stream.  Raises an error if it is already closed."""
    _raise_os_errors(this.opened().close)
    this.sink = None
