"""Binary: bytes with a header.

Source: manual, specs/binary; server protocol, section 4.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Binary")


class BinaryObject(Obj):
    """An urbiscript Binary; ``data`` has one character per byte."""

    __slots__ = ("data", "keywords")

    def __init__(self, world: World, protos: list[Obj], keywords: str = "", data: str = "") -> None:
        super().__init__(world, protos)
        self.keywords = keywords
        self.data = data

    def clone(self) -> BinaryObject:
        """A copy."""
        return BinaryObject(self.world, [self], self.keywords, self.data)


CLASSES = {"Binary": BinaryObject}


def binary(world: World, keywords: str, data: str) -> BinaryObject:
    """A Binary."""
    return BinaryObject(world, [world.global_.slots["Binary"]], keywords, data)


@TABLE.primitive("init")
def init(world: World, this: BinaryObject, keywords: str, data: str) -> None:
    """Some data with some keywords."""
    this.keywords, this.data = keywords, data


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
    return not this.data


@TABLE.primitive("copy")
def copy(world: World, this: BinaryObject) -> Any:
    """Another Binary of the same content."""
    return binary(world, this.keywords, this.data)


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: BinaryObject) -> str:
    """``BIN`` size keywords, a line feed, the bytes."""
    head = f" {this.keywords}" if this.keywords else ""
    return f"BIN {len(this.data)}{head}\n{this.data}"


@TABLE.primitive("==")
def equals(world: World, this: BinaryObject, other: Any) -> bool:
    """Whether the other has the same keywords and bytes."""
    return isinstance(other, BinaryObject) and (this.keywords, this.data) == (other.keywords, other.data)


@TABLE.primitive("!=")
def differs(world: World, this: BinaryObject, other: Any) -> bool:
    """``!(this == other)``."""
    return not (isinstance(other, BinaryObject) and (this.keywords, this.data) == (other.keywords, other.data))


@TABLE.primitive("+")
def plus(world: World, this: BinaryObject, other: BinaryObject) -> Any:
    """The bytes of both, with the keywords of this one, or of the other if this one has none."""
    return binary(world, this.keywords or other.keywords, this.data + other.data)
