"""The base: obeys commands for 0.4 s each, supervises itself, and tells all about it a hundred times a second.

    base = SegwayRmp("200")
    base.hear(frame(0x413, 332, 0), now=0.0)
    base.tick(0.01)                                # ten frames, at 0.01 s

What it models: both scales of firmware and the oldest one (five frames a cycle), speed, acceleration and turn limits,
tractor and balance mode, lockout, a fall when it balances no more, the end of a command after 0.4 s, e-stop, a low and
an empty battery, integrators that are reset and that wrap, the servo frame counter that wraps, power off by command.

What it leaves out: current limits, gain schedules (kept and reported, without effect), roll, slopes, wheel slip,
temperatures, the low speed of a nearly empty battery, the difference between the two channels. The maker's guide was
not at hand: that a base forgets its settings when it is switched off, and that 0x0407 shows zeros once a command is
too old, are guesses.
"""

from __future__ import annotations

from random import Random

from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway import monitor as m
from urbihw_fakes.segway.body import STEP, Body

LIFETIME = 0.4
"""Seconds for which a command is good."""
LOW, EMPTY = 66.0, 60.0
"""Volts."""
_CATCH_UP = 100
"""Servo frames at most that are made up for after a pause of whoever serves this."""
_FULL = 16
_FULL_CURRENT = 256
_RIGHT, _LEFT, _YAW, _FORWARD = (1, 2, 4, 8)


