"""The console in a pipe: the input goes to the server, the server's output goes to standard output unchanged.

It ends when all statements of the input have run, so the last one is answered, too.  The banner is omitted, and the
last statement needs no ``;``.
"""

from __future__ import annotations

import os
import sys
import threading
from typing import BinaryIO, Final

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused
from urbihw.client.credentials import Credentials
from urbihw.client.session import Message
from urbihw.client.where import Where
from urbihw.exitcodes import EX_RUNTIME, EX_SYNTAX, EX_UNAVAILABLE
from urbihw.kernel.stages import Input

CHUNK: Final = 64 * 1024
SILENCE_TIMEOUT_S: Final = 2.0
"""Seconds without output after which an input that ends within a statement counts as run."""
END_TIMEOUT_S: Final = 1.0
"""Seconds in which the end of the input is read after the server has closed: it may have been closed by the input."""


def run_session(where: Where, who: Credentials, source: BinaryIO) -> int:
    """Send all of ``source``, and print the output of the server.

    Returns the exit code: 0, or 65 or 70 if the first error was a syntax error or a run-time error.  Raises CliRefused.
    """
    with LobbyClient(where, who) as link:
        link.read_banner()
        return PipeSession(link, source).run()


class PipeSession:
    """One session of the console in a pipe."""

    def __init__(self, link: LobbyClient, source: BinaryIO) -> None:
        self._link = link
        self._source = source
        self._end = f"__urbihw_end_{os.getpid()}"
        self._incomplete = False
        self._all_sent = threading.Event()
        self._code = 0

    def run(self) -> int:
        """Send the input in a thread while the output is printed.  Returns the exit code."""
        threading.Thread(target=self._send_all, daemon=True).start()
        while True:
            line = self._link.read(SILENCE_TIMEOUT_S)
            if line is not None and line.channel == self._end:
                return self._code
            if line is not None:
                self._show(line)
            elif self._link.ended and self._all_sent.wait(END_TIMEOUT_S):
                # The input contained quit or shutdown.
                return self._code
            elif self._link.ended:
                raise CliRefused(f"{self._link.peer} closed the connection", EX_UNAVAILABLE)
            elif self._incomplete:
                raise CliRefused("the input ends within a statement, which was not run", EX_SYNTAX)

    def _send_all(self) -> None:
        """Send the input to its end, then a statement whose answer shows that the input has run."""
        watched = Input()
        # Read only what is available: the writer of the pipe may wait for an answer.
        while data := os.read(self._source.fileno(), CHUNK):
            watched.feed(data)
            self._link.send(data)
        watched.feed(b"\n;\n")
        self._all_sent.set()
        self._link.send(f'\n;\nChannel.new("{self._end}") << 1|;\n'.encode())
        self._incomplete = watched.ends_within()

    def _show(self, line: Message) -> None:
        if line.is_error and line.channel == "error" and not self._code:
            self._code = EX_SYNTAX if ": syntax error: " in line.text else EX_RUNTIME
        sys.stdout.buffer.write(line.raw + b"\n")
        sys.stdout.buffer.flush()
