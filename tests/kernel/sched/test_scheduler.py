"""The scheduler alone, with plain Python jobs: order, time, stopping, freezing, groups."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.group import Group
from urbihw.kernel.sched.hooks import SchedulerHooks
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.signals import JobKilled, StopTag
from urbihw.kernel.sched.tag import Tag, TagEntry
from urbihw.kernel.sched.waiting import WaitQueue


class World(SchedulerHooks):
    """A scheduler and a log of what its jobs said."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self.said: list[Any] = []
        self.scheduler = Scheduler(self.clock, hooks=self)

    def job_failed(self, job: Job, error: Exception) -> None:
        """A job has failed."""
        self.said.append(f"{job.name} failed: {error!r}")

    def talker(self, name: str, count: int) -> Job:
        """A job that says name1, name2 ... and yields after each."""

        def body() -> None:
            for i in range(1, count + 1):
                self.said.append(f"{name}{i}")
                self.scheduler.yield_()

        return self.scheduler.spawn(body, name)

    def run(self) -> list[Any]:
        """Run until nothing is left to do; what was said."""
        self.scheduler.run_simulated()
        return self.said


class EndedReport(World):
    """The job is ended while its failure is reported, as by a watchdog."""

    def job_failed(self, job: Job, error: Exception) -> None:
        super().job_failed(job, error)
        raise JobKilled


@pytest.fixture
def world() -> World:
    return World()


def test_who_is_ended_while_its_failure_is_reported_does_not_end_the_scheduler() -> None:
    world = EndedReport()

    def fails() -> None:
        raise ValueError("x")

    job = world.scheduler.spawn(fails, "f")
    job.when_ended(lambda job: world.said.append(f"{job.name} ended"))
    world.talker("a", 1)
    assert world.run() == ["f failed: ValueError('x')", "f ended", "a1"]


def test_jobs_take_turns_first_in_first_out(world: World) -> None:
    world.talker("a", 3)
    world.talker("b", 2)
    assert world.run() == ["a1", "b1", "a2", "b2", "a3"]


def test_a_comma_statement_starts_at_once_and_its_maker_queues_behind_it(world: World) -> None:
    scheduler = world.scheduler

    def main() -> None:
        for name in "abc":
            scheduler.start_now(world.talker(name, 3))

    scheduler.spawn(main, "main")
    assert world.run() == ["a1", "b1", "a2", "c1", "b2", "a3", "c2", "b3", "c3"]


def test_sleepers_wake_in_order_of_their_deadlines_at_exact_times(world: World) -> None:
    def sleeper(seconds: float) -> None:
        world.scheduler.sleep(seconds)
        world.said.append((seconds, world.clock.now()))

    for seconds in (0.3, 0.1, 0.2):
        world.scheduler.spawn(lambda s=seconds: sleeper(s))  # type: ignore[misc]
    assert world.run() == [(0.1, 0.1), (0.2, 0.2), (0.3, 0.3)]


def test_run_returns_the_next_deadline(world: World) -> None:
    world.scheduler.spawn(lambda: world.scheduler.sleep(1.5))
    assert world.scheduler.run() == 1.5


def test_interrupt_makes_run_return_although_jobs_are_ready(world: World) -> None:
    def body() -> None:
        for i in range(1000):
            if i == 3:
                world.scheduler.interrupt()
            world.said.append(i)
            world.scheduler.yield_()

    world.scheduler.spawn(body)
    assert world.scheduler.run() == 0.0
    assert len(world.said) < 10


def test_posted_actions_run_between_rounds_outside_any_job(world: World) -> None:
    world.scheduler.post(lambda: world.said.append(world.scheduler.current))
    assert world.run() == [None]


def test_killing_a_sleeper_runs_its_finally_and_leaves_no_timer(world: World) -> None:
    def body() -> None:
        try:
            world.scheduler.sleep(100)
        finally:
            world.said.append("finally")

    job = world.scheduler.spawn(body)
    world.scheduler.run()
    world.scheduler.kill(job)
    assert world.scheduler.run() is None
    assert world.said == ["finally"]
    assert job.status() == "terminated"


def test_a_killed_job_that_never_started_does_not_run(world: World) -> None:
    job = world.talker("a", 3)
    world.scheduler.kill(job)
    assert world.run() == []
    assert job.done


def test_a_group_waits_for_its_children(world: World) -> None:
    scheduler = world.scheduler

    def child() -> None:
        scheduler.sleep(1)
        world.said.append("child")

    def main() -> None:
        with Group(scheduler) as group:
            group.start(child)
            world.said.append("main goes on")
        world.said.append(f"joined at {world.clock.now():g}")

    scheduler.spawn(main)
    assert world.run() == ["main goes on", "child", "joined at 1"]


