"""Printing nodes: the shapes that the manual and the original show, and printing then parsing."""

from __future__ import annotations

import pytest
from syntax_reading import EXAMPLES, node, plain

from urbihw.kernel.syntax.printer import print_float, print_name, print_node
from urbihw.kernel.syntax.reader import Statement, parse_program


@pytest.mark.parametrize("text", EXAMPLES)
def test_what_is_printed_parses_to_the_same(text: str) -> None:
    for item in parse_program(text):
        if isinstance(item, Statement):
            printed = print_node(item.node)
            assert plain(node(printed)) == plain(item.node), printed


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("function () { echo(0) }", ["function () {", "  echo(0)", "}"]),
        ("function (a, b,) { echo(0) }", ["function (var a, var b) {", "  echo(0)", "}"]),
        ("function () {}", ["function () {}"]),
        ("function { call }", ["function {", "  call", "}"]),
        ("closure (x = 1, y[]) { x }", ["closure (var x = 1, var y[]) {", "  x", "}"]),
        (
            'function () { echo("a" + this); return 42; }',
            ["function () {", "  echo(\"a\".'+'(this));", "  return 42;", "}"],
        ),
        ("function () { 1; 2 | 3 }", ["function () {", "  1;", "  2 | 3", "}"]),
        ("{ 1, { 2 & 3, }; }", ["{", "  1,", "  {", "    2 & 3,", "  };", "}"]),
        ("if (a) { b } else c", ["if (a) {", "  b", "} else c"]),
        (
            "switch (x) { case 1 if y: a; b; default: }",
            ["switch (x) {", "  case 1 if y:", "    a;", "    b;", "  default:", "}"],
        ),
        (
            "try {1} catch (var e) {2} catch {} finally {}",
            ["try {", "  1", "} catch (var e) {", "  2", "} catch {} finally {}"],
        ),
    ],
)
def test_lines(text: str, lines: list[str]) -> None:
    assert print_node(node(text)).split("\n") == lines


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ('lazyFail(1+2, "+" * 2)', "lazyFail(1.'+'(2), \"+\".'*'(2))"),
        ("1 + 2 * 3 == 8", "1.'+'(2.'*'(3)).'=='(8)"),
        ("-(1)", "1.'-'"),
        ("!a", "a.'!'"),
        ("as_no()", "as_no()"),
        ("l[0]", "l.'[]'(0)"),
        ("l[0] = 1", "l.'[]='(0, 1)"),
        ("1 in [1]", "[1].has(1)"),
        ("1 not in [1]", "[1].hasNot(1)"),
        ("(a && b) || c && (d || e)", "a && b || c && (d || e)"),
        ("x = y = 1", "x = y = 1"),
        ("(x = 1).y", "(x = 1).y"),
        ("180deg", "3.14159"),
        ("1h", "3600"),
        ('"a" "\\x00\\xff\\"\\\\\\a\\t"', r'"a\x00\xff\"\\\x07\t"'),
        ("'assert'(1)", "'assert'(1)"),
        ("'it\\'s' + 'if'", r"'it\'s'.'+'('if')"),
        ("a.new", "a.new"),
        ("(1,)", "(1,)"),
        ("[ => ]", "[ => ]"),
        ("1|", "1 |"),
        ("a & b &", "a & b &"),
    ],
)
def test_one_line(text: str, printed: str) -> None:
    assert print_node(node(text)) == printed


@pytest.mark.parametrize(
    ("value", "printed"),
    [
        (7.0, "7"),
        (-0.5, "-0.5"),
        (1e16, "10000000000000000"),
        (1e18, "1000000000000000000"),
        (1e19, "1e+19"),
        (999999.9, "1e+06"),
        (99999.95, "99999.9"),
        (0.00001, "1e-05"),
        (float("inf"), "inf"),
        (float("nan"), "nan"),
    ],
)
def test_floats(value: float, printed: str) -> None:
    assert print_float(value) == printed


def test_names() -> None:
    assert [print_name(name) for name in ["x", "_1", "1", "", "if", "a b", "new", "foreach", "\xe9"]] == [
        "x",
        "_1",
        "'1'",
        "''",
        "'if'",
        "'a b'",
        "'new'",
        "'foreach'",
        r"'\xe9'",
    ]
    assert print_name("new", member=True) == "new"


def test_depth_is_no_limit() -> None:
    deep = "[" * 3000 + "]" * 3000
    assert print_node(node(deep)) == deep
