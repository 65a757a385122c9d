"""Work in a thread: one piece at a time, and only the newest result counts."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from urbihw.navigation.background import Background


def test_a_newer_work_waits_for_the_thread_of_the_older() -> None:
    posted: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
    background = Background(posted.put, (OSError,))
    release, begun = threading.Event(), list[int]()
    results: list[int] = []

    def work(number: int) -> Callable[[], int]:
        def run() -> int:
            begun.append(number)
            release.wait(5)
            return number

        return run

    for number in range(30):
        background.start(work(number), results.append, lambda error: results.append(-1))
    assert begun in ([], [0]) and background.busy
    release.set()
    posted.get(timeout=5)()
    assert results == [] and background.busy
    posted.get(timeout=5)()
    assert begun == [0, 29] and results == [29] and not background.busy


def test_dropped_work_does_not_begin() -> None:
    posted: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
    background = Background(posted.put, (OSError,))
    seen: list[str] = []
    background.start(lambda: seen.append("first"), lambda _: seen.append("done"), lambda _: None)
    background.start(lambda: seen.append("second"), lambda _: seen.append("done"), lambda _: None)
    background.drop()
    posted.get(timeout=5)()
    assert seen == ["first"] and posted.empty()
    background.start(lambda: None, lambda _: seen.append("third"), lambda _: None)
    posted.get(timeout=5)()
    assert seen == ["first", "third"]
