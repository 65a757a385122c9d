"""The base: executes each command for 0.4 s, supervises itself, and sends its monitoring cycle 100 times per second.

    base = SegwayRmp("200")
    base.receive_frame(frame(0x413, 332, 0), 0.0)
    base.tick(0.01)                                # ten frames, at 0.01 s

Modelled: both scales of firmware and the oldest firmware (five frames per cycle), speed, acceleration and turn limits,
tractor and balance mode, lockout, a fall without balance, the end of a command after 0.4 s, e-stop, a low and an empty
battery, reset and wrap of the integrators, wrap of the servo frame counter, power off by command.

Not modelled: current limits, gain schedules (kept and reported, without effect), roll, slopes,
temperatures, the low speed of a nearly empty battery, the difference between the two channels. The maker's guide was
not available: two guesses are that a base loses its settings at power-off, and that 0x0407 shows zeros after the end of
a command.
"""

from __future__ import annotations

from random import Random

from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway import monitor as m
from urbihw_fakes.segway.body import STEP, Body

LIFETIME = 0.4
"""Seconds for which a command is valid."""
LOW, EMPTY = 66.0, 60.0
"""Volts."""
_CATCH_UP = 100
"""Maximum number of servo frames executed at once after a pause of the serving loop."""
_FULL = 16
_FULL_CURRENT = 256
_RIGHT, _LEFT, _YAW, _FORWARD = (1, 2, 4, 8)


