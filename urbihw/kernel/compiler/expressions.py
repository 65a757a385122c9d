"""Literals, names, messages, properties and patterns to Python expressions."""

from __future__ import annotations

import ast as py
from contextlib import nullcontext
from functools import partial

from urbihw.kernel.compiler.emit import (
    LOAD,
    Pos,
    attr,
    call,
    choose,
    const,
    if_,
    is_pure,
    list_,
    name,
    position_of,
    set_,
    tuple_,
    walrus,
)
from urbihw.kernel.compiler.operations import CONSTANTS, is_native
from urbihw.kernel.compiler.operators import make_operator
from urbihw.kernel.compiler.visit import Maker, make_expr, make_list, make_thunks, make_value, refuse_void
from urbihw.kernel.compiler.writer import InvisibleCall, Writer
from urbihw.kernel.syntax import ast

BOUNCED = "echo"
"""The function of Global that bounces the call to the lobby (manual, specs/global).  The arguments are evaluated there,
so an error in one of them has passed through the call; not in a call from the lobby itself."""
MAX_REPEATED = 20
"""Maximum number of nodes of the arguments that are compiled twice: for a strict function, and for a lazy one."""


def make_float(node: ast.Float, w: Writer) -> py.expr:
    """A number, an angle in radians or a duration in seconds (units are already applied)."""
    p = w.mark(node)
    return py.BinOp(const(node.value, p), py.Add(), name("ZERO", p), **p)


def make_string(node: ast.StringLiteral, w: Writer) -> py.expr:
    """A string literal, adjacent ones glued."""
    p = w.mark(node)
    return call("new_string", [const(node.value, p)], p)


def make_list_literal(node: ast.ListLit, w: Writer) -> py.expr:
    """``[a, b]``."""
    p = w.mark(node)
    return call("new_list", [make_list(w, node.items, make_value, p)], p)


def make_tuple_literal(node: ast.TupleLit, w: Writer) -> py.expr:
    """``()``, ``(a,)``, ``(a, b)``."""
    p = w.mark(node)
    return call("new_tuple", [make_list(w, node.items, make_value, p)], p)


def make_dictionary(node: ast.DictLit, w: Writer) -> py.expr:
    """``["a" => 1]`` and ``[ => ]``."""
    p = w.mark(node)
    flat = [part for pair in node.pairs for part in pair]
    return call("new_dictionary", [make_list(w, flat, make_value, p)], p)


def make_this(node: ast.This, w: Writer) -> py.expr:
    """``this``."""
    return w.this(node, w.mark(node))


def make_call_message(node: ast.CallKeyword, w: Writer) -> py.expr:
    """``call``: the message by which the running function was called."""
    local = node.bound.local
    assert local is not None
    return w.read(local, w.mark(node))


def make_call(node: ast.Call, w: Writer) -> py.expr:
    """``target.name(args)``."""
    local = node.bound.local
    if local is not None:
        if node.args is None or local.name == "scopeTag" and node.name in ("scopeTag", "scope"):
            return w.read(local, w.mark(node))
        return make_local_call(node, w, w.read(local, w.mark(node)))
    if node.target is None and node.args is None and node.name in CONSTANTS:
        return name(CONSTANTS[node.name], w.mark(node))
    if not w.generic and is_native(node):
        return make_operator(node, w)
    if node.target is None:
        return make_send(node, w, lambda: w.this(node, w.mark(node)))
    target = node.target
    return make_send(node, w, lambda: make_expr(target, w))


def make_send(node: ast.Call, w: Writer, target: Maker) -> py.expr:
    """A message to a target."""
    if node.bound.lazy:
        return make_lazy_send(node, w, target)
    if not node.args:
        made = target()
        p = w.mark(node, node.name)
        return call("own_send0" if node.target is None else "send0", [made, const(node.name, p)], p)
    receiver = target()
    p = w.mark(node, node.name)
    if isinstance(receiver, py.Name):
        first, again = receiver, name(receiver.id, p)
    else:
        variable = w.fresh("_o")
        first, again = walrus(variable, receiver, p), name(variable, p)  # type: ignore[assignment]
    found = call("own_method" if node.target is None else "method", [first, const(node.name, p)], p)
    return make_application(node, w, found, again, p)


def make_local_call(node: ast.Call, w: Writer, function: py.expr) -> py.expr:
    """Call what a local variable holds, with ``this`` as its target."""
    p = w.mark(node, node.name)
    this = w.this(node, p)
    found = call("callee", [function], p)
    if node.bound.lazy and node.args:
        return make_guarded(node, w, found, this, p)
    return make_application(node, w, found, this, p)


def make_application(node: ast.Call, w: Writer, function: py.expr, target: py.expr, p: Pos) -> py.expr:
    """Call ``function`` strictly, or, if it turns out to be lazy, with its arguments unevaluated."""
    args = node.args or ()
    verb = f"c{len(args)}" if len(args) <= 3 else "cn"
    out, w.body.out = w.body.out, []
    made = make_arguments(node, w, p)
    before, w.body.out = w.body.out, out
    found = name("_t", p)
    strict = attr(walrus("_t", function, p), "strict", p)
    takes_text = attr(found, "takes_text", p)
    late = [found, target, w.this(node, p), const(node.name, p), const(w.late.add(node, w.pace), p)]
    if all(is_pure(statement) for statement in before):
        w.emit(*before)
        now = call(walrus("_c", attr(found, verb, p), p), [target, *with_text(made, takes_text)], p)
        return choose(strict, now, call("lazy_site", late, p), p)
    kept, result = w.fresh("_t"), w.fresh()
    w.emit(set_(kept, function, p))
    late[0] = name(kept, p)
    made = with_text(made, attr(name(kept, p), "takes_text", p))
    done = [*before, set_(result, call(attr(name(kept, p), verb, p), [target, *made], p), p)]
    w.emit(if_(attr(name(kept, p), "strict", p), done, [set_(result, call("lazy_site", late, p), p)], p))
    return name(result, p)


