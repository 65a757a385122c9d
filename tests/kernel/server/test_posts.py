"""Other threads that post much do not hold up clients."""

from __future__ import annotations

import asyncio

from urbihw.kernel.sched.clock import Clock, SimClock
from urbihw.kernel.sched.scheduler import MAX_RUN_S, Scheduler
from urbihw.kernel.server.loop import LoopDriver


class Ticking(SimClock):
    """A clock that goes on by a millisecond whenever somebody looks at it."""

    def now(self) -> float:
        self.idle(super().now() + 0.001)
        return super().now()

    def round(self) -> float:
        return self.now()


def test_sockets_have_their_turn_between_the_posts() -> None:
    """However many posts there are, what else the loop has to do waits for one drive, not for one each."""

    async def play() -> list[int]:
        scheduler = Scheduler(SimClock())
        driver = LoopDriver(scheduler)
        loop = asyncio.get_running_loop()
        done: list[int] = []
        drives = 0
        run = scheduler.run

        def counted() -> float | None:
            nonlocal drives
            drives += 1
            return run()

        scheduler.run = counted  # type: ignore[method-assign]
        for number in range(1000):
            scheduler.post(lambda number=number: done.append(number))  # type: ignore[misc]
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert done == list(range(1000))
        assert drives == 1
        await loop.run_in_executor(None, scheduler.post, lambda: done.append(-1))
        for _ in range(10):
            await asyncio.sleep(0)
        driver.close()
        return [done[-1], drives]

    assert asyncio.run(play()) == [-1, 2]


def test_posts_that_never_end_let_others_have_their_turn() -> None:
    clock: Clock = Ticking()
    scheduler = Scheduler(clock)
    posts = 0

    def again() -> None:
        nonlocal posts
        posts += 1
        scheduler.post(again)

    scheduler.post(again)
    before = clock.now()
    deadline = scheduler.run()
    assert deadline is not None
    assert deadline - before <= MAX_RUN_S + 0.005
    assert posts < 100
