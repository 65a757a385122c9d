"""Long functions are cut into pieces: programs mean the same, and no piece is long."""

from __future__ import annotations

from collections.abc import Iterator
from types import CodeType

import pytest

from urbihw.kernel import Kernel, errors
from urbihw.kernel.compiler import CompiledUnit, compile_node, pieces, visit
from urbihw.kernel.lobby import long_work, shell
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.reader import Statement, StatementReader

PROGRAMS = {
    "locals": "function f(a, b = 2) { var c = a + b; c = c * 2; var d = c - 1; d += a; a = d; a + b + c }; f(1);"
              " f(1, 5);",
    "arguments are assigned": "function f(x) { x = x + 1; x = x + 1; x = x + 1; x = x + 1; x }; f(1);",
    "loops": "{ var n = 0; for| (var i = 0; i < 9; i++) { n += i; if (i == 2) continue; n += 100; if (i == 5) break;"
             " n += 1000 }; n };",
    "loops in loops": "{ var l = []; for (var i : [1, 2, 3]) { for (var j : [1, 2, 3]) { if (j == 2) continue;"
                      " if (i == 3) break; l << i * 10 + j; l << 0 }; l << i }; l };",
    "while": "{ var n = 0; while (true) { n += 1; n += 1; if (n > 7) { n += 1; break }; n += 1; n += 1 }; n };",
    "return": "function f(x) { if (x == 1) return 10; var y = x + 1; if (x == 2) { return y }; for (var i : [1, 2])"
              " { y += i; if (x == 3) return y; y += 1 }; y }; [f(1), f(2), f(3), f(4)];",
    "return of nothing": "function f(x) { x + 1; x + 2; if (x) return; x + 3; x + 4; 7 }; f(true); f(false);",
    "finally": "function f(l) { try { l << 1; l << 2; try { l << 3; return l } finally { l << 4; l << 5 }; l << 6 }"
               " finally { l << 7; l << 8 } }; f([]);",
    "catch": "{ var l = []; try { l << 1; l << 2; throw 42; l << 3 } catch (var e if e == 1) { l << e; l << 9 }"
             " catch (var e) { l << e; l << e + 1; l << e + 2; l << e + 3 } else { l << 7 }; l };",
    "throw again": "try { try { 1; 2; 3; throw 5 } catch { 1; 2; 3; 4; 5; throw } } catch (var e) { e };",
    "closures": "{ var n = 0; var add = closure (x) { n += x; n += 1; n += 1; n += 1; n }; add(1); add(2); n += 1;"
                " n };",
    "closures of a loop": "{ var l = []; for| (var i : [1, 2, 3]) { var j = i * 10; l << closure () { j += 1; j +="
                          " i; j };"
                          " l << closure () { i } }; l.map(closure (f) { f.apply([this]) }) };",
    "functions in functions": "function f(a) { var b = a + 1; function g(c) { var d = b + c; function h(e) { a + b"
                              " + c + d"
                              " + e }; h(1) + h(2) + d }; b = 100; g(1) + g(2) }; f(1);",
    "class": "class Big { var x = 1; var y = 2; function init(z) { this.x = z; this.y = x + 1; y += 1 };"
             " function sum() { var s = x; s += y; s += x * y; return s; 1 }; var last = 3 }; Big.new(4).sum;"
             " Big.last;",
    "do": "do (Object.clone) { var a = 1; var b = a + 1; var c = a + b; a = c + 1; [a, b, c] }.a;",
    "patterns": "{ [var a, [var b, var c]] = [1, [2, 3]]; a += b; b += c; switch ([a, b]) { case [1, var d]: d; case"
                " [var d, 5]: [d, a, b, c]; default: 0 } };",
    "and, or": "{ var a = 1; (a == 1 && { a += 1; a += 1; a == 3 }) || { a += 10; false }; a };",
    "background": "{ var l = []; l << 1, var x = 3, { l << x; l << x + 1; l << x + 2 }, l << 9; l };",
    "branches": "{ var a = 0; var b = 0; { a += 1; a += 1; a += 1 } & { b += 1; b += 2; b += 3 }; [a, b] };",
    "tags": "{ var t = Tag.new; var l = []; t: { l << 1; l << 2; t.stop(7); l << 3; l << 4 }; l };",
    "scope tag": "{ var l = []; { l << 1, { sleep(1s) | l << 2 }, l << 3; scopeTag.stop; l << 4 }; l };",
    "at": "{ var n = 0; var e = Event.new; at (e?(var x) if x > 1) { n += x; n += x; n += x } onleave { n += 1000;"
          " n += 1 };"
          " e!(1); e!(2); n };",
    "every": "{ var n = 0; timeout (1s) every| (300ms) { n += 1; n += 1; n += 1 }; n };",
    "waituntil": "{ var e = Event.new; var n = 0; { sleep(100ms) | e!(4) }, waituntil (e?(var x)); n += x; n += x;"
                 " n };",
    "parallel loops": "{ var n = 0; for& (var i : [1, 2, 3]) { n += i; n += 1; n += 1; if (i == 2) continue; n +="
                      " 10 }; n };",
    "lazy arguments": "function lazy { call.evalArgAt(0) + call.evalArgAt(0) }; { var a = 1; var b = lazy({ a += 1;"
                      " a += 1; a"
                      " += 1; a }); [a, b] };",
    "late arguments": "{ var f = function { call.evalArgs }; var o = Object.clone; var o.g = f; var a = 1; var b = 2;"
                      " o.g(a + 1, { b += 1; b += 1; b }, a = 9); [a, b] };",
    "order": "{ var x = 1; [x, x++, x, { x += 1; x }, x++, x, [x, x++], x] };",
    "order of arguments": "{ var x = 1; function f(a, b, c, d, e) { [a, b, c, d, e] }; f(x, x++, { x = x * 2; x },"
                          " x++, x) };",
    "order of a sum": "{ var x = 1; x + x++ * { x += 1; x } + x + (x = 10) + x };",
    "dictionary": '{ var x = 0; ["a" => x++, "b" => { x += 1; x }, "c" => x++, "d" => x].asString };',
    "deep expressions": "function f(a, b) { a + b }; f(f(f(f(f(f(f(1, 2), f(3, 4)), 5), f(6, f(7, 8))), 9), f(1,"
                        " 1)), f(0, 1));",
    "an error's place": "function f(x) { x + 1; x + 2;\n x + 3; g(x);\n x + 4 };\nfunction g(x) { 1; 2; 3; 4;\n"
                        " x.nothing;\n 5 };\n"
                        "{ 1; 2; 3;\n f(7); 4; 5 };",
    "an error in a loop": "function f(l) { 1; for (var x : l) { 1; 2;\n x.nothing; 3 }; 2 };\n f([1, 2]);",
    "assertions": "assert { 1 == 1; 2 == 3; 4 < 5 };",
    "operators in place": "{ var l = [1, 2]; l[0] += 5; l[1]++; var o = Object.clone; var o.x = 1; o.x += 2; o.x++;"
                          " [l, o.x] };",
}


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Nearly everything counts as long."""
    for name, size in {"MAX_WHOLE_WEIGHT": 40, "MAX_PIECE_WEIGHT": 30, "MIN_APART_WEIGHT": 20}.items():
        monkeypatch.setattr(pieces, name, size)
    monkeypatch.setattr(visit, "MAX_PARTS", 6)
    monkeypatch.setattr(long_work, "MAX_SHORT_TEXT", 0)
    monkeypatch.setattr(shell, "MAX_SHORT_TEXT", 0)
    yield


@pytest.fixture(scope="module")
def kernel() -> Iterator[Kernel]:
    made = Kernel(fast=True)
    yield made
    made.close()


def said(kernel: Kernel, program: str) -> list[str]:
    """What a new lobby says to a program, without time stamps."""
    lines = kernel.run_text(kernel.open_lobby(), program).splitlines()
    return [line[:1] + line[9:] for line in lines]


def unit(text: str) -> CompiledUnit:
    """A statement, compiled as if it were long."""
    (item,) = StatementReader().feed(text.encode() + b";")
    assert isinstance(item, Statement)
    return compile_node(item.node, pace=StepPace())


def codes(made: CompiledUnit) -> list[CodeType]:
    """All Python functions of a unit."""
    todo, found = [made.code, *made.pieces], []
    while todo:
        code = todo.pop()
        found.append(code)
        todo += [each for each in code.co_consts if isinstance(each, CodeType)]
    return found


@pytest.mark.parametrize("kind", PROGRAMS)
def test_a_program_that_is_cut_says_the_same(kernel: Kernel, kind: str, request: pytest.FixtureRequest) -> None:
    whole = said(kernel, PROGRAMS[kind])
    request.getfixturevalue("small")
    assert said(kernel, PROGRAMS[kind]) == whole
    assert whole


def test_it_was_cut(small: None) -> None:
    assert len(unit("{ var a = 1; a += 1; a += 2; a += 3; a += 4; a }").pieces) >= 2


@pytest.mark.parametrize(
    "text",
    [
        "function () {" + "f(x); " * 3000 + "1}",
        "function () { var x = 1; " + "x = x + g(x, 2); " * 3000 + "return x }",
        "function () { while (true) {" + "f(x); if (a) break; if (b) continue; if (c) return 3; " * 1000 + "} }",
        "class A {" + "".join(f"function f{n}(a) {{ var b = a; b + {n} }}; " for n in range(1000)) + "}",
        "[" + "1, " * 10_000 + "1]",
        "[" + ("[" + "1, " * 100 + "1], ") * 100 + "1]",
        "[" + ("f(a, [1, 2, 3], b + 1), ") * 2000 + "1]",
        "[" + '"a" => 1, ' * 5000 + '"b" => 2]',
        "f(" + "1, " * 5000 + "1)",
        "f(" + "g(1, 2, [3, 4]), " * 1000 + "1)",
        "+".join(["f(1)"] * 5000),
        "f(" * 300 + "1" + ", [2, 3])" * 300,
        "(" * 300 + "f(1) + 2" + ") * (f(1) + 3)" * 300,
        "{" + "t: {" * 40 + "f(1); " * 1000 + "}" * 40 + "}",
        "{" + "f(1), " * 1000 + "f(2)}",
        "f(1) & " * 1000 + "f(2)",
        "switch (x) {" + "case 1: f(1); f(2); " * 100 + "}",
    ],
    ids=lambda text: text[:30],
)
def test_no_piece_is_long(text: str) -> None:
    made = unit(text)
    assert len(made.pieces) > 2
    # Some 20 bytes of instructions for each node, so that none takes more than some 3 ms to compile.
    assert max(len(code.co_code) for code in codes(made)) < 100_000


def test_what_cannot_be_cut_is_refused() -> None:
    with pytest.raises(errors.StatementTooLong):
        unit("function (" + ", ".join(f"a{n}" for n in range(20_000)) + ") {}")


def test_variables_that_go_through_many_functions_are_refused() -> None:
    """They would take memory in each."""
    variables = "".join(f"var a{n} = 1; " for n in range(1000))
    uses = "; ".join(f"a{n}" for n in range(1000))
    with pytest.raises(errors.StatementTooLong):
        unit("function () {" + variables + "closure () {" * 240 + uses + "}" * 241)


def test_a_list_whose_parts_take_statements_is_written_in_linear_size() -> None:
    sizes = [len(unit("{ var x = 1; [" + "x++, " * count + "x] }").pieces) for count in (500, 1000)]
    assert sizes[1] < 3 * sizes[0]
