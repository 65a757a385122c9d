"""Who has a device open: an urbihw daemon differs from any other program."""

from __future__ import annotations

from pathlib import Path

import pytest

from urbihw.daemon.holders import daemon_of_file, holder_of_file


def process(proc: Path, number: int, parent: int, words: str, *files: Path) -> None:
    folder = proc / str(number)
    (folder / "fd").mkdir(parents=True)
    for index, file in enumerate(files):
        (folder / "fd" / str(index)).symlink_to(file)
    name = words.split()[0]
    (folder / "comm").write_text(f"{name}\n")
    (folder / "stat").write_text(f"{number} (a ) name) S {parent} 1 1 0\n")
    (folder / "cmdline").write_bytes(words.replace(" ", "\0").encode() + b"\0")


@pytest.mark.parametrize("worker", ["child", "spare"])
def test_the_daemon_behind_its_bus_worker_is_found(tmp_path: Path, worker: str) -> None:
    device, other = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1"
    device.touch()
    other.touch()
    proc = tmp_path / "proc"
    process(proc, 7, 1, "python3 -m urbihw_fakes bioloid", device)
    process(proc, 42, 40, f"python3 -m urbihw.buses.{worker} 9 servos {device}", device)
    process(proc, 50, 1, "minicom", other)
    assert daemon_of_file(str(device), proc) == 40
    assert holder_of_file(str(device), proc) == "an urbihw daemon (process 40)"
    assert daemon_of_file(str(other), proc) == 0
    assert holder_of_file(str(other), proc) == "minicom (process 50)"
    assert daemon_of_file(str(tmp_path / "none"), proc) == 0
