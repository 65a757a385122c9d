"""File and Directory.

Source: manual, specs/file and specs/directory.  A directory with subscribed events is read ten times a second.
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
from collections.abc import Callable, Iterator
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.holdings import Holding, holdings_of
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import MAX_STRING_LENGTH
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.binary import binary
from urbihw.kernel.stdlib.path import failure, from_system, name_of, path, system
from urbihw.kernel.stdlib.pipe import OPEN_FLAGS, Backlog, Opening, PipeSink, PipeSource, pipes_of
from urbihw.kernel.stdlib.support import check_descriptors
from urbihw.kernel.value import Value

FILE = Table("File")
DIRECTORY = Table("Directory")
TABLES = [FILE, DIRECTORY]

WATCH_PERIOD_S = 0.1
"""Interval in seconds at which a watched directory is read.

Reading works in simulated time and on network file systems, where notifications of the operating system (inotify) do
not; it costs some microseconds, and only while there are subscribers.
"""

TIME_SLICE_S: Final = 0.002
"""Time slice in seconds after which other jobs get a turn."""
CHUNK_SIZE: Final = 256 * 1024
"""Number of bytes of a file that are read or written in one operation."""
MAX_SPECIAL_FILE_SIZE: Final = 16 * 1024 * 1024
"""Maximum number of bytes read from a device or a fifo."""
MAX_GATHERED_SIZE: Final = 4 * MAX_SPECIAL_FILE_SIZE
"""Maximum number of bytes that the unfinished reads of devices and fifos of one connection may hold."""
STREAMS: Final = "streams"
MAX_STREAMS: Final = 64
"""Maximum number of fifos, terminals and devices that a connection may read and write at the same time."""

NOTES = {
    "File": "A file of the operating system.",
    "Directory": "A directory of the operating system, with events for files that appear and disappear.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class NamedObject(Obj):
    """A File or a Directory; ``path`` has one character per byte."""

    __slots__ = ("path",)

    def __init__(self, world: World, protos: list[Obj], path: str = "") -> None:
        super().__init__(world, protos)
        self.path = path


class FileObject(NamedObject):
    """An urbiscript File, known by its path."""

    __slots__ = ()

    def clone(self) -> FileObject:
        """A File with the same path."""
        return FileObject(self.world, [self], self.path)


class DirectoryObject(NamedObject):
    """An urbiscript Directory, known by its path."""

    __slots__ = ("created", "deleted", "known", "watched")

    def __init__(self, world: World, protos: list[Obj], path: str = "") -> None:
        super().__init__(world, protos, path)
        self.created = Event(world, [world.event_proto])
        self.deleted = Event(world, [world.event_proto])
        self.known: set[str] = set()
        self.watched = False

    def clone(self) -> DirectoryObject:
        """A Directory with the same path."""
        return DirectoryObject(self.world, [self], self.path)

    def watch(self, context: Any) -> None:
        """Read the directory periodically while the events have subscribers."""
        if not self.watched:
            self.watched = True
            self.known = set(names(self.path))
            self._later(context)

    def _later(self, context: Any) -> None:
        scheduler = self.world.scheduler
        scheduler.call_at(scheduler.clock.now() + WATCH_PERIOD_S, lambda: self._poll_directory(context))

    def _poll_directory(self, context: Any) -> None:
        if not self.created.subscriptions and not self.deleted.subscriptions:
            self.watched = False
            return
        present = set(names(self.path))
        news = [(self.created, name) for name in sorted(present - self.known)]
        news += [(self.deleted, name) for name in sorted(self.known - present)]
        self.known = present
        if news:
            self.world.scheduler.spawn(lambda: self._emit_events(news), "directory", context=context)
        self._later(context)

    def _emit_events(self, news: list[tuple[Event, str]]) -> None:
        for event, name in news:
            event.emit([self.world.string(name)])


CLASSES = {"File": FileObject, "Directory": DirectoryObject}


def names(directory: str) -> list[str]:
    """The names in a directory, in order; empty if it cannot be read."""
    try:
        return sorted(from_system(name) for name in os.listdir(system(directory)))
    except OSError:
        return []


def read(world: World, name: str) -> str:
    """The bytes of a file, as characters (see ``read_bytes``)."""
    return read_bytes(world, name).decode("latin-1")


def read_bytes(world: World, name: str) -> bytes:
    """All bytes of a file.  The job waits for the data of a special file (device, fifo).  Other jobs get turns
    meanwhile.

    Raises an error if the file cannot be read or is larger than the maximum size of a String.  The limit is lower for a
    special file, whose size is unknown and may be infinite.
    """
    try:
        descriptor = os.open(system(name), os.O_RDONLY | OPEN_FLAGS)
    except OSError as error:
        raise failure(error, name) from error
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        with open(descriptor, "rb", buffering=0) as file:
            return _read_special_file(world, name, lambda: _piece(file, name), MAX_STRING_LENGTH)
    source = PipeSource(pipes_of(world))
    with registered_stream(world, source):
        source.start(descriptor, Backlog(pipes_of(world).poller, 0), stat.S_ISFIFO(mode))
        backlog = pipes_of(world).backlog(holdings_of(world))
        return _read_special_file(world, name, source.read_some, MAX_SPECIAL_FILE_SIZE, backlog)


def _piece(file: io.FileIO, name: str) -> bytes:
    try:
        return file.read(CHUNK_SIZE) or b""
    except OSError as error:
        raise failure(error, name) from error


def _read_special_file(
    world: World, name: str, read_some: Callable[[], bytes], most: int, backlog: Backlog | None = None
) -> bytes:
    """All bytes of a special file; they count in the connection's backlog while they are read."""
    found = bytearray()
    try:
        while piece := read_some():
            found += piece
            if backlog is not None:
                backlog.gathered += len(piece)
                if backlog.gathered > MAX_GATHERED_SIZE:
                    raise errors.primitive(f"too much is read at once (more than {MAX_GATHERED_SIZE} bytes): {name}")
            if len(found) > most:
                raise errors.primitive(f"file too large (more than {most} bytes): {name}")
            world.scheduler.give_way(TIME_SLICE_S)
        return bytes(found)
    finally:
        if backlog is not None:
            backlog.gathered -= len(found)


