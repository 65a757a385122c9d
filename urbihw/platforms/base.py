"""What every robot on one wire does with its worker: start it, give it signs of life, pass on what it says, end it.

A platform derives from ``WiredRobot``, names the family of its wire, and says what to do with what was found and
measured.  The worker's messages come in a thread of the handle and are posted into the kernel's thread; what devices
want is gathered in ``Wire`` and leaves once per scheduler round.  The sign of life is sent by the kernel's own timer:
it is the kernel whose death, or whose being stuck in a script, must stop the robot.

``motion`` is who may move the robot: a stop, from wherever it comes, advances its epoch, and what is older is dropped
by whoever holds it.  A platform says in ``on_halt`` what its own code still means to do.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, Final, Protocol

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.buses.supervisor import Supervisor
from urbihw.kernel.uobject import (
    BadConfig,
    DeviceError,
    Motion,
    NotReady,
    Opened,
    Robot,
    RobotSettings,
    event,
    function,
    owned,
    reading,
)
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.limits import DeviceLimits, LimitSettings
from urbihw.platforms.wire import Wire
from urbihw.settings import BadSetting

SAME_STOP: Final = 0.05
"""Seconds within which a second stop of a robot that was not moved since is the same one: no person is so quick."""
ALIVE: Final = 0.5
"""Seconds between signs of life."""
PATIENCE: Final = 2.0
"""Seconds to wait for the first reading of all devices."""
SILENCE: Final = 3.0
"""Seconds without a word of the worker after which it is not alive; statistics come every second."""


class Handle(Protocol):
    """What is needed of a worker."""

    def send(self, message: m.ToWorker) -> None:
        """Hand a message to the worker."""
        ...

    def stop(self) -> None:
        """Stop the robot and end the worker."""
        ...


Named = Callable[[str], str]
"""How the settings call a kind of limit of one device."""
LimitTable = Mapping[tuple[Any, str], m.Limit]


class Limited(Protocol):
    """A device that can have limits."""

    def limits_in_counts(self, limits: DeviceLimits, named: Named) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """What limits in SI units are in the raw counts of the device."""
        ...

    def was_limited(self, message: m.Limited) -> None:
        """A limit made something else of a target, of this device or another."""
        ...


class WiredRobot(Robot):
    """A robot on one wire.

    A subclass sets ``family`` and ``robot_name`` and implements ``status``, ``on_found``, ``on_samples`` and ``whole``;
    the other hooks do nothing by themselves.  It aims, writes and reads through ``wire``.
    """

    family: ClassVar[str]
    """What drives the wire: a row of ``urbihw.buses.driver.FAMILIES``, or "module:Class"."""
    robot_name: ClassVar[str]
    """What it is called in the log."""

    url = reading("")
    link = reading(False)
    rate = reading(0.0)
    busLoad = reading(0.0)
    statistics = reading()
    linkLost = event()
    linkBack = event()
    stopped = event()
    released = event()
    guarded = event()
    estop = owned(False)
    epoch = reading(0.0)
    stops = reading(0.0)

    start_worker: Callable[..., Handle] = staticmethod(Supervisor.start)
    """Makes a worker; tests put another one here."""
    bus_time: Callable[[], float] = staticmethod(time.monotonic)
    """The clock of the worker's time stamps."""

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        self.log = DeviceLog(logging.getLogger(f"urbihw.{self.robot_name}"), self.host.now, self._later)
        self.motion = Motion(self.host.world, self.robot_name, self._release)
        self.wire = Wire(self.tell, self.motion)
        self.limits = LimitSettings({}, {})
        self.offset = 0.0
        """Kernel's time = worker's time + offset, in seconds."""
        self._worker: Handle | None = None
        self._opened: Opened | None = None
        self._missed_link = False
        self._resume = True
        self._stop_asked_at = -math.inf
        self._unknown_limits: set[str] = set()
        self._has_told_limits = False
        self._heard_at = 0.0
        self.notify_change(self.estop, self._estop_written)

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """See ``Robot``.  The options go to the driver of the wire."""
        self._opened = opened
        self._heard_at = self.bus_time()
        self.offset = self.host.now() - self._heard_at
        self.url.sense(settings.url)
        self.motion.keep = settings.keep_motion
        self.limits = LimitSettings.of(settings.limits)
        self._resume = settings.resume
        try:
            self._worker = self.start_worker(
                settings.url, post=self._post, settings=_for_worker(settings), family=self.family,
                control=settings.control,
            )
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self.robot_name}: {error}") from error
        except BadUrl as error:
            raise BadConfig(str(error)) from error
        self.host.each_round(self.wire.flush)
        self.set_timer(ALIVE, self._say_alive)

    def configure(self, settings: RobotSettings) -> None:
        """See ``Robot``."""
        message, limits = _for_worker(settings), LimitSettings.of(settings.limits)
        try:
            driver_of(self.family).configure(message)
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self.robot_name}: {error}") from error
        self.motion.keep = settings.keep_motion
        self.limits = limits
        self._resume = settings.resume
        self.tell(message)
        self.send_limits()

    def close(self) -> None:
        """See ``Robot``."""
        worker, self._worker = self._worker, None
        self.motion.close()
        self.log.close()
        self.destroy()
        if worker is not None:
            worker.stop()

    def abandon(self) -> None:
        """See ``Robot``."""
        worker = self._worker
        if worker is not None:
            worker.stop()

    def alive(self) -> bool:
        """See ``Robot``: whether the worker was heard of lately, also with the link down."""
        return self.bus_time() - self._heard_at <= SILENCE

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def stop(self) -> None:
        """Stop now, as the safe stop of this robot is; what is begun afterwards moves it again.

        Statements that began before, and would move it later, end with an error.
        """
        self.halt_all(self.motion.asked())

    @function("checkMotion")
    def check_motion(self) -> None:
        """Raise the error of a statement that began before the last stop, if the running one did."""
        self.motion.check()

    def _estop_written(self) -> None:
        who = str(self.motion.origin())
        if not isinstance(self.estop.value, bool):
            raise ValueError("this slot takes true or false")
        # What is told to the worker arrives in order, so both count from here on.
        if self.estop.value:
            self._halted(f"emergency stop by {who}")
            self.motion.renew()
            self.motion.latched = who
            self.tell(m.EmergencyStop(who))
        else:
            self.motion.latched = ""
            self.tell(m.Release(who))
        self.estop.sense(self.estop.value)

    # ---------------------------------------------------------------- what a subclass calls

    def tell(self, message: m.ToWorker) -> None:
        """Hand a message to the worker, if there is one."""
        if self._worker is not None:
            try:
                self._worker.send(message)
            except LinkGone:
                # Its Ended is on the way and says why.
                pass

    def halt_all(self, reason: str) -> None:
        """Stop the robot; whoever asks for it, in the running job, may move it again."""
        now = self.host.now()
        if self.motion.at_rest and now - self._stop_asked_at < SAME_STOP:
            # A program that asks again and again: nothing was begun since.
            self.motion.renew()
            return
        self._stop_asked_at = now
        self._halted(reason)
        self.motion.renew()
        self.tell(m.Stop(self.motion.epoch, reason))

    def _halted(self, reason: str, epoch: int | None = None) -> None:
        """The robot is stopped: all motion of before is over."""
        self.motion.advance(reason, epoch)
        self.on_halt(reason)
        self._show_stops()

    def _show_stops(self) -> None:
        self.epoch.sense(float(self.motion.epoch))
        self.stops.sense(float(self.motion.stops))

    def _release(self, devices: tuple[Hashable, ...], reason: str) -> None:
        """A client is gone that moved some devices."""
        self.log.warning("%s: stopped: %s", _names(devices), reason)
        self.on_halt(reason, devices)
        self._show_stops()
        self.tell(m.Stop(self.motion.epoch, reason, devices))

    @property
    def opening(self) -> bool:
        """Whether the daemon still waits for the answer of ``open``."""
        return self._opened is not None

    def answer(self, error: DeviceError | None) -> None:
        """Answer ``open``; later calls do nothing."""
        opened, self._opened = self._opened, None
        if opened is not None:
            opened(error)

    def wait_for_readings(self) -> None:
        """Answer ``open`` when ``whole``, but do not wait for ever: a device may have died since it was found."""
        self._later(PATIENCE, lambda: self.answer(None))

    def _later(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        """Do something once; gives what takes that back."""
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            action()

        handle = self.set_timer(seconds, over)
        return lambda: self.remove_timer(handle)

    def send_limits(self) -> None:
        """Let the worker know of the limits; to be called when the devices are known, and when one has changed."""
        if not self.limits and not self._has_told_limits:
            return
        self._has_told_limits = bool(self.limits)
        table: dict[tuple[Any, str], m.Limit] = {}
        thresholds: list[m.Threshold] = []
        names: dict[str, None] = {}
        for name, device in self.limited_devices().items():
            names[name] = None
            limits, own = device.limits_in_counts(self.limits.device(name), partial(self.limits.named, name))
            table.update(limits)
            thresholds += own
        for name in self.limits.unknown(names):
            if name not in self._unknown_limits:
                self._unknown_limits.add(name)
                self.log.warning("limits.%s: there is no such device; there are: %s", name, ", ".join(names))
        self.tell(m.Limits(table, tuple(thresholds)))

    def rate_words(self) -> str:
        """The rate of the bus for ``status``, "" before it is known."""
        return f", {self.rate.sensed:.0f} Hz" if self.rate.sensed else ""

    # ---------------------------------------------------------------- hooks

    def limited_devices(self) -> Mapping[str, Limited]:
        """The devices that can have limits, by the names of their slots."""
        return {}

    def on_found(self, message: m.Found) -> None:
        """The devices that are there, when the link has come up: also each time when it comes back."""
        raise NotImplementedError

    def on_samples(self, message: m.Samples) -> None:
        """What was measured; add ``offset`` to its times."""
        raise NotImplementedError

    def whole(self) -> bool:
        """Whether all that is there has been measured once, so that clients may come in."""
        raise NotImplementedError

    def on_happened(self, message: m.Happened) -> None:
        """A device reported something."""

    def on_device_state(self, message: m.DeviceState) -> None:
        """A device was lost, or is back."""

    def on_link_down(self, reason: str) -> None:
        """The link is down: what is measured is stale from now on."""

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """All motion, or that of some devices, is over: end what the platform's own code still means to do."""

    def on_stopped(self, reason: str) -> None:
        """The worker brought the robot, or some devices, to a stop."""

    def on_limited(self, message: m.Limited) -> None:
        """A limit of the settings made something else of a target."""
        for device in self.limited_devices().values():
            device.was_limited(message)

    def on_guarded(self, message: m.Guarded) -> None:
        """A measured value went too far, or is back."""
        if message.holds and message.passed:
            self.motion.held[message.device] = message.name
        elif message.holds:
            self.motion.held.pop(message.device, None)
        what = "passed" if message.passed else "is back from"
        self.log.warning("%s: %s %s %s", message.device, message.item, what, message.name)
        self.guarded.emit(str(message.device), message.name, message.passed)

    def on_refused(self, message: m.Refused) -> None:
        """A target or watch made no sense, or may not be now."""
        self.log.warning("%s: %s: %s", message.device, message.item, message.reason)

    # ---------------------------------------------------------------- the worker

    def _post(self, message: m.FromWorker) -> None:
        """Called in the worker handle's thread."""
        self.host.post(lambda: self._heard(message))

    def _say_alive(self) -> None:
        self.tell(m.Alive())

    def _heard(self, message: m.FromWorker) -> None:
        if not isinstance(message, m.WorkerState | m.Ended):
            self._heard_at = self.bus_time()
        match message:
            case m.Samples():
                self.on_samples(message)
                if self._opened is not None and self.whole():
                    self.answer(None)
            case m.Reply():
                self.wire.replied(message)
            case m.Happened():
                self.on_happened(message)
            case m.Found():
                self.on_found(message)
            case m.DeviceState():
                if message.new == "lost" and not self._resume:
                    self._end_movements(message.device, f"it was lost: {message.reason}")
                self.on_device_state(message)
            case m.LinkState():
                self._link_state(message)
            case m.Statistics():
                self._statistics(message)
            case m.Refused():
                self.on_refused(message)
            case m.Stopped():
                self._stopped(message)
            case m.Latched():
                self._latched(message)
            case m.Limited():
                self.on_limited(message)
            case m.Guarded():
                self.on_guarded(message)
            case m.WorkerState():
                self._worker_state(message)
            case m.Ended():
                self._ended(message)
            case m.Pulse():
                pass

    def _end_movements(self, device: Hashable, reason: str) -> None:
        """What moves a device is over (``on_lost = "end"``)."""
        self.motion.end(device, reason)
        self.on_halt(reason, (device,))

    def _stopped(self, message: m.Stopped) -> None:
        if message.devices is None:
            self.log.info("%s stopped: %s", self.robot_name, message.reason)
        if message.devices is None and message.epoch > self.motion.epoch:
            self._halted(message.reason, message.epoch)
        self.on_stopped(message.reason)
        self.stopped.emit(message.reason)

    def _latched(self, message: m.Latched) -> None:
        self.motion.latched = message.reason
        self.estop.sense(bool(message.reason))
        if message.reason:
            self.log.warning("emergency stop by %s: nothing moves until it is released", message.reason)
        else:
            self.log.warning("emergency stop released by %s", message.who)
            self.released.emit(message.who)

    def _worker_state(self, message: m.WorkerState) -> None:
        """The worker hangs, or was replaced: what it was told is lost, and so is what it was asked."""
        if not message.reason:
            self.log.warning("the bus worker answers again")
            return
        self._halted(message.reason)
        self.wire.lost(message.reason)
        if self._opened is not None:
            self.log.warning("%s", message.reason)
            return
        self._link_state(m.LinkState(False, message.reason))

    def _statistics(self, message: m.Statistics) -> None:
        self.rate.sense(message.rate)
        self.busLoad.sense(message.load)
        self.statistics.sense(
            {"rate": message.rate, "late": message.late, "busLoad": message.load, "dropped": message.dropped}
            | {kind: float(count) for kind, count in message.errors.items()}
        )

    def _link_state(self, message: m.LinkState) -> None:
        if self._opened is not None and not message.up:
            self.answer(NotReady(message.reason))
            return
        if bool(self.link.sensed) == message.up:
            return
        self.link.sense(message.up)
        if message.up:
            if self._missed_link:
                self.log.warning("link to %s is back", self.url.sensed)
                self.linkBack.emit()
            return
        self._missed_link = True
        if not self._resume:
            self._halted(f"the link was lost: {message.reason}")
        self.log.warning("link lost: %s; trying again until it is back", message.reason)
        self.on_link_down(message.reason)
        self.linkLost.emit(message.reason)

    def _ended(self, message: m.Ended) -> None:
        if self._worker is None and not message.reason:
            return
        reason = message.reason or "the bus worker ended"
        if self._opened is not None:
            self.answer(NotReady(reason))
        else:
            self._worker = None
            self._link_state(m.LinkState(False, reason))


def _for_worker(settings: RobotSettings) -> m.Configure:
    return m.Configure(
        rate=settings.rate,
        dead_man=settings.dead_man,
        torque_off_on_stop=settings.torque_off_on_stop,
        resume=settings.resume,
        options=settings.options,
    )


def _names(devices: tuple[Hashable, ...]) -> str:
    return ", ".join(map(str, devices))
