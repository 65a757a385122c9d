"""The statements of one job except loops: blocks, choices, ``return`` and exceptions."""

from __future__ import annotations

import ast as py
from functools import partial

from urbihw.kernel import errors
from urbihw.kernel.compiler.control import write_abandon
from urbihw.kernel.compiler.emit import Pos, attr, call, const, do, except_, if_, is_, list_, name, raise_, set_, try_
from urbihw.kernel.compiler.expressions import make_pattern
from urbihw.kernel.compiler.operators import make_condition
from urbihw.kernel.compiler.places import write_bindings
from urbihw.kernel.compiler.scopes import is_binding
from urbihw.kernel.compiler.visit import make_expr, make_thunk, make_value, write_body, write_stmt, write_tagged_scope
from urbihw.kernel.compiler.writer import Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.check import children

MAX_COPIED_NODES = 20_000
"""Maximum number of nodes in all copies of a ``finally`` clause; compiling them takes a fifth of a second."""


def write_empty(node: ast.Empty, w: Writer, dest: str | None) -> None:
    """Nothing between two separators."""
    w.finish_void(dest, w.mark(node))


def write_scope(node: ast.Scope, w: Writer, dest: str | None) -> None:
    """``{ body }``."""
    p = w.mark(node)
    write_tagged_scope(w, node.bound.scope_tag, lambda: write_body(node.body, w, dest, p), p)


def write_pipe(node: ast.Pipe, w: Writer, dest: str | None) -> None:
    """``a | b | c``: no other job runs in between."""
    for item in node.items[:-1]:
        write_stmt(item, w, None)
    write_stmt(node.items[-1], w, dest)


def write_if(node: ast.If, w: Writer, dest: str | None) -> None:
    """``if (cond) then else otherwise``."""
    p = w.mark(node)
    if isinstance(node.cond, ast.Seq | ast.Pipe | ast.Var):
        variable = w.fresh()
        write_stmt(node.cond, w, variable)
        test: py.expr = name(variable, p)
    else:
        test = make_condition(node.cond, w)
    then = w.block(lambda: write_stmt(node.then, w, dest))
    otherwise = w.block(lambda: write_body(node.otherwise, w, dest, p))
    w.emit(if_(test, then, otherwise, w.mark(node.cond)))


def write_switch(node: ast.Switch, w: Writer, dest: str | None) -> None:
    """``switch (value) { cases }``."""
    p = w.mark(node)
    subject = w.fresh()
    w.emit(set_(subject, make_value(node.value, w), p))
    write_cases(w, list(node.cases), subject, dest, p)


def write_cases(w: Writer, cases: list[ast.Case], subject: str, dest: str | None, p: Pos) -> None:
    """The first case, and the others in its else."""
    if not cases:
        w.finish_void(dest, p)
        return
    case, rest = cases[0], cases[1:]
    if case.pattern is None:
        write_body(case.body, w, dest, p)
        return
    hit = w.fresh()
    w.emit(set_(hit, const(False, p), p))
    write_match(case.pattern, w, case.guard, name(subject, p), hit, p)
    then = w.block(lambda: write_body(case.body, w, dest, p))
    otherwise = w.block(lambda: write_cases(w, rest, subject, dest, p))
    w.emit(if_(name(hit, p), then, otherwise, p))


def write_match(pattern: ast.Node, w: Writer, guard: ast.Node | None, subject: py.expr, hit: str, p: Pos) -> None:
    """Set ``hit`` if the subject matches and the guard holds; the bindings are declared then."""
    bound = w.fresh()
    if guard is None and is_binding(pattern):
        w.emit(set_(bound, list_([subject], p), p))
        write_bindings(pattern, w, pattern, bound)
        w.emit(set_(hit, const(True, p), p))
        return
    w.emit(set_(bound, call("match", [make_pattern(pattern, w), subject], p), p))

    def inside() -> None:
        write_bindings(pattern, w, pattern, bound)
        test = const(True, p) if guard is None else call("truth", [make_condition(guard, w)], p)
        w.emit(set_(hit, test, p))

    w.emit(if_(is_(name(bound, p), const(None, p), p, negated=True), w.block(inside), [], p))


def write_return(node: ast.Return, w: Writer, dest: str | None) -> None:
    """``return value``."""
    p = w.mark(node)
    value = name("VOID", p) if node.value is None else make_expr(node.value, w)
    if not w.body.frame.literal:
        around = w.body
        while not around.frame.literal and around.outer is not None:
            around = around.outer
        around.crossed_return = True
        w.emit(raise_(call("Leave", [name(around.return_token, p), value], p), p))
        return
    if w.body.groups:
        kept = w.fresh()
        w.emit(set_(kept, value, p))
        write_abandon(w, 0, p)
        value = name(kept, p)
    w.emit(py.Return(value, **p))


