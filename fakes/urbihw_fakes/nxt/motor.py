"""One output port and the motor on it.

Speeds settle with a time constant; a regulated motor reaches `FULL_SPEED` at power 100 at any battery voltage, another
one a share of it.  The figures are those of a bare NXT motor: 170 rpm at 9 V without load (philohome.com, "NXT motor
internals"), rounded down for a motor in a model.
"""

from __future__ import annotations

import math

from urbihw_fakes.nxt import codes

FULL_SPEED = 900.0  # degrees per second at power 100
SETTLING = 0.05  # s, of a driven or braked motor
COASTING = 0.3  # s, of a free one
NOMINAL = 9.0  # V
RAMP = 1.0  # s, of a ramp without a limit


class Motor:
    """A motor; positions in degrees.

    Attributes:
        power, mode, regulation, turn_ratio, run_state, limit: as set by SETOUTPUTSTATE, and changed by its execution.
        position: of the axle, since power-on.
        speed: degrees per second.
        jammed: the axle is blocked by hand.
    """

    def __init__(self) -> None:
        self.position = 0.0
        self.speed = 0.0
        self.jammed = False
        self.reset()

    def reset(self) -> None:
        """Reset as at the start or end of a program: power off, all counters 0."""
        self.power = self.mode = self.regulation = self.turn_ratio = self.limit = 0
        self.run_state = codes.IDLE
        self._tacho_from = self._block_from = self._rotation_from = self._began_at = self.position
        self._ramp = 1.0

    def set_output(self, power: int, mode: int, regulation: int, turn_ratio: int, run_state: int, limit: int) -> None:
        """SETOUTPUTSTATE: without the on bit the firmware forgets power and regulation."""
        if not mode & codes.MOTOR_ON:
            power = regulation = 0
        self.power, self.mode, self.regulation = power, mode, regulation
        self.turn_ratio, self.run_state, self.limit = turn_ratio, run_state, limit
        self._began_at = self.position
        self._ramp = 0.0 if run_state == codes.RAMP_UP else 1.0
        if limit:
            self._tacho_from = self.position

    def count(self, tacho: int, block: int, rotation: int) -> None:
        """Set the three counters, as after a rotation."""
        self._tacho_from = self.position - tacho
        self._block_from = self.position - block
        self._rotation_from = self.position - rotation

    def reset_position(self, relative: bool) -> None:
        """RESETMOTORPOSITION: the block count, or the rotation count."""
        if relative:
            self._block_from = self.position
        else:
            self._rotation_from = self.position

    @property
    def tacho(self) -> int:
        """Degrees since the limit was set."""
        return math.floor(self.position - self._tacho_from + 0.5)

    @property
    def block(self) -> int:
        """Degrees since the block count was reset."""
        return math.floor(self.position - self._block_from + 0.5)

    @property
    def rotation(self) -> int:
        """Degrees since the rotation count was reset."""
        return math.floor(self.position - self._rotation_from + 0.5)

    def advance(self, seconds: float, volts: float) -> None:
        """Advance by a number of seconds."""
        wanted, settling = self._drive(seconds, volts)
        share = 1 - math.exp(-seconds / settling)
        if self.jammed:
            self.speed = 0.0
            return
        before = self.speed
        self.speed += (wanted - before) * share
        # The integral of the exponential, so that one coarse step equals many fine ones.
        self.position += wanted * seconds + (before - wanted) * settling * share
        if self.limit and abs(self.position - self._began_at) >= self.limit:
            self._arrive()

    def _drive(self, seconds: float, volts: float) -> tuple[float, float]:
        """Advance the speed towards its final value."""
        if not self.mode & codes.MOTOR_ON or self.run_state == codes.IDLE:
            return 0.0, SETTLING if self.mode & codes.BRAKE else COASTING
        ramps = {codes.RAMP_UP: seconds / RAMP, codes.RAMP_DOWN: -seconds / RAMP}
        self._ramp = min(1.0, max(0.0, self._ramp + ramps.get(self.run_state, 0.0)))
        regulated = self.mode & codes.REGULATED and self.regulation
        wanted = self.power / 100 * FULL_SPEED * self._ramp * (1.0 if regulated else volts / NOMINAL)
        holds = self.power != 0 or regulated or self.mode & codes.BRAKE
        return wanted, SETTLING if holds else COASTING

    def _arrive(self) -> None:
        """Handle the tacho limit: the motor becomes idle, and stops at once if it brakes."""
        if self.mode & codes.BRAKE:
            self.position = self._began_at + math.copysign(self.limit, self.position - self._began_at)
            self.speed = 0.0
        self.power = 0
        self.run_state = codes.IDLE
        self.limit = 0
