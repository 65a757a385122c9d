"""Regular expressions that take long: others are answered meanwhile, and there is a limit to it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.stdlib import worker_thread
from urbihw.kernel.stdlib.matcher import Matcher
from urbihw.kernel.stdlib.regexp import MATCH_TIMEOUT_S, MAX_EXPRESSION_LENGTH, MAX_QUICK_LENGTH

pytestmark = pytest.mark.e2e

TIMEOUT_S = 20.0
ENDLESS = '"(a+)+$"'
TEXT = '"a" * 60 + "b"'
TOOK = "regular expression `(a+)+$' took more than 1 s"


class Talk:
    """Connections of a kernel in real time."""

    def __init__(self) -> None:
        self.kernel = Kernel()
        self.lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")
        self.kernel.run()

    def ask(self, text: str, lobby: Lobby | None = None) -> str:
        """The first line that comes back, without its time."""
        lobby = self.lobby if lobby is None else lobby
        lobby.feed(text.encode())
        return self.heard(lobby)

    def heard(self, lobby: Lobby) -> str:
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            self.kernel.run()
            line = lobby.output.take_bytes().decode()
            if line:
                return line.rstrip("\n").partition("] ")[2]
            time.sleep(0.001)
        raise AssertionError("no answer")


@pytest.fixture
def talk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Talk]:
    monkeypatch.setattr(worker_thread, "IDLE_TIMEOUT_S", 0.2)
    made = Talk()
    yield made
    made.kernel.close()
    end = time.monotonic() + TIMEOUT_S
    while any(thread.name == "urbihw-worker" for thread in threading.enumerate()):
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_match_without_end_is_an_error_that_names_it(talk: Talk) -> None:
    began = time.monotonic()
    assert talk.ask(f"Regexp.new({ENDLESS}).match({TEXT});") == f"!!! 1.1-42: match: {TOOK}"
    assert time.monotonic() - began < MATCH_TIMEOUT_S + 5
    assert talk.ask("40 + 2;") == "42"


def test_others_are_answered_meanwhile(talk: Talk) -> None:
    talk.lobby.feed(f"Regexp.new({ENDLESS}).match({TEXT});".encode())
    for _ in range(3):
        assert talk.ask("6 * 7;", talk.other) == "42"
    assert talk.lobby.output.take_bytes() == b""
    assert TOOK in talk.heard(talk.lobby)


def test_the_error_can_be_caught_and_what_was_found_before_stays(talk: Talk) -> None:
    talk.lobby.feed(f"var r = Regexp.new({ENDLESS})|; r.match(\"baa\")|;".encode())
    assert talk.ask(f"try {{ r.match({TEXT}) }} catch (var e) {{ [e.message, r.matches] }};") == (
        f'["{TOOK}", ["aa", "aa"]]'
    )


def test_a_long_text_gives_what_a_short_one_does(talk: Talk) -> None:
    talk.lobby.feed(b'var r = Regexp.new("(b)(x)?(c)")|; function after (n) { "a" * n + "bc" }|;')
    for size in (1, MAX_QUICK_LENGTH - 2, MAX_QUICK_LENGTH - 1, 10 * MAX_QUICK_LENGTH):
        assert talk.ask(f"[r.match(after({size})), r.matches, r.hasNot(after({size}))];") == (
            '[true, ["bc", "b", "", "c"], false]'
        )
        assert talk.ask(f'r.match("a" * {size});') == "false"


def test_what_matches_within_a_condition_is_no_hindrance(talk: Talk) -> None:
    """A condition that waits for a match does not take for its own what others read meanwhile."""
    talk.lobby.feed(b'var Global.n = 0|; var r = Regexp.new("b")|; var Global.text = "a" * 50000|;')
    talk.lobby.feed(b'at ({ echo("look") | r.match(Global.text) }) echo("found");')
    assert talk.heard(talk.lobby) == "*** look"
    assert talk.ask("Global.n;", talk.other) == "0"
    assert talk.ask("Global.n = 1; Global.n = 2|;", talk.other) == "1"
    assert talk.ask('Global.text = "a" * 50000 + "b"|;') == "*** look"
    assert talk.heard(talk.lobby) == "*** found"


def test_one_who_fills_the_queue_keeps_nobody_else_waiting(talk: Talk) -> None:
    talk.lobby.feed(f"for& (20) Regexp.new({ENDLESS}).match({TEXT}),".encode())
    talk.kernel.run()
    began = time.monotonic()
    assert talk.ask('Regexp.new("b").match("a" * 10000 + "b");', talk.other) == "true"
    assert time.monotonic() - began < 2 * MATCH_TIMEOUT_S + 5


def test_a_job_that_is_stopped_waits_no_more(talk: Talk) -> None:
    talk.lobby.feed(f"var t = Tag.new|; t: Regexp.new({ENDLESS}).match({TEXT}),".encode())
    talk.kernel.run()
    assert talk.ask("t.stop; 40 + 2;") == "42"
    assert talk.kernel.scheduler.shares.of(talk.lobby) == 1
    assert talk.ask('Regexp.new("b").match("a" * 10000 + "b");') == "true"


def test_in_simulated_time_it_is_the_same() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby("127.0.0.1")
    assert TOOK in kernel.run_text(lobby, f"Regexp.new({ENDLESS}).match({TEXT});")
    kernel.close()


def test_expressions_that_are_long_themselves_are_refused(talk: Talk) -> None:
    assert talk.ask(f'Regexp.new("a" * {MAX_EXPRESSION_LENGTH + 1});').endswith("...': too complex")
    assert talk.ask(f'Regexp.new("a" * {MAX_EXPRESSION_LENGTH}).match("a");') == "false"


@pytest.fixture
def matcher() -> Iterator[Matcher]:
    made = Matcher()
    yield made
    made.close()


def test_the_process_answers_and_begins_anew_after_a_time_out(matcher: Matcher) -> None:
    assert matcher.search("(a)(b)?", "xa", 5.0) == ["a", "a", ""]
    assert matcher.search("b", "xa", 5.0) is None
    with pytest.raises(TimeoutError):
        matcher.search("(a+)+$", "a" * 60 + "b", 0.1)
    assert matcher.search("b", "ab\xff", 5.0) == ["b"]


def test_a_match_may_not_take_all_memory(matcher: Matcher) -> None:
    with pytest.raises(ValueError, match="takes too much memory"):
        matcher.search("((a)|(b))*c", "ab" * 5_000_000, 20.0)
    assert matcher.search("b", "ab", 5.0) == ["b"]


def test_nothing_else_is_left_by_the_alarm(talk: Talk) -> None:
    assert talk.ask('Regexp.new("b").match("ab");') == "true"
    signal.raise_signal(signal.SIGPROF)
    assert talk.ask("40 + 2;") == "42"
