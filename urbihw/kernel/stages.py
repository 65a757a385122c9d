"""The stages of the compiler, as text for people: what ``urbihw dump`` prints."""

from __future__ import annotations

import ast as pyast
from collections.abc import Callable
from typing import Final

from urbihw.kernel.compiler import compile_node
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.reader import Statement, SyntaxProblem, parse_program


def tokens(statement: Statement) -> str:
    """One token a line: where it stands in its statement, its kind, its value."""
    lexer = Lexer([])
    lexer.feed(statement.text)
    lexer.close()
    lines = []
    if lexer.begin():
        while (token := lexer.next()) is not None:
            lines.append(f"{token.span!s:12} {token.kind:10} {token.value!r}")
    return "\n".join(lines)


def tree(statement: Statement) -> str:
    """The syntax tree."""
    return repr(statement.node)


def python(statement: Statement) -> str:
    """The generated Python; ``_K`` are its constants, ``_N`` syntax that it carries along."""
    unit = compile_node(statement.node, keep_tree=True)
    assert unit.tree is not None
    return pyast.unparse(unit.tree)


STAGES: Final[dict[str, Callable[[Statement], str]]] = {"tokens": tokens, "ast": tree, "python": python}


def dump(text: str, stage: str, file: str | None = None) -> tuple[list[str], list[str]]:
    """The statements of a program at one of ``STAGES``, and its syntax errors and warnings, each with its place."""
    shown, problems = [], []
    for item in parse_program(text, file):
        if isinstance(item, SyntaxProblem):
            problems.append(f"{item.location}: {'warning' if item.warning else 'syntax error'}: {item.message}")
        else:
            shown.append(STAGES[stage](item))
    return shown, problems
