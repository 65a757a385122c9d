"""The compiler's services for the commands: its stages as text, its keywords, and whether a text is complete."""

from __future__ import annotations

import ast as pyast
from collections.abc import Callable
from typing import Final

from urbihw.kernel.compiler import compile_node
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.reader import Statement, StatementReader, SyntaxProblem, parse_program
from urbihw.kernel.syntax.tokens import ANGLES, DURATIONS, IGNORED, KEYWORDS, SYNONYMS

WORDS: Final = frozenset({*KEYWORDS, *SYNONYMS, *IGNORED})
"""The words that cannot be names."""
UNITS: Final = (*DURATIONS, *ANGLES)
"""The units that may follow a number."""


def tokens(statement: Statement) -> str:
    """The tokens of a statement, one per line: position within the statement, kind, value."""
    lexer = Lexer([])
    lexer.feed(statement.text)
    lexer.close()
    lines = []
    if lexer.begin():
        while (token := lexer.next()) is not None:
            lines.append(f"{token.span!s:12} {token.kind:10} {token.value!r}")
    return "\n".join(lines)


def tree(statement: Statement) -> str:
    """The syntax tree of a statement, as text."""
    return repr(statement.node)


def python(statement: Statement) -> str:
    """The generated Python; ``_K`` are its constants, ``_N`` the syntax trees that it uses at run time."""
    unit = compile_node(statement.node, keep_tree=True)
    assert unit.tree is not None
    return pyast.unparse(unit.tree)


STAGES: Final[dict[str, Callable[[Statement], str]]] = {"tokens": tokens, "ast": tree, "python": python}


def dump(text: str, stage: str, file: str | None = None) -> tuple[list[str], list[str]]:
    """The statements of a program at one of ``STAGES``, and its syntax errors and warnings with their locations."""
    shown, problems = [], []
    for item in parse_program(text, file):
        if isinstance(item, SyntaxProblem):
            problems.append(f"{item.location}: {'warning' if item.warning else 'syntax error'}: {item.message}")
        else:
            shown.append(STAGES[stage](item))
    return shown, problems


class Input:
    """Tracks whether the bytes sent to a server end within a statement."""

    def __init__(self) -> None:
        self._reader = StatementReader()

    def feed(self, data: bytes) -> None:
        """Add bytes that have come."""
        self._reader.feed(data)

    def ends_within(self) -> bool:
        """Whether a server waits for the rest of a statement.  Must be called once, at the end."""
        return bool(self._reader.finish())


def unfinished(text: str) -> bool:
    """Whether a server waits for the rest of this text."""
    watched = Input()
    watched.feed(text.encode("utf-8", "surrogateescape") + b"\n")
    return watched.ends_within()
