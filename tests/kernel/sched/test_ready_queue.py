"""Turns when a round of all ready jobs takes too long: one of each context, in order within each."""

from __future__ import annotations

from typing import Any

import pytest

from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.ready_queue import MAX_FAIR_ROUND
from urbihw.kernel.sched.scheduler import Scheduler

MANY = 5 * MAX_FAIR_ROUND


class World:
    """A scheduler that is interrupted whenever a job says so, and what its jobs said."""

    def __init__(self) -> None:
        self.scheduler = Scheduler(SimClock())
        self.said: list[tuple[str, int, int]] = []
        """The context, the number of the job in it, and which of its turns it was."""

    def talker(self, context: str, number: int, turns: int = 2, cuts: bool = False) -> Job:
        """A job that has some turns, and interrupts the round in each if ``cuts``."""

        def body() -> None:
            for turn in range(turns):
                self.said.append((context, number, turn))
                if cuts:
                    self.scheduler.interrupt()
                self.scheduler.yield_()

        return self.scheduler.spawn(body, f"{context}{number}", context)

    def turns_of(self, context: str) -> list[tuple[int, int]]:
        return [(number, turn) for name, number, turn in self.said if name == context]


@pytest.fixture
def world() -> World:
    return World()


def in_turns(jobs: int, turns: int) -> list[tuple[int, int]]:
    """What jobs of one context say, first in first out."""
    return [(number, turn) for turn in range(turns) for number in range(jobs)]


def test_who_comes_to_a_crowd_waits_for_one_job_of_it(world: World) -> None:
    for number in range(MANY):
        world.talker("crowd", number, cuts=number % 10 == 3)
    world.scheduler.run()
    before = len(world.said)
    world.talker("guest", 0, turns=3)
    world.scheduler.run()
    assert world.said.index(("guest", 0, 0)) <= before + 1
    while world.scheduler.jobs:
        world.scheduler.run()
    assert world.turns_of("crowd") == in_turns(MANY, 2)
    assert world.said.index(("guest", 0, 2)) < MANY


def test_a_round_that_is_not_interrupted_is_one_of_all(world: World) -> None:
    for number in range(MANY):
        world.talker("crowd", number)
    world.talker("guest", 0)
    world.scheduler.run()
    assert world.said.index(("guest", 0, 0)) == MANY


def test_contexts_that_have_waited_come_first(world: World) -> None:
    for context in "abc":
        for number in range(MANY):
            world.talker(context, number, turns=1, cuts=True)
    while world.scheduler.jobs:
        world.scheduler.run()
    order = "".join(name for name, _, _ in world.said)
    assert order == "abc" * MANY
    for context in "abc":
        assert world.turns_of(context) == in_turns(MANY, 1)


def test_new_jobs_keep_their_place_in_a_crowd(world: World) -> None:
    """``start_now``, ``run_first`` and ``prefer`` mean what they mean without a crowd."""

    def played(cuts: bool) -> list[Any]:
        scheduler, said = Scheduler(SimClock()), []

        def say(text: str) -> Any:
            return lambda: said.append(text)

        def maker(number: int) -> Any:
            def body() -> None:
                said.append(f"begin {number}")
                if cuts and number % 7 == 0:
                    scheduler.interrupt()
                scheduler.yield_()
                how = (scheduler.start_now, scheduler.run_first, scheduler.prefer, scheduler.prefer)[number % 4]
                how(scheduler.spawn(say(f"made by {number}"), context="crowd"))
                said.append(f"end {number}")
            return body

        for number in range(MANY):
            scheduler.spawn(maker(number), context="crowd")
        while scheduler.jobs:
            scheduler.run()
        return said

    assert played(True) == played(False)


def test_a_crowd_is_over_when_all_ready_jobs_are_one_round(world: World) -> None:
    for number in range(MANY):
        world.talker("crowd", number, turns=1, cuts=number == 0)
    for number in range(10):
        world.talker("rest", number, turns=4)
    while world.scheduler.jobs:
        world.scheduler.run()
    cycle = world.scheduler.cycle
    for number in range(MANY):
        world.talker("crowd", number, turns=1)
    world.scheduler.run()
    assert world.scheduler.cycle <= cycle + 2
    assert world.scheduler.run() is None


def test_jobs_of_a_crowd_can_be_ended(world: World) -> None:
    jobs = [world.talker("crowd", number, turns=9, cuts=True) for number in range(MANY)]
    world.scheduler.run()
    for job in jobs:
        world.scheduler.kill(job)
    while world.scheduler.jobs:
        world.scheduler.run()
    assert len(world.said) == 1


@pytest.mark.parametrize("how", ["start_now", "run_first"])
def test_jobs_that_fork_at_once_leave_the_others_their_turn_in_each_round(world: World, how: str) -> None:
    scheduler = world.scheduler
    for number in range(MANY):
        world.talker("crowd", number, turns=1, cuts=number == 0)
    scheduler.run()

    def fork(depth: int) -> None:
        world.said.append(("forks", depth, 0))
        if depth < MANY:
            getattr(scheduler, how)(scheduler.spawn(lambda: fork(depth + 1), context="forks"))

    scheduler.spawn(lambda: fork(0), context="forks")
    world.talker("guest", 0, turns=3)
    while not world.turns_of("forks"):
        scheduler.interrupt()
        scheduler.run()
    before = scheduler.cycle
    while len(world.turns_of("guest")) < 3:
        scheduler.interrupt()
        scheduler.run()
    assert scheduler.cycle <= before + 3 * 3  # each round is cut after one job, and three contexts take turns
    assert len(world.turns_of("forks")) < MANY
    while scheduler.jobs:
        scheduler.run()
    assert [depth for depth, _ in world.turns_of("forks")] == list(range(MANY + 1))
