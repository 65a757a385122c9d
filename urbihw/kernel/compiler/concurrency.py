"""Statements that involve several jobs, tags, events and time."""

from __future__ import annotations

import ast as py
from collections.abc import Callable
from typing import Any

from urbihw.kernel.compiler.emit import (
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
    list_,
    name,
    raise_,
    set_,
    try_,
    tuple_,
)
from urbihw.kernel.compiler.scopes import Local
from urbihw.kernel.compiler.statements import Statements
from urbihw.kernel.syntax import ast


class Concurrency(Statements):
    """Methods ``s_Node(node, dest)`` for what ``Statements`` leaves out."""

    # ---------------------------------------------------------------- separators

    def s_Seq(self, node: ast.Seq, dest: str | None) -> None:
        if any(separator == "," for _, separator in node.items):
            p = self.mark(node)
            self.group(lambda group: self.closing_scope(lambda: self.sequence_of(node, dest, group), p), p)
        else:
            self.sequence_of(node, dest, "")

    def closing_scope(self, write: Callable[[], None], p: Pos) -> None:
        """The statements of a scope; its scope tag is stopped before the background jobs are waited for."""
        close, self.w.close_scope = self.w.close_scope, None
        if close is None:
            write()
        else:
            self.emit(try_(self.block(write), [], [], [close()], p))

    def sequence_of(self, node: ast.Seq, dest: str | None, group: str) -> None:
        """``a; b, c``: the value is that of the last statement that is not in the background."""
        last = max((i for i, (_, separator) in enumerate(node.items) if separator != ","), default=-1)
        p = self.mark(node)
        kept = dest
        if dest == RETURN and last < len(node.items) - 1:
            kept = self.fresh()
        if last < 0:
            self.void(kept if kept != RETURN else None, p)
        for index, (item, separator) in enumerate(node.items):
            if separator == ",":
                self.emit(do(call(attr(name(group, p), "start", p), [self.background(item)], p), p))
            else:
                self.stmt(item, kept if index == last else None)
                if index < len(node.items) - 1 and not (kept == RETURN and index == last):
                    self.yield_(self.mark(item))
        if kept != dest:
            assert kept is not None
            self.emit(py.Return(name(kept, p), **p))

    def group(self, write: Callable[[str], None], p: Pos) -> None:
        """A block that waits for its background jobs: ``with group() as g: ...``."""
        text = self.fresh("_g")
        self.w.groups.append(text)
        body = self.block(lambda: write(text))
        self.w.groups.pop()
        item = py.withitem(call("group", [], p), py.Name(text, STORE, **p))
        self.emit(py.With([item], body or [py.Pass(**p)], None, **p))

    def background(self, item: ast.Node) -> py.expr:
        """A statement as the body of a job; a ``var`` there belongs to the scope around it."""
        local = self.binding.locals.get(id(item))
        if isinstance(item, ast.Var) and local is not None:
            p = self.mark(item)
            self.declare(local, name("VOID", p), p)
            if item.value is None:
                return name("nothing", p)
            value = item.value
            frame = self.binding.frames[id(value)]
            return self.nested(frame, [], lambda: self.write(local, self.value(value), p), p)
        return self.thunk(item)

    def s_Par(self, node: ast.Par, dest: str | None) -> None:
        p = self.mark(node)

        def write(group: str) -> None:
            for item in node.items:
                self.emit(do(call(attr(name(group, p), "launch", p), [self.background(item)], p), p))

        self.group(write, p)
        self.void(dest, p)

    # ---------------------------------------------------------------- loops whose turns are jobs

    def apart(self, write: Callable[[Loop, str], None], p: Pos) -> None:
        """A loop whose turns are jobs of a group; ``break`` in one ends all."""
        self.counter += 1
        loop = Loop(self.w, self.counter)
        body = self.block(lambda: self.group(lambda group: write(loop, group), p))
        if loop.crossed_break:
            self.emit(set_(loop.break_token, call("token", [], p), p))
            handler = [if_(self.not_mine(loop.break_token, p), [raise_(None, p)], [], p)]
            body = [try_(body, [except_("Leave", "_l", handler, p)], [], [], p)]
        self.emit(*body)

    def turn_apart(self, loop: Loop, body: ast.Node) -> py.expr:
        """The body of such a loop as a function; ``continue`` returns from it."""
        frame = self.binding.frames[id(body)]
        p = self.mark(body)

        def write() -> None:
            self.w.apart = loop
            inside = self.block(lambda: self.scope_tagged(body, lambda: self.stmt(body, None), p))
            if loop.crossed_continue:
                handler = [if_(self.not_mine(loop.continue_token, p), [raise_(None, p)], [], p)]
                inside = [
                    set_(loop.continue_token, call("token", [], p), p),
                    try_(inside, [except_("Leave", "_l", handler, p)], [], [], p),
                ]
            self.emit(*(inside or [py.Pass(**p)]))

        return self.nested(frame, [], write, p)

    def parallel_loop(self, items: Any, cond: ast.Node | None, body: ast.Node, step: ast.Node | None, p: Pos) -> None:
        """``while, (cond) body`` and ``for, (init; cond; step) body``."""

        def write(loop: Loop, group: str) -> None:
            tests: list[py.expr] = []
            inside = self.block(lambda: tests.append(const(True, p) if cond is None else self.condition(cond)))
            inside.append(if_(py.UnaryOp(py.Not(), tests[0], **p), [py.Break(**p)], [], p))
            made: list[py.expr] = []
            inside += self.block(lambda: made.append(self.turn_apart(loop, body)))
            inside.append(do(call(attr(name(group, p), "start", p), made, p), p))
            if step is not None:
                inside += self.block(lambda: self.stmt(step, None))
            self.emit(py.While(const(True, p), inside, [], **p))

        self.apart(write, p)

    def each_apart(self, node: ast.ForEach, local: Local | None, items: py.expr, p: Pos) -> None:
        """``for& (var x : items) body``."""

        def write(loop: Loop, group: str) -> None:
            variable = "_each" if local is None else local.python
            inside: list[py.stmt] = []
            if local is not None and local.boxed:
                inside.append(set_(variable, call("Box", [name(variable, p)], p), p))
            made: list[py.expr] = []
            inside += self.block(lambda: made.append(self.turn_apart(loop, node.body)))
            inside.append(do(call(attr(name(group, p), "launch", p), made, p), p))
            verb = "times" if local is None else "iterate"
            self.emit(py.For(py.Name(variable, STORE, **p), call(verb, [items], p), inside, [], None, **p))

        self.apart(write, p)

    def s_Every(self, node: ast.Every, dest: str | None) -> None:
        p = self.mark(node)
        pace = self.fresh("_p")
        self.emit(set_(pace, call("pace", [], p), p))

        def rest() -> None:
            period = self.value(node.period)
            self.emit(do(call(attr(name(pace, p), "wait", p), [period], p), p))

        def inline(loop: Loop) -> None:
            self.emit(py.While(const(True, p), self.turn(loop, node.body, rest, p), [], **p))

        def spread(loop: Loop, group: str) -> None:
            made: list[py.expr] = []
            inside = self.block(lambda: made.append(self.turn_apart(loop, node.body)))
            inside.append(do(call(attr(name(group, p), "launch", p), made, p), p))
            inside += self.block(rest)
            self.emit(py.While(const(True, p), inside, [], **p))

        if node.flavor == ",":
            self.apart(spread, p)
        else:
            self.loop(inline, node.body, p)
        self.void(dest, p)

    # ---------------------------------------------------------------- tags

    def s_Tagged(self, node: ast.Tagged, dest: str | None) -> None:
        p = self.mark(node)
        tag = node.tag
        if isinstance(tag, ast.Call) and tag.args is None and id(tag) not in self.binding.locals:
            self.passage(call("tag_named", self.named_tag(tag, node, p), p), node.body, dest, p)
        else:
            self.passage(call("tag_open", [self.value(tag)], p), node.body, dest, p)

    def named_tag(self, tag: ast.Call, node: ast.Node, p: Pos) -> list[py.expr]:
        """A tag given by name, which is made if it does not exist: what holds it, and its names."""
        names: list[str] = []
        at: ast.Node | None = tag
        while isinstance(at, ast.Call) and at.args is None and id(at) not in self.binding.locals:
            names.insert(0, at.name)
            at = at.target
        holder = self.this(node, p) if at is None else self.value(at)
        return [holder, const(at is None, p), const(tuple(names), p)]

    def passage(self, opened: py.expr, body: ast.Node, dest: str | None, p: Pos) -> None:
        """Code that a tag can make its job leave."""
        text = self.fresh("_w")
        self.emit(set_(text, opened, p))

        def verb(field: str, *args: py.expr) -> py.expr:
            return call(attr(name(text, p), field, p), list(args), p)

        inside = [do(verb("enter"), p), *self.block(lambda: self.stmt(body, dest))]
        foreign = py.UnaryOp(py.Not(), verb("owns", name("_s", p)), **p)
        left: list[py.stmt] = [if_(foreign, [raise_(None, p)], [], p)]
        left += self.block(lambda: self.finish(dest, attr(name("_s", p), "value", p), p))
        self.emit(try_(inside, [except_("StopTag", "_s", left, p)], [], [do(verb("exit"), p)], p))

    def s_Guarded(self, node: ast.Guarded, dest: str | None) -> None:
        p = self.mark(node)
        cond = node.cond.expr if isinstance(node.cond, ast.ExprCond) else node.cond
        if node.kind == "timeout":
            opened = call("timeout", [self.value(cond)], p)
        elif isinstance(cond, ast.EventCond):
            event, accept, _ = self.event_parts(cond)
            opened = call("event_guard", [const(node.kind, p), event, accept], p)
        else:
            opened = call("guard", [const(node.kind, p), self.thunk(cond)], p)
        self.passage(opened, node.body, dest, p)

    # ---------------------------------------------------------------- events and conditions

    def x_Emit(self, node: ast.Emit) -> py.expr:
        event = node.event
        makers = [lambda: self.value(event)]
        makers += [lambda arg=arg: self.value(arg) for arg in node.args or ()]  # type: ignore[misc]
        if node.duration is not None:
            duration = node.duration
            makers.append(lambda: self.value(duration))
        made = self.sequence(makers)
        count = len(node.args or ())
        p = self.mark(node, "emit")
        return call("emit", [made[0], list_(made[1 : 1 + count], p), *made[1 + count :]], p)

    def duration(self, node: ast.Node | None, p: Pos) -> py.expr:
        """The ``~ duration`` of a condition, or None."""
        return const(None, p) if node is None else self.value(node)

    def event_parts(self, cond: ast.EventCond) -> tuple[py.expr, py.expr, py.expr]:
        """The event, the function that accepts payloads, and the duration."""
        p = self.mark(cond)
        event, duration = self.sequence([lambda: self.value(cond.event), lambda: self.duration(cond.duration, p)])
        frame = self.binding.frames[id(cond)]
        accept = self.nested(frame, ["_payload"], lambda: self.accept(cond, p), p)
        return event, accept, duration

    def accept(self, cond: ast.EventCond, p: Pos) -> None:
        """The body of the function that takes a payload and gives the bound values, or None to refuse it."""
        bound: py.expr = tuple_([], p)
        if cond.patterns is not None:
            patterns = list_([self.pattern(pattern) for pattern in cond.patterns], p)
            self.emit(set_("_m", call("match_payload", [patterns, name("_payload", p)], p), p))
            self.emit(if_(is_(name("_m", p), const(None, p), p), [py.Return(const(None, p), **p)], [], p))
            for index, local in enumerate(self.binding.formals[id(cond)]):
                self.declare(local, py.Subscript(name("_m", p), const(index, p), py.Load(), **p), p)
            bound = name("_m", p)
        if cond.guard is not None:
            refused = py.UnaryOp(py.Not(), self.condition(cond.guard), **p)
            self.emit(if_(refused, [py.Return(const(None, p), **p)], [], p))
        self.emit(py.Return(bound, **p))

    def handler(self, node: ast.Node | None, p: Pos) -> py.expr:
        """The body of an ``at``: a function of the values bound by the pattern."""
        if node is None:
            return const(None, p)
        frame = self.binding.frames[id(node)]
        bound = self.binding.formals.get(id(node), [])

        def write() -> None:
            for local in bound:
                if local.boxed:
                    self.emit(set_(local.python, call("Box", [name(local.python, p)], p), p))
            self.scope_tagged(node, lambda: self.stmt(node, None), p)

        return self.nested(frame, [local.python for local in bound], write, p)

    def s_At(self, node: ast.At, dest: str | None) -> None:
        self.watch("at", node, node.cond, node.leave, dest)

    def s_Whenever(self, node: ast.Whenever, dest: str | None) -> None:
        self.watch("whenever", node, node.cond, node.otherwise, dest)

    def watch(
        self,
        verb: str,
        node: ast.At | ast.Whenever,
        cond: ast.EventCond | ast.ExprCond,
        other: ast.Node | None,
        dest: str | None,
    ) -> None:
        """``at`` and ``whenever``."""
        p = self.mark(node)
        if isinstance(cond, ast.EventCond):
            parts = list(self.event_parts(cond))
            kind = verb + "_event"
        else:
            parts = [self.thunk(cond.expr), self.duration(cond.duration, p)]
            kind = verb + "_expr"
        parts += [self.handler(node.body, p), self.handler(other, p)]
        self.emit(do(call(kind, parts, p), p))
        self.void(dest, p)

    def s_WaitUntil(self, node: ast.WaitUntil, dest: str | None) -> None:
        p = self.mark(node)
        if isinstance(node.cond, ast.ExprCond):
            self.emit(do(call("wait_expr", [self.thunk(node.cond.expr), self.duration(node.cond.duration, p)], p), p))
        else:
            event, accept, _ = self.event_parts(node.cond)
            bound = self.fresh()
            self.emit(set_(bound, call("wait_event", [event, accept], p), p))
            self.bind_pattern(node, ast.ListLit(node.cond.patterns or ()), bound)
        self.void(dest, p)
