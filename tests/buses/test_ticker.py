"""Ticks keep the rate: alone, and as a worker whose cycle takes longer than the period that was asked."""

from __future__ import annotations

import itertools

import pytest

from urbihw.buses import messages as m
from urbihw.buses.ticker import LEAST_GAP_S, Ticker

from .conftest import Rig
from .test_worker import Bench, of

FACTORY_DELAY = 250
"""The return delay of a new servo, 500 us, as a count."""
READ = ("present_position", "present_speed", "present_load", "present_voltage", "present_temperature")


@pytest.mark.parametrize("ended", [0.0, 0.004, 0.01 - LEAST_GAP_S])
def test_a_tick_in_time_keeps_the_deadlines(ended: float) -> None:
    ticker = Ticker(0.01, 0.0)
    assert ticker.advance(ended) == 0
    assert ticker.due == 0.01


def test_a_late_tick_lets_the_next_one_begin_at_once_and_moves_the_phase() -> None:
    ticker = Ticker(0.01, 0.0)
    assert ticker.advance(0.0126) == 0
    assert ticker.due == 0.0126 + LEAST_GAP_S
    assert ticker.advance(0.02) == 0
    assert ticker.due == pytest.approx(0.0226 + LEAST_GAP_S)


def test_missed_ticks_are_counted_once_and_not_made_up_for() -> None:
    ticker = Ticker(0.01, 0.0)
    assert ticker.advance(0.095) == 8
    assert ticker.due == 0.095 + LEAST_GAP_S
    assert ticker.advance(0.096) == 0
    assert ticker.due == pytest.approx(0.105 + LEAST_GAP_S)


def test_delays_of_less_than_a_tick_add_up() -> None:
    """What was executed and what was missed is what was asked for."""
    ticker, executed, missed = Ticker(0.01, 0.0), 0, 0
    while ticker.due < 10.0:
        executed += 1
        missed += ticker.advance(ticker.due + 0.0126)
    assert executed == pytest.approx(10.0 / 0.0127, abs=1)
    assert executed + missed == pytest.approx(1000, abs=1)


def rate_at(rig: Rig, asked: float) -> tuple[float, m.Statistics]:
    """Samples a second of a worker that is asked for a rate, and its last statistics; 18 servos are read each tick."""
    bench = Bench(rig, m.Configure(rate=asked, dead_man=0))
    try:
        bench.run(0.5)
        bench.tell(*(m.Watch(number, READ) for number in range(1, 19)))
        bench.run(0.2)
        begin = rig.clock.now()
        heard = bench.run(1.1)
        return len(of(m.Samples, heard)) / (rig.clock.now() - begin), of(m.Statistics, heard)[-1]
    finally:
        bench.close()


def test_who_asks_for_more_never_gets_less(rig: Rig) -> None:
    """18 servos as they are shipped, at 1 Mbps: a cycle of 13 ms, whatever is asked."""
    for unit in rig.kit:
        unit.registers.put("return_delay", FACTORY_DELAY)
    cycle = 18 * (8 + 14) * 10e-6 + 18 * 500e-6
    limit = 1 / cycle
    asked = (25, 50, 70, 75, 80, 90, 100, 130, 160, 200, 1000)
    rates = [rate_at(rig, each)[0] for each in asked]
    for wanted, rate in zip(asked, rates, strict=True):
        assert rate == pytest.approx(min(wanted, limit), rel=0.02), (wanted, rates)
    assert all(after >= before * 0.998 for before, after in itertools.pairwise(rates)), rates
