"""Events: emissions, subscriptions, and the jobs that handlers run in.

An *emission* begins, lasts (an instant, a duration, or until it is stopped) and ends.  A *subscription* is what ``at``,
``whenever`` and ``waituntil`` set up: it accepts or refuses a payload, and is notified of the beginning and the end of
each emission that it accepted.  A subscription belongs to the tags under which it was made: it ends when one of them is
stopped, and it misses the emissions that happen while one of them is frozen.  Handlers run as jobs of their own under
those tags.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.tag import TagEntry
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.sched.waiting import Completion

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Payload = list[Any]
Accept = Callable[[Payload], Any]
"""Takes a payload, and returns the values bound by the pattern (any object but None), or None to refuse the payload."""


class EventListener(Protocol):
    """The receiver of emissions: a handler, a waiting job, or an event that follows another one."""

    def offer(self, emission: Emission) -> None:
        """An emission begins.  A listener that adds itself to the ``matches`` is notified of the end."""
        ...

    def ended(self, emission: Emission, match: Any) -> None:
        """An accepted emission is over."""
        ...


class Emission:
    """One occurrence of an event; ``on`` while it lasts."""

    sustained = False
    """Whether the emission lasts until a program ends it, which does not wait for the handlers of ``at sync``."""
    __slots__ = ("event", "jobs", "matches", "on", "payload")

    def __init__(self, event: Event, payload: Payload) -> None:
        self.event = event
        self.payload = payload
        self.on = True
        self.matches: list[tuple[EventListener, Any]] = []
        self.jobs: list[Job] = []

    def stop(self) -> None:
        """End the emission; a second call does nothing."""
        if not self.on:
            return
        self.on = False
        self.event.emissions.pop(self, None)
        for subscription, match in self.matches:
            subscription.ended(self, match)


class SustainedEmission(Emission):
    """An emission that ``trigger`` begins."""

    __slots__ = ()
    sustained = True


class Event(Obj):
    """An urbiscript Event, with its subscriptions."""

    __slots__ = ("emissions", "subscriptions")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.subscriptions: dict[EventListener, None] = {}
        self.emissions: dict[Emission, None] = {}

    def clone(self) -> Event:
        """A new event without subscriptions."""
        return Event(self.world, [self])

    def begin(self, payload: Payload, kind: type[Emission] = Emission) -> Emission:
        """Begin an emission, which ends with ``stop``.  Must be called in a job, since the guards of subscriptions run
        here.
        """
        emission = kind(self, payload)
        self.emissions[emission] = None
        try:
            for subscription in tuple(self.subscriptions):
                if subscription in self.subscriptions:  # not ended while a handler of ``at sync`` was waited for
                    subscription.offer(emission)
        except BaseException:
            emission.stop()  # an error in a guard ends the emission
            raise
        return emission

    def follow(self, other: Event) -> None:
        """Emit all further emissions of another event, each for as long as it lasts."""
        follower = Follower(self)
        other.subscriptions[follower] = None
        for emission in list(other.emissions):
            follower.offer(emission)

    def emit(self, payload: Payload, duration: float = 0.0) -> Emission:
        """Emit for an instant, or hold the running job for a duration in seconds."""
        emission = self.begin(payload)
        if duration > 0:
            try:
                self.world.scheduler.sleep(duration)
            finally:
                emission.stop()
        else:
            emission.stop()
        return emission

    def sync_emit(self, payload: Payload) -> None:
        """Emit for an instant, and wait until the handlers are over."""
        for job in self.emit(payload).jobs:
            wait_for(self.world, job)

    def wait_until_over(self) -> None:
        """Park the running job until no emission is in progress."""
        while self.emissions:
            emission = next(iter(self.emissions))
            ending = Ending(self.world)
            emission.matches.append((ending, None))
            ending.over.wait()

    def subscribe(self, subscription: EventListener) -> None:
        """Add a subscription, and offer it the emissions that are in progress.  The event in the slot ``onSubscribe``,
        if there is one, is emitted.
        """
        self.subscriptions[subscription] = None
        watcher = self.slots.get("onSubscribe")
        if isinstance(watcher, Event):
            watcher.emit([])
        for emission in list(self.emissions):
            subscription.offer(emission)


class Ending:
    """The end of one emission, for which a job waits."""

    __slots__ = ("over",)

    def __init__(self, world: World) -> None:
        self.over: Completion[None] = Completion(world.scheduler)

    def offer(self, emission: Emission) -> None:
        """Further emissions are ignored."""

    def ended(self, emission: Emission, match: Any) -> None:
        """The emission is over."""
        self.over.complete(None)


class Follower:
    """Emits an event whenever another one is emitted, and for the same time."""

    __slots__ = ("_event",)

    def __init__(self, event: Event) -> None:
        self._event = event

    def offer(self, emission: Emission) -> None:
        """The other event begins."""
        mine = self._event.begin(emission.payload)
        emission.matches.append((self, mine))
        emission.jobs += mine.jobs

    def ended(self, emission: Emission, match: Any) -> None:
        """The other event is over."""
        before = len(match.jobs)
        match.stop()
        emission.jobs += match.jobs[before:]


def wait_for(world: World, job: Job) -> None:
    """Park the running job until another is over."""
    if job.done:
        return
    over: Completion[Job] = Completion(world.scheduler)
    job.when_ended(over.complete)
    over.wait()


class Handlers:
    """Runs handler jobs for an ``at`` or the like, in the context and under the tags of the job that set it up."""

    __slots__ = ("__weakref__", "_context", "_entries", "_ordered", "live", "name", "world")

    def __init__(self, world: World, name: str) -> None:
        maker = world.scheduler.running()
        self.world = world
        self.name = name
        self._context = maker.context
        self._ordered = maker.ordered
        self._entries: list[TagEntry] = list(maker.entries)
        self.live = True
        for entry in self._entries:
            entry.tag.hooks[self] = None

    def frozen(self) -> bool:
        """Whether one of the tags is frozen."""
        return self.world.scheduler.frozen_tags > 0 and any(entry.tag.is_frozen() for entry in self._entries)

    def spawn(self, body: Callable[[], Any], jobs: list[Job] | None = None) -> None:
        """Make a handler job under the tags, and add it to ``jobs``.

        Raises TooManyJobs in a job of the same connection, which causes them.  A job of another connection goes on, and
        the error is reported to the connection of the handler.
        """
        scheduler = self.world.scheduler
        try:
            made = scheduler.spawn(body, self.name, context=self._context, entries=self._entries)
        except TooManyJobs as error:
            current = scheduler.current
            if self._context is None or (current is not None and current.charged_context is self._context):
                raise
            self.fail(error)
        else:
            made.ordered = max(self._ordered, _order_of(scheduler.current))
            if jobs is not None:
                jobs.append(made)

    def spawn_last(self, body: Callable[[], Any]) -> None:
        """Make a job without the tags, one of which was stopped: the ``onleave`` at the end of this."""
        self.world.scheduler.spawn(body, self.name, context=self._context).ordered = self._ordered

    def fail(self, error: Exception) -> None:
        """Report an error of a condition or a guard to its connection; the job that evaluated it goes on."""
        if self._context is not None:
            self._context.report(error)
            return

        def tell() -> None:
            raise error

        self.spawn(tell)

    def stopped(self) -> None:
        """One of the tags was stopped."""
        if self.live:
            self.live = False
            for entry in self._entries:
                entry.tag.hooks.pop(self, None)
            self.close()

    def close(self) -> None:
        """End the ``at`` or the like."""


def _order_of(trigger: Job | None) -> int:
    """The ``Job.ordered`` that a job passes on to the handlers that it triggers: what a client triggers is ordered by
    it; what a device triggers, in this process or another one, only by the client that set the handler up."""
    if trigger is None or getattr(trigger.context, "ordered", None) is not None:
        return 0
    return trigger.ordered


class Subscription(Handlers):
    """An ``at`` or ``whenever`` on an event.

    ``accept`` returns the bound values or None; ``enter(match, emission)`` and ``leave(match)`` return the bodies to
    run, or None.  With a ``duration``, in seconds, an emission counts only when it has lasted that long.
    """

    __slots__ = ("_accept", "_duration", "_enter", "_event", "_leave", "_on", "_simple", "_timers")

    def __init__(
        self,
        world: World,
        event: Event,
        accept: Accept,
        enter: Callable[[Any, Emission], Callable[[], Any] | None],
        leave: Callable[[Any], Callable[[], Any] | None] | None,
        duration: float | None,
    ) -> None:
        super().__init__(world, "at")
        # Then the end of an emission does not matter, and is not recorded.
        self._simple = duration is None and leave is None
        self._event = event
        self._accept = accept
        self._enter = enter
        self._leave = leave
        self._duration = duration
        self._timers: dict[Emission, Timer] = {}
        self._on: dict[Emission, Any] = {}
        event.subscribe(self)

    def offer(self, emission: Emission) -> None:
        scheduler = self.world.scheduler
        if scheduler.frozen_tags and self.frozen():
            return
        try:
            match = self._accept(emission.payload)
        except Exception as error:
            self.fail(error)
            return
        if match is None:
            return
        if self._simple:
            body = self._enter(match, emission)
            if body is not None:
                self.spawn(body, emission.jobs)
            return
        emission.matches.append((self, match))
        if self._duration is None:
            self._begin(emission, match)
        else:
            deadline = self.world.scheduler.clock.now() + self._duration
            self._timers[emission] = self.world.scheduler.call_at(deadline, lambda: self._begin(emission, match))

    def _begin(self, emission: Emission, match: Any) -> None:
        if self._timers:
            self._timers.pop(emission, None)
        self._on[emission] = match
        body = self._enter(match, emission)
        if body is not None:
            self.spawn(body, emission.jobs)

    def ended(self, emission: Emission, match: Any) -> None:
        """An accepted emission is over."""
        timer = self._timers.pop(emission, None) if self._timers else None
        if timer is not None:
            timer.cancel()
        if self._on.pop(emission, None) is None or self._leave is None or self.frozen():
            return
        body = self._leave(match)
        if body is not None:
            self.spawn_leave(body, emission)

    def spawn_leave(self, body: Callable[[], Any], emission: Emission) -> None:
        """A job for the ``onleave``."""
        self.spawn(body, emission.jobs)

    def close(self) -> None:
        """Unsubscribe, and run the ``onleave`` for the emissions in progress."""
        self._event.subscriptions.pop(self, None)
        for timer in self._timers.values():
            timer.cancel()
        for match in self._on.values():
            body = None if self._leave is None else self._leave(match)
            if body is not None:
                self.spawn_last(body)
        self._on.clear()


class Synchronous(Handlers):
    """For ``at sync``: the job that starts a handler waits until the handler is over.

    Only jobs of the same connection wait: a handler must not delay the programs of others.  Code outside any job (a
    device that writes) does not wait, nor does the evaluation of a condition.
    """

    __slots__ = ()

    def spawn(self, body: Callable[[], Any], jobs: list[Job] | None = None) -> None:
        """Make a handler job, which runs at once; the running job waits until it is over."""
        made: list[Job] = []
        super().spawn(body, made)
        if jobs is not None:
            jobs += made
        current = self.world.scheduler.current
        if not made or current is None or self.world.recorder.present() is not None:
            return
        if current.charged_context is self._context:
            # It is a part of the waiting statement: a stop of the robot during the wait counts for it, too.
            made[0].descend(current)
            self.world.scheduler.run_first(made[0])
            wait_for(self.world, made[0])


class SyncSubscription(Synchronous, Subscription):
    """An ``at sync`` on an event."""

    __slots__ = ()

    def spawn_leave(self, body: Callable[[], Any], emission: Emission) -> None:
        """Make a job for the ``onleave``.  The job that ends an emission of ``trigger`` does not wait for it."""
        if emission.sustained:
            Handlers.spawn(self, body, emission.jobs)
        else:
            self.spawn(body, emission.jobs)


class Waiter:
    """A ``waituntil`` on an event: parks the running job until an emission is accepted."""

    __slots__ = ("_accept", "_accepted", "_job", "world")

    def __init__(self, world: World, accept: Accept) -> None:
        self.world = world
        self._accept = accept
        self._job = world.scheduler.running()
        self._accepted: Completion[Any] = Completion(world.scheduler)

    def offer(self, emission: Emission) -> None:
        """An emission begins; it is ignored while the waiting job is frozen."""
        if not self._accepted.done and not self._job.frozen:
            try:
                match = self._accept(emission.payload)
            except Exception as error:
                self.world.scheduler.throw(self._job, error)
            else:
                if match is not None:
                    self._accepted.complete(match)

    def ended(self, emission: Emission, match: Any) -> None:
        """The end of an emission is ignored."""

    def wait(self, event: Event) -> Any:
        """Park the running job until an emission is accepted; return the bound values."""
        event.subscribe(self)
        try:
            return self._accepted.wait()
        finally:
            event.subscriptions.pop(self, None)
