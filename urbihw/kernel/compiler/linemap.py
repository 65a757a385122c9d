"""From an instruction of generated code back to urbiscript.

Generated Python carries no real line numbers: the "line" of each instruction is an index into the table of its unit.
An entry holds the span of the urbiscript node, the name of the call made there (None without a call), and the entry
that encloses it as an invisible call: the body of a for-each counts as called by ``each``.  The number of the enclosing
entry is negative for the arguments of a call that bounces to the lobby: it counts unless ``this`` is the lobby.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from urbihw.kernel.syntax.location import Location, Position, Span


class MappedPlace(NamedTuple):
    """One place in a unit's source."""

    span: Span
    name: str | None
    outer: int


class MappedCall(NamedTuple):
    """A location and the name called there."""

    location: Location
    name: str | None


def have_bounced(entries: Iterable[MappedPlace]) -> bool:
    """Whether some of these places are in arguments of calls that bounce to the lobby."""
    return any(entry.outer < 0 for entry in entries)


class LineMap:
    """The table of one unit, placed where the statement stood: ``base`` is the position of its first character.

    ``late_units`` has the code of arguments that turned out to be lazy, by their nodes, and the state of the compiler
    for it.
    """

    __slots__ = ("_has_bounced", "base", "entries", "late_units", "syntax", "system")

    def __init__(self, entries: list[MappedPlace], base: Position, system: bool, syntax: object) -> None:
        self.entries = entries
        self.base = base
        self.system = system
        self.syntax = syntax
        self._has_bounced: bool | None = None
        self.late_units: dict[Any, tuple[Any, Any]] = {}

    @property
    def has_bounced(self) -> bool:
        """Whether there are arguments of calls that bounce to the lobby."""
        if self._has_bounced is None:
            # Each write that moves a device asks; a statement of a template need not be compiled for it.
            known = getattr(self.entries, "have_bounced", None)
            self._has_bounced = have_bounced(self.entries) if known is None else known
        return self._has_bounced

    def frames(self, index: int, bounces: bool = False) -> list[MappedCall]:
        """The urbiscript call frames of one instruction, innermost first; ``bounces``: ``this`` is not the lobby."""
        steps = []
        while 0 < index < len(self.entries):
            entry = self.entries[index]
            steps.append(MappedCall(Location.of(entry.span, self.base), entry.name))
            index = entry.outer
            while index < 0:
                index = -index if bounces else self.entries[-index].outer
        return steps
