"""An AX-12 whose horn is a joint of a body: its registers drive a motor there, and are read from there.

The electronics are those of the plain AX-12: modes, compliance, limits, heat, alarms, power.  Where that has a motor
of its own, this one asks the body: what the torque does is the body's matter.  So the position sags under a weight, the
load register shows what holding takes, and without torque the joint falls.

Choice: while the moving speed is limited, the point that is held runs ahead to the goal at that speed, never farther
than the compliance slope from the horn, so a blocked servo pushes with its full torque and no more.
"""

from __future__ import annotations

from urbihw_fakes.dynamixel.ax12 import NOMINAL_VOLTS, SPEED_STEP, Ax12, Compliance, WheelDrive

STEP = 0.002
"""s of one step of the body."""


class JointServo(Ax12):
    """One AX-12 in a body; the units of ``position`` and ``speed`` are position steps.

    ``prepare``, then ``pull`` and ``follow`` in turns, once for each step, then ``finish``.
    """

    def __init__(self, unit: int, position: float) -> None:
        super().__init__(unit, position=position)
        self._held = position
        """Where the goal has got to on its way, at the moving speed."""
        self._limit = 0.0
        self._goal = self._cruise = 0.0
        self._reach = 0
        self._law: Compliance | WheelDrive = Compliance(self.registers.get)

    @property
    def driven(self) -> bool:
        """Whether the motor is connected: power, torque on, and a torque limit."""
        return self._limit > 0.0

    def advance(self, elapsed: float) -> None:
        """Nothing: the body moves on, see ``finish``."""

    def prepare(self) -> None:
        """Read from the registers what the next steps need."""
        get = self.registers.get
        torque = self.powered and get("torque_enable")
        self._limit = get("torque_limit") / 1023 if torque else 0.0
        if self.wheel:
            self._law = WheelDrive(get("moving_speed"), self._limit)
        else:
            self._law = Compliance(get)
            self._goal, self._cruise = get("goal_position"), (get("moving_speed") & 1023) * SPEED_STEP * STEP
            self._reach = 2 + max(get("cw_margin") + get("cw_slope"), get("ccw_margin") + get("ccw_slope"))

    def pull(self) -> float:
        """The torque of the coming step, as a share of the stall torque at nominal voltage; with what pushes it."""
        if not self._limit:
            self._held, self.drive = self.position, 0.0
        elif isinstance(self._law, WheelDrive):
            self.drive = self._law.drive(self.position, self.load)
        else:
            self._move_on()
            drive = self._law.drive(self._held - self.position)
            self.drive = max(-self._limit, min(self._limit, drive))
        return self.drive * self.volts / NOMINAL_VOLTS + self.load

    def follow(self, position: float, speed: float) -> None:
        """Where the body has turned the horn, in position steps, and how fast."""
        self.position, self.speed = position, speed

    def finish(self, span: float) -> None:
        """Account for ``span`` seconds of the present drive."""
        self._strain(span, self._limit)

    def _move_on(self) -> None:
        if not self._cruise:
            # 0 is full speed without control.
            self._held = self._goal
            return
        way = self._goal - self._held
        self._held += max(-self._cruise, min(self._cruise, way))
        self._held = max(self.position - self._reach, min(self.position + self._reach, self._held))
