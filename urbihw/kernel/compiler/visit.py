"""From a node to its visitor, and what all visitors need: values, operands in order, parts that are functions.

An urbiscript expression may contain statements (``1 + { ...; 2 }``), a Python one may not: such a node writes its
statements before the statement under construction, and its value goes to a variable.  ``make_in_order`` keeps the order
of evaluation: when a later operand writes statements, the earlier ones are put into variables first.
"""

from __future__ import annotations

import ast as py
from collections.abc import Callable, Sequence
from typing import Any

from urbihw.kernel.compiler.emit import (
    STORE,
    Pos,
    attr,
    call,
    choose,
    const,
    do,
    is_,
    is_pure,
    list_,
    name,
    position_of,
    set_,
    try_,
    walrus,
)
from urbihw.kernel.compiler.operations import is_native
from urbihw.kernel.compiler.scopes import OPERATIONS, left_of, spine
from urbihw.kernel.compiler.writer import RETURN, Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame, Local
from urbihw.kernel.syntax.location import Span

MAX_OPERATIONS = 100
"""Maximum number of operations of a sum, or of parts of a list, in one Python expression."""
MAX_PARTS = 300
"""Maximum number of nodes of one Python expression; Python compiles them without a pause, in 2 ms."""
NEVER_VOID = frozenset(
    (ast.Float, ast.StringLiteral, ast.ListLit, ast.TupleLit, ast.DictLit, ast.This, ast.CallKeyword, ast.Function)
)

Maker = Callable[[], py.expr]
Make = Callable[[Any, Writer], py.expr]


# ---------------------------------------------------------------- one node


def make_expr(node: ast.Node, w: Writer) -> py.expr:
    """The value of a node; it may be void."""
    kind = node.__class__
    if kind in OPERATIONS:
        piece = split_sum(node, w, OPERATIONS, make_expr)
        if piece is not None:
            return piece
    begun = w.unkept()
    make = w.expressions.get(kind)
    if make is None:
        variable = w.fresh()
        write_stmt(node, w, variable)
        w.keep(begun)
        return name(variable, w.mark(node))
    made = make(node, w)
    if w.unkept() - begun > MAX_PARTS:
        variable = w.fresh()
        w.emit(set_(variable, made, position_of(made)))
        w.keep(begun)
        return name(variable, position_of(made))
    return made


def write_stmt(node: ast.Node, w: Writer, dest: str | None) -> None:
    """Write a node; its value goes to ``dest``."""
    if node.bound.apart and w.body.frame is not node.bound.frame:
        p = w.mark(node)
        w.finish(dest, call(make_thunk(node, w), [], p), p)
        return
    write = w.statements.get(node.__class__)
    if write is not None:
        write(node, w, dest)
        return
    made = make_expr(node, w)
    w.finish(dest, made, w.mark(node))


def write_body(node: ast.Node | None, w: Writer, dest: str | None, p: Pos) -> None:
    """A node that may be missing."""
    if node is None:
        w.finish_void(dest, p)
    else:
        write_stmt(node, w, dest)


# ---------------------------------------------------------------- values


def make_value(node: ast.Node, w: Writer, where: Span | None = None) -> py.expr:
    """The value of a node where void is an error, which points at the node or at ``where``."""
    return refuse_void(make_expr(node, w), node, w, node.span if where is None else where)


def refuse_void(made: py.expr, node: ast.Node, w: Writer, where: Span) -> py.expr:
    """An expression that was made of a node, with the check that its value is not void; the error points at
    ``where``."""
    if is_never_void(node, w):
        return made
    p = w.mark_span(where)
    is_value = is_(walrus("_v", made, p), name("VOID", p), p, negated=True)
    return choose(is_value, name("_v", p), call("no_void", [], p), p)


def is_never_void(node: ast.Node, w: Writer) -> bool:
    """Whether the value of a node is certainly not void."""
    if node.__class__ in NEVER_VOID:
        return True
    if not isinstance(node, ast.Call):
        return False
    if not w.generic and is_native(node):
        return True
    if node.args is not None:
        return False
    local = node.bound.local
    if local is not None:
        return not local.maybe_void
    return node.target is None and node.name in ("true", "false", "nil")


def make_operand(node: ast.Node, w: Writer) -> py.expr:
    """A value that is used at once and not stored: a literal need not be a new object."""
    if isinstance(node, ast.Float):
        return const(node.value, w.mark(node))
    return make_expr(node, w)


