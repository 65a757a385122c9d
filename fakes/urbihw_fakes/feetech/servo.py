"""A Feetech servo: instructions, modes, alarms, calibration.

The packets are those of Dynamixel protocol 1.0; the error byte has other bits, and no bit for a request that is not
understood or damaged: it is not answered. Choices where the sheet is silent: the answer to a changed ID or speed still
has the old one; RESET restores the factory values except the ID; a goal outside the angle limits is moved to up to
the limit, without an error bit; the middle taken with 128 is kept whatever the lock says; an overcurrent cuts the
torque until the torque switch is written.
"""

from __future__ import annotations

from math import inf
from typing import Final

from urbihw_fakes.dynamixel import packet1
from urbihw_fakes.dynamixel.framer import BROADCAST, Request
from urbihw_fakes.dynamixel.registers import Refusal, Register, Write
from urbihw_fakes.dynamixel.unit import Unit, near
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.memory import Memory
from urbihw_fakes.feetech.motion import ACCELERATION_UNIT, STEP, Motor, Order
from urbihw_fakes.feetech.tables import MODELS

BAUDS: Final = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
ERR_VOLTAGE, ERR_SENSOR, ERR_HEAT, ERR_CURRENT, ERR_ANGLE, ERR_OVERLOAD = (1 << bit for bit in range(6))
PHASE_SPEED_UNIT, PHASE_ZERO_IS_FULL, PHASE_MULTI_TURN = 0x04, 0x08, 0x10
COARSE_SPEED = 50  # steps/s of one unit of speed while phase bit 2 is 0
POSITION, SPEED, PWM, RELATIVE = range(4)
_TAKE_MIDDLE = 128


