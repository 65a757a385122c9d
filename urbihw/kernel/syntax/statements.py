"""What each rule of the grammar makes, from the whole statement down to where expressions begin.

See expressions.py for how the methods are named and called.
"""

from __future__ import annotations

from typing import NamedTuple

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.expressions import Args, Expressions, Place
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.tokens import Token

Condition = ast.EventCond | ast.ExprCond


class Command(NamedTuple):
    """A whole statement of a connection: its node, None if empty or broken, and the token that ended it."""

    node: Node | None
    ending: Token


class Each(NamedTuple):
    """The head of a for over items: the name of the loop variable, if any, and what to go over."""

    name: str | None
    items: Node


def _flavor(token: Token | None, default: str) -> str:
    return default if token is None else token.kind


class Statements(Expressions):
    """The rules from ``start`` to where ``expression`` begins."""

    def complete(self, _span: Span, node: Node, ending: Token) -> Command:
        return Command(node, ending)

    def nothing(self, _span: Span, *symbols: Token) -> Command:
        return Command(None, symbols[-1])

    # ------------------------------------------------------------ composition

    def list_trailing(self, span: Span, items: list[Node]) -> list[Node]:
        items.append(ast.Empty(span=Span(span.end_line, span.end_column, span.end_line, span.end_column)))
        return items

    def command(self, span: Span, items: list[Node]) -> Node:
        return items[0] if len(items) == 1 else ast.Pipe(tuple(items), span=span)

    def parallel(self, span: Span, items: list[Node]) -> Node:
        return items[0] if len(items) == 1 else ast.Par(tuple(items), span=span)

    def part(self, _span: Span, *symbols: Node | Token) -> tuple[Node, str] | None:
        match symbols:
            case (Node() as statement, Token() as separator):
                return statement, separator.kind
        return None

    def sequence(self, span: Span, parts: list[tuple[Node, str] | None]) -> Node:
        items = tuple(part for part in parts if part is not None)
        return ast.Seq(items, span=span) if items else ast.Empty(span=span)

    def sequence_last(self, span: Span, *symbols: list[tuple[Node, str] | None] | Node) -> Node:
        last = symbols[-1]
        assert isinstance(last, Node)
        items = tuple(part for part in symbols[0] if part is not None) if isinstance(symbols[0], list) else ()
        return ast.Seq((*items, (last, "")), span=span) if items else last

    def block(self, span: Span, body: Node | None) -> ast.Scope:
        return ast.Scope(None if isinstance(body, ast.Empty | Token) else body, span=span)

    def tagged(self, span: Span, tag: Node, body: Node) -> Node:
        return ast.Tagged(tag, body, span=span)

    # ------------------------------------------------------------ flow control

    def if_(self, span: Span, condition: Node, then: Node, otherwise: Node | None = None) -> Node:
        return ast.If(condition, then, otherwise, span=span)

    def while_(self, span: Span, flavor: Token | None, condition: Node, body: Node) -> Node:
        return ast.While(_flavor(flavor, ";"), condition, body, span=span)

    def loop(self, span: Span, flavor: Token | None, body: Node) -> Node:
        return ast.While(_flavor(flavor, ";"), None, body, span=span)

    def for_(self, span: Span, flavor: Token | None, first: Node, test: Node, step: Node, body: Node) -> Node:
        return ast.For(_flavor(flavor, ";"), first, test, step, body, span=span)

    def empty(self, span: Span) -> Node:
        return ast.Empty(span=span)

    def always(self, span: Span) -> Node:
        """The condition of ``for (;;)``."""
        return ast.Call(None, "true", span=span)

    def for_each(self, span: Span, flavor: Token | None, head: Each, body: Node) -> Node:
        return ast.ForEach(_flavor(flavor, ";"), head.name, head.items, body, span=span)

    def each(self, _span: Span, name: Token, items: Node) -> Each:
        return Each(name.text, items)

    def each_time(self, _span: Span, items: Node) -> Each:
        return Each(None, items)

    def break_(self, span: Span) -> Node:
        return ast.Break(span=span)

    def continue_(self, span: Span) -> Node:
        return ast.Continue(span=span)

    def return_(self, span: Span, value: Node | None = None) -> Node:
        return ast.Return(value, span=span)

    def throw(self, span: Span, value: Node | None = None) -> Node:
        return ast.Throw(value, span=span)

    def switch(self, span: Span, value: Node, cases: list[ast.Case], default: ast.Case | None) -> Node:
        return ast.Switch(value, (*cases, default) if default is not None else tuple(cases), span=span)

    def case(self, span: Span, pattern: Node, guard: Node | None, body: Node | None) -> Node:
        return ast.Case(pattern, guard, body, span=span)

    def default(self, span: Span, body: Node | None) -> Node:
        return ast.Case(None, None, body, span=span)

    def try_(
        self,
        span: Span,
        body: ast.Scope,
        catches: list[ast.Catch],
        otherwise: ast.Scope | None,
        final: ast.Scope | None,
    ) -> Node:
        return ast.Try(body, tuple(catches), otherwise, final, span=span)

    def try_finally(self, span: Span, body: ast.Scope, final: ast.Scope) -> Node:
        return ast.Try(body, (), None, final, span=span)

    def catch(self, span: Span, pattern: Node, guard: Node | None, body: ast.Scope) -> Node:
        return ast.Catch(pattern, guard, body, span=span)

    def catch_all(self, span: Span, body: ast.Scope) -> Node:
        return ast.Catch(None, None, body, span=span)

    def assert_block(self, span: Span, claims: Args, last: Node | None = None) -> Node:
        return ast.Assert(tuple(claims) if last is None else (*claims, last), span=span)

    # ------------------------------------------------------------ functions and objects

    def function_named(self, span: Span, place: Place, formals: list[ast.Formal] | None, body: ast.Scope) -> Node:
        return ast.Var(place.target, place.name, self.function(span, formals, body), place=place.span, span=span)

    def class_(self, span: Span, place: Place, protos: Args | None, body: ast.Scope) -> Node:
        return ast.Class(place.target, place.name, tuple(protos or ()), body, span=span)

    def word_object(self, span: Span, word: Token) -> None:
        self._word(word, "object", span)

    def word_event(self, span: Span, word: Token) -> None:
        self._word(word, "event", span)

    def source(self, _span: Span, word: Token, name: Token) -> str:
        self._word(word, "from", word.span)
        return name.text

    def _word(self, word: Token, expected: str, span: Span) -> None:
        if word.text != expected:
            self.problem(f"unexpected `{word.text}', expecting `{expected}'", span)

    def external_object(self, span: Span, _word: None, name: Token) -> Node:
        return ast.External("object", (name.text,), None, None, span=span)

    def external_var(self, span: Span, path: list[Token], source: str) -> Node:
        return ast.External("var", tuple(name.text for name in path), None, source, span=span)

    def external_function(self, span: Span, arity: Token, path: list[Token], source: str) -> Node:
        assert isinstance(arity.value, float)
        return ast.External("function", tuple(name.text for name in path), arity.value, source, span=span)

    def external_event(self, span: Span, _word: None, arity: Token, path: list[Token], source: str) -> Node:
        assert isinstance(arity.value, float)
        return ast.External("event", tuple(name.text for name in path), arity.value, source, span=span)

    # ------------------------------------------------------------ time and events

    def emit(self, span: Span, event: Node, hold: Node | None) -> Node:
        return ast.Emit(event, None, hold, span=span)

    def emit_with(self, span: Span, event: Node, args: Args, hold: Node | None) -> Node:
        return ast.Emit(event, tuple(args), hold, span=span)

    def emit_old(self, span: Span, event: Node, hold: Node | None) -> Node:
        event, args = _without_arguments(event)
        return ast.Emit(event, args, hold, span=span)

    def expression_condition(self, span: Span, expression: Node, hold: Node | None) -> Condition:
        return ast.ExprCond(expression, hold, span=span)

    def event_condition(self, span: Span, event: Node, guard: Node | None, hold: Node | None) -> Condition:
        return ast.EventCond(event, None, guard, hold, span=span)

    def event_condition_with(
        self, span: Span, event: Node, patterns: Args, guard: Node | None, hold: Node | None
    ) -> Condition:
        return ast.EventCond(event, tuple(patterns), guard, hold, span=span)

    def event_condition_old(self, span: Span, event: Node, guard: Node | None, hold: Node | None) -> Condition:
        event, patterns = _without_arguments(event)
        return ast.EventCond(event, patterns, guard, hold, span=span)

    def at(self, span: Span, condition: Condition, body: Node, leave: Node | None = None) -> Node:
        return ast.At(condition, body, leave, span=span)

    def whenever(self, span: Span, condition: Condition, body: Node, otherwise: Node | None = None) -> Node:
        return ast.Whenever(condition, body, otherwise, span=span)

    def waituntil(self, span: Span, condition: Condition) -> Node:
        return ast.WaitUntil(condition, span=span)

    def every(self, span: Span, flavor: Token | None, period: Node, body: Node) -> Node:
        return ast.Every(_flavor(flavor, ","), period, body, span=span)

    def timeout(self, span: Span, duration: Node, body: Node) -> Node:
        return ast.Guarded("timeout", duration, body, span=span)

    def stopif(self, span: Span, condition: Condition, body: Node) -> Node:
        return ast.Guarded("stopif", condition, body, span=span)

    def freezeif(self, span: Span, condition: Condition, body: Node) -> Node:
        return ast.Guarded("freezeif", condition, body, span=span)


def _without_arguments(event: Node) -> tuple[Node, tuple[Node, ...] | None]:
    """In the old forms ``emit e(1)`` and ``at (?e(1))`` what looks like a call is the event and its payload."""
    if isinstance(event, ast.Call) and event.args is not None and event.name != "[]":
        return ast.Call(event.target, event.name, span=event.span), event.args
    return event, None
