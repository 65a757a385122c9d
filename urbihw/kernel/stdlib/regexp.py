"""Regexp: Perl's regular expressions.

Source: manual, specs/regexp.  Python's ``re`` does the work; ``perl`` tells it what it would read otherwise.
"""

from __future__ import annotations

import re
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.perl import NotPerl, to_python
from urbihw.kernel.stdlib.string import escaped

TABLE = Table("Regexp")
PROTOS = {"Regexp": ("Container", "Object")}
EMPTY = re.compile("")


class RegexpObject(Obj):
    """An urbiscript Regexp; ``text`` as it was written, ``found`` are the groups of the latest match."""

    __slots__ = ("compiled", "found", "text")

    def __init__(self, world: World, protos: list[Obj], text: str = "", compiled: re.Pattern[str] = EMPTY) -> None:
        super().__init__(world, protos)
        self.text = text
        self.compiled = compiled
        self.found: list[str] = []

    def clone(self) -> RegexpObject:
        """The same expression, not matched yet."""
        return RegexpObject(self.world, [self], self.text, self.compiled)

    def search(self, text: str) -> bool:
        """Look for the expression anywhere in a text."""
        match = self.compiled.search(text)
        self.found = [] if match is None else [match[0], *(group or "" for group in match.groups())]
        return match is not None


CLASSES = {"Regexp": RegexpObject}


@TABLE.primitive("init")
def init(world: World, this: RegexpObject, expression: str) -> None:
    """Compile an expression; an error if there is something wrong with it."""
    if not expression:
        raise errors.primitive("invalid regular expression `': Empty expression")
    try:
        this.compiled = re.compile(to_python(expression), re.ASCII)
    except (re.error, NotPerl, RecursionError, OverflowError) as error:
        reason = "too complex" if isinstance(error, (RecursionError, OverflowError)) else getattr(error, "msg", error)
        raise errors.primitive(f"invalid regular expression `{expression}': {reason}") from error
    this.text = expression


@TABLE.primitive("asString")
def as_string(world: World, this: RegexpObject) -> str:
    """The expression."""
    return this.text


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: RegexpObject) -> str:
    """``Regexp`` and the expression as a literal."""
    return f"Regexp({escaped(this.text)})"


@TABLE.primitive("match", "has")
def match(world: World, this: RegexpObject, text: str) -> bool:
    """Whether the expression is found anywhere in a string; ``matches`` tells what was found."""
    return this.search(text)


@TABLE.primitive("hasNot")
def has_not(world: World, this: RegexpObject, text: str) -> bool:
    """Whether the expression is nowhere in a string."""
    return not this.search(text)


@TABLE.primitive("matches")
def matches(world: World, this: RegexpObject) -> Any:
    """What the latest ``match`` found: the whole, then each group; empty if it found nothing."""
    return world.new_list([world.string(group) for group in this.found])


@TABLE.primitive("[]")
def get_item(world: World, this: RegexpObject, index: float) -> Any:
    """``matches[index]``."""
    if not 0 <= index < len(this.found) or index != int(index):
        raise errors.primitive(f"out of bound index: {world.text(index)}")
    return world.string(this.found[int(index)])
