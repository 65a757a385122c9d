"""Positions and spans in a source text, which tokens, nodes and errors carry.

Lines and columns count from 1, columns in bytes (a tab is one), as the server protocol page says.  A span prints
as the original prints it: ``1.5-7`` on one line (end column inclusive), ``1.5`` for one character, ``1.5-3.2``
over several lines, with ``file:`` in front when the text has a name.
"""

from __future__ import annotations

from typing import NamedTuple


class Position(NamedTuple):
    """One character of a text: line and column from 1, and the name of the text (None at the console)."""

    line: int
    column: int
    file: str | None = None

    def __str__(self) -> str:
        place = f"{self.line}.{self.column}"
        return place if self.file is None else f"{self.file}:{place}"

    def after(self, base: Position) -> Position:
        """This position, relative to the start of a statement (1.1), moved to where the statement begins."""
        if self.line == 1:
            return Position(base.line, base.column + self.column - 1, base.file)
        return Position(base.line + self.line - 1, self.column, base.file)


class Span(NamedTuple):
    """A stretch of text: (line, column) of its first character and (end_line, end_column) one past its last."""

    line: int
    column: int
    end_line: int
    end_column: int

    def to(self, other: Span) -> Span:
        """From the beginning of this span to the end of the other."""
        return Span(self.line, self.column, other.end_line, other.end_column)


NOWHERE = Span(1, 1, 1, 1)


class Location(NamedTuple):
    """An absolute place: two positions of one text; ``end`` is one past the last character."""

    begin: Position
    end: Position

    @classmethod
    def of(cls, span: Span, base: Position) -> Location:
        """The place of a span that is relative to a statement beginning at ``base``."""
        begin = Position(span.line, span.column).after(base)
        end = Position(span.end_line, span.end_column).after(base)
        return cls(begin, end)

    def __str__(self) -> str:
        begin, end = self
        last = end.column - 1
        if begin.line != end.line:
            return f"{begin}-{end.line}.{last}"
        if last == begin.column:
            return str(begin)
        return f"{begin}-{last}"
