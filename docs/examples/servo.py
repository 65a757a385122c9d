"""A servomotor as an urbiscript object: the example of the Urbi manual, chapter 4.1, in Python.

In urbiscript, once ``host.register(Servo)`` was called::

    var wrist = Servo.new(3);
    wrist.val = 0.5 time:1s;        // one second, thirty to sixty small moves
    wrist.val;                      // where it really is
    wrist.P = 2; wrist.setPID(2, 0, 1);
"""

from __future__ import annotations

from typing import ClassVar, Protocol

from urbihw.kernel.uobject import UObject, function, owned, variable


class Hardware(Protocol):
    """What a maker of servomotors gives you."""

    def initialize(self, id: int) -> bool: ...
    def get_position(self, id: int) -> float: ...
    def set_position(self, id: int, position: float) -> None: ...
    def set_pid(self, id: int, p: float, i: float, d: float) -> None: ...


class Servo(UObject):
    """Derive and set ``hardware``; every ``Servo.new(id)`` is then one motor."""

    hardware: ClassVar[Hardware]

    val = owned(0.0)  # an actuator when written, a sensor when read
    P = variable(1.0)
    I = variable(0.0)  # noqa: E741 - its name since Ziegler and Nichols
    D = variable(0.0)

    def init(self, id: int) -> None:
        """Called by ``new``.  A ValueError is an error in urbiscript, with the same words."""
        self.motor = id
        if not self.hardware.initialize(id):
            raise ValueError(f"there is no servomotor {id}")
        self.notify_change(self.val, self.value_changed)
        self.notify_access(self.val, self.value_accessed)
        for gain in (self.P, self.I, self.D):
            self.notify_change(gain, self.pid_changed)

    def value_changed(self) -> None:
        """``val`` was written."""
        self.hardware.set_position(self.motor, self.val.value)
        self.value_accessed()

    def value_accessed(self) -> None:
        """``val`` is about to be read."""
        self.val.value = self.hardware.get_position(self.motor)

    def pid_changed(self) -> None:
        """One of the gains was written."""
        self.hardware.set_pid(self.motor, self.P.value, self.I.value, self.D.value)

    @function("setPID")
    def set_pid(self, p: float, i: float, d: float) -> None:
        """All gains at once."""
        for var, gain in ((self.P, p), (self.I, i), (self.D, d)):
            var.value = gain
        self.pid_changed()
