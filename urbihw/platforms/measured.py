"""Devices whose values are old while the robot cannot be reached."""

from __future__ import annotations

from urbihw.kernel.uobject import UObject, reading
from urbihw.platforms.words import COMMON


class MeasuredDevice(UObject):
    """A device that shows measurements: ``stale`` is true before the first one and while the link is down."""

    slot_words = {"stale": COMMON["stale"]}

    stale = reading(True)
    _is_stale = True

    def mark_fresh(self) -> None:
        """A measurement has come; called with each."""
        if self._is_stale:
            self._is_stale = False
            self.stale.sense(False)

    def mark_stale(self) -> None:
        """The link is down."""
        self._is_stale = True
        self.stale.sense(True)
