"""Statements that differ in their literals only: the same answers as without templates, at a fraction of the price."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.compiler import CompiledUnit, compile_node
from urbihw.kernel.lobby import templates
from urbihw.kernel.lobby.templates import MAX_SKELETON_LENGTH, MAX_TEMPLATE_TEXT, TemplateUse, skeleton
from urbihw.kernel.runtime.backtrace import Stack, later_stack
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.value import Value


class Console:
    """A kernel and one connection; ``with_templates`` is whether statements may share code."""

    def __init__(self, with_templates: bool = True) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        if not with_templates:
            self.kernel.programs.read.use = lambda text: None  # type: ignore[method-assign]

    def say(self, text: str) -> str:
        """What is answered."""
        self.lobby.feed(text.encode("latin-1"))
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.01)
        return self.lobby.output.take_bytes().decode("latin-1")


@pytest.mark.parametrize(("text", "bones", "literals"), [
    ('o.f("a", 1.5e-3)|;', "o.f(\0, \0)|;\1sn", ['"a"', "1.5e-3"]),
    ("a1.b2 = 3;", "a1.b2 = \0;\1n", ["3"]),
    ("f(-5);", "f(-\0);\1n", ["5"]),
    ("f(5.clone, 2s, 0x10, 7);", "f(5.clone, 2s, 0x10, \0);\1n", ["7"]),
])
def test_the_skeleton_of_a_statement(text: str, bones: str, literals: list[str]) -> None:
    assert skeleton(text) == (bones, literals)


@pytest.mark.parametrize("text", [
    "f();", "{ 1 };", 'f("a\\n");', 'f("a)(1;', "f(1); // one", "f(1 /* one */);", "f('1');", "f(1" + " " * 300 + ");",
    "BIN 1 e2;a",
])
def test_what_is_too_intricate_has_none(text: str) -> None:
    assert skeleton(text) is None


def test_long_data_counts_by_what_is_to_be_compiled() -> None:
    numbers = "f([" + ", ".join(["3.14159"] * 80) + "]);"
    assert len(numbers) > MAX_SKELETON_LENGTH
    assert skeleton(numbers) == ("f([" + ", ".join(["\0"] * 80) + "]);\1" + "n" * 80, ["3.14159"] * 80)
    assert skeleton('f("' + "x" * 5000 + '");') == ("f(\0);\1s", ['"' + "x" * 5000 + '"'])
    assert skeleton("f([" + ", ".join(["1"] * 200) + "]);") is None
    assert skeleton('f("' + "x" * MAX_TEMPLATE_TEXT + '");') is None


SESSIONS = [
    [f"[{', '.join(str(begin + 0.5 + index) for index in range(70))}].size + {begin};" for begin in (1, 100, 2000, 7)],
    [f'"{letter * 2000}".size + {number};' for number, letter in enumerate("abcd")],
    ["echo(1);", "echo(2);", "echo(2.5);", "echo(1e3);"],
    ['"a" + 1;', '"b" + 2;', '"c" + 3;'],
    ["var x1 = 1;", "var x2 = 2;", "var y = 3;", "var y = 4;", "var y = 5;", "y;"],
    ["f(1);", "f(2, 3);", "f(4);", "f(5);", "1.foo(2);", "1.foo(3);", "1.foo(4444);"],
    ['[1, "a", ["k" => 2]];', '[3, "bb", ["kk" => 4]];', '["", 5, [6]];', '[5, "", ["k" => 6]];'],
    ["1 + 1;", "2 + 2;", "3 + 4 * 2;", "-5;", "-6;", "- 7;", "1 - -1;", "2 - -2;", "3 - -3;"],
    ["5 == 5;", "5 == 6;", "7 == 7;", "true && 1;", "true && 2;", "true && 3;", "false || 4;"],
    ["if (1) 2 else 3;", "if (0) 5 else 6;", "if (4) 5 else 6;", "if (0) 8 else 9;"],
    ["for (3) echo(1);", "for (2) echo(4);", "for (0) echo(5);", "for (var i : 3) echo(i);",
     "for (var i : 2) echo(i);"],
    ["function lazy { call.args };", "lazy(1);", "lazy(2);", "lazy(3);", "lazy(44 + 5);", "lazy(6 + 7);",
     "lazy(8 + 9);"],
    ["function lazy { call.evalArgs.asString + call.args[0].asString }; lazy(1);", "lazy(2, -3);", "lazy(3, -5);",
     "lazy(4, 4 + 4);", "lazy(5, -5);", "lazy(6, lazy(lazy(7)));", "lazy(6, lazy(lazy(8)));", "lazy(6, lazy(lazy(6)));",
     "lazy(1 / 0);", "lazy(22 / 0);", "lazy(333 / 0);"],
    ["assert(1 == 1);", "assert(1 == 2);", "assert(3 == 22);", "assert(1);", "assert(0);", "isdef(1);", "isdef(22);",
     "isdef(3);"],
    ["var n = 0|; at (n > 1) echo(11);", "at (n > 2) echo(22);", "at (n > 3) echo(33);", "n = 2|; n = 3|; n = 4|;",
     "1 && 2;", "0 && 3;", "4 && 5;", "6 & 7;", "8 & 9;", "echo(10) & echo(11);", "echo(1 / 0) & echo(12);"],
    ["var l = [1, 2, 3]|; l[0] = 5|; l[1] = 6|; l[2] = 7|; l;", "l[0];", "l[1];", "l[2];", "l[9];"],
    ["2 / 0;", "3 / 0;", "4 / 0;", "[1][2];", "[1][33];", "[1][444];"],
    ['throw "a";', 'throw "bb";', 'throw "ccc";', "eval(\"1\");", 'eval("2 + nothing");', 'eval("3 + nothing");'],
    ["echo(1), echo(2), echo(3), echo(4),", "sleep(0.1), echo(5), sleep(0.2),"],
    ["1s;", "2s;", "3s;", "1e400;", "2e400;", "3e400;", "1e38;", "1e39;", "1e40;"],
    ['"a" "b";', '"c" "d";', '"e" "f";', "1 2;", "3 4;", "5 6;", "f(1;", "f(2;", ");", "f(3;",
     ");"],
    ["var o = Object.new|; var o.a = 1; o.a = 2; o.a = 3; o.a = 4; o.b = 1; o.b = 2; o.b = 3;"],
    ["every (1s) echo(1),", "every (1s) echo(2),", "every (1s) echo(3),", "at (1 == 2) echo(3);",
     "at (4 == 4) echo(5);"],
    ["switch (1) { case 1: 2; };", "1.print(2);", "1.print(3);", 'x.getSlot("a");', 'x.getSlot("bcd");',
     'x.getSlot("e");'],
    ['o.p->rangemin = 1;', 'o.p->rangemin = 2;', "o.p->rangemin = 3;",
     "1;2;3;4;\n5;\n6; 7; nope(8); nope(99);nope(100);"],
]  # fmt: skip


@pytest.mark.parametrize("session", SESSIONS, ids=[session[0] for session in SESSIONS])
def test_every_answer_is_what_it_was(session: list[str]) -> None:
    """Also the positions in errors, of statements of one line and of those behind them."""
    with_templates, without = Console(), Console(with_templates=False)
    for text in [*session, " ".join(session)]:
        assert with_templates.say(text) == without.say(text), text


def test_the_third_statement_of_a_kind_is_neither_read_nor_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    console, compiled = Console(), []

    def counting(*args: Any, **named: Any) -> CompiledUnit:
        compiled.append(args)
        return compile_node(*args, **named)

    monkeypatch.setattr(templates, "compile_node", counting)
    console.say('var o = Object.new|; function o.f(a, b) { echo(a + b) }|; o.f("x", 1); o.f("y", 2); o.f("z", 3);')
    number = len(compiled)
    assert console.say('o.f("it is ", 4.5);').endswith("*** it is 4.5\n")
    assert len(compiled) == number
    known = console.kernel.programs.read.get('o.f("k", 5);')
    assert isinstance(known.node, TemplateUse)


def test_the_place_of_a_statement_is_noted_without_reading_it_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """As each write of a variable that moves something does, so that its log can tell where it was asked for."""
    console, compiled = Console(), []
    noted: list[Callable[[], Stack]] = []

    def counting(*args: Any, **named: Any) -> CompiledUnit:
        compiled.append(args)
        return compile_node(*args, **named)

    monkeypatch.setattr(templates, "compile_node", counting)

    def mark(this: Value, value: Value) -> Value:
        noted.append(later_stack())
        return value

    world = console.kernel.world
    world.global_.slots["mark"] = make_primitive(world, "mark", mark, 1, 1)
    console.say("mark(1); mark(2); mark(3);\necho(mark(1)); echo(mark(2)); echo(mark(3));\n")
    noted.clear()
    number = len(compiled)
    assert console.say("mark(44);").endswith("] 44\n") and console.say("echo(mark(55));").endswith("*** 55\n")
    assert len(compiled) == number
    assert [str(stack().location) for stack in noted] == ["3.1-8", "3.15-22"]
    assert [stack().routine for stack in noted] == ["mark", "mark"]


def test_lines_with_a_lazy_function_of_the_client_itself_are_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    console, compiled = Console(), []

    def counting(*args: Any, **named: Any) -> CompiledUnit:
        compiled.append(args)
        return compile_node(*args, **named)

    monkeypatch.setattr(templates, "compile_node", counting)
    console.say("function count { call.args.size }|; class K { function count(x) { x } }|; var k = K.new|;")
    console.say("count(1, 1); count(2, 2); count(3, 3); k.count(1); k.count(2); k.count(3);")
    number = len(compiled)
    assert console.say("count(4, 5);").endswith("] 2\n")
    assert console.say("k.count(6);").endswith("] 6\n")
    assert len(compiled) == number


def test_each_set_of_lazy_names_has_a_form_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, compiled = Kernel(SimClock()), []

    def counting(*args: Any, **named: Any) -> CompiledUnit:
        compiled.append(args)
        return compile_node(*args, **named)

    monkeypatch.setattr(templates, "compile_node", counting)
    lobbies = [kernel.open_lobby() for _ in range(templates.MAX_FORMS + 2)]
    for number, lobby in enumerate(lobbies):
        names = [f"f{digit}" for digit in range(3) if number >> digit & 1]
        kernel.run_text(lobby, "".join(f"function lobby.{name} {{ call.args.size }}|;" for name in names))
        kernel.run_text(lobby, "".join(f"function lobby.f{n}(x) {{ x }}|;" for n in range(3) if f"f{n}" not in names))

    def answers(number: int, argument: int) -> str:
        return kernel.run_text(lobbies[number], f"[f0({argument}), f1({argument}), f2({argument})];")

    def expected(number: int, argument: int) -> str:
        return f"[00000000] [{', '.join(str(1 if number >> digit & 1 else argument) for digit in range(3))}]\n"

    for argument in (5, 6, 7):
        for number in range(len(lobbies)):
            assert answers(number, argument) == expected(number, argument)
    forms = [len(each._forms) for each in kernel.programs.read._templates.values() if each is not None]
    assert max(forms) == templates.MAX_FORMS
    for number in (1, 2):
        answers(number, 8)
    before = len(compiled)
    for argument in (9, 10):
        for number in (1, 2):
            assert answers(number, argument) == expected(number, argument)
    assert len(compiled) == before


def test_a_function_that_becomes_lazy_is_called_so() -> None:
    console = Console()
    console.say("function f(x) { echo(x) }|; f(1); f(2); f(3);")
    console.say('removeSlot("f")|; function f { echo(call.args[0].asString) }|;')
    assert console.say("f(41);").endswith("*** 41\n")
    assert console.say("f(42);").endswith("*** 42\n")


def test_floods_of_data_leave_nothing_behind() -> None:
    console = Console()
    programs = console.kernel.programs
    console.say("var x = 0|;")
    before = len(programs.read)
    for number in range(3000):
        console.lobby.feed(f"x = {number}|;".encode())
        console.kernel.scheduler.run_simulated(console.kernel.clock.now() + 0.001)
    assert console.say("x;").endswith(" 2999\n")
    assert len(programs.read) <= before + 3


def test_what_is_remembered_is_bounded() -> None:
    console = Console()
    programs = console.kernel.programs
    for number in range(templates.MAX_TEMPLATES + 50):
        console.say(f"var v{number} = [{number}]|; v{number}x.g(1)|; v{number}x.g(2)|;")
    assert len(programs.read) <= templates.MAX_TEMPLATES and len(programs.read._templates) <= templates.MAX_TEMPLATES


def test_binary_data_is_never_taken_for_literals() -> None:
    console, plain = Console(), Console(with_templates=False)
    for text in ["BIN 1e2;aaaa;", "BIN 1e2;aaaa;", "BIN 1 e2;abbb;", "BIN 1;abbb;"] * 2:
        assert console.say(text) == plain.say(text)
