"""Servomotors that are commanded all at once: the example of the Urbi manual, chapter 4.2, in Python.

In urbiscript, once the classes are registered (``loadModule("servo_hub");``)::

    var pan = HubServo.new(1)|; var tilt = HubServo.new(2)|;
    pan.val = 0.3 time:1s & tilt.val = -0.2 time:1s;        // one command of two positions every 20 ms
"""

from __future__ import annotations

from typing import ClassVar, Protocol

from urbihw.kernel.uobject import UObject, UObjectHub, owned


class Hardware(Protocol):
    """What a maker of servomotors gives you."""

    def get_position(self, id: int) -> float: ...
    def set_positions(self, positions: dict[int, float]) -> None: ...


class ServoHub(UObjectHub):
    """Gathers the commands of all servomotors and sends them in one; there is one such object."""

    hardware: ClassVar[Hardware]

    def init(self) -> None:
        """Called once, when the class is registered."""
        self.wanted: dict[int, float] = {}
        self.set_update(0.02)

    def add_value(self, id: int, position: float) -> None:
        """One servomotor wants to be there."""
        self.wanted[id] = position

    def update(self) -> None:
        """Called every 20 ms, after the ``update`` of all servomotors."""
        if self.wanted:
            self.hardware.set_positions(self.wanted)
            self.wanted = {}


class HubServo(UObject):
    """One servomotor: reads its position before each pass of urbiscript, hands its command to the hub after it."""

    val = owned(0.0)

    def init(self, id: int) -> None:
        """Called by ``new``."""
        self.motor = id
        self.sent = 0.0
        self.register(ServoHub)
        self.set_timer(0.02, self.measure)
        self.set_update(0.02)

    def measure(self) -> None:
        """Before a pass of urbiscript."""
        self.val.sense(ServoHub.hardware.get_position(self.motor))

    def update(self) -> None:
        """After a pass of urbiscript."""
        if self.val.value != self.sent:
            self.sent = self.val.value
            self.host.hub(ServoHub).add_value(self.motor, self.sent)
