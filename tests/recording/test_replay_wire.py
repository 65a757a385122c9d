"""The wire of a recording, played to the same driver: values, stamps and events are those that were recorded."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from recording_lab import RecordedWorker, ReplayRig, Said, capture_of, kit_rig, write

from urbihw.buses import messages as m

ITEMS = ("present_position", "present_speed", "present_load")
GOAL = "goal_position"
Script = Callable[[RecordedWorker], None]


def swing(worker: RecordedWorker) -> None:
    """A joint swings, others are read; everything is healthy."""
    worker.run(0.6)
    worker.tell(*(m.Watch(number, ITEMS) for number in range(1, 19)))
    for goal in (600, 400, 512):
        worker.tell(m.Targets({(6, GOAL): goal, (7, GOAL): 1023 - goal}))
        worker.run(0.4)
    worker.tell(m.Request(1, "write", 3, "led", 1), m.Request(2, "read", 3, "present_voltage"))
    worker.run(0.2)


def fault(worker: RecordedWorker, do: str, *words: Any) -> None:
    """Do something to the robot; the recorded wire remembers it."""
    kit = getattr(worker.rig, "kit", None)
    if kit is not None:
        getattr(kit.faults, do)(*words)


def silenced(worker: RecordedWorker) -> None:
    """One servo is silent for a while and comes back."""
    worker.run(0.6)
    worker.tell(*(m.Watch(number, ITEMS) for number in (5, 6, 7)), m.Targets({(6, GOAL): 600}))
    worker.run(0.3)
    fault(worker, "start", "silence", 6)
    worker.run(2.0)
    fault(worker, "stop", None, 6)
    worker.run(2.5)


def damaged(worker: RecordedWorker) -> None:
    """Some answers are damaged."""
    worker.run(0.6)
    worker.tell(*(m.Watch(number, ITEMS) for number in (5, 6)))
    worker.run(0.2)
    for word in ("checksum", "cut", "noise"):
        fault(worker, "start", word, 5)
        worker.run(0.1)
        fault(worker, "stop")
        worker.run(0.1)


def unplugged(worker: RecordedWorker) -> None:
    """The adapter is pulled in the middle of a movement, and put back."""
    worker.run(0.6)
    worker.tell(*(m.Watch(number, ITEMS) for number in (5, 6)), m.Targets({(6, GOAL): 900}))
    worker.run(0.3)
    if hasattr(worker.rig, "kit"):
        worker.rig.end.unplug()
    worker.run(1.0)
    if hasattr(worker.rig, "kit"):
        worker.rig.end.replug()
    worker.run(3.0)


def without_times(events: list[Said]) -> list[Said]:
    return [{key: value for key, value in event.items() if key not in ("at", "time", "times")} for event in events]


def times(events: list[Said]) -> list[float]:
    return [time for event in events for time in (event["time"], *event["times"].values())]


@pytest.mark.parametrize("script", [swing, silenced, damaged, unplugged])
def test_the_same_driver_gives_the_same_values_stamps_and_events(script: Script, tmp_path: Path) -> None:
    recorded = RecordedWorker(kit_rig(), tmp_path / "a.sock")
    script(recorded)
    file = write(tmp_path / "robot.mcap", recorded.lines)
    assert not recorded.said("Lost") and file.count > 400
    recorded.end()

    rig = ReplayRig(capture_of(file.path))
    played = RecordedWorker(rig, tmp_path / "b.sock")
    script(played)
    assert getattr(rig.device.answers, "differences", None) == ""
    samples, again = recorded.said("Samples"), played.said("Samples")
    assert len(samples) > 30 and without_times(again) == without_times(samples)
    assert times(again) == pytest.approx(times(samples), abs=5e-6)
    kinds = ("DeviceState", "LinkState", "Found", "Reply", "Refused", "Stopped", "Applied")
    assert without_times(played.said(*kinds)) == without_times(recorded.said(*kinds))
    assert json.loads(played.lines[0])["devices"] == json.loads(recorded.lines[0])["devices"]
    states = [event["new"] for event in recorded.said("DeviceState")]
    links = [event["up"] for event in recorded.said("LinkState")]
    assert {"suspect", "lost", "back"} <= {*states} if script in (silenced, damaged) else not states
    assert links == ([False, True] if script is unplugged else [])
    played.end()


def test_a_driver_that_asks_otherwise_is_noticed(tmp_path: Path) -> None:
    recorded = RecordedWorker(kit_rig(), tmp_path / "a.sock")
    swing(recorded)
    capture = capture_of(write(tmp_path / "robot.mcap", recorded.lines).path)
    recorded.end()
    rig = ReplayRig(capture)
    played = RecordedWorker(rig, tmp_path / "b.sock")
    played.run(0.6)
    played.tell(m.Watch(6, ("present_temperature",)))
    played.run(0.1)
    assert "recorded was" in getattr(rig.device.answers, "differences", "")
    played.end()


def test_a_later_session_on_recorded_answers_finds_the_robot_and_reads_it(tmp_path: Path) -> None:
    """Not strict: another program than the recorded one; what it reads is what was recorded."""
    recorded = RecordedWorker(kit_rig(), tmp_path / "a.sock")
    swing(recorded)
    capture = capture_of(write(tmp_path / "robot.mcap", recorded.lines).path)
    recorded.end()
    played = RecordedWorker(ReplayRig(capture, strict=False), tmp_path / "b.sock")
    played.run(0.6)
    played.tell(*(m.Watch(number, ITEMS) for number in range(1, 19)), m.Targets({(6, GOAL): 555}))
    played.run(0.5)
    assert len(json.loads(played.lines[0])["devices"]) == 19
    assert not [state for state in played.said("DeviceState") if state["new"] == "lost"]
    recorded_positions = {event["values"]["6"]["present_position"] for event in recorded.said("Samples")}
    assert {event["values"]["6"]["present_position"] for event in played.said("Samples")} <= recorded_positions
    played.end()
