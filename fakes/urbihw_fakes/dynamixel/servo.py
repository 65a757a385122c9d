"""Servos of the families in `families`: registers, refusals, and a simple motion.

The motion: a joint goes to its goal, slower and slower near it, at most at its cruise speed, and stands; a wheel turns
with its speed; a servo that is given a torque, a current or a PWM turns with that share of full speed. There are no
forces, no inertia, no heat: the AX-12 and the X series (`ax12`, `xseries`) have these.

Choices where the sheet is silent: a new goal does not switch the torque on (AX does); torque on takes the present
position as the goal; a goal outside the limits is refused (protocol 1.0: angle limit error, 2.0: data limit error).
"""

from __future__ import annotations

from collections.abc import Callable

from urbihw_fakes.dynamixel import packet1
from urbihw_fakes.dynamixel.families import FAMILIES, Family
from urbihw_fakes.dynamixel.registers import Refusal, Register, Write
from urbihw_fakes.dynamixel.unit import STEP, Unit, near
from urbihw_fakes.dynamixel.unit1 import Unit1
from urbihw_fakes.dynamixel.unit2 import BAUDS, Unit2
from urbihw_fakes.errors import UnknownRequest

CLOCKWISE = 1024  # bit 10 of speeds, loads and torques of the older tables
AMBIENT = 32
LAG = 0.03  # seconds by which a joint is behind a moving goal
NEAR = 0.3  # counts from the goal at which it stands
WATCHDOG_STEP = 0.02  # s
FAST_BAUDS = {4030: (6_000_000, 10_500_000), 2020: (6_000_000, 10_500_000), 54024: (10_500_000,)}
DRIVEN, TURNING, POSITIONED = "driven", "turning", "positioned"
MODES = {0: DRIVEN, 1: TURNING, 3: POSITIONED, 4: POSITIONED, 16: DRIVEN}
GOALS = ("goal_position", "goal_velocity", "goal_current", "goal_pwm")


class Shaft(Unit):
    """The part that turns; `position` and `speed` are in position counts (and per second) and may be set at any time.

    Attributes:
        model: name.
        family: its numbers.
        volts: supply.
        held: the horn is held by hand: it does not turn.
    """

    def fit_shaft(self, model: str) -> None:
        """Set up the motion of a model, at rest in the middle."""
        self.model = model
        self.family: Family = FAMILIES[model]
        self.position = float(self.family.middle)
        self.speed = 0.0
        self.volts = self.family.volts
        self.held = False
        self.sensors = {name: sense for name, sense in self._senses().items() if name in self.registers.by_name}
        self.boot()

    def boot(self) -> None:
        """Set the power-on values: no torque, the goal at the present position."""
        super().boot()
        self.speed = 0.0
        self._stay()

    @property
    def full_speed(self) -> float:
        """Counts per second without load."""
        return self.family.full_rpm / 60 * self.family.counts

    @property
    def count_speed(self) -> float:
        """Counts per second of one count of a speed register."""
        return self.family.rpm / 60 * self.family.counts

    @property
    def kind(self) -> str:
        """What it obeys: a position, a speed, or a torque (PWM, current)."""
        raise NotImplementedError

    def commanded_speed(self, kind: str) -> float:
        """Return the set speed in counts/s; for a positioned servo its cruise speed."""
        raise NotImplementedError

    @property
    def bounds(self) -> tuple[int, int] | None:
        """The lowest and the highest goal, None where any is taken."""
        raise NotImplementedError

    def advance(self, elapsed: float) -> None:
        get = self.registers.get
        limp = not get("torque_enable") or ("torque_limit" in self.registers.by_name and not get("torque_limit"))
        if limp or not self.powered or self.held:
            self.speed = 0.0
            return
        kind = self.kind
        speed = max(-self.full_speed, min(self.full_speed, self.commanded_speed(kind)))
        if kind == POSITIONED:
            self._approach(get("goal_position"), abs(speed), elapsed)
        else:
            self.speed = speed
            self.position += speed * elapsed

    def _approach(self, goal: float, cruise: float, elapsed: float) -> None:
        """Go to a goal: the nearer, the slower, and never faster than the cruise speed."""
        while elapsed > 0 and self.position != goal:
            span = min(elapsed, STEP)
            elapsed -= span
            gap = goal - self.position
            pace = min(cruise, abs(gap) / LAG)
            if abs(gap) < NEAR or pace == 0.0:
                self.position, self.speed = (goal if pace else self.position), 0.0
                return
            self.speed = pace if gap > 0 else -pace
            self.position += self.speed * span
        if self.position == goal:
            self.speed = 0.0

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """Check a write as in `Unit`; a goal must lie within the limits."""
        write = super().examine(address, data)
        if isinstance(write, Write) and (bounds := self.bounds) is not None:
            for register, value in write.values:
                if register.name == "goal_position" and not bounds[0] <= value <= bounds[1]:
                    return Refusal.LIMIT
        return write

    def written(self, register: Register, value: int, before: int) -> None:
        """Torque on takes the present position as the goal."""
        if register.name == "torque_enable" and value and not before:
            self._stay()

    def _stay(self) -> None:
        low, high = self.registers.by_name["goal_position"].bounds
        self.registers.put("goal_position", max(low, min(high, self._raw_position())))

    def _raw_position(self) -> int:
        low, high = self.registers.by_name["present_position"].bounds
        return max(low, min(high, round(self.position)))

    def _raw_velocity(self) -> int:
        return round(self.speed / self.count_speed)

    def _senses(self) -> dict[str, Callable[[], int]]:
        return {
            "present_position": self._raw_position,
            "present_velocity": self._raw_velocity,
            "present_voltage": lambda: round(self.volts * 10),
            "present_temperature": lambda: AMBIENT,
            "moving": lambda: int(self.speed != 0.0),
        }


