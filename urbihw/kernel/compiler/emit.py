"""Building Python syntax: small constructors.

Every node carries a position ``p``, made by ``Writer.mark``: its line is the index of an entry in the unit's table.
"""

from __future__ import annotations

import ast as py
from collections.abc import Sequence
from typing import Any

Pos = dict[str, Any]
LOAD, STORE = py.Load(), py.Store()


def position(line: int) -> Pos:
    """The position that stands for an entry of the unit's table; Python requires columns, which are not used."""
    return {"lineno": line, "col_offset": 0}


def position_of(made: py.expr) -> Pos:
    """The position of a Python node."""
    return {"lineno": made.lineno, "col_offset": 0}


def name(text: str, p: Pos) -> py.Name:
    """Read a Python variable."""
    return py.Name(text, LOAD, **p)


def target(text: str, p: Pos) -> py.Name:
    """Write a Python variable."""
    return py.Name(text, STORE, **p)


def const(value: Any, p: Pos) -> py.Constant:
    """The expression of a constant."""
    return py.Constant(value, **p)


def attr(value: py.expr, field: str, p: Pos) -> py.Attribute:
    """``value.field``."""
    return py.Attribute(value, field, LOAD, **p)


def call(function: str | py.expr, args: list[py.expr], p: Pos) -> py.Call:
    """``function(args)``."""
    return py.Call(name(function, p) if isinstance(function, str) else function, args, [], **p)


def walrus(text: str, value: py.expr, p: Pos) -> py.NamedExpr:
    """``(text := value)``."""
    return py.NamedExpr(target(text, p), value, **p)


def choose(test: py.expr, then: py.expr, otherwise: py.expr, p: Pos) -> py.IfExp:
    """``then if test else otherwise``."""
    return py.IfExp(test, then, otherwise, **p)


def tuple_(items: list[py.expr], p: Pos) -> py.Tuple:
    """``(items)``."""
    return py.Tuple(items, LOAD, **p)


def list_(items: list[py.expr], p: Pos) -> py.List:
    """``[items]``."""
    return py.List(items, LOAD, **p)


def is_(left: py.expr, right: py.expr, p: Pos, negated: bool = False) -> py.Compare:
    """``left is right``, ``left is not right``."""
    return py.Compare(left, [py.IsNot() if negated else py.Is()], [right], **p)


def set_(text: str, value: py.expr, p: Pos) -> py.Assign:
    """``text = value``."""
    return py.Assign([target(text, p)], value, **p)


def do(value: py.expr, p: Pos) -> py.Expr:
    """An expression for its effect."""
    return py.Expr(value, **p)


def if_(test: py.expr, then: list[py.stmt], otherwise: list[py.stmt], p: Pos) -> py.If:
    """``if test: then else: otherwise``."""
    return py.If(test, then or [py.Pass(**p)], otherwise, **p)


def try_(
    body: list[py.stmt], handlers: list[py.ExceptHandler], otherwise: list[py.stmt], final: list[py.stmt], p: Pos
) -> py.Try:
    """A statement ``try`` with its handlers."""
    return py.Try(body or [py.Pass(**p)], handlers, otherwise, final, **p)


def except_(kind: str, text: str, body: Sequence[py.stmt], p: Pos) -> py.ExceptHandler:
    """``except kind as text: body``."""
    return py.ExceptHandler(name(kind, p), text, list(body), **p)


def raise_(value: py.expr | None, p: Pos) -> py.Raise:
    """``raise value``."""
    return py.Raise(value, None, **p)


def function(text: str, params: list[str], body: list[py.stmt], p: Pos, defaults: int = 0) -> py.FunctionDef:
    """``def text(params): body``; the last ``defaults`` parameters default to MISSING."""
    args = py.arguments(
        posonlyargs=[],
        args=[py.arg(param, None, **p) for param in params],
        vararg=None,
        kwonlyargs=[],
        kw_defaults=[],
        kwarg=None,
        defaults=[name("MISSING", p) for _ in range(defaults)],
    )
    made = py.FunctionDef(text, args, body or [py.Pass(**p)], [], None, **p)
    vars(made)["type_params"] = []  # wanted from Python 3.12 on
    return made


def is_pure(statement: py.stmt) -> bool:
    """Whether a statement only defines a function, so that its place among others does not matter."""
    return isinstance(statement, py.FunctionDef) or getattr(statement, "pure", False)
