"""Who may move the robot, as its bus worker sees it: the motion epoch, and the latch of an emergency stop.

Every write that may move the robot carries the epoch in which it was made.  Each stop advances the epoch, and what is
older is refused from then on, wherever it comes from.  An emergency stop also latches: until it is released, all that
may move the robot is refused.  The latch is kept in a file, so that a new worker finds it.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Final

STALE: Final = "the robot was stopped after this was asked for"
_MOST: Final = 200


class Authority:
    """The last word on motion.

    Attributes:
        epoch: of the robot's motion.
        latched: why an emergency stop holds, "" if none does.
    """

    def __init__(self, epoch: int = 0, file: Path | None = None) -> None:
        """``file`` keeps the latch, None for nowhere."""
        self.epoch = epoch
        self._file = file
        self.latched = self._kept()

    def advance(self, epoch: int | None = None) -> None:
        """The robot is stopped; ``epoch`` is what the master calls the time from now on."""
        self.epoch = self.epoch + 1 if epoch is None else max(self.epoch, epoch)

    def latch(self, reason: str) -> str:
        """Let nothing move the robot until ``release``; why the latch would not outlive this worker, or ""."""
        self.latched = " ".join(reason.split())[:_MOST] or "emergency stop"
        if self._file is None:
            return ""
        try:
            self._file.write_text(self.latched + "\n", "utf-8")
        except (OSError, ValueError) as error:
            return f"the emergency stop holds, but is not kept in {self._file}: {error}"
        return ""

    def release(self) -> None:
        """Let the robot be moved again."""
        self.latched = ""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.unlink()

    def refusal(self, epoch: int) -> str:
        """Why something written in an epoch may not move the robot; "" if it may."""
        if self.latched:
            return f"an emergency stop holds ({self.latched}): release it first"
        return STALE if epoch < self.epoch else ""

    def _kept(self) -> str:
        if self._file is None:
            return ""
        with contextlib.suppress(OSError, UnicodeDecodeError), self._file.open(encoding="utf-8") as file:
            return file.read(_MOST).strip() or "emergency stop"
        return ""
