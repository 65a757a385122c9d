"""The writer of a unit: the Python statements of the function under construction, and the tables of the unit.

Visitors are functions of a node and of the writer.  Those of expressions (``make_call(node, w)``) give a Python
expression; those of statements (``write_if(node, w, dest)``) write Python statements that deliver the value to
``dest``: nowhere (None), out of the function (RETURN), or into a Python variable.  ``codegen`` has the tables that say
which class of nodes has which; ``visit`` looks them up.
"""

from __future__ import annotations

import ast as py
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from urbihw.kernel.compiler.emit import LOAD, STORE, Pos, attr, call, const, do, function, name, position, set_
from urbihw.kernel.compiler.late import LateSites
from urbihw.kernel.compiler.linemap import MappedPlace
from urbihw.kernel.compiler.scopes import Binding
from urbihw.kernel.compiler.unit import Syntax
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame, Local
from urbihw.kernel.syntax.location import NOWHERE, Span
from urbihw.kernel.syntax.pace import StepPace

_new: Final = tuple.__new__
RETURN: Final = "return"
"""The destination of a value that the function returns."""

Expressions = Mapping[type[ast.Node], Callable[[Any, "Writer"], py.expr]]
"""The visitors that make expressions."""
Statements = Mapping[type[ast.Node], Callable[[Any, "Writer", "str | None"], None]]
"""The visitors that write statements."""


class InvisibleCall(NamedTuple):
    """A call that encloses the places written inside it: the last two fields of their ``MappedPlace``."""

    entry: int
    bounced: bool = False


NO_CALL: Final = InvisibleCall(0)
"""Represents the place outside all invisible calls."""


class Loop:
    """A loop under construction."""

    __slots__ = ("break_token", "continue_token", "crossed_break", "crossed_continue", "detached", "groups")

    def __init__(self, groups: int, number: int) -> None:
        self.groups = groups
        """The number of groups of background jobs around the loop in its function."""
        self.detached = ""
        """The variable with the tag of the detached jobs, if a break has to stop them."""
        self.break_token = f"_b{number}"
        self.continue_token = f"_n{number}"
        self.crossed_break = False
        self.crossed_continue = False


class Body:
    """The Python function being written, inside ``outer``."""

    __slots__ = ("apart", "close_scope", "crossed_return", "frame", "groups", "loops", "out", "outer", "return_token")

    def __init__(self, frame: FunctionFrame, outer: Body | None) -> None:
        self.frame = frame
        self.outer = outer
        self.out: list[py.stmt] = []
        self.loops: list[Loop] = []
        self.groups: list[str] = []
        self.close_scope: Callable[[], py.stmt] | None = None
        self.apart: Loop | None = None
        self.return_token = ""
        self.crossed_return = False


