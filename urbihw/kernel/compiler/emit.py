"""Building Python syntax: small constructors, and the state of the Python function being written.

Every node carries a position ``p``, made by ``Writer.mark``: its line is the index of an entry in the unit's table.
"""

from __future__ import annotations

import ast as py
from collections.abc import Callable, Sequence
from typing import Any

from urbihw.kernel.compiler.linemap import Entry
from urbihw.kernel.compiler.scopes import Binding, Frame, Local
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.location import NOWHERE, Span
from urbihw.kernel.syntax.pace import Pace

Pos = dict[str, Any]
LOAD, STORE = py.Load(), py.Store()
RETURN = "return"
"""The destination that means: this is the value of the function."""


def name(text: str, p: Pos) -> py.Name:
    """Read a Python variable."""
    return py.Name(text, LOAD, **p)


def target(text: str, p: Pos) -> py.Name:
    """Write a Python variable."""
    return py.Name(text, STORE, **p)


def const(value: Any, p: Pos) -> py.Constant:
    """A constant."""
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
    """``try``."""
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


class Loop:
    """A loop that break and continue may leave, perhaps from another job."""

    __slots__ = ("break_token", "continue_token", "crossed_break", "crossed_continue", "detached", "groups")

    def __init__(self, writer: Writer, number: int) -> None:
        self.detached = ""
        """The variable that knows the jobs which the body detaches, if a break has to stop them."""
        self.groups = len(writer.groups)
        self.break_token = f"_b{number}"
        self.continue_token = f"_n{number}"
        self.crossed_break = False
        self.crossed_continue = False


class Writer:
    """The state of one Python function being written."""

    __slots__ = ("close_scope", "apart", "crossed_return", "frame", "groups", "loops", "out", "outer", "return_token")

    def __init__(self, frame: Frame, outer: Writer | None) -> None:
        self.frame = frame
        self.outer = outer
        self.out: list[py.stmt] = []
        self.loops: list[Loop] = []
        self.groups: list[str] = []
        self.close_scope: Callable[[], py.stmt] | None = None
        self.apart: Loop | None = None
        self.return_token = ""
        self.crossed_return = False


class Emitter:
    """What all parts of the code generator share."""

    def __init__(self, binding: Binding, generic: bool, pace: Pace) -> None:
        self.binding = binding
        self.pace = pace
        self.generic = generic
        self.entries: list[Entry] = [Entry(NOWHERE, None, 0)]
        self.constants: list[Any] = []
        self.syntax: Any = None
        self.pieces: dict[int, str] = {}
        """The operations of very long sums; the variable of those that are put into one, else empty."""
        self.kept = 0
        """How many of the entries are no longer part of the expression under construction."""
        self.outer_entry = 0
        self.counter = 0
        self.copies = 1
        self.w = Writer(binding.top, None)

    # ---------------------------------------------------------------- positions and names

    def mark(self, node: ast.Node, called: str | None = None) -> Pos:
        """The position for code that comes from a node; ``called`` is the name of the call made there."""
        return self.mark_span(node.span, called)

    def mark_span(self, span: Span, called: str | None = None) -> Pos:
        """The position for code that comes from a stretch of text."""
        self.pace.step()
        line = len(self.entries)
        self.entries.append(Entry(span, called, self.outer_entry))
        return {"lineno": line, "col_offset": 0, "end_lineno": line, "end_col_offset": 0}

    def unkept(self) -> int:
        """How many parts of expressions have been written that are not yet part of a statement."""
        return len(self.entries) - self.kept

    def keep(self, begun: int) -> None:
        """What has been written since ``unkept()`` was ``begun`` is in statements now."""
        self.kept += self.unkept() - begun

    def fresh(self, prefix: str = "_x") -> str:
        """A new Python name."""
        self.counter += 1
        return f"{prefix}{self.counter}"

    def constant(self, value: Any, p: Pos) -> py.expr:
        """``_K[i]``: a constant that Python has no literal for."""
        self.constants.append(value)
        return py.Subscript(name("_K", p), const(len(self.constants) - 1, p), LOAD, **p)

    def nodes(self, value: tuple[ast.Node, ...], p: Pos) -> py.expr:
        """``_N[i]``: the syntax of lazy arguments."""
        return py.Subscript(name("_N", p), const(self.syntax.add(value), p), LOAD, **p)

    def emit(self, *statements: py.stmt) -> None:
        """Write statements."""
        self.w.out.extend(statements)

    def finish(self, dest: str | None, value: py.expr, p: Pos) -> None:
        """Deliver a value to where the statement's value goes: nowhere, out of the function, or a variable."""
        if dest is None:
            if not isinstance(value, py.Constant | py.Name):
                self.emit(do(value, p))
        elif dest == RETURN:
            self.emit(py.Return(value, **p))
        else:
            self.emit(set_(dest, value, p))

    # ---------------------------------------------------------------- locals

    def read(self, local: Local, p: Pos) -> py.expr:
        """Read a local."""
        if local.late:
            return call(attr(name("_L", p), "read", p), [const(local.name, p)], p)
        variable = name(local.python, p)
        return attr(variable, "v", p) if local.boxed else variable

    def declare(self, local: Local, value: py.expr, p: Pos) -> None:
        """Give a local its first value."""
        self.emit(set_(local.python, call("Box", [value], p) if local.boxed else value, p))

    def write(self, local: Local, value: py.expr, p: Pos) -> None:
        """Assign a local again."""
        if local.late:
            self.emit(do(call(attr(name("_L", p), "write", p), [const(local.name, p), value], p), p))
        elif local.boxed:
            self.emit(py.Assign([py.Attribute(name(local.python, p), "v", STORE, **p)], value, **p))
        else:
            self.emit(set_(local.python, value, p))

    def this(self, node: ast.Node, p: Pos) -> py.expr:
        """``this`` as the node sees it."""
        return name(self.binding.this[id(node)].python, p)

    # ---------------------------------------------------------------- nested functions and blocks

    def block(self, write: Any) -> list[py.stmt]:
        """The statements that ``write()`` writes, apart from the present ones."""
        outer, self.w.out = self.w.out, []
        try:
            write()
            return self.w.out
        finally:
            self.w.out = outer

    def nested(self, frame: Frame, params: list[str], write: Any, p: Pos, defaults: int = 0) -> py.expr:
        """Define a Python function whose body ``write()`` writes; its name.

        Locals of this function that are fresh in each turn of a loop reach it through a factory.
        """
        text, begun = self.fresh("_f"), self.unkept()
        outer = self.w
        self.w = Writer(frame, outer)
        try:
            write()
            body = self.w.out
        finally:
            self.w = outer
        self.keep(begun)
        made = function(text, params, body, p, defaults)
        fresh = [local.python for local in frame.free if local.fresh and local.frame is outer.frame]
        if not fresh:
            self.emit(made)
            return name(text, p)
        factory = self.fresh("_m")
        self.emit(function(factory, fresh, [made, py.Return(name(text, p), **p)], p))
        bound = set_(text, call(factory, [name(local, p) for local in fresh], p), p)
        bound.pure = True  # type: ignore[attr-defined]
        self.emit(bound)
        return name(text, p)


def is_pure(statement: py.stmt) -> bool:
    """Whether a statement only defines a function, so that its place among others does not matter."""
    return isinstance(statement, py.FunctionDef) or getattr(statement, "pure", False)
