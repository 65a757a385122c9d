"""The text of a value that may nest, within bounds: the base of the formats for programs.  Not in the manual."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Final

from urbihw.kernel.library import Dictionary, List, Tuple, Value, World, errors

MAX_DEPTH: Final = 20
"""Maximum nesting of lists and dictionaries."""


class NestedText(ABC):
    """Writes one value, and counts its characters: a list may contain another one many times.

    Attributes:
        between: what stands between the key and the value of a member of a Dictionary.
    """

    between: ClassVar[str]

    def __init__(self, world: World, most: int) -> None:
        """``most``: the maximum number of characters."""
        self.world = world
        self._most = most
        self._left = most

    def text(self, value: Value, depth: int = 0) -> str:
        """The text of a value or of a member.  Raises an urbiscript error when it is too long or too deep, and what the
        printing of an object raises.
        """
        if depth > MAX_DEPTH:
            raise errors.primitive(f"the value nests deeper than {MAX_DEPTH}", None)
        if isinstance(value, List | Tuple):
            self._count(2 + 2 * len(value.l))
            return f"[{', '.join([self.text(member, depth + 1) for member in value.l])}]"
        if isinstance(value, Dictionary):
            self._count(2 + (2 + len(self.between)) * len(value.d))
            return self.dictionary([f"{self._counted(self.string(key))}{self.between}{self.text(member, depth + 1)}"
                                    for key, member in value.d.items()])
        return self._counted(self.plain(value))

    @abstractmethod
    def dictionary(self, members: list[str]) -> str:
        """Put the members of a Dictionary together."""

    @abstractmethod
    def string(self, text: str) -> str:
        """The text of a String."""

    @abstractmethod
    def plain(self, value: Value) -> str:
        """The text of a value that contains no others."""

    def check_length(self, length: int) -> None:
        """Raise an urbiscript error if no text of this length may follow."""
        if length > self._left:
            raise errors.primitive(f"the value is longer than {self._most} characters", None)

    def _counted(self, text: str) -> str:
        self._count(len(text))
        return text

    def _count(self, length: int) -> None:
        self.check_length(length)
        self._left -= length
