"""Calibration files: LeRobot's format, atomic writing, former versions, differences."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from urbihw.buses.servos import calibration
from urbihw.buses.servos.calibration import BadCalibration, JointCalibration

# As LeRobot 0.4 writes it (draccus, four spaces).
LEROBOT = """{
    "shoulder_pan": {
        "id": 1,
        "drive_mode": 0,
        "homing_offset": -1470,
        "range_min": 700,
        "range_max": 3400
    },
    "gripper": {
        "id": 6,
        "drive_mode": 1,
        "homing_offset": 1424,
        "range_min": 2031,
        "range_max": 3476
    }
}
"""
ARM = {
    "shoulder_pan": JointCalibration(1, 0, -1470, 700, 3400),
    "gripper": JointCalibration(6, 1, 1424, 2031, 3476),
}


def test_a_file_of_lerobot_is_read_and_written_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "arm.json"
    path.write_text(LEROBOT)
    assert calibration.load(path) == ARM
    assert list(calibration.load(path)) == ["shoulder_pan", "gripper"]
    again = tmp_path / "again.json"
    assert calibration.save(again, ARM) is None
    assert again.read_text() == LEROBOT
    assert ARM["shoulder_pan"].middle == 2050.0


def test_former_versions_are_kept_and_the_same_content_makes_none(tmp_path: Path) -> None:
    path = tmp_path / "arm.json"
    calibration.save(path, ARM)
    assert calibration.save(path, ARM) is None
    moved = {**ARM, "gripper": JointCalibration(6, 0, 1424, 2000, 3476)}
    assert calibration.save(path, moved) == tmp_path / "arm.json.1"
    assert calibration.save(path, ARM) == tmp_path / "arm.json.2"
    assert calibration.versions(path) == [tmp_path / "arm.json.1", tmp_path / "arm.json.2"]
    assert calibration.load(path) == calibration.load(tmp_path / "arm.json.1") == ARM
    assert calibration.load(tmp_path / "arm.json.2") == moved
    assert sorted(os.listdir(tmp_path)) == ["arm.json", "arm.json.1", "arm.json.2"]


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "arm.json"
    calibration.save(path, ARM)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(BadCalibration, match=r"arm\.json: cannot be written: No space left"):
        calibration.save(path, {"other": JointCalibration(1, 0, 0, 0, 1)})
    assert path.read_text() == LEROBOT
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]


def test_differences_are_told_joint_by_joint() -> None:
    other = {"gripper": JointCalibration(6, 0, 1424, 2000, 3476), "wrist": JointCalibration(5, 0, 0, 1, 2)}
    assert calibration.diff(ARM, other) == [
        "gripper: drive_mode 1 -> 0, range_min 2031 -> 2000",
        "shoulder_pan: only in the first file",
        "wrist: only in the second file",
    ]
    assert calibration.diff(ARM, ARM) == []


JOINT = {"id": 1, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "this is no JSON"),
        ("[" * 100_000, "this is no JSON"),
        ("[1]", "one entry per joint"),
        ('{"a": 1}', "joint 'a' lacks id, drive_mode"),
        (json.dumps({"a": {**JOINT, "id": 254}}), "joint 'a': id is 0..253, not 254"),
        (json.dumps({"a": {**JOINT, "id": True}}), "id is a whole number, not True"),
        (json.dumps({"a": {**JOINT, "range_min": 1.5}}), "range_min is a whole number"),
        (json.dumps({"a": {**JOINT, "drive_mode": 2}}), "drive_mode is 0 or 1, not 2"),
        (json.dumps({"a": {**JOINT, "range_min": 4095}}), "range_min 4095 is not below range_max 4095"),
        (json.dumps({"a": JOINT, "b": JOINT}), "a and b have the same id 1"),
        ('{"a": {}, "a": {}}', "'a' is there twice"),
        (json.dumps({"\ud800": JOINT}), r"joint '\ud800': a name is printable text"),
        (json.dumps({"a\x1b[2J\n": JOINT}), r"joint 'a\x1b[2J\n': a name is printable text"),
        (json.dumps({"": JOINT}), "joint '': a name is printable text"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "arm.json"
    path.write_text(content)
    with pytest.raises(BadCalibration) as caught:
        calibration.load(path)
    assert str(path) in str(caught.value) and words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_and_fields_of_a_later_lerobot(tmp_path: Path) -> None:
    with pytest.raises(BadCalibration, match="No such file"):
        calibration.load(tmp_path / "none.json")
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(BadCalibration, match="fifo"):
        calibration.load(tmp_path / "fifo")
    path = tmp_path / "arm.json"
    path.write_text(json.dumps({"a": {**JOINT, "unit": "step"}}))
    assert calibration.load(path) == {"a": JointCalibration(1, 0, 0, 0, 4095)}


def test_a_name_that_is_there_twice_is_found_among_many(tmp_path: Path) -> None:
    names = [f"joint{number}" for number in range(50_000)] + ["joint7"]
    (tmp_path / "many.json").write_text("{" + ", ".join(f'"{name}": 0' for name in names) + "}")
    with pytest.raises(BadCalibration, match="'joint7' is there twice"):
        calibration.load(tmp_path / "many.json")