def test_a_failing_child_stops_its_siblings_and_its_owner(world: World) -> None:
    scheduler = world.scheduler

    def failing() -> None:
        scheduler.sleep(1)
        raise ValueError("child")

    def sibling() -> None:
        try:
            scheduler.sleep(100)
        finally:
            world.said.append(f"sibling stopped at {world.clock.now():g}")

    def main() -> None:
        try:
            with Group(scheduler) as group:
                group.launch(failing)
                group.launch(sibling)
        except ValueError as error:
            world.said.append(f"owner got {error}")

    scheduler.spawn(main)
    assert world.run() == ["sibling stopped at 1", "owner got child"]


def test_stopping_a_tag_leaves_the_outermost_entry_with_a_value(world: World) -> None:
    scheduler = world.scheduler
    tag = Tag(scheduler, "t")

    def main() -> None:
        outer = tag.enter()
        try:
            inner = tag.enter()
            try:
                scheduler.sleep(10)
            except StopTag as signal:
                world.said.append(("inner mine", signal.entry is inner))
                raise
            finally:
                tag.leave(inner)
        except StopTag as signal:
            world.said.append(("outer mine", signal.entry is outer, signal.value))
        finally:
            tag.leave(outer)

    scheduler.spawn(main)
    scheduler.run()
    scheduler.spawn(lambda: tag.stop("value"))
    assert world.run() == [("inner mine", False), ("outer mine", True, "value")]


def test_freezing_stops_the_clock_of_a_sleeper(world: World) -> None:
    scheduler = world.scheduler
    tag = Tag(scheduler, "t")

    def main() -> None:
        entry = tag.enter()
        scheduler.sleep(1)
        world.said.append(world.clock.now())
        tag.leave(entry)

    def control() -> None:
        scheduler.sleep(0.4)
        tag.freeze()
        world.said.append(job.status())
        scheduler.sleep(2)
        tag.unfreeze()

    job = scheduler.spawn(main)
    scheduler.spawn(control)
    assert world.run() == ["sleeping (frozen)", 3.0]
    assert job.shift == pytest.approx(2.0)


def test_a_job_frozen_by_two_tags_needs_both_unfrozen(world: World) -> None:
    scheduler = world.scheduler
    outer = Tag(scheduler, "outer")
    inner = Tag(scheduler, "inner", outer)

    def main() -> None:
        entry = inner.enter()
        scheduler.yield_()
        world.said.append(world.clock.now())
        inner.leave(entry)

    def control() -> None:
        outer.freeze()
        inner.freeze()
        scheduler.sleep(1)
        outer.unfreeze()
        scheduler.sleep(1)
        inner.unfreeze()

    scheduler.spawn(main)
    scheduler.spawn(control)
    assert world.run() == [2.0]


def test_a_blocked_tag_lets_nobody_in(world: World) -> None:
    tag = Tag(world.scheduler, "t")

    def main() -> None:
        tag.block("skipped")
        try:
            tag.enter()
        except StopTag as signal:
            world.said.append(signal.value)
        tag.unblock()
        tag.leave(tag.enter())
        world.said.append("entered")

    world.scheduler.spawn(main)
    assert world.run() == ["skipped", "entered"]


def test_a_waiter_that_is_stopped_leaves_the_queue(world: World) -> None:
    scheduler = world.scheduler
    queue = WaitQueue(scheduler)
    first = scheduler.spawn(queue.wait, "first")

    def second() -> None:
        queue.wait()
        world.said.append("second woken")

    scheduler.spawn(second, "second")
    scheduler.run()
    scheduler.kill(first)
    scheduler.run()
    assert len(queue) == 1
    assert queue.wake_one()
    assert world.run() == ["second woken"]


def test_ten_thousand_jobs_come_and_go(world: World) -> None:
    for _ in range(10_000):
        world.scheduler.spawn(lambda: world.scheduler.sleep(1))
    world.scheduler.run_simulated()
    assert not world.scheduler.jobs
    assert len(world.scheduler.timers) == 0


def test_jobs_that_begin_in_one_round_need_no_carrier_each(world: World) -> None:
    carriers: list[Any] = []

    def body() -> None:
        carriers.append(world.scheduler.running().carrier)

    for _ in range(3):
        world.scheduler.spawn(body)
    frozen = world.scheduler.spawn(lambda: world.said.append("frozen"), entries=[frozen_entry(world)])
    killed = world.scheduler.spawn(lambda: world.said.append("killed"))
    world.scheduler.kill(killed)
    world.scheduler.spawn(body)
    assert world.run() == []
    assert len(carriers) == 4 and len(set(carriers)) == 1
    assert killed.done and not frozen.done
    frozen.entries[0].tag.unfreeze()
    assert world.run() == ["frozen"]


