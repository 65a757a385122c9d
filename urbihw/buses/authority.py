"""The authority over motion in a bus worker: the motion epoch, and the latch of an emergency stop.

Every write that may move the robot carries the epoch in which it was made.  Each stop advances the epoch; writes of an
older epoch are refused from then on, from every sender.  An emergency stop also latches: until its release every write
that may move the robot is refused.  The latch is stored in a file, so that a replacement worker finds it.  A file that
is there holds, whatever it contains and even if it cannot be read: the robot was not released.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Final

STALE: Final = "the robot was stopped after this was asked for"
_MOST: Final = 200
_ABSENT: Final = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG})
"""Failures to open a file that cannot be there."""


class MotionAuthority:
    """Decides whether a write may move the robot.

    Attributes:
        epoch: the current motion epoch.
        latched: the reason of the emergency stop that holds, "" if none does.
        unreadable: why the latch file could not be read, although it is there; "" if it could.
        unkept: why the latch that holds is not in its file, so that it ends with this worker; "" if it is.
    """

    def __init__(self, epoch: int = 0, file: Path | None = None) -> None:
        """``file`` stores the latch; with None the latch ends with this worker."""
        self.epoch = epoch
        self._file = file
        self.unreadable = self.unkept = ""
        self.latched = self._read_latch()

    def advance(self, epoch: int | None = None) -> None:
        """Begin the next epoch after a stop, or ``epoch`` if the master has numbered it already."""
        # Never back: the worker may have stopped the robot by itself meanwhile, and that stop holds.
        self.epoch = self.epoch + 1 if epoch is None else max(self.epoch, epoch)

    def latch(self, reason: str) -> None:
        """Refuse all motion until ``release``; ``keep_latch`` writes the file, after the stop."""
        self.latched = " ".join(reason.split())[:_MOST] or "emergency stop"

    def keep_latch(self) -> str:
        """Write the latch to its file; return why that was not possible, which ``unkept`` tells from then on, or ""."""
        self.unkept = self._write_latch()
        return self.unkept

    def _write_latch(self) -> str:
        if self._file is None:
            return ""
        try:
            # Never blocking: a pipe in place of the file must not hold up the stop.
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK | os.O_CLOEXEC
            with os.fdopen(os.open(self._file, flags, 0o666), "wb") as file:
                file.write(self.latched.encode() + b"\n")
        except (OSError, ValueError) as error:
            return f"the emergency stop holds, but is not kept in {self._file}: {error}"
        return ""

    def release(self) -> str:
        """Allow motion again and remove the latch file; return why it could not be removed, or ""."""
        self.latched = self.unkept = ""
        if self._file is None:
            return ""
        try:
            _remove(self._file)
        except OSError as error:
            why = error.strerror or error
            return f"released, but {self._file} cannot be removed ({why}), so it holds at the next start: remove it"
        return ""

    def refusal(self, epoch: int) -> str:
        """Return why a write of this epoch may not move the robot, "" if it may."""
        if self.latched:
            return f"an emergency stop holds ({self.latched}): release it first"
        return STALE if epoch < self.epoch else ""

    def _read_latch(self) -> str:
        """Return the reason in the latch file, "" if there is no file."""
        if self._file is None:
            return ""
        try:
            # Never blocking: it may be a pipe.
            with os.fdopen(os.open(self._file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
                data = file.read(4 * _MOST) or b""
        except OSError as error:
            if error.errno in _ABSENT:
                return ""
            self.unreadable = self._explain_unreadable(error.strerror or str(error))
            return "emergency stop"
        text = data.decode("utf-8", "replace")[:_MOST]
        if "\ufffd" in text:
            self.unreadable = self._explain_unreadable("it is not UTF-8 text")
        return " ".join("".join(each if each.isprintable() else " " for each in text).split()) or "emergency stop"

    def _explain_unreadable(self, why: str) -> str:
        return f"{self._file} cannot be read ({why}): an emergency stop holds, release it"


def _remove(file: Path) -> None:
    """Remove a latch file, or the folder that lies in its place if that is empty.  Raises OSError."""
    try:
        file.unlink(missing_ok=True)
    except IsADirectoryError:
        file.rmdir()
