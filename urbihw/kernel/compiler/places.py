"""Declarations and assignments of variables, slots, elements and properties."""

from __future__ import annotations

import ast as py
from collections.abc import Callable
from functools import partial

from urbihw.kernel.compiler.emit import LOAD, STORE, Pos, call, const, do, if_, is_, list_, name, set_, walrus
from urbihw.kernel.compiler.expressions import make_pattern, slot_holder
from urbihw.kernel.compiler.operations import INPLACE
from urbihw.kernel.compiler.scopes import binding_names
from urbihw.kernel.compiler.visit import make_expr, make_in_order, make_value
from urbihw.kernel.compiler.writer import Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import Local


def write_var(node: ast.Var, w: Writer, dest: str | None) -> None:
    """``var name``, ``var target.name``."""
    local = node.bound.local
    if local is not None:
        p = w.mark(node)
        first = name("VOID", p) if node.value is None else make_value(node.value, w, node.span)
        w.declare(local, first, p)
        if dest is not None:
            w.finish(dest, w.read(local, p), p)
        return
    target = node.target
    holder = (lambda: w.this(node, w.mark(node))) if target is None else (lambda: make_expr(target, w))
    makers = [holder]
    if node.value is not None:
        value = node.value
        makers.append(lambda: make_value(value, w, node.place))
    made = make_in_order(w, *makers)
    p = w.mark_span(node.place, "createSlot" if node.value is None else "setSlot")
    made.insert(1, const(node.name, p))
    if node.value is None:
        made.append(name("VOID", p))
    w.finish(dest, call("declare_const" if node.const else "declare", made, p), p)


def write_assign(node: ast.Assign, w: Writer, dest: str | None) -> None:
    """``place = value modifiers``."""
    if node.modifiers:
        write_trajectory(node, w, dest)
    elif isinstance(node.place, ast.Property):
        write_assign_property(node.place, w, node, dest)
    elif isinstance(node.place, ast.Call) and node.place.args is None:
        write_assign_place(node.place, w, node, dest)
    else:
        write_assign_pattern(node, w, dest)


def write_assign_place(place: ast.Call, w: Writer, node: ast.Assign, dest: str | None) -> None:
    """``x = value`` and ``o.x = value``."""
    local = place.bound.local
    if local is not None:
        value = make_value(node.value, w)
        p = w.mark(node)
        write_constant_guard(w, local, p)
        w.write(local, value, p)
        if dest is not None:
            w.finish(dest, w.read(local, p), p)
        return
    made = make_in_order(w, slot_holder(place, w, place), lambda: make_value(node.value, w))
    p = w.mark(place, "updateSlot")
    made.insert(1, const(place.name, p))
    w.finish(dest, call("update", made, p), p)


def write_constant_guard(w: Writer, local: Local, p: Pos) -> None:
    """Assigning a ``const`` local is an error when it happens."""
    if local.const:
        w.emit(do(call("constant", [], p), p))


def write_assign_property(place: ast.Property, w: Writer, node: ast.Assign, dest: str | None) -> None:
    """``o.x->p = value``."""
    made = make_in_order(w, slot_holder(place.slot, w, place), lambda: make_value(node.value, w))
    p = w.mark(node, "setProperty")
    args = [made[0], const(place.slot.name, p), const(place.name, p), made[1]]
    w.finish(dest, call("set_property", args, p), p)


def write_assign_pattern(node: ast.Assign, w: Writer, dest: str | None) -> None:
    """``[var a, 2] = value``: the bindings are declared here."""
    p = w.mark(node)
    value, bound = w.fresh(), w.fresh()
    w.emit(set_(value, make_value(node.value, w), p))
    w.emit(set_(bound, call("match", [make_pattern(node.place, w), name(value, p)], p), p))
    w.emit(if_(is_(name(bound, p), const(None, p), p), [do(call("no_match", [], p), p)], [], p))
    write_bindings(node.place, w, node.place, bound)
    w.finish(dest, name(value, p), p)


def write_bindings(key: ast.Node, w: Writer, patterns: ast.Node, bound: str) -> None:
    """Put matched values into the locals (or slots of this) that a pattern declares."""
    p = w.mark(key)
    names = binding_names((patterns,))
    for index, (text, local) in enumerate(zip(names, key.bound.names, strict=True)):
        value = py.Subscript(name(bound, p), const(index, p), LOAD, **p)
        if local is None:
            w.emit(do(call("declare", [w.this(key, p), const(text, p), value], p), p))
        else:
            w.declare(local, value, p)


