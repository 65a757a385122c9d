"""Statements: declarations, assignments, functions, blocks, and sequential flow control.

``stmt(node, dest)`` writes a node so that its value goes to ``dest``: nowhere (None), out of the function (RETURN), or
into a Python variable.
"""

from __future__ import annotations

import ast as py
import dataclasses
from typing import Any

from urbihw.kernel.compiler.bind import Local, binding_names
from urbihw.kernel.compiler.emit import (
    LOAD,
    RETURN,
    STORE,
    Loop,
    Pos,
    attr,
    call,
    const,
    do,
    except_,
    if_,
    is_,
    is_pure,
    list_,
    name,
    raise_,
    set_,
    try_,
    walrus,
)
from urbihw.kernel.compiler.expressions import COMPARISONS, EQUALITY, INPLACE, Expressions, Maker
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.printer import print_node

COMPARED = (*COMPARISONS, *EQUALITY, "===", "!==", "~=", "=~=")


class Statements(Expressions):
    """Methods ``s_Node(node, dest)`` write a node whose value may be wanted."""

    def stmt(self, node: ast.Node, dest: str | None) -> None:
        """Write a node; its value goes to ``dest``."""
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

    # ---------------------------------------------------------------- functions and objects

    def x_Function(self, node: ast.Function) -> py.expr:
        """A function literal: a nested Python function wrapped into a Code."""
        frame = self.binding.frames[id(node)]
        formals = self.binding.formals[id(node)]
        info = self.info(node, frame.uses_call)
        p = self.mark(node)
        own_this = self.this_of(node)
        params = [own_this if own_this is not None else "_this"]
        if info.lazy or info.uses_call:
            params.append(self.call_name(node))
        params += [local.python for local in formals]
        defaults = sum(1 for formal in node.formals or () if formal.default is not None)
        made = self.nested(frame, params, lambda: self.function_body(node, p), p, defaults)
        return call("function", [made, self.constant(info, p)], p)

    def this_of(self, node: ast.Function) -> str | None:
        """The Python name of a function's own ``this``; None for a closure, which has that of its maker."""
        local = self.binding.own_this.get(id(node))
        return None if local is None else local.python

    def call_name(self, node: ast.Function) -> str:
        """The Python name of a function's call message."""
        return self.binding.own_call[id(node)].python

    def function_body(self, node: ast.Function, p: Pos) -> None:
        """Defaults, boxes, the body, and what catches a return from another job."""
        if node.closure:  # a closure captures its target even if it does not use it: it is part of its identity
            self.emit(do(self.this(node, p), p))
        for formal, local in zip(node.formals or (), self.binding.formals[id(node)], strict=True):
            if formal.default is not None:
                default = formal.default
                inside = self.block(lambda d=default, x=local: self.emit(
                    set_(x.python, self.value(d), self.mark(d))))
                self.emit(if_(is_(name(local.python, p), name("MISSING", p), p), inside, [], p))
            if local.boxed:
                self.emit(set_(local.python, call("Box", [name(local.python, p)], p), p))
        self.w.return_token = self.fresh("_r")
        outer_entry, self.outer_entry = self.outer_entry, 0
        body = self.block(lambda: self.stmt(node.body, RETURN))
        self.outer_entry = outer_entry
        if not self.w.crossed_return:
            self.emit(*body)
            return
        token = self.w.return_token
        self.emit(set_(token, call("token", [], p), p))
        leave = [
            if_(self.not_mine(token, p), [raise_(None, p)], [], p),
            py.Return(attr(name("_l", p), "value", p), **p),
        ]
        self.emit(try_(body, [except_("Leave", "_l", leave, p)], [], [], p))

    def not_mine(self, token: str, p: Pos) -> py.expr:
        """Whether a Leave on its way up is for somebody else."""
        return is_(attr(name("_l", p), "token", p), name(token, p), p, negated=True)

    def thunk(self, node: ast.Node) -> py.expr:
        """A node as a Python function without parameters, run later or in another job."""
        frame = self.binding.frames[id(node)]
        p = self.mark(node)
        return self.nested(frame, [], lambda: self.scope_tagged(node, lambda: self.stmt(node, RETURN), p), p)

    def s_Do(self, node: ast.Do, dest: str | None) -> None:
        p = self.mark(node)
        this = self.binding.this[id(node.body)]
        self.declare(this, self.value(node.target), p)
        self.body(node.body.body, None, p)
        self.finish(dest, self.read(this, p), p)

    def s_Class(self, node: ast.Class, dest: str | None) -> None:
        p = self.mark(node)
        local = self.binding.locals.get(id(node))
        this = self.binding.this[id(node.body)]
        target = node.target
        makers: list[Maker] = [lambda proto=proto: self.value(proto) for proto in node.protos]  # type: ignore[misc]
        if target is not None:
            makers.append(lambda: self.value(target))
        made = self.sequence(makers)
        protos = made[: len(node.protos)]
        self.declare(this, call("new_class", [const(node.name, p), list_(protos, p)], p), p)
        if local is not None:
            self.declare(local, self.read(this, p), p)
        else:
            holder = made[-1] if target is not None else self.this(node, p)
            where = self.mark(node, "setSlot")
            self.emit(do(call("declare", [holder, const(node.name, p), self.read(this, p)], where), p))
        self.body(node.body.body, None, p)
        self.finish(dest, self.read(this, p), p)

    # ---------------------------------------------------------------- blocks

    def s_Empty(self, node: ast.Empty, dest: str | None) -> None:
        self.void(dest, self.mark(node))

    def s_Scope(self, node: ast.Scope, dest: str | None) -> None:
        p = self.mark(node)
        self.scope_tagged(node, lambda: self.body(node.body, dest, p), p)

    def scope_tagged(self, node: ast.Node, write: Any, p: Pos) -> None:
        """A block; if its scope tag is used, the tag is stopped when the block is left."""
        local = self.binding.scope_tags.get(id(node))
        outer, self.w.close_scope = self.w.close_scope, None
        if local is None:
            write()
        else:
            tag = local

            def close() -> py.stmt:
                return do(call(attr(self.read(tag, p), "close", p), [], p), p)

            self.declare(tag, call("scope_tag", [], p), p)
            self.w.close_scope = close
            self.emit(try_(self.block(write), [], [], [close()], p))
        self.w.close_scope = outer

    def s_Pipe(self, node: ast.Pipe, dest: str | None) -> None:
        for item in node.items[:-1]:
            self.stmt(item, None)
        self.stmt(node.items[-1], dest)

    def yield_(self, p: Pos) -> None:
        """Let other jobs run, if any is ready."""
        self.emit(if_(name("ready", p), [do(call("yield_", [], p), p)], [], p))

    # ---------------------------------------------------------------- choices

    def s_If(self, node: ast.If, dest: str | None) -> None:
        p = self.mark(node)
        if isinstance(node.cond, ast.Seq | ast.Pipe | ast.Var):
            variable = self.fresh()
            self.stmt(node.cond, variable)
            test: py.expr = name(variable, p)
        else:
            test = self.condition(node.cond)
        then = self.block(lambda: self.stmt(node.then, dest))
        otherwise = self.block(lambda: self.body(node.otherwise, dest, p))
        self.emit(if_(test, then, otherwise, self.mark(node.cond)))

    def s_Switch(self, node: ast.Switch, dest: str | None) -> None:
        p = self.mark(node)
        subject = self.fresh()
        self.emit(set_(subject, self.value(node.value), p))
        self.cases(list(node.cases), subject, dest, p)

    def cases(self, cases: list[ast.Case], subject: str, dest: str | None, p: Pos) -> None:
        """The first case, and the others in its else."""
        if not cases:
            self.void(dest, p)
            return
        case, rest = cases[0], cases[1:]
        if case.pattern is None:
            self.body(case.body, dest, p)
            return
        hit = self.fresh()
        self.emit(set_(hit, const(False, p), p))
        self.matched(case.pattern, case.guard, name(subject, p), hit, p)
        then = self.block(lambda: self.body(case.body, dest, p))
        otherwise = self.block(lambda: self.cases(rest, subject, dest, p))
        self.emit(if_(name(hit, p), then, otherwise, p))

    def matched(self, pattern: ast.Node, guard: ast.Node | None, subject: py.expr, hit: str, p: Pos) -> None:
        """Set ``hit`` if the subject matches and the guard holds; the bindings are declared then."""
        bound = self.fresh()
        self.emit(set_(bound, call("match", [self.pattern(pattern), subject], p), p))

        def inside() -> None:
            self.bind_pattern(pattern, pattern, bound)
            test = const(True, p) if guard is None else call("truth", [self.condition(guard)], p)
            self.emit(set_(hit, test, p))

        self.emit(if_(is_(name(bound, p), const(None, p), p, negated=True), self.block(inside), [], p))

    # ---------------------------------------------------------------- loops

    def loop(self, write: Any, p: Pos) -> None:
        """Write a loop by ``write(loop)``, and around it what catches a break from another job."""
        self.counter += 1
        loop = Loop(self.w, self.counter)
        self.w.loops.append(loop)
        body = self.block(lambda: write(loop))
        self.w.loops.pop()
        if not loop.crossed_break:
            self.emit(*body)
            return
        self.emit(set_(loop.break_token, call("token", [], p), p))
        handler = [if_(self.not_mine(loop.break_token, p), [raise_(None, p)], [], p)]
        self.emit(try_(body, [except_("Leave", "_l", handler, p)], [], [], p))

    def turn(self, loop: Loop, body: ast.Node, after: Any, p: Pos) -> list[py.stmt]:
        """One turn of a loop: the body, then ``after()``, which ``continue`` must not skip."""
        inside = self.block(lambda: self.stmt(body, None))
        if loop.crossed_continue:
            handler = [if_(self.not_mine(loop.continue_token, p), [raise_(None, p)], [], p)]
            inside = [
                set_(loop.continue_token, call("token", [], p), p),
                try_(inside, [except_("Leave", "_l", handler, p)], [], [], p),
            ]
        rest = self.block(after)
        if not rest or not _continues(body):
            return inside + rest
        inside = inside or [py.Pass(**p)]
        once = py.For(py.Name("_once", STORE, **p), name("ONCE", p), inside, [*rest, py.Continue(**p)], None, **p)
        return [once, py.Break(**p)]

    def s_While(self, node: ast.While, dest: str | None) -> None:
        p = self.mark(node)
        if node.flavor == ",":
            self.parallel_loop(None, node.cond, node.body, None, p)
        else:
            self.loop(lambda loop: self.while_(loop, node.cond, node.body, None, node.flavor, p), p)
        self.void(dest, p)

    def while_(
        self, loop: Loop, cond: ast.Node | None, body: ast.Node, step: ast.Node | None, flavor: str, p: Pos
    ) -> None:
        """``while flavor (cond) body``, with the step of a C-like for."""

        def after() -> None:
            if step is not None:
                self.stmt(step, None)
            if flavor == ";":
                self.yield_(p)

        tests: list[py.expr] = []
        before = self.block(lambda: tests.append(const(True, p) if cond is None else self.condition(cond)))
        turn = self.turn(loop, body, after, p)
        if before and not all(is_pure(statement) for statement in before):
            stop = if_(py.UnaryOp(py.Not(), tests[0], **p), [py.Break(**p)], [], p)
            self.emit(py.While(const(True, p), [*before, stop, *turn], [], **p))
        else:
            self.emit(*before)
            self.emit(py.While(tests[0], turn or [py.Pass(**p)], [], **p))

    def s_For(self, node: ast.For, dest: str | None) -> None:
        p = self.mark(node)
        self.stmt(node.init, None)
        if node.flavor == ",":
            self.parallel_loop(None, node.cond, node.body, node.step, p)
        else:
            cond = None if isinstance(node.cond, ast.Empty) else node.cond
            self.loop(lambda loop: self.while_(loop, cond, node.body, node.step, node.flavor, p), p)
        self.void(dest, p)

    def parallel_loop(
        self, items: Any, cond: ast.Node | None, body: ast.Node, step: ast.Node | None, p: Pos
    ) -> None:
        """``while,`` and ``for,`` (see ``Concurrency``)."""
        raise NotImplementedError

    def s_ForEach(self, node: ast.ForEach, dest: str | None) -> None:
        p = self.mark(node)
        items = self.value(node.items)
        local = self.binding.locals.get(id(node))
        outer_entry = self.outer_entry
        self.outer_entry = self.mark(node.body, "each" if node.flavor == ";" else "each" + node.flavor)["lineno"]
        if node.flavor == "&":
            self.each_apart(node, local, items, p)
        else:
            self.loop(lambda loop: self.each(loop, node, local, items, p), p)
        self.outer_entry = outer_entry
        self.void(dest, p)

    def each_apart(self, node: ast.ForEach, local: Any, items: py.expr, p: Pos) -> None:
        """``for&`` (see ``Concurrency``)."""
        raise NotImplementedError

    def each(self, loop: Loop, node: ast.ForEach, local: Any, items: py.expr, p: Pos) -> None:
        """``for (var x : items) body`` over a snapshot."""
        after = (lambda: self.yield_(p)) if node.flavor == ";" else (lambda: None)
        variable = "_each" if local is None else local.python
        turn: list[py.stmt] = []
        if local is not None and local.boxed:
            turn.append(set_(variable, call("Box", [name(variable, p)], p), p))
        turn += self.turn(loop, node.body, after, p)
        verb = "times" if local is None else "iterate"
        self.emit(py.For(py.Name(variable, STORE, **p), call(verb, [items], p), turn or [py.Pass(**p)], [], None, **p))

    def s_Break(self, node: ast.Break, dest: str | None) -> None:
        self.leave_loop(node, "break")

    def s_Continue(self, node: ast.Continue, dest: str | None) -> None:
        self.leave_loop(node, "continue")

    def leave_loop(self, node: ast.Node, how: str) -> None:
        """break or continue: by Python's own where the loop is in this function, else by a Leave."""
        p = self.mark(node)
        if self.w.loops:
            self.abandon(self.w.loops[-1].groups, p)
            self.emit(py.Break(**p) if how == "break" else py.Continue(**p))
            return
        writer = self.w
        while not writer.loops and writer.apart is None and writer.outer is not None:
            writer = writer.outer
        if writer is self.w and writer.apart is not None and how == "continue":
            self.abandon(0, p)
            self.emit(py.Return(name("VOID", p), **p))
            return
        loop = writer.loops[-1] if writer.loops else writer.apart
        assert loop is not None
        if how == "break":
            loop.crossed_break = True
            token = loop.break_token
        else:
            loop.crossed_continue = True
            token = loop.continue_token
        self.emit(raise_(call("Leave", [name(token, p)], p), p))

    def abandon(self, kept: int, p: Pos) -> None:
        """Stop the background jobs of the blocks that are being left: all but the outermost ``kept`` ones."""
        for group in reversed(self.w.groups[kept:]):
            self.emit(do(call(attr(name(group, p), "abandon", p), [], p), p))

    def s_Return(self, node: ast.Return, dest: str | None) -> None:
        p = self.mark(node)
        value = name("VOID", p) if node.value is None else self.expr(node.value)
        if self.w.frame.function is None:
            writer = self.w
            while writer.frame.function is None and writer.outer is not None:
                writer = writer.outer
            writer.crossed_return = True
            self.emit(raise_(call("Leave", [name(writer.return_token, p), value], p), p))
            return
        if self.w.groups:
            kept = self.fresh()
            self.emit(set_(kept, value, p))
            self.abandon(0, p)
            value = name(kept, p)
        self.emit(py.Return(value, **p))

    # ---------------------------------------------------------------- exceptions

    def s_Try(self, node: ast.Try, dest: str | None) -> None:
        p = self.mark(node)
        body_dest = dest if node.otherwise is None else None
        body = self.block(lambda: self.stmt(node.body, body_dest))
        handlers = []
        if node.catches:
            caught = self.fresh("_e")
            handled = self.block(lambda: self.catches(list(node.catches), caught, dest, p))
            handlers.append(except_("Exception", caught, handled or [py.Pass(**p)], p))
        otherwise = [] if node.otherwise is None else self.block(lambda: self.stmt(node.otherwise, dest))
        final = [] if node.final is None else self.block(lambda: self.stmt(node.final, None))
        if not handlers and not final:
            self.emit(*body, *otherwise)
            return
        if not handlers:
            final = final or [py.Pass(**p)]
        self.emit(try_(body, handlers, otherwise, final, p))

    def catches(self, catches: list[ast.Catch], caught: str, dest: str | None, p: Pos) -> None:
        """The first catch clause, and the others in its else."""
        if not catches:
            self.emit(raise_(None, p))
            return
        catch, rest = catches[0], catches[1:]
        if catch.pattern is None:
            self.stmt(catch.body, dest)
            return
        hit = self.fresh()
        self.emit(set_(hit, const(False, p), p))
        self.matched(catch.pattern, catch.guard, call("caught", [name(caught, p)], p), hit, p)
        then = self.block(lambda: self.stmt(catch.body, dest))
        otherwise = self.block(lambda: self.catches(rest, caught, dest, p))
        self.emit(if_(name(hit, p), then, otherwise, p))

    def s_Throw(self, node: ast.Throw, dest: str | None) -> None:
        p = self.mark(node)
        if node.value is None:
            self.emit(raise_(None, p))
        else:
            self.emit(raise_(call("thrown", [self.value(node.value)], p), p))

    # ---------------------------------------------------------------- assertions

    def s_Assert(self, node: ast.Assert, dest: str | None) -> None:
        p = self.mark(node)

        def claims() -> None:
            for claim in node.claims:
                self.claim(claim)

        checks = self.block(claims)
        self.emit(if_(call("asserting", [], p), checks, [], p))
        self.void(dest, p)

    def claim(self, claim: ast.Node) -> None:
        """One claim; a call is made in a way that lets the message show the values of its parts."""
        p = self.mark(claim)
        text = const(self.text(claim), p)
        if not isinstance(claim, ast.Call) or (claim.target is None and claim.args is None
                                               and id(claim) in self.binding.locals):
            made = self.expr(claim)
            known = isinstance(claim, ast.Float | ast.String | ast.ListLit | ast.TupleLit | ast.DictLit)
            self.emit(do(call("assert_value", [text, made, const(known, p)], p), p))
            return
        local = self.binding.locals.get(id(claim))
        function: py.expr = const(None, p)
        if local is not None:
            function = self.read(local, p)
            target = self.this(claim, p)
        elif claim.target is None:
            target = self.this(claim, p)
        else:
            target = self.expr(claim.target)
        thunks = list_([self.thunk(argument) for argument in claim.args or ()], p)
        p = self.mark(claim, claim.name)
        self.emit(do(call("assert_call", [text, target, const(claim.target is not None, p), const(claim.name, p),
                                          function, thunks, self.nodes(claim.args or (), p)], p), p))

    def text(self, node: ast.Node) -> str:
        """A claim as the user would see it printed: a comparison is shown as one, not as a message."""
        if isinstance(node, ast.Call) and node.name in COMPARED and node.target is not None and node.args:
            return f"{self.text(node.target)} {node.name} {print_node(node.args[0])}"
        if isinstance(node, ast.Call) and node.args == ():
            return print_node(dataclasses.replace(node, args=None))
        return print_node(node)


def _continues(node: Any) -> bool:
    """Whether a loop's body has a ``continue`` of its own (not one of an inner loop or function)."""
    if isinstance(node, ast.Continue):
        return True
    if isinstance(node, tuple):
        return any(_continues(member) for member in node)
    if not isinstance(node, ast.Node) or isinstance(node, ast.Function | ast.While | ast.For | ast.ForEach | ast.Every):
        return False
    return any(_continues(getattr(node, field)) for field in type(node).__dataclass_fields__ if field != "span")


__all__ = ["RETURN", "Statements"]
