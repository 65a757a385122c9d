"""Files that a user names: what is no regular file is refused, without waiting for it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from urbihw.files import BadFile, read_regular, write_regular


def test_a_fifo_and_an_endless_device_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("fifo", "zero"):
        with pytest.raises(BadFile, match=f"{name}: is not a regular file"):
            read_regular(tmp_path / name, 10)
        with pytest.raises(BadFile, match="is not a regular file"):
            write_regular(tmp_path / name, b"x")


def test_a_long_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "long").write_bytes(b"x" * 11)
    with pytest.raises(BadFile, match="longer than 10 bytes"):
        read_regular(tmp_path / "long", 10)
    assert read_regular(tmp_path / "long", 11).data == b"x" * 11


def test_a_file_is_written_as_a_whole_and_keeps_its_mode_and_its_link(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_bytes(b"old")
    file.chmod(0o640)
    link.symlink_to(file)
    write_regular(link, b"new")
    assert link.is_symlink() and file.read_bytes() == b"new" and file.stat().st_mode & 0o777 == 0o640
    assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "link"]


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for name in ("folder", "no/where", "a\0b", "/dev/full"):
        with pytest.raises(BadFile):
            write_regular(tmp_path / name, b"x")
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]