def make_arguments(node: ast.Call, w: Writer, p: Pos) -> list[py.expr]:
    """The strict arguments of a call: void is an error of the call."""
    bounced = node.target is None and node.name == BOUNCED

    def make_argument(argument: ast.Node, w: Writer) -> py.expr:
        with w.within(InvisibleCall(p["lineno"], bounced=True)) if bounced else nullcontext():
            made = make_expr(argument, w)
        return refuse_void(made, argument, w, node.span)

    made = make_list(w, node.args or (), make_argument, p)
    return made.elts if isinstance(made, py.List) else [py.Starred(made, LOAD, **p)]


def with_text(made: list[py.expr], takes_text: py.expr) -> list[py.expr]:
    """Arguments of a call; a literal at their begin is a Python str for a function that ``takes_text``."""
    first = made[0] if made else None
    if not isinstance(first, py.Call) or not isinstance(first.func, py.Name) or first.func.id != "new_string":
        return made
    return [choose(takes_text, first.args[0], first, position_of(first)), *made[1:]]


def make_lazy_send(node: ast.Call, w: Writer, target: Maker) -> py.expr:
    """A message by a name known to belong to a lazy function; other functions of this name may be strict."""
    receiver = target()
    p = w.mark(node, node.name)
    if not node.args:
        return call("lazy_send0", [receiver, w.this(node, p), const(node.name, p)], p)
    kept = w.fresh("_o")
    w.emit(set_(kept, receiver, p))
    found = call("own_method" if node.target is None else "method", [name(kept, p), const(node.name, p)], p)
    return make_guarded(node, w, found, name(kept, p), p)


def make_guarded(node: ast.Call, w: Writer, function: py.expr, target: py.expr, p: Pos) -> py.expr:
    """Call a function that may be lazy: what is known only when it is called.

    A strict function gets the values of short arguments without a detour.  The values of longer ones are computed by
    functions, as for a lazy one, so that calls inside calls are not written twice as often at each level.
    """
    args = node.args or ()
    kept, result = w.fresh("_t"), w.fresh()

    def write(strict: bool) -> None:
        if strict:
            verb = f"c{len(args)}" if len(args) <= 3 else "cn"
            values = with_text(make_arguments(node, w, p), attr(name(kept, p), "takes_text", p))
            made = call(attr(name(kept, p), verb, p), [target, *values], p)
        else:
            sent = [name(kept, p), target, w.this(node, p), const(node.name, p)]
            made = call("lazy_call", [*sent, *make_thunks(w, args, p)], p)
        w.emit(set_(result, made, p))

    w.emit(set_(kept, function, p))
    if count_short(args) > MAX_REPEATED:
        write(strict=False)
    else:
        strictly, unevaluated = (w.block(partial(write, strict)) for strict in (True, False))
        w.emit(if_(attr(name(kept, p), "strict", p), strictly, unevaluated, p))
    return name(result, p)


def count_short(args: tuple[ast.Node, ...]) -> int:
    """The number of nodes of some arguments; more than MAX_REPEATED if one of them is not a plain expression, or is
    written twice itself.
    """
    found, todo = 0, list(args)
    while todo and found <= MAX_REPEATED:
        node = todo.pop()
        found += 1
        if isinstance(node, ast.Call) and not (node.args and node.bound.lazy):
            todo += [part for part in (node.target, *(node.args or ())) if part is not None]
        elif isinstance(node, ast.ListLit | ast.TupleLit):
            todo += node.items
        elif not isinstance(node, ast.Float | ast.StringLiteral | ast.This):
            return MAX_REPEATED + 1
    return found


def slot_holder(slot: ast.Call, w: Writer, node: ast.Node) -> Maker:
    """The object whose slot is meant by ``a`` or ``o.a``."""
    target = slot.target
    if target is None:
        return lambda: w.this(node, w.mark(node))
    return lambda: make_value(target, w)


def make_external(node: ast.External, w: Writer) -> py.expr:
    """``external function (2) X.f from X``."""
    p = w.mark(node)
    words = (node.kind, ".".join(node.path), node.arity, node.source)
    return call("external", [const(word, p) for word in words], p)


def make_property(node: ast.Property, w: Writer) -> py.expr:
    """``slot->name``."""
    holder = slot_holder(node.slot, w, node)()
    p = w.mark(node, "getProperty")
    return call("get_property", [holder, const(node.slot.name, p), const(node.name, p)], p)


def make_pattern(node: ast.Node, w: Writer) -> py.expr:
    """A pattern as the tuple that ``runtime.matching`` describes."""
    p = w.mark(node)
    if isinstance(node, ast.Var) and node.target is None and node.value is None:
        return tuple_([const("bind", p)], p)
    if isinstance(node, ast.ListLit | ast.TupleLit):
        kind = "list" if isinstance(node, ast.ListLit) else "tuple"
        return tuple_([const(kind, p), make_list(w, node.items, make_pattern, p)], p)
    if isinstance(node, ast.DictLit):
        pairs: list[py.expr] = [tuple_([make_value(key, w), make_pattern(item, w)], p) for key, item in node.pairs]
        return tuple_([const("dict", p), list_(pairs, p)], p)
    return tuple_([const("value", p), make_value(node, w)], p)
