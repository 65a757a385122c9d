"""The authority over motion in a bus worker: the motion epoch, and the latch of an emergency stop.

Every write that may move the robot carries the epoch in which it was made.  Each stop advances the epoch; writes of an
older epoch are refused from then on, whoever sends them.  An emergency stop also latches: until its release every write
that may move the robot is refused.  The latch is stored in a file, so that a replacement worker finds it.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Final

STALE: Final = "the robot was stopped after this was asked for"
_MOST: Final = 200


class MotionAuthority:
    """Decides whether a write may move the robot.

    Attributes:
        epoch: the current motion epoch.
        latched: the reason of the emergency stop that holds, "" if none does.
    """

    def __init__(self, epoch: int = 0, file: Path | None = None) -> None:
        """``file`` stores the latch; with None the latch ends with this worker."""
        self.epoch = epoch
        self._file = file
        self.latched = self._read_latch()

    def advance(self, epoch: int | None = None) -> None:
        """Begin the next epoch after a stop, or ``epoch`` if the master has numbered it already."""
        self.epoch = self.epoch + 1 if epoch is None else max(self.epoch, epoch)

    def latch(self, reason: str) -> str:
        """Refuse all motion until ``release``; return why the latch file could not be written, or ""."""
        self.latched = " ".join(reason.split())[:_MOST] or "emergency stop"
        if self._file is None:
            return ""
        try:
            self._file.write_text(self.latched + "\n", "utf-8")
        except (OSError, ValueError) as error:
            return f"the emergency stop holds, but is not kept in {self._file}: {error}"
        return ""

    def release(self) -> None:
        """Allow motion again and remove the latch file."""
        self.latched = ""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.unlink()

    def refusal(self, epoch: int) -> str:
        """Return why a write of this epoch may not move the robot, "" if it may."""
        if self.latched:
            return f"an emergency stop holds ({self.latched}): release it first"
        return STALE if epoch < self.epoch else ""

    def _read_latch(self) -> str:
        if self._file is None:
            return ""
        with contextlib.suppress(OSError, UnicodeDecodeError), self._file.open(encoding="utf-8") as file:
            return file.read(_MOST).strip() or "emergency stop"
        return ""
