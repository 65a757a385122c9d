"""The nodes of the statement rules of the grammar, from the whole statement down to expressions. The functions are
named and called as those of ``expressions`` are.
"""

from __future__ import annotations

from typing import NamedTuple

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.expressions import Args, DeclaredPlace, function
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.rules import Problem, Problems, RuleSet
from urbihw.kernel.syntax.tokens import Token

RULES = RuleSet()

Condition = ast.EventCond | ast.ExprCond


class StatementCommand(NamedTuple):
    """A whole statement of a connection: its node, None if empty or broken, and the token that ended it."""

    node: Node | None
    ending: Token


class Each(NamedTuple):
    """The head of a for over items: the name of the loop variable, if any, and the items."""

    name: str | None
    items: Node


def _flavor(token: Token | None, default: str) -> str:
    return default if token is None else token.kind


@RULES.rule
def complete(_span: Span, node: Node, ending: Token) -> StatementCommand:
    return StatementCommand(node, ending)


@RULES.rule
def nothing(_span: Span, *symbols: Token) -> StatementCommand:
    return StatementCommand(None, symbols[-1])


# ------------------------------------------------------------ composition


@RULES.rule
def list_trailing(span: Span, items: list[Node]) -> list[Node]:
    items.append(ast.Empty(span=Span(span.end_line, span.end_column, span.end_line, span.end_column)))
    return items


@RULES.rule
def command(span: Span, items: list[Node]) -> Node:
    return items[0] if len(items) == 1 else ast.Pipe(tuple(items), span=span)


@RULES.rule
def parallel(span: Span, items: list[Node]) -> Node:
    return items[0] if len(items) == 1 else ast.Par(tuple(items), span=span)


@RULES.rule
def part(_span: Span, *symbols: Node | Token) -> tuple[Node, str] | None:
    match symbols:
        case (Node() as statement, Token() as separator):
            return statement, separator.kind
    return None


@RULES.rule
def sequence(span: Span, parts: list[tuple[Node, str] | None]) -> Node:
    items = tuple(part for part in parts if part is not None)
    return ast.Seq(items, span=span) if items else ast.Empty(span=span)


@RULES.rule
def sequence_last(span: Span, *symbols: list[tuple[Node, str] | None] | Node) -> Node:
    last = symbols[-1]
    assert isinstance(last, Node)
    items = tuple(part for part in symbols[0] if part is not None) if isinstance(symbols[0], list) else ()
    return ast.Seq((*items, (last, "")), span=span) if items else last


@RULES.rule
def block(span: Span, body: Node | None) -> ast.Scope:
    return ast.Scope(None if isinstance(body, ast.Empty | Token) else body, span=span)


@RULES.rule
def tagged(span: Span, tag: Node, body: Node) -> Node:
    return ast.Tagged(tag, body, span=span)


# ------------------------------------------------------------ flow control


@RULES.rule
def if_(span: Span, condition: Node, then: Node, otherwise: Node | None = None) -> Node:
    return ast.If(condition, then, otherwise, span=span)


@RULES.rule
def while_(span: Span, flavor: Token | None, condition: Node, body: Node) -> Node:
    return ast.While(_flavor(flavor, ";"), condition, body, span=span)


@RULES.rule
def loop(span: Span, flavor: Token | None, body: Node) -> Node:
    return ast.While(_flavor(flavor, ";"), None, body, span=span)


@RULES.rule
def for_(span: Span, flavor: Token | None, first: Node, test: Node, step: Node, body: Node) -> Node:
    return ast.For(_flavor(flavor, ";"), first, test, step, body, span=span)


@RULES.rule
def empty(span: Span) -> Node:
    return ast.Empty(span=span)


@RULES.rule
def always(span: Span) -> Node:
    """The condition of ``for (;;)``."""
    return ast.Call(None, "true", span=span)


@RULES.rule
def for_each(span: Span, flavor: Token | None, head: Each, body: Node) -> Node:
    return ast.ForEach(_flavor(flavor, ";"), head.name, head.items, body, span=span)


@RULES.rule
def each(_span: Span, name: Token, items: Node) -> Each:
    return Each(name.text, items)


