"""Function literals, lazy pieces of code, blocks, objects, and assertions."""

from __future__ import annotations

import ast as py
import dataclasses
from typing import Any

from urbihw.kernel.compiler.emit import (
    RETURN,
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
)
from urbihw.kernel.compiler.expressions import COMPARISONS, EQUALITY, Maker
from urbihw.kernel.compiler.places import Places
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.printer import print_node

COMPARED = (*COMPARISONS, *EQUALITY, "===", "!==", "~=", "=~=")


class Functions(Places):
    """What makes Python functions, and what they are made of."""

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
