"""Function literals, objects, and assertions."""

from __future__ import annotations

import ast as py
import dataclasses
from functools import partial

from urbihw.kernel.compiler.control import catch_leave
from urbihw.kernel.compiler.emit import Pos, attr, call, const, do, if_, is_, list_, name, set_
from urbihw.kernel.compiler.operations import COMPARISONS, EQUALITY
from urbihw.kernel.compiler.unit import FunctionInfo
from urbihw.kernel.compiler.visit import Maker, make_expr, make_in_order, make_thunk, make_value, write_body, write_stmt
from urbihw.kernel.compiler.writer import NO_CALL, RETURN, Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame
from urbihw.kernel.syntax.printer import print_node

COMPARED = (*COMPARISONS, *EQUALITY, "===", "!==", "~=", "=~=")


def function_info(node: ast.Function, w: Writer, uses_call: bool) -> FunctionInfo:
    """What is known of a function literal."""
    formals = node.formals or ()
    variadic = bool(formals) and formals[-1].variadic
    needed = [rank for rank, formal in enumerate(formals, 1) if formal.default is None and not formal.variadic]
    least = needed[-1] if needed else 0
    most = -1 if variadic or node.formals is None else len(formals)
    index = w.syntax.add(node)
    return FunctionInfo(least, most, node.formals is None, uses_call, node.closure, len(formals), w.syntax, index)


def make_function(node: ast.Function, w: Writer) -> py.expr:
    """A function literal: a nested Python function wrapped into a Code."""
    frame = node.bound.function
    assert frame is not None
    info = function_info(node, w, frame.uses_call)
    p = w.mark(node)
    params = ["_this" if frame.this is None else frame.this.python]
    if info.lazy or info.uses_call:
        assert frame.call is not None
        params.append(frame.call.python)
    params += [local.python for local in frame.params]
    defaults = sum(1 for formal in node.formals or () if formal.default is not None)
    made = w.nested(frame, params, lambda: write_function_body(node, w, frame, p), p, defaults)
    return call("function", [made, w.constant(info, p)], p)


def write_function_body(node: ast.Function, w: Writer, frame: FunctionFrame, p: Pos) -> None:
    """Defaults, boxes, the body, and the handler of a return from another job."""
    if node.closure:  # a closure captures its target even if it does not use it: the target is part of its identity
        w.emit(do(w.this(node, p), p))
    for formal, local in zip(node.formals or (), frame.params, strict=True):
        if formal.default is not None:
            default, inside = w.block_of(partial(make_value, formal.default, w))
            inside.append(set_(local.python, default, w.mark(formal.default)))
            w.emit(if_(is_(name(local.python, p), name("MISSING", p), p), inside, [], p))
        w.box(local, p)
    w.body.return_token = w.fresh("_r")
    with w.within(NO_CALL):
        body = w.block(lambda: write_stmt(node.body, w, RETURN))
    if not w.body.crossed_return:
        w.emit(*body)
        return
    value = py.Return(attr(name("_l", p), "value", p), **p)
    w.emit(*catch_leave(body, w.body.return_token, [value], p))


def write_do(node: ast.Do, w: Writer, dest: str | None) -> None:
    """``do (target) { body }``."""
    p = w.mark(node)
    this = node.body.bound.this
    assert this is not None
    w.declare(this, make_value(node.target, w), p)
    write_body(node.body.body, w, None, p)
    w.finish(dest, w.read(this, p), p)


def write_class(node: ast.Class, w: Writer, dest: str | None) -> None:
    """``class target.name : protos { body }``."""
    p = w.mark(node)
    local = node.bound.local
    this = node.body.bound.this
    assert this is not None
    target = node.target
    makers: list[Maker] = [partial(make_value, proto, w) for proto in node.protos]
    if target is not None:
        makers.append(lambda: make_value(target, w))
    made = make_in_order(w, *makers)
    protos = made[: len(node.protos)]
    w.declare(this, call("new_class", [const(node.name, p), list_(protos, p)], p), p)
    if local is not None:
        w.declare(local, w.read(this, p), p)
    else:
        holder = made[-1] if target is not None else w.this(node, p)
        where = w.mark(node, "setSlot")
        w.emit(do(call("declare", [holder, const(node.name, p), w.read(this, p)], where), p))
    write_body(node.body.body, w, None, p)
    w.finish(dest, w.read(this, p), p)


def write_assert(node: ast.Assert, w: Writer, dest: str | None) -> None:
    """``assert(claim)`` and ``assert { claim."""
    p = w.mark(node)
    checks: list[py.stmt] = []
    for claim in node.claims:
        checks += w.block(partial(write_claim, claim, w))
    w.emit(if_(call("asserting", [], p), checks, [], p))
    w.finish_void(dest, p)


def write_claim(claim: ast.Node, w: Writer) -> None:
    """One claim; a call is made in a way that lets the message show the values of its parts."""
    p = w.mark(claim)
    text = const(claim_text(claim), p)
    local = claim.bound.local
    if not isinstance(claim, ast.Call) or claim.target is None and claim.args is None and local is not None:
        made = make_expr(claim, w)
        known = isinstance(claim, ast.Float | ast.StringLiteral | ast.ListLit | ast.TupleLit | ast.DictLit)
        w.emit(do(call("assert_value", [text, made, const(known, p)], p), p))
        return
    function: py.expr = const(None, p)
    if local is not None:
        function = w.read(local, p)
        target = w.this(claim, p)
    elif claim.target is None:
        target = w.this(claim, p)
    else:
        target = make_expr(claim.target, w)
    thunks = list_([make_thunk(argument, w) for argument in claim.args or ()], p)
    p = w.mark(claim, claim.name)
    kept = [const(claim.target is not None, p), const(claim.name, p), function, thunks, w.nodes(claim.args or (), p)]
    w.emit(do(call("assert_call", [text, target, *kept], p), p))


def claim_text(node: ast.Node) -> str:
    """A claim as the user would see it printed: a comparison is shown as one, not as a message."""
    if isinstance(node, ast.Call) and node.name in COMPARED and node.target is not None and node.args:
        return f"{claim_text(node.target)} {node.name} {print_node(node.args[0])}"
    if isinstance(node, ast.Call) and node.args == ():
        return print_node(dataclasses.replace(node, args=None))
    return print_node(node)
