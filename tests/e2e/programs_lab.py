"""Real processes for the tests of the programs: started, listened to with bounded patience, and ended."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import starts

TIMEOUT_S = 60.0

_CONTROL = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|[=>()][0-9A-Z]?|\][^\x07]*\x07)")
_WHERE_IS_THE_CURSOR = b"\x1b[6n"


def module(name: str, *arguments: str) -> tuple[str, ...]:
    """The command line of a program of urbihw."""
    return (sys.executable, "-m", f"urbihw.cli.{name}", *arguments)


def run(
    name: str, *arguments: str, stdin: str = "", cwd: Path | None = None, **environment: str
) -> tuple[int, str, str]:
    """A program that ends by itself: exit code, standard output, standard error."""
    done = starts.run(module(name, *arguments), input=stdin, capture_output=True, text=True, timeout=TIMEOUT_S,
                          cwd=cwd, env={**os.environ, **environment})
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


class Terminal:
    """A program at a terminal of its own; ``heard`` is what it shows, without control sequences."""

    def __init__(self, name: str, *arguments: str, cwd: Path | None = None, **environment: str) -> None:
        self._end, side = pty.openpty()
        fcntl.ioctl(side, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        first = termios.tcgetattr(side)
        self.process = starts.Forked(
            module(name, *arguments), stdin=side, stdout=side, stderr=side, cwd=cwd, start_new_session=True,
            env={**os.environ, "TERM": "xterm-256color", **environment},
        )
        # Kept open: a terminal without a holder has no settings.
        self._side = side
        self.at_first = first
        self.heard = ""

    def type(self, text: str) -> None:
        """Press keys."""
        os.write(self._end, text.encode())

    def settings(self) -> list[object]:
        """How the terminal treats keys."""
        return list(termios.tcgetattr(self._side))

    def interrupt(self) -> None:
        """Ctrl-C as a signal, for a program that leaves the terminal as it is."""
        self.process.send_signal(signal.SIGINT)

    def wait(self, pattern: str, seconds: float = TIMEOUT_S) -> str:
        """Wait until something is shown, and forget all up to it; what was forgotten."""
        end = time.monotonic() + seconds
        while (found := re.search(pattern, self.heard)) is None:
            assert time.monotonic() < end, f"{pattern!r} did not come, but: {self.heard}"
            self._listen(end - time.monotonic())
        seen, self.heard = self.heard[: found.end()], self.heard[found.end() :]
        return seen

    def listen(self, seconds: float) -> str:
        """What is shown within some time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._listen(left)
        return self.heard

    def _listen(self, seconds: float) -> None:
        ready, _, _ = select.select([self._end], [], [], max(0.0, min(seconds, 0.2)))
        if not ready:
            return
        try:
            data = os.read(self._end, 65536)
        except OSError:
            time.sleep(0.01)
            return
        if _WHERE_IS_THE_CURSOR in data:
            os.write(self._end, b"\x1b[1;1R")
        self.heard += _CONTROL.sub("", data.decode("utf-8", "replace")).replace("\r", "")

    def ended(self, seconds: float = TIMEOUT_S) -> int:
        """Wait for the end; the exit code."""
        end = time.monotonic() + seconds
        while self.process.poll() is None:
            assert time.monotonic() < end, f"it did not end, but: {self.heard}"
            self._listen(0.05)
        self.listen(0.05)
        return self.process.returncode

    def close(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait(TIMEOUT_S)
        os.close(self._side)
        os.close(self._end)


class Server:
    """``urbi`` on a free port, or on the one it is given."""

    def __init__(self, folder: Path, *arguments: str, port: int = 0, **environment: str) -> None:
        port_file = folder / "port"
        port_file.unlink(missing_ok=True)
        self.port_file = str(port_file)
        self._log = (folder / "log").open("w+")
        self.process = starts.Forked(
            module("urbi", "--quiet", f"--port={port}", f"--port-file={port_file}", *arguments),
            stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log, cwd=folder, env={**os.environ, **environment},
        )
        try:
            end = time.monotonic() + TIMEOUT_S
            while not (port_file.exists() and port_file.read_text().endswith("\n")):
                assert self.process.poll() is None and time.monotonic() < end, self.log()
                time.sleep(0.01)
        except BaseException:
            self.close()
            raise
        self.port = int(port_file.read_text())

    def log(self) -> str:
        """What it said on its console."""
        self._log.seek(0)
        return self._log.read()

    def close(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait(TIMEOUT_S)
        self._log.close()
