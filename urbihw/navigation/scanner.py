"""A range scanner as urbiscript sees it, whatever measures: its slots, and its scans for the navigator.

The manual counts the readings from the left: the first one is at ``angleMax``, the last one at ``angleMin``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar, Final

from urbihw.kernel.uobject import UObject, event, finite_number, owned, reading, set_range
from urbihw.navigation.base import Echo, Log

FRESH_S: Final = 1.0
"""Seconds for which a scan tells what is ahead."""
_HALF: Final = math.pi / 2


class RangeScanner(UObject):
    """A scanner; ``load`` 1 connects to it, 0 lets go of it.

    A platform derives its own class, which has the name that urbiscript knows, and says in ``slot_name`` where it is.
    """

    slot_name: ClassVar[str] = "laser"
    """How urbiscript reaches it, for messages."""

    load = owned(0.0)
    val = reading([])
    lastCaptureTimestamp = reading(0.0)
    angleMin = reading(-_HALF)
    angleMax = reading(_HALF)
    resolution = reading(math.radians(1))
    laserDistanceMin = reading(0.02)
    laserDistanceMax = reading(math.inf)
    rate = reading(0.0)
    state = reading("off")
    dirty = reading(False)
    lost = event()
    back = event()

    log: Log
    """Set by the robot."""

    def init(self, place: float) -> None:
        """``place`` is m from the middle of the base to the scanner, ahead."""
        set_range(self.load, 0.0, 1.0)
        self.place = place
        self.wanted = False
        self.ranges: Sequence[float] = ()
        self.stamp = -math.inf
        self.scanned: Callable[[], None] = lambda: None
        for name in ("Min", "Max"):
            self.variables["laserDistance" + name].put(self.face, "distance" + name)
        self.notify_change(self.load, self._load_written)

    # ---------------------------------------------------------------- hooks

    def connect(self) -> None:
        """Begin to scan.  Raises ValueError when that cannot be."""
        raise NotImplementedError

    def disconnect(self) -> None:
        """Scan no more; nobody waits for it."""
        raise NotImplementedError

    # ---------------------------------------------------------------- on and off

    def _load_written(self) -> None:
        wanted = finite_number(self.load.value) != 0
        if wanted == self.wanted:
            return
        if wanted:
            self.connect()
            self.state.sense("connecting")
        else:
            self.disconnect()
            self._show_off("off")
        self.wanted = wanted

    def _show_off(self, state: str) -> None:
        self.load.sense(0.0)
        self.state.sense(state)
        self.ranges, self.stamp = (), -math.inf

    def show_lost(self, reason: str) -> None:
        """The scanner does not answer (any more); what it is connected by goes on trying."""
        if self.wanted and self.state.sensed != "lost":
            self.log.warning("laser: %s; trying again until it answers", reason)
            self._show_off("lost")
            self.lost.emit(reason)

    def show_ended(self, reason: str) -> None:
        """The scanner is off, and nothing tries to reach it any more: ``load`` must be written again."""
        if self.wanted:
            self.wanted = False
            self.log.warning("laser: off: %s", reason)
            self._show_off("off")
            self.lost.emit(reason)

    # ---------------------------------------------------------------- what was measured

    def show_geometry(self, field: float, resolution: float) -> None:
        """The field of view, symmetric about straight ahead, and the step between two readings: rad."""
        self.angleMin.sense(-field / 2)
        self.angleMax.sense(field / 2)
        self.resolution.sense(resolution)

    def show_scan(self, ranges: Sequence[float], stamp: float, farthest: float) -> None:
        """A scan came: m from right to left, inf where nothing was hit; ``farthest`` is the most it can measure."""
        self.rate.sense(1 / (stamp - self.stamp) if stamp > self.stamp > -math.inf else 0.0)
        self.ranges, self.stamp = ranges, stamp
        self.laserDistanceMax.sense(farthest, stamp)
        self.val.sense(list(reversed(ranges)), stamp)
        self.lastCaptureTimestamp.sense(stamp, stamp)
        if not self.load.sensed:
            self.load.sense(1.0)
            if self.state.sensed == "lost":
                self.log.warning("laser: it is back")
                self.back.emit()
            self.state.sense("on")
        self.scanned()

    # ---------------------------------------------------------------- what the navigator asks

    def check_on(self) -> None:
        """See ``navigation.base.Scanner``."""
        if not self.load.sensed:
            raise ValueError(f"localization by scans needs the laser; switch it on first: {self.slot_name}.load = 1")

    def nearest(self) -> float:
        """m to the nearest thing ahead, in the path of the robot, from the scanner; inf without a fresh scan."""
        return min(self.ranges, default=math.inf) if self._is_fresh() else math.inf

    def fresh_echoes(self) -> list[Echo]:
        """See ``navigation.base.Scanner``."""
        return self.echoes() if self._is_fresh() else []

    def echoes(self) -> list[Echo]:
        """See ``navigation.base.Scanner``."""
        first, step = self.angleMin.sensed, self.resolution.sensed
        return [(r, first + i * step) for i, r in enumerate(self.ranges) if math.isfinite(r)]

    def _is_fresh(self) -> bool:
        return self.host.now() - self.stamp <= FRESH_S
