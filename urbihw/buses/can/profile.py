"""The speed with which a drive goes to a position by itself: its object "profile velocity" (0x6081).

A limit of the settings bounds it, so that the firmware keeps the limit between two goals, too, and after the death of
the worker. The profile acceleration (0x6083) is left as it is: a drive without a profile deceleration (0x6084) brakes
with it, and a limit must not slow down a stop.
"""

from __future__ import annotations

import math
from typing import Protocol

from canopen import SdoAbortedError, SdoCommunicationError

from urbihw.buses.can import cia402 as c
from urbihw.buses.errors import BusTimeout


class ObjectAccess(Protocol):
    """A drive whose objects can be read and written."""

    def read_object(self, index: int, sub: int) -> int:
        """Return an object of the drive. Raises SdoAbortedError, SdoCommunicationError."""
        ...

    def write_object(self, index: int, sub: int, value: int) -> None:
        """Write an object of the drive; raises the same."""
        ...


class ProfileSpeed:
    """The profile velocity of one drive.

    Attributes:
        problem: why the drive does not keep the limit on its way to a position; "" if it does.
    """

    def __init__(self, drive: ObjectAccess) -> None:
        """Read the value that the drive has. Raises SdoCommunicationError."""
        self.problem = ""
        self._drive = drive
        self._own: float = math.inf
        try:
            # Some drives take 0 as "no limit".
            self._own = drive.read_object(c.PROFILE_SPEED, 0) or math.inf
        except SdoAbortedError:
            # The limit is written all the same: if the drive has no such object, `problem` will tell it.
            pass
        self._written: float = self._own

    def bound(self, most: float) -> bool:
        """Set the drive's own value, or `most` (increments/s) if that is less; return whether something was written."""
        wanted = max(1.0, min(self._own, most))
        if wanted == self._written or math.isinf(wanted):
            self.problem = ""
            return False
        try:
            self._drive.write_object(c.PROFILE_SPEED, 0, int(wanted))
        except (SdoAbortedError, SdoCommunicationError, BusTimeout) as error:
            self._written = math.nan
            told = f"the drive does not take the limit of its speed (object 6081): {error}"
            self.problem = told if most < self._own else ""
            return True
        self._written, self.problem = wanted, ""
        return True
