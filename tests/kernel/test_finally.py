"""What ends a job cannot be swallowed or replaced by its ``finally`` clauses; they have a second when a client goes."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import FINALLY_TIMEOUT_S, Lobby


class Talk:
    """A kernel on the simulated clock."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.scheduler = self.kernel.scheduler
        self.lobby = self.open()

    def open(self) -> Lobby:
        """A further connection."""
        return self.kernel.open_lobby()

    def say(self, text: str, lobby: Lobby | None = None, seconds: float = 1.0) -> list[str]:
        """Let a client say something; what it has heard some seconds later, without time stamps."""
        lobby = lobby or self.lobby
        lobby.feed(text.encode() + b"\n")
        self.run(seconds)
        lines = lobby.output.take_bytes().decode().splitlines()
        return [line.partition("] ")[2] for line in lines]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.scheduler.run_simulated(self.scheduler.clock.now() + seconds)


@pytest.fixture
def talk() -> Talk:
    return Talk()


SURVIVORS = {
    "error instead, caught": "try { try { sleep(1h) } finally { x } } catch { sleep(1h) }",
    "error instead, caught by a waiting job": "try { Semaphore.acquire } catch (var z) { nil } finally { x }",
    "error instead, again and again": "loop { try { try { sleep(1h) } finally { x } } catch { sleep(1h) } }",
    "throw instead": "try { try { sleep(1h) } finally { throw 1 } } catch (var e) { sleep(1h) }",
    "continue": "loop { try { sleep(1h) } finally { continue } }",
    "continue in a scope": "loop { try { sleep(1h) } finally { { continue } } }",
    "break": "{ loop { try { sleep(1h) } finally { break } }; sleep(1h) }",
    "return": "{ function f() { try { sleep(1h) } finally { return 1 } }; f; sleep(1h) }",
    "return from another job": "{ function f() { try { sleep(1h) } finally { { return 1 } & nil } }; f; sleep(1h) }",
    "in a catch": "try { x } catch { try { sleep(1h) } finally { y } }; sleep(1h)",
    "nested": "try { try { try { sleep(1h) } finally { x } } finally { y } } catch { sleep(1h) }",
    "beside others": "{ { try { sleep(1h) } finally { x } } & sleep(1h) }",
    "stopped inside while it leaves": "try { sleep(1h) } finally { t: { t.stop; sleep(1h) } }; sleep(1h)",
}


@pytest.mark.parametrize("separator", [";", ","])
@pytest.mark.parametrize("program", SURVIVORS.values(), ids=SURVIVORS)
def test_no_job_outlives_its_connection(talk: Talk, program: str, separator: str) -> None:
    client = talk.open()
    talk.say('var Global.t = Tag.new("t");')
    talk.say(program + separator, client)
    assert talk.scheduler.shares.of(client)
    client.close()
    talk.run(0.0)
    assert not talk.scheduler.shares.of(client)
    assert talk.say("40 + 2;") == ["42"]


@pytest.mark.parametrize("program", SURVIVORS.values(), ids=SURVIVORS)
def test_no_job_outlives_the_stop_of_its_tag(talk: Talk, program: str) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.out = Tag.new("out");')
    before = len(talk.scheduler.jobs)
    talk.say(f"out: {{ {program} }},")
    assert len(talk.scheduler.jobs) > before
    talk.say("out.stop;")
    assert len(talk.scheduler.jobs) == before


@pytest.mark.parametrize("program", SURVIVORS.values(), ids=SURVIVORS)
def test_no_statement_outlives_its_timeout(talk: Talk, program: str) -> None:
    talk.say('var Global.t = Tag.new("t");')
    assert talk.say(f"timeout (0.5s) {{ {program} }}; 6 * 7;")[-1:] == ["42"]


@pytest.mark.parametrize("program", SURVIVORS.values(), ids=SURVIVORS)
def test_no_job_outlives_terminate(talk: Talk, program: str) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.jobs = [];')
    before = len(talk.scheduler.jobs)
    talk.say(f"{{ jobs << Job.current; {program} }},")
    talk.say("jobs[0].terminate;")
    assert len(talk.scheduler.jobs) == before


def test_an_error_in_a_clause_that_runs_because_of_a_signal_is_reported(talk: Talk) -> None:
    talk.say('var Global.t = Tag.new("t");')
    assert talk.say("t: try { try { sleep(1h) } finally { nowhere } } catch { echo(1) },") == []
    assert talk.say("t.stop;") == ["!!! 2.38-44: lookup failed: nowhere"]


