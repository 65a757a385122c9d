"""A laser on a wire of its own, with a worker of its own that runs the driver of its model."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl, BadValue
from urbihw.frozen import frozen
from urbihw.kernel.uobject import reading
from urbihw.navigation.base import ScannerWorker
from urbihw.navigation.scanner import RangeScanner

MODELS: Final[dict[str, str]] = {
    "lms200": "urbihw.navigation.lasers.lms200driver:SickDriver",
    "rplidar": "urbihw.navigation.lasers.rplidardriver:RplidarDriver",
    "urg": "urbihw.navigation.lasers.scipdriver:ScipDriver",
    "lms1xx": "urbihw.navigation.lasers.coladriver:ColaDriver",
}
"""``laser_model`` in the settings -> the driver: SICK LMS2xx; Slamtec RPLIDAR; Hokuyo with SCIP 2; SICK LMS1xx, TiM."""
_TICKS: Final = 50.0
"""Ticks of the worker per second; the laser scans more slowly."""


@frozen
class Mount:
    """Which laser a base has, and where.

    Attributes:
        url: its line, "" for none.
        model: a row of MODELS.
        place: m from the middle of the base ahead to the laser.
        turn: rad to the left from the front of the base to the front of the laser.
    """

    url: str
    model: str = "lms200"
    place: float = 0.0
    turn: float = 0.0


class LineLaser(RangeScanner):
    """A laser of one of the MODELS; ``model`` and ``serial`` are what it tells of itself, once it is on."""

    laserDistanceMax = reading(0.0)
    model = reading("")
    serial = reading("")

    def init(self, mount: Mount, start_worker: Callable[..., ScannerWorker], offset: float) -> None:  # type: ignore[override]
        """``mount`` names the laser; ``offset`` is the kernel's time at time 0 of the workers."""
        super().init(mount.place)
        self.mount = mount
        self._start_worker = start_worker
        self._offset = offset
        self._worker: ScannerWorker | None = None
        self._session = 0

    def connect(self) -> None:
        """Start a worker that reads the laser.  Raises ValueError for a url that no bus accepts."""
        settings = m.Configure(rate=_TICKS, dead_man=0.0)
        session = self._session = self._session + 1

        def post(message: m.FromWorker) -> None:
            """Called in the thread of the worker's handle; messages of a released worker are ignored."""
            self.host.post(lambda: self._heard(message) if session == self._session else None)

        try:
            self._worker = self._start_worker(
                self.mount.url, post=post, settings=settings, family=MODELS[self.mount.model]
            )
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
        self._session += 1
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.stop()

    def _heard(self, message: m.FromWorker) -> None:
        if isinstance(message, m.Samples):
            values = message.values["laser"]
            self.dirty.sense(bool(values["dirty"]))
            self.show_scan(values["ranges"], message.time + self._offset, values["farthest"])
        elif isinstance(message, m.Found):
            (info,) = message.devices
            self.show_geometry(info.field, info.resolution, info.middle + self.mount.turn)
            self.laserDistanceMin.sense(info.nearest)
            self.model.sense(info.model)
            self.serial.sense(info.serial)
        elif isinstance(message, m.LinkState | m.WorkerState) and message.reason:
            self.show_lost(message.reason)
        elif isinstance(message, m.Ended):
            self._worker = None
            self.show_ended(message.reason or "its worker ended")
