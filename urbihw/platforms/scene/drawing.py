"""The pictures of a world, drawn by a process of their own while somebody wants them (``painter``)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Final

from urbihw.platforms.scene.painting import ViewPoint

WIDTH, HEIGHT = 480, 360
PERIOD_S: Final = 0.1
"""Seconds between the beginnings of two pictures, at least: to draw one takes as long as much physics."""
RETRY_S: Final = 5.0
"""Seconds until it is tried again to draw after a problem."""
_LONGEST_LINE: Final = 4096


class CannotDraw(Exception):
    """No picture came; the message is one line."""


class SceneDrawing:
    """Draws the newest state; one that comes while another is being drawn replaces one that waits."""

    def __init__(
        self,
        post: Callable[[Callable[[], None]], None],
        show: Callable[[bytes, float], None],
        tell: Callable[[str], None],
    ) -> None:
        """``post`` runs a function in the kernel's thread; there ``show`` gets each picture (a JPEG) and the time of
        its state, and ``tell`` why there are none: once, and "" when they come again."""
        self._post, self._show, self._tell = post, show, tell
        self._news = threading.Condition()
        self._job: tuple[Path, bytes, float, ViewPoint] | None = None
        self._wanted = False
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._problem = ""

    def start(self) -> None:
        """Be ready to draw."""
        with self._news:
            self._wanted = True
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="world view", daemon=True)
                self._thread.start()

    def stop(self) -> None:
        """Draw no more; the process ends."""
        with self._news:
            self._wanted = False
            self._job = None
            if self._process is not None:
                self._process.kill()
            self._news.notify()

    def offer(self, model: Path, state: bytes, time: float, view: ViewPoint) -> None:
        """Let this state be drawn next."""
        with self._news:
            if self._wanted:
                self._job = model, state, time, view
                self._news.notify()

    def _run(self) -> None:
        """Draw until no client wants pictures; in a thread of its own."""
        model: Path | None = None
        while (job := self._next()) is not None:
            due = monotonic() + PERIOD_S
            try:
                if self._process is None or job[0] != model:
                    self._end_process()
                    model = job[0]
                    self._begin_process(model)
                picture = self._draw(job[1], job[3])
            except CannotDraw as error:
                self._end_process()
                self._report(str(error))
                with self._news:
                    self._news.wait_for(lambda: not self._wanted, RETRY_S)
                continue
            self._report("")
            self._post(lambda picture=picture, time=job[2]: self._show(picture, time))  # type: ignore[misc]
            with self._news:
                self._news.wait_for(lambda: not self._wanted, max(0.0, due - monotonic()))
        self._end_process()

    def _next(self) -> tuple[Path, bytes, float, ViewPoint] | None:
        """Wait for something to draw; None at the end of the thread."""
        with self._news:
            self._news.wait_for(lambda: self._job is not None or not self._wanted)
            if not self._wanted:
                self._thread = None
                return None
            job, self._job = self._job, None
            return job

    def _begin_process(self, model: Path) -> None:
        root = str(Path(__file__).resolve().parents[3])
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        process = subprocess.Popen(
            (sys.executable, "-m", "urbihw.platforms.scene.painter", str(model), str(WIDTH), str(HEIGHT)),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path}, start_new_session=True,
        )  # fmt: skip
        with self._news:
            self._process = process
            if not self._wanted:
                process.kill()

    def _end_process(self) -> None:
        with self._news:
            process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def _draw(self, state: bytes, view: ViewPoint) -> bytes:
        """Ask the process for a picture.  Raises CannotDraw."""
        process = self._process
        assert process is not None and process.stdin is not None and process.stdout is not None
        head = json.dumps([view.azimuth, view.elevation, view.distance, view.target, len(state)])
        try:
            process.stdin.write(head.encode() + b"\n" + state)
            process.stdin.flush()
            kind, _, rest = process.stdout.readline(_LONGEST_LINE).decode().rstrip("\n").partition(" ")
            picture = process.stdout.read(int(rest)) if kind == "jpeg" else b""
        except (OSError, ValueError):
            kind, rest, picture = "", "", b""
        if picture:
            return picture
        raise CannotDraw(rest if kind == "problem" else "the process that draws has ended")

    def _report(self, problem: str) -> None:
        if problem != self._problem:
            self._problem = problem
            if self._wanted:  # else it was ended
                self._post(lambda: self._tell(problem))
