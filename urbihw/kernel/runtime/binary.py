"""Binary: bytes with a header.

The content is a Python buffer that is never changed, so images and sounds go from device to socket without a copy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from urbihw.kernel.runtime.object import Obj

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Buffer = bytes | bytearray | memoryview


class BinaryObject(Obj):
    """An urbiscript Binary: ``keywords`` describe the ``content``."""

    __slots__ = ("content", "keywords")

    def __init__(self, world: World, protos: list[Obj], keywords: str = "", content: Buffer = b"") -> None:
        super().__init__(world, protos)
        self.keywords = keywords
        self.content = content

    @property
    def data(self) -> str:
        """The bytes, one character each."""
        return bytes(self.content).decode("latin-1")

    def clone(self) -> BinaryObject:
        return BinaryObject(self.world, [self], self.keywords, self.content)
