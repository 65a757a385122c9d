"""The node each construct makes, precedence and associativity, and the spans of nodes."""

from __future__ import annotations

import math

import pytest
from syntax_reading import node

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Call, Float, Node, Scope, Seq
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.reader import Statement, parse_program

A, B, C, E, X = (Call(None, name) for name in "abcex")
ONE, TWO = Float(1), Float(2)


def call(target: Node | None, name: str, *args: Node) -> Call:
    return Call(target, name, args)


NODES: list[tuple[str, Node]] = [
    ("1s 2ms", Float(1.002)),
    ("1d", Float(86400)),
    ("180deg", Float(math.pi)),
    ("0xFFFFFFFF", Float(4294967295)),
    ('"a" "b"', ast.StringLiteral("ab")),
    (r'"\101\x41\0\1012\B(3)("\")\\"', ast.StringLiteral('AA\0A2"\\"\\')),
    ('"a\r\nb"', ast.StringLiteral("a\n\nb")),
    ("'a b'", Call(None, "a b")),
    ("f()", call(None, "f")),
    ("a.new", Call(A, "new")),
    ("new(1)", call(None, "new", ONE)),
    ("new a.b(1)", call(Call(A, "b"), "new", ONE)),
    ("new a", Call(A, "new")),
    ("BIN 3 jpeg;abc", call(Call(None, "Binary"), "new", ast.StringLiteral("jpeg"), ast.StringLiteral("abc"))),
    ("(a)", A),
    ("(a,)", ast.TupleLit((A,))),
    ("[=>]", ast.DictLit(())),
    ("-1 ** 2", call(call(ONE, "**", TWO), "-")),
    ("2 ** -1", call(TWO, "**", call(ONE, "-"))),
    ("a ** b ** c", call(A, "**", call(B, "**", C))),
    ("a - b - c", call(call(A, "-", B), "-", C)),
    ("-a.b", call(Call(A, "b"), "-")),
    ("-a[1]", call(call(A, "[]", ONE), "-")),
    ("a + b << c", call(call(A, "+", B), "<<", C)),
    ("2 ^ 1 == x", call(TWO, "^", call(ONE, "==", X))),
    ("a < b == c", call(call(A, "<", B), "==", C)),
    ("a bitor b bitand c", call(A, "bitor", call(B, "bitand", C))),
    ("!a == b", call(call(A, "==", B), "!")),
    ("!a in b", call(B, "has", call(A, "!"))),
    ("a + !b * c", call(A, "+", call(call(B, "*", C), "!"))),
    ("a not in b && c", ast.And(call(B, "hasNot", A), C)),
    ("a || b && c", ast.Or(A, ast.And(B, C))),
    ("not a and b", ast.And(call(A, "!"), B)),
    ("! a -= 1", call(ast.OpAssign(A, "-=", ONE), "!")),
    ("a && b = 1", ast.And(A, ast.Assign(B, ONE))),
    ("a = b = 1", ast.Assign(A, ast.Assign(B, ONE))),
    ("a[1] = 2", call(A, "[]=", ONE, TWO)),
    ("a->b = 1", ast.Assign(ast.Property(A, "b"), ONE)),
    ("a.b->c", ast.Property(Call(A, "b"), "c")),
    ("[var a] = b", ast.Assign(ast.ListLit((ast.Var(None, "a"),)), B)),
    ("a = 1 time: 2s ampli: b + 1", ast.Assign(A, ONE, (("time", TWO), ("ampli", call(B, "+", ONE))))),
    ("a[1] += 2", ast.OpAssign(call(A, "[]", ONE), "+=", TWO)),
    ("a++", ast.Postfix(A, "++")),
    ("const var a.b = 1", ast.Var(A, "b", ONE, True)),
    ("function a.b {}", ast.Var(A, "b", ast.Function(False, None, Scope(None)))),
    (
        "closure (a, var b = 1, c[],) {}",
        ast.Function(True, (ast.Formal("a"), ast.Formal("b", ONE), ast.Formal("c", None, True)), Scope(None)),
    ),
    ("class a.b : c { 1 }", ast.Class(A, "b", (C,), Scope(ONE))),
    ("do (a) { 1 }.b", Call(ast.Do(A, Scope(ONE)), "b")),
    ("{ 1 }", Scope(ONE)),
    ("{ ; }", Scope(None)),
    ("{ 1;; 2, }", Scope(Seq(((ONE, ";"), (TWO, ","))))),
    ("{ 1; 2 }", Scope(Seq(((ONE, ";"), (TWO, ""))))),
    ("a | b & c | 1", ast.Pipe((A, ast.Par((B, C)), ONE))),
    ("a |", ast.Pipe((A, ast.Empty()))),
    ("a: b: c | 1", ast.Pipe((ast.Tagged(A, ast.Tagged(B, C)), ONE))),
    ("a = b: c", ast.Tagged(ast.Assign(A, B), C)),
    ("if (a; b) 1", ast.If(Seq(((A, ";"), (B, ""))), ONE, None)),
    ("if (a) if (b) 1 else 2", ast.If(A, ast.If(B, ONE, TWO), None)),
    ("while| (a) b", ast.While("|", A, B)),
    ("loop, b", ast.While(",", None, B)),
    ("for (;;) a", ast.For(";", ast.Empty(), Call(None, "true"), ast.Empty(), A)),
    ("for& (var x in a) b", ast.ForEach("&", "x", A, B)),
    ("foreach (var x : a) b", ast.ForEach(";", "x", A, B)),
    ("loopn (2) b", ast.ForEach(";", None, TWO, B)),
    ("every (1s) a", ast.Every(",", ONE, A)),
    (
        "switch (x) { case 1 if a: b; default: }",
        ast.Switch(X, (ast.Case(ONE, A, Seq(((B, ";"),))), ast.Case(None, None, None))),
    ),
    (
        "try {} catch (1 if a) {} catch {} else {} finally {}",
        ast.Try(
            Scope(None),
            (ast.Catch(ONE, A, Scope(None)), ast.Catch(None, None, Scope(None))),
            Scope(None),
            Scope(None),
        ),
    ),
    ("try {} finally {}", ast.Try(Scope(None), (), None, Scope(None))),
    ("throw", ast.Throw(None)),
    ("assert(a)", ast.Assert((A,))),
    ("assert(a, b)", call(None, "assert", A, B)),
    ("assert { a;; b }", ast.Assert((A, B))),
    ("e!", ast.Emit(E, None, None)),
    ("e!() ~ 1s", ast.Emit(E, (), ONE)),
    ("emit a.e(1) ~ 1s", ast.Emit(Call(A, "e"), (ONE,), ONE)),
    ("at (e?) a", ast.At(ast.EventCond(E, None, None, None), A, None)),
    ("at (e?() if b ~ 1) a onleave c", ast.At(ast.EventCond(E, (), B, ONE), A, C)),
    ("at sync (e?) a onleave c", ast.At(ast.EventCond(E, None, None, None), A, C, True)),
    ("at (?a.e(var x)) b", ast.At(ast.EventCond(Call(A, "e"), (ast.Var(None, "x"),), None, None), B, None)),
    ("whenever (a == 2 ~ 1s) b else c", ast.Whenever(ast.ExprCond(call(A, "==", TWO), ONE), B, C)),
    ("waituntil(a)", ast.WaitUntil(ast.ExprCond(A, None))),
    ("timeout (1s) a", ast.Guarded("timeout", ONE, A)),
    ("stopif (e?) a", ast.Guarded("stopif", ast.EventCond(E, None, None, None), A)),
    ("external function (2) X.f from Y", ast.External("function", ("X", "f"), 2, "Y")),
    ("external object X", ast.External("object", ("X",), None, None)),
    ("public a", A),
]