class Writer:
    """Writes one unit; afterwards ``entries``, ``constants`` and ``syntax`` belong to the unit."""

    def __init__(
        self, binding: Binding, expressions: Expressions, statements: Statements, generic: bool, pace: StepPace
    ) -> None:
        """``generic``: arithmetic is sent as messages."""
        self.binding = binding
        self.lazy_names = binding.lazy_names
        self.expressions = expressions
        self.statements = statements
        self.generic = generic
        self.pace = pace
        self.entries: list[MappedPlace] = [MappedPlace(NOWHERE, None)]
        self.constants: list[Any] = []
        self.late = LateSites()
        self.syntax = Syntax([], self.late)
        self.body = Body(binding.top, None)
        self.kept = 0
        """The number of entries that are not part of the expression under construction any more."""
        self.around = NO_CALL
        """The invisible call around what is written."""
        self.has_bounced = False
        """Whether some of them bounce to the lobby."""
        self.counter = 0
        self.copies = 1
        """The number of copies that Python makes of the code under construction, in ``finally`` clauses."""

    # ---------------------------------------------------------------- positions and names

    def mark(self, node: ast.Node, called: str | None = None) -> Pos:
        """The position for code that comes from a node; ``called`` is the name of the call made there."""
        self.pace.step()
        entries = self.entries
        line = len(entries)
        entries.append(_new(MappedPlace, (node.span, called, *self.around)))
        return {"lineno": line, "col_offset": 0}

    def mark_span(self, span: Span, called: str | None = None) -> Pos:
        """The position for code that comes from a stretch of text."""
        self.pace.step()
        self.entries.append(MappedPlace(span, called, *self.around))
        return position(len(self.entries) - 1)

    @contextmanager
    def within(self, around: InvisibleCall) -> Iterator[None]:
        """What is written meanwhile is in an invisible call."""
        before, self.around = self.around, around
        self.has_bounced = self.has_bounced or around.bounced
        yield
        self.around = before

    def unkept(self) -> int:
        """The number of nodes of expressions that are not part of a statement yet."""
        return len(self.entries) - self.kept

    def keep(self, begun: int) -> None:
        """Record that the nodes written since ``unkept()`` was ``begun`` are in statements now."""
        self.kept = len(self.entries) - begun

    def fresh(self, prefix: str = "_x") -> str:
        """A new Python name."""
        self.counter += 1
        return f"{prefix}{self.counter}"

    def new_loop(self) -> Loop:
        """A loop that begins here."""
        self.counter += 1
        return Loop(len(self.body.groups), self.counter)

    def constant(self, value: Any, p: Pos) -> py.expr:
        """``_K[i]``: a constant that Python has no literal for."""
        self.constants.append(value)
        return py.Subscript(name("_K", p), const(len(self.constants) - 1, p), LOAD, **p)

    def nodes(self, value: tuple[ast.Node, ...], p: Pos) -> py.expr:
        """``_N[i]``: the syntax of lazy arguments."""
        return py.Subscript(name("_N", p), const(self.syntax.add(value), p), LOAD, **p)

    # ---------------------------------------------------------------- statements

    def emit(self, *statements: py.stmt) -> None:
        """Write some statements at the end of the body."""
        self.body.out.extend(statements)

    def finish(self, dest: str | None, value: py.expr, p: Pos) -> None:
        """Deliver a value to where the statement's value goes: nowhere, out of the function, or a variable."""
        if dest is None:
            if not isinstance(value, py.Constant | py.Name):
                self.emit(do(value, p))
        elif dest == RETURN:
            self.emit(py.Return(value, **p))
        else:
            self.emit(set_(dest, value, p))

    def finish_void(self, dest: str | None, p: Pos) -> None:
        """The statement has no value."""
        if dest is not None:
            self.finish(dest, name("VOID", p), p)

    def block(self, write: Callable[[], None]) -> list[py.stmt]:
        """The statements that ``write()`` writes, apart from the present ones."""
        outer, self.body.out = self.body.out, []
        write()
        made, self.body.out = self.body.out, outer
        return made

    def block_of(self, make: Callable[[], py.expr]) -> tuple[py.expr, list[py.stmt]]:
        """The expression that ``make()`` makes, and the statements that it writes for that."""
        outer, self.body.out = self.body.out, []
        made = make()
        before, self.body.out = self.body.out, outer
        return made, before

    # ---------------------------------------------------------------- locals

    def read(self, local: Local, p: Pos) -> py.expr:
        """The expression that reads a local variable."""
        if local.late:
            return call(attr(name("_L", p), "read", p), [const(local.name, p)], p)
        variable = name(local.python, p)
        return attr(variable, "v", p) if local.boxed else variable

    def declare(self, local: Local, value: py.expr, p: Pos) -> None:
        """Give a local its first value."""
        self.emit(set_(local.python, call("Box", [value], p) if local.boxed else value, p))

    def box(self, local: Local, p: Pos) -> None:
        """A parameter has its value; put it into a Box if it lives in one."""
        if local.boxed:
            self.emit(set_(local.python, call("Box", [name(local.python, p)], p), p))

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
        local = node.bound.this
        assert local is not None
        return name(local.python, p)

    # ---------------------------------------------------------------- nested functions

    def nested(
        self, frame: FunctionFrame, params: list[str], write: Callable[[], None], p: Pos, defaults: int = 0
    ) -> py.expr:
        """Define a Python function whose body ``write()`` writes; its name.

        Locals of this function that are fresh in each turn of a loop reach it through a factory.
        """
        text, begun = self.fresh("_f"), self.unkept()
        outer = self.body
        self.body = Body(frame, outer)
        write()
        out, self.body = self.body.out, outer
        self.keep(begun)
        made = function(text, params, out, p, defaults)
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
