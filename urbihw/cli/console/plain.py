"""The console in a pipe: what is read goes to the server, what the server says goes to standard output as it is.

It ends when all that was read is run: a question that is asked last is answered then.  How the server greets is left
out, and the last statement needs no ``;``.
"""

from __future__ import annotations

import os
import sys
import threading
from typing import BinaryIO, Final

from urbihw.cli.lines import Line
from urbihw.cli.link import Link
from urbihw.cli.options import EX_RUNTIME, EX_SYNTAX, EX_UNAVAILABLE, Refused
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.kernel.stages import Input

CHUNK: Final = 64 * 1024
SILENCE: Final = 2.0
"""Seconds without a word after which an input that ends within a statement counts as run."""


def talk(where: Where, who: Credentials, source: BinaryIO) -> int:
    """Send all of ``source``, show what comes.

    The exit code: 0, or 65 or 70 if the first error was one of syntax or one while running.  Raises Refused.
    """
    with Link(where, who) as link:
        link.greeting()
        return Talker(link, source).talk()


class Talker:
    """One conversation."""

    def __init__(self, link: Link, source: BinaryIO) -> None:
        self._link = link
        self._source = source
        self._end = f"__urbihw_end_{os.getpid()}"
        self._incomplete = False
        self._all_sent = False
        self._code = 0

    def talk(self) -> int:
        """Send and show, beside each other."""
        threading.Thread(target=self._send_all, daemon=True).start()
        while True:
            line = self._link.read(SILENCE)
            if line is not None and line.channel == self._end:
                return self._code
            if line is not None:
                self._show(line)
            elif self._link.ended and self._all_sent:
                # Somebody said quit or shutdown.
                return self._code
            elif self._link.ended:
                raise Refused(f"{self._link.peer} closed the connection", EX_UNAVAILABLE)
            elif self._incomplete:
                raise Refused("the input ends within a statement, which was not run", EX_SYNTAX)

    def _send_all(self) -> None:
        """Send the input to its end, and then ask for a sign that it is run."""
        watched = Input()
        # No more than there is: who writes to us may wait for an answer.
        while data := os.read(self._source.fileno(), CHUNK):
            watched.feed(data)
            self._link.send(data)
        watched.feed(b"\n;\n")
        self._all_sent = True
        self._link.send(f'\n;\nChannel.new("{self._end}") << 1|;\n'.encode())
        self._incomplete = watched.ends_within()

    def _show(self, line: Line) -> None:
        if line.is_error and line.channel == "error" and not self._code:
            self._code = EX_SYNTAX if b": syntax error: " in line.text else EX_RUNTIME
        sys.stdout.buffer.write(line.raw + b"\n")
        sys.stdout.buffer.flush()
