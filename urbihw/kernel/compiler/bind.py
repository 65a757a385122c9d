"""Binding: which names are local variables, in which functions they are, and which inner functions capture them.

A *frame* becomes one Python function: the statement itself, each function literal, and each piece of code that runs as
a job of its own or later (the parts of ``&``, what stands before ``,``, conditions and bodies of ``at``, lazy
arguments).  A frame contains nested *scopes*; a scope maps names to ``Local``s.  The scopes of a top-level statement
and of a ``do`` or ``class`` body make slots instead of locals.  ``this`` and ``call`` are locals too, under those
names.

A local that an inner frame reads is *captured*; one that is captured and assigned again is kept in a ``Box``, so
that all frames (and watched conditions) see the change.  A local declared inside a loop is a fresh one in each turn:
an inner function that captures it is made by a factory taking it as a parameter.

A visitor is a function of a node and of the ``Binder``.  It stores its results on the node
(``syntax.binding.BoundNode``).  ``VISITORS`` has the visitor of each class of nodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from urbihw.kernel.compiler import bind_flow, bind_names
from urbihw.kernel.compiler.scopes import Binding, NameScope
from urbihw.kernel.compiler.walk import SCOPE_TAG, Binder, Visitors
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.pace import StepPace

VISITORS: Final[Visitors] = {
    ast.This: bind_names.bind_this,
    ast.CallKeyword: bind_names.bind_call_message,
    ast.Call: bind_names.bind_operation,
    ast.And: bind_names.bind_operation,
    ast.Or: bind_names.bind_operation,
    ast.Property: bind_names.bind_property,
    ast.Var: bind_names.bind_var,
    ast.Assign: bind_names.bind_assign,
    ast.OpAssign: bind_names.bind_op_assign,
    ast.Postfix: bind_names.bind_postfix,
    ast.Function: bind_names.bind_function,
    ast.Do: bind_names.bind_do,
    ast.Class: bind_names.bind_class,
    ast.Scope: bind_flow.bind_scope,
    ast.Seq: bind_flow.bind_seq,
    ast.Par: bind_flow.bind_par,
    ast.If: bind_flow.bind_if,
    ast.While: bind_flow.bind_while,
    ast.For: bind_flow.bind_for,
    ast.ForEach: bind_flow.bind_for_each,
    ast.Every: bind_flow.bind_every,
    ast.Switch: bind_flow.bind_switch,
    ast.Try: bind_flow.bind_try,
    ast.Return: bind_flow.bind_return,
    ast.Assert: bind_flow.bind_assert,
    ast.Tagged: bind_flow.bind_tagged,
    ast.At: bind_flow.bind_at,
    ast.Whenever: bind_flow.bind_whenever,
    ast.WaitUntil: bind_flow.bind_wait_until,
    ast.Guarded: bind_flow.bind_guarded,
}


def bind(
    node: ast.Node,
    lazy_names: Iterable[str],
    late: Iterable[str] = (),
    apart: bool = False,
    pace: StepPace | None = None,
) -> Binding:
    """Find the local variables of one top-level statement; ``late`` are names of variables of a waiting frame.

    ``apart``: code that is nested too deep in loops, tags and ``try``s becomes a separate function.  Raises TooDeep,
    and TooLong for a statement that captures too many variables; the nodes are unchanged then.
    """
    binder = Binder(VISITORS, lazy_names, apart, pace or StepPace())
    for name in late:
        local = binder.declare(name)
        local.late = local.maybe_void = True
    binder.scope = NameScope(binder.scope, binder.frame, slots=True, block=True)
    try:
        binder.bound(node)
        binder.walk(node)
    except BaseException:
        binder.result.release()
        raise
    binder.frame.scope_tag = binder.scope.names.get(SCOPE_TAG)
    return binder.result
