"""Binary: bytes with a header that describes their format.

Source: manual, specs/binary; server protocol, section 4.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.binary import BinaryObject, Buffer
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import MAX_STRING_LENGTH, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

TABLE = Table("Binary")


CLASSES = {"Binary": BinaryObject}

NOTES = {
    "Binary.data": "The bytes, as a String.",
    "Binary.keywords": "The header, as a String.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def binary(world: World, keywords: str, content: Buffer) -> BinaryObject:
    """Make a Binary with keywords and content."""
    return BinaryObject(world, [world.classes["Binary"]], keywords, content)


@TABLE.primitive("init")
def init(world: World, this: BinaryObject, keywords: str, data: str) -> None:
    """Make a Binary from keywords and data."""
    this.keywords, this.content = keywords, data.encode("latin-1")


@TABLE.primitive("empty")
def empty(world: World, this: BinaryObject) -> bool:
    """Whether there are no bytes."""
    return not len(this.content)


@TABLE.primitive("copy")
def copy(world: World, this: BinaryObject) -> Value:
    """A new Binary with the same content."""
    return binary(world, this.keywords, this.content)


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: BinaryObject) -> str:
    """``BIN`` size keywords, a line feed, the bytes."""
    head = f" {this.keywords}" if this.keywords else ""
    return f"BIN {len(this.content)}{head}\n{this.data}"


@TABLE.primitive("==")
def equals(world: World, this: BinaryObject, other: Value) -> bool:
    """Whether the other Binary has the same keywords and bytes."""
    return isinstance(other, BinaryObject) and (this.keywords, this.content) == (other.keywords, other.content)


@TABLE.primitive("!=")
def differs(world: World, this: BinaryObject, other: Value) -> bool:
    """``!(this == other)``."""
    return not (isinstance(other, BinaryObject) and (this.keywords, this.content) == (other.keywords, other.content))


@TABLE.primitive("+")
def plus(world: World, this: BinaryObject, other: BinaryObject) -> Value:
    """The bytes of both, with the keywords of this Binary or, if it has none, of the other."""
    if len(this.content) + len(other.content) > MAX_STRING_LENGTH:
        raise too_long("bytes", MAX_STRING_LENGTH)
    return binary(world, this.keywords or other.keywords, bytes(this.content) + bytes(other.content))


def install(world: World, programs: Any) -> None:
    """Make the parts of a Binary slots that can be assigned."""

    def write_data(this: BinaryObject, value: Value) -> None:
        this.content = world.checks.to_str(value, 1).encode("latin-1")

    def write_keywords(this: BinaryObject, value: Value) -> None:
        this.keywords = world.checks.to_str(value, 1)

    proto = prototype(world, "Binary")
    field(world, proto, "data", lambda this: world.string(this.data), write_data, BinaryObject)
    field(world, proto, "keywords", lambda this: world.string(this.keywords), write_keywords, BinaryObject)
