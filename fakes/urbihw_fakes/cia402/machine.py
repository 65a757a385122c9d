"""The states of CiA 402, and the motor that turns in one of them.

    not ready -> switch on disabled -> ready to switch on -> switched on -> operation enabled
    fault reaction -> fault -> switch on disabled           (from everywhere, and back by a rising bit 7)
    quick stop: from operation enabled, brakes, then switch on disabled

What a motor does: it follows its speed with a bounded acceleration; to a position it goes with a speed from which it
can still stop there. A torque accelerates it, against a friction that grows with its speed. Homing drives to a limit
switch and slowly back off it, or takes the present place (methods 17, 18, 35, 37). Without power it runs out.
"""

from __future__ import annotations

import math

SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = (
    "switch on disabled",
    "ready to switch on",
    "switched on",
    "operation enabled",
    "quick stop active",
    "fault",
)
STATUS = {
    SWITCH_ON_DISABLED: 0x0040,
    READY: 0x0021,
    SWITCHED_ON: 0x0023,
    ENABLED: 0x0027,
    QUICK_STOP: 0x0007,
    FAULT: 0x0008,
}
VOLTAGE, REMOTE, REACHED, LIMIT, SETPOINT = 0x0010, 0x0200, 0x0400, 0x0800, 0x1000
POSITION, VELOCITY, TORQUE, HOMING = 1, 3, 4, 6
MODES = frozenset((0, POSITION, VELOCITY, TORQUE, HOMING))
"""Modes of operation that can be chosen; 0 means no mode."""
NEGATIVE_SWITCH, POSITIVE_SWITCH = 17, 18
HOMING_METHODS = frozenset((NEGATIVE_SWITCH, POSITIVE_SWITCH, 35, 37))
SWITCHES = (-3.0, 3.0)
"""Turns from where it stood at power on to its limit switches."""
ATTAINED = 0x1000
FULL_TORQUE = 1000
_HALT, _NEW, _RELATIVE = 0x0100, 0x0010, 0x0040
_RUN_OUT = 5.0  # turns/s^2 of a motor without power

# What a control word asks for: (mask, value, name); looked through in this order.
_COMMANDS = (
    (0x0002, 0x0000, "disable voltage"),
    (0x0006, 0x0002, "quick stop"),
    (0x0007, 0x0006, "shutdown"),
    (0x000F, 0x0007, "switch on"),
    (0x000F, 0x000F, "enable"),
)
_TRANSITIONS = {
    (SWITCH_ON_DISABLED, "shutdown"): READY,
    (READY, "switch on"): SWITCHED_ON,
    # A drive may take both steps at once (transition 3 and 4).
    (READY, "enable"): ENABLED,
    (SWITCHED_ON, "enable"): ENABLED,
    (ENABLED, "switch on"): SWITCHED_ON,
    (ENABLED, "shutdown"): READY,
    (SWITCHED_ON, "shutdown"): READY,
    (ENABLED, "quick stop"): QUICK_STOP,
    (READY, "quick stop"): SWITCH_ON_DISABLED,
    (SWITCHED_ON, "quick stop"): SWITCH_ON_DISABLED,
    **{(state, "disable voltage"): SWITCH_ON_DISABLED for state in (READY, SWITCHED_ON, ENABLED, QUICK_STOP)},
}


