"""A kernel on a simulated clock behind the face of a socket, for programs that connect to a server."""

from __future__ import annotations

import socket
from collections import deque
from typing import Any

import pytest

from urbihw.cli import reach
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.kernel import Kernel
from urbihw.kernel.facade import HostProcess
from urbihw.kernel.sched.clock import SimClock

HERE = Where("here", 1)
NOBODY = Credentials(environment={})


class KernelSocket:
    """What ``socket.create_connection`` answers; time passes while somebody waits for bytes.

    One thread may send while another one receives.  ``interrupt``: raise KeyboardInterrupt when there is nothing more
    to come, as a user would press Ctrl-C.
    """

    def __init__(self, setup: str = "", *, quiet: bool = True, interrupt: bool = False) -> None:
        self.kernel = Kernel(SimClock(), process=HostProcess(shutdown=self.close))
        self.sent = b""
        self._interrupt = interrupt
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

    def _take(self) -> None:
        self._said += self._lobby.output.take_bytes()

    def setsockopt(self, *arguments: object) -> None:
        pass

    def settimeout(self, seconds: float | None) -> None:
        pass

    def sendall(self, data: bytes) -> None:
        if not self._open:
            raise BrokenPipeError
        self.sent += data
        self._unread.append(data)

    def recv(self, size: int) -> bytes:
        """What the server says within a minute of its own time."""
        end = self.kernel.clock.now() + 60
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
                raise TimeoutError
            self.kernel.clock.idle(deadline)
        return b""

    def close(self) -> None:
        self._open = False



def serve(monkeypatch: pytest.MonkeyPatch, setup: str = "", **options: Any) -> KernelSocket:
    """A kernel in which ``setup`` was run, as the server of the connections made from then on."""
    made = KernelSocket(setup, **options)
    monkeypatch.setattr(socket, "create_connection", lambda address, timeout: made.open())
    monkeypatch.setattr(reach, "client_sockets", lambda number: [])
    return made
