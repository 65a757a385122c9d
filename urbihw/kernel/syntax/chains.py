"""Long chains ``a.b = 1|c.d = 2|...;`` on one connection, cut at their ``|``.

A program of the C++ SDK that writes variables sends all writes of one callback as one statement:
``lamp.getSlot("val").update_timed(5, 1000000)|`` may stand in it ten thousand times (remote UObject protocol, section
5).  Parsed as a whole, it would be one tree that no cache knows, and none of it could run before all is compiled.  So
the reader takes such pieces one by one from the buffer: each is a statement of its own for the caches, whose text ends
with ``;`` there.

Only what cannot mean anything else is cut: calls and assignments through names, with simple arguments, at the
outermost level.  What comes behind the last of them is the rest of the chain and is parsed as usual.  Nothing runs
before the whole chain has been read.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from urbihw.kernel.syntax.ast import Node

if TYPE_CHECKING:
    from urbihw.kernel.syntax.reader import Statement

SHORTEST: Final = 8
"""Number of pieces from which on a chain is cut; shorter ones are parsed as a whole, and run without a pause."""
LONGEST_PIECE: Final = 1000
"""Maximum length of a piece, in characters."""

_TEXT = r'"[^"\\\n]*+"'
_ARGUMENTS = rf"\((?:[^()\"'\\{{}}|;&\n/`]++|{_TEXT})*+\)"
_VALUE = rf"(?:{_TEXT}|[-+]?[\w.]++(?:(?<=[eE])[-+]\d++)?|\[[^][()\"'\\{{}}|;&\n/`]*+\])"
_PIECE = rf"[A-Za-z_]\w*+(?:\.\w++|{_ARGUMENTS})++(?:[ ]*+=[ ]*+{_VALUE})?+"
_JOINT = r"[ ]*+\|(?=[^|=])"

PIECE: Final = re.compile(rf"({_PIECE}){_JOINT}")
"""One piece and the ``|`` behind it; group 1 is the piece."""
_MANY: Final = re.compile(rf"(?:{_PIECE}{_JOINT}[ \t\r\n]*+){{{SHORTEST}}}")
_OPEN_TEXT = r'"[^"\\\n]*+'
_OPEN_ARGUMENTS = rf"\((?:[^()\"'\\{{}}|;&\n/`]++|{_TEXT})*+(?:{_OPEN_TEXT})?+"
_OPEN_VALUE = rf"[ ]*+(?:=[ ]*+(?:{_VALUE}|[-+]|{_OPEN_TEXT}|\[[^][()\"'\\{{}}|;&\n/`]*+)?+[ ]*+)?+\|?+"
_OPEN_PIECE = rf"[A-Za-z_]\w*+(?:\.\w*+|{_ARGUMENTS})*+(?:{_OPEN_ARGUMENTS}|{_OPEN_VALUE})"
_BEGUN: Final = re.compile(rf"(?:{_PIECE}{_JOINT}[ \t\r\n]*+)*+(?:{_OPEN_PIECE})?+\Z")


def is_long(buffer: str, at: int) -> bool:
    """Whether a long chain begins here."""
    return _MANY.match(buffer, at) is not None


def may_go_on(buffer: str, at: int) -> bool:
    """Whether the input ends inside a piece, or between two: then nothing is complete before more has come."""
    return len(buffer) - at <= LONGEST_PIECE * SHORTEST and _BEGUN.match(buffer, at) is not None


class LongChain(Node):
    """Stands for the syntax of a long chain: its pieces, each a statement; the last may be the rest of the chain."""

    __slots__ = ("pieces",)

    def __init__(self, pieces: list[Statement]) -> None:
        super().__init__()
        self.pieces = pieces
