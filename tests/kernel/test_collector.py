"""What Python's collector goes through in a server, and when."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import weakref
from collections.abc import Iterator

import pytest

from urbihw.kernel.sched import collector
from urbihw.kernel.sched.collector import Collector


class Node:
    """Refers to itself."""

    def __init__(self) -> None:
        self.me = self


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """The time of the collector; each collection takes a second."""
    now = [1000.0]

    def monotonic() -> float:
        now[0] += 1
        return now[0]

    monkeypatch.setattr("urbihw.kernel.sched.collector.time.monotonic", monotonic)
    gc.unfreeze()  # what lives as long as all tests
    gc.collect()
    yield now
    assert gc.get_freeze_count() == 0


def test_what_a_long_collection_left_is_gone_through_once_in_a_while(time: list[float]) -> None:
    guarded = Collector()
    guarded.guard()
    try:
        node = Node()
        ref = weakref.ref(node)
        gc.collect()
        assert gc.get_freeze_count() > 0
        del node
        gc.collect()
        assert ref() is not None
        time[0] += collector.FULL_COLLECTION_PERIOD_S
        gc.collect()
        assert ref() is None
    finally:
        guarded.release()


def test_when_memory_is_short_all_is_gone_through(time: list[float]) -> None:
    guarded = Collector()
    guarded.guard()
    try:
        node = Node()
        ref = weakref.ref(node)
        gc.collect()
        del node
        guarded.collect()
        assert ref() is None
    finally:
        guarded.release()


def test_a_short_collection_freezes_nothing(time: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collector, "SLOW_COLLECTION_S", 10.0)
    guarded = Collector()
    guarded.guard()
    try:
        gc.collect()
        gc.collect(0)
        assert gc.get_freeze_count() == 0
    finally:
        guarded.release()


def test_long_work_thaws_what_it_froze_when_all_of_it_is_over(time: list[float]) -> None:
    working = Collector()
    with working:
        with working:
            working.freeze_existing()
        assert gc.get_freeze_count() > 0
    assert gc.get_freeze_count() == 0


def test_long_work_in_a_server_leaves_it_frozen(time: list[float]) -> None:
    guarded = Collector()
    guarded.guard()
    with guarded:
        guarded.freeze_existing()
    assert gc.get_freeze_count() > 0
    guarded.release()


FROZEN = """
import gc, threading
from urbihw.kernel import Kernel

kept = []

def serve():
    kept.append(Kernel())
    gc.freeze()

thread = threading.Thread(target=serve)
thread.start()
thread.join()
gc.unfreeze()
used = [bytearray(100) for _ in range(10_000)]
gc.collect()
"""


def test_a_kernel_that_is_frozen_survives_its_thread() -> None:
    env = {**os.environ, "PYTHONMALLOC": "debug"}
    assert subprocess.run((sys.executable, "-c", FROZEN), env=env, check=False).returncode == 0