class Servo1(Shaft, Unit1):
    """A servo of protocol 1.0 of one of the `FAMILIES`."""

    answers_bulk_read = True

    def __init__(self, model: str, unit: int = 1) -> None:
        super().__init__(unit, FAMILIES[model].rows)
        self._has_torque_mode = "torque_control" in self.registers.by_name
        self._turns = "multi_turn_offset" in self.registers.by_name
        self.fit_shaft(model)

    @property
    def kind(self) -> str:
        """The angle limits tell: both 0 is a wheel."""
        get = self.registers.get
        if self._has_torque_mode and get("torque_control"):
            return DRIVEN
        return TURNING if get("low_limit") == get("high_limit") == 0 else POSITIONED

    def commanded_speed(self, kind: str) -> float:
        get = self.registers.get
        if kind == DRIVEN:
            return _signed(get("goal_torque")) / 1023 * self.full_speed
        if kind == TURNING:
            step = self.full_speed / 1023 if self.family.shares else self.count_speed
            return _signed(get("speed")) * step
        return (get("speed") & 1023) * self.count_speed or self.full_speed

    @property
    def bounds(self) -> tuple[int, int] | None:
        """The angle limits of a joint; none for a wheel, and where both are 4095 (multi-turn)."""
        low, high = self.registers.get("low_limit"), self.registers.get("high_limit")
        return None if self.kind != POSITIONED or (self._turns and low == high == 4095) else (low, high)

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """A joint takes speeds of 0..1023."""
        write = super().examine(address, data)
        if isinstance(write, Refusal) or self.kind != POSITIONED:
            return write
        too_fast = any(register.name == "speed" and value > 1023 for register, value in write.values)
        return Refusal.RANGE if too_fast else write

    def _refused(self, refusal: Refusal | None) -> int:
        return packet1.ERR_ANGLE if refusal is Refusal.LIMIT else super()._refused(refusal)

    def _senses(self) -> dict[str, Callable[[], int]]:
        return super()._senses() | {"present_speed": self._raw_speed, "present_current": lambda: 2048}

    def _raw_position(self) -> int:
        if self.kind == TURNING:
            return round(self.position % self.family.counts) % round(self.family.counts)
        return super()._raw_position()

    def _raw_speed(self) -> int:
        share = self.family.shares and self.kind == TURNING
        return _with_bit(self.speed / (self.full_speed / 1023 if share else self.count_speed))


