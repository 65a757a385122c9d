"""A simulated robot in a process of its own: ``urbihw serve --fake``, and its console as an object of urbiscript."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.kernel.uobject import LOCK_INSTANCE, NotReady, UObject, reading, threaded

_START_TIMEOUT_S = 10.0
ANSWER_TIMEOUT_S: Final = 5.0
MAX_LINE_LENGTH: Final = 200
"""Characters of a line for the fake's console."""
PACKAGE = "urbihw_fakes"
"""The package that ``python -m`` runs; it is never imported here."""


def _home_of_fakes() -> str:
    """The folder that contains the package of the fakes: the one of this package, or ``fakes`` in the source tree."""
    root = Path(__file__).resolve().parents[2]
    return str(root if (root / PACKAGE).is_dir() else root / "fakes")


class Fake:
    """A running ``python -m urbihw_fakes``.  It ends with its standard input, so it cannot outlive the daemon.

    Attributes: commands: the words of its console, a dictionary of name, parameters and meaning for each; known when
    ``url`` has returned.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        # It must be the fakes of this installation, wherever that was imported from.
        path = os.pathsep.join(filter(None, (_home_of_fakes(), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            (sys.executable, "-m", PACKAGE, *arguments, "--json"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env={**os.environ, "PYTHONPATH": path},
            # Ctrl-C must reach the daemon alone, which stops the robot first; a fake that has ended cannot be stopped.
            start_new_session=True,
        )
        self.commands: list[dict[str, str]] = []
        self._lock = threading.Lock()
        self._read = b""
        self._late = 0
        """The number of answers that came too late, and are still to come."""

    async def url(self) -> str:
        """The url of the simulated robot, once it serves.  Raises NotReady."""
        try:
            line = await asyncio.to_thread(self._read_line, _START_TIMEOUT_S)
            self.commands = json.loads(await asyncio.to_thread(self._read_line, _START_TIMEOUT_S))
        except TimeoutError:
            raise NotReady(f"the fake robot (process {self._process.pid}) did not start") from None
        except EOFError:
            raise NotReady("the fake robot did not start; its own message stands above") from None
        return line.strip()

    def tell(self, line: str) -> str:
        """Say a line to its console, in any thread; returns the answer.  Raises ValueError when there is none."""
        if len(line) > MAX_LINE_LENGTH or not line.isprintable():
            raise ValueError(f"one line of up to {MAX_LINE_LENGTH} characters expected")
        with self._lock:
            stdin = self._process.stdin
            assert stdin is not None
            try:
                stdin.write(line.encode() + b"\n")
                self._late += 1
                answer = ""
                while self._late:
                    answer = json.loads(self._read_line(ANSWER_TIMEOUT_S))
                    self._late -= 1
            except (OSError, ValueError, EOFError) as error:
                late = isinstance(error, TimeoutError)
                raise ValueError(f"the fake robot {'does not answer' if late else 'has ended'}") from error
        return answer

    def _read_line(self, timeout: float) -> str:
        """The next line of its output.  Raises TimeoutError, EOFError."""
        stdout = self._process.stdout
        assert stdout is not None
        end = time.monotonic() + timeout
        while b"\n" not in self._read:
            if not select.select((stdout,), (), (), max(end - time.monotonic(), 0.0))[0]:
                raise TimeoutError
            data = stdout.read(1 << 16)
            if not data:
                raise EOFError
            self._read += data
        line, _, self._read = self._read.partition(b"\n")
        return line.decode()

    def close(self) -> None:
        """End the process.  A second call does nothing."""
        process = self._process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            process.wait(1.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class FakeConsole(UObject):
    """The console of the simulated robot (``--fake``): faults, pushes, claps; what its standard input takes."""

    slot_words = {"commands": ("the words: name, parameters and meaning of each", "")}

    commands = reading([])

    def init(self, fake: Any = None) -> None:
        """Called by ``new``; programs cannot make another one."""
        if not isinstance(fake, Fake):
            raise ValueError("there is one console, fake: it belongs to the simulated robot")
        self._fake = fake
        self.commands.sense(fake.commands)

    @threaded(LOCK_INSTANCE)
    def tell(self, line: str) -> str:
        """tell(line): say a line to the simulated robot, such as "silence 6"; returns its answer."""
        return self._fake.tell(line)
