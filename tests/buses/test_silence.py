"""When a silent worker counts as hung: a loaded machine is no reason, a worker that blocks or computes for ever is."""

from __future__ import annotations

import itertools
from multiprocessing import Pipe
from types import SimpleNamespace

import pytest

from urbihw.buses import worker
from urbihw.buses.counter import StatisticsCounter
from urbihw.buses.messages import Ended, FromWorker
from urbihw.buses.processor import Processor, held_up
from urbihw.buses.servos.driver import ServoDriver
from urbihw.buses.silence import CHECK_PERIOD_S, MOST_CREDIT, Silence

ALLOWED = 2.0


def killed_after(waits: float, *, suspended_at: float = 1e9) -> float:
    """Seconds until a worker is killed that waits for a processor for this share of the time."""
    silence, now, own = Silence(100.0, 5.0), 0.0, 0.0
    while not silence.hangs(ALLOWED):
        step = 3.0 if now <= suspended_at < now + CHECK_PERIOD_S else CHECK_PERIOD_S
        now += step
        own += step * waits
        silence.look(100.0 + now, 5.0 + own)
        assert now < 100
    return now


@pytest.mark.parametrize(
    ("waits", "seconds"), [(0.0, ALLOWED), (0.5, 2 * ALLOWED), (0.8, 5 * ALLOWED), (0.99, (1 + MOST_CREDIT) * ALLOWED)]
)
def test_the_time_in_which_a_worker_had_no_processor_does_not_count_up_to_a_bound(waits: float, seconds: float) -> None:
    assert killed_after(waits) == pytest.approx(seconds, abs=2 * CHECK_PERIOD_S)


def test_a_worker_gets_its_time_again_when_we_were_suspended_ourselves() -> None:
    assert killed_after(0.0, suspended_at=1.0) == pytest.approx(1.0 + 3.0 + ALLOWED, abs=2 * CHECK_PERIOD_S)


def test_a_process_tells_how_long_it_waited() -> None:
    waited = held_up()
    assert waited is not None and 0.0 <= waited < 1e6
    assert held_up("none") is None


@pytest.mark.parametrize("before", [5.0, None])
def test_a_time_that_cannot_be_read_neither_ends_a_worker_nor_gives_it_more_time(before: float | None) -> None:
    silence = Silence(100.0, before)
    silence.look(100.1, None)
    assert not silence.hangs(ALLOWED)
    silence.look(100.2, 5.0)
    for tenths in range(3, 23):
        silence.look(100 + tenths / 10, None)
        assert silence.hangs(ALLOWED) == (silence.lasted >= ALLOWED)


def test_what_waited_before_we_were_suspended_counts_no_more() -> None:
    silence = Silence(100.0, 5.0)
    silence.look(100.3, 5.3)
    silence.look(104.0, None)
    for tenths in range(1, 22):
        silence.look(104 + tenths / 10, None)
    assert silence.hangs(ALLOWED)


@pytest.mark.parametrize(("stopped", "silent"), [(False, "4.0"), (True, "0.4")])
def test_one_that_was_killed_is_told_with_the_time_that_it_was_silent(
    monkeypatch: pytest.MonkeyPatch, stopped: bool, silent: str
) -> None:
    looks = itertools.count(1000)
    monkeypatch.setattr(worker, "time", SimpleNamespace(monotonic=lambda: next(looks) / 10))
    monkeypatch.setattr(worker, "CHECK_PERIOD_S", 0.0)
    ours, theirs = Pipe()
    told: list[FromWorker] = []
    waited = itertools.count(1)
    made = worker.Worker(
        "robot", ours, told.append, lambda _: "", theirs.close, lambda: next(waited) / 20, lambda: stopped, ALLOWED
    )
    made._reader.join(10.0)
    assert told[-1] == Ended(f"the bus worker of robot hung for {silent} s and was killed")


def test_a_second_whose_wait_cannot_be_read_tells_none(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([None, 7.0, 7.0, 7.25, 7.25, None, None])
    monkeypatch.setattr(Processor, "held_up", lambda _: next(times))
    counter = StatisticsCounter(100.0, Processor())
    shares = [counter.close(101.0 + second, None, ServoDriver(), 0, 50.0).held_up for second in range(3)]
    assert shares == [0.0, 0.25, 0.0]
