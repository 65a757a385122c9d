"""Advice behind the errors of beginners: what each mistake is told, and that nobody else is told anything."""

from __future__ import annotations

from functools import cache

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock

shared_kernel = cache(lambda: Kernel(SimClock()))
HINT = "!!!    hint: "
CASES = {
    "var gain = 2| class Amp { function out(x) { x * gain } }| Amp.out(3);":
        "gain is a variable of your connection, which other objects do not see: use var Global.gain",
    "speed = 3;": "a new variable is declared with var: var speed = ...",
    "class P { function init(a) {} }|; P(3);": "an object of this kind is made by new: P.new(...)",
    "echo('hi');": 'a String stands between double quotes: "hi"',
    "try { 1/0 } catch (e) { echo(e) };": "the variable is declared in the parentheses: catch (var e)",
    "for (i in [1, 2]) echo(i);": "the variable is declared in the parentheses: for (var i in list)",
    "for i in [1, 2] echo(i);": "the variable is declared in parentheses: for (var i in list) echo(i)",
    "class S { function f() { self.x } }|; S.f;": "the object itself is called this",
    "if (false) 1; else 2;": "there is no ; before else: if (c) 1 else 2",
    "if (false) 1 elif (true) 2;": "the next condition follows else: if (a) 1 else if (b) 2",
    "every 1s echo(1);": "what follows every stands in parentheses: every (1s)",
    "while true { 1 };": "what follows while stands in parentheses: while (...)",
    "var e = Event.new|; e.emit(1);": "an event is emitted by a !, as in e!(1)",
    "echo(\xe2\x80\x9chi\xe2\x80\x9d);": 'a String stands between straight quotes: "hi"',
    "NULL;": "no value at all is nil",
    "def f(x) { x };": "a function is declared like this: function f(x) { x + 1 }",
    "int n = 3;": "a variable is declared with var: var x = 1",
    "let n = 3;": "a variable is declared with var: var x = 1",
    "++i;": "the sign stands behind the name: x++",
    "[1, 2].length;": "the number of members is x.size",
    "[1].push(2);": "a value is added to a list by <<, as in list << 3",
    "str(3);": "the text of a value is x.asString",
    "print(3);": "a value is printed by echo(x)",
    "help;": 'x.localSlotNames; lists the slots of x, System.documentation(x, "size"); describes one',
    "for (i = 0; i < 3; i++) echo(i);": "the variable is declared in the parentheses: for (var i = 0; ...)",
    'echo "hi";': "arguments stand in parentheses: echo(...)",
    "sleep 1s;": "arguments stand in parentheses: sleep(...)",
    "class A extends Object { };": "the prototype stands behind a colon: class A : B { }",
    "try { 1 } except { 2 };": "errors are caught by catch: try { f } catch (var e) { echo(e) }",
    "var x = 1|; x := 2;": "a value is assigned by =, as in x = 3",
    "[1].forEach(function (x) {});": "a function is called with each member by list.each(f)",
    '"abc".substr(1);': "a part of a String is s[begin, end]",
    '"abc".upper;': "capital letters are made by toUpper",
    '"1".toInt;': "a number is made by asFloat",
    "[1].contains(1);": "a member is found by in: 3 in list",
    "rand();": "a random integer below 100 is 100.random",
    "Math.PI;": "the constant is called pi",
    "if (1 > 2) then echo(1);": "there is no then: if (c) 1 else 2",
    "elif (1 > 2) echo(1);": "the next condition follows else: if (a) 1 else if (b) 2",
    "unless (1 > 2) echo(1);": "the opposite of a condition is !: if (!c) { ... }",
    "repeat (3) echo(1);": "so many times is for (3) { ... }",
    "loop (3) echo(1);": "so many times is for (3) { ... }",
    "loop: echo(1);": "what belongs together stands in braces: if (c) { ... }",
    "if (1 > 2): echo(1);": "what belongs together stands in braces: if (c) { ... }",
    "do { echo(1) } while (false);": "a loop is written while (c) { ... }",
    "function f(x) return x;": "a function is declared like this: function f(x) { x + 1 }",
    "[1].map(x => x * 2);": "a function is written like this: function (x) { x + 1 }",
    "var h = lambda x: x;": "a function is written like this: function (x) { x + 1 }",
    "1 is 5;": "two values are compared by ==",
    "1 <> 5;": "not equal is written !=",
    "true AND false;": "and is written &&",
    "true ? 1 : 2;": "a choice is written if (c) 1 else 2",
    "1 if true else 2;": "a choice is written if (c) 1 else 2",
    "at (true) { 1 } else { 2 };": "at has onleave in place of else: at (c) 1 onleave 2",
    "switch (1) { case 1: echo(1); break; };": "a case of a switch ends by itself, without break",
    "try { 1 } catch (Exception e) { 2 };": "errors of a kind are caught by catch (var e if e.isA(Exception))",
    'raise "bad";': "an error is thrown by throw",
    "from math import sin;": "there is nothing to import: write the object before the name, as in Math.cos",
    "# a comment;": "a comment begins with //",
    "`hello`;": 'a String stands between double quotes: "hi"',
    "'abc;\n": 'a String stands between double quotes: "hi"',
    '"a" . "b";': 'texts are joined by +: "a" + "b"',
    "var \xc3\xa9t\xc3\xa9 = 3;": "a name has letters from a to z, digits and _",
    "sleep(1 s);": "a unit stands at its number: 2s, 90deg; there are ms, s, min, h, d, rad, deg and grad",
    "sleep(1sec);": "a unit stands at its number: 2s, 90deg; there are ms, s, min, h, d, rad, deg and grad",
    "[1 2 3];": "values are separated by a comma: f(1, 2), [1, 2]",
    "echo(1) echo(2);": "statements are separated by ;",
    '["a": 1];': 'a Dictionary is written ["a" => 1]',
    'int("5");': 'a number is made by asFloat: "5".asFloat',
    "foreach (x in [1, 2]) echo(x);": "the variable is declared in the parentheses: for (var x in list)",
    "const k = 3;": "a constant is declared with const var: const var x = 1",
    "Nowhere(3);": "there is no class Nowhere: class Nowhere { ... } makes one, Nowhere.new(...) an object of it",
    "exit;": "quit; ends the connection, shutdown; the server",
}
WITHOUT = (
    "nowhere;", "1.nowhere;", "sin(1, 2);", "1 / 0;", "]", "1 + * 2;", "hi();", "try { NULL } catch {};", "throw 1;",
    "function f() { hi }|; f;", "1 = 2;", "\\;", "P.new;", "Object.new.setSlot;",
)  # fmt: skip


