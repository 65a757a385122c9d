"""The code generator: one top-level statement to one Python function of ``this``; the tables of visitors."""

from __future__ import annotations

import ast as py
from typing import Final

from urbihw.kernel.compiler import (
    concurrency,
    conditions,
    expressions,
    functions,
    loops,
    operators,
    places,
    statements,
)
from urbihw.kernel.compiler.emit import function
from urbihw.kernel.compiler.scopes import Binding
from urbihw.kernel.compiler.visit import write_stmt, write_tagged_scope
from urbihw.kernel.compiler.writer import RETURN, Expressions, Statements, Writer
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.pace import StepPace

EXPRESSIONS: Final[Expressions] = {
    ast.Float: expressions.make_float,
    ast.StringLiteral: expressions.make_string,
    ast.ListLit: expressions.make_list_literal,
    ast.TupleLit: expressions.make_tuple_literal,
    ast.DictLit: expressions.make_dictionary,
    ast.This: expressions.make_this,
    ast.CallKeyword: expressions.make_call_message,
    ast.Call: expressions.make_call,
    ast.External: expressions.make_external,
    ast.Property: expressions.make_property,
    ast.And: operators.make_and,
    ast.Or: operators.make_or,
    ast.Function: functions.make_function,
    ast.Emit: conditions.make_emit,
}
"""The visitors of nodes that become Python expressions."""

STATEMENTS: Final[Statements] = {
    ast.Var: places.write_var,
    ast.Assign: places.write_assign,
    ast.OpAssign: places.write_op_assign,
    ast.Postfix: places.write_postfix,
    ast.Do: functions.write_do,
    ast.Class: functions.write_class,
    ast.Assert: functions.write_assert,
    ast.Empty: statements.write_empty,
    ast.Scope: statements.write_scope,
    ast.Pipe: statements.write_pipe,
    ast.If: statements.write_if,
    ast.Switch: statements.write_switch,
    ast.Return: statements.write_return,
    ast.Try: statements.write_try,
    ast.Throw: statements.write_throw,
    ast.While: loops.write_while,
    ast.For: loops.write_for,
    ast.ForEach: loops.write_for_each,
    ast.Every: loops.write_every,
    ast.Break: loops.write_break,
    ast.Continue: loops.write_continue,
    ast.Seq: concurrency.write_seq,
    ast.Par: concurrency.write_par,
    ast.Tagged: concurrency.write_tagged,
    ast.Guarded: concurrency.write_guarded,
    ast.At: conditions.write_at,
    ast.Whenever: conditions.write_whenever,
    ast.WaitUntil: conditions.write_wait_until,
}
"""The visitors of nodes that become Python statements; they deliver the value if it is needed."""


def write_unit(node: ast.Node, binding: Binding, generic: bool, pace: StepPace) -> tuple[py.FunctionDef, Writer]:
    """The function ``statement(this)`` of a bound statement, and the writer with the tables of its unit."""
    w = Writer(binding, EXPRESSIONS, STATEMENTS, generic, pace)
    p = w.mark(node)
    top = binding.top
    assert top.this is not None
    body = w.block(lambda: write_tagged_scope(w, top.scope_tag, lambda: write_stmt(node, w, RETURN), p))
    return function("statement", [top.this.python], body, p), w
