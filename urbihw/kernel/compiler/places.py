"""Declarations and assignments: what puts values into variables, slots, elements and properties.

``stmt(node, dest)`` writes a node so that its value goes to ``dest``: nowhere (None), out of the function (RETURN), or
into a Python variable; methods ``s_Node(node, dest)`` do it.
"""

from __future__ import annotations

import ast as py
from typing import Any

from urbihw.kernel.compiler.emit import (
    LOAD,
    STORE,
    Pos,
    call,
    const,
    do,
    if_,
    is_,
    list_,
    name,
    set_,
    walrus,
)
from urbihw.kernel.compiler.expressions import INPLACE, Expressions
from urbihw.kernel.compiler.scopes import Local, binding_names
from urbihw.kernel.syntax import ast


class Places(Expressions):
    """The statements that write to places."""

    def stmt(self, node: ast.Node, dest: str | None) -> None:
        """Write a node; its value goes to ``dest``."""
        if id(node) in self.binding.apart and self.w.frame is not self.binding.frames[id(node)]:
            p = self.mark(node)
            self.finish(dest, call(self.thunk(node), [], p), p)
            return
        method = getattr(self, "s_" + type(node).__name__, None)
        if method is not None:
            method(node, dest)
            return
        made = self.expr(node)
        self.finish(dest, made, self.mark(node))

    def void(self, dest: str | None, p: Pos) -> None:
        """The statement has no value."""
        if dest is not None:
            self.finish(dest, name("VOID", p), p)

    def body(self, node: ast.Node | None, dest: str | None, p: Pos) -> None:
        """A node that may be missing."""
        if node is None:
            self.void(dest, p)
        else:
            self.stmt(node, dest)

    # ---------------------------------------------------------------- declarations and assignments

    def s_Var(self, node: ast.Var, dest: str | None) -> None:
        local = self.binding.locals.get(id(node))
        if local is not None:
            p = self.mark(node)
            first = name("VOID", p) if node.value is None else self.value(node.value, node.span)
            self.declare(local, first, p)
            if dest is not None:
                self.finish(dest, self.read(local, p), p)
            return
        target = node.target
        holder = (lambda: self.this(node, self.mark(node))) if target is None else (lambda: self.expr(target))
        makers = [holder]
        if node.value is not None:
            value = node.value
            makers.append(lambda: self.value(value, node.place))
        made = self.sequence(makers)
        p = self.mark_span(node.place, "createSlot" if node.value is None else "setSlot")
        made.insert(1, const(node.name, p))
        if node.value is None:
            made.append(name("VOID", p))
        self.finish(dest, call("declare_const" if node.const else "declare", made, p), p)

    def s_Assign(self, node: ast.Assign, dest: str | None) -> None:
        if node.modifiers:
            self.trajectory(node, dest)
        elif isinstance(node.place, ast.Property):
            self.assign_property(node.place, node, dest)
        elif isinstance(node.place, ast.Call):
            self.assign_place(node.place, node, dest)
        else:
            self.assign_pattern(node, dest)

    def assign_place(self, place: ast.Call, node: ast.Assign, dest: str | None) -> None:
        """``x = value`` and ``o.x = value``."""
        local = self.binding.locals.get(id(place))
        if local is not None:
            value = self.value(node.value)
            p = self.mark(node)
            self.constant_guard(local, p)
            self.write(local, value, p)
            if dest is not None:
                self.finish(dest, self.read(local, p), p)
            return
        made = self.sequence([self.slot_holder(place, place), lambda: self.value(node.value)])
        p = self.mark(place, "updateSlot")
        made.insert(1, const(place.name, p))
        self.finish(dest, call("update", made, p), p)

    def constant_guard(self, local: Local, p: Pos) -> None:
        """Assigning a ``const`` local is an error when it happens."""
        if local.const:
            self.emit(do(call("constant", [], p), p))

    def assign_property(self, place: ast.Property, node: ast.Assign, dest: str | None) -> None:
        """``o.x->p = value``."""
        made = self.sequence([self.slot_holder(place.slot, place), lambda: self.value(node.value)])
        p = self.mark(node, "setProperty")
        args = [made[0], const(place.slot.name, p), const(place.name, p), made[1]]
        self.finish(dest, call("set_property", args, p), p)

    def assign_pattern(self, node: ast.Assign, dest: str | None) -> None:
        """``[var a, 2] = value``: the bindings are declared here."""
        p = self.mark(node)
        value, bound = self.fresh(), self.fresh()
        self.emit(set_(value, self.value(node.value), p))
        self.emit(set_(bound, call("match", [self.pattern(node.place), name(value, p)], p), p))
        self.emit(if_(is_(name(bound, p), const(None, p), p), [do(call("no_match", [], p), p)], [], p))
        self.bind_pattern(node.place, node.place, bound)
        self.finish(dest, name(value, p), p)

    def bind_pattern(self, key: ast.Node, patterns: ast.Node, bound: str) -> None:
        """Put matched values into the locals (or slots of this) that a pattern declares."""
        p = self.mark(key)
        names = binding_names((patterns,))
        for index, (text, local) in enumerate(zip(names, self.binding.patterns[id(key)], strict=True)):
            value = py.Subscript(name(bound, p), const(index, p), LOAD, **p)
            if local is None:
                self.emit(do(call("declare", [self.this(key, p), const(text, p), value], p), p))
            else:
                self.declare(local, value, p)

    def s_OpAssign(self, node: ast.OpAssign, dest: str | None) -> None:
        place = node.place
        local = self.binding.locals.get(id(place))
        if local is not None:
            p = self.mark(node, node.op)
            self.constant_guard(local, p)
            if node.op == "+=" and isinstance(node.value, ast.String) and not self.generic:
                joined = call("join_in_place", [self.read(local, p), const(node.value.value, p)], p)
                self.write(local, joined, p)
                self.finish(dest, self.read(local, p), p)
                return
            value = self.value(node.value)
            p = self.mark(node, node.op)
            if node.op in INPLACE and not self.generic and not local.late:
                where: Any = py.Name(local.python, STORE, **p)
                if local.boxed:
                    where = py.Attribute(name(local.python, p), "v", STORE, **p)
                self.emit(py.AugAssign(where, INPLACE[node.op](), value, **p))
            else:
                self.write(local, call("in_place", [self.read(local, p), const(node.op, p), value], p), p)
            if dest is not None:
                self.finish(dest, self.read(local, p), p)
            return

        def change(old: py.expr, p: Pos) -> py.expr:
            return call("in_place", [old, const(node.op, p), self.value(node.value)], p)

        self.change_place(place, node, change, dest)

    def s_Postfix(self, node: ast.Postfix, dest: str | None) -> None:
        kept = self.fresh() if dest is not None else None

        def change(old: py.expr, p: Pos) -> py.expr:
            return call("step", [walrus(kept, old, p) if kept is not None else old, const(node.op, p)], p)

        local = self.binding.locals.get(id(node.place))
        p = self.mark(node, node.op)
        if local is not None:
            self.constant_guard(local, p)
            self.write(local, change(self.read(local, p), p), p)
        else:
            self.change_place(node.place, node, change, None)
        if kept is not None:
            self.finish(dest, name(kept, p), p)

    def change_place(self, place: ast.Node, node: ast.Node, change: Any, dest: str | None) -> None:
        """Read a slot, an element or a property, compute from it, and write it back; the holder is evaluated once."""
        p = self.mark(node, "updateSlot")
        held = self.fresh("_o")
        if isinstance(place, ast.Property):
            self.emit(set_(held, self.slot_holder(place.slot, place)(), p))
            key: list[py.expr] = [const(place.slot.name, p), const(place.name, p)]
            verbs = ("get_property", "set_property")
        elif isinstance(place, ast.Call) and place.name == "[]" and place.args is not None:
            parts = [place.target, *place.args]
            made = self.sequence([lambda part=part: self.value(part) for part in parts])  # type: ignore[misc]
            self.emit(set_(held, made[0], p))
            index = self.fresh("_i")
            self.emit(set_(index, list_(made[1:], p), p))
            key = [name(index, p)]
            verbs = ("get_item", "set_item")
        else:
            assert isinstance(place, ast.Call)
            self.emit(set_(held, self.slot_holder(place, place)(), p))
            key = [const(place.name, p)]
            verbs = ("send0", "update")
        old = call(verbs[0], [name(held, p), *key], self.mark(node))
        self.finish(dest, call(verbs[1], [name(held, p), *key, change(old, p)], p), p)

    def trajectory(self, node: ast.Assign, dest: str | None) -> None:
        """``place = target time: 1s``."""
        place = node.place
        assert isinstance(place, ast.Call)
        local = self.binding.locals.get(id(place))
        values = [node.value, *(value for _, value in node.modifiers)]
        holder = self.slot_holder(place, place) if local is None else (lambda: const(None, self.mark(node)))
        made = self.sequence([holder, *((lambda v=v: self.value(v)) for v in values)])
        p = self.mark(node, "updateSlot")
        keys: list[py.expr | None] = [const(text, p) for text, _ in node.modifiers]
        attributes = py.Dict(keys, made[2:], **p)
        if local is not None:
            self.emit(do(call("move_local", [name(local.python, p), made[1], attributes], p), p))
        else:
            self.emit(do(call("move_slot", [made[0], const(place.name, p), made[1], attributes], p), p))
        self.void(dest, p)
