"""Statements that involve several jobs and tags."""

from __future__ import annotations

import ast as py

from urbihw.kernel.compiler.conditions import make_event_parts, make_watched
from urbihw.kernel.compiler.control import write_closing_scope, write_group, write_yield
from urbihw.kernel.compiler.emit import Pos, attr, call, const, do, except_, if_, name, raise_, set_, try_
from urbihw.kernel.compiler.visit import frame_of, make_thunk, make_value, write_stmt
from urbihw.kernel.compiler.writer import RETURN, Writer
from urbihw.kernel.syntax import ast


def write_seq(node: ast.Seq, w: Writer, dest: str | None) -> None:
    """Statements joined by ``;`` and ``,``: (statement, separator that follows it, or "" at the end)."""
    if any(separator == "," for _, separator in node.items):
        p = w.mark(node)
        write_group(w, lambda group: write_closing_scope(w, lambda: write_sequence(node, w, dest, group), p), p)
    else:
        write_sequence(node, w, dest, "")


def write_sequence(node: ast.Seq, w: Writer, dest: str | None, group: str) -> None:
    """``a; b, c``: the value is that of the last statement that is not in the background."""
    last = max((i for i, (_, separator) in enumerate(node.items) if separator != ","), default=-1)
    p = w.mark(node)
    kept = dest
    if dest == RETURN and last < len(node.items) - 1:
        kept = w.fresh()
    if last < 0:
        w.finish_void(kept if kept != RETURN else None, p)
    for index, (item, separator) in enumerate(node.items):
        if separator == ",":
            w.emit(do(call(attr(name(group, p), "start", p), [make_background(item, w)], p), p))
        else:
            write_stmt(item, w, kept if index == last else None)
            if index < len(node.items) - 1 and not (kept == RETURN and index == last):
                write_yield(w, w.mark(item))
    if kept != dest:
        assert kept is not None
        w.emit(py.Return(name(kept, p), **p))


def make_background(item: ast.Node, w: Writer) -> py.expr:
    """A statement as the body of a job; a ``var`` there belongs to the scope around it."""
    local = item.bound.local
    if isinstance(item, ast.Var) and local is not None:
        p = w.mark(item)
        w.declare(local, name("VOID", p), p)
        if item.value is None:
            return name("nothing", p)
        value = item.value
        frame = frame_of(value)
        return w.nested(frame, [], lambda: w.write(local, make_value(value, w), p), p)
    return make_thunk(item, w)


def write_par(node: ast.Par, w: Writer, dest: str | None) -> None:
    """``a & b & c``: all at once."""
    p = w.mark(node)

    def write(group: str) -> None:
        for item in node.items:
            w.emit(do(call(attr(name(group, p), "launch", p), [make_background(item, w)], p), p))

    write_group(w, write, p)
    w.finish_void(dest, p)


def write_tagged(node: ast.Tagged, w: Writer, dest: str | None) -> None:
    """``tag: body``."""
    p = w.mark(node)
    tag = node.tag
    if isinstance(tag, ast.Call) and tag.args is None and tag.bound.local is None:
        write_tag_scope(w, call("tag_named", make_named_tag(tag, w, node, p), p), node.body, dest, p)
    else:
        write_tag_scope(w, call("tag_open", [make_value(tag, w)], p), node.body, dest, p)


def make_named_tag(tag: ast.Call, w: Writer, node: ast.Node, p: Pos) -> list[py.expr]:
    """A tag given by name, which is made if it does not exist: what holds it, and its names."""
    names: list[str] = []
    at: ast.Node | None = tag
    while isinstance(at, ast.Call) and at.args is None and at.bound.local is None:
        names.insert(0, at.name)
        at = at.target
    holder = w.this(node, p) if at is None else make_value(at, w)
    return [holder, const(at is None, p), const(tuple(names), p)]


def write_tag_scope(w: Writer, opened: py.expr, body: ast.Node, dest: str | None, p: Pos) -> None:
    """Code that a tag can make its job leave."""
    text = w.fresh("_w")
    w.emit(set_(text, opened, p))

    def verb(field: str, *args: py.expr) -> py.expr:
        return call(attr(name(text, p), field, p), list(args), p)

    inside = [do(verb("enter"), p), *w.block(lambda: write_stmt(body, w, dest))]
    foreign = py.UnaryOp(py.Not(), verb("owns", name("_s", p)), **p)
    left: list[py.stmt] = [if_(foreign, [raise_(None, p)], [], p)]
    left += w.block(lambda: w.finish(dest, attr(name("_s", p), "value", p), p))
    w.emit(try_(inside, [except_("StopTag", "_s", left, p)], [], [do(verb("exit"), p)], p))


def write_guarded(node: ast.Guarded, w: Writer, dest: str | None) -> None:
    """``timeout (duration) body``, ``stopif (cond) body``, ``freezeif (cond) body``."""
    p = w.mark(node)
    cond = node.cond.expr if isinstance(node.cond, ast.ExprCond) else node.cond
    if node.kind == "timeout":
        opened = call("timeout", [make_value(cond, w)], p)
    elif isinstance(cond, ast.EventCond):
        event, accept, _ = make_event_parts(cond, w)
        opened = call("event_guard", [const(node.kind, p), event, accept], p)
    else:
        opened = call("guard", [const(node.kind, p), make_watched(cond, w)], p)
    write_tag_scope(w, opened, node.body, dest, p)
