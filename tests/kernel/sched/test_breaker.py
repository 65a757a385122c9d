"""The trace function that interrupts a job which does not yield."""

from __future__ import annotations

import sys

from urbihw.kernel.sched.breaker import Breaker
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.scheduler import Scheduler


def test_all_signals_set_one_trace_function_that_lives_on() -> None:
    """Python calls a trace function without a reference of its own: one that a second signal replaced was freed while
    it was used, and the process died."""
    scheduler = Scheduler(SimClock())
    breaker = Breaker(scheduler, lambda: 0.0)
    seen = []

    def body() -> None:
        former = sys.gettrace()
        try:
            for error in (ValueError("one"), ValueError("two")):
                breaker.break_in(None, error, after=1.0)
                seen.append(sys.gettrace())
        finally:
            sys.settrace(former)

    scheduler.spawn(body, "job")
    scheduler.run()
    assert seen[0] is not None
    assert seen[0] is seen[1]
    assert any(kept is seen[0] for kept in vars(breaker).values())
