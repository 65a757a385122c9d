"""The urbiscript object of any range scanner: its slots, and its scans for the navigator.

The manual counts the readings from the left: the first one is at ``angleMax``, the last one at ``angleMin``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar, Final

from urbihw.kernel.uobject import UObject, event, finite_number, owned, reading, set_range
from urbihw.navigation.base import Echo, NavigationLog

FRESH_S: Final = 1.0
"""Seconds for which a scan is valid."""
_HALF: Final = math.pi / 2
_BESIDE: Final = 1e-9
"""Readings exactly to the side belong to the half plane ahead."""


class RangeScanner(UObject):
    """A scanner; ``load`` 1 connects to it, 0 disconnects.

    A platform derives its own class, whose name is that in urbiscript, and sets ``slot_name`` to its slot.

    Attributes:
        scanned: called after each scan.
        tell_lost: called with the reason when the scanner is lost, and with "" when it is back or switched off.
    """

    slot_name: ClassVar[str] = "laser"
    """Its slot in urbiscript, for messages."""

    slot_words = {
        "load": ("1 connects to the scanner, 0 disconnects", "1"),
        "val": ("distances, from angleMax at the left to angleMin; inf without an echo", "m"),
        "lastCaptureTimestamp": ("time of the scan", "s"),
        "laserDistanceMin": ("least distance that can be measured", "m"),
        "laserDistanceMax": ("greatest distance that can be measured", "m"),
        "rate": ("scans in a second", "Hz"),
        "state": ("off, connecting, on or lost", ""),
        "dirty": ("whether the front screen is dirty", ""),
        "model": ("model of the scanner", ""),
        "serial": ("serial number of the scanner", ""),
        "lost": ("event: the scanner sends nothing any more", ""),
        "back": ("event: the scanner sends again", ""),
    }

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

    log: NavigationLog
    """The log of the robot, which sets it."""

    def init(self, place: float) -> None:
        """``place`` is the distance in m from the middle of the base ahead to the scanner."""
        set_range(self.load, 0.0, 1.0)
        self.place = place
        self.wanted = False
        self.ranges: Sequence[float] = ()
        self.stamp = -math.inf
        self.scanned: Callable[[], None] = lambda: None
        self.tell_lost: Callable[[str], None] = lambda reason: None
        for name in ("Min", "Max"):
            self.variables["laserDistance" + name].add_slot(self.face, "distance" + name)
        self.notify_change(self.load, self._load_written)

    # ---------------------------------------------------------------- hooks

    def connect(self) -> None:
        """Start to scan.  Raises ValueError if that is impossible."""
        raise NotImplementedError

    def disconnect(self) -> None:
        """Stop scanning, without waiting for the end."""
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

    def _show_off(self, state: str, reason: str = "") -> None:
        self.load.sense(0.0)
        self.state.sense(state)
        self.rate.sense(0.0)
        self.ranges, self.stamp = (), -math.inf
        self.tell_lost(reason)

    def show_lost(self, reason: str) -> None:
        """The scanner does not answer (any more); its driver goes on trying."""
        if self.wanted and self.state.sensed != "lost":
            self.log.warning("laser: %s; trying again until it answers", reason)
            self._show_off("lost", reason)
            self.lost.emit(reason)

    def show_ended(self, reason: str) -> None:
        """The scanner is off, and its driver has ended: ``load`` must be written again."""
        if self.wanted:
            self.wanted = False
            self.log.warning("laser: off: %s", reason)
            self._show_off("off", reason)
            self.lost.emit(reason)

    # ---------------------------------------------------------------- what was measured

    def show_geometry(self, field: float, resolution: float, middle: float = 0.0) -> None:
        """Show the field of view about ``middle`` (to the left of straight ahead), and the step between two readings,
        in rad."""
        self.angleMin.sense(middle - field / 2)
        self.angleMax.sense(middle + field / 2)
        self.resolution.sense(resolution)

    def show_scan(self, ranges: Sequence[float], stamp: float, farthest: float) -> None:
        """Show a scan: distances in m from right to left, inf without an echo; ``farthest`` is the maximum range."""
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
            self.tell_lost("")
            self.state.sense("on")
        self.scanned()

    # ---------------------------------------------------------------- what the navigator asks

    def check_on(self) -> None:
        """Raise ValueError while the laser is off."""
        if not self.load.sensed:
            raise ValueError(f"localization by scans needs the laser; switch it on first: {self.slot_name}.load = 1")

    def nearest(self) -> float:
        """Distance in m from the scanner to the nearest obstacle in the half plane ahead; inf without a fresh scan."""
        return min((r for r, angle in self.fresh_echoes() if math.cos(angle) > -_BESIDE), default=math.inf)

    def fresh_echoes(self) -> list[Echo]:
        """Return the echoes of the last scan, none when it is older than FRESH_S."""
        return self.echoes() if self.is_fresh() else []

    def echoes(self) -> list[Echo]:
        """Return the finite readings of the last scan with their angles: (m, rad)."""
        first, step = self.angleMin.sensed, self.resolution.sensed
        return [(r, first + i * step) for i, r in enumerate(self.ranges) if math.isfinite(r)]

    def is_fresh(self) -> bool:
        """Return whether the last scan is at most FRESH_S old."""
        return self.host.now() - self.stamp <= FRESH_S
