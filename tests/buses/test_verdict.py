"""The verdict on a worker's answer to "health": one case for each reason, and none for a healthy robot."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from health_sample import HEALTHY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from urbihw.buses.verdict import Level, judge, level_of


def robot(**changes: Any) -> dict[str, Any]:
    return copy.deepcopy(HEALTHY) | changes


def with_device(**changes: Any) -> dict[str, Any]:
    made = robot()
    values = changes.pop("values", {})
    made["devices"][0].update(changes)
    made["devices"][0]["values"].update(values)
    return made


def with_bus(**changes: Any) -> dict[str, Any]:
    made = robot()
    made["bus"].update(changes)
    return made


def test_a_healthy_robot_gives_no_reason() -> None:
    assert judge(HEALTHY) == []
    assert level_of([]) == Level.OK


CASES = [
    (robot(link=False, link_reason="no such port"), 2, "no link: no such port"),
    (
        robot(estop="the red button"),
        2,
        "emergency stop by the red button; urbihw release ends it, with --all also if it is not yours",
    ),
    (
        robot(dead_man={"timeout": 1.5, "age": 4.0, "fired": True}),
        2,
        "no sign of life from the daemon for 4.0 s: the robot is stopped",
    ),
    (
        robot(last_stop={"reason": "no sign of life from the master for 1.5 s", "age": 12.0}),
        1,
        "stopped 12 s ago: no sign of life from the master for 1.5 s",
    ),
    (robot(restarts=2), 1, "the bus worker was replaced 2 times"),
    (
        with_bus(late_share=0.21, mean_rate=79.4, turnaround=0.0005),
        1,
        "a cycle takes 12.6 ms, so 79 Hz of 100: shorten the return delay (stop the daemon, urbihw doctor URL --mend) "
        "or set rate = 75",
    ),
    (with_bus(rate=50.0), 1, "50 Hz instead of 100"),
    (with_bus(recent_errors={"timeouts": 80}), 1, "80 timeouts on the wire in 60 s"),
    (
        with_bus(recent_errors={"timeouts": 900}, held_up=0.3, crowd=3.2),
        1,
        "900 timeouts on the wire in 60 s: this computer is busy (no processor for 30 % of the time)",
    ),
    (
        with_bus(recent_errors={"timeouts": 900}, crowd=3.2),
        2,
        "900 timeouts on the wire in 60 s: this computer is busy (3.2 programs for each processor)",
    ),
    (with_bus(recent_errors={"damaged": 900}, crowd=3.2), 2, "900 damaged on the wire in 60 s"),
    (robot(missing=[{"id": 3, "name": "hip", "expected": "AX-12A"}]), 2, "hip (3): missing, expected AX-12A"),
    (robot(unexpected=[{"id": 9, "name": "", "expected": "", "found": "AX-12A"}]), 1, "9: not expected (AX-12A)"),
    (
        robot(other=[{"id": 6, "name": "knee", "expected": "AX-12A", "found": "AX-12W"}]),
        1,
        "knee (6): is AX-12W, not AX-12A",
    ),
    (with_device(state="lost", reason="no answer"), 2, "6: lost: no answer"),
    (with_device(state="suspect", reason="checksum"), 1, "6: suspect: checksum"),
    (with_device(alarm="overload"), 2, "6: alarm: overload"),
    (with_device(age=3.5), 1, "6: last answer 3.5 s ago"),
    (with_device(age=7.0, period=2.0), 1, "6: last answer 7.0 s ago"),
    (with_device(passed=[{"name": "limits.voltage", "holds": False}]), 1, "6: beyond limits.voltage"),
    (with_device(passed=[{"name": "limits.temperature", "holds": True}]), 2, "6: beyond limits.temperature; held"),
    (with_device(values={"temperature": 66.0}), 1, "6: 66 degC, near its limit of 70"),
    (with_device(values={"temperature": 71.0}), 2, "6: 71 degC, beyond its limit of 70"),
    (with_device(values={"voltage": 5.5}), 2, "6: 5.5 V, below its limit of 6.0"),
    (with_device(values={"voltage": 15.0}), 2, "6: 15.0 V, above its limit of 14.0"),
    (with_device(values={"charge": 0.06}), 1, "6: 6 % of its charge left"),
]  # fmt: skip


@pytest.mark.parametrize(("told", "level", "text"), CASES, ids=[case[2] for case in CASES])
def test_each_reason(told: dict[str, Any], level: int, text: str) -> None:
    (finding,) = judge(told)
    assert (finding.level, str(finding)) == (level, text)


def test_the_worst_comes_first_and_is_the_verdict() -> None:
    told = with_device(age=3.5, alarm="overload")
    found = judge(told)
    assert [finding.kind for finding in found] == ["alarm", "stale"]
    assert level_of(found) == Level.BAD


def test_without_a_link_its_devices_give_no_further_reasons() -> None:
    told = with_device(state="no link", age=80.0) | {"link": False, "missing": [{"id": 6}]}
    assert [finding.kind for finding in judge(told)] == ["link"]


def test_a_device_that_is_read_seldom_or_speaks_by_itself_is_not_stale() -> None:
    assert judge(with_device(age=5.0, period=2.0)) == []
    assert judge(with_device(age=900.0, period=None)) == []


def test_a_missing_device_is_told_once() -> None:
    told = with_device(state="lost") | {"missing": [{"id": 6, "name": "knee", "expected": "AX-12A"}]}
    assert [finding.kind for finding in judge(told)] == ["missing"]


json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(sorted(HEALTHY["devices"][0])), inner),
    max_leaves=20,
)


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(sorted(HEALTHY)), json))
def test_no_answer_is_so_strange_that_it_cannot_be_judged(told: dict[str, Any]) -> None:
    assert level_of(judge(told)) in Level
