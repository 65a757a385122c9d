"""From an instruction of generated code back to urbiscript.

Generated Python carries no real line numbers: the "line" of each instruction is an index into the table of its unit.
An entry holds the span of the urbiscript node, the name of the call made there (None without a call), and the
invisible call around it, if there is one: the body of a for-each counts as called by ``each``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from urbihw.kernel.syntax.location import Location, Position, Span


class MappedPlace(NamedTuple):
    """One place in a unit's source.

    ``outer`` is the index of the entry of the invisible call around it, 0 for none.  ``in_bounced``: that call bounces
    to the lobby, and its arguments are evaluated there, so it counts unless ``this`` is the lobby.
    """

    span: Span
    name: str | None
    outer: int = 0
    in_bounced: bool = False


class MappedCall(NamedTuple):
    """A location and the name called there."""

    location: Location
    name: str | None


class LineMap:
    """The table of one unit, placed where the statement stood: ``base`` is the position of its first character.

    ``late_units`` has the code of arguments that turned out to be lazy, by their nodes, and the state of the compiler
    for it.
    """

    __slots__ = ("_entries", "base", "has_bounced", "late_units", "syntax", "system")

    def __init__(
        self,
        entries: Callable[[], list[MappedPlace]],
        has_bounced: bool,
        base: Position,
        system: bool,
        syntax: object,
    ) -> None:
        """``entries`` returns the table, which most statements never need; ``has_bounced``: it has arguments of calls
        that bounce to the lobby.
        """
        self.has_bounced = has_bounced
        self._entries = entries
        self.base = base
        self.system = system
        self.syntax = syntax
        self.late_units: dict[Any, tuple[Any, Any]] = {}

    def frames(self, index: int, bounces: bool = False) -> list[MappedCall]:
        """The urbiscript call frames of one instruction, innermost first; ``bounces``: ``this`` is not the lobby."""
        steps, entries = [], self._entries()
        while 0 < index < len(entries):
            entry = entries[index]
            steps.append(MappedCall(Location.of(entry.span, self.base), entry.name))
            while entry.in_bounced and not bounces:
                entry = entries[entry.outer]
            index = entry.outer
        return steps
