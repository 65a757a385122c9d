"""Many jobs, many events, and loops without end beside others: all in simulated time."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby


class Talk:
    """A connection and its neighbour."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")
        self.kernel.run()

    def say(self, text: str, seconds: float = 1.0, lobby: Lobby | None = None) -> list[str]:
        """Send something and let some time pass; what comes back, without time stamps."""
        until = self.kernel.clock.now() + seconds
        return [line[:1] + line[9:] for line in self.kernel.run_text(lobby or self.lobby, text, until).splitlines()]

    def beside_loops(self, text: str, seconds: float, lobby: Lobby | None = None) -> list[str]:
        """The same while loops without end are ready all the time: a simulated clock creeps on under them."""
        scheduler, listener = self.kernel.scheduler, lobby or self.lobby
        until = self.kernel.clock.now() + seconds
        alarm = scheduler.call_at(until, scheduler.interrupt)
        listener.feed(text.encode())
        while self.kernel.run() is not None and self.kernel.clock.now() < until:
            continue
        alarm.cancel()
        return [line[:1] + line[9:] for line in listener.output.take_bytes().decode().splitlines()]

    def at_rest(self) -> None:
        """Only the main jobs of the two connections are there, and both answer."""
        assert self.say("40 + 2;") == ["[] 42"]
        assert self.say("6 * 7;", lobby=self.other) == ["[] 42"]
        assert len(self.kernel.scheduler.jobs) == 2
        assert len(self.kernel.scheduler.timers) == 0


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_ten_thousand_jobs_sleep_and_are_stopped_at_once(talk: Talk) -> None:
    talk.say("var n = 0|; var t = Tag.new|; for& (10000) t: { try { n += 1 | sleep(1h) } finally { n -= 1 } },", 10)
    assert talk.say("n;") == ["[] 10000"]
    assert len(talk.kernel.scheduler.jobs) >= 10_000
    assert talk.say("6 * 7;", lobby=talk.other) == ["[] 42"]
    assert talk.say("t.stop; n;") == ["[] 0"]
    talk.at_rest()


def test_ten_thousand_jobs_wait_for_one_event(talk: Talk) -> None:
    talk.say("var n = 0|; var e = Event.new|; for (10000) detach({ waituntil (e?) | n += 1 })|;", 10)
    assert talk.say("n;") == ["[] 0"]
    assert talk.say("e!; sleep(1s); n;", 2) == ["[] 10000"]
    talk.at_rest()


def test_a_hundred_thousand_events_are_all_handled(talk: Talk) -> None:
    """Emitted without a pause by one job, each makes a handler that has to wait for its turn."""
    talk.say("var n = 0|; var e = Event.new|; var t = Tag.new|; t: at (e?(var x)) { n += x },")
    assert talk.say("for| (100000) e!(1); sleep(1s); n;", 60) == ["[] 100000"]
    talk.say("t.stop;")
    talk.at_rest()


def test_events_beyond_the_most_jobs_are_refused_to_who_emits(talk: Talk) -> None:
    talk.kernel.scheduler.shares.max_total = 5000
    talk.say("var n = 0|; var e = Event.new|; var t = Tag.new|; t: at (e?) { n += 1 },")
    assert talk.say("for| (10000) e!;", 60)[0].endswith(": too many jobs")
    assert talk.say("n < 5000;") == ["[] true"]
    talk.say("t.stop;")
    talk.at_rest()


@pytest.mark.parametrize("watched", ["e?", "x > 0"])
def test_a_tag_is_stopped_from_the_body_of_its_own_at(talk: Talk, watched: str) -> None:
    talk.say("var n = 0|; var x = 0|; var e = Event.new|; var t = Tag.new|;")
    talk.say(f"t: at ({watched}) {{ n += 1 | t.stop | n += 10 }},")
    assert talk.say("e!; x = 1|; sleep(1s); e!; x = 0|; x = 1|; sleep(1s); n;", 5) == ["[] 1"]
    talk.at_rest()


def test_a_tag_is_stopped_from_its_own_every(talk: Talk) -> None:
    talk.say("var n = 0|; var t = Tag.new|; t: every (10ms) { n += 1 | if (n == 3) t.stop },", 5)
    assert talk.say("n;") == ["[] 3"]
    talk.at_rest()


LOOPS = "var Global.t = Tag.new|; t: while (true) 1, t: loop { 2 },"


def test_endless_loops_share_with_those_that_sleep(talk: Talk) -> None:
    assert talk.beside_loops(LOOPS + "var n = 0|; t: every (10ms) n += 1,", 0.15) == []
    assert talk.beside_loops("n >= 10;", 0.01) == ["[] true"]
    assert talk.beside_loops("6 * 7;", 0.01, talk.other) == ["[] 42"]
    assert talk.beside_loops("t.stop;", 0.01) == []
    talk.at_rest()


def test_endless_loops_are_stopped_from_another_connection(talk: Talk) -> None:
    talk.beside_loops(LOOPS, 0.01)
    assert talk.beside_loops("t.stop; 1;", 0.01, talk.other) == ["[] 1"]
    talk.at_rest()


def test_a_loop_that_hardly_yields_is_stopped_from_another_connection(talk: Talk) -> None:
    """It yields only where it says so."""
    talk.beside_loops("var Global.t = Tag.new|; t: while| (true) { for| (1000) {} | sleep(0) }, t: loop { 2 },", 0.001)
    assert talk.beside_loops("t.stop; 1;", 0.001, talk.other) == ["[] 1"]
    talk.at_rest()


def test_a_connection_that_closes_takes_its_endless_loops_along(talk: Talk) -> None:
    leaver = talk.kernel.open_lobby("127.0.0.1")
    talk.beside_loops(LOOPS, 0.01, leaver)
    leaver.close()
    talk.beside_loops("", 0.01)
    talk.at_rest()
