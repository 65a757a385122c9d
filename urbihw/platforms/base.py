"""The base of robots on one wire: start the worker, send it heartbeats, dispatch its messages, end it.

A platform derives from ``WiredRobot``, names the family of its wire, and handles the devices found and the values
measured.  The worker's messages arrive in a thread of the handle and are posted into the kernel's thread; the writes of
devices are gathered in ``DeviceChannel`` and sent once per scheduler round.  The heartbeat is sent by the kernel's own
timer, since the robot must stop when the kernel dies or is blocked by a script.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, Final, Protocol

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.buses.supervisor import Supervisor
from urbihw.kernel.uobject import (
    BadConfig,
    DeviceError,
    NotReady,
    Opened,
    RobotSettings,
    event,
    reading,
)
from urbihw.platforms.arrival import Arrival, Stage
from urbihw.platforms.expected import for_worker
from urbihw.platforms.guarded import GuardedRobot
from urbihw.platforms.limits import LimitSettings
from urbihw.platforms.remembered import DeviceMemory
from urbihw.platforms.words import ROBOT
from urbihw.settings import BadSetting

HEARTBEAT_PERIOD_S: Final = 0.5
"""Seconds between heartbeats to the worker, at most."""
MIN_HEARTBEAT_PERIOD_S: Final = 0.01
HEARTBEATS: Final = 4
"""Heartbeats that are sent while the worker waits for one before it stops the robot."""
FIRST_READING_TIMEOUT_S: Final = 2.0
"""Seconds to wait for the first reading of all devices before ``open`` is answered."""
SILENCE_TIMEOUT_S: Final = 3.0
"""Seconds without a message of the worker after which it is not alive; it sends statistics every second."""

_ABSENT: Final = """\
{{
  if (!Global.hasLocalSlot("robot")) Global.setSlot("robot", Component.new("robot"))
  | robot.shareLink({slot})
  | if (!robot.hasLocalSlot("stop")) robot.setSlot("stop", function () {{ {slot}.stop }})
}};
"""
"""The object ``robot`` of a robot of which nothing is known yet; its tree takes the place of it."""

LINK_DOWN: Final = "the link to the robot is down"
"""Explains why a robot does not obey."""


class WorkerHandle(Protocol):
    """The interface of a worker's handle that a robot uses."""

    def send(self, message: m.ToWorker) -> None:
        """Send a message to the worker."""
        ...

    def stop(self) -> None:
        """Stop the robot and end the worker."""
        ...


