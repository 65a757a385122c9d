"""Servos: the base of the classes of servos, with the same slots where possible, whatever their control table.

``val`` is the goal when written and the measured position when read, in rad from the middle, counter-clockwise
positive, or as the ``Frame`` of the joint says.  ``speed`` is in rad/s: of a joint, how fast it goes to following
goals; of a wheel, how fast it turns.  ``mode`` is the operating mode, by its name in the control table.  It is a wheel
while ``cwLimit`` and ``ccwLimit`` are both 0.  ``load`` 0 switches the motor off, and it stays off, whatever is written
to ``val``, until ``load`` is 1.

A change of mode, and switching on, take several confirmed writes; what is written to ``val`` and ``speed`` meanwhile is
deferred and sent behind them, because one register means different things in two modes.  A deferred write keeps its
origin: a stop ends it like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Final

from urbihw.buses import messages as m
from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.item import Item, Mode
from urbihw.buses.servos.item import ShaftMotion as ModeMotion
from urbihw.kernel.uobject import EffectorDevice, Motion, Origin, UVar, event, number, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.servos import words
from urbihw.platforms.servos.devices import Refused, ServoBusDevice
from urbihw.platforms.servos.frame import JointFrame
from urbihw.platforms.servos.joint import JointCounts
from urbihw.platforms.servos.servolimits import ServoLimits
from urbihw.platforms.servos.slots import ChangeHandler, RegisterSlot

_PROBE_COUNTS: Final = 1000  # converted to rad/s, they give the scale of a register
_MODE_WORDS: Final = {"joint": "position", "wheel": "velocity"}
"""Names of modes of the older models -> those of the newer ones; both may be written to ``mode``."""
_NO_SPEEDS: Final = frozenset({"goal_current", "goal_pwm", "goal_torque", "goal_position"})
"""Effectors of modes that make no wheel."""
Step = tuple[str, Any]
"""One write of a change of mode: item and raw count, or ``PRESENT_POSITION``."""


class ServoMotor(ServoBusDevice, EffectorDevice):
    """The base of the kinds of servos: how its mode is selected tells them apart."""

    slot_words = words.SERVO

    kind_of_device = "motor"
    wheel = reading(False)
    mode = owned("")
    jointName = reading("")
    blockedFor = reading(0.0)
    blocked = event()
    overspeed = event()

    goal: ClassVar[str] = "goal_position"
    limits: tuple[str, str]
    """The registers of cwLimit and ccwLimit."""

    def init(  # type: ignore[override]
        self, channel: DeviceChannel, info: DeviceInfo, refused: Refused, motion: Motion, frame: JointFrame
    ) -> None:
        """``motion`` is who may move the robot, ``frame`` the joint that the servo is."""
        self.motion = motion
        self.frame = frame
        self.joint = JointCounts(self.table_for(info), frame)
        self.mode_read: Mode | None = None
        self.jointName.sense(frame.name)
        super().init(channel, info, refused)

    def prepare(self) -> None:
        """Bind the writes of the slots val, speed, mode, load, cwLimit and ccwLimit."""
        self.val, self.speed, self.load = (self.variables[name] for name in ("val", "speed", "load"))
        self.cw_limit, self.ccw_limit = self.variables["cwLimit"], self.variables["ccwLimit"]
        self._off = False
        self._switches = 0
        self._fastest = math.inf, ""
        self._speed_wanted: int | None = None
        self._deferred_writes: dict[str, Origin] = {}
        self._limits_wanted: dict[str, float] = {}
        self._limits_planned: dict[str, float] = {}
        self._mode_wanted: Mode | None = None
        self._settle_origin = self.motion.own()
        self._goal_guard = self.guard(self.motion, self.number, self.val)
        self._speed_guard = self.guard(self.motion, self.number, self.speed)
        self.notify_change(self.val, lambda: self._write_val(self._goal_guard.origin))
        self.notify_change(self.speed, lambda: self._write_speed(self._speed_guard.origin))
        self.notify_change(self.load, self._write_load)
        self.notify_change(self.mode, self._write_mode)
        for var in (self.cw_limit, self.ccw_limit):
            self.notify_change(var, self._write_limit)
            set_range(var, *self.joint.range_of(self.limits[0]))
        for item in {*self.table.mode_items, *self.limits}:
            self.on_change(item, lambda raw, stamp: self._update_limits(stamp))
        set_range(self.load, 0.0, 1.0)
        self._blocked_since: float | None = None
        self.blockedFor.set_property("unit", "s")
        self.notify_access(self.blockedFor, self._show_block)

    # ---------------------------------------------------------------- defined by each kind of servo

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """Slowest and fastest speed, rad/s."""
        raise NotImplementedError

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The register and raw count for a speed in rad/s."""
        raise NotImplementedError

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """The writes, in order, that make it a wheel, or a joint with these limits in rad."""
        raise NotImplementedError

    def plan_mode(self, mode: Mode) -> list[Step]:
        """The writes, in order, that select a mode."""
        raise NotImplementedError

    def plan_on(self) -> list[Step]:
        """The writes that switch the motor on, holding where it is."""
        raise NotImplementedError

    # ---------------------------------------------------------------- val

    def change_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """Return the handlers of the slots that depend on several registers or on the mode."""
        if row.name == "speed":
            return self.speed_handler(row, var)
        if row.name == "load":
            return lambda raw, stamp: self.update_load(stamp)
        if row.name in ("cwLimit", "ccwLimit"):
            return lambda raw, stamp: None
        return self._framed_handler(row, var)

    def speed_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """Return the handler of the present speed; override where it depends on the mode."""
        return self._framed_handler(row, var)

    def _framed_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        if self.frame.is_plain:
            return super().change_handler(row, var)
        return self.joint.change_handler(row, var, self.facts)

    def raw_of(self, row: RegisterSlot, value: float) -> int:
        """Return the raw count for a value of a slot, in the frame of the joint.  Raises BadValue."""
        return super().raw_of(row, self.frame.wanted(row.name, value))

    def _write_val(self, origin: Origin) -> None:
        raw = self.joint.count_of(self.goal, number(self.val))
        if self.switching:
            self._deferred_writes["val"] = origin
        elif self.takes_positions and not self._off:
            self.channel.set_target(self.number, self.goal, raw, origin, self.goal_scale)
            self._enable_torque(origin)

    # ---------------------------------------------------------------- what the body does

    def set_blocked(self, since: float | None) -> None:
        """Something keeps the joint from its goal since that time of the kernel's clock, None: nothing does."""
        self._blocked_since = since
        self._show_block()
        if since is not None:
            self.log.warning("motor %d is blocked on its way to its goal", self.number)
            self.blocked.emit(self.blockedFor.sensed)

    def set_too_fast(self, speed: float) -> None:
        """The joint turns faster than its limit."""
        self.log.warning("motor %d turns at %.1f rad/s, above %s", self.number, speed, self._fastest[1])
        self.overspeed.emit(speed)

    def _show_block(self) -> None:
        since = self._blocked_since
        self.blockedFor.sense(0.0 if since is None else max(0.0, self.host.now() - since))

    def explain_hindrance(self) -> str:
        if self._blocked_since is None:
            return ""
        return f"blocked for {self.host.now() - self._blocked_since:.1f} s: free the joint, or robot.stop"

    @property
    def goal_scale(self) -> float:
        """Counts of the goal for 1 rad."""
        item = self.table.item(self.goal)
        return 1 / (units.to_si(item, 1) - units.to_si(item, 0))

    @property
    def takes_positions(self) -> bool:
        """Whether a goal position moves it in its present mode."""
        return self.mode_read is None or self.mode_read.motion is ModeMotion.POSITION

    @property
    def is_off(self) -> bool:
        """Whether it stays off until ``load`` is written."""
        return self._off

    def explain_off(self) -> str:
        """Return why a write does not move it, "" if it does; while it is being switched on, writes are deferred."""
        # Behind an alarm the advice to switch it on would not help.
        alarm = self.explain_alarm()
        if alarm and not self.switching:
            return alarm
        return f"motor {self.number} is off: switch it on with load = 1" if self._off else ""

    def _enable_torque(self, origin: Origin) -> None:
        """Switch the torque on with a goal: an AX servo does that by itself, others do not."""
        if self.raw.get("torque_enable") != 1:
            self.channel.set_target(self.number, "torque_enable", 1, origin)

    # ---------------------------------------------------------------- speed

    def _write_speed(self, origin: Origin) -> None:
        value = number(self.speed)
        if self.switching:
            self._deferred_writes["speed"] = origin
            return
        wheel = bool(self.wheel.sensed)
        item, raw = self.speed_target(value, wheel)
        if wheel:
            if self._off:
                return
            self._enable_torque(origin)
            self.channel.set_target(self.number, item, raw, origin, self.wheel_scale()[1])
        else:
            self._speed_wanted = raw
            self._write_joint_speed()
            if value > self._fastest[0]:
                self.show_limited(*self._fastest)

    # ---------------------------------------------------------------- limits of the settings

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits to raw counts for the present mode: see ``platforms.hooks.LimitedDevice``."""
        limits, named = self._with_range(limits, named)
        made = ServoLimits(self.number, limits, named)
        self._fastest = limits.speed, named("speed")
        # In every mode: by them the worker knows that limits hold, and refuses modes that cannot keep them.
        table = made.joint_limits(self.table.item(self.goal), self.frame)
        if self.wheel.sensed:
            table |= made.wheel_limits(*self.wheel_scale())
        table = {**table, **self._limit_joint_speed()}
        row = self.find_row("torqueLimit")
        if row is None:
            return table, made.thresholds("", 0, False)
        strongest = self._max_torque_count(row, limits.torque)
        drives = self.mode_read is not None and self.mode_read.effector == row.item
        if math.isfinite(limits.torque) and not drives:
            # An alarm sets the register to 0; that is not a limit that a program has written.
            most = min(strongest, self.settings.get(row.item) or self.raw.get(row.item) or strongest)
            self.show_wanted(row.item, most)
            self.set_setting(row.item, most)
        table = table | made.torque_limits(row.item, strongest, drives)
        return table, made.thresholds(row.item, strongest, drives)

    def _with_range(self, limits: DeviceLimits, named: LimitNamer) -> tuple[DeviceLimits, LimitNamer]:
        """Return the limits with the range of the joint, and the names of the settings that they come from."""
        (low, high), (least, most) = limits.position, (self.frame.low, self.frame.high)
        if (least, most) == (-math.inf, math.inf):
            return limits, named
        narrow = replace(limits, position=(min(max(low, least), most), max(min(high, most), least)))
        own = narrow.position != limits.position
        return narrow, lambda kind: self.frame.limit if kind == "position" and own else named(kind)

    def mark_released(self) -> None:
        """The worker has switched it off; it stays off until ``load`` is written."""
        self._off = True

    def _max_torque_count(self, row: RegisterSlot, torque: float) -> int:
        """The largest count of the torque limit that is no more than a torque in N m."""
        item = self.table.item(row.item)
        share = min(row.view.to_si(torque, self.facts), units.limits_si(item)[1])
        return int(whole_counts(0.0, share / units.to_si(item, 1))[1])

    def _limit_joint_speed(self) -> LimitTable:
        """Bound the servo's own speed on its way to a goal; return the limit of its register.

        So the servo keeps the limit by itself, too, when the worker is dead.  A limit of the acceleration is not
        written: it would slow down a stop.
        """
        if self.wheel.sensed or not self.takes_positions:
            return {}
        self._write_joint_speed()
        item, most = self._joint_speed_limit()
        if most is None:
            return {}
        return {(self.number, item): m.Limit(-most, most, name=self._fastest[1])}

    def _joint_speed_limit(self) -> tuple[str, int | None]:
        """The register of a joint's speed ("" for none), and its highest count under the limit, None without one."""
        item = self.joint_speed_item
        if not item or math.isinf(self._fastest[0]):
            return item, None
        unit, row = units.unit_of(self.table.item(item)), self.table.item(item)
        most = max(row.low, 1)
        most = max(most, min(row.high if unit.high is None else unit.high, unit.to_raw(self._fastest[0])))
        return item, most - 1 if most > 1 and unit.to_si(most) > self._fastest[0] else most

    def _write_joint_speed(self) -> None:
        """Write the speed that a program wants, or that the limit leaves of it, where it changes something."""
        item, most = self._joint_speed_limit()
        wanted = self._speed_wanted
        if not item or (wanted is None and most is None and item not in self.settings):
            return
        # 0 is the full speed of the servo.
        raw = wanted or 0
        raw = raw if most is None else min(raw or most, most)
        if self.settings.get(item) != raw or raw == wanted:
            self.set_setting(item, raw)

    @property
    def joint_speed_item(self) -> str:
        """The register of the speed of a joint on its way to a goal, "" for none."""
        raise NotImplementedError

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited target in the slot that was written."""
        if message.device != self.number:
            return
        if message.item == self.goal:
            self.limit_applied(self.joint.angle_of(self.goal, int(message.applied)), message.limit)
        elif self.wheel.sensed and message.item == self.wheel_scale()[0]:
            raw = int(message.applied)
            self.limit_applied(self.speed_of(raw), message.limit)

    def find_row(self, slot: str) -> RegisterSlot | None:
        """The row of a slot, None if it has none."""
        return next((row for row in self.rows if row.name == slot), None)

    def wheel_scale(self) -> tuple[str, float]:
        """The register of a wheel's speed, and its counts for 1 rad/s."""
        item, _ = self.speed_target(0.0, True)
        return item, _PROBE_COUNTS / self.speed_of(_PROBE_COUNTS)

    def wheel_unit(self, item: Item) -> float:
        """Return rad/s for 1 of a speed register of a wheel: 1, or full speed where it is a share of full drive."""
        return 1.0 if units.unit_of(item, True).symbol else self.facts.full_speed

    def speed_of(self, raw: int) -> float:
        """Return the wheel speed in rad/s of a raw target."""
        raise NotImplementedError

    # ---------------------------------------------------------------- mode

    def _write_mode(self) -> None:
        wanted = self.mode.value
        if not isinstance(wanted, str):
            raise ValueError("this slot takes the name of a mode")
        mode = self._mode_named(wanted)
        # As a change of the limits, it may move the servo slightly.
        self.motion.check()
        self._mode_wanted = mode
        self._settle_origin = self.motion.origin()
        self.mode.sense(mode.name)
        # What is written after it refers to that mode.
        set_range(self.val, *self._range_in(mode))
        set_range(self.speed, *self.speed_range(makes_wheel(mode)))
        self.channel.settle_later(self)

    def _range_in(self, mode: Mode | None) -> tuple[float, float]:
        """Return the lowest and highest position of the joint in a mode."""
        if mode is None or mode.limits:
            least, most = sorted(self.joint.angle_of(item, self.raw[item]) for item in self.limits)
        else:
            least, most = self.joint.range_of(self.goal if mode.motion is ModeMotion.POSITION else self.limits[0])
        return max(least, min(self.frame.low, most)), min(most, max(self.frame.high, least))

    def _mode_named(self, name: str) -> Mode:
        """Return a mode by its name, the name that other models have for it, or the first word of its name."""
        names = [mode.name for mode in self.table.modes]
        found = [mode for mode in self.table.modes if name in (mode.name, _MODE_WORDS.get(mode.name))]
        found = found or [mode for mode in self.table.modes if mode.name.split()[0] == name]
        if not found:
            raise ValueError(f"no mode {name!r}; there are: {', '.join(names)}")
        return found[0]

    # ---------------------------------------------------------------- load

    def _write_load(self) -> None:
        off = number(self.load) == 0
        if not off:
            self.motion.check_device(self.number)
        self._off = off
        self.load.sense(0.0 if off else 1.0)
        self.write_steps([("torque_enable", 0)] if self._off else self.plan_on(), "load")

    def write_steps(self, steps: list[Step], slot: str, origin: Origin | None = None) -> None:
        """Execute several writes without interruption; writes to val and speed are deferred meanwhile.

        ``origin`` is who has asked for them, None for the running job.
        """
        if not steps:
            self._send_deferred_writes()
            return
        self._switches += 1
        asked = self.motion.origin() if origin is None else origin

        def replied(reply: Reply) -> None:
            self._switches -= 1
            if reply.ok:
                self.update_values(dict(reply.value), self.host.now())
            else:
                self.refused(slot, self.explain_error(reply.error))
                self.motion.warn(asked, f"{slot} of motor {self.number} not written: {self.explain_error(reply.error)}")
                # A motor that could not be switched on counts as off, until its register is read again.
                self._off = self._off or slot == "load"
                if slot == "mode":
                    # What was written for that mode means something else in another.
                    self._deferred_writes = {}
                self._deferred_writes.pop(slot, None)
                for item, _ in steps:
                    self.channel.read(self.number, item, lambda read, item=item: self._store_reading(item, read, slot))  # type: ignore[misc]
                self._show_known()
            if not self._switches and self._limits_wanted == self._limits_planned:
                self._limits_wanted = {}
            if not self._switches and self.switching:
                # The mode was changed meanwhile; how, depends on the registers as they are now.
                self.channel.settle_later(self)
            self._send_deferred_writes()

        self.channel.write_all(self.number, steps, replied, asked)

    def _show_known(self) -> None:
        """Show the limits and the power as last read: what was wanted has not been done."""
        self._update_limits(self.host.now())
        self.update_load(self.host.now())

    def _store_reading(self, item: str, reply: Reply, refused: str) -> None:
        """Store a register that was read again after a write of the slot ``refused`` was refused."""
        if reply.ok and reply.value is not None:
            self.update_values({item: reply.value}, self.host.now())
            if refused == "load" and item == "torque_enable" and not self._switches:
                self._off = not reply.value  # it was on before, and is still

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
        self._settle_origin = self.motion.origin()
        var.sense(number(var))
        least, most = self._wanted_limits()
        # A speed that is written after the limits refers to the mode that they select, whatever was selected before.
        self._mode_wanted = None
        set_range(self.speed, *self.speed_range(least == most == 0))
        # ``cwLimit = ccwLimit = 0`` is two writes that select one mode: combine them at the end of the round.
        self.channel.settle_later(self)

    def _wanted_limits(self) -> tuple[float, float]:
        wanted = self._limits_wanted
        return wanted.get("cwLimit", self.cw_limit.sensed), wanted.get("ccwLimit", self.ccw_limit.sensed)

    def settle(self) -> None:
        """End of a round in which the mode or limits were written: select the mode, or write the limits."""
        if self._switches:
            return
        mode, self._mode_wanted = self._mode_wanted, None
        if mode is not None:
            self._limits_wanted = {}
            self.write_steps(self.plan_mode(mode), "mode", self._settle_origin)
            return
        least, most = self._wanted_limits()
        steps = self.plan_limits(least == most == 0, least, most)
        # They count until they are written: the second one of ``cwLimit = ccwLimit = 0`` may come in a later round.
        self._limits_planned = dict(self._limits_wanted) if steps else {}
        if not steps:
            self._limits_wanted = {}
        self.write_steps(steps, "cwLimit, ccwLimit", self._settle_origin)

    @property
    def switching(self) -> bool:
        """Whether several writes are being executed; what is written to the effectors meanwhile is deferred."""
        return bool(self._switches or self._limits_wanted or self._mode_wanted)

    def defer_write(self, slot: str, origin: Origin) -> None:
        """Write an effector again, with its value at that time, when the present writes have been executed."""
        self._deferred_writes[slot] = origin

    def effector_writers(self) -> dict[str, Callable[[Origin], None]]:
        """Return the slots that move the servo, in the order in which they are written, and how; override to add."""
        return {"speed": self._write_speed, "val": self._write_val}

    def _send_deferred_writes(self) -> None:
        if self.switching:
            return
        deferred, self._deferred_writes = self._deferred_writes, {}
        for slot, write in self.effector_writers().items():
            origin = deferred.get(slot)
            if origin is not None and self.motion.is_live(origin, self.number):
                try:
                    write(origin)
                except ValueError as error:
                    # Its statement has ended, and no one waits for the error.
                    self.motion.warn(origin, f"{slot} of motor {self.number} not written: {error}")

    def _update_limits(self, stamp: float) -> None:
        if any(item not in self.raw for item in (*self.table.mode_items, *self.limits)):
            return
        mode = self.mode_read = self.table.mode_of(self.raw)
        self.mode.sense("" if mode is None else mode.name, stamp)
        wheel = mode is not None and makes_wheel(mode)
        least, most = sorted(self.joint.angle_of(item, self.raw[item]) for item in self.limits)
        self.wheel.sense(wheel)
        self.cw_limit.sense(0.0 if wheel else least, stamp)
        self.ccw_limit.sense(0.0 if wheel else most, stamp)
        set_range(self.val, *self._range_in(mode))
        set_range(self.speed, *self.speed_range(wheel))
        self.mode_changed()

    mode_changed: Callable[[], None] = staticmethod(lambda: None)
    """Called when its mode or its limits have been read."""


def makes_wheel(mode: Mode) -> bool:
    """Return whether a servo turns without end in a mode, at a speed that is set."""
    return mode.motion is ModeMotion.RATE and mode.effector not in _NO_SPEEDS
