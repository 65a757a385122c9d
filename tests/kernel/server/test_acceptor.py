"""UNIX sockets bound by path, and what becomes of their files."""

from __future__ import annotations

import errno
import os
import socket
import stat
from pathlib import Path

import pytest

from urbihw.kernel.server.acceptor import bind_unix, release_socket


def test_the_file_of_a_socket_goes_with_it(tmp_path: Path) -> None:
    path = tmp_path / "urbi.socket"
    made = bind_unix(path, 0o600)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    release_socket(made)
    release_socket(made)
    assert not path.exists() and made.fileno() == -1


@pytest.mark.parametrize("kind", ["symlink", "file", "socket"])
def test_what_somebody_has_put_in_its_place_stays(tmp_path: Path, kind: str) -> None:
    path, other = tmp_path / "urbi.socket", tmp_path / "other"
    made = bind_unix(path)
    path.rename(tmp_path / "moved")  # keeps the inode in use
    other.write_text("not ours")
    if kind == "symlink":
        path.symlink_to(other)
    elif kind == "file":
        path.write_text("not ours")
    else:
        with socket.socket(socket.AF_UNIX) as neighbour:
            neighbour.bind(str(path))
    release_socket(made)
    assert os.path.lexists(path)
    assert other.read_text() == "not ours"


def test_a_link_to_the_very_socket_is_not_its_file(tmp_path: Path) -> None:
    path, moved = tmp_path / "urbi.socket", tmp_path / "moved"
    made = bind_unix(path)
    path.rename(moved)
    path.symlink_to(moved)
    release_socket(made)
    assert path.is_symlink() and moved.is_socket()


def test_a_relative_path_means_the_folder_of_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made = bind_unix(Path("urbi.socket"))
    monkeypatch.chdir("/")
    release_socket(made)
    assert not (tmp_path / "urbi.socket").exists()


def test_a_socket_that_was_left_is_replaced_and_one_in_use_is_not(tmp_path: Path) -> None:
    path = tmp_path / "urbi.socket"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    made = bind_unix(path)
    made.listen()
    with pytest.raises(OSError, match="somebody listens") as caught:
        bind_unix(path)
    assert caught.value.errno == errno.EADDRINUSE
    release_socket(made)
