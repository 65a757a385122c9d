"""Long texts: all other clients are answered while they are read and compiled, and what is too long is refused."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.syntax import reader

PART = 0.25
"""Part of the whole work that may be done in one go.  What is meant is a hundredth of a second; a part of the work is
the same on a machine that is slow or busy."""
ANSWERS = 5
"""How often a neighbour is answered at least while a long text is read."""
SHORT_S = 0.05
"""Seconds of the processor that may be taken in one go in any case: a short work has few parts."""


@pytest.fixture
def kernel() -> Iterator[Kernel]:
    made = Kernel()
    made.run()
    COLLECTOR.guard()  # as in a server: the objects of the other tests are not visited in the midst of a measurement
    gc.freeze()
    yield made
    COLLECTOR.release()
    made.close()


def lines(lobby: Lobby) -> list[str]:
    """What a lobby was told, without time stamps."""
    return [line[:1] + line[9:] for line in lobby.output.take_bytes().decode("latin-1").splitlines()]


def play(
    kernel: Kernel, text: str | bytes, neighbour: Lobby, last: str = "[] *** done"
) -> tuple[list[str], int, float]:
    """Send a text while a neighbour asks something after each run of the scheduler.

    Gives what was answered, how often the neighbour was meanwhile, and which part of the processor's time the longest
    run took, 0 for a short one.
    """
    lobby = kernel.open_lobby()
    lobby.feed(text.encode("latin-1") if isinstance(text, str) else text)
    lobby.feed(b'\n;echo("done");')
    said: list[str] = []
    answers, longest, whole = 0, 0.0, 0.0
    until = time.monotonic() + 60
    while last not in said and time.monotonic() < until:
        neighbour.feed(b"1 + 1;")
        began = time.thread_time()
        kernel.run()
        took = time.thread_time() - began
        longest, whole = max(longest, took), whole + took
        answers += len(lines(neighbour))
        said += lines(lobby)
    lobby.close()
    kernel.run()
    return said, answers, longest / whole if longest > SHORT_S else 0.0


LONG = {
    "list": ("[" + "1, " * 100_000 + "1].size", ["[] 100001"]),
    "list of lists": ("[" + ("[" + "1, " * 50 + "1], ") * 1000 + "1].size", ["[] 1001"]),
    "dictionary": ("[" + '"a" => 1, ' * 30_000 + '"b" => 2].size', ["[] 2"]),
    "sum": ("+".join(["1"] * 50_000), ["[] 50000"]),
    "function": ("function f() {" + "g(1); " * 20_000 + "1}|", []),
    "block": ("{ var n = 0; " + "n += 1; " * 10_000 + "n }", ["[] 10000"]),
    "class": ("class A {" + "".join(f"function f{n}(a) {{ var b = a; if (a) return b; b }}; " for n in range(1000))
              + "}|", []),
    "background": ("var n = 0|; {" + "n += 1, " * 3000 + "}; n", ["[] 3000"]),
    "text": ('"' + "a" * 5_000_000 + '".size', ["[] 5000000"]),
    "comment": ("/*" + "a b; " * 2_000_000 + "*/ 1", ["[] 1"]),
    "statements": ("nil;" * 50_000 + "2", ["[] 2"]),
    "long chain": ("var Global.n = 0|; " + "".join(f"Global.n = {n}|" for n in range(20_000)) + "Global.n",
                   ["[] 19999"]),
    "eval": ('eval("[" + "1, " * 50000 + "1].size")', ["[] 50001"]),
    "eval of statements": ('eval("nil; " * 50000 + "3")', ["[] 3"]),
    "wrong at the end": ("[" + "1, " * 50_000 + "1 1]", ["[:error] !!! 1.150004: syntax error: unexpected float"]),
    "wrong in a function": ("function f() {" + "var x; " * 20_000 + "}|", None),
    "refused": ("[" + "1, " * 200_000 + "1]",
                ["[:error] !!! 1.1-375000: syntax error: statement too long (more than 250000 words and signs):"
                 " make several of it"]),
    "calls in calls": ("f(" * 300 + "1" + ", [2, 3])" * 300, ["[:error] !!! 1.1-3301: lookup failed: f"]),
    "brackets": ("(" * 100_000 + "1" + ")" * 100_000,
                 ["[:error] !!! 1.1-20000: syntax error: statement too deeply nested"]),
    "open brackets": ("(" * 100_000, ["[:error] !!! 1.1-20000: syntax error: statement too deeply nested"]),
    "no characters": ("\x01" * 300_000 + "1", None),
}  # fmt: skip


@pytest.mark.parametrize("kind", LONG)
def test_neighbours_are_answered_meanwhile(kernel: Kernel, kind: str) -> None:
    text, expected = LONG[kind]
    last = "[] *** done" if kind != "open brackets" else str(expected[0] if expected else "")
    said, answers, longest = play(kernel, text, kernel.open_lobby(), last)
    assert said[-1] == last
    if expected is not None:
        assert said[: len(expected)] == expected
    assert answers >= ANSWERS
    assert longest < PART


def test_a_long_file_is_loaded_without_holding_others(kernel: Kernel, tmp_path: Path) -> None:
    file = tmp_path / "long.u"
    file.write_text("var Global.n = 0|;\n" + "Global.n += 1|;\n" * 10_000 + "[" + "1, " * 20_000 + "1].size;")
    said, answers, longest = play(kernel, f'load("{file}");', kernel.open_lobby())
    assert said == ["[] 20001", "[] *** done"]
    assert answers >= ANSWERS
    assert longest < PART


def test_a_program_that_is_too_long_to_load_is_refused(kernel: Kernel) -> None:
    said, answers, _ = play(kernel, 'eval("nil; " * 300000);', kernel.open_lobby())
    assert said[0].endswith("program too long (more than 500000 words and signs): make several of it")
    assert said[-1] == "[] *** done"
    assert answers >= ANSWERS


# ---------------------------------------------------------------- what waits to be read


def test_what_waits_is_counted_and_read_when_its_turn_comes(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    lobby.feed(b"var n = 0|; var e = Event.new|; waituntil (e?); 1;")
    kernel.run()
    assert lobby.shell.waiting == 0
    for _ in range(1000):
        lobby.feed(b"n += 1|;")
    kernel.run()
    assert lobby.shell.waiting == 8000
    other = kernel.open_lobby()
    kernel.world.ops.put_slot(kernel.world.global_, "e", lobby.slots["e"])
    other.feed(b"e!;")
    kernel.run()
    assert runs(kernel, lobby, b"n;") == ["[] 1", "[] 1000"]
    assert lobby.shell.waiting == 0


@pytest.mark.parametrize("text", [b"1 +;" * 500, b'var x = "' + b"ab" * 3000 + b'"|; "\\B(5)(a;b;c)"; x.size; 1 2; 3;',
                                  b"BIN 3000;" + b";" * 3000 + b"; 1; { 2; 3 }, 4;"])
@pytest.mark.parametrize("size", [1, 100, 5000])
def test_answers_do_not_depend_on_the_packets(kernel: Kernel, text: bytes, size: int) -> None:
    whole, parts = kernel.open_lobby(), kernel.open_lobby()
    whole.feed(text)
    for at in range(0, len(text), size):
        parts.feed(text[at : at + size])
        if at % 3:
            kernel.run()
    for _ in range(1000):
        kernel.run()
    expected = lines(whole)
    assert expected
    assert lines(parts) == expected


def begin(kernel: Kernel, text: str) -> Lobby:
    """A lobby in the midst of reading or compiling a text."""
    lobby = kernel.open_lobby()
    lobby.feed(text.encode())
    for _ in range(3):
        kernel.run()
    assert lobby.output.take_bytes() == b""
    return lobby


def runs(kernel: Kernel, lobby: Lobby, text: bytes) -> list[str]:
    """What a lobby answers to a short statement."""
    lobby.feed(text)
    for _ in range(100_000):
        if kernel.run() is None:
            break
    return lines(lobby)


READING = "[" + "1, " * 30_000 + "1].size;"
COMPILING = "+".join(["1"] * 3000) + "; " + "1;" * 1000


@pytest.mark.parametrize("text", [READING, COMPILING])
def test_an_interruption_ends_the_reading_and_the_compiling(kernel: Kernel, text: str) -> None:
    lobby = begin(kernel, text)
    lobby.shell.interrupt()
    kernel.run()
    assert lobby.shell.waiting == 0
    assert runs(kernel, lobby, b"6 * 7;") == ["[:error] !!! received interruption, killing foreground job.", "[] 42"]


@pytest.mark.parametrize("text", [READING, COMPILING])
def test_a_client_that_is_gone_in_the_midst_of_it(kernel: Kernel, text: str) -> None:
    jobs = len(kernel.scheduler.jobs)
    lobby = begin(kernel, text)
    lobby.close()
    for _ in range(10):
        kernel.run()
    assert len(kernel.scheduler.jobs) == jobs
    assert runs(kernel, kernel.open_lobby(), b"6 * 7;") == ["[] 42"]
    assert not COLLECTOR.is_busy()


def test_a_stop_of_the_connection_ends_the_statement_only(kernel: Kernel) -> None:
    for _ in range(50):
        lobby = begin(kernel, "+".join(["1"] * 20_000) + "; 2;")
        for _ in range(100_000):  # until it is compiled: what is being read belongs to no statement yet
            if not lobby.shell.waiting:
                break
            kernel.run()
        if not lines(lobby):
            lobby.tag.tag.stop(kernel.world.void)
            answers = runs(kernel, lobby, b"6 * 7;")
            if answers == ["[] 2", "[] 42"]:
                return
            assert answers == ["[] 20000", "[] 2", "[] 42"]  # it had been read, and not begun
        lobby.close()  # or it has ended in the turn in which it was compiled
    pytest.fail("no stop came while the statement ran")


def test_the_limit_of_recursion_is_that_of_programs_while_something_is_compiled(kernel: Kernel) -> None:
    other = kernel.open_lobby()
    other.feed(b"function Global.deep(n) { 1 + deep(n) };")
    begin(kernel, "+".join(["1"] * 20_000) + ";")
    kernel.run()
    lines(other)
    assert runs(kernel, other, b"deep(1);")[0].endswith("stack exhausted")


def test_a_short_statement_is_run_at_once() -> None:
    """Nothing comes between: no other job, no turn of the sockets.  In simulated time no statement is late."""
    kernel = Kernel(clock=SimClock())
    lobby = kernel.open_lobby()
    kernel.run()
    lobby.feed(b'var l = [1, 2, 3]|; eval("l << 4"); l;')
    assert lobby.shell.waiting == 0
    kernel.run()
    assert lines(lobby) == ["[] [1, 2, 3, 4]", "[] [1, 2, 3, 4]"]


def test_when_idle_waits_for_what_waits(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    lobby.feed(b"nil;" * 5000 + b"1;")
    said: list[list[str]] = []
    lobby.shell.when_idle(lambda: said.append(lines(lobby)))
    for _ in range(1000):
        kernel.run()
        if said:
            break
    assert said[0] == ["[] 1"]


def test_a_refused_statement_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_BYTES", 10_000)
    made = reader.StatementReader()
    (refused,) = made.feed(b'f("' + b"a" * 20_000)
    assert isinstance(refused, reader.SyntaxProblem)
    assert refused.message == "statement too long (more than 10000 bytes): make several of it"
    for _ in range(100):
        assert made.feed(b"; b" * 10_000) == []
    lexer = made._lexer
    assert sum(map(len, lexer._text)) + sum(map(len, lexer._parts)) + len(lexer.unread_input[0]) < 50_000
    (item,) = made.feed(b'", 1); 3;')
    assert isinstance(item, reader.Statement)
    assert item.text == "3;"
