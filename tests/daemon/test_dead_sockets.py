"""Sockets that a killed daemon has left in the runtime folder are removed by the next start, and no others."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw.daemon.config import Config
from urbihw.daemon.dead_sockets import remove_dead_sockets
from urbihw.daemon.service import DaemonService, StartError


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder whose path is short enough for a socket."""
    with tempfile.TemporaryDirectory(prefix="uh") as made:
        yield Path(made)


def bound(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.bind(str(path))
    return made


def names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_only_sockets_without_a_process_are_removed(folder: Path) -> None:
    for name in ("urbi-54000.socket", "bioloid-54000.sock", "mine"):
        bound(folder / name).close()
    (folder / "file.sock").write_text("a file")
    (folder / "bioloid-54000.sock.estop").write_text("held")
    (folder / "link.sock").symlink_to(folder / "mine")
    with bound(folder / "urbi-54001.socket") as listening, bound(folder / "urbi-54002.socket") as starting:
        listening.listen()
        assert starting.fileno() >= 0
        remove_dead_sockets(folder)
        assert names(folder) == [
            "bioloid-54000.sock.estop", "file.sock", "link.sock", "mine", "urbi-54001.socket", "urbi-54002.socket",
        ]  # fmt: skip


def test_the_sockets_of_another_user_are_left(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bound(folder / "urbi-54000.socket").close()
    mine = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: mine + 1)
    remove_dead_sockets(folder)
    assert names(folder) == ["urbi-54000.socket"]


def test_a_folder_that_is_not_there_is_no_matter(folder: Path) -> None:
    remove_dead_sockets(folder / "none")


def test_a_start_removes_them(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    (folder / "urbihw").mkdir(mode=0o700)
    bound(folder / "urbihw" / "urbi-1.socket").close()
    bound(folder / "urbihw" / "nxt-1.sock").close()
    with contextlib.suppress(StartError):
        asyncio.run(DaemonService(Config(platform="bioloid", url="/dev/null", port=0)).run())
    assert names(folder / "urbihw") == []