class SegwayRmp(CanNode):
    """One base, switched on and standing.

    Attributes:
        body: the machine; `body.volts`, `body.push`, `body.lift` are for whoever plays the world.
        mode, gain: see `frames`.
        lockout: balance mode is refused.
        velocity_scale, acceleration_scale, turn_scale: 0..16, share of the most; current_limit: 0..256.
        powered: the base is on; the box is always.
        heard: commands heard so far.
        refused: configurations that made no sense.
        turn_factor: counts of turn command for 1 rad/s; published values differ.
        blink: servo frames for which the motors are off, from the next one on; then they are on again by themselves.

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
    ) -> None:
        if model not in f.MODELS:
            raise UnknownRequest(f"model {model!r}: no such RMP; say one of {', '.join(f.MODELS)}")
        self.model = f.MODELS[model]
        self.body = Body()
        self.turn_factor = turn_factor
        self.old_firmware = old_firmware
        self.box_volts = 6.4
        self.estop = False
        self.powered = True
        self.frames = 0
        self.heard = self.refused = 0
        self.blink = 0
        self._off = False
        self._lost: dict[int | None, int] = {}
        self._chance = Random(0)
        self.start_mode = mode
        self._forget()
        self._zero = dict.fromkeys((_RIGHT, _LEFT, _YAW, _FORWARD), 0)
        self._next: float | None = None

    def _forget(self) -> None:
        """As after switching on."""
        self.mode = self.start_mode
        self.gain = 0
        self.lockout = False
        self.velocity_scale = self.acceleration_scale = self.turn_scale = _FULL
        self.current_limit = _FULL_CURRENT
        self._velocity = self._turn = 0
        self._commanded: float | None = None

    # --- the bus --------------------------------------------------------------------------------------------------

    def hear(self, frame: CanFrame, now: float) -> list[Timed]:
        """Take a command; there is no answer to any."""
        if not self.powered or len(frame.data) != 8:
            return []
        if frame.id == f.SHUTDOWN:
            self.power_off(now)
        elif frame.id == f.COMMAND:
            self.heard += 1
            velocity, turn, command, parameter = f.words(frame.data)
            self._velocity = _limited(f.signed(velocity), f.FULL_VELOCITY)
            self._turn = _limited(f.signed(turn), f.FULL_TURN)
            self._commanded = now
            self._configure(command, parameter, now)
        return []

    def due(self) -> float | None:
        """When the next servo frame is over; at once, before the first."""
        return 0.0 if self._next is None else self._next

    def tick(self, now: float) -> list[Timed]:
        """Move on to `now`; the frames of all servo frames until then."""
        if self._next is None:
            self._next = now
        elif now - self._next > _CATCH_UP * STEP:
            self._next = now - _CATCH_UP * STEP
        sent: list[Timed] = []
        while self._next <= now + 1e-9:
            self._move(self._next)
            sent += [Timed(self._next, frame) for frame in self._said()]
            self._next += STEP
        return sent

    def lose(self, identifier: int | None, every: int = 1) -> None:
        """Send a frame no more in every so many-th cycle; None for one of the frames, another each time. 0: send all.

        Raises:
            UnknownRequest: no such frame, or a number below 0.
        """
        if identifier is not None and identifier not in (*f.CYCLE, f.STATUS):
            raise UnknownRequest(f"frame {identifier:#x}: say one of 0x400 to 0x407 or 0x680")
        if every < 0:
            raise UnknownRequest(f"every {every} cycles: say 1 or more, or 0 for never")
        self._lost[identifier] = every

    def power_off(self, now: float) -> None:
        """The base goes off; a balancing one falls."""
        self.powered = False

    def power_on(self, now: float) -> None:
        """The base starts with its counters at zero."""
        if not self.powered:
            self.powered = True
            self.frames = 0
            self._forget()
            self._reset(_RIGHT | _LEFT | _YAW | _FORWARD)

    # --- commands -------------------------------------------------------------------------------------------------

    def _configure(self, command: int, parameter: int, now: float) -> None:
        scale = min(parameter, _FULL)
        match command:
            case 0:
                pass
            case 10:
                self.velocity_scale = scale
            case 11:
                self.acceleration_scale = scale
            case 12:
                self.turn_scale = scale
            case 13 if parameter <= 2:
                self.gain = parameter
            case 14:
                self.current_limit = min(parameter, _FULL_CURRENT)
            case 15 if parameter <= 1:
                self.lockout = bool(parameter)
            case 16 if parameter <= f.POWER_DOWN:
                self._request(parameter, now)
            case 50:
                self._reset(parameter)
            case _:
                self.refused += 1

    def _request(self, mode: int, now: float) -> None:
        if mode == f.POWER_DOWN:
            self.power_off(now)
        elif (mode == f.BALANCE and (self.lockout or self.body.fallen)) or (mode != f.DISABLED and self.estop):
            self.refused += 1
        else:
            self.mode = mode

    def _reset(self, mask: int) -> None:
        counts = self._counts()
        for bit in self._zero:
            if mask & bit:
                self._zero[bit] = counts[bit]

    def preset(self, left: int = 0, right: int = 0, forward: int = 0, yaw: int = 0) -> None:
        """Let the integrators stand at these counts now, as after a long way."""
        counts = self._counts()
        for bit, value in ((_LEFT, left), (_RIGHT, right), (_FORWARD, forward), (_YAW, yaw)):
            self._zero[bit] = counts[bit] - value

    def _counts(self) -> dict[int, int]:
        """Counts since the machine was made."""
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
            # In tractor mode it stands on casters; in any other it has two wheels.
            self.body.coast(self.start_mode == f.TRACTOR)
            return
        empty = self.body.volts < EMPTY
        speed = 0.0 if empty else self._velocity / f.FULL_VELOCITY * f.FULL_SPEED * self.velocity_scale / _FULL
        turn = 0.0 if empty else self._turn / self.turn_factor * self.turn_scale / _FULL
        self.body.drive(speed, turn, self.acceleration_scale / _FULL, self.mode == f.BALANCE)

    def _said(self) -> list[CanFrame]:
        if not self.powered:
            return m.box_alone(self.box_volts)
        reading = self.reading()
        frames = (m.old_cycle if self.old_firmware else m.cycle)(reading, self.model)
        if not self.old_firmware:
            frames += [m.status(*self.status_words()), m.box_heartbeat(self.box_volts)]
        lost = self._lost_now([frame.id for frame in frames])
        return [frame for frame in frames if frame.id not in lost]

    def _lost_now(self, identifiers: list[int]) -> set[int]:
        """Which frames of this cycle are not sent."""
        due = [identifier for identifier, every in self._lost.items() if every and self.frames % every == 0]
        return {self._chance.choice(identifiers) if identifier is None else identifier for identifier in due}

    def reading(self) -> m.Reading:
        """What the base measures now."""
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
        """The two words of 0x0680: what is on, and what is wrong on both sides."""
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
