"""The object ``segway``: the base, its RMPs, and the causes of a stop.

The base is stopped when the kernel has been silent for DEAD_MAN seconds, when the connection that drove it closes, when
the link or the base is lost, and when the daemon ends.  No script is needed for that.
"""

from __future__ import annotations

import weakref
from collections.abc import Hashable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, NotReady, Opened, Origin, RobotSettings, event, function, reading
from urbihw.navigation.lasers.fitting import BaseLaser, fit_laser
from urbihw.navigation.pilot import Pilot
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.segway import words
from urbihw.platforms.segway.driver import BASE, FASTEST, SLOWEST
from urbihw.platforms.segway.navigation import SegwayOdometry, SegwayPlanner, SegwayWheels
from urbihw.platforms.segway.options import SegwayOptions
from urbihw.platforms.segway.rmp import RMP

DEAD_MAN: Final = 0.4
"""Maximum silence of the kernel in seconds before the base is stopped: the base's own time-out."""
SHORTEST: Final = 1 / FASTEST
"""Minimum seconds between two readings: two cycles of the base."""
LONGEST: Final = 60.0
TREE: Final = "rmp.u"
"""Builds the standard robot API when the base was found."""


class Segway(WiredRobot):
    """A Segway RMP of any model."""

    slot_words = words.BASE

    classes = (RMP, SegwayOdometry, SegwayPlanner, BaseLaser)

    robot_name = "segway"
    model_name = "Segway RMP"
    family = "urbihw.platforms.segway.driver:RmpDriver"

    rmpModel = reading("200")
    build = reading(0.0)
    state = reading("lost")
    lost = event()
    back = event()
    restarted = event()
    refused = event()

    def init(self) -> None:
        """Called by ``new``; the worker is started by ``open``."""
        super().init()
        self.settings: dict[str, int] = {}
        self._members: weakref.WeakSet[RMP] = weakref.WeakSet()
        self.options = SegwayOptions()
        self._wanted: RobotSettings
        self._pilot: Pilot | None = None
        self._laser: BaseLaser | None = None
        self._wheels: SegwayWheels | None = None
        self._raw: dict[str, int] = {}
        self._built = False

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the worker at a safe rate and dead-man time."""
        self._wanted = _safe(settings)
        super().open(self._wanted, opened)
        self.options = SegwayOptions.of(settings.options)
        self.rmpModel.sense(self.options.model)
        self.identity.show(model=f"{self.model_name} {self.options.model}")
        self.channel.watch(BASE, (), 1 / self._wanted.rate)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings; the rate remains the one that the RMPs requested."""
        self._wanted = replace(_safe(settings), rate=self._wanted.rate)
        super().configure(self._wanted)
        self.options = SegwayOptions.of(settings.options)

    def close(self) -> None:
        """Close the laser, then the base."""
        if self._laser is not None:
            self._laser.close()
        super().close()

    def summary(self) -> str:
        """Return the model, the voltage of the battery and the rate."""
        if self.state.sensed != "ok":
            return "base lost"
        volts = f", {self._raw['battery'] / 4:.0f} V" if "battery" in self._raw else ""
        return f"RMP {self.rmpModel.sensed}{volts}" + self.worker.rate_words()

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def join(self, rmp: RMP, period: float) -> None:
        """Add an RMP that shows this base every ``period`` s; the fastest RMP sets the rate of the commands, within
        20 to 50 ms."""
        if not 0 < period <= LONGEST:
            raise ValueError(f"period is in seconds, {SHORTEST:g} to {LONGEST:g}")
        rmp.attach(self, max(period, SHORTEST))
        self._members.add(rmp)
        rmp.changed_state(str(self.state.sensed))
        self._pace(min(float(member.period.sensed) for member in self._members))
        if self._raw and self.state.sensed == "ok":
            rmp.show_cycle(self._raw, self.host.now())

    @function
    def steer(self, rmp: RMP) -> None:
        """Make the planner use this RMP: its odometry, its coefficients, and its ranges."""
        if self._pilot is None or self._wheels is None:
            self._wheels = SegwayWheels(self, rmp)
            odometry = self.host.create(SegwayOdometry)
            self._pilot = Pilot(self._wheels, odometry, self.motion, self.log)
            self._laser = self._pilot.scanner = fit_laser(self, self.options)
            self._pilot.planner = self.host.create(SegwayPlanner, None, self._pilot)
            self.put_slot("odometry", odometry)
            self.put_slot("planner", self._pilot.planner)
        self._wheels.rmp.pilot = None
        self._wheels.rmp = rmp
        rmp.pilot = self._pilot

    @function("moveTo")
    def move_to(self, goal: Any) -> None:
        """Drive to [x, y, heading] on the map along a planned path; the planner's events report the end."""
        if self._pilot is None:
            raise ValueError("there is no planner yet: segway.steer(rmp) makes one")
        self._pilot.planner.move_to(goal)

    @function("explainOff")
    def explain_off(self) -> str:
        """Return why the base does not drive in its present mode or with its present fault, "" if it does."""
        return "" if self._wheels is None else self._wheels.rmp.explain_off()

    @function
    def shutdown(self) -> None:
        """Switch the base off; a balancing base falls."""
        origin = self.motion.origin()
        self.channel.send_request(
            "shutdown", BASE, lambda reply: None if reply.ok else self._refuse("shutdown", reply.error, origin)
        )

    # ---------------------------------------------------------------- what an RMP and the planner call

    def base_limits(self) -> DeviceLimits:
        """Return the limits of the settings for the base."""
        return self.limits.settings.device(BASE)

    def end_path(self) -> None:
        """End the planner's path: a program drives the base itself."""
        if self._pilot is not None:
            self._pilot.yield_to_hand()

    def set_target(self, item: str, counts: int, origin: Origin) -> None:
        """Send a speed with the next command."""
        self.channel.set_target(BASE, item, counts, origin)

    def send_configuration(self, slot: str, name: str, parameter: int) -> None:
        """Configure the base; a refusal is logged and emitted, and the writer is warned."""
        origin = self.motion.origin()

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self._refuse(slot, reply.error, origin)
            elif name not in ("reset", "mode"):
                self.settings[name] = parameter
            for rmp in self._members:
                rmp.configured()

        self.channel.write(BASE, name, parameter, done, origin)

    def _refuse(self, slot: str, reason: str, origin: Origin) -> None:
        self.guard.warn_writer(origin, "%s: not done: %s", slot, reason)
        self.refused.emit(slot, reason)

    # ---------------------------------------------------------------- the worker

    def _pace(self, period: float) -> None:
        rate = min(max(1 / period, SLOWEST), FASTEST)
        if rate != self._wanted.rate:
            self._wanted = replace(self._wanted, rate=rate)
            super().configure(self._wanted)
        self.channel.watch(BASE, (), period)

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the base, represented by the RMP that was made first."""
        first = min(self._members, key=lambda rmp: rmp.unique_name, default=None)
        return {} if first is None else {BASE: first}

    def on_found(self, message: m.Found) -> None:
        """Show the firmware, and build the tree at the first connection."""
        (info,) = message.devices
        self.build.sense(float(info.build))
        if info.old:
            self.log.warning("the firmware of the base is old: it tells neither mode nor torques nor faults")
        self._changed("ok")
        if not self._built:
            self._built = True
            path = Path(__file__).with_name(TREE)
            self.host.run(path.read_text("latin-1"), path.name, self._has_tree)

    def _has_tree(self, problem: str) -> None:
        self.limits.send()
        self.arrival.answer(BadConfig(problem) if problem else None)

    def on_samples(self, message: m.Samples) -> None:
        """Offer the values of a cycle to every RMP."""
        self._raw = dict(message.values[BASE])
        stamp = message.times[BASE] + self.offset
        for rmp in self._members:
            rmp.offer_cycle(self._raw, stamp)

    def is_complete(self) -> bool:
        """Return False: ``open`` is answered when the tree is built."""
        return False

    def on_happened(self, message: m.DeviceReport) -> None:
        """Report another commander on the bus and a channel that fails or is back; after a restart of the base, send
        its settings again."""
        if message.what == "channel":
            self.log.warning("%s", message.value)
            return
        if message.what != "restarted":
            self.log.warning("another program on the bus commands this base too; end it, or the base jerks")
            return
        self.log.warning("the base was switched off and on; it gets its settings again")
        for name, parameter in self.settings.items():
            self.send_configuration(name, name, parameter)
        self.restarted.emit()

    def on_device_state(self, message: m.DeviceState) -> None:
        """Show the loss and the return of the base; the loss ends a path."""
        if message.new == "lost":
            if self.arrival.opening:
                self.arrival.answer(NotReady(_nobody(self.arrival.url.sensed, message.reason)))
                return
            self.log.warning("the base is lost: %s; its motion is zero until it is driven again", message.reason)
            self.guard.count_standstill()
            self._changed("lost")
            self._drop_path(f"the base is lost: {message.reason}")
            self.lost.emit(message.reason)
        elif message.new == "back":
            self.log.warning("the base is back")
            self.guard.count_standstill()
            self._changed("ok")
            self.back.emit()

    def on_link_down(self, reason: str) -> None:
        """Mark the base as lost and end a path."""
        self._changed("lost")
        self._drop_path("the link was lost")

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """End the path that the robot follows."""
        self._drop_path(reason)

    def _drop_path(self, reason: str) -> None:
        """End a path, because the worker has stopped the base."""
        if self._pilot is not None:
            self._pilot.drop_orders(reason)

    def _changed(self, state: str) -> None:
        self.state.sense(state)
        for rmp in self._members:
            rmp.changed_state(state)


def _safe(settings: RobotSettings) -> RobotSettings:
    """Return the settings within the limits of this robot: always a dead-man time, and a rate of 20 to 50 Hz."""
    return replace(
        settings,
        rate=min(max(settings.rate, SLOWEST), FASTEST),
        dead_man=min(settings.dead_man or DEAD_MAN, DEAD_MAN),
    )


def _nobody(url: str, reason: str) -> str:
    if reason != "it says nothing":
        return f"no RMP on {url}: {reason}"
    return (
        f"no RMP on {url}: is it switched on, are its plugs in, is this its speed (USB ?baud=460800, CAN 500 kbit/s)?"
    )
