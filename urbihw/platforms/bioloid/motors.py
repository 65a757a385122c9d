"""Servos: the base of the classes AX12 (protocol 1.0) and XServo (protocol 2.0), with the same slots where possible.

``val`` is the goal when written and the measured position when read, in rad from the middle, counter-clockwise
positive.  ``speed`` is in rad/s: of a joint, how fast it goes to following goals; of a wheel, how fast it turns.  A
motor is a wheel while ``cwLimit`` and ``ccwLimit`` are both 0.  ``load`` 0 switches the motor off, and it stays off,
whatever is written to ``val``, until ``load`` is 1.

Switching between joint and wheel, and switching on, take several confirmed writes; what is written to ``val`` and
``speed`` meanwhile is deferred and sent behind them, because one register means different things in the two modes.  A
deferred write keeps its origin: a stop ends it like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Final

from urbihw.buses import messages as m
from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.device import DeviceInfo
from urbihw.kernel.uobject import EffectorDevice, Motion, Origin, UVar, number, reading, set_range
from urbihw.platforms.base import LimitNamer, LimitTable
from urbihw.platforms.bioloid import words
from urbihw.platforms.bioloid.devices import ChangeHandler, Device, Refused
from urbihw.platforms.bioloid.servolimits import ServoLimits
from urbihw.platforms.bioloid.slots import Slot
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.limits import DeviceLimits, whole_counts

_PROBE_COUNTS: Final = 1000  # converted to rad/s, they give the scale of a register
Step = tuple[str, Any]
"""One write of a change of mode: item and raw count, or ``PRESENT_POSITION``."""


class Servo(Device, EffectorDevice):
    """The base of both kinds of servos."""

    slot_words = words.SERVO

    kind_of_device = "motor"
    wheel = reading(False)

    goal: ClassVar[str] = "goal_position"
    limits: ClassVar[tuple[str, str]]
    """The registers of cwLimit and ccwLimit."""

    def init(self, channel: DeviceChannel, info: DeviceInfo, refused: Refused, motion: Motion) -> None:  # type: ignore[override]
        """``motion`` is who may move the robot."""
        self.motion = motion
        super().init(channel, info, refused)

    def prepare(self) -> None:
        """Bind the writes of the slots val, speed, load, cwLimit and ccwLimit."""
        self.val, self.speed, self.load = (self.variables[name] for name in ("val", "speed", "load"))
        self.cw_limit, self.ccw_limit = self.variables["cwLimit"], self.variables["ccwLimit"]
        self._off = False
        self._switches = 0
        self._fastest = math.inf, ""
        self._deferred_writes: dict[str, Origin] = {}
        self._limits_wanted: dict[str, float] = {}
        self._goal_guard = self.guard(self.motion, self.number, self.val)
        self._speed_guard = self.guard(self.motion, self.number, self.speed)
        self.notify_change(self.val, lambda: self._write_val(self._goal_guard.origin))
        self.notify_change(self.speed, lambda: self._write_speed(self._speed_guard.origin))
        self.notify_change(self.load, self._write_load)
        for var in (self.cw_limit, self.ccw_limit):
            self.notify_change(var, self._write_limit)
            set_range(var, *units.limits_si(self.table.item(self.goal_item_of_limits())))
        for item in (*self.mode_items(), *self.limits):
            self.on_change(item, lambda raw, stamp: self._update_limits(stamp))
        set_range(self.load, 0.0, 1.0)

    def goal_item_of_limits(self) -> str:
        """The register whose range bounds the limits."""
        return self.limits[0]

    def mode_items(self) -> tuple[str, ...]:
        """Registers beside the limits that decide whether it is a wheel; override."""
        return ()

    # ---------------------------------------------------------------- defined by each kind of servo

    def reads_wheel(self) -> bool:
        """Return whether its registers, as last read, make it a wheel."""
        raise NotImplementedError

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """Slowest and fastest speed, rad/s."""
        raise NotImplementedError

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The register and raw count for a speed in rad/s."""
        raise NotImplementedError

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """The writes, in order, that make it a wheel, or a joint with these limits in rad."""
        raise NotImplementedError

    def plan_on(self) -> list[Step]:
        """The writes that switch the motor on, holding where it is."""
        raise NotImplementedError

    # ---------------------------------------------------------------- val

    def change_handler(self, row: Slot, var: UVar) -> ChangeHandler:
        """Return the handlers of the slots that depend on several registers or on the mode."""
        if row.name == "speed":
            return self.speed_handler(row, var)
        if row.name == "load":
            return lambda raw, stamp: self.update_load(stamp)
        if row.name in ("cwLimit", "ccwLimit"):
            return lambda raw, stamp: None
        return super().change_handler(row, var)

    def speed_handler(self, row: Slot, var: UVar) -> ChangeHandler:
        """Return the handler of the present speed; override where it depends on the mode."""
        return super().change_handler(row, var)

    def _write_val(self, origin: Origin) -> None:
        raw = units.from_si(self.table.item(self.goal), number(self.val))
        if self._switching:
            self._deferred_writes["val"] = origin
        elif not self.wheel.sensed and not self._off:
            self.channel.set_target(self.number, self.goal, raw, origin)
            self._enable_torque(origin)

    def explain_off(self) -> str:
        """Return why a write does not move it, "" if it does; while it is being switched on, writes are deferred."""
        if self._off:
            return f"motor {self.number} is off: switch it on with load = 1"
        return "" if self._switching else self.explain_alarm()

    def explain_alarm(self) -> str:
        """Return why an alarm leaves it without torque, and what to do; "" without an alarm; override."""
        return ""

    def _enable_torque(self, origin: Origin) -> None:
        """Switch the torque on with a goal: an AX servo does that by itself, others do not."""
        if self.raw.get("torque_enable") != 1:
            self.channel.set_target(self.number, "torque_enable", 1, origin)

    # ---------------------------------------------------------------- speed

    def _write_speed(self, origin: Origin) -> None:
        value = number(self.speed)
        if self._switching:
            self._deferred_writes["speed"] = origin
            return
        wheel = bool(self.wheel.sensed)
        item, raw = self.speed_target(value, wheel)
        if wheel:
            if self._off:
                return
            self._enable_torque(origin)
            self.channel.set_target(self.number, item, raw, origin)
        else:
            self.settings[item] = raw
            self.channel.set_target(self.number, item, raw)
            if value > self._fastest[0]:
                self.show_applied(*self._fastest)

    # ---------------------------------------------------------------- limits of the settings

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits to raw counts for the present mode: see ``platforms.base.LimitedDevice``."""
        row = self.row("torqueLimit")
        strongest = self._max_torque_count(row, limits.torque)
        if math.isfinite(limits.torque):
            # An alarm sets the register to 0; that is not a limit that a program has written.
            self._write_setting(row, min(strongest, self.settings.get(row.item) or self.raw.get(row.item) or strongest))
        made = ServoLimits(self.number, limits, named)
        self._fastest = limits.speed, named("speed")
        if self.wheel.sensed:
            table = made.wheel_limits(*self.wheel_scale())
        else:
            table = made.joint_limits(self.table.item(self.goal))
        return table | made.torque_limits(row.item, strongest), made.thresholds(row.item, strongest)

    def mark_released(self) -> None:
        """The worker has switched it off; it stays off until ``load`` is written."""
        self._off = True

    def _max_torque_count(self, row: Slot, torque: float) -> int:
        """The largest count of the torque limit that is no more than a torque in N m."""
        item = self.table.item(row.item)
        share = min(row.view.to_si(torque, self.facts), units.limits_si(item)[1])
        return int(whole_counts(0.0, share / units.to_si(item, 1))[1])

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited target in the slot that was written."""
        if message.device != self.number:
            return
        if message.item == self.goal:
            self.limit_applied(units.to_si(self.table.item(self.goal), int(message.applied)), message.limit)
        elif self.wheel.sensed and message.item == self.wheel_scale()[0]:
            raw = int(message.applied)
            self.limit_applied(self.speed_of(raw), message.limit)

    def row(self, slot: str) -> Slot:
        """The row of a slot."""
        return next(row for row in self.rows if row.name == slot)

    def wheel_scale(self) -> tuple[str, float]:
        """The register of a wheel's speed, and its counts for 1 rad/s."""
        item, _ = self.speed_target(0.0, True)
        return item, _PROBE_COUNTS / self.speed_of(_PROBE_COUNTS)

    def speed_of(self, raw: int) -> float:
        """Return the wheel speed in rad/s of a raw target."""
        raise NotImplementedError

    # ---------------------------------------------------------------- load

    def _write_load(self) -> None:
        off = number(self.load) == 0
        if not off:
            self.motion.check_device(self.number)
        self._off = off
        self.load.sense(0.0 if off else 1.0)
        self._write_steps([("torque_enable", 0)] if self._off else self.plan_on(), "load")

    def _write_steps(self, steps: list[Step], slot: str) -> None:
        """Execute several writes without interruption; writes to val and speed are deferred meanwhile."""
        if not steps:
            self._send_deferred_writes()
            return
        self._switches += 1

        def replied(reply: Reply) -> None:
            self._switches -= 1
            if reply.ok:
                self.update_values(dict(reply.value), self.host.now())
            else:
                self.refused(slot, self.explain_error(reply.error))
                # A motor that could not be switched on stays off until ``load`` is written again.
                self._off = self._off or slot == "load"
                for item, _ in steps:
                    self.channel.read(self.number, item, lambda read, item=item: self._store_reading(item, read))  # type: ignore[misc]
                self._show_known()
            self._send_deferred_writes()

        self.channel.write_all(self.number, steps, replied, self.motion.origin())

    def _show_known(self) -> None:
        """Show the limits and the power as last read: what was wanted has not been done."""
        self._update_limits(self.host.now())
        self.update_load(self.host.now())

    def _store_reading(self, item: str, reply: Reply) -> None:
        if reply.ok and reply.value is not None:
            self.update_values({item: reply.value}, self.host.now())

    def update_load(self, stamp: float) -> None:
        """Update the slot load from the registers that it depends on."""
        self.load.sense(float(self.raw.get("torque_enable", 0)), stamp)

    def restore(self) -> None:
        """Write the settings of urbiscript again; a motor that was switched off stays off."""
        super().restore()
        if self._off:
            self.write("torque_enable", 0, "load")

    # ---------------------------------------------------------------- limits and mode

    def _write_limit(self, var: UVar) -> None:
        # A change of mode may move it slightly, so a statement that was stopped must not cause one.
        self.motion.check()
        self._limits_wanted[var.name] = number(var)
        var.sense(number(var))
        least, most = self._wanted_limits()
        # A speed that is written after the limits refers to the mode that they select.
        set_range(self.speed, *self.speed_range(least == most == 0))
        # ``cwLimit = ccwLimit = 0`` is two writes that select one mode: combine them at the end of the round.
        self.channel.settle_later(self)

    def _wanted_limits(self) -> tuple[float, float]:
        wanted = self._limits_wanted
        return wanted.get("cwLimit", self.cw_limit.sensed), wanted.get("ccwLimit", self.ccw_limit.sensed)

    def settle(self) -> None:
        """End of a round in which limits were written: change the mode, or write the limits."""
        least, most = self._wanted_limits()
        self._limits_wanted = {}
        self._write_steps(self.plan_limits(least == most == 0, least, most), "cwLimit, ccwLimit")

    @property
    def _switching(self) -> bool:
        return bool(self._switches or self._limits_wanted)

    def _send_deferred_writes(self) -> None:
        if self._switching:
            return
        deferred, self._deferred_writes = self._deferred_writes, {}
        for slot, write in (("speed", self._write_speed), ("val", self._write_val)):
            origin = deferred.get(slot)
            if origin is not None and self.motion.is_live(origin, self.number):
                write(origin)

    def _update_limits(self, stamp: float) -> None:
        if any(item not in self.raw for item in (*self.mode_items(), *self.limits)):
            return
        wheel = self.reads_wheel()
        least, most = (
            0.0 if wheel else units.to_si(self.table.item(item), self.raw[item]) for item in self.limits
        )
        self.wheel.sense(wheel)
        self.cw_limit.sense(least, stamp)
        self.ccw_limit.sense(most, stamp)
        if wheel:
            least, most = units.limits_si(self.table.item(self.goal_item_of_limits()))
        set_range(self.val, least, most)
        set_range(self.speed, *self.speed_range(wheel))
        self.mode_changed()

    mode_changed: Callable[[], None] = staticmethod(lambda: None)
    """Called when its mode or its limits have been read."""
