"""The verb "values" of the control socket: measured values in SI units at a rate, whatever the parent does."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from urbihw.buses import messages as m

from .conftest import Rig
from .test_control import Caller, ControlBench

ITEMS = ("present_position", "present_temperature")


@pytest.fixture
def bench(rig: Rig, tmp_path: Path) -> Iterator[ControlBench]:
    made = ControlBench(rig, tmp_path / "robot.sock")
    made.run(0.5)
    made.tell(m.Watch(6, ITEMS, 0.0), m.Watch(7, ITEMS, 0.0))
    made.run(0.1)
    yield made
    made.end()


def ask(bench: ControlBench, hz: object) -> Caller:
    caller = bench.call()
    caller.send(json.dumps({"do": "values", "hz": hz}).encode() + b"\n")
    return caller


def values_of(caller: Caller) -> list[dict[str, Any]]:
    return [line for line in caller.hear() if line.get("event") == "Values"]


def test_values_come_at_the_rate_in_si_units_and_follow_the_servo(bench: ControlBench) -> None:
    caller = ask(bench, 20)
    bench.run(1.0)
    told = values_of(caller)
    assert 18 <= len(told) <= 21
    assert told[-1]["values"]["6"]["temperature"] == bench.register("present_temperature")
    steps = [later["time"] - earlier["time"] for earlier, later in zip(told, told[1:], strict=False)]
    assert steps == pytest.approx([0.05] * len(steps), abs=0.011)
    bench.move(900)
    bench.run(1.0)
    place = (bench.register("present_position") - 511.5) * 5.236 / 1023
    assert values_of(caller)[-1]["values"]["6"]["position"] == pytest.approx(place, abs=0.01)


def test_a_rate_of_0_ends_them_and_others_are_refused(bench: ControlBench) -> None:
    caller = ask(bench, 20)
    bench.run(0.2)
    caller.send(b'{"do": "values", "hz": 0}\n')
    bench.run(0.1)
    assert values_of(caller)
    bench.run(0.5)
    assert values_of(caller) == []
    for wrong in (51, -1, "20", True, None, float("nan")):
        caller = ask(bench, wrong)
        bench.run(0.05)
        (answer,) = caller.hear()
        assert answer == {"ok": False, "error": '"hz" must be 0 or from 0.1 to 50'}


def test_a_device_that_is_lost_has_no_values(bench: ControlBench) -> None:
    caller = ask(bench, 10)
    bench.run(0.3)
    assert {"6", "7"} <= set(values_of(caller)[-1]["values"])
    bench.rig.kit.faults.start("silence", 6)
    bench.run(1.0)
    last = values_of(caller)[-1]["values"]
    assert "6" not in last
    assert "7" in last


def test_a_client_that_does_not_read_loses_values_is_told_and_delays_nobody(bench: ControlBench) -> None:
    slow, quick = ask(bench, 50), ask(bench, 10)
    bench.run(0.1)
    control = bench.engine._control
    assert control is not None
    (deaf,) = (each for each in control._clients if each.values_rate == 50)
    taking, full = deaf.socket, _Full(deaf.socket)
    deaf.socket = cast(socket.socket, full)
    bench.run(2.0)
    assert len(deaf._waiting) <= 5
    assert len(values_of(quick)) >= 19
    deaf.socket = taking
    bench.run(0.2)
    assert sum(line.get("dropped", 0) for line in values_of(slow)) >= 85


class _Full:
    """A socket whose buffer is full."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner

    def send(self, data: bytes) -> int:
        raise BlockingIOError

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)
