"""The verb "health" of the control socket: what a worker knows of its robot, in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw.buses import messages as m

from .conftest import Rig
from .test_control import ControlBench

ITEMS = ("present_position", "present_temperature", "present_voltage", "present_load")
CENTRE = 511.5


@pytest.fixture
def bench(rig: Rig, tmp_path: Path) -> Iterator[ControlBench]:
    made = ControlBench(rig, tmp_path / "robot.sock")
    made.run(0.5)
    made.tell(m.Watch(6, ITEMS, 0.0))
    made.run(0.1)
    yield made
    made.end()


def health(bench: ControlBench) -> dict[str, Any]:
    return bench.order("health")[0]


def device(bench: ControlBench, number: int = 6) -> dict[str, Any]:
    (row,) = [each for each in health(bench)["devices"] if each["device"] == number]
    assert isinstance(row, dict)
    return row


def test_measured_values_are_in_si_units_with_the_range_of_the_model(bench: ControlBench) -> None:
    bench.rig.kit.servo(6).heat(48)
    bench.run(0.1)
    row = device(bench)
    assert (row["state"], row["model"], row["alarm"]) == ("ok", "AX-12A", "")
    assert row["values"]["temperature"] == 48
    assert row["units"] == {"position": "rad", "temperature": "degC", "voltage": "V", "load": ""}
    assert row["limits"] == {"temperature": [None, 70.0], "voltage": [6.0, 14.0]}
    assert row["age"] < 0.1


def test_a_target_stands_beside_what_the_limits_made_of_it_and_who_wrote_it(bench: ControlBench) -> None:
    bench.tell(m.Limits({(6, "goal_position"): m.Limit(300, 600, name="limits.motor6.position")}))
    bench.tell(m.Writers({6: "Lobby_2 (127.0.0.1)"}))
    bench.move(900)
    row = device(bench)
    assert row["who"] == "Lobby_2 (127.0.0.1)"
    assert row["requested"]["position"] == pytest.approx((900 - CENTRE) * 5.236 / 1023, abs=1e-3)
    assert row["applied"]["position"] == pytest.approx((600 - CENTRE) * 5.236 / 1023, abs=1e-3)
    bench.order("stop")
    row = device(bench)
    assert (row["requested"], row["applied"], row["who"]) == ({}, {}, "")


def test_a_servo_that_is_lost_and_one_that_is_overheated(bench: ControlBench) -> None:
    bench.rig.kit.faults.start("silence", 6)
    bench.rig.kit.servo(7).heat(90)
    bench.tell(m.Watch(7, ITEMS, 0.0))
    bench.run(0.5)
    row = device(bench)
    assert (row["state"], row["lost"], row["missed"]) == ("lost", 1, 1)
    assert row["reason"]
    assert row["age"] > 0.3
    assert "overheating" in device(bench, 7)["alarm"]


def test_the_bus_and_the_stops_are_told(bench: ControlBench) -> None:
    bench.order("stop", "me")
    bench.run(2.1)
    told = health(bench)
    assert told["bus"]["wanted_rate"] == 100
    assert told["bus"]["rate"] == pytest.approx(100, rel=0.05)
    assert told["bus"]["load"] > 0
    assert (told["bus"]["late"], told["bus"]["late_share"]) == (0, 0)
    assert told["last_stop"]["reason"] == "stop asked by me"
    assert (told["stops"], told["restarts"], told["link_reason"]) == (1, 0, "")
    assert told["dead_man"] == {"timeout": 0, "age": pytest.approx(2.1, abs=0.3), "fired": False}
    assert told["expected"] == []


def test_a_robot_without_a_link_says_why(bench: ControlBench) -> None:
    bench.rig.end.unplug()
    bench.run(0.3)
    told = health(bench)
    assert not told["link"]
    assert told["link_reason"]
    assert {row["state"] for row in told["devices"]} == {"no link"}


def test_a_stop_of_one_device_forgets_its_target_and_its_writer_only(bench: ControlBench) -> None:
    bench.tell(m.Writers({6: "me", 7: "you"}), m.Targets({(6, "goal_position"): 600, (7, "goal_position"): 600}))
    bench.run(0.1)
    bench.tell(m.Stop(0, "its client has gone", (6,)))
    bench.run(0.1)
    assert (device(bench, 6)["requested"], device(bench, 6)["who"]) == ({}, "")
    assert (device(bench, 7)["requested"].keys(), device(bench, 7)["who"]) == ({"position"}, "you")


def test_what_an_emergency_stop_refuses_was_not_requested(bench: ControlBench) -> None:
    bench.order("estop", "the red button")
    bench.move(900, epoch=1)
    assert device(bench)["requested"] == {}
    assert health(bench)["estop"] == "the red button"
