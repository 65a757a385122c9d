"""The daemon under a service manager: a port that is passed to it, and what it reports at a reload."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0
PASS = """
import os, sys
os.dup2(int(sys.argv[1]), 3)
os.environ |= {"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": "1", "LISTEN_FDNAMES": "port"}
os.execv(sys.argv[2], sys.argv[2:])
"""
"""Does what systemd does: the socket becomes descriptor 3 of the process that the variables name."""


@contextlib.contextmanager
def daemon(config: Path, port: socket.socket, told: Path) -> Iterator[subprocess.Popen[bytes]]:
    words = (sys.executable, "-m", "urbihw.cli.main", "serve", "--config", str(config))
    environment = os.environ | {"NOTIFY_SOCKET": str(told), "RUNTIME_DIRECTORY": str(told.parent)}
    running = subprocess.Popen((sys.executable, "-c", PASS, str(port.fileno()), *words), env=environment,
                               pass_fds=(port.fileno(),), stdin=subprocess.DEVNULL)
    try:
        yield running
    finally:
        running.terminate()
        assert running.wait(TIMEOUT_S) == 0


def test_clients_wait_while_the_daemon_starts_anew_and_a_reload_is_reported(tmp_path: Path) -> None:
    told, config = tmp_path / "notify", tmp_path / "robot.toml"
    with (
        socket.create_server(("127.0.0.1", 0)) as port,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager,
    ):
        manager.bind(str(told))
        manager.settimeout(TIMEOUT_S)
        config.write_text(f'platform = "p3dx"\nfake = true\nport = {port.getsockname()[1]}\n')
        for _ in range(2):
            with socket.create_connection(port.getsockname(), TIMEOUT_S) as client:  # it is not accepted yet
                client.sendall(b"echo(6 * 7); quit;")
                with daemon(config, port, told) as running:
                    assert b"*** 42" in b"".join(iter(lambda: client.recv(4096), b""))
                    assert manager.recv(4096).startswith(b"READY=1")
                    running.send_signal(signal.SIGHUP)
                    heard = [manager.recv(4096)]
                    while not heard[-1].startswith(b"READY=1"):
                        heard.append(manager.recv(4096))
                    assert sum(one.startswith(b"RELOADING=1\nMONOTONIC_USEC=") for one in heard) == 1
            while not manager.recv(4096).startswith(b"STOPPING=1"):
                pass
