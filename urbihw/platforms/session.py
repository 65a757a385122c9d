"""The session of a robot with its bus worker: start, settings, heartbeats, statistics, end.

The heartbeat is sent by the kernel's own timer, since the robot must stop when the kernel dies or is blocked by a
script.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.kernel.uobject import BadConfig, DevicePart, RobotSettings, UObject, reading
from urbihw.settings import BadSetting

HEARTBEAT_PERIOD_S: Final = 0.5
"""Seconds between heartbeats to the worker, at most."""
MIN_HEARTBEAT_PERIOD_S: Final = 0.01
HEARTBEATS: Final = 4
"""Heartbeats that are sent while the worker waits for one before it stops the robot."""
SILENCE_TIMEOUT_S: Final = 3.0
"""Seconds without a message of the worker after which it is not alive; it sends statistics every second."""


class WorkerHandle(Protocol):
    """The interface of a worker's handle that a robot uses."""

    def send(self, message: m.ToWorker) -> None:
        """Send a message to the worker."""
        ...

    def stop(self) -> None:
        """Stop the robot and end the worker."""
        ...


class WorkerSession(DevicePart):
    """The session with the worker of one robot.

    Attributes:
        handle: of the worker; None before ``start`` and after its end.
    """

    rate = reading(0.0)
    busLoad = reading(0.0)
    statistics = reading()

    def __init__(self, device: UObject, name: str, family: str) -> None:
        """``name`` stands in messages about settings; ``family`` names the driver of the wire."""
        super().__init__(device)
        self._name = name
        self._family = family
        self.handle: WorkerHandle | None = None
        self._clock: Callable[[], float] = time.monotonic
        self._heard_at = 0.0
        self._heartbeat: int | None = None

    def start(
        self, start_worker: Callable[..., WorkerHandle], clock: Callable[[], float],
        post: Callable[[m.FromWorker], None], settings: RobotSettings, expected: tuple[m.ExpectedDevice, ...],
    ) -> None:
        """Start the worker; ``post`` is called in the thread of its handle.  Raises BadConfig."""  # fmt: skip
        self._clock = clock
        self._heard_at = clock()
        try:
            self.handle = start_worker(
                settings.url, post=post, settings=_for_worker(settings, expected), family=self._family,
                control=settings.control,
            )  # fmt: skip
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self._name}: {error}") from error
        except BadUrl as error:
            raise BadConfig(str(error)) from error
        self._begin_heartbeats(settings.dead_man)

    def check(self, settings: RobotSettings) -> None:
        """Raise BadConfig for settings that the driver does not accept."""
        try:
            driver_of(self._family).configure(_for_worker(settings, ()))
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self._name}: {error}") from error

    def configure(self, settings: RobotSettings, expected: tuple[m.ExpectedDevice, ...]) -> None:
        """Send new settings to the worker, and heartbeats as often as they want."""
        self.send(_for_worker(settings, expected))
        self._begin_heartbeats(settings.dead_man)

    def send(self, message: m.ToWorker) -> None:
        """Send a message to the worker, if there is one."""
        if self.handle is not None:
            try:
                self.handle.send(message)
            except LinkGone:
                # The worker has ended; its ``Ended`` message follows with the reason.
                pass

    def forget(self) -> WorkerHandle | None:
        """Forget the worker, which has ended or is to end; return its handle."""
        handle, self.handle = self.handle, None
        return handle

    def heard(self) -> None:
        """The worker has sent a message."""
        self._heard_at = self._clock()

    def alive(self) -> bool:
        """Return whether the worker has sent a message within SILENCE_TIMEOUT_S, even while the link is down."""
        return self._clock() - self._heard_at <= SILENCE_TIMEOUT_S

    def publish_statistics(self, message: m.Statistics) -> None:
        """Show the counters of the bus."""
        self.rate.sense(message.rate)
        self.busLoad.sense(message.load)
        self.statistics.sense(
            {"rate": message.rate, "late": message.late, "busLoad": message.load, "dropped": message.dropped}
            | {kind: float(count) for kind, count in message.errors.items()}
        )

    def rate_words(self) -> str:
        """Return the rate of the bus for ``status``, "" before it is known."""
        return f", {self.rate.sensed:.0f} Hz" if self.rate.sensed else ""

    def _begin_heartbeats(self, dead_man: float) -> None:
        """Send heartbeats from now on, several in the time after which the worker stops the robot."""
        if self._heartbeat is not None:
            self.device.remove_timer(self._heartbeat)
        period = min(HEARTBEAT_PERIOD_S, dead_man / HEARTBEATS) if dead_man else HEARTBEAT_PERIOD_S
        self._heartbeat = self.device.set_timer(max(period, MIN_HEARTBEAT_PERIOD_S), self._send_heartbeat)

    def _send_heartbeat(self) -> None:
        self.send(m.Heartbeat())


def _for_worker(settings: RobotSettings, expected: tuple[m.ExpectedDevice, ...]) -> m.Configure:
    return m.Configure(
        rate=settings.rate,
        dead_man=settings.dead_man,
        torque_off_on_stop=settings.torque_off_on_stop,
        resume=settings.resume,
        options=settings.options,
        realtime=settings.realtime,
        expected=expected,
    )