def write(world: World, name: str, content: str) -> None:
    """Make a file of these bytes; an existing special file (device, fifo) is written to."""
    data = content.encode("latin-1", "replace")
    try:
        if not is_special_file(name):
            with open(system(name), "wb", buffering=0) as file:
                for at in range(0, len(data), CHUNK_SIZE):
                    file.write(data[at : at + CHUNK_SIZE])
                    world.scheduler.give_way(TIME_SLICE_S)
            return
        sink = PipeSink(pipes_of(world))
        opened = open_for_writing(world, name)
        with registered_stream(world, sink):
            sink.start(opened)
            try:
                sink.write(data)
                sink.wait_until_written()
            finally:
                sink.drop()
    except OSError as error:
        raise failure(error, name) from error


def is_special_file(name: str) -> bool:
    """Whether the path is an existing special file (device, fifo), whose other side may be slow.  Raises OSError."""
    try:
        return not stat.S_ISREG(os.stat(system(name)).st_mode)
    except FileNotFoundError:
        return False


def open_for_writing(world: World, name: str) -> int:
    """Open a special file for writing in non-blocking mode; for a fifo, wait for a reader.  Raises OSError."""
    if not stat.S_ISFIFO(os.stat(system(name)).st_mode):
        return os.open(system(name), os.O_WRONLY | OPEN_FLAGS)
    opening = Opening(pipes_of(world), system(name))
    with registered_stream(world, opening):
        return opening.wait()


