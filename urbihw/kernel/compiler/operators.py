"""Operators and conditions to Python expressions."""

from __future__ import annotations

import ast as py

from urbihw.kernel.compiler.emit import LOAD, attr, call, choose, const, if_, is_, is_pure, name, set_, walrus
from urbihw.kernel.compiler.operations import ARITHMETIC, COMPARISONS, EQUALITY, VERBS, is_equality, operator_of
from urbihw.kernel.compiler.visit import (
    Make,
    make_expr,
    make_in_order,
    make_operand,
    make_thunks,
    make_value,
    split_sum,
)
from urbihw.kernel.compiler.writer import Writer
from urbihw.kernel.syntax import ast

CHOICES = (ast.And, ast.Or)


def make_condition(node: ast.Node, w: Writer) -> py.expr:
    """A Python expression whose truth is that of the node."""
    if node.bound.piece:
        return make_expr(node, w)
    if isinstance(node, ast.Call) and node.target is not None and not w.generic and not node.bound.lazy:
        if node.name in COMPARISONS and node.args is not None and len(node.args) == 1:
            return make_comparison(node, w, node.target, node.args[0])
        if node.name == "!" and not node.args:
            return py.UnaryOp(py.Not(), make_condition(node.target, w), **w.mark(node))
    if isinstance(node, ast.Call) and node.target is not None and is_equality(node):
        return make_equality(node, w)
    if isinstance(node, CHOICES) and not node.bound.lazy:
        return split_sum(node, w, CHOICES, make_condition) or make_short_circuit(node, w, make_condition)
    return make_operand(node, w)


def make_operator(node: ast.Call, w: Writer) -> py.expr:
    """A call that a Python operator implements."""
    assert node.target is not None
    if not node.args:
        if node.name == "!":
            made = make_condition(node, w)
            p = w.mark(node, node.name)
            return choose(made, name("TRUE", p), name("FALSE", p), p)
        operand = make_operand(node.target, w)
        p = w.mark(node, node.name)
        if isinstance(operand, py.Constant):
            return py.BinOp(name("ZERO", p), py.Sub(), operand, **p)
        return py.UnaryOp(py.USub(), operand, **p)
    left, right = node.target, node.args[0]
    if node.name in COMPARISONS:
        return make_boolean(w, make_comparison(node, w, left, right), node)
    if node.name == "+" and isinstance(right, ast.StringLiteral):
        text = const(right.value, w.mark(right))
        return call("join", [make_operand(left, w), text], w.mark(node, node.name))
    if node.name in ARITHMETIC:
        a, b = make_in_order(w, lambda: make_operand(left, w), lambda: make_operand(right, w))
        if isinstance(a, py.Constant) and isinstance(b, py.Constant):
            a = make_expr(left, w)
        return py.BinOp(a, ARITHMETIC[node.name](), b, **w.mark(node, node.name))
    if node.name in EQUALITY:
        return make_boolean(w, make_equality(node, w), node)
    if node.name in VERBS:
        args = make_in_order(w, lambda: make_expr(left, w), lambda: make_value(right, w))
        return call(VERBS[node.name], args, w.mark(node, node.name))
    a, b = make_in_order(w, lambda: make_value(left, w), lambda: make_value(right, w))
    p = w.mark(node, node.name)
    return choose(is_(a, b, p, negated=node.name == "!=="), name("TRUE", p), name("FALSE", p), p)


def make_comparison(node: ast.Call, w: Writer, left: ast.Node, right: ast.Node) -> py.expr:
    """``left < right`` and so on: a Python bool, or the result of an object's operator."""
    a, b = make_in_order(w, lambda: make_operand(left, w), lambda: make_operand(right, w))
    return py.Compare(a, [COMPARISONS[node.name]()], [b], **w.mark(node, node.name))


def make_equality(node: ast.Call, w: Writer) -> py.expr:
    """``left == right``: a Python bool, or the result of an object's operator."""
    assert node.target is not None and node.args is not None
    left, right = node.target, node.args[0]
    args = make_in_order(w, lambda: make_operand(left, w), lambda: make_operand(right, w))
    return call(EQUALITY[node.name], args, w.mark(node, node.name))


def make_boolean(w: Writer, made: py.expr, node: ast.Node) -> py.expr:
    """A Python bool as true or false; anything else as it is."""
    p = w.mark(node)
    is_bool = is_(attr(walrus("_v", made, p), "__class__", p), name("bool", p), p)
    return choose(is_bool, choose(name("_v", p), name("TRUE", p), name("FALSE", p), p), name("_v", p), p)


def make_sent_choice(node: ast.And | ast.Or, w: Writer) -> py.expr:
    """``&&`` or ``||`` of something that may have its own: a message, unless it turns out to have the built-in one."""
    operator = operator_of(node)
    left = make_expr(node.left, w)
    thunks, nodes = make_thunks(w, (node.right,), w.mark(node))
    p, within = w.mark(node), w.mark(node, operator)
    target, right = w.fresh("_o"), w.fresh("_r")
    w.emit(set_(target, left, p), set_(right, thunks, p))
    args = [name(target, within), w.this(node, within), const(operator, within), name(right, within), nodes]
    evaluated = call(py.Subscript(name(right, p), const(0, p), LOAD, **p), [], p)
    kind = py.And() if isinstance(node, ast.And) else py.Or()
    built_in = py.BoolOp(kind, [name(target, p), evaluated], **p)
    is_built_in = call("is_built_in", [name(target, p), const(operator, p)], p)
    return choose(is_built_in, built_in, call("lazy_send", args, within), p)


def make_and(node: ast.And, w: Writer) -> py.expr:
    """``left && right``: the right side only if the left is true."""
    if node.bound.lazy:
        return make_sent_choice(node, w)
    return make_short_circuit(node, w, make_expr)


def make_or(node: ast.Or, w: Writer) -> py.expr:
    """``||``; of two events it makes a third, and their truth has no say."""
    if node.bound.lazy:
        return make_sent_choice(node, w)
    left = make_expr(node.left, w)
    right, before = w.block_of(lambda: make_expr(node.right, w))
    p = w.mark(node, "||")
    variable = w.fresh("_o")
    w.emit(set_(variable, left, p))
    event = is_(attr(name(variable, p), "__class__", p), name("Event", p), p)
    joined = choose(event, call("either", [name(variable, p), right], p), right, p)
    test = py.BoolOp(py.Or(), [event, py.UnaryOp(py.Not(), name(variable, p), **p)], **p)
    w.emit(if_(test, [*before, set_(variable, joined, p)], [], p))
    return name(variable, p)


def make_short_circuit(node: ast.And | ast.Or, w: Writer, make: Make) -> py.expr:
    """``&&`` and ``||``: the right side is evaluated only if it decides."""
    left = make(node.left, w)
    right, before = w.block_of(lambda: make(node.right, w))
    p = w.mark(node)
    both = isinstance(node, ast.And)
    if all(is_pure(statement) for statement in before):
        w.emit(*before)
        return py.BoolOp(py.And() if both else py.Or(), [left, right], **p)
    variable = w.fresh()
    w.emit(set_(variable, left, p))
    test: py.expr = name(variable, p)
    if not both:
        test = py.UnaryOp(py.Not(), test, **p)
    w.emit(if_(test, [*before, set_(variable, right, p)], [], p))
    return name(variable, p)
