"""The file of the last run's devices: what was written comes back, and nothing else is believed."""

from __future__ import annotations

import importlib
import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from urbihw.buses.driver import driver_of
from urbihw.buses.servos.device import DeviceInfo
from urbihw.files import BadFile
from urbihw.platforms import find, folders, load, remembered
from urbihw.platforms.base import WiredRobot

SERVO = DeviceInfo(3, 12, "AX-12A", "AX-12", 24, 1, "joint")
URL = "/dev/ttyUSB0"


def test_what_was_saved_comes_back_for_its_url_only(tmp_path: Path) -> None:
    file = tmp_path / "robots" / "toy.json"
    assert remembered.load(file, URL, DeviceInfo) == ()
    remembered.save(file, URL, [SERVO])
    assert remembered.load(file, URL, DeviceInfo) == (SERVO,)
    assert remembered.load(file, "/dev/ttyUSB1", DeviceInfo) == ()
    assert [each.name for each in file.parent.iterdir()] == ["toy.json"]


ROW = json.loads(json.dumps({each.name: getattr(SERVO, each.name) for each in fields(SERVO)}))


@pytest.mark.parametrize(
    "content",
    [
        b"", b"{", b"[]", b"\xff\xfe", b"[" * 100_000, b'{"url": "/dev/ttyUSB0"}', b" " * (remembered.MAX_BYTES + 1),
        {"url": URL, "devices": {}}, {"url": URL, "devices": [3]}, {"url": URL, "devices": [{}]},
        {"url": URL, "devices": [ROW | {"id": "3"}]}, {"url": URL, "devices": [ROW | {"id": True}]},
        {"url": URL, "devices": [ROW | {"id": 10**30}]}, {"url": URL, "devices": [ROW | {"more": 1}]},
        {"url": URL, "devices": [ROW | {"name": "x" * 5000}]}, {"url": URL, "devices": [ROW] * 1001},
    ],
)  # fmt: skip
def test_wrong_content_is_refused(tmp_path: Path, content: Any) -> None:
    file = tmp_path / "toy.json"
    file.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    with pytest.raises(remembered.BadMemory):
        remembered.load(file, URL, DeviceInfo)


@pytest.mark.parametrize("platform", [folder.name for folder in folders()])
def test_the_description_of_every_robot_comes_back(platform: str, tmp_path: Path) -> None:
    kind = load(find(platform))
    assert issubclass(kind, WiredRobot)
    described = driver_of(kind.family).device_info
    if described is None:
        pytest.skip("the next run has no use for its description")
    lab = importlib.import_module(f"{platform}_lab").Lab.ready()
    found = tuple(lab.robot.device_memory.found.values())
    remembered.save(tmp_path / "file", URL, found)
    assert found and remembered.load(tmp_path / "file", URL, described) == found


def test_a_fifo_in_its_place_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "toy.json")
    with pytest.raises(remembered.BadMemory, match="not a regular file"):
        remembered.load(tmp_path / "toy.json", URL, DeviceInfo)
    with pytest.raises(BadFile, match="not a regular file"):
        remembered.save(tmp_path / "toy.json", URL, [SERVO])