def write_op_assign(node: ast.OpAssign, w: Writer, dest: str | None) -> None:
    """``place op value`` where op is ``+=`` and so on."""
    place = node.place
    local = place.bound.local
    if local is not None:
        p = w.mark(node, node.op)
        write_constant_guard(w, local, p)
        if node.op == "+=" and isinstance(node.value, ast.StringLiteral) and not w.generic:
            joined = call("join_in_place", [w.read(local, p), const(node.value.value, p)], p)
            w.write(local, joined, p)
            w.finish(dest, w.read(local, p), p)
            return
        before = w.read(local, p)
        old, value = make_in_order(w, lambda: before, lambda: make_value(node.value, w))
        p = w.mark(node, node.op)
        if old is before and node.op in INPLACE and not w.generic and not local.late:
            where: py.Name | py.Attribute = py.Name(local.python, STORE, **p)
            if local.boxed:
                where = py.Attribute(name(local.python, p), "v", STORE, **p)
            w.emit(py.AugAssign(where, INPLACE[node.op](), value, **p))
        else:
            w.write(local, call("in_place", [old, const(node.op, p), value], p), p)
        if dest is not None:
            w.finish(dest, w.read(local, p), p)
        return

    def change(old: py.expr, p: Pos) -> py.expr:
        before, value = make_in_order(w, lambda: old, lambda: make_value(node.value, w))
        return call("in_place", [before, const(node.op, p), value], p)

    write_change(place, w, node, change, dest)


def write_postfix(node: ast.Postfix, w: Writer, dest: str | None) -> None:
    """``place++`` or ``place--``."""
    kept = w.fresh() if dest is not None else None

    def change(old: py.expr, p: Pos) -> py.expr:
        return call("step", [walrus(kept, old, p) if kept is not None else old, const(node.op, p)], p)

    local = node.place.bound.local
    p = w.mark(node, node.op)
    if local is not None:
        write_constant_guard(w, local, p)
        w.write(local, change(w.read(local, p), p), p)
    else:
        write_change(node.place, w, node, change, None)
    if kept is not None:
        w.finish(dest, name(kept, p), p)


def write_change(
    place: ast.Node, w: Writer, node: ast.OpAssign | ast.Postfix, change: Callable[[py.expr, Pos], py.expr],
    dest: str | None,
) -> None:
    """Read a slot, an element or a property, compute from it, and write it back; the holder is evaluated once."""
    p = w.mark(node, node.op)
    held = w.fresh("_o")
    if isinstance(place, ast.Property):
        w.emit(set_(held, slot_holder(place.slot, w, place)(), p))
        key: list[py.expr] = [const(place.slot.name, p), const(place.name, p)]
        verbs, read, write = ("get_property", "set_property"), "getProperty", "setProperty"
    elif isinstance(place, ast.Call) and place.name == "[]" and place.args is not None:
        assert place.target is not None
        parts = [place.target, *place.args]
        made = make_in_order(w, *(partial(make_value, part, w) for part in parts))
        w.emit(set_(held, made[0], p))
        index = w.fresh("_i")
        w.emit(set_(index, list_(made[1:], p), p))
        key = [name(index, p)]
        verbs, read, write = ("get_item", "set_item"), "[]", "[]="
    else:
        assert isinstance(place, ast.Call)
        w.emit(set_(held, slot_holder(place, w, place)(), p))
        key = [const(place.name, p)]
        verbs, read, write = ("send0", "update"), place.name, "updateSlot"
    old = call(verbs[0], [name(held, p), *key], w.mark(node, read))
    changed = change(old, p)
    p = w.mark(node, write)
    w.finish(dest, call(verbs[1], [name(held, p), *key, changed], p), p)


def write_trajectory(node: ast.Assign, w: Writer, dest: str | None) -> None:
    """``place = target time: 1s``."""
    place = node.place
    assert isinstance(place, ast.Call)
    local = place.bound.local
    values = [node.value, *(value for _, value in node.modifiers)]
    holder = slot_holder(place, w, place) if local is None else (lambda: const(None, w.mark(node)))
    made = make_in_order(w, holder, *(partial(make_value, each, w) for each in values))
    p = w.mark(node, "updateSlot")
    keys: list[py.expr | None] = [const(text, p) for text, _ in node.modifiers]
    attributes = py.Dict(keys, made[2:], **p)
    if local is not None:
        w.emit(do(call("move_local", [name(local.python, p), made[1], attributes], p), p))
    else:
        w.emit(do(call("move_slot", [made[0], const(place.name, p), made[1], attributes], p), p))
    w.finish_void(dest, p)
