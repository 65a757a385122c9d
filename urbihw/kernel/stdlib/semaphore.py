"""Semaphore, Barrier, PubSub: synchronization of jobs.

Source: manual, specs/semaphore, specs/barrier, specs/pubsub, specs/pubsub/subscriber.  Jobs are served in the order of
their requests; a job that is stopped while it waits acquires nothing.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import HandoverQueue
from urbihw.kernel.stdlib.members import callable_of
from urbihw.kernel.value import Value

SEMAPHORE = Table("Semaphore")
BARRIER = Table("Barrier")
PUBSUB = Table("PubSub")
SUBSCRIBER = Table("PubSub.Subscriber")
TABLES = [SEMAPHORE, BARRIER, PUBSUB, SUBSCRIBER]

NOTES = {
    "Semaphore": "A counter of permits: jobs wait while it is 0.",
    "Barrier": "Jobs wait at a barrier until another job wakes one or all of them.",
    "PubSub": "A publisher: each subscriber receives all published values.",
    "PubSub.Subscriber": "A queue of the values published since the subscription.",
    "PubSub.subscribers": "The List of the Subscribers.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


# ---------------------------------------------------------------- Semaphore


class SemaphoreObject(Obj):
    """An urbiscript Semaphore: ``count`` more jobs may acquire it."""

    __slots__ = ("count", "line")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.count = 0
        self.line: HandoverQueue[Any] = HandoverQueue(world.scheduler)

    def clone(self) -> SemaphoreObject:
        return SemaphoreObject(self.world, [self])

    def acquire(self) -> None:
        """Wait until the count is positive, and decrement it."""
        if self.count > 0:
            self.count -= 1
        else:
            self.line.wait(self._take_back)

    def release(self) -> None:
        """Let a waiting job go on, or else increment the count."""
        if self.line.hand_over(None) is None:
            self.count += 1

    def _take_back(self, value: Value) -> None:
        self.release()


@SEMAPHORE.primitive("init")
def init_semaphore(world: World, this: SemaphoreObject, count: int) -> None:
    """Make a semaphore that a number of jobs may hold at the same time."""
    this.count = count


@SEMAPHORE.primitive("acquire", "p")
def acquire(world: World, this: SemaphoreObject) -> None:
    """Wait until the semaphore is available, and acquire it."""
    this.acquire()


@SEMAPHORE.primitive("release", "v")
def release(world: World, this: SemaphoreObject) -> None:
    """Release the semaphore once."""
    this.release()


@SEMAPHORE.primitive("criticalSection")
def critical_section(world: World, this: SemaphoreObject, function: Value) -> Value:
    """Call a function while holding the semaphore; returns its result."""
    wanted = callable_of(world, function)
    this.acquire()
    try:
        return world.invoke(wanted, this)
    finally:
        this.release()


# ---------------------------------------------------------------- Barrier


class BarrierObject(Obj):
    """An urbiscript Barrier, with its waiting jobs."""

    __slots__ = ("line",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.line: HandoverQueue[Any] = HandoverQueue(world.scheduler)

    def clone(self) -> BarrierObject:
        return BarrierObject(self.world, [self])


@BARRIER.primitive("wait")
def wait(world: World, this: BarrierObject) -> Value:
    """Wait for a signal; returns its payload."""
    return this.line.wait()


@BARRIER.primitive("signal")
def signal(world: World, this: BarrierObject, payload: Value) -> float:
    """Wake the job that has waited longest; returns the number of woken jobs: 0 or 1."""
    return float(this.line.hand_over(payload) is not None)


@BARRIER.primitive("signalAll")
def signal_all(world: World, this: BarrierObject, payload: Value) -> float:
    """Wake all waiting jobs; returns their number."""
    woken = len(this.line)
    while this.line.hand_over(payload) is not None:
        pass
    return float(woken)


# ---------------------------------------------------------------- PubSub


class SubscriberObject(Obj):
    """An urbiscript PubSub.Subscriber: a queue of published values."""

    __slots__ = ("line", "values")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.values: deque[Any] = deque()
        self.line: HandoverQueue[Any] = HandoverQueue(world.scheduler)

    def clone(self) -> SubscriberObject:
        return SubscriberObject(self.world, [self])

    def add_value(self, value: Value) -> None:
        """Queue a published value."""
        if self.line.hand_over(value) is None:
            self.values.append(value)

    def next_value(self) -> Any:
        """Wait for the next value and return it."""
        return self.values.popleft() if self.values else self.line.wait(self.values.appendleft)


CLASSES = {"Semaphore": SemaphoreObject, "Barrier": BarrierObject, "PubSub.Subscriber": SubscriberObject}


@PUBSUB.primitive("init")
def init_pubsub(world: World, this: Value) -> None:
    """Make a publisher without subscribers."""
    world.ops.put_slot(world.as_obj(this), "subscribers", world.new_list([]))


@PUBSUB.primitive("subscribe")
def subscribe(world: World, this: Value) -> Value:
    """A new Subscriber, which receives the values published from now on."""
    made = SubscriberObject(world, [world.send(this, "Subscriber")])
    world.send(world.send(this, "subscribers"), "<<", made)
    return made


@PUBSUB.primitive("unsubscribe")
def unsubscribe(world: World, this: Value, subscriber: Value) -> Value:
    """Remove a subscriber; returns it."""
    world.send(world.send(this, "subscribers"), "removeById", subscriber)
    return subscriber


@PUBSUB.primitive("publish")
def publish(world: World, this: Value, value: Value) -> Value:
    """Queue a value for each subscriber; returns the value."""
    for subscriber in world.iterate(world.send(this, "subscribers")):
        if isinstance(subscriber, SubscriberObject):
            subscriber.add_value(value)
    return value


@SUBSCRIBER.primitive("getOne")
def get_one(world: World, this: SubscriberObject) -> Value:
    """The next published value; waits if there is none."""
    return this.next_value()


@SUBSCRIBER.primitive("getAll")
def get_all(world: World, this: SubscriberObject) -> Value:
    """The list of all published values in the queue; waits if there is none."""
    values = [this.next_value()]
    values += this.values
    this.values.clear()
    return world.new_list(values)
