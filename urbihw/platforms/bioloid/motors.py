"""Servos: the classes AX12 (protocol 1.0) and XServo (protocol 2.0), with the same slots where the devices have them.

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
from urbihw.buses.dynamixel import units
from urbihw.buses.dynamixel.device import DeviceInfo
from urbihw.buses.dynamixel.status import state_words
from urbihw.buses.dynamixel.stop import HERE
from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import EffectorDevice, Motion, Origin, UVar, function, number, reading, set_range
from urbihw.platforms.base import LimitTable, Named
from urbihw.platforms.bioloid import slots
from urbihw.platforms.bioloid.devices import Device, Refused, Take
from urbihw.platforms.bioloid.servolimits import ServoLimits
from urbihw.platforms.bioloid.slots import Slot
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.wire import Wire

_MANY: Final = 1000  # counts of which the speed is asked to know that of one
Step = tuple[str, Any]
"""One write of a switch of mode: item and raw count, or ``HERE``."""


class Servo(Device, EffectorDevice):
    """What both kinds of servos share."""

    kind_of_device = "motor"
    wheel = reading(False)

    goal: ClassVar[str] = "goal_position"
    limits: ClassVar[tuple[str, str]]
    """The registers of cwLimit and ccwLimit."""

    def init(self, wire: Wire, info: DeviceInfo, refused: Refused, motion: Motion) -> None:  # type: ignore[override]
        """``motion`` is who may move the robot."""
        self.motion = motion
        super().init(wire, info, refused)

    def prepare(self) -> None:
        """Bind what the slots val, speed, load, cwLimit and ccwLimit do."""
        self.val, self.speed, self.load = (self.variables[name] for name in ("val", "speed", "load"))
        self.cw_limit, self.ccw_limit = self.variables["cwLimit"], self.variables["ccwLimit"]
        self._off = False
        self._switches = 0
        self._fastest = math.inf, ""
        self._deferred: dict[str, Origin] = {}
        self._limits_wanted: dict[str, float] = {}
        self._goal_guard = self.guard(self.motion, self.number, self.val)
        self._speed_guard = self.guard(self.motion, self.number, self.speed)
        self.notify_change(self.val, lambda: self._val_written(self._goal_guard.origin))
        self.notify_change(self.speed, lambda: self._speed_written(self._speed_guard.origin))
        self.notify_change(self.load, self._load_written)
        for var in (self.cw_limit, self.ccw_limit):
            self.notify_change(var, self._limit_written)
            set_range(var, *units.limits_si(self.table.item(self.goal_item_of_limits())))
        for item in (*self.mode_items(), *self.limits):
            self.on_change(item, lambda raw, stamp: self._limits_read(stamp))
        set_range(self.load, 0.0, 1.0)

    def goal_item_of_limits(self) -> str:
        """The register whose range bounds the limits."""
        return self.limits[0]

    def mode_items(self) -> tuple[str, ...]:
        """Registers beside the limits that decide whether it is a wheel; override."""
        return ()

    # ---------------------------------------------------------------- what a kind of servo defines

    def reads_wheel(self) -> bool:
        """Whether its registers, as last read, make it a wheel."""
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

    def taker(self, row: Slot, var: UVar) -> Take:
        """Registers of the slots with a meaning of their own."""
        if row.name == "speed":
            return self.speed_taker(row, var)
        if row.name == "load":
            return lambda raw, stamp: self.load_read(stamp)
        if row.name in ("cwLimit", "ccwLimit"):
            return lambda raw, stamp: None
        return super().taker(row, var)

    def speed_taker(self, row: Slot, var: UVar) -> Take:
        """How the present speed is read; override where the mode matters."""
        return super().taker(row, var)

    def _val_written(self, origin: Origin) -> None:
        raw = units.from_si(self.table.item(self.goal), number(self.val))
        if self._switching:
            self._deferred["val"] = origin
        elif not self.wheel.sensed and not self._off:
            self.wire.aim(self.number, self.goal, raw, origin)
            self._want_torque(origin)

    def explain_off(self) -> str:
        """See ``EffectorDevice``: while it is being switched on, what is written waits for that."""
        if self._off:
            return f"motor {self.number} is off: switch it on with load = 1"
        return "" if self._switching else self.explain_alarm()

    def explain_alarm(self) -> str:
        """Why an alarm leaves it without torque, and what ends that; "" while none does; override."""
        return ""

    def _want_torque(self, origin: Origin) -> None:
        """An AX servo switches its torque on by itself when given a goal, others do not: say it to both."""
        if self.raw.get("torque_enable") != 1:
            self.wire.aim(self.number, "torque_enable", 1, origin)

    # ---------------------------------------------------------------- speed

    def _speed_written(self, origin: Origin) -> None:
        value = number(self.speed)
        if self._switching:
            self._deferred["speed"] = origin
            return
        wheel = bool(self.wheel.sensed)
        item, raw = self.speed_target(value, wheel)
        if wheel:
            if self._off:
                return
            self._want_torque(origin)
            self.wire.aim(self.number, item, raw, origin)
        else:
            self.settings[item] = raw
            self.wire.aim(self.number, item, raw)
            if value > self._fastest[0]:
                self.show_applied(*self._fastest)

    # ---------------------------------------------------------------- limits of the settings

    def limits_in_counts(self, limits: DeviceLimits, named: Named) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.base.Limited``: those of the present mode."""
        row = self.row("torqueLimit")
        strongest = self._strongest(row, limits.torque)
        if math.isfinite(limits.torque):
            # 0 is what an alarm has left: no torque limit of anybody's.
            self._set(row, min(strongest, self.settings.get(row.item) or self.raw.get(row.item) or strongest))
        made = ServoLimits(self.number, limits, named)
        self._fastest = limits.speed, named("speed")
        if self.wheel.sensed:
            table = made.wheel(*self.wheel_scale())
        else:
            table = made.joint(self.table.item(self.goal))
        return table | made.torque(row.item, strongest), made.thresholds(row.item, strongest)

    def released(self) -> None:
        """The worker has switched it off: it stays off until ``load`` is written."""
        self._off = True

    def _strongest(self, row: Slot, torque: float) -> int:
        """The largest count of the torque limit that is no more than a torque in N m."""
        item = self.table.item(row.item)
        share = min(row.view.take(torque, self.facts), units.limits_si(item)[1])
        return int(whole_counts(0.0, share / units.to_si(item, 1))[1])

    def was_limited(self, message: m.Limited) -> None:
        """See ``platforms.base.Limited``."""
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
        return item, _MANY / self.speed_of(_MANY)

    def speed_of(self, raw: int) -> float:
        """The speed of a wheel, rad/s, that a count of its register asks for."""
        raise NotImplementedError

    # ---------------------------------------------------------------- load

    def _load_written(self) -> None:
        off = number(self.load) == 0
        if not off:
            self.motion.check_device(self.number)
        self._off = off
        self._switch([("torque_enable", 0)] if self._off else self.plan_on(), "load")

    def _switch(self, steps: list[Step], slot: str) -> None:
        """Several writes that belong together; what is written to val and speed meanwhile comes behind them."""
        if not steps:
            self._send_deferred()
            return
        self._switches += 1

        def replied(reply: Reply) -> None:
            self._switches -= 1
            if reply.ok:
                self.take(dict(reply.value), self.host.now())
            else:
                self.refused(slot, self.explained(reply.error))
                # A motor that could not be switched on stays off until that is asked for again.
                self._off = self._off or slot == "load"
                for item, _ in steps:
                    self.wire.read(self.number, item, lambda read, item=item: self._read_again(item, read))  # type: ignore[misc]
            self._send_deferred()

        self.wire.write_all(self.number, steps, replied, self.motion.origin())

    def _read_again(self, item: str, reply: Reply) -> None:
        if reply.ok and reply.value is not None:
            self.take({item: reply.value}, self.host.now())

    def load_read(self, stamp: float) -> None:
        """A register that decides about the slot load was read."""
        self.load.sense(float(self.raw.get("torque_enable", 0)), stamp)

    def restore(self) -> None:
        """Set again what urbiscript had set; a motor that was switched off stays off."""
        super().restore()
        if self._off:
            self.write("torque_enable", 0, "load")

    # ---------------------------------------------------------------- limits and mode

    def _limit_written(self, var: UVar) -> None:
        # A switch of mode may move it a little: not for a statement that was stopped.
        self.motion.check()
        self._limits_wanted[var.name] = number(var)
        least, most = self._wanted()
        # A speed written behind the limits means the mode that they make.
        set_range(self.speed, *self.speed_range(least == most == 0))
        # ``cwLimit = ccwLimit = 0`` is two writes that are one wish.
        self.wire.settle_later(self)

    def _wanted(self) -> tuple[float, float]:
        wanted = self._limits_wanted
        return wanted.get("cwLimit", self.cw_limit.sensed), wanted.get("ccwLimit", self.ccw_limit.sensed)

    def settle(self) -> None:
        """The round in which limits were written is over: switch mode, or set them."""
        least, most = self._wanted()
        self._limits_wanted = {}
        self._switch(self.plan_limits(least == most == 0, least, most), "cwLimit, ccwLimit")

    @property
    def _switching(self) -> bool:
        return bool(self._switches or self._limits_wanted)

    def _send_deferred(self) -> None:
        if self._switching:
            return
        deferred, self._deferred = self._deferred, {}
        for slot, write in (("speed", self._speed_written), ("val", self._val_written)):
            origin = deferred.get(slot)
            if origin is not None and self.motion.is_live(origin, self.number):
                write(origin)

    def _limits_read(self, stamp: float) -> None:
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
    """Called when its mode or its limits were read anew."""


