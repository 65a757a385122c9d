"""The base of robots on one wire: it makes the parts of a robot, and passes the messages of the bus worker to them.

A platform derives from ``WiredRobot``, names the family of its wire, and handles the devices found and the values
measured (``hooks``).  Each part has one job: ``worker`` is the session with the bus worker, ``guard`` knows who may
move the robot and what stops it, ``limits`` has the limits of its devices, ``arrival`` has its link and answers
``open``, ``report`` shows its problems, ``identity`` its name and address, ``drawn`` its figure.  The worker's messages
arrive in a thread of the handle and are posted into the kernel's thread; the writes of devices
are gathered in ``channel`` and sent once per scheduler round.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.supervisor import Supervisor
from urbihw.kernel.uobject import BadConfig, DevicePart, Opened, PlatformRobot, RobotSettings, function
from urbihw.platforms.arrival import Arrival
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.drawn import DrawnRobot
from urbihw.platforms.expected import for_worker
from urbihw.platforms.guarded import MotionGuard
from urbihw.platforms.hooks import RobotHooks
from urbihw.platforms.identity import RobotIdentity
from urbihw.platforms.limited import LOOSER_SHOWN_S, RobotLimits
from urbihw.platforms.limits import LimitSettings
from urbihw.platforms.problems import ProblemReport
from urbihw.platforms.remembered import DeviceMemory
from urbihw.platforms.session import WorkerHandle, WorkerSession
from urbihw.platforms.words import ROBOT


class WiredRobot(RobotHooks, PlatformRobot):
    """A robot on one wire.

    A subclass sets ``family`` and ``robot_name`` and implements ``summary``, ``on_found``, ``on_samples``
    and ``is_complete``; the other hooks do nothing by default.  It writes and reads through ``channel``.
    """

    parts: ClassVar[tuple[type[DevicePart], ...]] = (
        RobotIdentity, MotionGuard, RobotLimits, Arrival, WorkerSession, ProblemReport, DrawnRobot,
    )  # fmt: skip
    slot_words = ROBOT

    whose_log: ClassVar[str] = ""
    """What its lines in the log begin with: the name of a robot beside another one."""

    start_worker: Callable[..., WorkerHandle] = staticmethod(Supervisor.start)
    """Starts a worker; replaced in tests."""
    bus_time: Callable[[], float] = staticmethod(time.monotonic)
    """The clock of the worker's time stamps."""

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        name = self.robot_name
        self.has_tree = False
        """Whether ``build_tree`` is over."""
        self.offset = 0.0
        """Kernel's time = worker's time + offset, in seconds."""
        self.expected: tuple[m.ExpectedDevice, ...] = ()
        """The devices that the settings expect; their names are those of the start."""
        self.log = DeviceLog(logging.getLogger(f"urbihw.{name}"), self.host.now, self.call_later, self.whose_log)
        self.device_memory = DeviceMemory(driver_of(self.family).device_info, self.log.warning)
        self.identity = RobotIdentity(self, name, self.model_name)
        self.drawn = DrawnRobot(self, lambda: self.figure())
        self.worker = WorkerSession(self, name, self.family)
        send = self.worker.send
        self.guard = MotionGuard(self, name, send, self.log, self)
        self.motion = self.guard.motion
        self.channel = DeviceChannel(send, self.motion)
        self.limits = RobotLimits(self, send, self.channel, self.motion, self.log, self)
        self.report = ProblemReport(
            self, send, self.log, self.call_later, self.unusable_devices, self.motion.arming.explain
        )
        self.motion.arming.on_unarmed = self.report.show_unarmed
        self.arrival = Arrival(
            self, self.guard, self.report, self.device_memory, self.log, self.call_later, self
        )

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the worker; ``opened`` is called when the devices have been read.  The options go to the driver."""
        self.arrival.begin(settings.url, opened)
        self.offset = self.host.now() - self.bus_time()
        self.expected = for_worker(settings.devices)
        self.device_memory.use(settings.memory, settings.url)
        self.identity.show()
        self.identity.show_address(settings.url)
        self.guard.configure(settings)
        self.limits.settings = LimitSettings.of(settings.limits)
        self.worker.start(self.start_worker, self.bus_time, self._post, settings, self.expected)
        self.host.each_round(self.channel.flush)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings and limits.  Raises BadConfig."""
        limits = LimitSettings.of(settings.limits)
        self.worker.check(settings)
        self.guard.configure(settings)
        have_changed = limits != self.limits.settings
        raised, looser = self.limits.take(limits)
        self.worker.configure(settings, self.expected)
        self.limits.send()
        if have_changed:
            self.report.show_looser(raised, looser, LOOSER_SHOWN_S)

    def close(self) -> None:
        """Stop the robot, end the worker, and destroy the objects."""
        handle = self.worker.forget()
        self.motion.close()
        self.log.close()
        self.destroy()
        if handle is not None:
            handle.stop()

    def abandon(self) -> None:
        """Stop the robot and end the worker, without touching the kernel."""
        handle = self.worker.handle
        if handle is not None:
            handle.stop()

    @function
    def stop(self) -> None:
        """Execute the safe stop of this robot now; statements that begin afterwards may move it again.

        Earlier statements that would move it later end with an error.
        """
        self.guard.halt_all(self.motion.asked())

    def status(self) -> str:
        return self.summary() if self.arrival.is_up() else "link down"

    def alive(self) -> bool:
        return self.worker.alive()

    @property
    def tree_begun(self) -> bool:
        return self.arrival.tree_begun

    def waits_for(self) -> str:
        return self.arrival.awaited

    # ---------------------------------------------------------------- what a subclass calls

    def build_tree(self, file: Path) -> None:
        """Run the program that builds the standard robot API; then send the limits, and wait for the first readings.

        If the program fails, ``open`` is answered with BadConfig.
        """
        self.host.run(file.read_text("latin-1"), file.name, self._tree_built)

    def _tree_built(self, problem: str) -> None:
        if problem:
            self.arrival.answer(BadConfig(problem))
            return
        self.has_tree = True
        self.limits.send()
        self.arrival.wait_for_readings()

    def call_later(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        """Call ``action`` once after some seconds; return a function that cancels it."""
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            action()

        handle = self.set_timer(seconds, over)
        return lambda: self.remove_timer(handle)

    # ---------------------------------------------------------------- messages of the worker

    def _post(self, message: m.FromWorker) -> None:
        """Pass a message to the kernel's thread; called in the thread of the worker's handle."""
        self.host.post(lambda: self._handle_message(message))

    def _handle_message(self, message: m.FromWorker) -> None:
        if not isinstance(message, m.WorkerState | m.Ended):
            self.worker.heard()
            self.report.show_worker("")
        match message:
            case m.Samples():
                self._handle_samples(message)
            case m.Reply():
                self.channel.handle_reply(message)
            case m.DeviceReport():
                self.on_happened(message)
            case m.Found():
                self.arrival.found(message)
            case m.GuestsGone():
                self.device_memory.drop(message.devices)
                self.on_gone(message)
            case m.Differences():
                self.report.show_differences(message)
            case m.DeviceState():
                self._handle_device_state(message)
            case m.LinkState():
                self.arrival.link_changed(message)
            case m.Statistics():
                self.worker.publish_statistics(message)
                self.on_statistics(message)
            case m.Refused():
                self._handle_refused(message)
            case m.Stopped():
                self.guard.handle_stopped(message)
            case m.Latched():
                self.guard.handle_latched(message)
            case m.Limited():
                self.limits.show_limited(message)
            case m.ThresholdCrossed():
                self.limits.show_crossed(message)
                self.on_threshold_crossed(message)
            case m.Held():
                # All of them: a worker that was replaced knows nothing of what its predecessor held.
                self.motion.held = dict(message.devices)
            case m.WorkerState():
                self._handle_worker_state(message)
            case m.Ended():
                if self.worker.forget() is not None or message.reason:
                    self.arrival.link_changed(m.LinkState(False, message.reason or "the bus worker ended"))
            case m.WorkerHeartbeat():
                pass

    def _handle_samples(self, message: m.Samples) -> None:
        """Show measurements, but not those that were on their way when the link was lost: all values are old then."""
        if self.arrival.opening or self.arrival.link.sensed:
            self.on_samples(message)
            if self.arrival.opening and self.is_complete():
                self.arrival.answer(None)

    def _handle_device_state(self, message: m.DeviceState) -> None:
        if message.new == "lost":
            self.guard.device_lost(message.device, message.reason)
        if message.device not in self.channel.blocked:
            # A blocked one answers, and remains absent for other reasons.
            self.guard.show_absence(message)
        self.on_device_state(message)

    def _handle_refused(self, message: m.Refused) -> None:
        """Log a refusal; not that of another device under a known id, since this is reported already."""
        self.on_refused(message)
        if message.device not in self.channel.blocked:
            self.log.warning("%s: %s: %s", message.device, message.item, message.reason)

    def _handle_worker_state(self, message: m.WorkerState) -> None:
        """The worker hangs or was replaced: its targets are lost, and its pending requests fail."""
        if not message.reason:
            self.log.warning("the bus worker answers again")
            return
        self.report.show_worker(f"{message.reason}: if the robot moves now, cut its power")
        self.guard.end_motion(message.reason)
        self.channel.fail_pending(message.reason)
        if not self.arrival.is_up():
            self.log.warning("%s", message.reason)
        self.arrival.link_changed(m.LinkState(False, message.reason))
