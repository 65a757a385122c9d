"""Loops, with iterations in place or as jobs, and the jumps out of them."""

from __future__ import annotations

import ast as py
from collections.abc import Callable

from urbihw.kernel.compiler.control import catch_leave, write_abandon, write_group, write_yield
from urbihw.kernel.compiler.emit import STORE, Pos, attr, call, const, do, if_, is_pure, name, raise_, set_, try_
from urbihw.kernel.compiler.operators import make_condition
from urbihw.kernel.compiler.visit import frame_of, make_value, write_stmt, write_tagged_scope
from urbihw.kernel.compiler.writer import InvisibleCall, Loop, Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import Local
from urbihw.kernel.syntax.check import children


def write_loop(w: Writer, write: Callable[[Loop], None], inside: ast.Node, p: Pos) -> None:
    """Write a loop by ``write(loop)``, and around it the handler of a break from another job.

    If ``inside`` detaches jobs and has a break, the loop gets its own tag, with which the break stops them.
    """
    loop = w.new_loop()
    if inside.bound.detaches and has_own(inside, w, ast.Break):
        loop.detached = w.fresh("_d")
        w.emit(set_(loop.detached, call("loop_tag", [], p), p))
    w.body.loops.append(loop)
    body = w.block(lambda: write(loop))
    w.body.loops.pop()
    if loop.crossed_break:
        body = catch_leave(body, loop.break_token, w.block(lambda: write_stop_detached(w, loop, p)), p)
    if loop.detached:
        enter, leave = (do(call(attr(name(loop.detached, p), verb, p), [], p), p) for verb in ("enter", "exit"))
        body = [try_([enter, *body], [], [], [leave], p)]
    w.emit(*body)


def write_stop_detached(w: Writer, loop: Loop, p: Pos) -> None:
    """Stop the detached jobs of a loop, for a break."""
    if loop.detached:
        w.emit(do(call(attr(name(loop.detached, p), "stop_others", p), [], p), p))


def make_turn(w: Writer, loop: Loop, body: ast.Node, after: Callable[[], None], p: Pos) -> list[py.stmt]:
    """One turn of a loop: the body, then ``after()``, which ``continue`` must not skip."""
    inside = w.block(lambda: write_stmt(body, w, None))
    if loop.crossed_continue:
        inside = catch_leave(inside, loop.continue_token, [], p)
    rest = w.block(after)
    if not rest or not has_own(body, w, ast.Continue):
        return inside + rest
    inside = inside or [py.Pass(**p)]
    once = py.For(py.Name("_once", STORE, **p), name("ONCE", p), inside, [*rest, py.Continue(**p)], None, **p)
    return [once, py.Break(**p)]


def write_while(node: ast.While, w: Writer, dest: str | None) -> None:
    """``while flavor (cond) body``."""
    p = w.mark(node)
    if node.flavor == ",":
        write_parallel_loop(w, node.cond, node.body, None, p)
    else:
        write_loop(w, lambda loop: write_while_loop(w, loop, node.cond, node.body, None, node.flavor, p), node.body, p)
    w.finish_void(dest, p)


def write_while_loop(
    w: Writer, loop: Loop, cond: ast.Node | None, body: ast.Node, step: ast.Node | None, flavor: str, p: Pos
) -> None:
    """``while flavor (cond) body``, with the step of a C-like for."""

    def after() -> None:
        if step is not None:
            write_stmt(step, w, None)
        if flavor == ";":
            write_yield(w, p)

    test, before = w.block_of(lambda: const(True, p) if cond is None else make_condition(cond, w))
    turn = make_turn(w, loop, body, after, p)
    if before and not all(is_pure(statement) for statement in before):
        stop = if_(py.UnaryOp(py.Not(), test, **p), [py.Break(**p)], [], p)
        w.emit(py.While(const(True, p), [*before, stop, *turn], [], **p))
    else:
        w.emit(*before)
        w.emit(py.While(test, turn or [py.Pass(**p)], [], **p))


def write_for(node: ast.For, w: Writer, dest: str | None) -> None:
    """C-like ``for flavor (init."""
    p = w.mark(node)
    write_stmt(node.init, w, None)
    if node.flavor == ",":
        write_parallel_loop(w, node.cond, node.body, node.step, p)
    else:
        cond = None if isinstance(node.cond, ast.Empty) else node.cond
        write_loop(w, lambda loop: write_while_loop(w, loop, cond, node.body, node.step, node.flavor, p), node.body, p)
    w.finish_void(dest, p)


def write_for_each(node: ast.ForEach, w: Writer, dest: str | None) -> None:
    """``for flavor (var name : items) body``, and ``for flavor (n) body`` with name None."""
    p = w.mark(node)
    routine = "each" if node.flavor == ";" else "each" + node.flavor
    local = node.bound.local
    items = call("times" if local is None else "iterate", [make_value(node.items, w)], w.mark(node, routine))
    with w.within(InvisibleCall(w.mark(node.body, routine)["lineno"])):
        if node.flavor == "&":
            write_each_apart(node, w, local, items, p)
        else:
            write_loop(w, lambda loop: write_each(w, loop, node, local, items, p), node.body, p)
    w.finish_void(dest, p)


def write_each(w: Writer, loop: Loop, node: ast.ForEach, local: Local | None, items: py.expr, p: Pos) -> None:
    """``for (var x : items) body``; ``items`` iterates over a snapshot."""
    after = (lambda: write_yield(w, p)) if node.flavor == ";" else (lambda: None)
    variable = "_each" if local is None else local.python
    turn: list[py.stmt] = []
    if local is not None and local.boxed:
        turn.append(set_(variable, call("Box", [name(variable, p)], p), p))
    turn += make_turn(w, loop, node.body, after, p)
    w.emit(py.For(py.Name(variable, STORE, **p), items, turn or [py.Pass(**p)], [], None, **p))