_CRAWL: Final = 1
"""Counts of an AX's moving_speed: 0.1 rpm of a joint, 0.1 % of the drive of a wheel."""


class AX12(Servo):
    """An AX-12, AX-12W or AX-18."""

    rows = slots.AX12
    limits = ("cw_angle_limit", "ccw_angle_limit")

    def prepare(self) -> None:
        """The torque limit says whether an alarm switched the motor off."""
        super().prepare()
        self.on_change("torque_limit", lambda raw, stamp: self.load_read(stamp))

    def load_read(self, stamp: float) -> None:
        """After an alarm the torque limit is 0: the motor gives no torque, whatever torque enable says."""
        on = self.raw.get("torque_enable") == 1 and self.raw.get("torque_limit") != 0
        self.load.sense(float(on), stamp)

    def explain_alarm(self) -> str:
        """After an alarm the torque limit is 0."""
        if self.raw.get("torque_limit") != 0:
            return ""
        return f"motor {self.number} gives no torque since an alarm: switch it on with load = 1"

    def lasting(self) -> dict[str, int]:
        """The speed that was set for a joint would drive a wheel."""
        wheel = bool(self.wheel.sensed)
        return {item: raw for item, raw in self.settings.items() if not (wheel and item == "moving_speed")}

    def plan_on(self) -> list[Step]:
        """Goal where it is (an old goal must not move it), torque limit back after an alarm, torque on."""
        steps: list[Step] = []
        if not self.wheel.sensed:
            steps.append((self.goal, HERE))
        if self.raw.get("torque_limit") == 0:
            steps.append(("torque_limit", self.settings.get("torque_limit", self.raw.get("max_torque", 1023))))
        return [*steps, ("torque_enable", 1)]

    def reads_wheel(self) -> bool:
        """Both angle limits 0."""
        return not any(self.raw[item] for item in self.limits)

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """A wheel turns both ways, up to its speed without load; of a joint 0 is the slowest there is."""
        if wheel:
            return -self.facts.full_speed, self.facts.full_speed
        return 0.0, units.UNITS["ax_speed"].to_si(1023)

    def speed_target(self, value: float, wheel: bool) -> Step:
        """A wheel is driven open loop: a share of full drive, taken to give that share of full speed."""
        item = self.table.item("moving_speed")
        return item.name, units.from_si(item, value / self.facts.full_speed if wheel else value, wheel)

    def speed_of(self, raw: int) -> float:
        """The inverse of ``speed_target``."""
        return units.to_si(self.table.item("moving_speed"), raw, True) * self.facts.full_speed

    def speed_taker(self, row: Slot, var: UVar) -> Take:
        """The present speed of a wheel is a share of full drive, too."""
        item, full = self.table.item(row.item), self.facts.full_speed

        def take(raw: int, stamp: float) -> None:
            if self.wheel.sensed:
                var.sense(units.to_si(item, raw, wheel=True) * full, stamp)
            else:
                var.sense(units.to_si(item, raw), stamp)

        return take

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """Speed first: that of a joint would drive the wheel, and that of a wheel is no speed of a joint.

        Between the writes, and if the servo does not answer in the middle of them, it has the least speed there is: a
        wheel does not turn with it, and a joint hardly moves; 0 would be full speed to a joint.
        """
        cw, ccw = self.limits
        if wheel:
            values = {cw: 0, ccw: 0}
        else:
            values = {item: units.from_si(self.table.item(item), si) for item, si in ((cw, least), (ccw, most))}
            values[ccw] = max(values[ccw], 1)
        steps: list[Step] = [(item, raw) for item, raw in values.items() if self.raw.get(item) != raw]
        if wheel == self.wheel.sensed or not steps:
            return steps
        if wheel:
            return [("moving_speed", _CRAWL), *steps, ("moving_speed", 0)]
        # It would go to the goal that it had before it was a wheel.
        held: list[Step] = [(self.goal, HERE)] if self.raw.get("torque_enable") == 1 else []
        return [("moving_speed", _CRAWL), *steps, *held, ("moving_speed", self.settings.get("moving_speed", 0))]

    def take_state(self, raw: int, stamp: float) -> None:
        """The error bits say what is wrong."""
        self.show_alarm(state_words(raw, self.protocol))


