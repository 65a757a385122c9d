"""What is kept from one start to the next: read only if no other user could have written it, and never without
bound."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import pytest

from urbihw.kernel.syntax import cache_folder
from urbihw.kernel.syntax.cache_folder import MAX_FILES, read_cached, write_cached


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The cache folder, with one file in it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache_folder._warn.cache_clear()
    write_cached("one", b"1")
    return tmp_path / "urbihw"


def test_what_was_written_is_read_and_private(folder: Path) -> None:
    assert read_cached("one") == b"1"
    assert read_cached("two") is None
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "one").stat().st_mode & 0o777 == 0o600
    write_cached("one", b"2")
    assert read_cached("one") == b"2"
    assert [path.name for path in folder.iterdir()] == ["one"]


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o1777])
def test_a_folder_that_others_can_write_is_not_read(folder: Path, mode: int, caplog: pytest.LogCaptureFixture) -> None:
    folder.chmod(mode)
    with caplog.at_level(logging.WARNING, "urbihw.kernel"):
        assert read_cached("one") is None
        assert read_cached("one") is None
    assert caplog.messages == [f"{folder} is not used, since others could have written it: remove it"]
    write_cached("one", b"2")  # it is the user's own, so it is made private
    assert read_cached("one") == b"2"


def test_a_file_that_others_can_write_is_not_read(folder: Path) -> None:
    (folder / "one").chmod(0o660)
    assert read_cached("one") is None
    write_cached("one", b"1")
    assert read_cached("one") == b"1"


@pytest.mark.parametrize("damage", ["cut", "one bit", "empty"])
def test_a_damaged_file_is_not_read(folder: Path, damage: str) -> None:
    write_cached("one", b"some code")
    whole = (folder / "one").read_bytes()
    cut = {"cut": whole[:-1], "one bit": whole[:-1] + bytes([whole[-1] ^ 1]), "empty": b""}[damage]
    (folder / "one").write_bytes(cut)
    assert read_cached("one") is None
    write_cached("one", b"some code")
    assert read_cached("one") == b"some code"


def test_a_fifo_and_a_huge_file_are_not_read(folder: Path) -> None:
    os.mkfifo(folder / "fifo", 0o600)
    assert read_cached("fifo") is None
    (folder / "huge").touch(0o600)
    os.truncate(folder / "huge", 1 << 40)
    assert read_cached("huge") is None


def test_a_link_is_not_followed(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").write_bytes(b"x")
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    assert read_cached("link") is None


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("given", [".", "one"])
def test_what_belongs_to_another_user_is_not_read(folder: Path, given: str) -> None:
    os.chown(folder / given, 12345, -1)
    assert read_cached("one") is None


def test_the_oldest_files_are_removed(folder: Path) -> None:
    for number in range(MAX_FILES - 1):
        (folder / f"old{number}").write_bytes(b"")
        os.utime(folder / f"old{number}", (1000.0 + number, 1000.0 + number))
    write_cached("last", b"3")
    left = {path.name for path in folder.iterdir()}
    assert len(left) == MAX_FILES + 1 - (MAX_FILES + 1) // 4
    assert {"one", "last", f"old{MAX_FILES - 2}"} <= left
    assert "old0" not in left