def say(text: str, quiet: bool = False) -> list[str]:
    """What a new connection is told."""
    kernel = shared_kernel()
    kernel.programs.quiet = True
    lobby: Lobby = kernel.open_lobby()
    kernel.programs.quiet = quiet
    lobby.feed(text.encode("latin-1"))
    kernel.run()
    return [line.partition("] ")[2] for line in lobby.output.take_bytes().decode("latin-1").splitlines()]


def beginner() -> tuple[Kernel, Lobby]:
    """A kernel that gives advice, and a new connection."""
    kernel = shared_kernel()
    kernel.programs.quiet = False
    return kernel, kernel.open_lobby()


@pytest.mark.parametrize("typed", CASES)
def test_a_mistake_is_followed_by_one_hint(typed: str) -> None:
    said = say(typed)
    hints = [line.removeprefix(HINT) for line in said if line.startswith(HINT)]
    assert hints == [CASES[typed]]
    assert said.index(HINT + hints[0]) > 0  # the error itself comes first


@pytest.mark.parametrize("typed", ["int n = 3;", "# a comment;", "var \xc3\xa9t\xc3\xa9 = 3;", "`hello`;", "a$b;"])
def test_an_error_with_a_hint_is_the_only_one_of_its_statement(typed: str) -> None:
    assert len(say(typed)) == 2


