"""The line that tells why a rate is not kept: each cause, and when it is told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from urbihw.buses.pace import Pace, PaceWatch

SLOW = Pace(wanted=100.0, rate=79.4, late=0.2)
GOOD = Pace(wanted=100.0, rate=100.0, late=0.0)


MEND = "(stop the daemon, urbihw doctor URL --mend)"


@pytest.mark.parametrize(("pace", "cause"), [
    (replace(SLOW, turnaround=0.0005, load=0.3), f"shorten the return delay {MEND}"),
    (replace(SLOW, turnaround=0.0011), f"each answer takes 1.1 ms: look for a slow adapter {MEND}"),
    (replace(SLOW, load=0.93, turnaround=0.0005), "the wire is full (93 %): choose a faster baud rate"),
    (replace(SLOW, held_up=0.23, load=0.93),
     "this computer is busy (no processor for 23 % of the time): end other programs"),
    (replace(SLOW, turnaround=0.0011, crowd=4.02),
     "this computer is busy (4.0 programs for each processor): end other programs"),
    (replace(SLOW, turnaround=0.0005, crowd=0.9), f"shorten the return delay {MEND}"),
    (SLOW, "this computer is too slow for it: watch fewer values"),
])  # fmt: skip
def test_the_first_cause_that_applies_is_told(pace: Pace, cause: str) -> None:
    assert pace.explain() == f"a cycle takes 12.6 ms, so 79 Hz of 100: {cause} or set rate = 75"


@pytest.mark.parametrize(("rate", "lower"), [(33.2, "30"), (25.6, "25"), (12.7, "12"), (1.5, "1"), (0.4, "1")])
def test_the_rate_to_set_is_a_round_one_that_is_kept(rate: float, lower: str) -> None:
    assert replace(SLOW, rate=rate).explain().endswith(f"set rate = {lower}")


def test_no_cycle_at_all_is_told_too() -> None:
    assert replace(SLOW, rate=0.0).explain() == "no cycle of the bus has ended; 100 Hz were asked for"


def test_it_is_told_after_five_seconds_once_and_again_after_a_good_minute() -> None:
    watch = PaceWatch()
    assert [bool(watch.hear(SLOW)) for _ in range(8)] == [False] * 4 + [True] + [False] * 3
    assert not any(watch.hear(second) for second in (GOOD, *[SLOW] * 8))
    assert not any(watch.hear(GOOD) for _ in range(60))
    assert sum(bool(watch.hear(SLOW)) for _ in range(8)) == 1


def test_what_is_too_little_is_not_told() -> None:
    watch = PaceWatch()
    assert not any(watch.hear(replace(GOOD, late=0.01)) for _ in range(20))
