"""AX-12: a servo of protocol 1.0 with a motor, a load, heat and alarms.

The motor: drive `u` in -1..1 (a fraction of full voltage; positive is counter-clockwise, larger position) and an
external torque `load` (fraction of stall torque, positive pushes counter-clockwise) give a speed that settles with a
time constant; friction holds it still when both nearly cancel. Joint mode drives by compliance: nothing inside the
margin, then the punch and a ramp over the slope up to full drive, all bounded by the torque limit, and slowed down to
the moving speed. Wheel mode drives with the speed register as it is.

Model choices (numbers not in the sheet): time constant, friction, heating, and that a drive at its limit without motion
counts as overload after `OVERLOAD_TIME`. An overload that shut the servo down lasts until Torque
Limit (34) is written. A goal outside the limits is refused, with the angle limit error. Not covered: calibration
(20..23), gear play, sag of the voltage under load; in the blind zone (300..360 deg) the position reads as the nearer
end.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp

from urbihw_fakes.dynamixel import packet1
from urbihw_fakes.dynamixel.registers import Refusal, Register, Write
from urbihw_fakes.dynamixel.unit import STEP
from urbihw_fakes.dynamixel.unit1 import Unit1

POSITIONS_PER_TURN = 1023 * 360 / 300
DEGREES = 300 / 1023  # of one position step
FULL_SPEED = 59 * 6 / DEGREES  # positions/s without load at 12 V: 59 rpm
SPEED_STEP = 0.666 / DEGREES  # positions/s of one step of Moving Speed (0.111 rpm)
NOMINAL_VOLTS = 12.0
TIME_CONSTANT = 0.008  # s until the speed is within 1/e of its final value
FRICTION = 0.02  # of stall torque
AMBIENT = 32.0  # degC
HEATING = 60.0  # degC above ambient after a long full drive
HEAT_TIME = 300.0  # s
OVERLOAD_TIME = 1.0  # s of stalled drive at its limit
STATE_BITS = packet1.ERR_VOLTAGE | packet1.ERR_HEAT | packet1.ERR_OVERLOAD
CLOCKWISE = 1024  # bit 10 of speeds and loads


def _eeprom(name: str, address: int, size: int, default: int, high: int | None = None, low: int = 0) -> Register:
    """Return a row of the EEPROM; without `high` it is read only."""
    return Register(name, address, size, default, low, high, writable=high is not None, eeprom=True)


def _ram(name: str, address: int, size: int, default: int, high: int | None = None, low: int = 0) -> Register:
    return Register(name, address, size, default, low, high, writable=high is not None)


TABLE = (
    _eeprom("model", 0, 2, 12),
    _eeprom("firmware", 2, 1, 24),
    _eeprom("id", 3, 1, 1, 253),
    _eeprom("baud", 4, 1, 1, 254),
    _eeprom("return_delay", 5, 1, 250, 254),
    _eeprom("cw_limit", 6, 2, 0, 1023),
    _eeprom("ccw_limit", 8, 2, 1023, 1023),
    _eeprom("temperature_limit", 11, 1, 70, 150),
    _eeprom("min_voltage", 12, 1, 60, 250, 50),
    _eeprom("max_voltage", 13, 1, 140, 250, 50),
    _eeprom("max_torque", 14, 2, 1023, 1023),
    _eeprom("status_level", 16, 1, 2, 2),
    _eeprom("alarm_led", 17, 1, 36, 127),
    _eeprom("shutdown", 18, 1, 36, 127),
    _eeprom("down_calibration", 20, 2, 0),
    _eeprom("up_calibration", 22, 2, 0),
    _ram("torque_enable", 24, 1, 0, 1),
    _ram("led", 25, 1, 0, 1),
    _ram("cw_margin", 26, 1, 1, 254),
    _ram("ccw_margin", 27, 1, 1, 254),
    _ram("cw_slope", 28, 1, 32, 254, 1),
    _ram("ccw_slope", 29, 1, 32, 254, 1),
    _ram("goal_position", 30, 2, 0, 1023),
    _ram("moving_speed", 32, 2, 0, 2047),
    _ram("torque_limit", 34, 2, 1023, 1023),
    _ram("present_position", 36, 2, 0),
    _ram("present_speed", 38, 2, 0),
    _ram("present_load", 40, 2, 0),
    _ram("present_voltage", 42, 1, 0),
    _ram("present_temperature", 43, 1, 0),
    _ram("registered", 44, 1, 0),
    _ram("moving", 46, 1, 0),
    _ram("lock", 47, 1, 0, 1, 1),
    _ram("punch", 48, 2, 32, 1023),
)


class Ax12(Unit1):
    """One AX-12, at rest in the middle (512) unless `position` (0..1023) says otherwise.

    Attributes that may be set at any time:
        load: external torque, fraction of stall torque, -1..1, positive counter-clockwise.
        volts: supply.
        position: of the horn, in position steps.
    In addition: `heat`, `overload`, and `pin_register` for any register.
    """

    def __init__(self, unit: int = 1, *, position: float = 512.0) -> None:
        super().__init__(unit, TABLE)
        self.position = position
        self.speed = 0.0  # positions/s
        self.drive = 0.0  # -1..1
        self.load = 0.0
        self.held = False
        self.volts = NOMINAL_VOLTS
        self.celsius = AMBIENT
        self.held_celsius: float | None = None
        self.overloaded = False
        self._stalled_for = 0.0
        self._left_over = 0.0  # remaining seconds, less than a step of the physics
        self.sensors = {
            "present_position": self._raw_position,
            "present_speed": self._raw_speed,
            "present_load": lambda: _signed(self.drive * 1023),
            "present_voltage": lambda: round(self.volts * 10) & 0xFF,
            "present_temperature": lambda: max(0, min(255, int(self.celsius))),
            "moving": lambda: int(self._moving()),
        }
        self.boot()

    # --- power and registers --------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Set the power-on values: goal at the present position, torque limit from Max Torque, torque off."""
        super().boot()
        self.drive = 0.0
        self.overloaded = False
        self._stalled_for = 0.0
        self.registers.put("goal_position", self._raw_position())
        self.registers.put("torque_limit", self.registers.get("max_torque"))

    def heat(self, celsius: float | None) -> None:
        """Fix the temperature at `celsius`; with None the model continues from there."""
        self.held_celsius = celsius
        if celsius is not None:
            self.celsius = celsius

    def overload(self) -> None:
        """Simulate an overload; without overload in Shutdown (18) it ends at once."""
        self.overloaded = True
        if self.registers.get("shutdown") & packet1.ERR_OVERLOAD:
            self._shut_down()

    @property
    def wheel(self) -> bool:
        """Wheel mode: both angle limits are 0."""
        return self.registers.get("cw_limit") == 0 == self.registers.get("ccw_limit")

    @property
    def alarm(self) -> bool:
        """True while the LED blinks an alarm: an error state that the Alarm LED mask names."""
        return bool(self.state_errors() & self.registers.get("alarm_led"))

    def state_errors(self) -> int:
        """Voltage, heat, overload, and in joint mode a goal outside the limits."""
        get = self.registers.get
        errors = self._alarms()
        if not self.wheel and not get("cw_limit") <= get("goal_position") <= get("ccw_limit"):
            errors |= packet1.ERR_ANGLE
        return errors

    def noticed(self, errors: int) -> None:
        """An answer error that the Shutdown mask names stops the servo as the lasting ones do."""
        if errors & self.registers.get("shutdown"):
            self._shut_down()

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """Check a write as in `Unit1`; in joint mode also goal within the limits, speed within 0..1023."""
        write = super().examine(address, data)
        if isinstance(write, Refusal) or self.wheel:
            return write
        get = self.registers.get
        for register, value in write.values:
            if register.name == "goal_position" and not get("cw_limit") <= value <= get("ccw_limit"):
                return Refusal.LIMIT
            if register.name == "moving_speed" and value > 1023:
                return Refusal.RANGE
        return write

    def _refused(self, refusal: Refusal | None) -> int:
        return packet1.ERR_ANGLE if refusal is Refusal.LIMIT else super()._refused(refusal)

    def written(self, register: Register, value: int, before: int) -> None:
        """Switch the torque on at a goal (as libraries report, unconfirmed); end a shutdown at a torque limit."""
        if register.name == "goal_position":
            self.registers.put("torque_enable", 1)
        elif register.name == "torque_limit":
            self.overloaded = False
            self._stalled_for = 0.0

    def _raw_position(self) -> int:
        position = self._here()
        if position > 1023:
            # Blind zone: the nearer end.
            return 1023 if position < (1023 + POSITIONS_PER_TURN) / 2 else 0
        return max(0, round(position))

    def _here(self) -> float:
        """Return the present position with its fraction of a step, 0 up to one turn."""
        return (self.position + self.speed * self._left_over) % POSITIONS_PER_TURN

    def _raw_speed(self) -> int:
        unit = FULL_SPEED / 1000 if self.wheel else SPEED_STEP
        return _signed(self.speed / unit)

    def _moving(self) -> bool:
        """Return whether a goal move is in progress: torque on, joint mode, outside the margins."""
        get = self.registers.get
        if not get("torque_enable") or self.wheel:
            return False
        error = get("goal_position") - self.position
        return abs(error) > max(get("ccw_margin") if error > 0 else get("cw_margin"), 1) + 0.5

    # --- physics --------------------------------------------------------------------------------------------------

    def advance(self, elapsed: float) -> None:
        """Advance in equal steps, so that the frequency of the calls does not change the motion."""
        owed = self._left_over + elapsed
        steps = int(owed / STEP + 1e-6)
        self._left_over = max(0.0, owed - steps * STEP)
        while steps > 0:
            speed, drive = self.speed, self.drive
            span = min(steps, 50)
            self._run(span)
            steps -= span
            steady = abs(self.speed - speed) < 1e-6 and abs(self.drive - drive) < 1e-9
            if steps > 50 and steady and not self._on_its_way():
                # Only angle and heat change from here on: one step instead of many.
                self.position = self._bounded(self.position + self.speed * steps * STEP)
                self._warm(steps * STEP)
                steps = 0

    def _on_its_way(self) -> bool:
        """Return whether a steady state will change: a goal is approached, or a stall becomes an overload."""
        goal_ahead = self.speed != 0.0 and self.drive != 0.0 and not self.wheel
        return goal_ahead or (self._stalled_for > 0.0 and not self.overloaded)

    def _run(self, steps: int) -> None:
        get = self.registers.get
        torque = self.powered and bool(get("torque_enable"))
        if not torque and self.speed == 0.0 and abs(self.load) <= FRICTION:
            self.drive = 0.0
            self._strain(steps * STEP, 0.0)
            return
        wheel = self.wheel
        limit = get("torque_limit") / 1023
        law = WheelDrive(get("moving_speed"), limit) if wheel else _Joint(self, limit)
        full = FULL_SPEED * max(self.volts, 0.0) / NOMINAL_VOLTS if self.powered else FULL_SPEED
        for _ in range(steps):
            drive = law.drive(self.position, self.load) if torque else 0.0
            push = drive + self.load
            if abs(push) <= FRICTION:
                push = 0.0
            else:
                push -= FRICTION if push > 0 else -FRICTION
            self.speed += (push * full - self.speed) * (STEP / TIME_CONSTANT)
            if abs(self.speed) < 1e-3 or self.held:
                self.speed = 0.0
            self.drive = drive
            self.position = self._bounded(self.position + self.speed * STEP)
        self._strain(steps * STEP, limit if torque else 0.0)

    def _strain(self, span: float, limit: float) -> None:
        """What ``span`` seconds of this drive do to the motor: a stall counts, and it warms up."""
        along = self.speed if self.drive > 0 else -self.speed
        stalled = limit > 0 and abs(self.drive) >= limit - 1e-6 and along < 0.02 * FULL_SPEED
        self._stalled_for = self._stalled_for + span if stalled else 0.0
        self._warm(span)

    def _warm(self, span: float) -> None:
        if self.held_celsius is not None:
            self.celsius = self.held_celsius
        else:
            goal = AMBIENT + HEATING * self.drive * self.drive
            self.celsius = goal + (self.celsius - goal) * exp(-span / HEAT_TIME)
        get = self.registers.get
        if self._stalled_for >= OVERLOAD_TIME:
            self.overloaded = True
        elif self.overloaded and get("torque_limit"):
            self.overloaded = False
        if self._alarms() & get("shutdown"):
            self._shut_down()

    def _bounded(self, position: float) -> float:
        """Return the position of a wheel modulo a turn; stop a joint at the ends of its range.

        One that has become a joint beyond them turns back, and no further away.
        """
        if self.wheel:
            return position % POSITIONS_PER_TURN
        within = min(max(position, min(0.0, self.position)), max(1023.0, self.position))
        if within != position:
            self.speed = 0.0
        return within

    def _alarms(self) -> int:
        get = self.registers.get
        errors = packet1.ERR_OVERLOAD if self.overloaded else 0
        if not get("min_voltage") <= round(self.volts * 10) <= get("max_voltage"):
            errors |= packet1.ERR_VOLTAGE
        if int(self.celsius) > get("temperature_limit"):
            errors |= packet1.ERR_HEAT
        return errors

    def _shut_down(self) -> None:
        self.registers.put("torque_limit", 0)
        self.drive = 0.0