class Machine:
    """State, motor, and what it was told. Increments and seconds.

    Attributes:
        state: see the head of this file.
        mode: of operation.
        position, speed: of the motor.
        target_position, target_speed, profile_speed, acceleration, quick_deceleration, limits: as in the dictionary.
        target_torque, most_torque, torque: in thousandths of the rated torque.
        homing_method, homing_speeds, home_offset: as in the dictionary.
        switches: places of the two limit switches.
        error: code of the last fault, 0 for none.
    """

    def __init__(self, increments: int) -> None:
        self.increments = increments
        self.state = SWITCH_ON_DISABLED
        self.mode = 0
        self.position = self.speed = 0.0
        self.target_position = self.target_speed = 0
        self.profile_speed = self._cruise = 2 * increments
        self.acceleration = 20 * increments
        self.quick_deceleration = 100 * increments
        self.limits = (-100 * increments, 100 * increments)
        self.most_speed = 20 * increments
        self.target_torque = 0
        self.most_torque = FULL_TORQUE
        self.torque = 0.0
        self.homing_method = 0
        self.homing_speeds = (increments, increments // 8)
        self.home_offset = 0
        self.switches = (SWITCHES[0] * increments, SWITCHES[1] * increments)
        self.error = 0
        self._homing = ""
        self._attained = False
        self._control = 0
        self._goal = 0.0
        self._acknowledged = False

    def control(self, word: int) -> None:
        """Execute a control word."""
        before, self._control = self._control, word
        if self.state == FAULT:
            if word & ~before & 0x80:
                self.state, self.error = SWITCH_ON_DISABLED, 0
            return
        asked = next((name for mask, value, name in _COMMANDS if word & mask == value), "")
        old = self.state
        self.state = _TRANSITIONS.get((old, asked), old)
        if self.state == ENABLED and old != ENABLED:
            self._goal = self.position
        self._set_point(word, before)

    def fault(self, code: int) -> None:
        """Enter the fault state: the power goes off."""
        self.state, self.error = FAULT, code

    def status(self) -> int:
        """The status word, object 6041."""
        word = STATUS[self.state] | REMOTE | VOLTAGE
        if self.state == ENABLED:
            if self._reached():
                word |= REACHED
            if self._acknowledged:
                word |= SETPOINT
            if self.mode == HOMING and self._attained:
                word |= ATTAINED
            if self.mode == POSITION and not self.limits[0] <= self.target_position <= self.limits[1]:
                word |= LIMIT
        return word

    def step(self, seconds: float) -> None:
        """Advance the motor by a number of seconds."""
        if self.state == ENABLED and self.mode == TORQUE and not self._control & _HALT:
            torque = max(-self.most_torque, min(self.most_torque, self.target_torque))
            # At full torque it reaches its highest speed.
            wanted = self.most_speed * torque / FULL_TORQUE
            most = float(self.acceleration) * abs(wanted - self.speed) / self.most_speed
        elif self.state == ENABLED:
            most, wanted = float(self.acceleration), self._wanted(seconds)
        elif self.state == QUICK_STOP:
            most, wanted = float(self.quick_deceleration), 0.0
        else:
            most, wanted = _RUN_OUT * self.increments, 0.0
        change = max(-most * seconds, min(most * seconds, wanted - self.speed))
        pushed = change / seconds / self.acceleration + self.speed / self.most_speed
        self.torque = FULL_TORQUE * pushed if self.state in (ENABLED, QUICK_STOP) else 0.0
        self.speed += change
        self.position += self.speed * seconds
        if self._homing:
            self._watch_switch()
        if self.state == QUICK_STOP and self.speed == 0.0:
            self.state = SWITCH_ON_DISABLED

    def _wanted(self, seconds: float) -> float:
        if self._control & _HALT:
            return 0.0
        if self.mode == VELOCITY:
            return float(max(-self.most_speed, min(self.most_speed, self.target_speed)))
        if self.mode == HOMING:
            return self._homing_speed()
        if self.mode != POSITION:
            return 0.0
        rest = self._goal - self.position
        # As fast as it can still brake, and not past the goal within this step.
        fast = min(self._cruise, self.most_speed, math.sqrt(2 * 0.8 * self.acceleration * abs(rest)))
        return math.copysign(min(fast, abs(rest) / seconds), rest)

    def _homing_speed(self) -> float:
        """Fast towards the switch, slowly away from it."""
        fast, slow = self.homing_speeds
        out = -1 if self.homing_method == NEGATIVE_SWITCH else 1
        return {"towards": out * float(fast), "off": -out * float(slow)}.get(self._homing, 0.0)

    def _watch_switch(self) -> None:
        low, high = self.switches
        pressed = self.position <= low if self.homing_method == NEGATIVE_SWITCH else self.position >= high
        if self._homing == "towards" and pressed:
            self._homing = "off"
        elif self._homing == "off" and not pressed:
            self._set_home()

    def _start_homing(self, word: int, before: int) -> None:
        """Bit 4 starts homing, and without it homing ends."""
        if not word & _NEW or self.state != ENABLED:
            self._homing = ""
        elif not before & _NEW:
            self._attained, self._homing = False, "towards"
            if self.homing_method not in (NEGATIVE_SWITCH, POSITIVE_SWITCH):
                self._set_home()

    def _set_home(self) -> None:
        """This place is the home offset from now on; the switches stay where they are."""
        shift = self.home_offset - self.position
        self.position += shift
        self.switches = (self.switches[0] + shift, self.switches[1] + shift)
        self._homing, self._attained = "", True

    def _set_point(self, word: int, before: int) -> None:
        if self.mode == HOMING:
            self._start_homing(word, before)
            return
        if not word & _NEW:
            self._acknowledged = False
        elif self.state == ENABLED and self.mode == POSITION and not before & _NEW:
            goal = self.position + self.target_position if word & _RELATIVE else self.target_position
            self._goal = max(self.limits[0], min(self.limits[1], goal))
            # The speed counts from this point on, as with a drive that plans its way when it takes the point.
            self._cruise = self.profile_speed
            self._acknowledged = True

    def _reached(self) -> bool:
        if self._control & _HALT:
            return abs(self.speed) < 1
        if self.mode == VELOCITY:
            return abs(self.speed - self.target_speed) < 1
        if self.mode in (HOMING, TORQUE):
            return not self._homing
        return abs(self._goal - self.position) < 2 and abs(self.speed) < self.increments / 100
