"""Event: a signal that programs emit, caught by ``at``, ``whenever`` and ``waituntil``.

Source: manual, specs/event.  ``runtime.event`` has the mechanism.
"""

from __future__ import annotations

from urbihw.kernel.runtime.event import Emission, Event, SustainedEmission
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

EVENT = Table("Event")
HANDLER = Table("Event.Handler")
TABLES = [EVENT, HANDLER]

NOTES = {
    "Event.onSubscribe": "Undefined by default; an event stored here is emitted when this event gets a subscriber.",
    "Event.Handler": "The result of trigger: an emission that lasts until it is stopped.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class EmissionObject(Obj):
    """An emission that was started by ``trigger``; ``stop`` ends it."""

    __slots__ = ("emission",)

    def __init__(self, world: World, protos: list[Obj], emission: Emission | None = None) -> None:
        super().__init__(world, protos)
        self.emission = emission

    def clone(self) -> EmissionObject:
        """Another handle of the same emission."""
        return EmissionObject(self.world, [self], self.emission)


CLASSES = {"Event.Handler": EmissionObject}


@EVENT.primitive("asEvent")
def as_event(world: World, this: Event) -> Value:
    """Returns this event itself."""
    return this


@EVENT.primitive("emit")
def emit(world: World, this: Event, *payload: Value) -> None:
    """Emit the event for an instant, with any number of values; does not wait for the handlers."""
    this.emit([*payload])


@EVENT.primitive("syncEmit")
def sync_emit(world: World, this: Event, *payload: Value) -> None:
    """Emit the event for an instant, with any number of values, and wait until the handlers have ended."""
    this.sync_emit([*payload])


@EVENT.primitive("trigger")
def trigger(world: World, this: Event, *payload: Value) -> Value:
    """Start an emission with any number of values; it lasts until ``stop`` of the returned object is called."""
    return EmissionObject(world, [world.classes["Event.Handler"]], this.begin([*payload], SustainedEmission))


@HANDLER.primitive("stop")
def stop(world: World, this: EmissionObject) -> None:
    """End the emission; a second call has no effect."""
    if this.emission is not None:
        this.emission.stop()


@EVENT.primitive("hasSubscribers")
def has_subscribers(world: World, this: Event) -> bool:
    """Whether the event has subscribers."""
    return bool(this.subscriptions)


@EVENT.primitive("<<")
def follow(world: World, this: Event, other: Event) -> Value:
    """Emit this event whenever the other event is emitted; returns this event."""
    this.follow(other)
    return this


@EVENT.primitive("||")
def either(world: World, this: Event, other: Event) -> Value:
    """A new event that is emitted whenever one of both events is."""
    made = Event(world, [world.event_proto])
    made.follow(this)
    made.follow(other)
    return made
