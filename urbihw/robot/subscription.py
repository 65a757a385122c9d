"""Subscription: samples of slots at a rate, as lines of JSON on a channel of the connection.  Not in the manual.

docs/telemetry.md has the lines.  A subscription belongs to the lobby that made it and to the tags under which it was
made: it ends with the one, and is stopped and frozen by the others.
"""

from __future__ import annotations

import re
from typing import Any, Final

from urbihw.kernel.library import List, Obj, String, Table, Value, World, errors, field
from urbihw.robot.binary_feed import BinaryFeed
from urbihw.robot.sampling import MAX_RATE_HZ, MIN_RATE_HZ, Feed, feeds_of
from urbihw.robot.value_feed import ValueFeed

TABLE = Table("Subscription")
LOBBY = Table("Lobby")
TABLES = [TABLE, LOBBY]

MAX_WINDOW: Final = 16
"""Maximum number of Binaries that a client takes without saying that it is ready."""
_NAME: Final = re.compile(r"[A-Za-z_][\w.-]{0,63}", re.ASCII)

NOTES = {
    "Subscription": "Samples of slots at a rate, as lines of JSON on a channel of the connection.",
    "Subscription.hz": "Samples in a second, 0 for each change; can be assigned.",
    "Subscription.name": "The channel of the lines.",
    "Subscription.slots": "The paths of the slots.",
    "Subscription.sent": "The number of samples sent.",
    "Subscription.lost": "The number of samples left out, because the client does not read or the server was late.",
    "Subscription.running": "Whether it goes on.",
}
"""Descriptions of slots that hold fields, which have no docstrings."""


class SubscriptionObject(Obj):
    """An urbiscript Subscription, with its slots."""

    __slots__ = ("feed",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.feed: Feed | None = None

    def clone(self) -> SubscriptionObject:
        """A Subscription without slots."""
        return SubscriptionObject(self.world, [self])

    def running_feed(self) -> Feed:
        """What it sends.  Raises the type error for the prototype."""
        if self.feed is None:
            raise self.world.type_error(None, self, "Subscription")
        return self.feed

    def value_feed(self) -> ValueFeed:
        """What it sends, if these are values and it has not ended."""
        feed = self.running_feed()
        if not isinstance(feed, ValueFeed):
            raise errors.primitive(f"{feed.name} is the subscription of a Binary")
        if feed.closed:
            raise errors.primitive(f"the subscription {feed.name} was stopped: make a new one")
        return feed


CLASSES = {"Subscription": SubscriptionObject}


@TABLE.primitive("init")
def init(world: World, this: SubscriptionObject, name: str, slots: List, hz: float = 10.0) -> None:
    """Send samples of slots on the channel ``name``, ``hz`` in a second, or with 0 at each change (at most 50 a
    second).  ``slots`` are the paths of the slots, such as ``"motor6.val"``.
    """
    if this.feed is not None:  # called again by a program: the object stands for one
        this.feed.close()
    this.feed = ValueFeed(world, this, _channel_name(name), _names(world, slots), _rate(hz))


@TABLE.primitive("binary")
def binary(
    world: World, this: SubscriptionObject, name: str, slot: str, hz: float = 10.0, window: float = 1.0
) -> Value:
    """Make a subscription of a slot that holds a Binary, such as a picture: the newest one, ``hz`` in a second at most.

    After ``window`` of them the next is sent when the client has called ``ready``; with 0 each is sent.
    """
    if not (window.is_integer() and 0 <= window <= MAX_WINDOW):
        raise errors.primitive(f"window: an integer from 0 to {MAX_WINDOW} expected")
    made = this.clone()
    made.feed = BinaryFeed(world, made, _channel_name(name), slot, _rate(hz) or MAX_RATE_HZ, int(window))
    return made


@TABLE.primitive("stop")
def stop(world: World, this: SubscriptionObject) -> None:
    """End it; a second call does nothing."""
    this.running_feed().close()


@TABLE.primitive("add")
def add(world: World, this: SubscriptionObject, slots: List) -> None:
    """Send further slots, too; the names are sent again."""
    this.value_feed().add(_names(world, slots))


@TABLE.primitive("remove")
def remove(world: World, this: SubscriptionObject, slots: List) -> None:
    """Send some slots no more; the names are sent again."""
    this.value_feed().remove(_names(world, slots))


@TABLE.primitive("ready")
def ready(world: World, this: SubscriptionObject) -> None:
    """The client has taken a Binary, and takes one more."""
    feed = this.running_feed()
    if isinstance(feed, BinaryFeed):
        feed.ready()


@TABLE.primitive("asString")
def as_string(world: World, this: SubscriptionObject) -> str:
    """``Subscription`` and its name."""
    return "Subscription" if this.feed is None else f"Subscription_{this.feed.name}"


@LOBBY.primitive("subscriptions")
def subscriptions(world: World, this: Value) -> Value:
    """The subscriptions of this connection."""
    return world.new_list([feed.face for feed in feeds_of(this)] if hasattr(this, "holdings") else [])


def _channel_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise errors.primitive("the name of a subscription has up to 64 letters, digits, _, . and -")
    return name


def _rate(hz: float) -> float:
    if hz != 0 and not MIN_RATE_HZ <= hz <= MAX_RATE_HZ:
        raise errors.primitive(f"hz: {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g} expected, or 0 for each change")
    return hz


def _names(world: World, slots: List) -> list[str]:
    if not all(isinstance(name, String) for name in slots.l):
        raise errors.primitive('a list of paths expected, such as ["motor6.val"]')
    return [name.s for name in slots.l]


def install(world: World, programs: Any) -> None:
    """Install the fields of a Subscription."""
    proto = world.classes["Subscription"]

    def fixed(target: Value, value: Value) -> None:
        raise errors.constness()

    def set_hz(target: SubscriptionObject, value: Value) -> None:
        feed, rate = target.running_feed(), _rate(world.as_float(value, 1, "hz"))
        if isinstance(feed, ValueFeed):
            target.value_feed().check_readings(len(feed.slots), rate)
        feed.set_rate(rate)
        if isinstance(feed, ValueFeed):
            feed.tell_names()

    def slots_of(feed: Feed) -> list[str]:
        return [slot.name for slot in feed.slots] if isinstance(feed, ValueFeed) else [feed.slot.name] \
            if isinstance(feed, BinaryFeed) else []

    readers: dict[str, Any] = {
        "name": lambda feed: world.string(feed.name),
        "slots": lambda feed: world.new_list([world.string(name) for name in slots_of(feed)]),
        "sent": lambda feed: float(feed.sent),
        "lost": lambda feed: float(feed.lost),
        "running": lambda feed: world.boolean(not feed.closed),
        "hz": lambda feed: float(feed.rate),
    }
    for name, read in readers.items():
        def reader(target: SubscriptionObject, read: Any = read) -> Value:
            return read(target.running_feed())

        field(world, proto, name, reader, set_hz if name == "hz" else fixed, SubscriptionObject)
