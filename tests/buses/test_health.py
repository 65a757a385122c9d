"""What the cycle thinks of a device: only misses in a row make it lost."""

from __future__ import annotations

from urbihw.buses.servos.health import LOST_AFTER, PROBE_PERIOD, Change, Health


def states(*changes: Change | None) -> list[str]:
    """The states that were entered."""
    return [change.new for change in changes if change is not None]


def test_misses_in_a_row_make_it_lost() -> None:
    health = Health()
    changes = [health.record_miss(float(tick), "silent") for tick in range(LOST_AFTER)]
    assert states(*changes) == ["suspect", "lost"]
    assert health.next_probe == LOST_AFTER - 1 + PROBE_PERIOD


def test_an_answer_between_misses_begins_the_count_anew() -> None:
    health = Health()
    for tick in range(10 * LOST_AFTER):
        changes = [health.record_miss(tick + step / 10, "silent") for step in range(LOST_AFTER - 1)]
        assert states(*changes, health.record_answer()) == ["suspect", "ok"]


def test_a_device_that_is_back_has_all_its_misses_before_it_again() -> None:
    health = Health()
    for _ in range(LOST_AFTER):
        health.record_miss(0.0, "silent")
    assert states(health.record_probe(0.3, False), health.record_probe(0.6, True)) == ["back"]
    changes = [health.record_miss(1.0, "silent") for _ in range(LOST_AFTER)]
    assert states(*changes) == ["suspect", "lost"]


def test_a_device_that_is_not_there_needs_no_misses() -> None:
    health = Health()
    assert states(health.declare_lost(5.0, "unplugged"), health.declare_lost(6.0, "unplugged")) == ["lost"]
    assert states(health.record_probe(7.0, True), health.record_answer()) == ["back", "ok"]
    assert states(health.record_miss(8.0, "silent")) == ["suspect"]
