"""Semaphore, Barrier, PubSub: jobs that wait for each other.

Source: manual, specs/semaphore, specs/barrier, specs/pubsub, specs/pubsub/subscriber.  All serve first come, first
served; a job stopped while it waits takes nothing with it.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import callable_of

SEMAPHORE = Table("Semaphore")
BARRIER = Table("Barrier")
PUBSUB = Table("PubSub")
SUBSCRIBER = Table("PubSub.Subscriber")
TABLES = [SEMAPHORE, BARRIER, PUBSUB, SUBSCRIBER]

NOTES = {
    "Semaphore": "A number of permits: jobs wait while there are none.",
    "Barrier": "Where jobs wait until somebody lets one or all of them go on.",
    "PubSub": "A publisher of values, each of which every subscriber gets.",
    "PubSub.Subscriber": "The values published since somebody subscribed, in order, waited for when there are none.",
    "PubSub.subscribers": "The List of those who subscribed.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class Ticket:
    """One job waiting for something that is handed to it."""

    __slots__ = ("given", "value")

    def __init__(self) -> None:
        self.given = False
        self.value: Any = None


class Line:
    """Jobs in line; who stands first is handed a value."""

    __slots__ = ("_tickets", "_world")

    def __init__(self, world: World) -> None:
        self._world = world
        self._tickets: deque[tuple[Ticket, Any]] = deque()

    def __len__(self) -> int:
        return len(self._tickets)

    def wait(self, refused: Any = None) -> Any:
        """Park the running job until something is handed to it; ``refused(value)`` takes it back if the job was stopped
        in the meantime."""
        scheduler = self._world.scheduler
        ticket = Ticket()
        place = (ticket, scheduler.running())
        self._tickets.append(place)
        try:
            while not ticket.given:
                scheduler.suspend(None)
        except BaseException:
            if not ticket.given:
                self._tickets.remove(place)
            elif refused is not None:
                refused(ticket.value)
            raise
        return ticket.value

    def hand(self, value: Any) -> bool:
        """Give a value to the first in line; whether there was one."""
        if not self._tickets:
            return False
        ticket, job = self._tickets.popleft()
        ticket.given, ticket.value = True, value
        self._world.scheduler.wake(job)
        return True


# ---------------------------------------------------------------- Semaphore


class SemaphoreObject(Obj):
    """An urbiscript Semaphore: ``count`` more jobs may pass."""

    __slots__ = ("count", "line")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.count = 0
        self.line = Line(world)

    def clone(self) -> SemaphoreObject:
        """A semaphore of its own."""
        return SemaphoreObject(self.world, [self])

    def acquire(self) -> None:
        """Wait until one more may pass."""
        if self.count > 0:
            self.count -= 1
        else:
            self.line.wait(self._take_back)

    def release(self) -> None:
        """Let one more pass."""
        if not self.line.hand(None):
            self.count += 1

    def _take_back(self, value: Any) -> None:
        self.release()


@SEMAPHORE.primitive("init")
def init_semaphore(world: World, this: SemaphoreObject, count: int) -> None:
    """A semaphore that a number of jobs may hold at the same time."""
    this.count = count


@SEMAPHORE.primitive("acquire", "p")
def acquire(world: World, this: SemaphoreObject) -> None:
    """Wait for one of the places and take it."""
    this.acquire()


@SEMAPHORE.primitive("release", "v")
def release(world: World, this: SemaphoreObject) -> None:
    """Give a place back (or add one)."""
    this.release()


@SEMAPHORE.primitive("criticalSection")
def critical_section(world: World, this: SemaphoreObject, function: Any) -> Any:
    """What a function gives, called while holding one of the places."""
    wanted = callable_of(world, function)
    this.acquire()
    try:
        return world.invoke(wanted, this)
    finally:
        this.release()


# ---------------------------------------------------------------- Barrier


class BarrierObject(Obj):
    """An urbiscript Barrier."""

    __slots__ = ("line",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.line = Line(world)

    def clone(self) -> BarrierObject:
        """A barrier of its own."""
        return BarrierObject(self.world, [self])


@BARRIER.primitive("wait")
def wait(world: World, this: BarrierObject) -> Any:
    """Wait for a signal; gives its payload."""
    return this.line.wait()


@BARRIER.primitive("signal")
def signal(world: World, this: BarrierObject, payload: Any) -> float:
    """Wake the job that waited longest; gives how many were woken: 0 or 1."""
    return float(this.line.hand(payload))


@BARRIER.primitive("signalAll")
def signal_all(world: World, this: BarrierObject, payload: Any) -> float:
    """Wake all jobs that wait; gives how many were woken."""
    woken = len(this.line)
    while this.line.hand(payload):
        pass
    return float(woken)


# ---------------------------------------------------------------- PubSub


class SubscriberObject(Obj):
    """An urbiscript PubSub.Subscriber: values not yet taken."""

    __slots__ = ("line", "values")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.values: deque[Any] = deque()
        self.line = Line(world)

    def clone(self) -> SubscriberObject:
        """A subscriber of its own."""
        return SubscriberObject(self.world, [self])

    def put(self, value: Any) -> None:
        """A value was published."""
        if not self.line.hand(value):
            self.values.append(value)

    def take(self) -> Any:
        """The next value, waited for if need be."""
        return self.values.popleft() if self.values else self.line.wait(self.values.appendleft)


CLASSES = {"Semaphore": SemaphoreObject, "Barrier": BarrierObject, "PubSub.Subscriber": SubscriberObject}


@PUBSUB.primitive("init")
def init_pubsub(world: World, this: Any) -> None:
    """A publisher without subscribers."""
    world.ops.put(world.as_obj(this), "subscribers", world.new_list([]))


@PUBSUB.primitive("subscribe")
def subscribe(world: World, this: Any) -> Any:
    """A new Subscriber, which gets what is published from now on."""
    made = SubscriberObject(world, [world.send(this, "Subscriber")])
    world.send(world.send(this, "subscribers"), "<<", made)
    return made


@PUBSUB.primitive("unsubscribe")
def unsubscribe(world: World, this: Any, subscriber: Any) -> Any:
    """Give a subscriber nothing more; gives the subscriber."""
    world.send(world.send(this, "subscribers"), "removeById", subscriber)
    return subscriber


@PUBSUB.primitive("publish")
def publish(world: World, this: Any, value: Any) -> Any:
    """Queue a value for each subscriber; gives the value."""
    for subscriber in world.iterate(world.send(this, "subscribers")):
        if isinstance(subscriber, SubscriberObject):
            subscriber.put(value)
    return value


@SUBSCRIBER.primitive("getOne")
def get_one(world: World, this: SubscriberObject) -> Any:
    """The next published value; waits for one if there is none."""
    return this.take()


@SUBSCRIBER.primitive("getAll")
def get_all(world: World, this: SubscriberObject) -> Any:
    """The list of all published values not yet taken; waits for one if there is none."""
    values = [this.take()]
    values += this.values
    this.values.clear()
    return world.new_list(values)
