"""Reading and comparing, for the tests of the syntax."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.reader import Item, Statement, StatementCache, StatementReader, SyntaxProblem, parse_program

EXAMPLES = [
    line for line in Path(__file__).with_name("examples.u").read_text("ascii").splitlines() if not line.startswith("//")
]


def node(text: str) -> ast.Node:
    """The node of the only statement of a text, which must be right."""
    (item,) = parse_program(text)
    assert isinstance(item, Statement), item
    return item.node


def told(items: Iterable[Item]) -> list[str]:
    """What a connection would see: the texts of statements, and errors with their positions."""
    lines = []
    for item in items:
        if isinstance(item, SyntaxProblem):
            lines.append(f"{'warning' if item.warning else 'error'} {item.location}: {item.message}")
        else:
            lines.append(item.text)
    return lines


def typed(text: str | bytes) -> list[str]:
    """What a connection would see for a text that is typed at once."""
    return told(StatementReader().feed(text if isinstance(text, bytes) else text.encode("latin-1")))


def in_pieces(data: bytes, size: int, cache: StatementCache | None = None) -> list[Item]:
    """The items of a text that comes in packets of ``size`` bytes and then ends."""
    reader = StatementReader(cache=cache)
    items = []
    for at in range(0, len(data), size):
        items += reader.feed(data[at : at + size])
    return items + reader.finish()


def plain(value: Any) -> Any:
    """A node without what printing loses: spans, empty argument lists, digits of floats beyond the sixth."""
    if isinstance(value, ast.Call) and value.args == ():
        return plain(dataclasses.replace(value, args=None))
    if isinstance(value, ast.Float):
        return f"{value.value:g}"
    if isinstance(value, ast.Node):
        fields = [field.name for field in dataclasses.fields(value) if field.compare]
        return type(value).__name__, *(plain(getattr(value, name)) for name in fields)
    if isinstance(value, tuple):
        return tuple(plain(member) for member in value)
    return value