@contextlib.contextmanager
def registered_stream(world: World, one: Holding) -> Iterator[None]:
    """Register a stream with the running job's connection while the block runs; the stream is closed at its end."""
    holdings = holdings_of(world)
    holdings.register(one, STREAMS, MAX_STREAMS)
    try:
        check_descriptors()
        yield
    finally:
        holdings.unregister(one)
        one.close()


# ---------------------------------------------------------------- File


@FILE.primitive("init")
def init_file(world: World, this: FileObject, name: Value) -> None:
    """Make a File for an existing file; its name is a String or a Path."""
    this.path = name_of(world, name)
    try:
        os.stat(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    if os.path.isdir(system(this.path)):
        raise errors.primitive(f"Is a directory: {this.path}")


@FILE.primitive("create")
def create(world: World, this: Obj, name: Value) -> Value:
    """Make an empty file with this name (a String or a Path); an existing file is replaced."""
    write(world, name_of(world, name), "")
    return FileObject(world, [world.classes["File"]], name_of(world, name))


@FILE.primitive("save")
def save(world: World, this: Obj, name: Value, content: str) -> None:
    """Make a file with this name (a String or a Path) and content; an existing file is replaced."""
    write(world, name_of(world, name), content)


@FILE.primitive("content")
def content(world: World, this: FileObject) -> Value:
    """The content as a Binary without keywords."""
    return binary(world, "", read_bytes(world, this.path))


@FILE.primitive("asList")
def file_as_list(world: World, this: FileObject) -> Value:
    """The list of the lines, without their line ends."""
    return world.new_list([world.string(line) for line in lines(read(world, this.path))])


def lines(text: str) -> list[str]:
    """The lines of a text, without their line ends."""
    parts = text.split("\n")
    if parts[-1] == "":
        parts.pop()
    return [part.removesuffix("\r") for part in parts]


@FILE.primitive("remove")
def remove(world: World, this: FileObject) -> None:
    """Remove the file from the disk."""
    try:
        os.remove(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error


@FILE.primitive("rename")
def rename(world: World, this: FileObject, name: Value) -> None:
    """Rename the file to this name (a String or a Path); an existing file of that name is replaced."""
    target = name_of(world, name)
    try:
        os.replace(system(this.path), system(target))
    except OSError as error:
        raise failure(error, this.path) from error
    this.path = target


@FILE.primitive("asString")
@DIRECTORY.primitive("asString")
def as_string(world: World, this: NamedObject) -> str:
    """The name, as it was given."""
    return this.path


@FILE.primitive("asPrintable")
@DIRECTORY.primitive("asPrintable")
def as_printable(world: World, this: NamedObject) -> str:
    """The type and the name, as a literal."""
    return f"{world.type_name(this)}({escaped(this.path)})"


# ---------------------------------------------------------------- Directory


@DIRECTORY.primitive("init")
def init_directory(world: World, this: DirectoryObject, name: Value) -> None:
    """Make a Directory for an existing directory; its name is a String or a Path."""
    this.path = name_of(world, name)
    try:
        os.listdir(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error


@DIRECTORY.primitive("content")
def directory_content(world: World, this: DirectoryObject) -> Value:
    """The names of the files in the directory, in order."""
    return world.new_list([world.string(name) for name in names(this.path)])


@DIRECTORY.primitive("asList")
def directory_as_list(world: World, this: DirectoryObject) -> Value:
    """The Paths of the files in the directory, in order."""
    return world.new_list([path(world, f"{this.path}/{name}") for name in names(this.path)])


@DIRECTORY.primitive("fileCreated")
def file_created(world: World, this: DirectoryObject) -> Value:
    """The event that is emitted with the name of each file that appears in the directory."""
    this.watch(world.scheduler.running().context)
    return this.created


@DIRECTORY.primitive("fileDeleted")
def file_deleted(world: World, this: DirectoryObject) -> Value:
    """The event that is emitted with the name of each file that disappears from the directory."""
    this.watch(world.scheduler.running().context)
    return this.deleted
