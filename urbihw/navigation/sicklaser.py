"""A SICK laser on a serial line of its own, with a worker of its own that runs ``sickdriver``."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Final

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl, BadValue
from urbihw.kernel.uobject import reading
from urbihw.navigation.base import Worker
from urbihw.navigation.scanner import RangeScanner

FAMILY: Final = "urbihw.navigation.sickdriver:SickDriver"
_LARGEST_COUNT: Final = 0x1FF6
_TICKS: Final = 50.0
"""Ticks of the worker per second; the laser scans more slowly."""


class SickLaser(RangeScanner):
    """A SICK LMS200 or one of its kin."""

    laserDistanceMax = reading(_LARGEST_COUNT / 1000)

    def init(  # type: ignore[override]
        self, url: str, place: float, start_worker: Callable[..., Worker], offset: float
    ) -> None:
        """``url`` is the url of its line, "" for none; ``place`` is the distance in m from the middle of the base to
        the laser.

        ``offset`` is the kernel's time at time 0 of the workers.
        """
        super().init(place)
        self.url = url
        self._start_worker = start_worker
        self._offset = offset
        self._worker: Worker | None = None
        self._session = 0

    def connect(self) -> None:
        """Start a worker that reads the laser.  Raises ValueError for a url that no bus accepts."""
        settings = m.Configure(rate=_TICKS, dead_man=0.0)
        session = self._session = self._session + 1

        def post(message: m.FromWorker) -> None:
            """Called in the thread of the worker's handle; messages of a released worker are ignored."""
            self.host.post(lambda: self._heard(message) if session == self._session else None)

        try:
            self._worker = self._start_worker(self.url, post=post, settings=settings, family=FAMILY)
        except (BadUrl, BadValue) as error:
            raise ValueError(str(error)) from error

    def disconnect(self) -> None:
        """End the worker in a thread of its own: that may take a second, and the kernel does not wait."""
        self._session += 1
        worker, self._worker = self._worker, None
        if worker is not None:
            threading.Thread(target=worker.stop, name="end of the laser's worker", daemon=True).start()

    def close(self) -> None:
        """Stop the worker, and wait until it has ended."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.stop()

    def _heard(self, message: m.FromWorker) -> None:
        if isinstance(message, m.Samples):
            values = message.values["laser"]
            self.dirty.sense(bool(values["dirty"]))
            self.show_scan(values["ranges"], message.time + self._offset, values["unit"] * _LARGEST_COUNT)
        elif isinstance(message, m.Found):
            (info,) = message.devices
            self.show_geometry(math.radians(info.field), math.radians(info.resolution / 100))
        elif isinstance(message, m.LinkState | m.WorkerState) and message.reason:
            self.show_lost(message.reason)
        elif isinstance(message, m.Ended):
            self._worker = None
            self.show_ended(message.reason or "its worker ended")
