"""Other threads that post much, and jobs that work long, do not hold up clients."""

from __future__ import annotations

import asyncio
import socket

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


def test_all_sockets_are_read_before_jobs_that_were_left_run_on() -> None:
    """Else one client after the other is heard, and each may hold the interpreter before the next one is."""

    async def play() -> tuple[list[int], int]:
        scheduler = Scheduler(SimClock())
        driver = LoopDriver(scheduler)
        loop = asyncio.get_running_loop()
        turns = 0
        turns_when_read: list[int] = []

        def work() -> None:
            nonlocal turns
            for _ in range(50):
                turns += 1
                scheduler.interrupt()
                scheduler.yield_()

        def listen(line: socket.socket) -> None:
            line.recv(1)
            turns_when_read.append(turns)
            driver.drive()

        lines = [socket.socketpair() for _ in range(5)]
        for ours, theirs in lines:
            loop.add_reader(ours, listen, ours)
            theirs.send(b"x")
        scheduler.spawn(work)
        driver.drive()
        while turns < 50 or len(turns_when_read) < len(lines):
            await asyncio.sleep(0)
        driver.close()
        for ours, theirs in lines:
            loop.remove_reader(ours)
            ours.close()
            theirs.close()
        return turns_when_read, turns

    assert asyncio.run(play()) == ([1] * 5, 50)