@RULES.rule
def each_time(_span: Span, items: Node) -> Each:
    return Each(None, items)


@RULES.rule
def break_(span: Span) -> Node:
    return ast.Break(span=span)


@RULES.rule
def continue_(span: Span) -> Node:
    return ast.Continue(span=span)


@RULES.rule
def return_(span: Span, value: Node | None = None) -> Node:
    return ast.Return(value, span=span)


@RULES.rule
def throw(span: Span, value: Node | None = None) -> Node:
    return ast.Throw(value, span=span)


@RULES.rule
def switch(span: Span, value: Node, cases: list[ast.Case], default: ast.Case | None) -> Node:
    return ast.Switch(value, (*cases, default) if default is not None else tuple(cases), span=span)


@RULES.rule
def case(span: Span, pattern: Node, guard: Node | None, body: Node | None) -> Node:
    return ast.Case(pattern, guard, body, span=span)


@RULES.rule
def default(span: Span, body: Node | None) -> Node:
    return ast.Case(None, None, body, span=span)


@RULES.rule
def try_(
    span: Span,
    body: ast.Scope,
    catches: list[ast.Catch],
    otherwise: ast.Scope | None,
    final: ast.Scope | None,
) -> Node:
    return ast.Try(body, tuple(catches), otherwise, final, span=span)


@RULES.rule
def try_finally(span: Span, body: ast.Scope, final: ast.Scope) -> Node:
    return ast.Try(body, (), None, final, span=span)


@RULES.rule
def catch(span: Span, pattern: Node, guard: Node | None, body: ast.Scope) -> Node:
    return ast.Catch(pattern, guard, body, span=span)


@RULES.rule
def catch_all(span: Span, body: ast.Scope) -> Node:
    return ast.Catch(None, None, body, span=span)


@RULES.rule
def assert_block(span: Span, claims: Args, last: Node | None = None) -> Node:
    return ast.Assert(tuple(claims) if last is None else (*claims, last), span=span)


# ------------------------------------------------------------ functions and objects


