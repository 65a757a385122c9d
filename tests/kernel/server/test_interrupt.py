"""Ctrl-C: the foreground job goes, its queue too, and nothing else; a program that never yields is left as well."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.shell import Shell
from urbihw.kernel.server.interrupt import Interrupter

KILLED = "[:error] !!! received interruption, killing foreground job."
BYE = "[:error] !!! received interruption, shutting down."


class Console:
    """An interactive lobby, its neighbour, and a key to press."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.lobby = self.kernel.open_lobby()
        self.other = self.kernel.open_lobby("127.0.0.1")
        self.ended = 0
        self.press = Interrupter(self.kernel.scheduler, self.end, self.lobby)
        self.kernel.run()

    def end(self) -> None:
        """What a shutdown does."""
        self.ended += 1

    def say(self, text: str, until: float | None = None) -> list[str]:
        """Type something and let simulated time pass; what comes back, without time stamps."""
        self.lobby.feed(text.encode())
        self.kernel.scheduler.run_simulated(until)
        return [line[:1] + line[9:] for line in self.lobby.output.take_bytes().decode().splitlines()]

    def ask(self, text: str) -> str:
        """What the neighbour is answered."""
        return self.kernel.run_text(self.other, text).partition("] ")[2].strip()

    @contextmanager
    def signals(self, *, period: float = 0.0) -> Iterator[None]:
        """The interruption comes as a signal once the process has worked for 50 ms, and every ``period`` after."""
        former = signal.signal(signal.SIGVTALRM, self.press)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.05, period)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            signal.signal(signal.SIGVTALRM, former)


@pytest.fixture
def console() -> Console:
    return Console()


def test_the_foreground_job_and_what_waits_behind_it_go(console: Console) -> None:
    assert console.say('every (1s) echo("Hello");', until=1.5) == ["[] *** Hello"] * 2
    assert console.say('echo("done"); function f() {', until=2.5) == ["[] *** Hello"]
    console.press()
    assert console.say("", until=4) == [KILLED]
    assert console.say('echo("interrupted");') == ["[] *** interrupted"]
    assert console.ended == 0


def test_what_is_in_the_background_goes_on(console: Console) -> None:
    console.say("var n = 0|; every (1s) n++, sleep(1h);", until=0.5)
    console.press()
    assert console.say("", until=3.5) == [KILLED]
    assert console.say("n;", until=3.6) == ["[] 4"]


