"""What a recording shows: lines, reasons, tables; through the command, from a worker in simulated time."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from recording_lab import RecordedWorker, kit_rig, write

from urbihw.buses import messages as m
from urbihw.cli.main import main
from urbihw.recording.records import RecordMaker

GOAL = "goal_position"
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Servo 6 is sent too far by one client, and stopped by another."""
    folder = tmp_path_factory.mktemp("recording")
    worker = RecordedWorker(kit_rig(), folder / "a.sock")
    worker.run(0.6)
    limit = m.Limit(0, 600, name="limits.motor6.position")
    worker.tell(m.Limits({(6, GOAL): limit}), m.Watch(6, ("present_position",)), m.Watch(7, ("present_position",)))
    worker.run(0.1)
    worker.tell(m.Writers({6: "Lobby_1 (127.0.0.1)"}), m.Targets({(6, GOAL): 900}))
    worker.run(0.4)
    worker.order("stop", "the \x1b[2Jcook")
    worker.run(0.5)
    yield write(folder / "robot.mcap", [*worker.lines, b"[[[", b'{"event":"Stopped"}']).path
    worker.end()


def shown(capsys: Capture, *words: str) -> list[str]:
    assert main(["show", *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_it_is_shown_who_asked_for_what_and_what_became_of_it(file: Path, capsys: Capture) -> None:
    lines = [" ".join(line.split()[1:]) for line in shown(capsys, str(file), "--device", "6")]
    assert lines == [
        "writer 6: Lobby_1 (127.0.0.1)",
        "target 6 goal_position 900",
        "limited 6 goal_position: 900 -> 600 by limits.motor6.position",
        "applied 6 goal_position 600",
    ]


def test_events_without_sense_and_control_characters_are_harmless(file: Path, capsys: Capture) -> None:
    lines = shown(capsys, str(file), "--kind", "events")
    assert any("stop asked by the " in line and "cook" in line for line in lines)
    assert any("1 records are missing here (a line without sense)" in line for line in lines)
    assert any("bytes that are not understood" in line for line in lines)
    assert all(line.isprintable() for line in lines)


def test_filters_by_kind_and_time(file: Path, capsys: Capture) -> None:
    assert all(line.split()[1] == "wire" for line in shown(capsys, str(file), "--kind", "wire"))
    part = shown(capsys, str(file), "--kind", "samples", "--from", "0.3s", "--to", "0.4")
    assert 9 <= len(part) <= 11 and all(0.3 <= float(line.split()[0]) <= 0.4 for line in part)


def test_why_a_device_is_where_it_is(file: Path, capsys: Capture) -> None:
    moving = shown(capsys, str(file), "--why", "motor6", "--at", "0.4s")
    assert [" ".join(line.split()[1:]) for line in moving[:2]] == [
        "asked for goal_position 900 by Lobby_1 (127.0.0.1)",
        "applied goal_position 600: limited by limits.motor6.position",
    ]
    assert "measured present_position" in moving[2]
    after = shown(capsys, str(file), "--why", "6", "--at", "1.5s")
    assert len(after) == 2 and "stopped: stop asked by the " in after[1] and "what was asked before is over" in after[1]
    assert shown(capsys, str(file), "--why", "motor99") == ["motor99: nothing was recorded of it until then"]


def test_why_knows_who_moved_a_joint_before_the_recording_and_the_names_of_an_arm(
    tmp_path: Path, capsys: Capture
) -> None:
    path, maker = tmp_path / "late.mcap", RecordMaker()
    answer = {
        "ok": True, "do": "record", "time": 5.0, "link": True, "estop": "", "epoch": 1,
        "writers": {"6": "Lobby_1 (127.0.0.1)", "5": "Lobby_2 (127.0.0.1)"},
    }  # fmt: skip
    lines: list[dict[str, Any]] = [
        answer,
        {"event": "Settings", "settings": {"devices": {"claw": {"id": 5}}}, "at": 5.0},
        {"event": "Samples", "time": 5.1, "values": {"6": {"present_position": 2000}}, "times": {}, "at": 5.1},
    ]
    texts = [json.dumps(line).encode() for line in lines]
    write(path, texts, "so101")
    for text in texts:
        maker.records(text)
    told = [" ".join(line.split()[1:]) for line in shown(capsys, str(path), "--why", "gripper")]
    assert told == ["moved last by Lobby_1 (127.0.0.1), before the recording began", "measured present_position 2000"]
    (line,) = shown(capsys, str(path), "--why", "claw")
    assert "moved last by Lobby_2 (127.0.0.1)" in line
    (begun,) = [record for record in maker.beginning if record.topic == "/writers"]
    assert json.loads(begun.data)["names"] == answer["writers"]
    maker.records(json.dumps({"event": "Stopped", "devices": [6], "reason": "", "at": 6.0}).encode())
    assert json.loads(maker.beginning[-1].data)["names"] == {"5": "Lobby_2 (127.0.0.1)"}


def test_who_moved_devices_that_are_stopped_is_forgotten_wherever_they_stand() -> None:
    maker = RecordMaker()
    answer = {"ok": True, "do": "record", "time": 5.0, "link": True, "estop": "", "epoch": 1,
              "writers": {"1": "a", "2": "b", "3": "c"}}
    stopped = {"event": "Stopped", "devices": [2, 3], "reason": "", "at": 6.0}
    for event in (answer, stopped):
        maker.records(json.dumps(event).encode())
    assert json.loads(maker.beginning[-1].data)["names"] == {"1": "a"}


def test_values_as_a_table(file: Path, capsys: Capture) -> None:
    rows = list(csv.reader(shown(capsys, str(file), "--csv", "--raw")))
    assert rows[0] == ["time", "6.present_position", "7.present_position"]
    positions = [int(row[1]) for row in rows[1:]]
    assert len(positions) > 90 and positions[0] == 512 and 515 < max(positions) <= 604
    assert shown(capsys, str(file), "--csv", "--raw", "--values", "7")[0] == "time,7.present_position"
    assert main(["show", str(file), "--csv", "--raw", "--values", "8"]) == 66
    assert "has no values of 8" in capsys.readouterr().err


def test_the_wire_is_decoded_packet_by_packet(file: Path, tmp_path: Path, capsys: Capture) -> None:
    capture = tmp_path / "wire.hex"
    capture.write_text("\n".join(shown(capsys, str(file), "--capture")) + "\n")
    assert main(["trace", str(capture)]) == 0
    told = capsys.readouterr()
    assert any("goal_position 600" in line for line in told.out.splitlines())
    assert ", 0 damaged, " in told.err