class WheelDrive:
    """Wheel mode: the speed register is a voltage."""

    def __init__(self, speed: int, limit: float) -> None:
        wanted = min((speed & 1023) / 1000, 1.0)
        self._drive = max(-limit, min(limit, -wanted if speed & CLOCKWISE else wanted))

    def drive(self, position: float, load: float) -> float:
        """The drive, -1..1, wherever the horn is."""
        return self._drive


class Compliance:
    """The drive of a joint by how far it is from its goal: nothing inside the margin, then the punch and a ramp."""

    def __init__(self, get: Callable[[str], int]) -> None:
        """``get`` reads a register."""
        self._punch = get("punch") / 1023
        self._ccw = (get("ccw_margin"), _floor_slope(get("ccw_slope")))
        self._cw = (get("cw_margin"), _floor_slope(get("cw_slope")))

    def drive(self, error: float) -> float:
        """The drive, -1..1, for an error in position steps."""
        margin, slope = self._ccw if error > 0 else self._cw
        beyond = abs(error) - margin
        if beyond <= 0.0:
            return 0.0
        return (1.0 if error > 0 else -1.0) * min(1.0, self._punch + (1.0 - self._punch) * beyond / slope)


class _Joint:
    """Joint mode: compliance around the goal, slowed to the moving speed."""

    def __init__(self, servo: Ax12, limit: float) -> None:
        get = servo.registers.get
        self._goal = get("goal_position")
        self._limit = limit
        self._compliance = Compliance(get)
        speed = get("moving_speed") & 1023
        full = FULL_SPEED * max(servo.volts, 0.1) / NOMINAL_VOLTS
        # 0 is full speed without control.
        self._cruise = speed * SPEED_STEP / full if speed else None

    def drive(self, position: float, load: float) -> float:
        drive = self._compliance.drive(self._goal - position)
        if drive and self._cruise is not None:
            # The drive that keeps the cruise speed against load and friction.
            sign = 1.0 if drive > 0 else -1.0
            needed = sign * (self._cruise + FRICTION) - load
            drive = min(drive, needed) if sign > 0 else max(drive, needed)
        return max(-self._limit, min(self._limit, drive))


def _floor_slope(value: int) -> int:
    """Return the slope as one of the servo's seven steps: 2, 4, 8, 16, 32, 64, 128 (a written 1 acts as 2)."""
    return max(2, min(128, 1 << (value.bit_length() - 1)))


def _signed(value: float) -> int:
    """Magnitude in bits 0..9, bit 10 set when negative (clockwise)."""
    size = min(1023, round(abs(value)))
    return size | CLOCKWISE if value < 0 and size else size
