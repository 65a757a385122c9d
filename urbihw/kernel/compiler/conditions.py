"""Events, and the statements that wait for them or watch a condition."""

from __future__ import annotations

import ast as py
from functools import partial

from urbihw.kernel.compiler.emit import Pos, call, const, do, if_, is_, list_, name, set_, tuple_
from urbihw.kernel.compiler.expressions import make_pattern
from urbihw.kernel.compiler.operators import make_condition
from urbihw.kernel.compiler.places import write_bindings
from urbihw.kernel.compiler.visit import frame_of, make_in_order, make_thunk, make_value, write_stmt, write_tagged_scope
from urbihw.kernel.compiler.writer import Writer
from urbihw.kernel.syntax import ast


def make_emit(node: ast.Emit, w: Writer) -> py.expr:
    """``event!``, ``event!(args)``, ``event!(args) ~ duration``."""
    makers = [partial(make_value, part, w) for part in (node.event, *(node.args or ()))]
    if node.duration is not None:
        makers.append(partial(make_value, node.duration, w))
    made = make_in_order(w, *makers)
    count = len(node.args or ())
    p = w.mark(node, "emit")
    return call("emit", [made[0], list_(made[1 : 1 + count], p), *made[1 + count :]], p)


def make_duration(node: ast.Node | None, w: Writer, p: Pos) -> py.expr:
    """The ``~ duration`` of a condition, or None."""
    return const(None, p) if node is None else make_value(node, w)


def make_event_parts(cond: ast.EventCond, w: Writer) -> tuple[py.expr, py.expr, py.expr]:
    """The event, the function that accepts payloads, and the duration."""
    p = w.mark(cond)
    event, duration = make_in_order(w, lambda: make_value(cond.event, w), lambda: make_duration(cond.duration, w, p))
    frame = frame_of(cond)
    accept = w.nested(frame, ["_payload"], lambda: write_accept(cond, w, p), p)
    return event, accept, duration


def write_accept(cond: ast.EventCond, w: Writer, p: Pos) -> None:
    """The body of the function that takes a payload and gives the bound values, or None to refuse it."""
    bound: py.expr = tuple_([], p)
    if cond.patterns is not None:
        patterns = list_([make_pattern(pattern, w) for pattern in cond.patterns], p)
        w.emit(set_("_m", call("match_payload", [patterns, name("_payload", p)], p), p))
        w.emit(if_(is_(name("_m", p), const(None, p), p), [py.Return(const(None, p), **p)], [], p))
        for index, local in enumerate(frame_of(cond).params):
            w.declare(local, py.Subscript(name("_m", p), const(index, p), py.Load(), **p), p)
        bound = name("_m", p)
    if cond.guard is not None:
        refused = py.UnaryOp(py.Not(), make_condition(cond.guard, w), **p)
        w.emit(if_(refused, [py.Return(const(None, p), **p)], [], p))
    w.emit(py.Return(bound, **p))


def make_handler(node: ast.Node | None, w: Writer, p: Pos) -> py.expr:
    """The body of an ``at``: a function of the values bound by the pattern."""
    if node is None:
        return const(None, p)
    frame = frame_of(node)

    def write() -> None:
        for local in frame.params:
            w.box(local, p)
        write_tagged_scope(w, frame.scope_tag, lambda: write_stmt(node, w, None), p)

    return w.nested(frame, [local.python for local in frame.params], write, p)


def make_watched(cond: ast.Node, w: Writer) -> py.expr:
    """A condition as a function; one without branches is marked, because it reads the same places each time."""
    made = make_thunk(cond, w)
    return call("straight", [made], w.mark(cond)) if is_straight(cond, w) else made


def is_straight(cond: ast.Node, w: Writer) -> bool:
    """Whether a condition consists of literals, names and calls; which calls run functions is seen when it runs."""
    todo = [cond]
    while todo:
        w.pace.step()
        node = todo.pop()
        if isinstance(node, ast.Call):
            todo += [part for part in (node.target, *(node.args or ())) if part is not None]
        elif not isinstance(node, ast.Float | ast.StringLiteral | ast.This):
            return False
    return True


def write_at(node: ast.At, w: Writer, dest: str | None) -> None:
    """``at (cond) body onleave leave``, ``at sync (cond) ...``."""
    write_watch(w, "at_sync" if node.sync else "at", node, node.leave, dest)


def write_whenever(node: ast.Whenever, w: Writer, dest: str | None) -> None:
    """``whenever (cond) body else otherwise``."""
    write_watch(w, "whenever", node, node.otherwise, dest)


def write_watch(w: Writer, verb: str, node: ast.At | ast.Whenever, other: ast.Node | None, dest: str | None) -> None:
    """``at`` and ``whenever``; ``other`` is the second body, ``verb`` the beginning of the operation's name."""
    p = w.mark(node)
    cond = node.cond
    if isinstance(cond, ast.EventCond):
        parts = list(make_event_parts(cond, w))
        kind = verb + "_event"
    else:
        parts = [make_watched(cond.expr, w), make_duration(cond.duration, w, p)]
        kind = verb + "_expr"
    parts += [make_handler(node.body, w, p), make_handler(other, w, p)]
    w.emit(do(call(kind, parts, p), p))
    w.finish_void(dest, p)


def write_wait_until(node: ast.WaitUntil, w: Writer, dest: str | None) -> None:
    """``waituntil (cond)``."""
    p = w.mark(node)
    if isinstance(node.cond, ast.ExprCond):
        condition = make_watched(node.cond.expr, w)
        w.emit(do(call("wait_expr", [condition, make_duration(node.cond.duration, w, p)], p), p))
    else:
        event, accept, _ = make_event_parts(node.cond, w)
        bound = w.fresh()
        w.emit(set_(bound, call("wait_event", [event, accept], p), p))
        write_bindings(node, w, ast.ListLit(node.cond.patterns or ()), bound)
    w.finish_void(dest, p)
