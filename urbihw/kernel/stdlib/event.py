"""Event: what can be emitted and caught.

Source: manual, specs/event.  The mechanism is ``runtime.event``.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.event import Emission, Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

EVENT = Table("Event")
HANDLER = Table("Event.Handler")
TABLES = [EVENT, HANDLER]

NOTES = {
    "Event.onSubscribe": "Not there at first: an event put here is emitted whenever somebody begins to watch this one.",
    "Event.Handler": "What trigger gives: an emission that lasts until it is stopped.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class EmissionObject(Obj):
    """What ``trigger`` gives: stops the emission."""

    __slots__ = ("emission",)

    def __init__(self, world: World, protos: list[Obj], emission: Emission | None = None) -> None:
        super().__init__(world, protos)
        self.emission = emission

    def clone(self) -> EmissionObject:
        """Another handle on the same emission."""
        return EmissionObject(self.world, [self], self.emission)


CLASSES = {"Event.Handler": EmissionObject}


@EVENT.primitive("asEvent")
def as_event(world: World, this: Event) -> Any:
    """This event itself."""
    return this


@EVENT.primitive("emit")
def emit(world: World, this: Event, *payload: Any) -> None:
    """Emit for an instant, with any number of values; does not wait for the handlers."""
    this.emit([*payload])


@EVENT.primitive("syncEmit")
def sync_emit(world: World, this: Event, *payload: Any) -> None:
    """Emit for an instant, with any number of values, and wait until the handlers are over."""
    this.sync_emit([*payload])


@EVENT.primitive("trigger")
def trigger(world: World, this: Event, *payload: Any) -> Any:
    """Begin to emit, with any number of values; lasts until ``stop`` of what this gives."""
    return EmissionObject(world, [world.classes["Event.Handler"]], this.begin([*payload]))


@HANDLER.primitive("stop")
def stop(world: World, this: EmissionObject) -> None:
    """End the emission; a second time is harmless."""
    if this.emission is not None:
        this.emission.stop()


@EVENT.primitive("hasSubscribers")
def has_subscribers(world: World, this: Event) -> bool:
    """Whether somebody watches this event."""
    return bool(this.subscriptions)


@EVENT.primitive("<<")
def follow(world: World, this: Event, other: Event) -> Any:
    """Emit whatever the other event emits; gives this event."""
    this.follow(other)
    return this


@EVENT.primitive("||")
def either(world: World, this: Event, other: Event) -> Any:
    """A new event emitted whenever one of both is."""
    made = Event(world, [world.event_proto])
    made.follow(this)
    made.follow(other)
    return made
