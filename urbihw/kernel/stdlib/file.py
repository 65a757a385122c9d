"""File and Directory.

Source: manual, specs/file and specs/directory.  A directory is looked at ten times a second while somebody watches
its events.
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
from urbihw.kernel.runtime.values import MOST_CHARACTERS
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.binary import binary
from urbihw.kernel.stdlib.path import failure, from_system, name_of, path, system
from urbihw.kernel.stdlib.pipe import OPENED, Backlog, Opening, PipeSink, PipeSource, pipes_of
from urbihw.kernel.stdlib.support import check_descriptors

FILE = Table("File")
DIRECTORY = Table("Directory")
TABLES = [FILE, DIRECTORY]

PERIOD = 0.1
"""Seconds between two looks at a watched directory.

Looking works in simulated time and on file systems of other machines, where the notices of the operating system
(inotify) do not; it costs some microseconds, and only while somebody watches.
"""

AIR: Final = 0.002
"""Seconds after which others have a turn."""
PIECE: Final = 256 * 1024
"""How many bytes of a file are read or written at once."""
MOST_WITHOUT_SIZE: Final = 16 * 1024 * 1024
"""How many bytes of a device or a fifo are read as a whole."""
MOST_TOGETHER: Final = 4 * MOST_WITHOUT_SIZE
"""How many bytes of them the jobs of a connection may have read that are not at the end yet."""
STREAMS: Final = "streams"
MOST_STREAMS: Final = 64
"""How many fifos, terminals and devices a connection may read and write at once."""

NOTES = {
    "File": "A file of the operating system.",
    "Directory": "A directory of the operating system, and events of what appears in it and what is gone.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class NamedObject(Obj):
    """A File or a Directory; ``path`` has one character per byte."""

    __slots__ = ("path",)

    def __init__(self, world: World, protos: list[Obj], path: str = "") -> None:
        super().__init__(world, protos)
        self.path = path


class FileObject(NamedObject):
    """An urbiscript File."""

    __slots__ = ()

    def clone(self) -> FileObject:
        """The same file."""
        return FileObject(self.world, [self], self.path)


class DirectoryObject(NamedObject):
    """An urbiscript Directory."""

    __slots__ = ("created", "deleted", "known", "watched")

    def __init__(self, world: World, protos: list[Obj], path: str = "") -> None:
        super().__init__(world, protos, path)
        self.created = Event(world, [world.event_proto])
        self.deleted = Event(world, [world.event_proto])
        self.known: set[str] = set()
        self.watched = False

    def clone(self) -> DirectoryObject:
        """The same directory."""
        return DirectoryObject(self.world, [self], self.path)

    def watch(self, context: Any) -> None:
        """Begin to look, as long as somebody waits for the events."""
        if not self.watched:
            self.watched = True
            self.known = set(names(self.path))
            self._later(context)

    def _later(self, context: Any) -> None:
        scheduler = self.world.scheduler
        scheduler.call_at(scheduler.clock.now() + PERIOD, lambda: self._look(context))

    def _look(self, context: Any) -> None:
        if not self.created.subscriptions and not self.deleted.subscriptions:
            self.watched = False
            return
        present = set(names(self.path))
        news = [(self.created, name) for name in sorted(present - self.known)]
        news += [(self.deleted, name) for name in sorted(self.known - present)]
        self.known = present
        if news:
            self.world.scheduler.spawn(lambda: self._tell(news), "directory", context=context)
        self._later(context)

    def _tell(self, news: list[tuple[Event, str]]) -> None:
        for event, name in news:
            event.emit([self.world.string(name)])


CLASSES = {"File": FileObject, "Directory": DirectoryObject}


def names(directory: str) -> list[str]:
    """What is in a directory, in order; nothing if it cannot be read (any more)."""
    try:
        return sorted(from_system(name) for name in os.listdir(system(directory)))
    except OSError:
        return []


def read(world: World, name: str) -> str:
    """The bytes of a file, as characters; see ``read_bytes``."""
    return read_bytes(world, name).decode("latin-1")


def read_bytes(world: World, name: str) -> bytes:
    """All of a file; what is no plain file (a device, a fifo) is waited for.  Others have their turn meanwhile.

    Raises an error if it cannot be read, or if there is more than a String may hold; of what has no size beforehand
    and may have no end, much less is taken.
    """
    try:
        descriptor = os.open(system(name), os.O_RDONLY | OPENED)
    except OSError as error:
        raise failure(error, name) from error
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        with open(descriptor, "rb", buffering=0) as file:
            return _gathered(world, name, lambda: _piece(file, name), MOST_CHARACTERS)
    source = PipeSource(pipes_of(world))
    with held(world, source):
        source.start(descriptor, Backlog(pipes_of(world).poller, 0), stat.S_ISFIFO(mode))
        return _gathered(world, name, source.some, MOST_WITHOUT_SIZE, pipes_of(world).backlog(holdings_of(world)))


def _piece(file: io.FileIO, name: str) -> bytes:
    try:
        return file.read(PIECE) or b""
    except OSError as error:
        raise failure(error, name) from error


def _gathered(world: World, name: str, some: Callable[[], bytes], most: int, backlog: Backlog | None = None) -> bytes:
    """All of a file; what is gathered counts in the backlog meanwhile."""
    found = bytearray()
    try:
        while piece := some():
            found += piece
            if backlog is not None:
                backlog.gathered += len(piece)
                if backlog.gathered > MOST_TOGETHER:
                    raise errors.primitive(f"too much is read at once (more than {MOST_TOGETHER} bytes): {name}")
            if len(found) > most:
                raise errors.primitive(f"file too large (more than {most} bytes): {name}")
            world.scheduler.give_way(AIR)
        return bytes(found)
    finally:
        if backlog is not None:
            backlog.gathered -= len(found)


def write(world: World, name: str, content: str) -> None:
    """Make a file of these bytes; what is there and no plain file (a device, a fifo) is written to."""
    data = content.encode("latin-1", "replace")
    try:
        if not lets_wait(name):
            with open(system(name), "wb", buffering=0) as file:
                for at in range(0, len(data), PIECE):
                    file.write(data[at : at + PIECE])
                    world.scheduler.give_way(AIR)
            return
        sink = PipeSink(pipes_of(world))
        opened = open_to_write(world, name)
        with held(world, sink):
            sink.start(opened)
            try:
                sink.write(data)
                sink.wait_until_written()
            finally:
                sink.drop()
    except OSError as error:
        raise failure(error, name) from error


def lets_wait(name: str) -> bool:
    """Whether something of a name is there and no plain file: its other side may let wait.  Raises OSError."""
    try:
        return not stat.S_ISREG(os.stat(system(name)).st_mode)
    except FileNotFoundError:
        return False


def open_to_write(world: World, name: str) -> int:
    """Open what is no plain file so that it does not block; a fifo once somebody reads it.  Raises OSError."""
    if not stat.S_ISFIFO(os.stat(system(name)).st_mode):
        return os.open(system(name), os.O_WRONLY | OPENED)
    opening = Opening(pipes_of(world), system(name))
    with held(world, opening):
        return opening.wait()


@contextlib.contextmanager
def held(world: World, one: Holding) -> Iterator[None]:
    """Hold a stream for the running job's connection as long as the job needs it; it is closed then."""
    holdings = holdings_of(world)
    holdings.own(one, STREAMS, MOST_STREAMS)
    try:
        check_descriptors()
        yield
    finally:
        holdings.disown(one)
        one.close()


