"""Signatures: the types of QiMessaging, written as text.

    v void   b bool   c/C w/W i/I l/L integers of 8 to 64 bits (capital: unsigned)   f d floats   s string   r raw bytes
    m dynamic (a signature, then a value of it)   o object   X unknown   [T] list   {KV} map
    (T...)<Name,field,...> struct or tuple

Texts of other machines are never trusted: their length and their depth are bounded.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

LONGEST: Final = 8192
"""Characters of a signature; the one of a MetaObject has 300."""
DEEPEST: Final = 24
"""Levels of nesting, of a signature, and of values in each other."""
PLAIN: Final = frozenset("vbcCwWiIlLfdsrmoX")


@frozen
class Type:
    """A type: ``kind`` is a letter, or ``[``, ``{`` or ``(`` with the types of the parts in ``parts``."""

    kind: str
    parts: tuple[Type, ...] = ()

    def __str__(self) -> str:
        inner = "".join(map(str, self.parts))
        return self.kind if self.kind in PLAIN else f"{self.kind}{inner}{_CLOSING[self.kind]}"


_CLOSING: Final = {"[": "]", "{": "}", "(": ")"}
_SINGLE: Final = {letter: Type(letter) for letter in PLAIN}
"""One object for each: signatures of others are kept, and must take little memory."""


@lru_cache(maxsize=1024)
def parse(text: str) -> Type:
    """The type that a signature stands for.  Raises BadFrame."""
    if len(text) > LONGEST:
        raise BadFrame(f"a signature of {len(text)} characters")
    found, end = _parse(text, 0, 0)
    if end != len(text):
        raise BadFrame(f"signature {text[:60]!r}: something follows its end")
    return found


def _parse(text: str, at: int, depth: int) -> tuple[Type, int]:
    letter = text[at : at + 1]
    if (single := _SINGLE.get(letter)) is not None:
        return single, at + 1
    if letter not in _CLOSING or depth >= DEEPEST:
        raise BadFrame(f"signature {text[:60]!r}: no type at {at}")
    parts: list[Type] = []
    closing = _CLOSING[letter]
    at += 1
    while text[at : at + 1] != closing:
        part, at = _parse(text, at, depth + 1)
        parts.append(part)
    if len(parts) != {"[": 1, "{": 2}.get(letter, len(parts)):
        raise BadFrame(f"signature {text[:60]!r}: {letter}{closing} with {len(parts)} parts")
    at += 1
    if letter == "(" and text[at : at + 1] == "<":
        # The names of a struct and of its fields; a field's name never has brackets of its own.
        end = text.find(">", at)
        if end < 0:
            raise BadFrame(f"signature {text[:60]!r}: a name does not end")
        at = end + 1
    return Type(letter, tuple(parts)), at