def write_try(node: ast.Try, w: Writer, dest: str | None) -> None:
    """``try body catches else otherwise finally final``."""
    p = w.mark(node)
    body_dest = dest if node.otherwise is None else None
    body = w.block(lambda: write_stmt(node.body, w, body_dest))
    handlers = []
    if node.catches:
        caught = w.fresh("_e")
        handled = w.block(lambda: write_catches(w, list(node.catches), caught, dest, p))
        handlers.append(except_("Exception", caught, handled or [py.Pass(**p)], p))
    otherwise = [] if node.otherwise is None else w.block(partial(write_stmt, node.otherwise, w, dest))
    guarded: list[py.stmt] = [try_(body, handlers, otherwise, [], p)] if handlers else [*body, *otherwise]
    final = [] if node.final is None else make_final(node, w, node.final)
    if final:
        write_final(w, guarded, final, p)
    else:
        w.emit(*guarded)


def write_final(w: Writer, body: list[py.stmt], final: list[py.stmt], p: Pos) -> None:
    """Statements with a ``finally`` clause.

    A signal that ends the job or leaves a tag goes on after the clause, even if the clause ends with an error or a
    jump, which would replace it in Python.  An aborted job does not run the clause.
    """
    ending, thrown, later = w.fresh("_s"), w.fresh("_e"), w.fresh("_e")
    none = const(None, p)
    runs = is_(attr(name(ending, p), "__class__", p), name("JobAborted", p), p, negated=True)
    unless_ending = if_(is_(name(ending, p), none, p), [raise_(None, p)], [], p)
    outlasting = call("outlasting", [name(ending, p), name(later, p)], p)
    go_on = try_([raise_(name(ending, p), p)], [], [], [set_(ending, none, p)], p)  # no cycle with its traceback
    clause = try_(
        [if_(runs, final, [], p)],
        [except_("BaseException", later, [unless_ending, set_(ending, outlasting, p)], p)],
        [],
        [if_(is_(name(ending, p), none, p, negated=True), [go_on], [], p)],
        p,
    )
    caught = except_("ENDINGS", thrown, [set_(ending, name(thrown, p), p)], p)
    w.emit(set_(ending, none, p), try_(body, [caught], [], [clause], p))


def make_final(node: ast.Try, w: Writer, clause: ast.Node) -> list[py.stmt]:
    """The ``finally`` clause.

    CPython compiles one copy of it for each way out of the ``try``, and copies of these for clauses nested in it: a
    short text could grow without end.  In that case the clause becomes a separate function.
    """
    if clause.bound.apart:
        p = w.mark(clause)
        return [do(call(make_thunk(clause, w), [], p), p)]
    outer = w.copies
    w.copies = outer * (2 + count_nodes(node, w, (ast.Return, ast.Break, ast.Continue)))
    if w.copies * count_nodes(clause, w, (ast.Node,)) > MAX_COPIED_NODES:
        raise errors.TooDeep
    made = w.block(lambda: write_stmt(clause, w, None))
    w.copies = outer
    return made


def write_catches(w: Writer, catches: list[ast.Catch], caught: str, dest: str | None, p: Pos) -> None:
    """The first catch clause, and the others in its else."""
    if not catches:
        w.emit(raise_(None, p))
        return
    catch, rest = catches[0], catches[1:]
    if catch.pattern is None:
        w.emit(do(call("caught", [name(caught, p)], p), p))
        write_stmt(catch.body, w, dest)
        return
    hit = w.fresh()
    w.emit(set_(hit, const(False, p), p))
    write_match(catch.pattern, w, catch.guard, call("caught", [name(caught, p)], p), hit, p)
    then = w.block(lambda: write_stmt(catch.body, w, dest))
    otherwise = w.block(lambda: write_catches(w, rest, caught, dest, p))
    w.emit(if_(name(hit, p), then, otherwise, p))


def write_throw(node: ast.Throw, w: Writer, dest: str | None) -> None:
    """``throw value``."""
    p = w.mark(node)
    if node.value is None:
        w.emit(raise_(None, p))
    else:
        w.emit(raise_(call("thrown", [make_value(node.value, w)], p), p))


def count_nodes(node: ast.Node, w: Writer, kinds: tuple[type[ast.Node], ...]) -> int:
    """How many nodes of these kinds there are in a node, itself included."""
    found, todo = 0, [node]
    while todo:
        w.pace.step()
        each = todo.pop()
        found += isinstance(each, kinds)
        todo.extend(children(each))
    return found