_REBOOTS = 1.0
"""Seconds in which a servo starts; it takes about 0.3."""
_HARDWARE_ERRORS = {0: "input voltage", 2: "overheating", 3: "encoder", 4: "electrical shock", 5: "overload"}
_POSITION, _VELOCITY = 3, 1


class XServo(Servo):
    """An X-series servo: XL330, XC330, XL430, XC430, XM430."""

    limits = ("min_position_limit", "max_position_limit")
    hidden = (("operating_mode", slots.RARE), ("hardware_error", slots.SLOW), ("velocity_limit", slots.RARE))

    def init(self, wire: Wire, info: DeviceInfo, refused: Refused, motion: Motion) -> None:  # type: ignore[override]
        """The XL430 family tells its load, the others measure their current."""
        self.rows = slots.XL430 if info.family == "XL430" else slots.X_CURRENT
        super().init(wire, info, refused, motion)

    def prepare(self) -> None:
        """A register says what is wrong with it; the torque limit has no sign."""
        super().prepare()
        self.on_change("hardware_error", self._take_hardware_error)
        set_range(self.variables["torqueLimit"], 0.0, self.facts.stall_torque)

    def mode_items(self) -> tuple[str, ...]:
        """The operating mode is a register of its own."""
        return ("operating_mode",)

    def reads_wheel(self) -> bool:
        """Velocity mode."""
        return self.raw["operating_mode"] == _VELOCITY

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """Up to its velocity limit."""
        item = self.table.item("velocity_limit")
        fastest = units.to_si(item, self.raw.get("velocity_limit", item.default or item.high))
        return (-fastest if wheel else 0.0), fastest

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The goal of a wheel, the profile of a joint."""
        item = self.table.item("goal_velocity" if wheel else "profile_velocity")
        return item.name, units.from_si(item, value)

    def speed_of(self, raw: int) -> float:
        """The inverse of ``speed_target``."""
        return units.to_si(self.table.item("goal_velocity"), raw)

    def plan_on(self) -> list[Step]:
        """The servo itself then takes the place where it is for its goal."""
        return [("torque_enable", 1)]

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """Mode and limits can only be written while the torque is off."""
        values = {"operating_mode": _VELOCITY if wheel else _POSITION}
        if not wheel:
            for item, si in zip(self.limits, (least, most), strict=True):
                values[item] = units.from_si(self.table.item(item), si)
        steps: list[Step] = [(item, raw) for item, raw in values.items() if self.raw.get(item) != raw]
        if not steps or self.raw.get("torque_enable") == 0:
            return steps
        return [("torque_enable", 0), *steps, ("torque_enable", 1)]

    def explained(self, error: str) -> str:
        """What is kept without power can only be written while the torque is off."""
        if "access" in error and self.raw.get("torque_enable"):
            return f"{error}; switch the motor off first: motor{self.number}.load = 0"
        return error

    def explain_alarm(self) -> str:
        """After an alarm only a restart brings the torque back."""
        if not self.raw.get("hardware_error"):
            return ""
        return f"motor {self.number} gives no torque since an alarm ({self.alarm.sensed}): motor{self.number}.reboot"

    @function
    def reboot(self) -> None:
        """Restart the servo, the only way to get its torque back after an alarm; it goes limp."""
        self.wire.ask("reboot", self.number, self._rebooted)

    def _rebooted(self, reply: Reply) -> None:
        if not reply.ok:
            self.refused("reboot", reply.error)
            return
        handle = 0

        def started() -> None:
            self.remove_timer(handle)
            self.restore()

        # Its RAM is as after power on: it gets its settings again when it listens.
        handle = self.set_timer(_REBOOTS, started)

    def _take_hardware_error(self, raw: int, stamp: float) -> None:
        self.show_alarm(", ".join(word for bit, word in _HARDWARE_ERRORS.items() if raw >> bit & 1))
