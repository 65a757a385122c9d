"""What a program can do to a server, and what it cannot: all in one process, on the simulated clock."""

from __future__ import annotations

import logging

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby


class Talk:
    """One connection of a kernel; ``other`` is a neighbour that must never notice."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.lobby = self.open()
        self.other = self.open()

    def open(self) -> Lobby:
        """One more connection."""
        return self.kernel.open_lobby("127.0.0.1")

    def say(self, text: str | bytes, until: float | None = None, *, lobby: Lobby | None = None) -> list[str]:
        """Send something, let time pass until nothing is left to do; the lines that come back, without time stamps."""
        lobby = self.lobby if lobby is None else lobby
        lobby.feed(text.encode("latin-1") if isinstance(text, str) else text)
        self.kernel.scheduler.run_simulated(until)
        return self.heard(lobby)

    def heard(self, lobby: Lobby) -> list[str]:
        """What a connection was told since the last look, without time stamps."""
        lines = lobby.output.take_bytes().decode("latin-1").splitlines()
        return [line[:1] + line[9:] if line[9:10] in ":]" and line[:1] == "[" else line for line in lines]


@pytest.fixture
def talk(caplog: pytest.LogCaptureFixture) -> Talk:
    caplog.set_level(logging.WARNING)
    return Talk()


def check(talk: Talk, caplog: pytest.LogCaptureFixture) -> None:
    """The connection and its neighbour answer, and nothing was our fault."""
    assert talk.say("\n;40 + 2;") == ["[] 42"]
    assert talk.say("6 * 7;", lobby=talk.other) == ["[] 42"]
    assert [record.getMessage() for record in caplog.records if "bug" in record.getMessage()] == []


# ---------------------------------------------------------------- statements that nest deep

NESTED = {
    "parentheses": ("(", "1", ")"),
    "list": ("[", "1", "]"),
    "braces": ("{", "1", "}"),
    "sum": ("1 + ", "1", ""),
    "sum to the right": ("(1 + ", "1", ")"),
    "and": ("true && ", "true", ""),
    "or": ("false || ", "true", ""),
    "strings": ('"a" + ', '"b"', ""),
    "pushes": ("", "[]", " << 1"),
    "power": ("1 ** ", "1", ""),
    "not": ("!", "true", ""),
    "minus": ("- ", "1", ""),
    "calls": ("f(", "1", ")"),
    "messages": ("", '"a"', ".asString"),
    "subscripts": ("", "x", "[0]"),
    "assignments": ("x = ", "1", ""),
    "dictionary": ('["a" => ', "1", "]"),
    "functions": ("function () {", "1", "}"),
    "tags": ("t: ", "1", ""),
    "ifs": ("if (true) ", "1", ""),
    "elses": ("if (false) 0 else ", "1", ""),
    "loops": ("for| (1) ", "1", ""),
    "whiles": ("while (true) {", "break", "; break}"),
    "tries": ("try {", "1", "} catch { 2 }"),
    "catches": ("try { throw 1 } catch {", "1", "}"),
    "finallies": ("try { 1 } finally {", "1", "}"),
    "ats": ("at (false) ", "1", ""),
    "branches": ("1 & ", "1", ""),
}


AT_THE_LEFT = ("sum", "and", "or", "strings", "pushes", "messages", "subscripts", "not", "minus")
ANY_DEPTH = (*AT_THE_LEFT, "parentheses", "branches")


@pytest.mark.parametrize("kind", NESTED)
@pytest.mark.parametrize("depth", [5, 100, 4000])
def test_deep_nesting_is_answered_or_refused(
    talk: Talk, caplog: pytest.LogCaptureFixture, kind: str, depth: int
) -> None:
    before, inside, after = NESTED[kind]
    answer = talk.say("var x = [1]|;\n" + before * depth + inside + after * depth + ";", until=1.0)
    if answer and "too deeply nested" in answer[0]:
        assert depth > 100
        assert kind not in ANY_DEPTH
        assert len(answer) == 1
        assert answer[0].startswith(("[:error] !!! 2.1-", "[:error] !!! 2.2-"))
        assert answer[0].endswith(": syntax error: statement too deeply nested")
    else:
        assert depth < 4000 or kind in ANY_DEPTH
        assert "error" not in "".join(answer) or kind in ("calls", "subscripts")
    check(talk, caplog)


SANE = (
    ("parentheses", 2000, "1"), ("list", 500, "[" * 500 + "1" + "]" * 500), ("sum", 5000, "5001"),
    ("braces", 1000, "1"), ("sum to the right", 1000, "1001"), ("and", 5000, "true"), ("or", 5000, "true"),
    ("assignments", 1000, "1"),
    ("strings", 5000, '"' + "a" * 5000 + 'b"'), ("pushes", 5000, "[" + ", ".join("1" * 5000) + "]"),
    ("tries", 100, "1"), ("catches", 100, "1"), ("finallies", 100, "1"), ("tags", 100, "1"), ("ifs", 1000, "1"),
)  # fmt: skip


@pytest.mark.parametrize("kind, depth, answer", SANE)
def test_sane_nesting_is_answered(talk: Talk, kind: str, depth: int, answer: str) -> None:
    before, inside, after = NESTED[kind]
    talk.say("var x = 0|;")
    assert talk.say(before * depth + inside + after * depth + ";") == ["[] " + answer]


def test_a_long_sum_works_wherever_it_stands(talk: Talk) -> None:
    """Terms are evaluated from left to right, each once."""
    long = "+".join(["f(1)"] * 1000)
    talk.say("var n = 0|; var order = []|; function f(x) { n += x | n }|;")
    assert talk.say(f"{long};") == ["[] 500500"]
    assert talk.say(f"n = 0|; if ({long} > 500500) 1 else 2;") == ["[] 2"]
    assert talk.say(f"n = 0|; var a = 0|; while ({long} < 500501) a++|; a;") == ["[] 1"]
    assert talk.say(f"n = 0|; [order << 1, {long}, order << 2];") == ["[] [[1, 2], 500500, [1, 2]]"]
    assert talk.say(f"n = 0|; function g(x) {{ {long} + x }}|; g(1);") == ["[] 500501"]
    assert talk.say(f"n = 0|; var c = closure () {{ {long} }}|; c();") == ["[] 500500"]
    assert talk.say(f"n = 0|; assert({long} == 500500);") == []
    assert talk.say(f"n = 0|; false && {long};") == ["[] false"]
    assert talk.say("n;") == ["[] 0"]
    assert talk.say(f"at ({'+'.join(['n'] * 1000)} == 3000) echo(n)|; n = 3|;", until=1) == ["[] *** 3"]
    (error,) = talk.say("+".join(["n"] * 1000) + ' + "a";')
    assert error.endswith(": +: unexpected \"a\" for argument 1, expected a Float")


def test_variables_of_blocks_that_python_cannot_nest(talk: Talk) -> None:
    """Beyond 20 blocks in one function the inner ones are functions; variables go through them."""
    loops = "".join(f"for| (var i{n} = 0; i{n} < 2; i{n} += 1) {{ " for n in range(8))
    assert talk.say("{ var sum = 0; " + loops + "sum += i0 + i7" + "}" * 8 + "; sum };") == ["[] 256"]
    deep, ends = "for| (var z : [1]) {" * 30, "}" * 30
    assert talk.say("{ var n = 0; " + deep + "n += z; var m = n" + ends + "; n };") == ["[] 1"]
    assert talk.say("{ var l = []; for| (var x : [1, 2]) {" + deep + "l << closure () { x }" + ends
                    + "}; [l[0].apply([this]), l[1].apply([this])] };") == ["[] [1, 2]"]


def test_jumps_out_of_blocks_that_python_cannot_nest(talk: Talk) -> None:
    """Jumps, errors and stops go through them too."""
    tries, ends = "try {" * 25, '} catch (var e if e == "no") {}' * 25
    finals = "".join(f"}} finally {{ l << {n} }}" for n in range(1, 26))
    talk.say("var t = Tag.new|;")
    assert talk.say("function f() { " + "try {" * 25 + "return 7" + "} finally { 1 }" * 25 + " }|; f();") == ["[] 7"]
    assert talk.say("{ var n = 0; while (true) { n += 1; " + tries + "if (n == 3) break" + ends + "}; n };") == ["[] 3"]
    assert talk.say("{ var n = 0; var m = 0; while (n < 5) { n += 1; " + tries + "continue" + ends + "; m += 1 }; m };"
                    ) == ["[] 0"]
    assert talk.say("try {" + tries + "throw 42" + ends + "} catch (var e) { e };") == ["[] 42"]
    assert talk.say("t: {" + tries + "t.stop(5)" + ends + "};") == ["[] 5"]
    assert talk.say("{ var l = []; " + "try {" * 25 + "l << 0" + finals + "; l };") == [f"[] {list(range(26))}"]


def test_deep_nesting_in_a_file_or_eval_is_an_exception(talk: Talk) -> None:
    assert talk.say('try { eval("[" * 4000 + "]" * 4000) } catch (var e) { e.message };') == [
        '[] "statement too deeply nested"'
    ]


def test_a_long_statement_of_many_lines_is_fine(talk: Talk) -> None:
    assert talk.say("[" + ",\n".join(["1"] * 3000) + "].size;") == ["[] 3000"]


# ---------------------------------------------------------------- recursion without end

ENDLESS = {
    "function": ("function f() { f() };", "f();"),
    "argument": ("function f(x) { f(x + 1) };", "f(1);"),
    "mutual": ("function f() { g() }; function g() { f() };", "f();"),
    "lazy": ("function f { f };", "f;"),
    "method": ("class A { function m() { this.m() } };", "A.m();"),
    "operator": ("class B { function '+'(x) { this + x } };", "B.new + 1;"),
    "comparison": ("class B { function '<'(x) { this < x } };", "B.new < 1;"),
    "equality": ("class B { function '=='(x) { this == x } };", "B.new == 1;"),
    "negation": ("class B { function '-'() { -this } }; var b = B.new|;", "-b;"),
    "printing a result": ("class C { function asString() { this.asString } };", "C.new;"),
    "echoing": ("class C { function asString() { this.asString } };", "echo(C.new);"),
    "printing inside": ("class C { function asPrintable() { this.asPrintable } };", "[C.new];"),
    "printing an error": ("class C { function asString() { this.asString } };", "throw C.new;"),
    "formatting": ('class G { function asString() { "%s" % this } };', "G.new;"),
    "finally": ("function f() { try { f() } finally { 1 } };", "f();"),
    "getter": ("var Global.D = Object.new|; function D.y() { this.y };", "D.y;"),
    "map": ("function f(x) { [1].map(closure (y) { f(y) }) };", "f(1);"),
    "sort": ("function f() { [2, 1].sort(closure (a, b) { f() }) };", "f();"),
    "for": ("function f() { for (var x: [1]) f() };", "f();"),
    "eval": ('function f() { eval("f()") };', "f();"),
    "tag": ("var t = Tag.new|; function f() { t: f() };", "f();"),
    "fallback": ("class E { function fallback() { this.foo } };", "E.bar;"),
    "init": ("class Global.F { function init() { F.new } };", "F.new;"),
    "default": ("function f(x = f()) { x };", "f();"),
    "sleeping": ("function f() { sleep(0) | f() };", "f();"),
    "waituntil": ("function f() { waituntil (f()) };", "f();"),
    "comparing lists in themselves": ("var l = []|; l << l|; var m = []|; m << m|;", "l == m;"),
    "comparing dictionaries in themselves": (
        'var d = ["a" => 1]|; d["a"] = d|; var e = ["a" => 1]|; e["a"] = e|;', "d == e;"
    ),
    "list of depth 20000": ("var l = []|; for| (20000) l = [l];", "l;"),
    "comparing deep lists": ("var l = []|; var m = []|; for| (20000) { l = [l] | m = [m] };", "l == m;"),
    "forking": ("function f() { f() & f() };", "f();"),
    "in the background": ("function f() { f(), };", "f();"),
}


@pytest.mark.parametrize("kind", ENDLESS)
def test_endless_recursion_ends_that_job_only(talk: Talk, caplog: pytest.LogCaptureFixture, kind: str) -> None:
    setup, start = ENDLESS[kind]
    jobs, timers = len(talk.kernel.scheduler.jobs), len(talk.kernel.scheduler.timers)
    talk.kernel.scheduler.shares.max_total = 2000
    talk.say(setup)
    answer = talk.say(start)
    told = [line for line in answer if "called from" not in line]
    assert len(told) == 1
    assert told[0].startswith("[:error] !!! ")
    assert told[0].endswith("too many jobs" if "f()," in setup or "&" in setup else "stack exhausted")
    assert len(talk.kernel.scheduler.jobs) == jobs
    assert len(talk.kernel.scheduler.timers) == timers
    check(talk, caplog)


def test_endless_recursion_can_be_caught(talk: Talk) -> None:
    talk.say("function f(n) { 1 + f(n) };")
    assert talk.say("try { f(1) } catch (var e) { e.message };") == ['[] "stack exhausted"']


def test_a_few_thousand_calls_deep_is_fine(talk: Talk) -> None:
    talk.say("var Global.depth = function (n) { if (n == 0) 0 else 1 + Global.depth(n - 1) }|;")
    assert talk.say("Global.depth(2000);") == ["[] 2000"]


def test_an_error_that_cannot_be_printed_is_still_told(talk: Talk, caplog: pytest.LogCaptureFixture) -> None:
    talk.say("class Global.Bad { function asString() { throw Bad.new } };")
    assert talk.say("throw Global.Bad.new;") == ["[:error] !!! 1.60-79: Bad_0x10000020"]
    check(talk, caplog)


def test_a_deep_call_stack_is_told_in_part(talk: Talk) -> None:
    talk.say("function f(n) { if (n == 0) throw 1 else f(n - 1) };")
    answer = talk.say("f(2000);")
    assert answer[0] == "[:error] !!! 1"
    assert len(answer) == 40
    (gap,) = [line for line in answer if "left out" in line]
    assert int(gap.partition("... ")[2].split()[0]) == 2001 - 38
    assert answer[-1] == "[:error] !!!    called from: 1.53-59: f"
