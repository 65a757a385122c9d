"""``urbi`` in a process of its own, a client, and the neighbour of all that is done to the server."""

from __future__ import annotations

import contextlib
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import starts

TIMEOUT_S = 60.0
"""Seconds after which anything has failed; a busy machine may need some."""

CENSUS = "[Lobby.instances.size, System.jobs.size];"


def until(done: Callable[[], bool]) -> None:
    """Wait for something."""
    end = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.01)


class Client:
    """A connection whose answers are taken without their time stamps."""

    def __init__(self, port: int, receive: int | None = None) -> None:
        """``receive``: the size of the operating system's buffer for what comes in."""
        self.socket = socket.socket()
        if receive is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
        self.socket.settimeout(TIMEOUT_S)
        self.socket.connect(("127.0.0.1", port))

    def say(self, data: bytes) -> None:
        """Send something; a server that hung up in the middle of it may have done right."""
        try:
            self.socket.sendall(data)
        except ConnectionError:
            return

    def line(self) -> str:
        """The next line that comes, whole."""
        heard = b""
        while not heard.endswith(b"\n"):
            data = self.socket.recv(1)
            assert data, f"the server hung up after {heard!r}"
            heard += data
        return heard.decode("latin-1").partition("] ")[2].rstrip("\n")

    def ask(self, text: str) -> str:
        """The line that answers."""
        self.say(text.encode() + b"\n")
        return self.line()

    def rest(self) -> bytes:
        """What comes until the server closes the connection."""
        heard = b""
        try:
            while data := self.socket.recv(65536):
                heard += data
        except ConnectionError:
            pass
        return heard

    def close(self) -> None:
        self.socket.close()


class Server:
    """``urbi`` in a process of its own, and the neighbour of all that is done to it."""

    def __init__(self, folder: Path, *arguments: str, descriptors: int | None = None) -> None:
        """``descriptors``: how many the process may have."""
        port_file = folder / "port"
        self._log = (folder / "log").open("w+")
        command = (sys.executable, "-m", "urbihw.cli.urbi", "--quiet", "--port", "0", "--port-file", str(port_file))
        self.process = starts.Forked((*command, *arguments), stdin=subprocess.DEVNULL, stderr=self._log)
        if descriptors is not None:
            resource.prlimit(self.process.pid, resource.RLIMIT_NOFILE, (descriptors, descriptors))
        self._clients: list[Client] = []
        try:
            end = time.monotonic() + TIMEOUT_S
            while not (port_file.exists() and port_file.read_text().endswith("\n")):
                assert self.process.poll() is None and time.monotonic() < end, self.log()
                time.sleep(0.01)
            self.port = int(port_file.read_text())
            self.neighbour = self.client()
            self.at_rest = self.neighbour.ask(CENSUS)
        except BaseException:
            self.close()
            raise

    def client(self, receive: int | None = None) -> Client:
        """One more client; those that a test leaves open are closed behind it."""
        self._clients.append(Client(self.port, receive))
        return self._clients[-1]

    def hang_up(self) -> None:
        """Close all clients but the neighbour: a test that failed may have left some."""
        for client in self._clients:
            if client is not self.neighbour:
                client.close()
        self._clients = [self.neighbour]

    def wait(self, question: str, answer: str) -> None:
        """Ask until the answer is the right one."""
        end = time.monotonic() + TIMEOUT_S
        while (heard := self.neighbour.ask(question)) != answer:
            assert time.monotonic() < end, f"{question} is {heard}, not {answer}"
            time.sleep(0.02)

    def log(self) -> str:
        """What the server wrote to its log."""
        self._log.seek(0)
        return self._log.read()

    def resident(self) -> float:
        """Megabytes of memory that the server holds."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def close(self) -> None:
        for client in self._clients:
            client.close()
        self.process.kill()
        self.process.wait(TIMEOUT_S)
        self._log.close()


def served(folders: pytest.TempPathFactory) -> Iterator[Server]:
    """The fixture of a server for a whole module."""
    with contextlib.closing(Server(folders.mktemp("hostile"))) as server:
        yield server


def looked_after(server: Server) -> Iterator[Server]:
    """The fixture of a server for a test: afterwards it must be as it was, and have nothing to complain of itself."""
    try:
        yield server
    finally:
        server.hang_up()
    assert server.neighbour.ask("40 + 2;") == "42"
    server.wait(CENSUS, server.at_rest)
    assert "Traceback" not in server.log()
    assert "bug" not in server.log()