def test_an_error_in_a_clause_replaces_an_error_as_before(talk: Talk) -> None:
    assert talk.say("try { try { throw 1 } finally { throw 2 } } catch (var e) { echo(e) };") == ["*** 2"]
    assert talk.say("loop { try { throw 1 } finally { break } }; 3;") == ["3"]
    assert talk.say("function f() { try { return 1 } finally { return 2 } } | f;") == ["2"]
    assert talk.say("function g() { try { { return 1 } & nil } finally { return 2 } } | g;") == ["2"]


def test_a_clause_may_be_stopped_itself(talk: Talk) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.u = Tag.new("u");')
    talk.say("t: try { sleep(1h) } finally { u: sleep(1h) | echo(1) },")
    assert talk.say("t.stop;") == []
    assert talk.say("u.stop;") == ["*** 1"]


def test_of_two_stops_the_one_that_leads_further_wins(talk: Talk) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.u = Tag.new("u");')
    talk.say("t: { u: try { sleep(1h) } finally { sleep(10s) } | echo(1) },")
    talk.say("t.stop;")
    assert talk.say("u.stop;", seconds=20) == []
    talk.say("t: { u: try { sleep(1h) } finally { sleep(10s) } | echo(1) } | echo(2),")
    talk.say("u.stop;")
    assert talk.say("t.stop;", seconds=20) == ["*** 2"]


def test_a_stop_that_comes_while_the_end_is_waited_for_does_not_replace_it(talk: Talk) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.u = Tag.new("u");')
    talk.say("t: { u: { { try { sleep(1h) } finally { sleep(2s) } } & sleep(1h) } | echo(1) },")
    talk.say("t.stop;", seconds=0.5)
    assert talk.say("u.stop;", seconds=20) == []


def test_a_stop_that_comes_while_a_tag_is_left_does_not_replace_it(talk: Talk) -> None:
    talk.say('var Global.t = Tag.new("t"); var Global.u = Tag.new("u"); var Global.v = Tag.new("v");')
    talk.say("at (v.leave?) u.stop;")
    talk.say("t: { u: { v: sleep(1h) } | echo(1) },")
    assert talk.say("t.stop;", seconds=20) == []


CLAUSES = {
    "waits": "try { sleep(1h) } finally { sleep(1h) }",
    "waits in a nested clause": "try { sleep(1h) } finally { try { sleep(1h) } finally { sleep(1h) } }",
    "calls itself": "{ function f() { try { sleep(1h) } finally { f } }; f }",
    "loops": "try { sleep(1h) } finally { loop { sleep(1s) } }",
    "detaches": "try { sleep(1h) } finally { detach({ sleep(1h) }) }",
    "waits for others": "try { sleep(1h) } finally { sleep(1h) & sleep(1h) }",
    "is frozen": "{ var f = Tag.new; f: try { sleep(1h) } finally { f.freeze; sleep(1h) } }",
}


@pytest.mark.parametrize("separator", [";", ","])
@pytest.mark.parametrize("program", CLAUSES.values(), ids=CLAUSES)
def test_a_clause_that_waits_ends_some_time_after_its_client(talk: Talk, program: str, separator: str) -> None:
    client = talk.open()
    talk.say(program + separator, client)
    client.close()
    talk.run(FINALLY_TIMEOUT_S + 0.1)
    assert not talk.scheduler.shares.of(client)


def test_a_clause_has_its_time_when_its_client_goes(talk: Talk) -> None:
    client = talk.open()
    talk.say("var Global.said = [];")
    talk.say("try { sleep(1h) } finally { sleep(500ms); said << 1; sleep(1h); said << 2 };", client)
    client.close()
    talk.run(10.0)
    assert talk.say("said;") == ["[1]"]


def test_who_does_not_wait_leaves_no_timer(talk: Talk) -> None:
    client = talk.open()
    talk.say("try { sleep(1h) } finally { 1 };", client)
    client.close()
    talk.run(0.0)
    assert talk.scheduler.timers.next_deadline() is None


def test_the_main_job_ends_with_its_client_whatever_ended_the_statement(talk: Talk) -> None:
    client = talk.open()
    talk.say("quit; sleep(1h);", client)
    talk.run(0.0)
    assert not talk.scheduler.shares.of(client)
