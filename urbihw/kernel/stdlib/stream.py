"""InputStream and OutputStream: files and pipes, byte by byte.

Source: manual, specs/input-stream and specs/output-stream.  A stream stands on a ``Source`` or a ``Sink``: a file's is
here, that of whatever may let wait in ``pipe``.  A stream that is forgotten is closed.
"""

from __future__ import annotations

import io
import os
import stat
import weakref
from typing import Any, BinaryIO, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.file import FileObject
from urbihw.kernel.stdlib.path import failure, system
from urbihw.kernel.stdlib.pipe import LIMIT, PipeSink, PipeSource, in_background, pump_in
from urbihw.kernel.stdlib.support import in_thread

__breakable__ = True

INPUT = Table("InputStream")
OUTPUT = Table("OutputStream")
TABLES = [INPUT, OUTPUT]

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
        return self._file.readline(LIMIT)

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


def _open(world: World, file: FileObject, mode: str) -> Any:
    """Open a file; one whose other side may let wait (a FIFO, a terminal) is opened in a thread."""
    name = system(file.path)
    try:
        if stat.S_ISREG(os.stat(name).st_mode):
            return open(name, mode)
        return in_thread(world, lambda: open(name, mode.replace("a", "w"), buffering=0))
    except OSError as error:
        raise failure(error, file.path) from error


# ---------------------------------------------------------------- InputStream


@INPUT.primitive("init")
def init_input(world: World, this: InputStreamObject, file: FileObject) -> None:
    """Read a File from its beginning.  One that is no plain file (a FIFO, a device) is read as things come."""
    opened = _open(world, file, "rb")
    source: FileSource | PipeSource
    if isinstance(opened, io.BufferedReader):
        source = FileSource(opened)
    else:
        source = PipeSource(world.scheduler)
        in_background(pump_in, opened, source, world.scheduler)
    weakref.finalize(this, source.close)
    this.source = source


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


@OUTPUT.primitive("init")
def init_output(world: World, this: OutputStreamObject, file: FileObject) -> None:
    """Write to the end of a File.  To one that is no plain file (a FIFO, a device) is written in a thread."""
    opened = _open(world, file, "ab")
    sink: io.BufferedWriter | PipeSink
    if isinstance(opened, io.BufferedWriter):
        sink = opened
    else:
        sink = PipeSink()
        in_background(sink.pump, opened)
    weakref.finalize(this, sink.close)
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