@pytest.mark.parametrize(("text", "expected"), NODES)
def test_node(text: str, expected: Node) -> None:
    program = parse_program(text if text != "throw" else "try {} catch { throw }")
    made = next(item.node for item in program if isinstance(item, Statement))
    if text == "throw":
        assert isinstance(made, ast.Try)
        assert made.catches[0].body == Scope(expected)
        return
    assert made == expected


SYNONYMS = [
    ("a and b", "a && b"),
    ("a or b", "a || b"),
    ("not a", "!a"),
    ("a xor b", "a ^ b"),
    ("a not_eq b", "a != b"),
    ("a xor_eq b", "a ^= b"),
    ("compl a", "~a"),
]


@pytest.mark.parametrize(("one", "other"), SYNONYMS)
def test_synonyms(one: str, other: str) -> None:
    assert node(one) == node(other)


def spans(text: str) -> dict[str, Span]:
    """The span of each node of a statement, by class name; of several the first."""
    found: dict[str, Span] = {}
    todo: list[object] = [node(text)]
    while todo:
        part = todo.pop(0)
        if isinstance(part, Node):
            found.setdefault(type(part).__name__, part.span)
            todo += [getattr(part, name) for name in part.__dataclass_fields__ if name not in ("span", "bound")]
        elif isinstance(part, tuple):
            todo += part
    return found


def test_a_span_covers_the_text_of_its_node() -> None:
    assert spans("x = f(12)") == {
        "Assign": Span(1, 1, 1, 10),
        "Call": Span(1, 1, 1, 2),
        "Float": Span(1, 7, 1, 9),
    }


def test_parentheses_belong_to_the_node_around() -> None:
    made = node("(1) + (x)")
    assert isinstance(made, Call)
    assert made.target is not None and made.args is not None
    assert (made.span, made.target.span, made.args[0].span) == (Span(1, 1, 1, 10), Span(1, 2, 1, 3), Span(1, 8, 1, 9))


def test_spans_over_lines_are_relative_to_the_statement() -> None:
    items = parse_program("1;\n\n  {\n  a\n};")
    last = items[-1]
    assert isinstance(last, Statement) and isinstance(last.node, Scope) and last.node.body is not None
    assert (last.base.line, last.base.column) == (3, 3)
    assert (last.node.span, last.node.body.span) == (Span(1, 1, 3, 2), Span(2, 3, 2, 4))


def test_var_and_function_span_the_whole_declaration() -> None:
    assert spans("var x = 2")["Var"] == Span(1, 1, 1, 10)
    assert spans("function f() {}")["Var"] == Span(1, 1, 1, 16)