class SegwayRmp(CanNode):
    """One base, switched on and standing.

    Attributes:
        body: the machine; `body.volts`, `body.push`, `body.lift` simulate its surroundings.
        mode, gain: see `frames`.
        lockout: balance mode is refused.
        velocity_scale, acceleration_scale, turn_scale: 0..16, share of the maximum; current_limit: 0..256.
        powered: the base is on; the box is always on.
        heard: number of commands so far.
        refused: number of invalid configurations.
        last_command: velocity and turn of the newest command, in counts; stays when the command ends after 0.4 s.
        turn_factor: counts of turn command for 1 rad/s; published values differ.
        blink: number of servo frames, from the next one on, with the motors off; then they are on again.

    Raises:
        UnknownRequest: no such model.
    """

    def __init__(
        self,
        model: str = "200",
        *,
        mode: int = f.BALANCE,
        old_firmware: bool = False,
        turn_factor: float = f.PER_RADIAN,
        body: Body | None = None,
    ) -> None:
        if model not in f.MODELS:
            raise UnknownRequest(f"model {model!r}: no such RMP; say one of {', '.join(f.MODELS)}")
        self.model = f.MODELS[model]
        self.body = body if body is not None else Body()
        self.turn_factor = turn_factor
        self.old_firmware = old_firmware
        self.box_volts = 6.4
        self.estop = False
        self.powered = True
        self.frames = 0
        self.heard = self.refused = 0
        self.last_command: tuple[int, int] | None = None
        self.blink = 0
        self._off = False
        self._lost: dict[int | None, int] = {}
        self._chance = Random(0)
        self.start_mode = mode
        self._reset_settings()
        self._zero = dict.fromkeys((_RIGHT, _LEFT, _YAW, _FORWARD), 0)
        self._next: float | None = None

    def _reset_settings(self) -> None:
        """Reset all settings to those after switching on."""
        self.mode = self.start_mode
        self.gain = 0
        self.lockout = False
        self.velocity_scale = self.acceleration_scale = self.turn_scale = _FULL
        self.current_limit = _FULL_CURRENT
        self._velocity = self._turn = 0
        self._commanded: float | None = None

    # --- the bus --------------------------------------------------------------------------------------------------

    def receive_frame(self, frame: CanFrame, now: float) -> list[Timed]:
        """Receive a command; commands are not answered."""
        if not self.powered or len(frame.data) != 8:
            return []
        if frame.id == f.SHUTDOWN:
            self.power_off(now)
        elif frame.id == f.COMMAND:
            self.heard += 1
            velocity, turn, command, parameter = f.words(frame.data)
            self._velocity = _limited(f.signed(velocity), f.FULL_VELOCITY)
            self._turn = _limited(f.signed(turn), f.FULL_TURN)
            self.last_command = self._velocity, self._turn
            self._commanded = now
            self._configure(command, parameter, now)
        return []

    def due(self) -> float | None:
        """Return the end of the present servo frame; 0 before the first."""
        return 0.0 if self._next is None else self._next

    def tick(self, now: float) -> list[Timed]:
        """Advance to `now`; return the CAN frames of all servo frames until then."""
        if self._next is None:
            self._next = now
        elif now - self._next > _CATCH_UP * STEP:
            self._next = now - _CATCH_UP * STEP
        sent: list[Timed] = []
        while self._next <= now + 1e-9:
            self._move(self._next)
            sent += [Timed(self._next, frame) for frame in self._frames_of_cycle()]
            self._next += STEP
        return sent

    def drop_frames(self, identifier: int | None, every: int = 1) -> None:
        """Drop a frame in each `every`-th cycle; None: a random frame each time. `every` 0: drop none.

        Raises:
            UnknownRequest: no such frame, or a number below 0.
        """
        if identifier is not None and identifier not in (*f.CYCLE, f.STATUS):
            raise UnknownRequest(f"frame {identifier:#x}: say one of 0x400 to 0x407 or 0x680")
        if every < 0:
            raise UnknownRequest(f"every {every} cycles: say 1 or more, or 0 for never")
        self._lost[identifier] = every

    def power_off(self, now: float) -> None:
        """Switch the base off; a balancing base falls."""
        self.powered = False

    def power_on(self, now: float) -> None:
        """Switch the base on; its counters start at zero."""
        if not self.powered:
            self.powered = True
            self.frames = 0
            self._reset_settings()
            self._reset_integrators(_RIGHT | _LEFT | _YAW | _FORWARD)

    # --- commands -------------------------------------------------------------------------------------------------

    def _configure(self, command: int, parameter: int, now: float) -> None:
        scale = min(parameter, _FULL)
        match command:
            case f.NO_CONFIGURATION:
                pass
            case f.SET_VELOCITY_SCALE:
                self.velocity_scale = scale
            case f.SET_ACCELERATION_SCALE:
                self.acceleration_scale = scale
            case f.SET_TURN_SCALE:
                self.turn_scale = scale
            case f.SET_GAIN_SCHEDULE if parameter <= 2:
                self.gain = parameter
            case f.SET_CURRENT_LIMIT:
                self.current_limit = min(parameter, _FULL_CURRENT)
            case f.SET_LOCKOUT if parameter <= 1:
                self.lockout = bool(parameter)
            case f.SET_MODE if parameter <= f.POWER_DOWN:
                self._request_mode(parameter, now)
            case f.RESET_INTEGRATORS:
                self._reset_integrators(parameter)
            case _:
                self.refused += 1

    def _request_mode(self, mode: int, now: float) -> None:
        if mode == f.POWER_DOWN:
            self.power_off(now)
        elif (mode == f.BALANCE and (self.lockout or self.body.fallen)) or (mode != f.DISABLED and self.estop):
            self.refused += 1
        else:
            self.mode = mode

    def _reset_integrators(self, mask: int) -> None:
        counts = self._counts()
        for bit in self._zero:
            if mask & bit:
                self._zero[bit] = counts[bit]

    def preset_integrators(self, left: int = 0, right: int = 0, forward: int = 0, yaw: int = 0) -> None:
        """Set the integrators to these counts, as after a long distance."""
        counts = self._counts()
        for bit, value in ((_LEFT, left), (_RIGHT, right), (_FORWARD, forward), (_YAW, yaw)):
            self._zero[bit] = counts[bit] - value

    def _counts(self) -> dict[int, int]:
        """Return the absolute counts since the start of the simulation."""
        body, model = self.body, self.model
        return {
            _RIGHT: round(body.right * model.distance),
            _LEFT: round(body.left * model.distance),
            _YAW: round(m.turns(body.yaw) * model.turn),
            _FORWARD: round(body.forward * model.distance),
        }

    # --- the machine ----------------------------------------------------------------------------------------------

    @property
    def motors(self) -> bool:
        """Whether the motors are on."""
        able = self.powered and not self.estop and not self.body.fallen and not self._off
        return able and self.mode in (f.TRACTOR, f.BALANCE)

    def _move(self, now: float) -> None:
        self.frames = (self.frames + 1) & 0xFFFF
        self._off, self.blink = self.blink > 0, max(0, self.blink - 1)
        if self._commanded is not None and now - self._commanded > LIFETIME:
            self._velocity = self._turn = 0
            self._commanded = None
        if self.estop and self.mode != f.DISABLED:
            self.mode = f.DISABLED
        if not self.motors:
            # In tractor mode it stands on casters, in the other modes on two wheels.
            self.body.coast(self.start_mode == f.TRACTOR)
            return
        empty = self.body.volts < EMPTY
        speed = 0.0 if empty else self._velocity / f.FULL_VELOCITY * f.FULL_SPEED * self.velocity_scale / _FULL
        turn = 0.0 if empty else self._turn / self.turn_factor * self.turn_scale / _FULL
        self.body.drive(speed, turn, self.acceleration_scale / _FULL, self.mode == f.BALANCE)

    def _frames_of_cycle(self) -> list[CanFrame]:
        if not self.powered:
            return m.box_alone(self.box_volts)
        reading = self.reading()
        frames = (m.old_cycle if self.old_firmware else m.cycle)(reading, self.model)
        if not self.old_firmware:
            frames += [m.status(*self.status_words()), m.box_heartbeat(self.box_volts)]
        lost = self._dropped_frames([frame.id for frame in frames])
        return [frame for frame in frames if frame.id not in lost]

    def _dropped_frames(self, identifiers: list[int]) -> set[int]:
        """Return the identifiers of the frames that are dropped in this cycle."""
        due = [identifier for identifier, every in self._lost.items() if every and self.frames % every == 0]
        return {self._chance.choice(identifiers) if identifier is None else identifier for identifier in due}

    def reading(self) -> m.Reading:
        """Return the measured values of the base."""
        body = self.body
        counts = {bit: count - self._zero[bit] for bit, count in self._counts().items()}
        return m.Reading(
            pitch=body.pitch,
            pitch_rate=body.pitch_rate,
            roll=body.roll,
            left_speed=body.left_speed,
            right_speed=body.right_speed,
            yaw_rate=body.turn,
            frames=self.frames,
            left_count=counts[_LEFT],
            right_count=counts[_RIGHT],
            forward_count=counts[_FORWARD],
            yaw_count=counts[_YAW],
            left_torque=body.left_torque,
            right_torque=body.right_torque,
            mode=self.mode,
            gain=self.gain,
            box_volts=self.box_volts,
            volts=body.loaded_volts,
            velocity=self._velocity,
            turn=self._turn,
        )

    def status_words(self) -> tuple[int, int]:
        """Return the two words of 0x0680: states, and the faults of both sides."""
        first = second = 0
        if self.motors:
            first |= 0x0080 | (0x0100 if self.mode == f.BALANCE else 0)
        if self.estop:
            first |= 0x0008
            second |= 0x0202
        if self.body.fallen:
            first |= 0x0001
            second |= 0x0101
        if self.body.volts < EMPTY:
            first |= 0x0420
            second |= 0x1010
        elif self.body.volts < LOW:
            first |= 0x4000
        return first, second


def _limited(value: int, most: int) -> int:
    return max(-most, min(most, value))
