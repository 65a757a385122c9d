"""A child of the daemon: started, started again when it ends, and ended.

It cannot outlive the daemon for long: it ends with its standard input, a socket, through which it sends signs of life.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import subprocess
import threading
from collections.abc import Sequence
from typing import Final

from urbihw.backoff import BackOff

log = logging.getLogger("urbihw.daemon")

EX_CONFIG: Final = 78
"""Exit code of a child with wrong settings: to start it again would not help."""
FIRST_PAUSE_S: Final = 1.0
MAX_PAUSE_S: Final = 30.0
STEADY_S: Final = 60.0
"""Seconds after which a child has run well, and the pauses begin anew."""
END_TIMEOUT_S: Final = 3.0
START_TIMEOUT_S: Final = 60.0
"""Seconds within which a child sends its first sign of life."""
SILENCE_TIMEOUT_S: Final = 4.0
"""Seconds without a sign of life after which a child is killed."""


class KeptChild:
    """Keeps a child running, in a thread.

    ``name`` is that of the child, and ``loss`` what is lost if it is killed, for the log. ``farewell`` is sent to it
    before its end, so that it can tell an order from the death of the daemon.
    """

    def __init__(self, command: Sequence[str], name: str, loss: str, farewell: bytes = b"") -> None:
        self._command = command
        self._name = name
        self._loss = loss
        self._farewell = farewell
        self._ending = threading.Event()
        self._child: subprocess.Popen[bytes] | None = None
        self._line: socket.socket | None = None
        self._thread = threading.Thread(target=self._keep, name=name, daemon=True)

    def start(self) -> None:
        """Start the child, and return at once."""
        self._thread.start()

    def close(self) -> None:
        """End the child.  A second call does nothing."""
        self._ending.set()
        child, line = self._child, self._line
        if line is not None:
            with contextlib.suppress(OSError):
                if self._farewell:
                    line.send(self._farewell, socket.MSG_DONTWAIT)
                line.shutdown(socket.SHUT_WR)
        self._thread.join(END_TIMEOUT_S)
        if child is not None and child.poll() is None:
            child.kill()
            self._thread.join(END_TIMEOUT_S)

    def _keep(self) -> None:
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while not self._ending.is_set():
            steady = threading.Timer(STEADY_S, pauses.reset)
            steady.daemon = True
            steady.start()
            code = self._run()
            steady.cancel()
            if self._ending.is_set():
                return
            if code == EX_CONFIG:
                log.error("the %s is not served (above): correct the settings, then start urbihw again", self._name)
                return
            pause = pauses.next_pause()
            log.error("the %s has ended (code %d); it is started again in %g s", self._name, code, pause)
            self._ending.wait(pause)

    def _run(self) -> int:
        """Run the child once; returns its exit code."""
        line, theirs = socket.socketpair()
        with line:
            # Ctrl-C must reach the daemon alone, which ends its children in order.
            with theirs:
                child = subprocess.Popen(self._command, stdin=theirs.fileno(), start_new_session=True)
            with child:
                self._child, self._line = child, line
                self._watch(child, line)
                return child.wait()

    def _watch(self, child: subprocess.Popen[bytes], line: socket.socket) -> None:
        """Read the signs of life until the child ends; kill one that is silent."""
        line.settimeout(START_TIMEOUT_S)
        try:
            while line.recv(4096):
                line.settimeout(SILENCE_TIMEOUT_S)
        except TimeoutError:
            if not self._ending.is_set():
                log.error("the %s has not answered for %g s: it is killed, and %s",
                          self._name, line.gettimeout(), self._loss)
            child.kill()
        except ConnectionError:
            pass  # it has ended
