"""When a silent worker counts as hung: a loaded machine is no reason, a worker that blocks or computes for ever is."""

from __future__ import annotations

import pytest

from urbihw.buses.processor import held_up
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
    assert 0.0 <= held_up() < 1e6
    assert held_up("none") == 0.0