def write_break(node: ast.Break, w: Writer, dest: str | None) -> None:
    """``break``."""
    write_leave_loop(node, w, "break")


def write_continue(node: ast.Continue, w: Writer, dest: str | None) -> None:
    """``continue``."""
    write_leave_loop(node, w, "continue")


def write_leave_loop(node: ast.Node, w: Writer, how: str) -> None:
    """break or continue: Python's own where the loop is in this function, else a Leave."""
    p = w.mark(node)
    if w.body.loops:
        write_abandon(w, w.body.loops[-1].groups, p)
        if how == "break":
            write_stop_detached(w, w.body.loops[-1], p)
        w.emit(py.Break(**p) if how == "break" else py.Continue(**p))
        return
    around = w.body
    while not around.loops and around.apart is None and around.outer is not None:
        around = around.outer
    if around is w.body and around.apart is not None and how == "continue":
        write_abandon(w, 0, p)
        w.emit(py.Return(name("VOID", p), **p))
        return
    loop = around.loops[-1] if around.loops else around.apart
    assert loop is not None
    if how == "break":
        loop.crossed_break = True
        token = loop.break_token
    else:
        loop.crossed_continue = True
        token = loop.continue_token
    w.emit(raise_(call("Leave", [name(token, p)], p), p))


def has_own(node: ast.Node, w: Writer, kind: type[ast.Node]) -> bool:
    """Whether a loop's body has a break or ``continue`` of its own (not one of an inner loop or function)."""
    todo = [node]
    while todo:
        w.pace.step()
        each = todo.pop()
        if isinstance(each, kind):
            return True
        if not isinstance(each, ast.Function | ast.While | ast.For | ast.ForEach | ast.Every):
            todo.extend(children(each))
    return False


def write_apart(w: Writer, write: Callable[[Loop, str], None], p: Pos) -> None:
    """A loop whose iterations are jobs of a group; ``break`` in one of them ends all."""
    loop = w.new_loop()
    body = w.block(lambda: write_group(w, lambda group: write(loop, group), p))
    if loop.crossed_break:
        body = catch_leave(body, loop.break_token, [], p)
    w.emit(*body)


def make_turn_apart(w: Writer, loop: Loop, body: ast.Node) -> py.expr:
    """The body of such a loop as a function; ``continue`` returns from it."""
    frame = frame_of(body)
    p = w.mark(body)

    def write() -> None:
        w.body.apart = loop
        inside = w.block(lambda: write_tagged_scope(w, frame.scope_tag, lambda: write_stmt(body, w, None), p))
        if loop.crossed_continue:
            inside = catch_leave(inside, loop.continue_token, [], p)
        w.emit(*(inside or [py.Pass(**p)]))

    return w.nested(frame, [], write, p)


def write_parallel_loop(w: Writer, cond: ast.Node | None, body: ast.Node, step: ast.Node | None, p: Pos) -> None:
    """``while, (cond) body`` and ``for, (init; cond; step) body``."""

    def write(loop: Loop, group: str) -> None:
        test, inside = w.block_of(lambda: const(True, p) if cond is None else make_condition(cond, w))
        inside.append(if_(py.UnaryOp(py.Not(), test, **p), [py.Break(**p)], [], p))
        turn, before = w.block_of(lambda: make_turn_apart(w, loop, body))
        inside += [*before, do(call(attr(name(group, p), "start", p), [turn], p), p)]
        if step is not None:
            inside += w.block(lambda: write_stmt(step, w, None))
        w.emit(py.While(const(True, p), inside, [], **p))

    write_apart(w, write, p)


def write_each_apart(node: ast.ForEach, w: Writer, local: Local | None, items: py.expr, p: Pos) -> None:
    """``for& (var x : items) body``; ``items`` iterates over a snapshot."""

    def write(loop: Loop, group: str) -> None:
        variable = "_each" if local is None else local.python
        inside: list[py.stmt] = []
        if local is not None and local.boxed:
            inside.append(set_(variable, call("Box", [name(variable, p)], p), p))
        turn, before = w.block_of(lambda: make_turn_apart(w, loop, node.body))
        inside += [*before, do(call(attr(name(group, p), "launch", p), [turn], p), p)]
        w.emit(py.For(py.Name(variable, STORE, **p), items, inside, [], None, **p))

    write_apart(w, write, p)


def write_every(node: ast.Every, w: Writer, dest: str | None) -> None:
    """``every flavor (period) body``."""
    p = w.mark(node)
    pace = w.fresh("_p")
    w.emit(set_(pace, call("pace", [], p), p))

    def rest() -> None:
        period = make_value(node.period, w)
        w.emit(do(call(attr(name(pace, p), "wait", p), [period], p), p))

    def inline(loop: Loop) -> None:
        w.emit(py.While(const(True, p), make_turn(w, loop, node.body, rest, p), [], **p))

    def spread(loop: Loop, group: str) -> None:
        turn, before = w.block_of(lambda: make_turn_apart(w, loop, node.body))
        inside = [*before, do(call(attr(name(group, p), "launch", p), [turn], p), p), *w.block(rest)]
        w.emit(py.While(const(True, p), inside, [], **p))

    if node.flavor == ",":
        write_apart(w, spread, p)
    else:
        write_loop(w, inline, node.body, p)
    w.finish_void(dest, p)
