"""The authority over motion in a bus worker: the motion epoch, and the latch of an emergency stop.

Every write that may move the robot carries the epoch in which it was made.  Each stop advances the epoch; writes of an
older epoch are refused from then on, from every sender.  An emergency stop also latches: until its release every write
that may move the robot is refused.  There is one latch for each user who has pressed an emergency stop, and the robot
is free when all are released.  They are stored in a file, one in a line (name, tab, user), so that a replacement worker
finds them.  A file that is there holds, whatever it contains and even if it cannot be read: the robot was not released.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Final

from urbihw.buses.latches import MOST, SHARED, UNKNOWN, plain_name, pressed, released

STALE: Final = "the robot was stopped after this was asked for"
MOST_HOLDERS: Final = 64
"""Users who may have a latch of their own; those after them share one."""
MOST_SHARING: Final = 1000
"""Users who share a latch and can release it; what those after them have pressed takes a release by name, or of all."""
_ABSENT: Final = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG})
"""Failures to open a file that cannot be there."""


class MotionAuthority:
    """Decides whether a write may move the robot.

    Attributes:
        epoch: the current motion epoch.
        holders: user -> name, of those who hold the robot by an emergency stop.
        unreadable: why the latch file could not be read, although it is there; "" if it could.
        unkept: why the latches that hold are not in their file, so that they end with this worker; "" if they are.
    """

    def __init__(self, epoch: int = 0, file: Path | None = None, holders: Iterable[tuple[str, str]] = ()) -> None:
        """``file`` stores the latches; with None they end with this worker.  ``holders`` hold the robot already."""
        self.epoch = epoch
        self._file = file
        self._sharing: set[str] = set()
        self.unreadable = self.unkept = ""
        kept = self._read_latches()
        self.holders = kept | dict(holders)
        # The worker before this one did not tell who shares a latch.
        self._has_unknown_sharers = SHARED in self.holders
        if self.holders != kept and not self.unreadable:
            self.keep_latches()

    @property
    def latched(self) -> str:
        """Who holds the robot by an emergency stop, in words; "" if it is free."""
        return " and ".join(self.holders.values())

    def advance(self, epoch: int | None = None) -> None:
        """Begin the next epoch after a stop, or ``epoch`` if the master has numbered it already."""
        # Never back: the worker may have stopped the robot by itself meanwhile, and that stop holds.
        self.epoch = self.epoch + 1 if epoch is None else max(self.epoch, epoch)

    def latch(self, who: str, user: str = UNKNOWN) -> None:
        """Refuse all motion until the release of this user; ``keep_latches`` writes the file, after the stop."""
        user = plain_name(user)
        if user not in self.holders and len(self.holders) >= MOST_HOLDERS:
            if len(self._sharing) < MOST_SHARING:
                self._sharing.add(user)
            elif user not in self._sharing:
                self._has_unknown_sharers = True
            user = SHARED
        self.holders = pressed(self.holders, who, user)

    def keep_latches(self) -> str:
        """Write the latches to their file, or remove it if there are none; return why that was not possible, or "".

        ``unkept`` tells from then on why those that hold are not kept.
        """
        if self.holders:
            self.unkept = self._write_latches()
            return self.unkept
        self.unkept = ""
        return self._remove_latches()

    def _write_latches(self) -> str:
        if self._file is None:
            return ""
        try:
            # Never blocking: a pipe in place of the file must not hold up the stop.
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK | os.O_CLOEXEC
            with os.fdopen(os.open(self._file, flags, 0o666), "wb") as file:
                file.write("".join(f"{who}\t{user}\n" for user, who in self.holders.items()).encode())
        except (OSError, ValueError) as error:
            return f"the emergency stop holds, but is not kept in {self._file}: {error}"
        return ""

    def _remove_latches(self) -> str:
        if self._file is None:
            return ""
        try:
            _remove(self._file)
        except OSError as error:
            why = error.strerror or error
            return f"released, but {self._file} cannot be removed ({why}), so it holds at the next start: remove it"
        return ""

    def release(self, user: str, others: Collection[str] = (), everyone: bool = False) -> tuple[str, ...]:
        """Release the latch of a user, and those of others, by user or name, or all; ``keep_latches`` comes next.

        Returns the names of those whose latches it was; none if somebody else holds the robot, or if none of the others
        does.  The latch that users share is free when all of them have released it; if some of them are not known, it
        takes a release by name, or of all.
        """
        before, self.holders = self.holders, released(self.holders, user, others, everyone)
        if plain_name(user) in self._sharing:
            self._sharing.remove(plain_name(user))
            if not self._sharing and not self._has_unknown_sharers:
                self.holders.pop(SHARED, None)
        if SHARED not in self.holders:
            self._sharing.clear()
            self._has_unknown_sharers = False
        return tuple(who for each, who in before.items() if each not in self.holders)

    def refusal(self, epoch: int) -> str:
        """Return why a write of this epoch may not move the robot, "" if it may."""
        if self.holders:
            return f"an emergency stop holds ({self.latched}): release it first"
        return STALE if epoch < self.epoch else ""

    def _read_latches(self) -> dict[str, str]:
        """Return the latches in the file: user -> name."""
        if self._file is None:
            return {}
        try:
            # Never blocking: it may be a pipe.
            with os.fdopen(os.open(self._file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
                data = file.read(8 * MOST * (MOST_HOLDERS + 1)) or b""
        except OSError as error:
            if error.errno in _ABSENT:
                return {}
            self.unreadable = self._explain_unreadable(error.strerror or str(error))
            return {UNKNOWN: "emergency stop"}
        text = data.decode("utf-8", "replace")
        if "\ufffd" in text:
            self.unreadable = self._explain_unreadable("it is not UTF-8 text")
        found = {}
        for row in text.splitlines()[-MOST_HOLDERS - 1 :]:
            who, _, user = row.partition("\t")
            found[plain_name(user)] = plain_name(who) or "emergency stop"
        return found or {UNKNOWN: "emergency stop"}

    def _explain_unreadable(self, why: str) -> str:
        return f"{self._file} cannot be read ({why}): an emergency stop holds, release it"


def _remove(file: Path) -> None:
    """Remove a latch file, or the folder that lies in its place if that is empty.  Raises OSError."""
    try:
        file.unlink(missing_ok=True)
    except IsADirectoryError:
        file.rmdir()