@pytest.mark.parametrize("typed", WITHOUT)
def test_other_errors_have_none(typed: str) -> None:
    assert not any("hint" in line for line in say(typed))


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (("var a = 3", ""), "end the statement with ;"),
        (("var a = 3", "exit"), "the statement before it is not complete: end it with ;, then write quit;"),
        (("motor6.val = echo(1", "quit;"), "the statement before it is not complete: end it with ;, then write quit;"),
        (("echo(1", ""), "a bracket is open: close it, and end the statement with ;"),
        (("echo((1 2;", "", ""), "a bracket is open: close it, and end the statement with ;"),
        (('echo("hi);', ""),
         "a String, a name between quotes or a comment is open: close it, and end the statement with ;"),
        (("every (1s) 1;", "2;", "3;"),
         "this waits: every and loop never end; Ctrl-C ends them, a comma behind them lets go on"),
        (("1;", ""), ""),
        (("", "  // nothing", ""), ""),
    ],
)  # fmt: skip
def test_who_waits_in_vain_for_an_answer_hears_why(lines: tuple[str, ...], told: str) -> None:
    kernel, lobby = beginner()
    kernel.run()
    lobby.output.take_bytes()
    for line in lines:
        kernel.feed(lobby, line.encode() + b"\r\n")
        kernel.run()
    said = lobby.output.take_bytes().decode()
    lobby.close()
    assert said.splitlines()[-1].partition("hint: ")[2] == told if told else "hint" not in said
    assert said.count("every and loop") <= 1


@pytest.mark.parametrize("typed", ["", "every (1s) 1;", "if (true) {", "var a = 3", 'echo("hi'])
def test_signs_of_life_of_a_lease_are_not_answered(typed: str) -> None:
    kernel, lobby = beginner()
    kernel.feed(lobby, b"lobby.lease = 2s|;")
    kernel.feed(lobby, typed.encode() + b"\n")
    kernel.run()
    lobby.output.take_bytes()
    for empty in (b"\n", b"\r\n", b"\n\n"):
        kernel.feed(lobby, empty)
    kernel.run()
    said = lobby.output.take_bytes()
    kernel.feed(lobby, b"exit\n")
    kernel.run()
    told = lobby.output.take_bytes()
    lobby.close()
    assert said == b""
    assert b"hint: " in told  # a line that somebody types is answered as before


@pytest.mark.parametrize("lease", ["0", "2s"])
def test_an_empty_line_does_not_hear_that_a_loop_goes_on(lease: str) -> None:
    kernel, lobby = beginner()
    kernel.feed(lobby, f"lobby.lease = {lease}|; loop {{ sleep(1s) }};".encode())
    kernel.run()
    lobby.output.take_bytes()
    kernel.feed(lobby, b"\n")
    kernel.run()
    said = lobby.output.take_bytes()
    lobby.close()
    assert said == b""


@pytest.mark.parametrize(
    ("text", "endless"),
    [("loopback", False), ("everyone", False), ("loop_1", False), ("every(1s) 1", True), ("every| (1s) 1", True),
     ("loop{ sleep(1s) }", True), ("loop sleep(1s)", True)],
)  # fmt: skip
def test_only_every_and_loop_go_on_for_ever(text: str, endless: bool) -> None:
    kernel, lobby = beginner()
    for name in ("loopback", "everyone", "loop_1"):
        kernel.feed(lobby, f"var lobby.{name} = 1|;".encode())
    kernel.feed(lobby, f"{text}| sleep(1s);".encode())
    kernel.run()
    lobby.output.take_bytes()
    kernel.feed(lobby, b"2;\n")
    said = lobby.output.take_bytes()
    lobby.close()
    assert (b"this waits" in said) == endless


def test_typographic_quotes_are_one_error() -> None:
    said = say("var x = \xe2\x80\x9chi\xe2\x80\x9d + \xe2\x80\x98ho\xe2\x80\x99; 1;")
    assert said[0] == r"!!! 1.9-11: syntax error: invalid character: `\xe2\x80\x9c'"
    assert said[2:] == ["1"]


def test_answers_of_the_original_only() -> None:
    assert say("speed = 3;", quiet=True) == ["!!! 1.1-5: lookup failed: speed (possible misspelling of sleep)"]


def test_a_quote_that_arrives_in_two_packets() -> None:
    kernel = shared_kernel()
    lobby = kernel.open_lobby()
    for part in (b"\xe2\x80", b"\x9chi;\n"):
        lobby.feed(part)
        kernel.run()
    assert lobby.output.take_bytes().count(b"invalid character") == 1
