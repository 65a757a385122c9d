"""A simulated robot in a process of its own: ``urbihw serve --fake``, and its console as an object of urbiscript."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.kernel.uobject import LOCK_INSTANCE, NotReady, UObject, reading, threaded

_START_TIMEOUT_S = 10.0
ANSWER_TIMEOUT_S: Final = 5.0
MAX_LINE_LENGTH: Final = 200
"""Characters of a line for the fake's console."""
SCENE_WORD: Final = "scene"
"""A word of the console of a simulated robot with a body in a simulated world: its state, or its model into a file."""
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


class FakeScene:
    """The simulated world of a simulated robot, as a source of ``worldView``: its console is asked for states."""

    def __init__(self, fake: Fake, file: Path, post: Callable[[Callable[[], None]], None], now: Callable[[], float]):
        """``file``: where the model is written; ``post`` runs a function in the kernel's thread, ``now`` is its time.
        """
        self._fake, self._file, self._post, self._now = fake, file, post, now
        self._over: threading.Event | None = None
        self._written = False

    def begin(self, period: float, show: Callable[[bytes, float], None]) -> None:
        self.end()
        self._over = over = threading.Event()
        threading.Thread(target=self._ask, args=(period, show, over), name="world", daemon=True).start()

    def end(self) -> None:
        if self._over is not None:
            self._over.set()
            self._over = None

    def model(self) -> Path:
        """See ``Source``: the console writes the file."""
        if not self._written:
            answer = self._fake.tell(f"{SCENE_WORD} {self._file}")
            if answer != "ok":
                raise ValueError(answer.removeprefix("error: "))
            self._written = True
        return self._file

    def remove(self) -> None:
        """Remove the file of the model."""
        with contextlib.suppress(OSError):
            self._file.unlink()

    def _ask(self, period: float, show: Callable[[bytes, float], None], over: threading.Event) -> None:
        """Ask for states until it is over; in a thread of its own."""
        due = time.monotonic()
        while not over.wait(max(0.0, due - time.monotonic())):
            due = max(due + period, time.monotonic())
            try:
                state = base64.b64decode(self._fake.tell(SCENE_WORD), validate=True)
            except ValueError:  # the simulated robot is busy, or has ended
                due += 1.0
                continue
            # One that the kernel has not taken yet is not followed by another.
            taken = threading.Event()
            self._post(lambda state=state, taken=taken: self._hand_over(state, show, over, taken))  # type: ignore[misc]
            while not taken.wait(1.0) and not over.is_set():
                pass

    def _hand_over(
        self, state: bytes, show: Callable[[bytes, float], None], over: threading.Event, taken: threading.Event
    ) -> None:
        taken.set()
        if not over.is_set():
            show(state, self._now())


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
