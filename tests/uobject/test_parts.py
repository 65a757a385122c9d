"""Devices of several parts: the slots of a part are slots of the device."""

from __future__ import annotations

from typing import ClassVar

import pytest
from uobject_console import Console

from urbihw.kernel.uobject import DevicePart, UObject, event, function, owned, reading
from urbihw.kernel.uremote.announce import class_lines


class Gauge(DevicePart):
    """Knows how full a tank is."""

    slot_words = {"level": ("how full it is", "m"), "ask": ("what a client wants", "m")}

    level = reading(0.25)
    ask = owned(0.0)
    moved = event()

    def __init__(self, device: UObject) -> None:
        super().__init__(device)
        device.notify_change(self.ask, self._fill)

    def _fill(self) -> None:
        self.level.sense(self.ask.value)
        self.moved.emit(self.ask.value)

    @function("emptyNow")
    def empty_now(self, rest: float = 0.0) -> float:
        """Leave no more than a rest."""
        self.level.sense(rest)
        return rest


class Bolt(DevicePart):
    """Says whether a tank is locked."""

    locked = reading(False)


class Tank(UObject):
    """A tank with a gauge."""

    parts: ClassVar[tuple[type[DevicePart], ...]] = (Gauge,)
    slot_words = {"colour": ("how it looks", "")}

    colour = reading("red")

    def init(self) -> None:
        self.gauge = Gauge(self)


class LockedTank(Tank):
    """The parts of a base class count too."""

    parts = (Bolt,)

    def init(self) -> None:
        super().init()
        self.bolt = Bolt(self)


@pytest.mark.parametrize("kind", [Tank, LockedTank])
def test_slots_of_a_part_are_slots_of_the_device(kind: type[Tank]) -> None:
    console = Console(kind)
    tank = console.host.create(kind, "tank")
    assert console.say("tank.level; tank.colour; tank.level->unit;") == ["0.25", '"red"', '"m"']
    assert console.say('at (tank.moved?(var level)) echo("moved %s" % level); tank.ask = 2; tank.level;') == [
        "2", "*** moved 2", "2",
    ]  # fmt: skip
    assert console.say("tank.emptyNow(0.5); tank.level; tank.emptyNow;") == ["0.5", "0.5", "0"]
    assert tank.gauge.level.sensed == 0
    (refused,) = console.say("tank.level = 3;")
    assert refused.startswith("!!!") and tank.gauge.level.sensed == 0
    assert kind.describe_function("emptyNow") == "Leave no more than a rest."


def test_each_instance_has_parts_of_its_own() -> None:
    console = Console(Tank)
    for name in ("left", "right"):
        console.host.create(Tank, name)
    assert console.say("left.ask = 1; left.level; right.level; right.emptyNow(0.1); left.level;") == [
        "1", "1", "0.25", "0.1", "1",
    ]  # fmt: skip


def test_a_class_has_no_part_to_call() -> None:
    console = Console(Tank)
    assert console.say("Tank.emptyNow;") == ["!!! 1.1-13: emptyNow: this is a class: make an instance with new"]


def test_a_part_that_the_class_does_not_name_has_no_slots() -> None:
    tank = Console(Tank).host.create(Tank, "tank")
    with pytest.raises(TypeError, match="Bolt is not among the parts of Tank"):
        Bolt(tank)


def test_a_remote_announces_the_functions_of_parts() -> None:
    assert "external function (0) Tank.emptyNow from Tank" in list(class_lines("Tank", Tank, False))
