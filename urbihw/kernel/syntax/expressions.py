"""What each expression rule of the grammar makes.

A method is named after a rule of urbiscript.lark, or after its alias.  It gets the span of the rule and the values of
its symbols, keywords and signs left out unless the rule begins with ``!``.  Lists stay Python lists while they grow,
so that a long one costs linear time; the node they end in takes a tuple.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.tokens import Token, shown

Args = list[Node]


@dataclass(frozen=True, slots=True)
class Problem:
    """Something to say about a stretch of the statement; a warning does not keep it from running."""

    message: str
    span: Span
    warning: bool = False


class Place(NamedTuple):
    """What ``var``, ``class`` or ``function`` declares: a name, or a slot of a target; errors point at ``span``."""

    target: Node | None
    name: str
    span: Span


class Expressions:
    """The rules from ``expression`` to the end of the grammar."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def problem(self, message: str, span: Span) -> None:
        """Report a syntax error."""
        self.problems.append(Problem(message, span))

    # ------------------------------------------------------------ lists that grow

    def none(self, _span: Span) -> None:
        """An optional part that is absent."""
        return

    def list_empty(self, _span: Span) -> list[object]:
        return []

    def list_first(self, _span: Span, first: object) -> list[object]:
        return [first]

    def list_next(self, _span: Span, items: list[object], item: object) -> list[object]:
        items.append(item)
        return items

    def list_same(self, _span: Span, items: list[object]) -> list[object]:
        return items

    # ------------------------------------------------------------ assignments and declarations

    def assign(self, span: Span, place: Node, value: Node, modifiers: list[tuple[Token, Node]]) -> Node:
        slot = isinstance(place, ast.Call) and place.args is None
        if modifiers and not slot:
            self.problem(f"unexpected {shown('NAME')}", modifiers[0][0].span)
        if isinstance(place, ast.Call) and place.name == "[]" and place.args is not None:
            return ast.Call(place.target, "[]=", (*place.args, value), span=span)
        return ast.Assign(place, value, tuple((name.text, value) for name, value in modifiers), span=span)

    def modifier(self, _span: Span, name: Token, value: Node) -> tuple[Token, Node]:
        return name, value

    def assign_operator(self, span: Span, place: Node, operator: Token, value: Node) -> Node:
        self._variable(place, operator)
        return ast.OpAssign(place, operator.text, value, span=span)

    def step_operator(self, span: Span, place: Node, operator: Token) -> Node:
        self._variable(place, operator)
        return ast.Postfix(place, operator.text, span=span)

    def _variable(self, place: Node, operator: Token) -> None:
        """Refuse what cannot be changed in place."""
        match place:
            case ast.Property() | ast.Call(args=None) | ast.Call(name="[]"):
                return
        self.problem(f"unexpected {shown(operator.kind)}", operator.span)

    def declaration(self, span: Span, place: Place) -> Node:
        return ast.Var(place.target, place.name, place=place.span, span=span)

    def declaration_const(self, span: Span, place: Place) -> Node:
        return ast.Var(place.target, place.name, None, True, place.span, span=span)

    def declare(self, span: Span, variable: ast.Var, value: Node) -> Node:
        return replace(variable, value=value, span=span)

    def place_name(self, _span: Span, name: Token) -> Place:
        return Place(None, name.text, name.span)

    def place_member(self, _span: Span, target: Node, name: Token) -> Place:
        return Place(target, name.text, target.span)

    def owner(self, span: Span, name: Token) -> Node:
        return ast.Call(None, name.text, span=span)

    # ------------------------------------------------------------ operators

    def or_(self, span: Span, left: Node, right: Node) -> Node:
        return ast.Or(left, right, span=span)

    def and_(self, span: Span, left: Node, right: Node) -> Node:
        return ast.And(left, right, span=span)

    def has(self, span: Span, item: Node, container: Node) -> Node:
        return ast.Call(container, "has", (item,), span=span)

    def has_not(self, span: Span, item: Node, container: Node) -> Node:
        return ast.Call(container, "hasNot", (item,), span=span)

    def binary(self, span: Span, left: Node, operator: Token, right: Node) -> Node:
        return ast.Call(left, operator.text, (right,), span=span)

    # The arguments are () and not None: `(-x) = 3` is a pattern, not an assignment to the slot '-'.
    def negate(self, span: Span, operand: Node) -> Node:
        return ast.Call(operand, "!", (), span=span)

    def minus(self, span: Span, operand: Node) -> Node:
        return ast.Call(operand, "-", (), span=span)

    def plus(self, span: Span, operand: Node) -> Node:
        return ast.Call(operand, "+", (), span=span)

    def complement(self, span: Span, operand: Node) -> Node:
        return ast.Call(operand, "compl", (), span=span)

    # ------------------------------------------------------------ messages

    def send(self, span: Span, target: Node, name: Token, args: Args | None = None) -> Node:
        return ast.Call(target, name.text, None if args is None else tuple(args), span=span)

    def subscript(self, span: Span, target: Node, args: Args) -> Node:
        return ast.Call(target, "[]", tuple(args), span=span)

    def property(self, span: Span, slot: Node, arrow: Token, name: Token) -> Node:
        if isinstance(slot, ast.Call) and slot.args is None:
            return ast.Property(slot, name.text, span=span)
        self.problem(f"unexpected {shown(arrow.kind)}", arrow.span)
        return slot

    def variable(self, span: Span, name: Token, args: Args | None = None) -> Node:
        return ast.Call(None, name.text, None if args is None else tuple(args), span=span)

    def new(self, span: Span, args: Args | None = None) -> Node:
        return ast.Call(None, "new", None if args is None else tuple(args), span=span)

    def new_old(self, span: Span, path: list[Token], args: Args | None = None) -> Node:
        self.problems.append(Problem("`new Obj(x)' is deprecated, use `Obj.new(x)'", span, warning=True))
        target: Node | None = None
        for name in path:
            start = path[0].span
            target = ast.Call(target, name.text, span=start.to(name.span))
        return ast.Call(target, "new", None if args is None else tuple(args), span=span)

    def assert_(self, span: Span, args: Args) -> Node:
        if len(args) == 1:
            return ast.Assert(tuple(args), span=span)
        return ast.Call(None, "assert", tuple(args), span=span)

    def arguments(self, _span: Span, args: Args) -> Args:
        return args

    # ------------------------------------------------------------ literals

    def float_(self, span: Span, token: Token) -> Node:
        assert isinstance(token.value, float)
        return ast.Float(token.value, span=span)

    def durations(self, span: Span, tokens: list[Token]) -> Node:
        return ast.Float(sum(token.value for token in tokens if isinstance(token.value, float)), span=span)

    def strings(self, span: Span, tokens: list[Token]) -> Node:
        return ast.String("".join(token.text for token in tokens), span=span)

    def binary_old(self, span: Span, token: Token) -> Node:
        assert isinstance(token.value, tuple)
        args = tuple(ast.String(text, span=span) for text in token.value)
        return ast.Call(ast.Call(None, "Binary", span=span), "new", args, span=span)

    def list_literal(self, span: Span, items: Args | None = None) -> Node:
        return ast.ListLit(tuple(items or ()), span=span)

    def dictionary(self, span: Span, pairs: list[tuple[Node, Node]] | None = None) -> Node:
        return ast.DictLit(tuple(pairs or ()), span=span)

    def pair(self, _span: Span, key: Node, value: Node) -> tuple[Node, Node]:
        return key, value

    def tuple_literal(self, span: Span, items: Args | None = None) -> Node:
        return ast.TupleLit(tuple(items or ()), span=span)

    def tuple_longer(self, span: Span, items: Args, last: Node) -> Node:
        return ast.TupleLit((*items, last), span=span)

    def broken_group(self, span: Span, _error: object) -> Node:
        return ast.Empty(span=span)

    def this(self, span: Span) -> Node:
        return ast.This(span=span)

    def call(self, span: Span) -> Node:
        return ast.CallMessage(span=span)

    # ------------------------------------------------------------ functions

    def function(self, span: Span, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
        return ast.Function(False, None if formals is None else tuple(formals), body, span=span)

    def closure(self, span: Span, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
        return ast.Function(True, None if formals is None else tuple(formals), body, span=span)

    def formal(self, span: Span, _var: Token | None, name: Token, default: Node | None = None) -> Node:
        return ast.Formal(name.text, default, span=span)

    def formal_rest(self, span: Span, _var: Token | None, name: Token) -> Node:
        return ast.Formal(name.text, None, True, span=span)

    def do(self, span: Span, target: Node, body: ast.Scope) -> Node:
        return ast.Do(target, body, span=span)