class Servo2(Shaft, Unit2):
    """A servo of protocol 2.0 of one of the `FAMILIES`."""

    def __init__(self, model: str, unit: int = 1) -> None:
        self._bauds = (*BAUDS, *FAST_BAUDS.get(FAMILIES[model].number, ()))
        super().__init__(unit, FAMILIES[model].rows)
        self._old_units = "speed" in self.registers.by_name
        self.fast_reads = False
        self.fit_shaft(model)

    @property
    def ids(self) -> tuple[int, ...]:
        """As in `Unit2`; XL-320 and PRO have no secondary ID."""
        return super().ids if "secondary_id" in self.registers.by_name else (self.id,)

    @property
    def baud(self) -> int:
        """As in `Unit2`; the larger models are faster."""
        return self._bauds[self.registers.get("baud")]

    def set_baud(self, baud: int) -> None:
        for value, speed in enumerate(self._bauds):
            if near(speed, baud) and value <= self.registers.by_name["baud"].bounds[1]:
                self.registers.put("baud", value)
                return
        raise UnknownRequest(f"speed {baud}: a {self.model} has no setting near it; there are {self._bauds}")

    @property
    def kind(self) -> str:
        """The mode register tells."""
        mode = self.registers.get("mode")
        if self._old_units:
            return TURNING if mode == 1 else POSITIONED
        return MODES.get(mode, POSITIONED)

    def commanded_speed(self, kind: str) -> float:
        get, rows = self.registers.get, self.registers.by_name
        if self._old_units:
            if kind == TURNING:
                return _signed(get("speed")) / 1023 * self.full_speed
            return (get("speed") & 1023) * self.count_speed or self.full_speed
        if kind == DRIVEN:
            goal = "goal_pwm" if get("mode") == 16 else "goal_current"
            return get(goal) / rows[goal].bounds[1] * self.full_speed
        if kind == TURNING:
            return get("goal_velocity") * self.count_speed
        # PRO has no profile: in the position modes its goal velocity is the limit.
        cruise = get("profile_velocity") if "profile_velocity" in rows else abs(get("goal_velocity"))
        limit = get("velocity_limit")
        return min(cruise or limit, limit) * self.count_speed

    @property
    def bounds(self) -> tuple[int, int] | None:
        """The position limits of the position mode."""
        if self.kind != POSITIONED or self.registers.get("mode") == 4:
            return None
        return self.registers.get("low_limit"), self.registers.get("high_limit")

    def advance(self, elapsed: float) -> None:
        """Advance; stop when the bus watchdog fires."""
        watchdog = self.registers.get("bus_watchdog") if "bus_watchdog" in self.registers.by_name else 0
        until = self.now + elapsed
        fires = self.last_heard + watchdog * WATCHDOG_STEP
        if watchdog > 0 and self.registers.get("torque_enable") and fires < until:
            super().advance(max(0.0, fires - self.now))
            self.registers.put("bus_watchdog", -1)
            for name in GOALS[1:]:
                if name in self.registers.by_name:
                    self.registers.put(name, 0)
            self._stay()
            elapsed = min(elapsed, until - fires)
        super().advance(elapsed)

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """The EEPROM only without torque, no goals after the bus watchdog, only modes that it has."""
        write = super().examine(address, data)
        if isinstance(write, Refusal):
            return write
        get, rows = self.registers.get, self.registers.by_name
        fired = "bus_watchdog" in rows and get("bus_watchdog") == -1
        for register, value in write.values:
            if register.eeprom and get("torque_enable"):
                return Refusal.ACCESS
            if (fired and register.name in GOALS) or (register.name == "bus_watchdog" and value < 0):
                return Refusal.RANGE
            if register.name == "mode" and not self._old_units and value not in MODES:
                return Refusal.RANGE
            if register.name == "speed" and value > 1023 and self.kind == POSITIONED:
                return Refusal.RANGE
        return write

    def _senses(self) -> dict[str, Callable[[], int]]:
        return super()._senses() | {
            "present_speed": lambda: _with_bit(self._share_or_speed()),
            "moving_status": lambda: 0x04 if self.speed else 0x01,
            "present_current": lambda: 0,
            "inverter_temperature": lambda: AMBIENT,
        }

    def _share_or_speed(self) -> float:
        return self.speed / (self.full_speed / 1023 if self.kind == TURNING else self.count_speed)


def _signed(value: int) -> int:
    return -(value & 1023) if value & CLOCKWISE else value


def _with_bit(speed: float) -> int:
    size = min(1023, round(abs(speed)))
    return size | CLOCKWISE if speed < 0 and size else size
