"""What a supervisor does to the world: Label, ManipulateNode and SimulationController (manual, 29.5.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from urbihw.kernel.uobject import UObject, UVar, function, number, owned, reading
from urbihw.platforms.measured import MeasuredDevice
from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots import words
from urbihw.platforms.webots.surface import Surface, surface_of


def supervising(device: UObject) -> Surface:
    """Return the robot, which must be a supervisor.  Raises ValueError."""
    surface = surface_of(device)
    if not surface.world.supervisor:
        raise ValueError("this robot is no supervisor: set the field supervisor of its Robot node to TRUE")
    return surface


class Label(UObject):
    """``Label.new(text)``: a text over the view of the world."""

    slot_words = words.LABEL

    txt = owned("")
    x = owned(0.0)
    y = owned(0.0)
    r = owned(0.0)
    g = owned(0.0)
    b = owned(0.0)
    a = owned(1.0)
    size = owned(0.1)

    def init(self, text: str) -> None:
        self._surface = supervising(self)
        self._number = self._surface.next_label()
        self.txt.sense(text)
        self.notify_change(self.txt, self._write_text)
        for var in (self.x, self.y, self.r, self.g, self.b, self.a, self.size):
            self.notify_change(var, partial(self._write, var))
        self._show()

    def _write_text(self) -> None:
        if not isinstance(self.txt.value, str):
            raise ValueError("txt is a String")
        self.txt.sense(self.txt.value)
        self._show()

    def _write(self, var: UVar) -> None:
        value = number(var)
        if not 0 <= value <= 1:
            raise ValueError(f"{var.name} is 0 to 1")
        var.sense(value)
        self._show()

    def _show(self) -> None:
        x, y, size, r, g, b, a = (
            float(var.sensed) for var in (self.x, self.y, self.size, self.r, self.g, self.b, self.a)
        )
        self._surface.ask("label", s.LabelText(self._number, str(self.txt.sensed), x, y, size, r, g, b, a))


class ManipulateNode(MeasuredDevice):
    """``ManipulateNode.new(name)``: where a node of the world is, and where it is put.

    ``ax``, ``ay``, ``az`` are a rotation vector: its direction is the axis, its length the angle in rad.
    """

    slot_words = words.MANIPULATE
    tx = owned(math.nan)
    ty = owned(math.nan)
    tz = owned(math.nan)
    ax = owned(math.nan)
    ay = owned(math.nan)
    az = owned(math.nan)
    node = reading("")

    def init(self, name: str) -> None:
        self._surface = surface = supervising(self)
        nodes = surface.world.nodes
        if nodes is not None and name not in nodes:
            raise ValueError(s.no_such(s.NODE, name, nodes))
        self.node.sense(name)
        self._name = name
        self._translation = (self.tx, self.ty, self.tz)
        self._rotation = (self.ax, self.ay, self.az)
        self._ordered: dict[str, list[float]] = {}
        for item, group in (("translation", self._translation), ("rotation", self._rotation)):
            for index, var in enumerate(group):
                self.notify_change(var, partial(self._write, item, index))
        surface.add_device(s.NODES + name, self, 0.0)

    def _write(self, item: str, index: int) -> None:
        group = self._translation if item == "translation" else self._rotation
        value = number(group[index])
        # Several components of one round are one order.
        vector = self._ordered.setdefault(item, [float(var.sensed) for var in group])
        if any(math.isnan(each) for position, each in enumerate(vector) if position != index):
            raise ValueError(f"{self._name}: nothing is known of its place yet; write it after a step")
        vector[index] = value
        self._surface.channel.settle_later(self)

    def settle(self) -> None:
        ordered, self._ordered = self._ordered, {}
        for item, vector in ordered.items():
            self._surface.write(s.NODES + self._name, item, tuple(vector))

    def show(self, value: Sequence[float], stamp: float) -> None:
        """Show where it is."""
        for var, each in zip((*self._translation, *self._rotation), value, strict=True):
            var.sense(each, stamp)
        self.mark_fresh()


class SimulationController(UObject):
    """``SimulationController.new``"""

    def init(self) -> None:
        self._surface = supervising(self)

    @function("physicsReset")
    def physics_reset(self) -> None:
        """Stop all bodies where they are."""
        self._surface.ask("reset physics")

    @function
    def revert(self) -> None:
        """Reload the world: the link is lost, and back with the world in its first state."""
        self._surface.ask("revert")

    @function
    def quit(self) -> None:
        """End the simulator at once."""
        self._surface.ask("quit")
