"""Sockets passed by the service manager, on real descriptors."""

from __future__ import annotations

import asyncio
import os
import socket
from pathlib import Path

import pytest

from urbihw.daemon.activation import passed_sockets
from urbihw.daemon.config import Config
from urbihw.daemon.service import DaemonService, StartError
from urbihw.kernel.uobject import BadConfig


def environment(count: int = 1, pid: int = 77) -> dict[str, str]:
    return {"LISTEN_PID": str(pid), "LISTEN_FDS": str(count), "LISTEN_FDNAMES": ":".join(["port"] * count), "HOME": "/"}


def test_the_passed_port_is_taken_and_the_variables_are_gone() -> None:
    listening = socket.create_server(("127.0.0.1", 0))
    port, first = listening.getsockname()[1], listening.detach()
    os.set_inheritable(first, True)
    variables = environment()
    (passed,) = passed_sockets(port, variables, pid=77, first=first)
    with passed:
        assert passed.getsockname() == ("127.0.0.1", port)
        assert not os.get_inheritable(first)
    assert variables == {"HOME": "/"}


@pytest.mark.parametrize("variables", [{}, environment(pid=78), {"LISTEN_PID": "77", "LISTEN_FDS": "x"}])
def test_what_is_meant_for_another_process_is_left_alone(variables: dict[str, str]) -> None:
    assert passed_sockets(54000, variables, pid=77) == []
    assert "LISTEN_PID" not in variables


def test_another_port_than_that_of_the_settings_is_a_mistake() -> None:
    listening = socket.create_server(("127.0.0.1", 0))
    port, first = listening.getsockname()[1], listening.detach()
    with pytest.raises(BadConfig, match=f"passes port {port}, but the settings say port 1:"):
        passed_sockets(1, environment(), pid=77, first=first)


def test_a_socket_of_another_kind_is_a_mistake(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "socket"))
        with pytest.raises(BadConfig, match="that is no TCP port"):
            passed_sockets(0, environment(), pid=77, first=os.dup(listening.fileno()))


def test_a_number_that_does_not_fit_names_the_variable() -> None:
    listening = socket.create_server(("127.0.0.1", 0))
    port, first = listening.getsockname()[1], listening.detach()
    read, write = os.pipe()
    try:
        with pytest.raises(BadConfig, match=f"LISTEN_FDS is 1, but descriptor {read} is no socket"):
            passed_sockets(port, environment(), pid=77, first=read)
        with pytest.raises(BadConfig, match=r"LISTEN_FDS is 1, but descriptor 99999 is no socket \(Bad file"):
            passed_sockets(port, environment(), pid=77, first=99_999)
    finally:
        for descriptor in (read, write, first):
            os.close(descriptor)


def test_a_socket_that_does_not_listen_is_a_mistake() -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        with pytest.raises(BadConfig, match="that does not listen"):
            passed_sockets(0, environment(), pid=77, first=os.dup(bound.fileno()))


def test_the_address_of_the_passed_port_decides_who_needs_a_token(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The settings name an address of this machine alone; others reach the passed one."""
    listening = socket.create_server(("0.0.0.0", 0))
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setattr("urbihw.daemon.service.passed_sockets", lambda port: [listening])

    async def serve() -> int:
        return await DaemonService(Config(platform="p3dx", port=listening.getsockname()[1])).run()

    with pytest.raises(StartError, match="there is no token yet"):
        asyncio.run(serve())
