"""A kernel on a simulated clock behind the face of a socket, for programs that connect to a server."""

from __future__ import annotations

import select
import socket
import time
from collections import deque
from types import SimpleNamespace
from typing import Any

import pytest

from urbihw.cli import reach
from urbihw.client import connection, core
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.kernel import Kernel
from urbihw.kernel.facade import HostProcess
from urbihw.kernel.sched.clock import SimClock
from urbihw.robot import ROBOT_LIBRARY

SILENCE_S = 60.0
"""Seconds of the kernel for which a client waits for bytes."""
HERE = Where("here", 1)
NOBODY = Credentials(environment={})


class KernelSocket:
    """What ``socket.create_connection`` answers; time passes while somebody waits for bytes.

    One thread may send while another one receives.  ``interrupt``: raise KeyboardInterrupt when there is nothing more
    to come, as a user would press Ctrl-C.
    """

    def __init__(self, setup: str = "", *, quiet: bool = True, interrupt: bool = False) -> None:
        self.kernel = Kernel(SimClock(), process=HostProcess(shutdown=self.close), libraries=(ROBOT_LIBRARY,))
        self.sent = b""
        self._interrupt = interrupt
        self._waited = 0.0
        self._said = b""
        self._unread: deque[bytes] = deque()
        self.kernel.run_text(self.kernel.open_lobby(), setup, until=0.0)
        self.kernel.programs.quiet = quiet
        self.open()

    def open(self) -> KernelSocket:
        """A new connection."""
        self._lobby = self.kernel.open_lobby("127.0.0.1")
        self._lobby.on_quit = self._take
        self._unread.clear()
        self._open = True
        return self

    def monotonic(self) -> float:
        """The clock of the client: the real one, and the time for which it has waited in vain."""
        return time.monotonic() + self._waited

    def _take(self) -> None:
        self._said += self._lobby.output.take_bytes()

    def setsockopt(self, *arguments: object) -> None:
        pass

    def settimeout(self, seconds: float | None) -> None:
        pass

    def shutdown(self, how: int) -> None:
        pass

    def fileno(self) -> int:
        return 0

    def register(self, descriptor: int, events: int) -> None:
        """This is also its own ``select.poll()``."""

    def poll(self, milliseconds: float | None) -> bool:
        """Whether to call ``recv``, in which time passes."""
        return milliseconds != 0

    def sendall(self, data: bytes) -> None:
        if not self._open:
            raise BrokenPipeError
        self.sent += data
        self._unread.append(data)

    def recv(self, size: int) -> bytes:
        """What the server says within SILENCE_S of its own time."""
        end = self.kernel.clock.now() + SILENCE_S
        while self._open:
            while self._unread:
                self._lobby.feed(self._unread.popleft())
            deadline = self.kernel.run()
            self._take()
            if self._said or not self._lobby.connected:
                said, self._said = self._said, b""
                return said
            if deadline is None or deadline > end:
                if self._interrupt:
                    raise KeyboardInterrupt
                self._waited += SILENCE_S
                raise TimeoutError
            self.kernel.clock.idle(deadline)
        return b""

    def close(self) -> None:
        self._open = False



def serve(monkeypatch: pytest.MonkeyPatch, setup: str = "", **options: Any) -> KernelSocket:
    """A kernel in which ``setup`` was run, as the server of the connections made from then on."""
    made = KernelSocket(setup, **options)
    monkeypatch.setattr(socket, "create_connection", lambda address, timeout: made.open())
    monkeypatch.setattr(core, "monotonic", made.monotonic)
    monkeypatch.setattr(connection, "monotonic", made.monotonic)
    monkeypatch.setattr(connection, "select", SimpleNamespace(poll=lambda: made, POLLIN=select.POLLIN))
    monkeypatch.setattr(reach, "client_sockets", lambda number: [])
    return made
