"""What the programs say that reach no server, or another program than a server: one line, by which one can go on."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where

Serve = Callable[[bytes], Where]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Begin a program that answers each connection with some bytes, and then closes it; b"" for one that is silent."""
    listeners: list[socket.socket] = []

    def begin(words: bytes) -> Where:
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)

        def answer() -> None:
            try:
                with listener.accept()[0] as client:
                    client.recv(1000)
                    client.sendall(words)
                    client.shutdown(socket.SHUT_WR)
                    client.recv(1000)
            except OSError:
                return

        if words:
            threading.Thread(target=answer, daemon=True).start()
        return Where("127.0.0.1", listener.getsockname()[1])

    yield begin
    for listener in listeners:
        listener.close()


def refusal(where: Where, patience: float = 5.0) -> str:
    with pytest.raises(CliRefused) as caught, LobbyClient(where, Credentials(environment={})) as link:
        link.read_banner(patience)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", "'SSH-2.0-OpenSSH_9.2'"),
        (b"HTTP/1.1 400 Bad Request\r\n", "'HTTP/1.1 400 Bad Request'"),
        (b"\x1b[31m\xff\n", "'\\x1b[31m\\\\xff'"),
    ],
)
def test_another_program_is_quoted(serve: Serve, words: bytes, shown: str) -> None:
    where = serve(words)
    assert refusal(where) == f"{where}: it is no urbiscript server, it said: {shown}; is this its port?"


def test_a_program_that_says_nothing(serve: Serve) -> None:
    where = serve(b"")
    assert refusal(where, 0.2) == f"{where} said nothing within 0.2 s: is it busy, is it an urbiscript server?"


def test_a_socket_that_a_killed_daemon_left(tmp_path: Path) -> None:
    path = tmp_path / "urbi-54000.socket"
    assert refusal(Where(str(path), 54000)) == f"no server listens at {path}; start the server: urbihw serve"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
        left.listen()
    told = f"no server listens at {path} any more, and the file may go; start the server: urbihw serve"
    assert refusal(Where(str(path), 54000)) == told


def test_a_port_where_nobody_listens(serve: Serve) -> None:
    where = serve(b"")
    other = Where("127.0.0.1", where.port)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        other = Where("127.0.0.1", free.getsockname()[1])
    assert refusal(other).endswith("Connection refused; is the server running, is this its port?")
