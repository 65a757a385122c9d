"""The gateway for browsers (``urbihw.web``) as a child of the daemon: started, started again when it ends, and ended.

It is a process of its own, so that a held interpreter leaves the panel alive.  It cannot outlive the daemon: it ends
with its standard input.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Final

from urbihw.backoff import BackOff
from urbihw.daemon.config import Config
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig

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
"""Seconds without a sign of life after which a child is killed: what a browser has begun ends with its connection."""


def check_panel(config: Config) -> None:
    """Whether there can be a panel.  Raises BadConfig."""
    if find_spec("aiohttp") is None or find_spec("segno") is None:
        raise BadConfig(f"web: this needs a package: {install_command('web')}")


def panel_command(config: Config, server: str, control: str) -> list[str]:
    """The command line of the gateway of a daemon.  ``server`` is its address or socket, ``control`` the socket of the
    worker, "" for none."""
    command = [sys.executable, "-m", "urbihw.cli.main", "panel", server, "--child", "--host", config.panel_host,
               "--port", str(config.panel_port), "--platform", config.platform, "--speed", f"{config.panel_speed:g}"]
    if control:
        command += ["--control", control]
    if config.fake:
        command.append("--fake")
    if config.tls_cert:
        command += ["--tls-cert", config.tls_cert]
    if config.tls_key:
        command += ["--tls-key", config.tls_key]
    return command


class Panel:
    """Keeps the gateway running, in a thread."""

    def __init__(self, command: Sequence[str]) -> None:
        self._command = command
        self._ending = threading.Event()
        self._child: subprocess.Popen[bytes] | None = None
        self._line: socket.socket | None = None
        self._thread = threading.Thread(target=self._keep, name="panel", daemon=True)

    def start(self) -> None:
        """Start the gateway as a process of its own."""
        self._thread.start()

    def close(self) -> None:
        """End the gateway.  A second call does nothing."""
        self._ending.set()
        child, line = self._child, self._line
        if line is not None:
            with contextlib.suppress(OSError):
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
                log.error("the panel is not served (above): correct the settings, then start urbihw again")
                return
            pause = pauses.next_pause()
            log.error("the panel has ended (code %d); it is started again in %g s", code, pause)
            self._ending.wait(pause)

    def _run(self) -> int:
        """Run the gateway once; returns its exit code."""
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
                log.error("the panel has not answered for %g s: it is killed, and what its browsers move ends",
                          line.gettimeout())
            child.kill()
        except ConnectionError:
            pass  # it has ended
