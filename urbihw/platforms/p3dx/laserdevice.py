"""The laser as urbiscript sees it; it has a wire and a worker of its own, or comes with the robot's (MobileSim).

The manual counts the readings from the left: the first one is at ``angleMax``, the last one at ``angleMin``.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import Final

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl, BadValue
from urbihw.kernel.uobject import event, reading
from urbihw.platforms.base import Handle
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.p3dx.devices import Switch
from urbihw.platforms.p3dx.frames import Pose
from urbihw.platforms.p3dx.options import SIMULATED
from urbihw.platforms.p3dx.values import number

FAMILY: Final = "urbihw.platforms.p3dx.laserdriver:SickDriver"
HALF: Final = math.pi / 2
_NEAREST: Final = 0.02
_LARGEST_COUNT: Final = 0x1FF6
_SIM_FARTHEST: Final = 32.0
_RATE: Final = 50.0
_FRESH: Final = 1.0


class Laser(Switch):
    """A scanning laser; ``load`` 1 connects to it, 0 lets go of it."""

    uname = "P3dxLaser"

    val = reading([])
    lastCaptureTimestamp = reading(0.0)  # noqa: N815 - names of slots
    angleMin = reading(-HALF)  # noqa: N815
    angleMax = reading(HALF)  # noqa: N815
    resolution = reading(math.radians(1))
    laserDistanceMin = reading(_NEAREST)  # noqa: N815
    laserDistanceMax = reading(_LARGEST_COUNT / 1000)  # noqa: N815
    rate = reading(0.0)
    state = reading("off")
    dirty = reading(False)
    lost = event()
    back = event()

    log: DeviceLog
    """Set by the robot."""

    def init(  # type: ignore[override]
        self, url: str, place: float, start_worker: Callable[..., Handle], watch: Callable[[bool], None], offset: float
    ) -> None:
        """``url`` of its wire, "sim" or ""; ``place`` is m from the middle of the robot to the laser.

        ``watch`` switches the simulated one; ``offset`` is the kernel's time at time 0 of the workers.
        """
        super().init()
        self._url = url
        self.place = place
        self._start_worker = start_worker
        self._watch = watch
        self._offset = offset
        self._worker: Handle | None = None
        self._wanted = False
        self._session = 0
        self.scanned: Callable[[], None] = lambda: None
        self.ranges: Sequence[float] = ()
        self.stamp = -math.inf
        for name in ("Min", "Max"):
            self.variables["laserDistance" + name].put(self.face, "distance" + name)
        self.notify_change(self.load, self._load_written)

    # ---------------------------------------------------------------- on and off

    def _load_written(self) -> None:
        wanted = number(self.load) != 0
        if wanted == self._wanted:
            return
        if wanted and not self._url:
            raise ValueError("this robot was given no laser; add ?laser=/dev/ttyUSB1 to its url")
        if wanted:
            self._connect()
        else:
            self._let_go()
        self._wanted = wanted

    def _connect(self) -> None:
        self.state.sense("connecting")
        if self._url == SIMULATED:
            self._watch(True)
            return
        settings = m.Configure(rate=_RATE, dead_man=0.0)
        session = self._session = self._session + 1

        def post(message: m.FromWorker) -> None:
            """Called in the worker handle's thread; the last words of a worker that was let go count no more."""
            self.host.post(lambda: self._heard(message) if session == self._session else None)

        try:
            self._worker = self._start_worker(self._url, post=post, settings=settings, family=FAMILY)
        except (BadUrl, BadValue) as error:
            self.state.sense("off")
            raise ValueError(str(error)) from error

    def _let_go(self) -> None:
        self._session += 1
        worker, self._worker = self._worker, None
        if worker is not None:
            # Its end may take a second, for which nobody shall wait.
            threading.Thread(target=worker.stop, name="end of the laser's worker", daemon=True).start()
        elif self._url == SIMULATED:
            self._watch(False)
        self._show_off("off")

    def close(self) -> None:
        """Let go of the wire, and wait until that is done."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.stop()

    def _show_off(self, state: str) -> None:
        self.load.sense(0.0)
        self.state.sense(state)
        self.ranges, self.stamp = (), -math.inf

    # ---------------------------------------------------------------- what the worker says

    def _heard(self, message: m.FromWorker) -> None:
        if isinstance(message, m.Samples):
            values = message.values["laser"]
            self.dirty.sense(bool(values["dirty"]))
            self.take(values["ranges"], message.time + self._offset, values["unit"] * _LARGEST_COUNT)
        elif isinstance(message, m.Found):
            (info,) = message.devices
            self._show_geometry(math.radians(info.field), math.radians(info.resolution / 100))
        elif isinstance(message, m.LinkState | m.WorkerState) and message.reason:
            self.is_gone(message.reason)
        elif isinstance(message, m.Ended):
            self._worker, self._wanted = None, False
            self.is_gone(message.reason or "its worker ended")

    def is_gone(self, reason: str) -> None:
        """The laser does not answer (any more); its worker goes on trying."""
        if self._wanted and self.state.sensed != "lost":
            self.log.warning("laser: %s; trying again until it answers", reason)
            self._show_off("lost")
            self.lost.emit(reason)

    def _show_geometry(self, field: float, resolution: float) -> None:
        self.angleMin.sense(-field / 2)
        self.angleMax.sense(field / 2)
        self.resolution.sense(resolution)

    def take_simulated(self, millimetres: Sequence[int], stamp: float) -> None:
        """A scan of MobileSim's laser, whose step follows from the number of readings."""
        if self._wanted and len(millimetres) > 1:
            self._show_geometry(math.pi, math.pi / (len(millimetres) - 1))
            ranges = [value / 1000 if value < _SIM_FARTHEST * 1000 else math.inf for value in millimetres]
            self.take(ranges, stamp, _SIM_FARTHEST)

    def take(self, ranges: Sequence[float], stamp: float, farthest: float) -> None:
        """Take a scan, from right to left."""
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

    # ---------------------------------------------------------------- what others ask

    def nearest(self) -> float:
        """m to the nearest thing ahead, in the path of the robot, from the laser; inf without a fresh scan."""
        if self.host.now() - self.stamp > _FRESH:
            return math.inf
        return min(self.ranges, default=math.inf)

    def fresh_points(self) -> list[tuple[float, float]]:
        """The points of a scan of the last second."""
        return self.points() if self.host.now() - self.stamp <= _FRESH else []

    def points(self) -> list[tuple[float, float]]:
        """Where the readings ended, as (distance, angle) from the laser, those without an echo left out."""
        first, step = self.angleMin.sensed, self.resolution.sensed
        return [(r, first + i * step) for i, r in enumerate(self.ranges) if math.isfinite(r)]

    def pose(self, robot: Pose) -> Pose:
        """Where the laser is when the robot is somewhere."""
        x, y, heading = robot
        return (x + self.place * math.cos(heading), y + self.place * math.sin(heading), heading)


def laser_url(option: str, *, simulator: bool) -> str:
    """Which laser there is: what the options say, or that of the simulator; "" for none."""
    return option or (SIMULATED if simulator else "")
