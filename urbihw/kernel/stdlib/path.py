"""Path: the name of a file or a directory.

Source: manual, specs/path.
"""

from __future__ import annotations

import os
import posixpath

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Path")
PROTOS = {"Path": ("Comparable", "Orderable")}


class PathObject(Obj):
    """An urbiscript Path; ``path`` is simplified, with one character per byte."""

    __slots__ = ("path",)

    def __init__(self, world: World, protos: list[Obj], path: str = ".") -> None:
        super().__init__(world, protos)
        self.path = path

    def clone(self) -> PathObject:
        """A Path with the same name."""
        return PathObject(self.world, [self], self.path)


CLASSES = {"Path": PathObject}


def simplified(text: str) -> str:
    """A path without redundant ``./`` and ``/``."""
    parts = [part for part in text.split("/") if part not in ("", ".")]
    return ("/" if text.startswith("/") else "") + "/".join(parts) or "."


def path(world: World, text: str) -> PathObject:
    """Make a Path from a name."""
    return PathObject(world, [world.classes["Path"]], simplified(text))


def name_of(world: World, value: Value, index: int = 1) -> str:
    """The name of a file or a directory, from an argument that is a String or a Path."""
    if isinstance(value, PathObject):
        return value.path
    if not isinstance(value, String):
        raise world.type_error(index, value, "String")
    return simplified(value.s) if value.s else ""


def system(name: str) -> bytes:
    """A name as bytes for the operating system.  Raises an error for an invalid name."""
    if "\0" in name:
        raise errors.primitive("names cannot have a null character in them")
    return name.encode("latin-1", "replace")


def from_system(name: bytes) -> str:
    """A name that the operating system returned, as a string."""
    return name.decode("latin-1")


def failure(error: OSError, name: str) -> errors.Raised:
    """The error ``message: name`` for a failed call of the operating system."""
    return errors.primitive(f"{error.strerror or error}: {name}")


@TABLE.primitive("init")
def init(world: World, this: PathObject, text: Value) -> None:
    """Make a Path from a String or a Path."""
    name = name_of(world, text)
    if not name:
        raise errors.primitive("invalid path: ")
    this.path = name


@TABLE.primitive("asString")
def as_string(world: World, this: PathObject) -> str:
    """The path, as a String."""
    return this.path


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: PathObject) -> str:
    """``Path`` and the path, as a literal."""
    return f"Path({escaped(this.path)})"


@TABLE.primitive("asList")
def as_list(world: World, this: PathObject) -> Value:
    """The names of the directories from the root down, and of the file."""
    return world.new_list([world.string(part) for part in this.path.split("/") if part])


@TABLE.primitive("absolute")
def absolute(world: World, this: PathObject) -> bool:
    """Whether the path begins at the root."""
    return this.path.startswith("/")


@TABLE.primitive("basename")
def basename(world: World, this: PathObject) -> str:
    """The last name of the path; ``/`` for the root."""
    return posixpath.basename(this.path) or "/"


@TABLE.primitive("dirname")
def dirname(world: World, this: PathObject) -> Value:
    """The Path of the parent directory."""
    return path(world, posixpath.dirname(this.path) or ".")


@TABLE.primitive("cwd")
def cwd(world: World, this: PathObject) -> Value:
    """The Path of the current directory."""
    return path(world, from_system(os.getcwdb()))


@TABLE.primitive("cd")
def cd(world: World, this: PathObject) -> Value:
    """Change the current directory to this path; returns its Path."""
    try:
        os.chdir(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    return path(world, from_system(os.getcwdb()))


@TABLE.primitive("exists")
def exists(world: World, this: PathObject) -> bool:
    """Whether a file or a directory with this path exists."""
    return os.path.lexists(system(this.path))


@TABLE.primitive("isDir")
def is_dir(world: World, this: PathObject) -> bool:
    """Whether the path is a directory."""
    return os.path.isdir(system(this.path))


@TABLE.primitive("isReg")
def is_reg(world: World, this: PathObject) -> bool:
    """Whether the path is a regular file."""
    return os.path.isfile(system(this.path))


def _may(this: PathObject, mode: int) -> bool:
    try:
        os.stat(system(this.path))
    except OSError as error:
        raise failure(error, this.path) from error
    return os.access(system(this.path), mode)


@TABLE.primitive("readable")
def readable(world: World, this: PathObject) -> bool:
    """Whether the file may be read.  Raises an error if it does not exist."""
    return _may(this, os.R_OK)


@TABLE.primitive("writable")
def writable(world: World, this: PathObject) -> bool:
    """Whether the file may be written.  Raises an error if it does not exist."""
    return _may(this, os.W_OK)


@TABLE.primitive("open")
def open_(world: World, this: PathObject) -> Value:
    """The Directory or the File with this path."""
    kind = "Directory" if os.path.isdir(system(this.path)) else "File"
    return world.send(world.classes[kind], "new", this)


@TABLE.primitive("/")
def join(world: World, this: PathObject, other: Value) -> Value:
    """Join this path and a relative path (a String or a Path)."""
    name = name_of(world, other)
    if name.startswith("/"):
        raise errors.primitive(f"Rhs of concatenation is absolute: {name}")
    return path(world, f"{this.path}/{name}")


@TABLE.primitive("==")
def equals(world: World, this: PathObject, other: Value) -> bool:
    """Whether the other value is a Path with the same name."""
    return isinstance(other, PathObject) and this.path == other.path


@TABLE.primitive("<")
def before(world: World, this: PathObject, other: PathObject) -> bool:
    """Whether the name comes before the name of another Path, in alphabetical order."""
    return this.path < other.path