@RULES.rule
def function_named(span: Span, place: DeclaredPlace, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
    return ast.Var(place.target, place.name, function(span, formals, body), place=place.span, span=span)


@RULES.rule
def class_(span: Span, place: DeclaredPlace, protos: Args | None, body: ast.Scope) -> Node:
    return ast.Class(place.target, place.name, tuple(protos or ()), body, span=span)


@RULES.rule
def enum_(span: Span, place: DeclaredPlace, names: list[Token]) -> Node:
    """``enum Name { a, b }`` is ``var Name = Enumeration.new("Name", ["a", "b"])``."""
    values = ast.ListLit(tuple(ast.StringLiteral(name.text, span=name.span) for name in names), span=span)
    args = (ast.StringLiteral(place.name, span=place.span), values)
    made = ast.Call(ast.Call(None, "Enumeration", span=place.span), "new", args, span=span)
    return ast.Var(place.target, place.name, made, place=place.span, span=span)


@RULES.rule
def getter(span: Span, place: DeclaredPlace, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
    """``get name() { }`` is ``name->oget = function () { }``."""
    return _accessor(span, place, "oget", function(span, formals, body))


@RULES.rule
def setter(span: Span, place: DeclaredPlace, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
    """``set name(x) { }`` is ``name->oset = function (x) { }``."""
    return _accessor(span, place, "oset", function(span, formals, body))


def _accessor(span: Span, place: DeclaredPlace, name: str, value: Node) -> Node:
    slot = ast.Call(place.target, place.name, span=place.span)
    return ast.Assign(ast.Property(slot, name, span=place.span), value, span=span)


@RULES.reporting_rule
def word_object(problems: Problems, span: Span, word: Token) -> None:
    _word(problems, word, "object", span)


@RULES.reporting_rule
def word_event(problems: Problems, span: Span, word: Token) -> None:
    _word(problems, word, "event", span)


@RULES.reporting_rule
def source(problems: Problems, _span: Span, word: Token, name: Token) -> str:
    _word(problems, word, "from", word.span)
    return name.text


def _word(problems: Problems, word: Token, expected: str, span: Span) -> None:
    if word.text != expected:
        problems.append(Problem(f"unexpected `{word.text}', expecting `{expected}'", span))


@RULES.rule
def external_object(span: Span, _word: None, name: Token) -> Node:
    return ast.External("object", (name.text,), None, None, span=span)


@RULES.rule
def external_var(span: Span, path: list[Token], source: str) -> Node:
    return ast.External("var", tuple(name.text for name in path), None, source, span=span)


@RULES.rule
def external_function(span: Span, arity: Token, path: list[Token], source: str) -> Node:
    assert isinstance(arity.value, float)
    return ast.External("function", tuple(name.text for name in path), arity.value, source, span=span)


@RULES.rule
def external_event(span: Span, _word: None, arity: Token, path: list[Token], source: str) -> Node:
    assert isinstance(arity.value, float)
    return ast.External("event", tuple(name.text for name in path), arity.value, source, span=span)


# ------------------------------------------------------------ time and events


@RULES.rule
def emit(span: Span, event: Node, hold: Node | None) -> Node:
    return ast.Emit(event, None, hold, span=span)


@RULES.rule
def emit_with(span: Span, event: Node, args: Args, hold: Node | None) -> Node:
    return ast.Emit(event, tuple(args), hold, span=span)


@RULES.rule
def emit_old(span: Span, event: Node, hold: Node | None) -> Node:
    event, args = _without_arguments(event)
    return ast.Emit(event, args, hold, span=span)


@RULES.rule
def expression_condition(span: Span, expression: Node, hold: Node | None) -> Condition:
    return ast.ExprCond(expression, hold, span=span)


@RULES.rule
def event_condition(span: Span, event: Node, guard: Node | None, hold: Node | None) -> Condition:
    return ast.EventCond(event, None, guard, hold, span=span)


@RULES.rule
def event_condition_with(span: Span, event: Node, patterns: Args, guard: Node | None, hold: Node | None) -> Condition:
    return ast.EventCond(event, tuple(patterns), guard, hold, span=span)


@RULES.rule
def event_condition_old(span: Span, event: Node, guard: Node | None, hold: Node | None) -> Condition:
    event, patterns = _without_arguments(event)
    return ast.EventCond(event, patterns, guard, hold, span=span)


@RULES.rule
def at(span: Span, condition: Condition, body: Node, leave: Node | None = None) -> Node:
    return ast.At(condition, body, leave, span=span)


@RULES.rule
def at_sync(span: Span, condition: Condition, body: Node, leave: Node | None = None) -> Node:
    """``at sync (...)``: a later addition (manual of 2.7, section Synchronous and asynchronous at)."""
    return ast.At(condition, body, leave, True, span=span)


@RULES.rule
def whenever(span: Span, condition: Condition, body: Node, otherwise: Node | None = None) -> Node:
    return ast.Whenever(condition, body, otherwise, span=span)


@RULES.rule
def waituntil(span: Span, condition: Condition) -> Node:
    return ast.WaitUntil(condition, span=span)


@RULES.rule
def every(span: Span, flavor: Token | None, period: Node, body: Node) -> Node:
    return ast.Every(_flavor(flavor, ","), period, body, span=span)


@RULES.rule
def timeout(span: Span, duration: Node, body: Node) -> Node:
    return ast.Guarded("timeout", duration, body, span=span)


@RULES.rule
def stopif(span: Span, condition: Condition, body: Node) -> Node:
    return ast.Guarded("stopif", condition, body, span=span)


@RULES.rule
def freezeif(span: Span, condition: Condition, body: Node) -> Node:
    return ast.Guarded("freezeif", condition, body, span=span)


def _without_arguments(event: Node) -> tuple[Node, tuple[Node, ...] | None]:
    """Split the apparent call of the old forms ``emit e(1)`` and ``at (?e(1))`` into the event and its payload."""
    if isinstance(event, ast.Call) and event.args is not None and event.name != "[]":
        return ast.Call(event.target, event.name, span=event.span), event.args
    return event, None
