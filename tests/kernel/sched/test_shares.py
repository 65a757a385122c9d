"""How many jobs one connection may have: more are refused to it alone."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.hooks import SchedulerHooks
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.shares import RESERVED_JOBS

REFUSED = "too many jobs: 300 of this connection"


class Talk:
    """Two connections of a kernel in which one may have 300 jobs."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.kernel.scheduler.shares.max_of_one = 300
        self.lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")
        self.kernel.run()

    def say(self, text: str, seconds: float = 1.0, lobby: Lobby | None = None) -> list[str]:
        """Send something and let some time pass; what comes back, without time stamps."""
        return self.heard(text, lobby or self.lobby, self.kernel.clock.now() + seconds)

    def heard(self, text: str, lobby: Lobby, until: float) -> list[str]:
        lines = self.kernel.run_text(lobby, text, until).splitlines()
        return [line[:1] + line[9:] for line in lines]

    def jobs(self, lobby: Lobby) -> int:
        """How many jobs a connection has besides its main one."""
        return self.kernel.scheduler.shares.of(lobby) - 1


@pytest.fixture
def talk() -> Talk:
    return Talk()


FORKING = {
    "branches": "function f() { f() & f() }; f();",
    "branches of a loop": "for& (1000) sleep(1h);",
    "in the background": "function f() { f(), sleep(1h) }; f();",
    "detached": "for (1000) detach(sleep(1h))|;",
    "spawned": "for (1000) spawn(closure () { sleep(1h) }, true)|;",
    "members": "var l = []|; for| (1000) l << 1; l.'each&'(closure (x) { sleep(1h) });",
    "handlers": "var e = Event.new|; at (e?) sleep(1h); for| (1000) e!;",
    "conditions": "var n = 0|; for (1000) detach({ waituntil (n > 5) })|;",
}


@pytest.mark.parametrize("kind", FORKING)
def test_a_connection_that_forks_without_end_is_refused_and_its_neighbour_is_not(talk: Talk, kind: str) -> None:
    answer = talk.say(FORKING[kind])
    assert [line for line in answer if REFUSED in line], answer
    assert talk.jobs(talk.lobby) <= 300
    assert talk.say("{ 1 & 2 & 3 }; for& (200) sleep(1ms); 40 + 2;", lobby=talk.other)[-1] == "[] 42"
    assert talk.say("40 + 2;")[-1] == "[] 42"


def test_statements_in_the_background_are_refused_one_by_one(talk: Talk) -> None:
    answer = talk.say("sleep(1h)," * 310)
    assert answer == [f"[:error] !!! {REFUSED}"] * 11
    assert talk.jobs(talk.lobby) == 299
    assert talk.say("40 + 2;") == ["[] 42"]


def test_handlers_of_one_are_not_refused_to_another_that_emits(talk: Talk) -> None:
    talk.say("var Global.e = Event.new|; for (1000) { at (Global.e?) sleep(1h) };")
    assert talk.say("Global.e!; 40 + 2;", lobby=talk.other) == ["[] 42"]
    assert talk.jobs(talk.lobby) == 299
    assert {line.endswith(f": {REFUSED}") for line in talk.say("")} == {True}


def test_the_error_can_be_caught(talk: Talk) -> None:
    assert talk.say("try { for& (1000) sleep(1h) } catch (var e if e.isA(Exception.Scheduling)) { e.message };") == [
        f'[] "{REFUSED}"'
    ]
    assert talk.jobs(talk.lobby) == 0


def scheduler_with(most: int, of_one: int, hooks: SchedulerHooks | None = None) -> Scheduler:
    made = Scheduler(SimClock(), hooks=hooks)
    made.shares.max_total, made.shares.max_of_one = most, of_one
    return made


def waiting(scheduler: Scheduler, context: object, number: int) -> list[Job]:
    """Jobs that wait for ever; made under a tag's entries they would be refused."""
    return [scheduler.spawn(lambda: scheduler.suspend(None), context=context) for _ in range(number)]


def test_jobs_are_counted_until_they_are_over() -> None:
    scheduler = scheduler_with(1000, 10)
    first = waiting(scheduler, "a", 10)
    scheduler.run()
    assert (scheduler.shares.of("a"), scheduler.shares.of("b")) == (10, 0)
    for job in first:
        scheduler.kill(job)
    scheduler.run()
    assert scheduler.shares.of("a") == 0


def test_a_job_that_is_refused_fails_when_it_begins_if_nobody_can_be_told() -> None:
    class FailureLog(SchedulerHooks):
        def job_failed(self, job: Job, error: Exception) -> None:
            failed.append((job.context, str(error)))

    failed: list[tuple[object, str]] = []
    scheduler = scheduler_with(1000, 10, FailureLog())
    waiting(scheduler, "a", 11)
    scheduler.run()
    assert failed == [("a", "too many jobs: 10 of this connection")]
    assert scheduler.shares.of("a") == 10


def test_a_job_with_a_parent_is_refused_to_the_parent() -> None:
    scheduler = scheduler_with(1000, 10)
    (parent,) = waiting(scheduler, "a", 1)
    waiting(scheduler, "a", 9)
    with pytest.raises(TooManyJobs):
        scheduler.spawn(lambda: None, parent=parent)


def test_with_too_many_in_all_whoever_has_few_may_still_make_some() -> None:
    scheduler = scheduler_with(500, 400)
    waiting(scheduler, "greedy", 400)
    waiting(scheduler, "second", 100)
    modest = waiting(scheduler, "modest", RESERVED_JOBS)
    scheduler.run()
    assert scheduler.shares.of("modest") == RESERVED_JOBS
    with pytest.raises(TooManyJobs, match=r"^too many jobs$"):
        scheduler.spawn(lambda: None, parent=modest[0])


def test_jobs_of_the_kernel_are_never_refused() -> None:
    scheduler = scheduler_with(10, 10)
    waiting(scheduler, None, 50)
    scheduler.run()
    assert scheduler.shares.of(None) == 50