def frozen_entry(world: World) -> TagEntry:
    """What a job stands in that is under a frozen tag."""
    entries: list[TagEntry] = []
    tag = Tag(world.scheduler, "cold")

    def body() -> None:
        entries.append(tag.enter())

    world.scheduler.spawn(body)
    world.run()
    tag.freeze()
    return entries[0]


def test_a_job_that_stops_its_own_tag_stops_the_others_first(world: World) -> None:
    """``t: { sleep(0.5s); t.stop }, t: loop { ... },``: the running job is thrown out last."""
    scheduler = world.scheduler
    tag = Tag(scheduler, "t")

    def stopper() -> None:
        tag.enter()
        scheduler.sleep(0.5)
        tag.stop(None)

    def other() -> None:
        tag.enter()
        while True:
            scheduler.sleep(0.3)
            world.said.append(world.clock.now())

    scheduler.spawn(stopper)
    scheduler.spawn(other)
    scheduler.run_simulated(2.0)
    assert world.said == [0.3]
    assert not scheduler.jobs


def family(world: World) -> tuple[Tag, Tag]:
    """A tag and its grandchild."""
    oldest = Tag(world.scheduler, "oldest")
    middle = Tag(world.scheduler, "middle", oldest)
    youngest = Tag(world.scheduler, "youngest", middle)
    assert oldest.descendants() == [oldest, middle, youngest]
    return oldest, youngest


def under(world: World, tag: Tag, body: Callable[[], None]) -> Job:
    """A job that runs a body under a tag, and says why it left."""

    def run() -> None:
        try:
            tag.enter()
            body()
        except StopTag as signal:
            world.said.append(signal.value)

    return world.scheduler.spawn(run)


def test_what_holds_for_a_tag_holds_for_its_grandchildren(world: World) -> None:
    oldest, youngest = family(world)
    scheduler = world.scheduler
    under(world, youngest, lambda: scheduler.sleep(9))
    scheduler.run_simulated(1.0)
    oldest.stop("stopped")
    scheduler.run_simulated(2.0)
    assert world.said == ["stopped"]
    oldest.block("blocked")
    under(world, youngest, lambda: world.said.append("never"))
    scheduler.run_simulated(3.0)
    assert world.said == ["stopped", "blocked"]
    oldest.unblock()
    oldest.freeze()
    under(world, youngest, lambda: world.said.append(world.clock.now()))
    scheduler.run_simulated(4.0)
    assert len(world.said) == 2
    oldest.unfreeze()
    scheduler.run_simulated(5.0)
    assert world.said[2:] == [4.0]


def test_a_frozen_job_whose_wait_is_over_goes_on_when_it_is_unfrozen(world: World) -> None:
    scheduler = world.scheduler
    tag, queue = Tag(scheduler, "t"), WaitQueue(scheduler)

    def body() -> None:
        queue.wait()
        world.said.append(world.clock.now())
        scheduler.sleep(1)
        world.said.append(world.clock.now())

    job = under(world, tag, body)
    scheduler.run_simulated(1.0)
    tag.freeze()
    queue.wake_one()
    scheduler.run_simulated(2.0)
    assert job.held and world.said == []
    scheduler.wake(job)
    tag.unfreeze()
    assert list(scheduler.ready).count(job) == 1
    scheduler.run_simulated(9.0)
    assert world.said == [2.0, 3.0]


def test_timers_of_the_same_time_keep_their_order(world: World) -> None:
    for number in range(5):
        world.scheduler.call_at(1.0, lambda number=number: world.said.append(number))  # type: ignore[misc]
    assert world.run() == [0, 1, 2, 3, 4]


def test_what_a_stopped_job_held_is_freed_without_the_collector(world: World) -> None:
    """Else the garbage of a crowd is freed in one go, while all others wait."""

    class Held:
        """Something that a job refers to."""

    found: list[weakref.ref[Held]] = []

    def body() -> None:
        held = Held()
        found.append(weakref.ref(held))
        world.scheduler.sleep(1)

    job = world.scheduler.spawn(body)
    world.scheduler.run()
    gc.disable()
    try:
        world.scheduler.kill(job)
        world.scheduler.run()
        assert found[0]() is None
    finally:
        gc.enable()
