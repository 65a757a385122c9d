"""How jobs wait: completions, queues, hand-overs, and that nothing else parks a job."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

import urbihw
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.waiting import Completion, HandoverQueue, WaitQueue, wait_for_ever


class Lab:
    """A scheduler, and what its jobs got."""

    def __init__(self) -> None:
        self.scheduler = Scheduler(SimClock())
        self.got: list[Any] = []

    def waiter(self, wait: Any, *args: Any) -> Job:
        """A job that says what it waited for, or by which error it ended."""

        def body() -> None:
            try:
                self.got.append(wait(*args))
            except Exception as error:
                self.got.append(error)

        made = self.scheduler.spawn(body)
        self.scheduler.run()
        return made

    def run(self) -> list[Any]:
        """What jobs got until now."""
        self.scheduler.run()
        return self.got


@pytest.fixture
def lab() -> Lab:
    return Lab()


def test_a_completion_gives_its_value_to_the_job_that_waits(lab: Lab) -> None:
    answer: Completion[int] = Completion(lab.scheduler)
    lab.waiter(answer.wait)
    assert lab.run() == []
    answer.complete(3)
    answer.complete(4)
    assert lab.run() == [3]


def test_what_is_complete_already_does_not_park(lab: Lab) -> None:
    answer: Completion[int] = Completion(lab.scheduler)
    answer.complete(3)
    lab.waiter(answer.wait)
    assert lab.got == [3]


def test_the_error_of_a_completion_is_raised_in_the_job_that_waits(lab: Lab) -> None:
    answer: Completion[int] = Completion(lab.scheduler)
    lab.waiter(answer.wait)
    error = ValueError("no")
    answer.fail(error)
    assert lab.run() == [error]


def test_the_outcome_of_work_is_its_value_or_its_error(lab: Lab) -> None:
    first: Completion[int] = Completion(lab.scheduler)
    second: Completion[float] = Completion(lab.scheduler)
    lab.waiter(first.wait)
    lab.waiter(second.wait)
    first.outcome_of(lambda: 3)()
    second.outcome_of(lambda: 1 / 0)()
    assert lab.run()[0] == 3
    assert isinstance(lab.got[1], ZeroDivisionError)


def test_completing_what_nobody_waits_for_any_more_wakes_nobody(lab: Lab) -> None:
    answer: Completion[int] = Completion(lab.scheduler)
    job = lab.waiter(lambda: (answer.wait(), None))
    lab.scheduler.kill(job)
    lab.run()
    answer.complete(3)
    assert lab.run() == []


def test_values_go_to_the_jobs_in_the_order_in_which_they_came(lab: Lab) -> None:
    queue: HandoverQueue[str] = HandoverQueue(lab.scheduler)
    jobs = [lab.waiter(queue.wait) for _ in range(2)]
    assert [queue.hand_over("a"), queue.hand_over("b"), queue.hand_over("c")] == [*jobs, None]
    assert lab.run() == ["a", "b"]


def test_a_job_that_is_stopped_in_line_is_passed_over(lab: Lab) -> None:
    queue: HandoverQueue[str] = HandoverQueue(lab.scheduler)
    first, second = (lab.waiter(queue.wait) for _ in range(2))
    lab.scheduler.kill(first)
    lab.run()
    assert queue.hand_over("a") is second
    assert lab.run() == ["a"]


def test_a_value_handed_to_a_job_that_is_stopped_is_given_back(lab: Lab) -> None:
    queue: HandoverQueue[str] = HandoverQueue(lab.scheduler)
    back: list[str] = []
    job = lab.waiter(queue.wait, back.append)
    queue.hand_over("a")
    lab.scheduler.kill(job)
    assert (lab.run(), back) == ([], ["a"])


def test_a_queue_is_left_when_the_time_is_up(lab: Lab) -> None:
    queue = WaitQueue(lab.scheduler)

    def wait(deadline: float) -> float:
        queue.wait_until(deadline)
        return lab.scheduler.clock.now()

    lab.waiter(wait, 2.0)
    lab.waiter(wait, 5.0)
    lab.scheduler.call_at(3.0, lambda: queue.wake_all())
    lab.scheduler.run_simulated()
    assert (lab.got, len(queue), lab.scheduler.clock.now()) == ([2.0, 3.0], 0, 3.0)


def test_waiting_for_ever_ends_when_the_job_is_stopped(lab: Lab) -> None:
    job = lab.waiter(wait_for_ever, lab.scheduler)
    lab.scheduler.wake(job)
    lab.run()
    assert not job.done
    lab.scheduler.kill(job)
    lab.run()
    assert job.done


def test_no_other_module_parks_a_job() -> None:
    """A loop round ``suspend`` has to leave its place when the job is stopped, and to bear being woken late: once is
    enough."""
    root = Path(urbihw.__file__).parent
    callers = {
        str(path.relative_to(root))
        for path in root.rglob("*.py")
        if ".suspend" in (text := path.read_text("utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "suspend"
    }
    assert callers == {"kernel/sched/waiting.py"}
