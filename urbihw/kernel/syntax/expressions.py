"""The nodes of the expression rules of the grammar.

A function is named after a rule of urbiscript.lark, or after its alias.  It gets the span of the rule and the values
of its symbols, keywords and signs left out unless the rule begins with ``!``.  Lists stay Python lists while they grow,
so that a long one costs linear time; the node they end in takes a tuple.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.rules import Problem, Problems, RuleSet
from urbihw.kernel.syntax.tokens import CONSTANTS, Token, shown

RULES = RuleSet()

Args = list[Node]


class DeclaredPlace(NamedTuple):
    """What ``var``, ``class`` or ``function`` declares: a name, or a slot of a target.  Errors point at ``span``."""

    target: Node | None
    name: str
    span: Span


# ------------------------------------------------------------ lists that grow


@RULES.rule
def none(_span: Span) -> None:
    """An optional part that is absent."""
    return


@RULES.rule
def list_empty(_span: Span) -> list[object]:
    return []


@RULES.rule
def list_first(_span: Span, first: object) -> list[object]:
    return [first]


@RULES.rule
def list_next(_span: Span, items: list[object], item: object) -> list[object]:
    items.append(item)
    return items


@RULES.rule
def list_same(_span: Span, items: list[object]) -> list[object]:
    return items


# ------------------------------------------------------------ assignments and declarations


@RULES.reporting_rule
def assign(problems: Problems, span: Span, place: Node, value: Node, modifiers: list[tuple[Token, Node]]) -> Node:
    slot = isinstance(place, ast.Call) and place.args is None
    _is_constant(problems, place)
    if modifiers and not slot:
        problems.append(Problem(f"unexpected {shown('NAME')}", modifiers[0][0].span))
    if isinstance(place, ast.Call) and place.name == "[]" and place.args is not None:
        return ast.Call(place.target, "[]=", (*place.args, value), span=span)
    return ast.Assign(place, value, tuple((name.text, value) for name, value in modifiers), span=span)


@RULES.rule
def modifier(_span: Span, name: Token, value: Node) -> tuple[Token, Node]:
    return name, value


@RULES.reporting_rule
def assign_operator(problems: Problems, span: Span, place: Node, operator: Token, value: Node) -> Node:
    _variable(problems, place, operator)
    return ast.OpAssign(place, operator.text, value, span=span)


@RULES.reporting_rule
def step_operator(problems: Problems, span: Span, place: Node, operator: Token) -> Node:
    _variable(problems, place, operator)
    return ast.Postfix(place, operator.text, span=span)


def _is_constant(problems: Problems, place: Node) -> bool:
    """Report a value where a variable should stand: ``nil``, ``this``."""
    match place:
        case ast.Call(target=None, args=None, name=name) if name in CONSTANTS:
            problems.append(Problem(f"`{name}' is a constant, no variable", place.span))
        case ast.This():
            problems.append(Problem("`this' is the object itself, no variable", place.span))
        case _:
            return False
    return True


def _variable(problems: Problems, place: Node, operator: Token) -> None:
    """Report an operand that cannot be modified in place."""
    if _is_constant(problems, place):
        return
    match place:
        case ast.Property() | ast.Call(args=None) | ast.Call(name="[]"):
            return
    problems.append(Problem(f"unexpected {shown(operator.kind)}", operator.span))


@RULES.rule
def declaration(span: Span, place: DeclaredPlace) -> Node:
    return ast.Var(place.target, place.name, place=place.span, span=span)


@RULES.rule
def declaration_const(span: Span, place: DeclaredPlace) -> Node:
    return ast.Var(place.target, place.name, None, True, place.span, span=span)


@RULES.rule
def declare(span: Span, variable: ast.Var, value: Node) -> Node:
    return replace(variable, value=value, span=span)


@RULES.rule
def place_name(_span: Span, name: Token) -> DeclaredPlace:
    return DeclaredPlace(None, name.text, name.span)


@RULES.rule
def place_member(_span: Span, target: Node, name: Token) -> DeclaredPlace:
    return DeclaredPlace(target, name.text, target.span)


@RULES.rule
def owner(span: Span, name: Token) -> Node:
    return ast.Call(None, name.text, span=span)


# ------------------------------------------------------------ operators


@RULES.rule
def or_(span: Span, left: Node, right: Node) -> Node:
    return ast.Or(left, right, span=span)


@RULES.rule
def and_(span: Span, left: Node, right: Node) -> Node:
    return ast.And(left, right, span=span)


@RULES.rule
def has(span: Span, item: Node, container: Node) -> Node:
    return ast.Call(container, "has", (item,), span=span)


@RULES.rule
def has_not(span: Span, item: Node, container: Node) -> Node:
    return ast.Call(container, "hasNot", (item,), span=span)


@RULES.rule
def binary(span: Span, left: Node, operator: Token, right: Node) -> Node:
    return ast.Call(left, operator.text, (right,), span=span)


# The arguments are () and not None: `(-x) = 3` is a pattern, not an assignment to the slot '-'.
@RULES.rule
def negate(span: Span, operand: Node) -> Node:
    return ast.Call(operand, "!", (), span=span)


@RULES.rule
def minus(span: Span, operand: Node) -> Node:
    return ast.Call(operand, "-", (), span=span)


@RULES.rule
def plus(span: Span, operand: Node) -> Node:
    return ast.Call(operand, "+", (), span=span)


@RULES.rule
def complement(span: Span, operand: Node) -> Node:
    return ast.Call(operand, "compl", (), span=span)


# ------------------------------------------------------------ messages


@RULES.rule
def send(span: Span, target: Node, name: Token, args: Args | None = None) -> Node:
    return ast.Call(target, name.text, None if args is None else tuple(args), span=span)


@RULES.rule
def slot_of(span: Span, target: Node, name: Token) -> Node:
    """``o.&name``: the value of a slot, not called."""
    return ast.Call(target, "getSlot", (ast.StringLiteral(name.text, span=name.span),), span=span)


@RULES.rule
def slot_here(span: Span, name: Token) -> Node:
    """``&name``: the value of a slot of ``this``, not called."""
    return ast.Call(None, "getSlot", (ast.StringLiteral(name.text, span=name.span),), span=span)


@RULES.rule
def subscript(span: Span, target: Node, args: Args) -> Node:
    return ast.Call(target, "[]", tuple(args), span=span)


@RULES.reporting_rule
def property_(problems: Problems, span: Span, slot: Node, arrow: Token, name: Token) -> Node:
    if isinstance(slot, ast.Call) and slot.args is None:
        return ast.Property(slot, name.text, span=span)
    problems.append(Problem(f"unexpected {shown(arrow.kind)}", arrow.span))
    return slot


@RULES.rule
def variable(span: Span, name: Token, args: Args | None = None) -> Node:
    return ast.Call(None, name.text, None if args is None else tuple(args), span=span)


@RULES.rule
def new(span: Span, args: Args | None = None) -> Node:
    return ast.Call(None, "new", None if args is None else tuple(args), span=span)


@RULES.reporting_rule
def new_old(problems: Problems, span: Span, path: list[Token], args: Args | None = None) -> Node:
    problems.append(Problem("`new Obj(x)' is deprecated, use `Obj.new(x)'", span, warning=True))
    target: Node | None = None
    for name in path:
        start = path[0].span
        target = ast.Call(target, name.text, span=start.to(name.span))
    return ast.Call(target, "new", None if args is None else tuple(args), span=span)


@RULES.rule
def assert_(span: Span, args: Args) -> Node:
    if len(args) == 1:
        return ast.Assert(tuple(args), span=span)
    return ast.Call(None, "assert", tuple(args), span=span)


@RULES.rule
def arguments(_span: Span, args: Args) -> Args:
    return args


# ------------------------------------------------------------ literals


@RULES.rule
def float_(span: Span, token: Token) -> Node:
    assert isinstance(token.value, float)
    return ast.Float(token.value, span=span)


@RULES.rule
def durations(span: Span, tokens: list[Token]) -> Node:
    return ast.Float(sum(token.value for token in tokens if isinstance(token.value, float)), span=span)


@RULES.rule
def strings(span: Span, tokens: list[Token]) -> Node:
    return ast.StringLiteral("".join(token.text for token in tokens), span=span)


@RULES.rule
def binary_old(span: Span, token: Token) -> Node:
    assert isinstance(token.value, tuple)
    args = tuple(ast.StringLiteral(text, span=span) for text in token.value)
    return ast.Call(ast.Call(None, "Binary", span=span), "new", args, span=span)


@RULES.rule
def list_literal(span: Span, items: Args | None = None) -> Node:
    return ast.ListLit(tuple(items or ()), span=span)


@RULES.rule
def dictionary(span: Span, pairs: list[tuple[Node, Node]] | None = None) -> Node:
    return ast.DictLit(tuple(pairs or ()), span=span)


@RULES.rule
def pair(_span: Span, key: Node, value: Node) -> tuple[Node, Node]:
    return key, value


@RULES.rule
def tuple_literal(span: Span, items: Args | None = None) -> Node:
    return ast.TupleLit(tuple(items or ()), span=span)


@RULES.rule
def tuple_longer(span: Span, items: Args, last: Node) -> Node:
    return ast.TupleLit((*items, last), span=span)


@RULES.rule
def broken_group(span: Span, _error: object) -> Node:
    return ast.Empty(span=span)


@RULES.rule
def this(span: Span) -> Node:
    return ast.This(span=span)


@RULES.rule
def call(span: Span) -> Node:
    return ast.CallKeyword(span=span)


# ------------------------------------------------------------ functions


@RULES.rule
def function(span: Span, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
    return ast.Function(False, None if formals is None else tuple(formals), body, span=span)


@RULES.rule
def closure(span: Span, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
    return ast.Function(True, None if formals is None else tuple(formals), body, span=span)


@RULES.rule
def formal(span: Span, _var: Token | None, name: Token, default: Node | None = None) -> Node:
    return ast.Formal(name.text, default, span=span)


@RULES.rule
def formal_rest(span: Span, _var: Token | None, name: Token) -> Node:
    return ast.Formal(name.text, None, True, span=span)


@RULES.rule
def do(span: Span, target: Node, body: ast.Scope) -> Node:
    return ast.Do(target, body, span=span)
