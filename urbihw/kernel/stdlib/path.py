"""Path: the name of something in the file system.

Source: manual, specs/path.
"""

from __future__ import annotations

import os
import posixpath
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World

TABLE = Table("Path")
PROTOS = {"Path": ("Comparable", "Orderable")}


class PathObject(Obj):
    """An urbiscript Path; ``path`` is simplified, with one character per byte."""

    __slots__ = ("path",)

    def __init__(self, world: World, protos: list[Obj], path: str = ".") -> None:
        super().__init__(world, protos)
        self.path = path

    def clone(self) -> PathObject:
        """The same path."""
        return PathObject(self.world, [self], self.path)


CLASSES = {"Path": PathObject}


def simplified(text: str) -> str:
    """A path without superfluous ``./`` and ``/``."""
    parts = [part for part in text.split("/") if part not in ("", ".")]
    return ("/" if text.startswith("/") else "") + "/".join(parts) or "."


def path(world: World, text: str) -> PathObject:
    """A Path."""
    return PathObject(world, [world.classes["Path"]], simplified(text))


def name_of(world: World, value: Any, index: int = 1) -> str:
    """An argument that names something in the file system: a String or a Path."""
    if isinstance(value, PathObject):
        return value.path
    if not isinstance(value, String):
        raise world.type_error(index, value, "String")
    return simplified(value.s) if value.s else ""


def system(name: str) -> bytes:
    """A name for the operating system: urbiscript strings are bytes.  An error for a name that none can have."""
    if "\0" in name:
        raise errors.primitive("names cannot have a null character in them")
    return name.encode("latin-1", "replace")


def from_system(name: bytes) -> str:
    """A name that comes from the operating system."""
    return name.decode("latin-1")


def failure(error: OSError, name: str) -> errors.Raised:
    """``message: name`` of a call of the operating system that failed."""
    return errors.primitive(f"{error.strerror or error}: {name}")


@TABLE.primitive("init")
def init(world: World, this: PathObject, text: Any) -> None:
    """The path that a string (or a Path) names."""
    name = name_of(world, text)
    if not name:
        raise errors.primitive("invalid path: ")
    this.path = name


@TABLE.primitive("asString")
def as_string(world: World, this: PathObject) -> str:
    """The path."""
    return this.path


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: PathObject) -> str:
    """``Path`` and the path as a literal."""
    return f"Path({escaped(this.path)})"


@TABLE.primitive("asList")
def as_list(world: World, this: PathObject) -> Any:
    """The names of the directories, and of the file, from the root down."""
    return world.new_list([world.string(part) for part in this.path.split("/") if part])


@TABLE.primitive("absolute")
def absolute(world: World, this: PathObject) -> bool:
    """Whether the path begins at the root."""
    return this.path.startswith("/")


@TABLE.primitive("basename")
def basename(world: World, this: PathObject) -> str:
    """The last name in the path; the root's is ``/``."""
    return posixpath.basename(this.path) or "/"


@TABLE.primitive("dirname")
def dirname(world: World, this: PathObject) -> Any:
    """The Path of the directory this one is in."""
    return path(world, posixpath.dirname(this.path) or ".")


@TABLE.primitive("cwd")
def cwd(world: World, this: PathObject) -> Any:
    """The Path of the current directory."""
    return path(world, from_system(os.getcwdb()))


@TABLE.primitive("cd")
def cd(world: World, this: PathObject) -> Any:
    """Make this the current directory; gives its Path."""
    try:
        os.chdir(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    return path(world, from_system(os.getcwdb()))


@TABLE.primitive("exists")
def exists(world: World, this: PathObject) -> bool:
    """Whether something is there."""
    return os.path.lexists(system(this.path))


@TABLE.primitive("isDir")
def is_dir(world: World, this: PathObject) -> bool:
    """Whether it is a directory."""
    return os.path.isdir(system(this.path))


@TABLE.primitive("isReg")
def is_reg(world: World, this: PathObject) -> bool:
    """Whether it is a regular file."""
    return os.path.isfile(system(this.path))


def _may(this: PathObject, mode: int) -> bool:
    try:
        os.stat(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    return os.access(system(this.path), mode)


@TABLE.primitive("readable")
def readable(world: World, this: PathObject) -> bool:
    """Whether it may be read; an error if nothing is there."""
    return _may(this, os.R_OK)


@TABLE.primitive("writable")
def writable(world: World, this: PathObject) -> bool:
    """Whether it may be written; an error if nothing is there."""
    return _may(this, os.W_OK)


@TABLE.primitive("open")
def open_(world: World, this: PathObject) -> Any:
    """The Directory or the File that is there."""
    kind = "Directory" if os.path.isdir(system(this.path)) else "File"
    return world.send(world.classes[kind], "new", this)


@TABLE.primitive("/")
def join(world: World, this: PathObject, other: Any) -> Any:
    """The path of something under this one, named by a relative String or Path."""
    name = name_of(world, other)
    if name.startswith("/"):
        raise errors.primitive(f"Rhs of concatenation is absolute: {name}")
    return path(world, f"{this.path}/{name}")


@TABLE.primitive("==")
def equals(world: World, this: PathObject, other: Any) -> bool:
    """Whether the other is a Path of the same name."""
    return isinstance(other, PathObject) and this.path == other.path


@TABLE.primitive("<")
def before(world: World, this: PathObject, other: PathObject) -> bool:
    """Whether the name comes before that of another Path."""
    return this.path < other.path
