"""Binary: bytes with a header.

Source: manual, specs/binary; server protocol, section 4.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.binary import BinaryObject, Buffer
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import MOST_CHARACTERS, too_long
from urbihw.kernel.runtime.world import World

TABLE = Table("Binary")


CLASSES = {"Binary": BinaryObject}


def binary(world: World, keywords: str, content: Buffer) -> BinaryObject:
    """A Binary."""
    return BinaryObject(world, [world.classes["Binary"]], keywords, content)


@TABLE.primitive("init")
def init(world: World, this: BinaryObject, keywords: str, data: str) -> None:
    """Some data with some keywords."""
    this.keywords, this.content = keywords, data.encode("latin-1")


@TABLE.primitive("data")
def data(world: World, this: BinaryObject) -> str:
    """The bytes."""
    return this.data


@TABLE.primitive("keywords")
def keywords(world: World, this: BinaryObject) -> str:
    """The header."""
    return this.keywords


@TABLE.primitive("empty")
def empty(world: World, this: BinaryObject) -> bool:
    """Whether there are no bytes."""
    return not len(this.content)


@TABLE.primitive("copy")
def copy(world: World, this: BinaryObject) -> Any:
    """Another Binary of the same content."""
    return binary(world, this.keywords, this.content)


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: BinaryObject) -> str:
    """``BIN`` size keywords, a line feed, the bytes."""
    head = f" {this.keywords}" if this.keywords else ""
    return f"BIN {len(this.content)}{head}\n{this.data}"


@TABLE.primitive("==")
def equals(world: World, this: BinaryObject, other: Any) -> bool:
    """Whether the other has the same keywords and bytes."""
    return isinstance(other, BinaryObject) and (this.keywords, this.content) == (other.keywords, other.content)


@TABLE.primitive("!=")
def differs(world: World, this: BinaryObject, other: Any) -> bool:
    """``!(this == other)``."""
    return not (isinstance(other, BinaryObject) and (this.keywords, this.content) == (other.keywords, other.content))


@TABLE.primitive("+")
def plus(world: World, this: BinaryObject, other: BinaryObject) -> Any:
    """The bytes of both, with the keywords of this one, or of the other if this one has none."""
    if len(this.content) + len(other.content) > MOST_CHARACTERS:
        raise too_long("bytes", MOST_CHARACTERS)
    return binary(world, this.keywords or other.keywords, bytes(this.content) + bytes(other.content))
