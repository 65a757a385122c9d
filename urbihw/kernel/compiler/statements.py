"""Sequential flow control: choices, loops, jumps and exceptions."""

from __future__ import annotations

import ast as py
from typing import Any

from urbihw.kernel import errors
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
    is_pure,
    name,
    raise_,
    set_,
    try_,
)
from urbihw.kernel.compiler.functions import Functions
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.check import children

MOST_COPIED = 20_000
"""The most nodes that all copies of a ``finally`` clause may have; compiling that many takes a fifth of a second."""


class Statements(Functions):
    """The statements of one job."""

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

    def loop(self, write: Any, inside: ast.Node, p: Pos) -> None:
        """Write a loop by ``write(loop)``, and around it what catches a break from another job.

        If ``inside`` detaches jobs and has a break, the loop is under a tag of its own, for the break to stop them.
        """
        self.counter += 1
        loop = Loop(self.w, self.counter)
        if id(inside) in self.binding.detaching and self.has(inside, ast.Break):
            loop.detached = self.fresh("_d")
            self.emit(set_(loop.detached, call("loop_tag", [], p), p))
        self.w.loops.append(loop)
        body = self.block(lambda: write(loop))
        self.w.loops.pop()
        if loop.crossed_break:
            self.emit(set_(loop.break_token, call("token", [], p), p))
            foreign = if_(self.not_mine(loop.break_token, p), [raise_(None, p)], [], p)
            handler = [foreign, *self.block(lambda: self.stop_detached(loop, p))]
            body = [try_(body, [except_("Leave", "_l", handler, p)], [], [], p)]
        if loop.detached:
            enter, leave = (do(call(attr(name(loop.detached, p), verb, p), [], p), p) for verb in ("enter", "exit"))
            body = [try_([enter, *body], [], [], [leave], p)]
        self.emit(*body)

    def stop_detached(self, loop: Loop, p: Pos) -> None:
        """A loop is broken: stop what it detached."""
        if loop.detached:
            self.emit(do(call(attr(name(loop.detached, p), "stop_others", p), [], p), p))

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
        if not rest or not self.has(body, ast.Continue):
            return inside + rest
        inside = inside or [py.Pass(**p)]
        once = py.For(py.Name("_once", STORE, **p), name("ONCE", p), inside, [*rest, py.Continue(**p)], None, **p)
        return [once, py.Break(**p)]

    def s_While(self, node: ast.While, dest: str | None) -> None:
        p = self.mark(node)
        if node.flavor == ",":
            self.parallel_loop(None, node.cond, node.body, None, p)
        else:
            self.loop(lambda loop: self.while_(loop, node.cond, node.body, None, node.flavor, p), node.body, p)
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
            self.loop(lambda loop: self.while_(loop, cond, node.body, node.step, node.flavor, p), node.body, p)
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
            self.loop(lambda loop: self.each(loop, node, local, items, p), node.body, p)
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
            if how == "break":
                self.stop_detached(self.w.loops[-1], p)
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
        final = [] if node.final is None else self.final(node, node.final)
        if not handlers and not final:
            self.emit(*body, *otherwise)
            return
        if not handlers:
            final = final or [py.Pass(**p)]
        self.emit(try_(body, handlers, otherwise, final, p))

    def final(self, node: ast.Try, clause: ast.Node) -> list[py.stmt]:
        """The ``finally`` clause.

        CPython compiles one copy of it for each way out of the ``try``, and copies of these for clauses nested in it:
        a short text could grow without end.  Where that was the case, the clause is a function of its own.
        """
        if id(clause) in self.binding.apart:
            p = self.mark(clause)
            return [do(call(self.thunk(clause), [], p), p)]
        outer = self.copies
        self.copies = outer * (2 + self.count(node, (ast.Return, ast.Break, ast.Continue)))
        if self.copies * self.count(clause, (ast.Node,)) > MOST_COPIED:
            raise errors.TooDeep
        made = self.block(lambda: self.stmt(clause, None))
        self.copies = outer
        return made

    def catches(self, catches: list[ast.Catch], caught: str, dest: str | None, p: Pos) -> None:
        """The first catch clause, and the others in its else."""
        if not catches:
            self.emit(raise_(None, p))
            return
        catch, rest = catches[0], catches[1:]
        if catch.pattern is None:
            self.emit(do(call("caught", [name(caught, p)], p), p))
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

    # ---------------------------------------------------------------- looking

    def count(self, node: ast.Node, kinds: tuple[type[ast.Node], ...]) -> int:
        """How many nodes of these kinds there are in a node, itself included."""
        found, todo = 0, [node]
        while todo:
            self.pace.step()
            each = todo.pop()
            found += isinstance(each, kinds)
            todo.extend(children(each))
        return found

    def has(self, node: ast.Node, kind: type[ast.Node]) -> bool:
        """Whether a loop's body has a break or ``continue`` of its own (not one of an inner loop or function)."""
        todo = [node]
        while todo:
            self.pace.step()
            each = todo.pop()
            if isinstance(each, kind):
                return True
            if not isinstance(each, ast.Function | ast.While | ast.For | ast.ForEach | ast.Every):
                todo.extend(children(each))
        return False


__all__ = ["RETURN", "Statements"]