def test_a_statement_typed_at_once_afterwards_is_not_killed(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    line = console.lobby.output.line

    def answering(text: str, channel: str = "") -> None:
        line(text, channel)
        if "killing" in text:  # the user types before the rest of the interruption has its turn
            console.lobby.feed(b"{ sleep(1s); 2 };")

    monkeypatch.setattr(type(console.lobby.output), "line", lambda _self, *given: answering(*given))
    with console.signals():
        assert console.say("loop| {};") == [KILLED, "[] 2"]


def test_a_statement_that_has_not_begun_yet_is_not_killed(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt = Shell.interrupt

    def typing_before(shell: Shell, *turn: int) -> None:
        console.lobby.feed(b"1 + 1;")
        interrupt(shell, *turn)

    monkeypatch.setattr(Shell, "interrupt", typing_before)
    with console.signals():
        assert console.say("loop| {};") == [KILLED, "[] 2"]


def test_with_nothing_in_the_foreground_nothing_happens(console: Console) -> None:
    console.press()
    assert console.say("") == []
    assert console.say("1;") == ["[] 1"]


def test_twice_in_a_row_shuts_down(console: Console) -> None:
    console.say("sleep(1h);", until=1)
    console.press()
    console.press()
    assert console.say("", until=1) == [BYE, KILLED]
    assert console.ended == 1


def test_twice_with_some_time_between_does_not(console: Console) -> None:
    press = Interrupter(console.kernel.scheduler, console.end, console.lobby, iter([10.0, 11.6]).__next__)
    press()
    console.say("")
    press()
    console.say("")
    assert console.say("1;") == ["[] 1"]
    assert console.ended == 0


def test_without_a_lobby_the_first_shuts_down(console: Console) -> None:
    console.press.lobby = None
    console.press()
    assert console.say("1;") == ["[] 1"]
    assert console.ended == 1


def test_the_handler_is_that_of_the_process_until_a_shutdown_begins(console: Console) -> None:
    press = Interrupter(console.kernel.scheduler, console.end, console.lobby, second_is_fatal=True)
    former = signal.signal(signal.SIGINT, press)
    handlers = []
    try:
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
            handlers.append(signal.getsignal(signal.SIGINT))
    finally:
        signal.signal(signal.SIGINT, former)
    assert handlers == [press, signal.SIG_DFL]
    console.kernel.run()
    assert console.ended == 1


def test_sigterm_shuts_down_whatever_the_console_runs(console: Console) -> None:
    console.say("sleep(1h);", until=1)
    console.press(signal.SIGTERM)
    console.say("", until=1)
    assert console.ended == 1


def test_finally_clauses_run_and_no_catch_stands_in_the_way(console: Console) -> None:
    console.say('try { sleep(1h) } catch { echo("caught") } finally { echo("left") };', until=1)
    console.press()
    assert console.say("", until=1) == ["[] *** left", KILLED]


def test_branches_of_the_foreground_go_with_it(console: Console) -> None:
    jobs = len(console.kernel.scheduler.jobs)
    console.say("{ sleep(1h) & sleep(2h) & sleep(3h) };", until=1)
    console.press()
    assert console.say("") == [KILLED]
    assert len(console.kernel.scheduler.jobs) == jobs


ENDLESS = {
    "loop": "while| (true) {};",
    "loop that calls": 'while| (true) { "a" + "b" };',
    "for": "for| (1e12) {};",
    "function": "function f() { while| (true) 1 }; f();",
    "calls": "function fib(n) { if (n < 2) n else fib(n - 1) + fib(n - 2) }; fib(60);",
    "closure": "while| (true) { [3, 1, 2].sort(closure (a, b) { a < b }) };",
    "in a finally clause": "try { 1 } finally { while| (true) 1 };",
    "sorting": "var l = [] | for| (2000) l << 1 | while| (true) l.sort();",
    "printing": "class A { function asString() { while| (true) 1 } }; A.new;",
    "in a branch": "{ while| (true) 1 } & sleep(1s);",
    "under a tag": "var t = Tag.new|; t: while| (true) 1;",
    "catching everything": "while| (true) { try { throw 1 } catch { 2 } };",
    "starting jobs": "while (true) { 1 | { 2, 3 } };",
    "condition": "at ({ while| (true) 1; true }) 1;",
}


@pytest.mark.parametrize("kind", ENDLESS)
def test_a_program_that_never_yields_is_left(console: Console, kind: str) -> None:
    scheduler = console.kernel.scheduler
    jobs = len(scheduler.jobs)
    with console.signals():
        answer = console.say(ENDLESS[kind], until=0)
    assert answer[-1:] == [KILLED]
    assert console.say("\n;40 + 2;", until=1) == ["[] 42"]
    assert console.ask("6 * 7;") == "42"
    assert sys.gettrace() is None
    assert console.ended == 0
    assert len(scheduler.jobs) == jobs


@pytest.mark.parametrize("text", ["while| (true) 1,", "var e = Event.new|; at (e?) while| (true) 1; e!;"])
def test_a_job_in_the_background_that_never_yields_is_left(console: Console, text: str) -> None:
    with console.signals():
        console.say(text, until=0)
    assert console.say("40 + 2;") == ["[] 42"]


def test_a_neighbour_that_never_yields_is_left(console: Console) -> None:
    with console.signals():
        console.kernel.run_text(console.other, "while| (true) 1;", until=0)
    assert console.say("40 + 2;") == ["[] 42"]


def test_a_background_job_that_yields_is_not_hurt(console: Console) -> None:
    console.say("var n = 0|; every (1s) { for| (100000) 1 | n++ }, sleep(1h);", until=0.5)
    with console.signals():
        assert console.say("", until=50.5) == [KILLED]
    assert console.say("var before = n|;", until=50.6) == []
    assert console.say("n - before;", until=60.6) == ["[] 0"]
    assert console.say("n - before;", until=60.7) == ["[] 10"]