def split_sum(node: ast.Node, w: Writer, kinds: tuple[type[ast.Node], ...], make: Make) -> py.expr | None:
    """The variable that holds the left part of a very long sum, if the node is such a part; else None.

    A sum of hundreds of terms is computed in pieces, from the left, each put into a variable: neither we nor
    Python's compiler could walk it in one.  ``make`` makes the operations of these ``kinds``.
    """
    known = node.bound.piece
    if known is not None:
        return name(known, w.mark(node)) if known else None
    if not isinstance(left_of(node), kinds):
        return None
    parts = spine(node, w.pace, kinds)
    for part in parts:
        w.pace.step()
        w.binding.bound(part).piece = ""
    if len(parts) > MAX_OPERATIONS:
        for part in parts[-MAX_OPERATIONS:0:-MAX_OPERATIONS]:
            variable = w.fresh()
            w.emit(set_(variable, make(part, w), w.mark(part)))
            part.bound.piece = variable
    return None


def make_in_order(w: Writer, *makers: Maker) -> list[py.expr]:
    """Make expressions that are evaluated in order, whatever statements each of them writes."""
    made: list[py.expr] = []
    kept = 0
    out = w.body.out
    for maker in makers:
        mark = len(out)
        expression = maker()
        if made and len(out) > mark and not all(is_pure(statement) for statement in out[mark:]):
            spills: list[py.stmt] = []
            for i, earlier in enumerate(made[kept:], kept):
                if not isinstance(earlier, py.Constant):
                    variable = w.fresh()
                    p = position_of(earlier)
                    spills.append(set_(variable, earlier, p))
                    made[i] = name(variable, p)
            out[mark:mark] = spills
            kept = len(made)
        made.append(expression)
    return made


def make_list(w: Writer, nodes: Sequence[ast.Node], make: Make, p: Pos) -> py.List | py.Name:
    """A Python list of what ``make`` makes of each node, evaluated in order.

    It is put together from pieces in a variable if it is long, or if making one of its parts takes statements.
    """
    variable, begun = "", w.unkept()
    made: list[py.expr] = []
    out = w.body.out

    def more() -> py.stmt:
        nonlocal variable, made
        part, made = list_(made, p), []
        if variable:
            return py.AugAssign(py.Name(variable, STORE, **p), py.Add(), part, **p)
        variable = w.fresh()
        return set_(variable, part, p)

    for node in nodes:
        mark = len(out)
        expression = make(node, w)
        if made and len(out) > mark and not all(is_pure(statement) for statement in out[mark:]):
            out.insert(mark, more())
        made.append(expression)
        if len(made) == MAX_OPERATIONS or w.unkept() - begun > MAX_PARTS:
            w.emit(more())
            w.keep(begun)
    if not variable:
        return list_(made, p)
    if made:
        w.emit(more())
        w.keep(begun)
    return name(variable, p)


# ---------------------------------------------------------------- parts that are functions


def frame_of(node: ast.Node) -> FunctionFrame:
    """The frame of a node that is the body of a Python function."""
    frame = node.bound.frame
    assert frame is not None
    return frame


def make_thunk(node: ast.Node, w: Writer) -> py.expr:
    """A node as a Python function without parameters, run later or in another job."""
    frame = frame_of(node)
    p = w.mark(node)

    def write() -> None:
        write_tagged_scope(w, frame.scope_tag, lambda: write_stmt(node, w, RETURN), p)

    return w.nested(frame, [], write, p)


def make_thunks(w: Writer, args: tuple[ast.Node, ...], p: Pos) -> list[py.expr]:
    """Unevaluated arguments: a list of functions, and a list of their syntax."""
    return [make_list(w, args, make_thunk, p), w.nodes(args, p)]


def write_tagged_scope(w: Writer, tag: Local | None, write: Callable[[], None], p: Pos) -> None:
    """A block; if its scope tag is used, the tag is stopped when the block is left."""
    outer, w.body.close_scope = w.body.close_scope, None
    if tag is None:
        write()
    else:
        used = tag

        def close() -> py.stmt:
            return do(call(attr(w.read(used, p), "close", p), [], p), p)

        w.declare(used, call("scope_tag", [], p), p)
        w.body.close_scope = close
        w.emit(try_(w.block(write), [], [], [close()], p))
    w.body.close_scope = outer
