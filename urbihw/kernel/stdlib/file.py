"""File and Directory.

Source: manual, specs/file and specs/directory.  A directory is looked at ten times a second while somebody watches
its events.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import MOST_CHARACTERS
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.binary import binary
from urbihw.kernel.stdlib.path import failure, from_system, name_of, path, system
from urbihw.kernel.stdlib.support import in_thread

FILE = Table("File")
DIRECTORY = Table("Directory")
TABLES = [FILE, DIRECTORY]

PERIOD = 0.1
"""Seconds between two looks at a watched directory.

Looking works in simulated time and on file systems of other machines, where the notices of the operating system
(inotify) do not; it costs some microseconds, and only while somebody watches.
"""

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
    """The bytes of a file, as characters.  Some devices have no end: an error if there is more than a String may hold.
    """
    def whole() -> bytes:
        with open(system(name), "rb") as file:
            return file.read(MOST_CHARACTERS + 1)

    try:
        data: bytes = _patiently(world, name, whole)
    except OSError as error:
        raise failure(error, name) from error
    if len(data) > MOST_CHARACTERS:
        raise errors.primitive(f"file too large (more than {MOST_CHARACTERS} bytes): {name}")
    return data.decode("latin-1")


def write(world: World, name: str, content: str) -> None:
    """Make a file of these bytes."""
    def whole() -> None:
        with open(system(name), "wb") as file:
            file.write(content.encode("latin-1", "replace"))

    try:
        _patiently(world, name, whole)
    except OSError as error:
        raise failure(error, name) from error


def _patiently(world: World, name: str, work: Callable[[], Any]) -> Any:
    """Do something with a file; in a thread if it is there and no plain file, since its other side may let wait."""
    try:
        plain = stat.S_ISREG(os.stat(system(name)).st_mode)
    except FileNotFoundError:
        plain = True
    return work() if plain else in_thread(world, work)


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
    return binary(world, "", read(world, this.path).encode("latin-1"))


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
