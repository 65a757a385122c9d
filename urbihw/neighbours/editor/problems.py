"""What the parser says of a text, as editors count: lines and columns from 0, columns in units of UTF-16."""

from __future__ import annotations

from typing import NamedTuple

from urbihw.kernel.syntax.reader import SyntaxProblem, parse_program


class TextProblem(NamedTuple):
    """An error or a warning, with the place of its first character and that behind its last one: line, column."""

    begin: tuple[int, int]
    end: tuple[int, int]
    message: str
    is_warning: bool


def problems_of(text: str) -> list[TextProblem]:
    """The errors and warnings of a program."""
    raw = text.encode("utf-8", "surrogatepass")
    lines = raw.split(b"\n")
    found = []
    for item in parse_program(raw.decode("latin-1")):
        if isinstance(item, SyntaxProblem):
            begin = _place(lines, item.location.begin.line, item.location.begin.column)
            end = max(begin, _place(lines, item.location.end.line, item.location.end.column))
            found.append(TextProblem(begin, end, f"{item.message}\n{item.advice}".strip(), item.warning))
    return found


def _place(lines: list[bytes], line: int, column: int) -> tuple[int, int]:
    """The place of a byte; the parser counts both from 1."""
    row = min(max(line - 1, 0), len(lines) - 1)
    before = lines[row][: max(column - 1, 0)].decode("utf-8", "replace")
    return row, len(before.encode("utf-16-le", "surrogatepass")) // 2
