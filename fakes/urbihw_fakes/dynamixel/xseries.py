"""X series: a servo of protocol 2.0 with operating modes, profiles, a bus watchdog and hardware errors.

The firmware side is here (registers, limits, alarms), the motion in `xmotion`, the numbers in `xtables`.

A change of the mode resets gains, profile and the goals of PWM and current, as the e-manual tells ("Operating Mode").
The gains of a new mode are those of a start, whichever it is (model choice).

Choices where the sheet is silent: turning the torque on, or changing the mode, sets the goals to the present position;
the range of Goal Position is +-256 turns in extended position mode, and the limits 48 and 52 in position mode (data
limit error); a fired bus watchdog stops the servo where it is, with its speed, PWM and current goals at 0, and refuses
goals until 0 is written, and any other value of register 98; only instructions to this servo restart it, also those in
the list of a sync or bulk instruction; an error that the Shutdown mask does not name shows in register 70 as well. Not
covered: I and D gains and feedforward (at a constant speed and under a load the horn is behind the trajectory by what
the P gain needs), time-based profiles' exact shape (same duration, trapezoid), drive mode "torque on by goal update"
beyond turning torque on, startup configuration, backup, protocol type 1, boot time.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp

from urbihw_fakes.dynamixel.registers import Refusal, Register, Write
from urbihw_fakes.dynamixel.unit import STEP
from urbihw_fakes.dynamixel.unit2 import Unit2
from urbihw_fakes.dynamixel.xmotion import Motor, Profile
from urbihw_fakes.dynamixel.xtables import (
    CURRENT,
    CURRENT_POSITION,
    EXTENDED,
    FULL_PWM,
    MODELS,
    POSITION,
    PWM,
    STEPS,
    VELOCITY,
    table,
)
from urbihw_fakes.errors import UnknownRequest

VELOCITY_STEP = 0.229 / 60 * STEPS  # position steps/s of one step of velocity
ACCELERATION_STEP = 214.577 / 3600 * STEPS  # position steps/s2
WATCHDOG_STEP = 0.02  # s
HW_VOLTAGE, HW_HEAT, HW_OVERLOAD = 0x01, 0x04, 0x20
DRIVE_REVERSE, DRIVE_TIMED, DRIVE_TORQUE_ON = 0x01, 0x04, 0x08
AMBIENT = 30.0  # degC
HEATING = 50.0  # degC above ambient after a long full drive
HEAT_TIME = 300.0  # s
OVERLOAD_TIME = 1.0  # s of stalled drive at its limit
GOALS = frozenset({"goal_pwm", "goal_current", "goal_velocity", "goal_position"})
RESET_BY_MODE = frozenset(
    {
        "velocity_i", "velocity_p", "position_d", "position_i", "position_p", "feedforward_2", "feedforward_1",
        "profile_acceleration", "profile_velocity",
    }
)  # fmt: skip


class XSeries(Unit2):
    """One servo of a model named in `MODELS`; `position` is that of the horn, in steps (2048 is the middle).

    Attributes that may be set at any time:
        motor.load: external torque, fraction of stall torque, positive counter-clockwise.
        motor.position: of the horn.
        volts: supply.
    In addition: `heat`, `overload`, and `pin_register` for any register.
    """

    def __init__(self, model: str = "XL430-W250", unit: int = 1, *, position: float = 2048.0) -> None:
        if model not in MODELS:
            raise UnknownRequest(f"model {model!r}: not modelled; there are {', '.join(MODELS)}")
        self.model = MODELS[model]
        super().__init__(unit, table(self.model))
        self._indirect_from = min(data for _, data, _ in self.model.indirect)
        self.fast_reads = self.model.firmware >= (46 if self.model.small else 45)
        self.motor = Motor(self.model.velocity_limit * VELOCITY_STEP, position)
        self.profile = Profile(position)
        self.volts = self.model.volts
        self.celsius = AMBIENT
        self.held_celsius: float | None = None
        self._stalled_for = 0.0
        self._left_over = 0.0
        self.sensors = self._sensors()
        self.boot()

    # --- power ----------------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Power-on or REBOOT: RAM defaults, no errors, torque off, position within one turn."""
        super().boot()
        self.pending = None
        self._stalled_for = 0.0
        self.motor.drive = 0.0
        self.motor.position %= STEPS
        self._free_effort()
        self._stay()

    def heat(self, celsius: float | None) -> None:
        """Fix the temperature at `celsius`; with None the model continues from there."""
        self.held_celsius = celsius
        if celsius is not None:
            self.celsius = celsius

    def overload(self) -> None:
        """Simulate an overload: the servo raises its error bit."""
        self._raise(HW_OVERLOAD)

    def clear_turns(self) -> bool:
        """CLEAR: only while the servo stands still."""
        if self.motor.speed or self.profile.velocity:
            return False
        self.motor.position %= STEPS
        self._stay()
        return True

    # --- registers ------------------------------------------------------------------------------------------------

    @property
    def mode(self) -> int:
        """The operating mode of the servo."""
        return self.registers.get("operating_mode")

    @property
    def torque(self) -> bool:
        """True while the motor is driven."""
        return self.powered and bool(self.registers.get("torque_enable"))

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """As in `Unit`, through the indirect area, with the rules of EEPROM, limits, watchdog and hardware errors."""
        values: list[tuple[Register, int]] = []
        for start, part in self._direct_runs(address, data):
            write = super().examine(start, part)
            if isinstance(write, Refusal):
                return write
            values.extend(write.values)
        for register, value in values:
            refusal = self._refuse(register, value)
            if refusal is not None:
                return refusal
        return Write(tuple(values))

    def _refuse(self, register: Register, value: int) -> Refusal | None:
        get = self.registers.get
        if register.eeprom and get("torque_enable"):
            return Refusal.ACCESS
        name = register.name
        if name in GOALS:
            if get("bus_watchdog") < 0:
                return Refusal.RANGE
            low, high = self._goal_limits(name)
            return None if low <= value <= high else Refusal.LIMIT
        if name == "operating_mode" and value not in self.model.modes:
            return Refusal.RANGE
        if name == "bus_watchdog" and (value < 0 or (value > 0 > get("bus_watchdog"))):
            return Refusal.RANGE
        if name == "torque_enable" and value and get("hardware_error") & get("shutdown"):
            # Only REBOOT restores the torque.
            return Refusal.ACCESS
        return None

    def _goal_limits(self, name: str) -> tuple[int, int]:
        get = self.registers.get
        if name == "goal_position":
            if self.mode == POSITION:
                return get("min_position"), get("max_position")
            return self.registers.by_name[name].bounds
        limit = get({"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}[name])
        return -limit, limit

    def fetch(self, address: int, count: int, now: float) -> bytes | Refusal:
        """As in `Unit`, through the indirect area."""
        data = super().fetch(address, count, now)
        if isinstance(data, Refusal) or not self._touches_indirect(address, count):
            return data
        self.sense()
        parts = (self.registers.read(self._target(address + i), 1) for i in range(count))
        return b"".join(b"\0" if isinstance(part, Refusal) else part for part in parts)

    def _touches_indirect(self, address: int, count: int) -> bool:
        return address + count > self._indirect_from and any(
            address < data + size and address + count > data for _, data, size in self.model.indirect
        )

    def _target(self, address: int) -> int:
        """Return the real address of a byte: an indirect data byte stands for the address in its entry."""
        for entries, data, size in self.model.indirect:
            if data <= address < data + size:
                raw = self.registers.read(entries + 2 * (address - data), 2)
                return address if isinstance(raw, Refusal) else int.from_bytes(raw, "little")
        return address

    def _direct_runs(self, address: int, data: bytes) -> list[tuple[int, bytes]]:
        """Split a write into runs of consecutive real addresses."""
        if not self._touches_indirect(address, len(data)):
            return [(address, data)]
        runs: list[tuple[int, bytes]] = []
        for offset in range(len(data)):
            target, byte = self._target(address + offset), data[offset : offset + 1]
            if runs and runs[-1][0] + len(runs[-1][1]) == target:
                runs[-1] = (runs[-1][0], runs[-1][1] + byte)
            else:
                runs.append((target, byte))
        return runs

    def written(self, register: Register, value: int, before: int) -> None:
        """Torque on and mode changes start from rest; a goal starts its profile; 0 clears a fired watchdog."""
        name = register.name
        starts = name == "torque_enable" and value == 1 != before
        if starts or (name == "operating_mode" and value != before):
            if self.mode == POSITION:
                # The count of turns is lost (e-manual, xl430-w250, "Present Position").
                self.motor.position %= STEPS
            if not starts:
                self._reset_control()
            self._stay()
        elif name in GOALS:
            if self.registers.get("drive_mode") & DRIVE_TORQUE_ON and not self.torque:
                self.profile.position, self.profile.velocity = self._horn(), 0.0
                if not self.registers.get("hardware_error") & self.registers.get("shutdown"):
                    self.registers.put("torque_enable", 1)
            self._plan(value - self.profile.position if name == "goal_position" else 0.0)

    def _reset_control(self) -> None:
        """A new mode has its own gains, no profile, and full effort (e-manual, xl430-w250, "Operating Mode")."""
        for name in RESET_BY_MODE & self.registers.by_name.keys():
            self.registers.put(name, self.registers.by_name[name].default)
        self._free_effort()

    def _free_effort(self) -> None:
        """Set the goals of PWM and current to their limits."""
        self.registers.put("goal_pwm", self.registers.get("pwm_limit"))
        if self.model.current_limit is not None:
            self.registers.put("goal_current", self.registers.get("current_limit"))

    # --- physics --------------------------------------------------------------------------------------------------

    def _sign(self) -> int:
        return -1 if self.registers.get("drive_mode") & DRIVE_REVERSE else 1

    def _offset(self) -> int:
        offset = self.registers.get("homing_offset")
        # In position mode at most a quarter turn applies.
        return max(-1024, min(1024, offset)) if self.mode == POSITION else offset

    def _horn(self) -> float:
        """The position as the registers show it: reversed and offset."""
        return self._sign() * self.motor.position + self._offset()

    def _stay(self) -> None:
        """Set goals and trajectory to the present position."""
        here = self._horn()
        self.profile = Profile(here)
        low, high = self.registers.by_name["goal_position"].bounds
        self.registers.put("goal_position", max(low, min(high, round(here))))
        self.registers.put("goal_velocity", 0)

    def _plan(self, distance: float) -> None:
        """Set the bounds of the next move from the profile registers."""
        get = self.registers.get
        velocity, acceleration = get("profile_velocity"), get("profile_acceleration")
        profile = self.profile
        if get("drive_mode") & DRIVE_TIMED:
            span = velocity / 1000
            ramp = min(acceleration / 1000, span / 2)
            profile.max_velocity = abs(distance) / (span - ramp) if span else 0.0
            profile.acceleration = profile.max_velocity / ramp if ramp else 0.0
        else:
            limit = get("velocity_limit")
            profile.max_velocity = (min(velocity, limit) if velocity else limit) * VELOCITY_STEP
            profile.acceleration = acceleration * ACCELERATION_STEP

    def advance(self, elapsed: float) -> None:
        """Advance in equal steps; stop when the bus watchdog fires."""
        until = self.now + elapsed
        watchdog = self.registers.get("bus_watchdog")
        fires = self.last_heard + watchdog * WATCHDOG_STEP
        if watchdog > 0 and self.torque and fires < until:
            self._go(max(0.0, elapsed - (until - fires)))
            self.registers.put("bus_watchdog", -1)
            self._stay()
            driven = {PWM: "goal_pwm", CURRENT: "goal_current"}.get(self.mode)
            if driven is not None:
                self.registers.put(driven, 0)
            elapsed = min(elapsed, until - fires)
        self._go(elapsed)

    def _go(self, elapsed: float) -> None:
        owed = self._left_over + elapsed
        steps = int(owed / STEP + 1e-6)
        self._left_over = max(0.0, owed - steps * STEP)
        while steps > 0:
            speed, drive = self.motor.speed, self.motor.drive
            span = min(steps, 50)
            self._run(span)
            steps -= span
            steady = abs(self.motor.speed - speed) < 1e-6 and abs(self.motor.drive - drive) < 1e-9
            if steps > 50 and steady and not self._on_its_way():
                # Only angle and heat change from here on: one step instead of many.
                leap = steps * STEP
                self.motor.position += self.motor.speed * leap
                self.profile.position += self.profile.velocity * leap
                self._warm(leap)
                steps = 0

    def _on_its_way(self) -> bool:
        """Return whether a steady state will change: a goal is approached, or a stall becomes an overload."""
        positions = self.mode in (POSITION, EXTENDED, CURRENT_POSITION)
        goal_ahead = self.torque and positions and (self.motor.speed != 0.0 or self.profile.velocity != 0.0)
        return goal_ahead or 0.0 < self._stalled_for < OVERLOAD_TIME

    def _run(self, steps: int) -> None:
        get = self.registers.get
        torque, mode, sign = self.torque, self.mode, self._sign()
        motor = self.motor
        full = motor.full_speed * max(self.volts, 0.0) / self.model.volts if self.powered else motor.full_speed
        limit = get("pwm_limit") / FULL_PWM
        if mode in (POSITION, EXTENDED, CURRENT_POSITION):
            limit = min(limit, abs(get("goal_pwm")) / FULL_PWM)
        if mode in (CURRENT, CURRENT_POSITION):
            limit = min(limit, abs(get("goal_current")) / self.model.stall)
        offset = self._offset()
        for _ in range(steps):
            motor.turn(self._drive(mode, sign, offset, limit) if torque else 0.0, full)
        span = steps * STEP
        along = motor.speed if motor.drive > 0 else -motor.speed
        pushing = torque and mode not in (PWM, CURRENT) and abs(motor.drive) >= limit - 1e-6 and limit > 0
        self._stalled_for = self._stalled_for + span if pushing and along < 0.02 * motor.full_speed else 0.0
        self._warm(span)

    def _drive(self, mode: int, sign: int, offset: int, limit: float) -> float:
        """The drive of one step, in the sense of the motor (not reversed)."""
        get = self.registers.get
        motor, profile = self.motor, self.profile
        if mode == PWM:
            return max(-limit, min(limit, sign * get("goal_pwm") / FULL_PWM))
        if mode == CURRENT:
            return limit if sign * get("goal_current") > 0 else -limit
        if mode == VELOCITY:
            profile.change(get("goal_velocity") * VELOCITY_STEP)
            profile.position = sign * motor.position + offset
            return motor.hold_velocity(sign * profile.velocity, limit)
        profile.toward(get("goal_position"))
        gap = sign * (profile.position - offset) - motor.position
        # Position P gain: PWM steps per position step times 128.
        drive = gap * get("position_p") / 128 / FULL_PWM
        return max(-limit, min(limit, drive))

    def _warm(self, span: float) -> None:
        if self.held_celsius is not None:
            self.celsius = self.held_celsius
        else:
            goal = AMBIENT + HEATING * self.motor.drive * self.motor.drive
            self.celsius = goal + (self.celsius - goal) * exp(-span / HEAT_TIME)
        self._alarm()

    def _alarm(self) -> None:
        if not self.powered:
            return
        get = self.registers.get
        if not get("min_voltage") <= round(self.volts * 10) <= get("max_voltage"):
            self._raise(HW_VOLTAGE)
        if int(self.celsius) > get("temperature_limit"):
            self._raise(HW_HEAT)
        if self._stalled_for >= OVERLOAD_TIME:
            self._raise(HW_OVERLOAD)

    def _raise(self, bit: int) -> None:
        errors = self.registers.get("hardware_error") | bit
        self.registers.put("hardware_error", errors)
        if errors & self.registers.get("shutdown"):
            self.registers.put("torque_enable", 0)
            self.motor.drive = 0.0

    # --- what registers 120..146 show -----------------------------------------------------------------------------

    def _sensors(self) -> dict[str, Callable[[], int]]:
        return {
            "realtime_tick": lambda: int(self.now * 1000) % 32768,
            "moving": lambda: int(abs(self._present_velocity()) > self.registers.get("moving_threshold")),
            "moving_status": self._moving_status,
            "present_pwm": lambda: round(self._sign() * self.motor.drive * FULL_PWM),
            "present_current": self._present_current,
            "present_velocity": self._present_velocity,
            "present_position": self._present_position,
            "velocity_trajectory": lambda: round(self.profile.velocity / VELOCITY_STEP),
            "position_trajectory": lambda: round(self.profile.position),
            "present_voltage": lambda: max(0, round(self.volts * 10)),
            "present_temperature": lambda: max(0, min(255, int(self.celsius))),
        }

    def _present_position(self) -> int:
        return round(self._horn() + self._sign() * self.motor.speed * self._left_over)

    def _present_velocity(self) -> int:
        return round(self._sign() * self.motor.speed / VELOCITY_STEP)

    def _present_current(self) -> int:
        """Current goes with torque (drive less what the speed induces); models without it show the drive."""
        if not self.torque:
            return 0
        motor = self.motor
        torque = motor.drive if self.model.current_limit is None else motor.drive - motor.speed / motor.full_speed
        return round(self._sign() * torque * self.model.stall)

    def _moving_status(self) -> int:
        """Bit 0: arrived within 10 steps (the sheet names no bits; model choice), bit 1: a profile is under way."""
        arrived = abs(self.registers.get("goal_position") - self._present_position()) < 10
        return int(arrived) | (0x02 if self.profile.velocity else 0)