# ---------------------------------------------------------------- File


@FILE.primitive("init")
def init_file(world: World, this: FileObject, name: Any) -> None:
    """The file of a name (a String or a Path), which must exist."""
    this.path = name_of(world, name)
    try:
        os.stat(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    if os.path.isdir(system(this.path)):
        raise errors.primitive(f"Is a directory: {this.path}")


@FILE.primitive("create")
def create(world: World, this: Obj, name: Any) -> Any:
    """A file of this name (a String or a Path), empty, whatever was there before."""
    write(world, name_of(world, name), "")
    return FileObject(world, [world.classes["File"]], name_of(world, name))


@FILE.primitive("save")
def save(world: World, this: Obj, name: Any, content: str) -> None:
    """Make a file of this name (a String or a Path) and this content, whatever was there before."""
    write(world, name_of(world, name), content)


@FILE.primitive("content")
def content(world: World, this: FileObject) -> Any:
    """The content as a Binary without keywords."""
    return binary(world, "", read_bytes(world, this.path))


@FILE.primitive("asList")
def file_as_list(world: World, this: FileObject) -> Any:
    """The lines, without their ends."""
    return world.new_list([world.string(line) for line in lines(read(world, this.path))])


def lines(text: str) -> list[str]:
    """The lines of a text, without their ends."""
    parts = text.split("\n")
    if parts[-1] == "":
        parts.pop()
    return [part.removesuffix("\r") for part in parts]


@FILE.primitive("remove")
def remove(world: World, this: FileObject) -> None:
    """Remove the file."""
    try:
        os.remove(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error


@FILE.primitive("rename")
def rename(world: World, this: FileObject, name: Any) -> None:
    """Give the file another name (a String or a Path); what was there before is gone."""
    target = name_of(world, name)
    try:
        os.replace(system(this.path), system(target))
    except OSError as error:
        raise failure(error, this.path) from error
    this.path = target


@FILE.primitive("asString")
@DIRECTORY.primitive("asString")
def as_string(world: World, this: NamedObject) -> str:
    """The name."""
    return this.path


@FILE.primitive("asPrintable")
@DIRECTORY.primitive("asPrintable")
def as_printable(world: World, this: NamedObject) -> str:
    """The type, and the name as a literal."""
    return f"{world.type_name(this)}({escaped(this.path)})"


# ---------------------------------------------------------------- Directory


@DIRECTORY.primitive("init")
def init_directory(world: World, this: DirectoryObject, name: Any) -> None:
    """The directory of a name (a String or a Path), which must exist."""
    this.path = name_of(world, name)
    try:
        os.listdir(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error


@DIRECTORY.primitive("content")
def directory_content(world: World, this: DirectoryObject) -> Any:
    """The names of what is in the directory, in order."""
    return world.new_list([world.string(name) for name in names(this.path)])


@DIRECTORY.primitive("asList")
def directory_as_list(world: World, this: DirectoryObject) -> Any:
    """The Paths of what is in the directory, in order."""
    return world.new_list([path(world, f"{this.path}/{name}") for name in names(this.path)])


@DIRECTORY.primitive("fileCreated")
def file_created(world: World, this: DirectoryObject) -> Any:
    """The event emitted with a name when something of this name appears in the directory."""
    this.watch(world.scheduler.running().context)
    return this.created


@DIRECTORY.primitive("fileDeleted")
def file_deleted(world: World, this: DirectoryObject) -> Any:
    """The event emitted with a name when something of this name is gone from the directory."""
    this.watch(world.scheduler.running().context)
    return this.deleted
