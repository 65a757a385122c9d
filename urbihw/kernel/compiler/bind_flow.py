"""Binding: composition of statements, flow control, events and tags."""

from __future__ import annotations

from urbihw.kernel.compiler.bind_names import bind_pattern, bind_values
from urbihw.kernel.compiler.scopes import NameScope, binding_names
from urbihw.kernel.compiler.walk import SCOPE_TAG, Binder
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame

# ---------------------------------------------------------------- composition and flow


def bind_scope(node: ast.Scope, b: Binder) -> None:
    """``{ body }``."""
    b.scope = NameScope(b.scope, b.frame, slots=False, block=True)
    b.walk(node.body)
    tag = b.scope.names.get(SCOPE_TAG)
    if tag is not None:
        b.bound(node).scope_tag = tag
    b.leave_scope()


def bind_seq(node: ast.Seq, b: Binder) -> None:
    """Statements, some of them in the background."""
    for item, separator in node.items:
        if separator == ",":
            bind_background(item, b)
        else:
            b.walk(item)


def bind_background(item: ast.Node, b: Binder) -> None:
    """A statement that is a job; a ``var`` there belongs to the scope around it."""
    if isinstance(item, ast.Var) and item.target is None and not b.scope.slots:
        local = b.declare(item.name)
        local.captured = local.assigned = local.maybe_void = True
        b.bound(item).local = local
        if item.value is not None:
            b.framed(item.value).free[local] = None
    else:
        b.framed(item)


def bind_par(node: ast.Par, b: Binder) -> None:
    """Bind statements that run as parallel jobs."""
    for item in node.items:
        bind_background(item, b)


def bind_if(node: ast.If, b: Binder) -> None:
    """``if``: variables that the condition declares are visible in both branches."""
    b.enter_scope()
    b.walk(node.cond)
    b.scoped(node.then)
    b.scoped(node.otherwise)
    b.leave_scope()


def bind_while(node: ast.While, b: Binder) -> None:
    """``while (cond) body``."""
    bind_loop(node.cond, node.body, node.flavor == ",", b)


def bind_every(node: ast.Every, b: Binder) -> None:
    """``every (period) body``."""
    bind_loop(node.period, node.body, node.flavor == ",", b)


def bind_loop(head: ast.Node | None, body: ast.Node, apart: bool, b: Binder) -> None:
    """A loop whose head is evaluated in each turn; ``apart`` when each turn of the body is a job of its own."""
    b.enter_turn(body)
    b.enter_scope()
    b.walk(head)
    if apart:
        b.framed(body)
    else:
        b.walk(body)
    b.leave_scope()
    b.leave_turn()


def bind_for(node: ast.For, b: Binder) -> None:
    """``for (init; cond; step) body``."""
    b.enter_scope()
    b.walk(node.init)
    b.enter_turn(node.body)
    b.walk(node.cond)
    if node.flavor == ",":
        b.framed(node.body)
    else:
        b.scoped(node.body)
    b.bodies.pop()
    b.walk(node.step)
    b.frame.loops -= 1
    b.leave_scope()


def bind_for_each(node: ast.ForEach, b: Binder) -> None:
    """``for (var name : items) body``."""
    b.walk(node.items)
    b.enter_turn(node.body)
    b.enter_scope()
    if node.name is not None:
        b.bound(node).local = b.declare(node.name)
    if node.flavor == "&":
        b.framed(node.body)
    else:
        b.walk(node.body)
    b.leave_scope()
    b.leave_turn()


def bind_switch(node: ast.Switch, b: Binder) -> None:
    """``switch (value) { cases }``."""
    b.walk(node.value)
    for case in node.cases:
        bind_clause(case, b)


def bind_clause(clause: ast.Case | ast.Catch, b: Binder) -> None:
    """A pattern, a guard and a body in a scope of their own."""
    b.enter_scope()
    if clause.pattern is not None:
        bind_pattern(clause.pattern, b)
    b.walk(clause.guard)
    b.walk(clause.body)
    b.leave_scope()


def bind_try(node: ast.Try, b: Binder) -> None:
    """``try``; the ``finally`` clause is a function where nesting is deep, see ``statements.make_final``."""
    b.walk(node.body)
    for catch in node.catches:
        bind_clause(catch, b)
    b.walk(node.otherwise)
    if b.apart and node.final is not None:
        b.bound(node.final).apart = True
        b.framed(node.final)
    else:
        b.walk(node.final)


def bind_return(node: ast.Return, b: Binder) -> None:
    """``return``, perhaps from another job."""
    b.walk(node.value)
    frame = b.function_around()
    if frame is not None and frame is not b.frame:
        frame.returns_through = True


def bind_assert(node: ast.Assert, b: Binder) -> None:
    """``assert``: the arguments of a claim become functions, so that the message can show their values."""
    for claim in node.claims:
        if not isinstance(claim, ast.Call):
            b.walk(claim)
            continue
        b.use_this(claim)
        if claim.target is None:
            b.bound(claim).local = b.lookup(claim.name)
        else:
            b.walk(claim.target)
        for argument in claim.args or ():
            b.framed(argument)


# ---------------------------------------------------------------- time, events, tags


def bind_tagged(node: ast.Tagged, b: Binder) -> None:
    """``tag: body``."""
    b.use_this(node)
    b.walk(node.tag)
    b.walk(node.body)


def bind_at(node: ast.At, b: Binder) -> None:
    """``at``: both bodies receive what the pattern binds."""
    patterns = bind_condition(node.cond, b)
    b.framed(node.body, patterns)
    if node.leave is not None:
        b.framed(node.leave, patterns)


def bind_whenever(node: ast.Whenever, b: Binder) -> None:
    """``whenever``: the body receives what the pattern binds."""
    patterns = bind_condition(node.cond, b)
    b.framed(node.body, patterns)
    if node.otherwise is not None:
        b.framed(node.otherwise)


def bind_wait_until(node: ast.WaitUntil, b: Binder) -> None:
    """``waituntil`` declares what the pattern binds here."""
    patterns = bind_condition(node.cond, b)
    b.declare_all(binding_names(patterns), node)


def bind_condition(cond: ast.EventCond | ast.ExprCond, b: Binder) -> tuple[ast.Node, ...]:
    """A condition on an event or on an expression; its patterns."""
    b.walk(cond.duration)
    if isinstance(cond, ast.ExprCond):
        b.framed(cond.expr)
        return ()
    b.walk(cond.event)
    patterns = cond.patterns or ()
    frame = b.bound(cond).frame = FunctionFrame(b.frame)
    outer = (b.frame, b.scope)
    b.frame, b.scope = frame, NameScope(b.scope, frame, slots=False)
    for pattern in patterns:
        bind_values(pattern, b)
    frame.params = [b.declare(name) for name in binding_names(patterns)]
    b.walk(cond.guard)
    b.frame, b.scope = outer
    return patterns


def bind_guarded(node: ast.Guarded, b: Binder) -> None:
    """``timeout``, ``stopif``, ``freezeif``."""
    cond = node.cond.expr if isinstance(node.cond, ast.ExprCond) else node.cond
    if node.kind == "timeout":
        b.walk(cond)
    elif isinstance(node.cond, ast.EventCond):
        bind_condition(node.cond, b)
    else:
        b.framed(cond)
    b.walk(node.body)