class WiredRobot(GuardedRobot):
    """A robot on one wire.

    A subclass sets ``family`` and ``robot_name`` and implements ``status``, ``on_found``, ``on_samples`` and
    ``is_complete``; the other hooks do nothing by default.  It writes and reads through ``channel``.
    """

    slot_words = ROBOT

    family: ClassVar[str]
    """The driver of the wire: a row of ``urbihw.buses.driver.FAMILIES``, or "module:Class"."""

    url = reading("")
    link = reading(False)
    rate = reading(0.0)
    busLoad = reading(0.0)
    statistics = reading()
    problems = reading([])
    linkLost = event()
    linkBack = event()

    start_worker: Callable[..., WorkerHandle] = staticmethod(Supervisor.start)
    """Starts a worker; replaced in tests."""
    bus_time: Callable[[], float] = staticmethod(time.monotonic)
    """The clock of the worker's time stamps."""

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.motion.set_absent(None, LINK_DOWN)
        self.offset = 0.0
        """Kernel's time = worker's time + offset, in seconds."""
        self._worker: WorkerHandle | None = None
        self._arrival = Arrival(self)
        self.expected: tuple[m.ExpectedDevice, ...] = ()
        """The devices that the settings expect; their names are those of the start."""
        self.device_memory = DeviceMemory(driver_of(self.family).device_info, self.log.warning)
        self._had_link_loss = False
        self._resume = True
        self._heard_at = 0.0
        self._heartbeat: int | None = None
        self._differences: list[str] = []
        self._lost_parts: dict[str, str] = {}

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the worker; ``opened`` is called when the devices have been read.  The options go to the driver."""
        self._arrival.begin(opened)
        self._heard_at = self.bus_time()
        self.offset = self.host.now() - self._heard_at
        self.url.sense(settings.url)
        self.expected = for_worker(settings.devices)
        self.device_memory.use(settings.memory, settings.url)
        self.identify()
        self.show_address(settings.url)
        self.motion.keep = settings.keep_motion
        self.limits = LimitSettings.of(settings.limits)
        self._resume = settings.resume
        try:
            self._worker = self.start_worker(
                settings.url, post=self._post, settings=replace(_for_worker(settings), expected=self.expected),
                family=self.family, control=settings.control,
            )
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self.robot_name}: {error}") from error
        except BadUrl as error:
            raise BadConfig(str(error)) from error
        self.host.each_round(self.channel.flush)
        self._begin_heartbeats(settings.dead_man)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings and limits.  Raises BadConfig."""
        message, limits = replace(_for_worker(settings), expected=self.expected), LimitSettings.of(settings.limits)
        try:
            driver_of(self.family).configure(message)
        except (BadValue, BadSetting) as error:
            raise BadConfig(f"{self.robot_name}: {error}") from error
        self.motion.keep = settings.keep_motion
        self.limits = limits
        self._resume = settings.resume
        self.send_message(message)
        self._begin_heartbeats(settings.dead_man)
        self.send_limits()

    def close(self) -> None:
        """Stop the robot, end the worker, and destroy the objects."""
        worker, self._worker = self._worker, None
        self.motion.close()
        self.log.close()
        self.destroy()
        if worker is not None:
            worker.stop()

    def abandon(self) -> None:
        """Stop the robot and end the worker, without touching the kernel."""
        worker = self._worker
        if worker is not None:
            worker.stop()

    def alive(self) -> bool:
        """Return whether the worker has sent a message within SILENCE_TIMEOUT_S, even while the link is down."""
        return self.bus_time() - self._heard_at <= SILENCE_TIMEOUT_S

    # ---------------------------------------------------------------- what a subclass calls

    def send_message(self, message: m.ToWorker) -> None:
        """Send a message to the worker, if there is one."""
        if self._worker is not None:
            try:
                self._worker.send(message)
            except LinkGone:
                # The worker has ended; its ``Ended`` message follows with the reason.
                pass

    @property
    def opening(self) -> bool:
        """Whether the robot has not been there yet since ``open``."""
        return self._arrival.stage is not Stage.HERE

    @property
    def tree_begun(self) -> bool:
        return self._arrival.tree_begun

    def waits_for(self) -> str:
        return self._arrival.awaited

    def answer_open(self, error: DeviceError | None) -> None:
        """Answer ``open``: NotReady once while the robot is absent, None once when it is there, with its slots.

        An arrival after a NotReady emits ``linkBack``.
        """
        self._arrival.answer(error)

    def has_link(self) -> bool:
        return bool(self.link.sensed)

    def show_stand_in(self, shown: Callable[[], None]) -> None:
        def over(problem: str) -> None:
            if problem:
                self.log.error("the slots of the absent robot are not there: %s", problem)
            shown()

        self.host.run(_ABSENT.format(slot=self.unique_name), "absent", over)

    def on_arrival(self) -> None:
        self.linkBack.emit()

    def wait_for_readings(self) -> None:
        """Answer ``open`` when ``is_complete``, or after a time-out: a device may have died since it was found."""
        if self.link.sensed:
            self.call_later(FIRST_READING_TIMEOUT_S, lambda: self.answer_open(None))
        else:
            self.answer_open(None)

    def show_problems(self) -> None:
        """Show what differs from the expected devices, which devices and parts cannot be used, and which programs wait
        for ``rearm``."""
        parts = [f"{name}: {reason}" for name, reason in self._lost_parts.items()]
        waiting = [each for each in (self.motion.explain_unarmed(),) if each]
        self.problems.sense([*waiting, *self._differences, *self.unusable_devices(), *parts])

    def show_part(self, name: str, reason: str) -> None:
        """Tell the health and ``problems`` that a part on a wire of its own is lost, a laser say; "" when it is not."""
        if self._lost_parts.get(name, "") == reason:
            return
        self._lost_parts.pop(name, None)
        if reason:
            self._lost_parts[name] = reason
        self.send_message(m.Unusable(name, reason))
        self.show_problems()

    def rate_words(self) -> str:
        """Return the rate of the bus for ``status``, "" before it is known."""
        return f", {self.rate.sensed:.0f} Hz" if self.rate.sensed else ""

    # ---------------------------------------------------------------- hooks

    def build_absent(self) -> bool:
        """Begin to build the tree of a robot that is absent at the start, from what the last run found.

        Returns False if nothing is known of it.  When the tree is built, ``wait_for_readings`` or ``answer_open`` is
        called, as after ``on_found``.
        """
        known = self.device_memory.recall()
        if not known:
            return False
        try:
            self.on_found(m.Found(known))
        except Exception as error:  # The file may describe devices that do not exist; the robot itself will tell.
            self.log.warning("the devices of the last run cannot be shown: %s: %s", self.device_memory.file, error)
            return False
        return True

    # ---------------------------------------------------------------- the worker

    def _post(self, message: m.FromWorker) -> None:
        """Pass a message to the kernel's thread; called in the thread of the worker's handle."""
        self.host.post(lambda: self._handle_message(message))

    def _begin_heartbeats(self, dead_man: float) -> None:
        """Send heartbeats from now on, several in the time after which the worker stops the robot."""
        if self._heartbeat is not None:
            self.remove_timer(self._heartbeat)
        period = min(HEARTBEAT_PERIOD_S, dead_man / HEARTBEATS) if dead_man else HEARTBEAT_PERIOD_S
        self._heartbeat = self.set_timer(max(period, MIN_HEARTBEAT_PERIOD_S), self._send_heartbeat)

    def _send_heartbeat(self) -> None:
        self.send_message(m.Heartbeat())

    def _handle_message(self, message: m.FromWorker) -> None:
        if not isinstance(message, m.WorkerState | m.Ended):
            self._heard_at = self.bus_time()
        match message:
            case m.Samples():
                self._handle_samples(message)
            case m.Reply():
                self.channel.handle_reply(message)
            case m.DeviceReport():
                self.on_happened(message)
            case m.Found():
                self._handle_found(message)
            case m.GuestsGone():
                self.device_memory.drop(message.devices)
                self.on_gone(message)
            case m.Differences():
                self._show_differences(message)
            case m.DeviceState():
                if message.new == "lost" and not self._resume:
                    self._end_movements(message.device, f"it was lost: {message.reason}")
                self._show_absence(message)
                self.on_device_state(message)
            case m.LinkState():
                self._handle_link_state(message)
            case m.Statistics():
                self._publish_statistics(message)
                self.on_statistics(message)
            case m.Refused():
                self.on_refused(message)
            case m.Stopped():
                self._handle_stopped(message)
            case m.Latched():
                self._handle_latched(message)
            case m.Limited():
                if not self._target_limits.is_outdated(message):
                    self.on_limited(message)
            case m.ThresholdCrossed():
                self.on_threshold_crossed(message)
            case m.Held():
                # All of them: a worker that was replaced knows nothing of what its predecessor held.
                self.motion.held = dict(message.devices)
            case m.WorkerState():
                self._handle_worker_state(message)
            case m.Ended():
                self._handle_end(message)
            case m.WorkerHeartbeat():
                pass

    def _handle_samples(self, message: m.Samples) -> None:
        """Show measurements, but not those that were on their way when the link was lost: all values are old then."""
        if self.opening or self.link.sensed:
            self.on_samples(message)
            if self.opening and self.is_complete():
                self.answer_open(None)

    def _handle_found(self, message: m.Found) -> None:
        self.device_memory.keep(message.devices)
        if not self.opening:
            self.on_found(message)
            return
        if message.devices:
            # An adapter alone is no robot.
            self._show_link(True)
        self.on_found(message)
        if message.devices and self.tree_begun:
            # The platform waits for readings only once, when the tree has been built.
            self.wait_for_readings()
        self._arrival.tree_begun = self.tree_begun or bool(message.devices)

    def _show_differences(self, message: m.Differences) -> None:
        """Show and log what differs from the expected devices, one line for each kind."""
        missing = [f"{each.name} (id {each.id})" for each in message.missing]
        unexpected = [f"id {each.id} ({each.found})" for each in message.unexpected]
        other = [f"{each.name} (id {each.id}) is {each.found}, not {each.expected}" for each in message.other]
        before = {*self._differences}
        shown = {
            "missing": [f"{each} missing" for each in missing],
            "unexpected": [f"{each} unexpected" for each in unexpected],
            "of another kind": other,
        }
        texts = [text for kind in shown.values() for text in kind]
        self._differences = texts
        self.show_problems()
        if before and not texts:
            self.log.info("all expected devices are there, and no others")
        for kind, devices in zip(shown, (missing, unexpected, other), strict=True):
            # A kind is reported again only if its number has grown.
            if not before.issuperset(shown[kind]):
                self.log.warning("%s: %s", kind, ", ".join(devices))

    def _handle_worker_state(self, message: m.WorkerState) -> None:
        """The worker hangs or was replaced: its targets are lost, and its pending requests fail."""
        if not message.reason:
            self.log.warning("the bus worker answers again")
            return
        self._end_motion(message.reason)
        self.channel.fail_pending(message.reason)
        if not self.link.sensed:
            self.log.warning("%s", message.reason)
        self._handle_link_state(m.LinkState(False, message.reason))

    def _publish_statistics(self, message: m.Statistics) -> None:
        self.rate.sense(message.rate)
        self.busLoad.sense(message.load)
        self.statistics.sense(
            {"rate": message.rate, "late": message.late, "busLoad": message.load, "dropped": message.dropped}
            | {kind: float(count) for kind, count in message.errors.items()}
        )

    def _handle_link_state(self, message: m.LinkState) -> None:
        if self.opening and not message.up:
            self.answer_open((BadConfig if message.mistake else NotReady)(message.reason))
        if bool(self.link.sensed) == message.up or (self.opening and message.up):
            return
        self._show_link(message.up)
        # Again when it is up: what was ordered meanwhile has not reached the robot.
        self.count_standstill()
        if message.up:
            # To a worker that may be another one.
            for name, reason in self._lost_parts.items():
                self.send_message(m.Unusable(name, reason))
            if self._had_link_loss:
                self.log.warning("link to %s is back", self.url.sensed, event="link-back")
                self.linkBack.emit()
            return
        self._had_link_loss = True
        if not self._resume:
            self._end_motion(f"the link was lost: {message.reason}")
        self.log.warning("link lost: %s; trying again until it is back", message.reason, event="link-lost")
        self.on_link_down(message.reason)
        self.linkLost.emit(message.reason)

    def _show_link(self, up: bool) -> None:
        self.link.sense(up)
        if not up:
            # The driver reports the devices that are lost again when the link is up.
            for device in list(self.motion.absent):
                self.motion.set_absent(device, "")
        self.motion.set_absent(None, "" if up else LINK_DOWN)

    def _handle_end(self, message: m.Ended) -> None:
        if self._worker is None and not message.reason:
            return
        reason = message.reason or "the bus worker ended"
        self._worker = None
        self._handle_link_state(m.LinkState(False, reason))


def _for_worker(settings: RobotSettings) -> m.Configure:
    return m.Configure(
        rate=settings.rate,
        dead_man=settings.dead_man,
        torque_off_on_stop=settings.torque_off_on_stop,
        resume=settings.resume,
        options=settings.options,
        realtime=settings.realtime,
    )