class FeetechServo(Unit):
    """One servo, at rest in its middle unless `position` (steps) says otherwise.

    Attributes that may be set at any time: `motor` (angle, load, stops of the horn) and `volts` of the supply. In
    addition: `heat`, `overload`, and `pin_register` for any register.
    """

    protocol = 1
    registers: Memory

    def __init__(self, model: str = "STS3215", unit: int = 1, *, position: float | None = None) -> None:
        if model not in MODELS:
            raise UnknownRequest(f"model {model!r}: not simulated; there are {', '.join(MODELS)}")
        self.model = model
        self._about = MODELS[model]
        self.steps = 4096 if self._about.series == "STS" else 1024
        super().__init__(unit, self._about.rows)
        self.registers = Memory(self._about.rows, "little" if self._about.series == "STS" else "big")
        self.registers.put("id", unit)
        middle = self.steps / 2 if position is None else position
        stops = (-inf, inf) if self._about.series == "STS" else (0.0, 1023.0)
        self.motor = Motor(middle, self._about.full_speed, stops)
        self.volts = self._about.volts
        self.overloaded = False
        self.cut = False  # the torque, by an overcurrent
        self.damaged_sensor = False
        self._loaded_for = self._current_for = self._left_over = 0.0
        self._turn_goal = 0.0  # goal in position and step mode, in steps of the present position
        self._until: float | None = None  # end of a move with a goal time, in seconds of `now`
        self.sensors = {
            "present_position": self._raw_position,
            "present_speed": self._raw_speed,
            "present_load": lambda: round(self.motor.drive * 1000),
            "present_voltage": lambda: round(self.volts * 10) & 0xFF,
            "present_temperature": lambda: max(0, min(255, int(self.motor.celsius))),
            "async_write": lambda: int(self.pending is not None),
            "status": self.state_errors,
            "moving": lambda: int(abs(self.motor.speed) > 1.0),
            "present_current": lambda: round(abs(self.motor.drive) * self._about.stall_current),
        }
        self.boot()

    # --- identity -----------------------------------------------------------------------------------------------

    @property
    def baud(self) -> int:
        """The speed of the line, by the vendor's codes."""
        return BAUDS[self.registers.get("baud")]

    def set_baud(self, baud: int) -> None:
        codes = [code for code, speed in enumerate(BAUDS) if near(speed, baud)]
        if not codes:
            raise UnknownRequest(f"speed {baud}: a Feetech servo has no setting near it")
        self.registers.put("baud", codes[0])

    @property
    def answers_sync_read(self) -> bool:
        """Servos of the SCS series do not answer SYNC READ."""
        return self._about.series == "STS"

    # --- state --------------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Set the power-on values: torque off, torque limit from the maximum torque."""
        self.registers.boot()
        self.pending = None
        self.motor.drive = 0.0
        self.overloaded = self.cut = False
        self._loaded_for = self._current_for = 0.0
        self._until = None
        if "torque_limit" in self.registers.by_name:
            self._set("torque_limit", self.registers.get("max_torque"))
        self._turn_goal = self._here()
        self._set("goal_position", round(self._turn_goal))

    def heat(self, celsius: float | None) -> None:
        """Fix the temperature at `celsius`; with None the model continues from there."""
        self.motor.held_celsius = celsius
        if celsius is not None:
            self.motor.celsius = celsius

    def overload(self) -> None:
        """Simulate an overload: the output falls to the protective torque until a new command."""
        self.overloaded = True

    def state_errors(self) -> int:
        """Voltage, sensor, heat, current, overload."""
        get = self.registers.get
        errors = ERR_OVERLOAD if self.overloaded else 0
        if not get("min_voltage") <= round(self.volts * 10) <= get("max_voltage"):
            errors |= ERR_VOLTAGE
        if self.damaged_sensor:
            errors |= ERR_SENSOR
        if int(self.motor.celsius) > get("max_temperature"):
            errors |= ERR_HEAT
        if self.cut:
            errors |= ERR_CURRENT
        return errors

    @property
    def mode(self) -> int:
        """The operating mode: that of the register, or from the angle limits for the SCS series."""
        if self._about.series == "STS":
            return self.registers.get("mode")
        return PWM if self._is_unlimited() else POSITION

    # --- instructions -------------------------------------------------------------------------------------------

    def execute(self, request: Request, now: float) -> bytes:
        """As in `Unit`; a damaged or unknown request is not answered."""
        unit = self.id
        self.tick(now)
        data = self._carry_out(request, now) if request.intact else None
        if data is None or (request.unit == BROADCAST and request.code != packet1.PING):
            return b""
        if request.code not in (packet1.PING, packet1.READ) and not self.registers.get("response_level"):
            return b""
        return packet1.status(unit, self.state_errors(), data)

    def _carry_out(self, request: Request, now: float) -> bytes | None:
        code, params = request.code, request.params
        if code == packet1.READ and len(params) == 2:
            return self._bytes(params[0], params[1], now)
        if code == packet1.WRITE and len(params) >= 2:
            self.perform(params[0], params[1:], now)
        elif code == packet1.REG_WRITE and len(params) >= 2:
            write = self.examine(params[0], params[1:])
            self.pending = None if isinstance(write, Refusal) else write
        elif code == packet1.ACTION:
            if self.pending is not None:
                write, self.pending = self.pending, None
                self.apply(write)
        elif code == packet1.RESET:
            self.registers.reset(keep=("id",))
            self.moved()
            self.boot()
        elif code != packet1.PING:
            return None
        return b""

    def report(self, address: int, count: int, now: float) -> bytes:
        """As in `Unit`: its answer to a sync read."""
        return packet1.status(self.id, self.state_errors(), self._bytes(address, count, now))

    def _bytes(self, address: int, count: int, now: float) -> bytes:
        data = self.fetch(address, count, now)
        return b"" if isinstance(data, Refusal) else data

    def apply(self, write: Write) -> None:
        """Execute a write, then what it sets off: first all registers, since a goal needs the speed beside it."""
        before = self.id
        for register, value in write.values:
            self.registers.take(self.registers.row(register.name), value)
        if self.id != before:
            self.moved()
        for register, value in write.values:
            self.written(register, value, value)

    def written(self, register: Register, value: int, before: int) -> None:
        """Handle a goal, the torque switch, the mode and the middle."""
        name = register.name
        if name == "torque":
            if value == _TAKE_MIDDLE:
                self._take_middle()
                return
            self.cut = False
            self._turn_goal = self._here()
        if name == "mode":
            self._turn_goal = self._here()
        if name == "goal_position":
            self._turn_goal = self._here() + value if self.mode == RELATIVE else self._limited(value)
        if name == "goal_time" and self.mode == POSITION and value > 0:
            self._until = self.now + value / 1000
        if name in ("goal_position", "goal_speed", "goal_pwm", "goal_time", "torque"):
            self.overloaded = False
            self._loaded_for = 0.0

    def _limited(self, goal: float) -> float:
        if self._is_unlimited():
            return goal
        get = self.registers.get
        return min(max(goal, get("min_angle")), get("max_angle"))

    def _is_unlimited(self) -> bool:
        return self.registers.get("min_angle") == 0 == self.registers.get("max_angle")

    def _take_middle(self) -> None:
        offset = round(self.motor.angle) % self.steps - self.steps // 2
        self.registers.put("offset", max(-2047, min(2047, offset)))
        self._set("torque", 0)
        self._turn_goal = self._here()

    def _set(self, name: str, value: int) -> None:
        """Set a register of the RAM from the model."""
        if name not in self._pinned:
            self.registers.put(name, value)

    # --- what the sensor shows ------------------------------------------------------------------------------------

    def _here(self) -> float:
        """Return the present position with its fraction: the angle less the offset, within one turn or over many."""
        if self._about.series == "SCS":
            return self.motor.angle
        here = self.motor.angle - self.registers.get("offset")
        return here if self.registers.get("phase") & PHASE_MULTI_TURN else here % self.steps

    def _raw_position(self) -> int:
        here = round(self._here())
        if self._about.series == "STS" and not self.registers.get("phase") & PHASE_MULTI_TURN:
            here %= self.steps
        return max(-32767, min(32767, here))

    def _raw_speed(self) -> int:
        return max(-32767, min(32767, round(self.motor.speed / self._speed_unit)))

    @property
    def _speed_unit(self) -> float:
        fine = self._about.series == "SCS" or self.registers.get("phase") & PHASE_SPEED_UNIT
        return 1.0 if fine else COARSE_SPEED

    # --- physics --------------------------------------------------------------------------------------------------

    def advance(self, elapsed: float) -> None:
        """Advance in equal steps, so that the frequency of the calls does not change the motion."""
        owed = self._left_over + elapsed
        steps = int(owed / STEP + 1e-6)
        self._left_over = max(0.0, owed - steps * STEP)
        for done in range(steps):
            order = self._order(self.now + done * STEP)
            if order.kind == "off" and not self.motor.load:
                # Nothing moves any more: only the heat changes.
                self.motor.run(order, (steps - done) * STEP)
                return
            self.motor.run(order)
            self._protect(STEP)

    def _order(self, now: float) -> Order:
        get = self.registers.get
        if not self.powered or get("torque") != 1 or self.cut or (self.state_errors() & ERR_HEAT & get("unloading")):
            return Order("off")
        limit = get("torque_limit" if "torque_limit" in self.registers.by_name else "max_torque") / 1000
        if self.overloaded:
            limit = min(limit, get("protective_torque") / 100)
        limit = min(limit, 1.0)
        mode = self.mode
        acceleration = get("acceleration") if "acceleration" in self.registers.by_name else 0
        slope = acceleration * ACCELERATION_UNIT if acceleration else inf
        if mode == PWM:
            drive = get("goal_pwm" if self._about.series == "STS" else "goal_time") / 1000
            return Order("pwm", rate=drive, limit=limit)
        if mode == SPEED:
            return Order("speed", rate=get("goal_speed") * self._speed_unit, acceleration=slope, limit=limit)
        distance = self._turn_goal - self._here()
        stiffness = get("position_p") / 1000
        return Order("position", distance, self._top_speed(distance, now), slope, limit, stiffness, get("cw_dead_zone"))

    def _top_speed(self, distance: float, now: float) -> float:
        if self._until is not None:
            rest = self._until - now
            if rest > STEP:
                return abs(distance) / rest
            self._until = None
        speed = abs(self.registers.get("goal_speed")) * self._speed_unit
        if speed:
            return speed
        return self.motor.full_speed if self.registers.get("phase") & PHASE_ZERO_IS_FULL else 0.0

    def _protect(self, span: float) -> None:
        get = self.registers.get
        drive = abs(self.motor.drive)
        over = not self.overloaded and drive * 100 > get("overload_torque")
        self._loaded_for = self._loaded_for + span if over else 0.0
        if self._loaded_for >= get("protection_time") * 0.01 and get("unloading") & ERR_OVERLOAD:
            self.overloaded = True
        if "protection_current" in self.registers.by_name:
            over = drive * self._about.stall_current > get("protection_current")
            self._current_for = self._current_for + span if over else 0.0
            if self._current_for >= get("overcurrent_time") * 0.01 and get("unloading") & ERR_CURRENT:
                self.cut = True
