"""Events: emissions, subscriptions, and the jobs that handlers run in.

An *emission* begins, lasts (an instant, a duration, or until it is stopped) and ends.  A *subscription* is what ``at``,
``whenever`` and ``waituntil`` set up: it accepts or refuses a payload, and is told the beginning and the end of each
emission it accepted.  A subscription belongs to the tags under which it was made: it is gone when one of them is
stopped, and what happens while one is frozen is lost on it.  Handlers run as jobs of their own, under those tags.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.tag import TagEntry
from urbihw.kernel.sched.timequeue import Timer

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Payload = list[Any]
Accept = Callable[[Payload], Any]
"""Given a payload, the values bound by the pattern (any object but None), or None to refuse."""


class Listener(Protocol):
    """What hears of emissions: a handler, a waiting job, an event that follows another."""

    def offer(self, emission: Emission) -> None:
        """An emission begins: put oneself among its ``matches`` to hear of its end."""
        ...

    def ended(self, emission: Emission, match: Any) -> None:
        """An emission that was accepted is over."""
        ...


class Emission:
    """One occurrence of an event; ``on`` while it lasts."""

    __slots__ = ("event", "jobs", "matches", "on", "payload")

    def __init__(self, event: Event, payload: Payload) -> None:
        self.event = event
        self.payload = payload
        self.on = True
        self.matches: list[tuple[Listener, Any]] = []
        self.jobs: list[Job] = []

    def stop(self) -> None:
        """The event is over; twice is harmless."""
        if not self.on:
            return
        self.on = False
        self.event.emissions.pop(self, None)
        for subscription, match in self.matches:
            subscription.ended(self, match)


class Event(Obj):
    """An urbiscript Event."""

    __slots__ = ("emissions", "subscriptions")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.subscriptions: dict[Listener, None] = {}
        self.emissions: dict[Emission, None] = {}

    def clone(self) -> Event:
        """A fresh event without subscriptions."""
        return Event(self.world, [self])

    def begin(self, payload: Payload) -> Emission:
        """Begin to emit; end it with ``stop``.  Runs in a job: guards of subscriptions are evaluated here."""
        emission = Emission(self, payload)
        self.emissions[emission] = None
        try:
            for subscription in tuple(self.subscriptions):
                subscription.offer(emission)
        except BaseException:
            emission.stop()  # the error of a guard ends what it was asked about
            raise
        return emission

    def follow(self, other: Event) -> None:
        """Emit whatever another event emits, from now on and as long as it lasts."""
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
        """Emit for an instant and wait until the handlers are over."""
        for job in self.emit(payload).jobs:
            wait_for(self.world, job)

    def subscribe(self, subscription: Listener) -> None:
        """Add a subscription; it is told at once of the emissions that last.  The event in the slot ``onSubscribe``, if
        there is one, is emitted."""
        self.subscriptions[subscription] = None
        watcher = self.slots.get("onSubscribe")
        if isinstance(watcher, Event):
            watcher.emit([])
        for emission in list(self.emissions):
            subscription.offer(emission)


class Follower:
    """Emits an event whenever another one is emitted, for as long."""

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
    me = world.scheduler.running()
    waiting = True

    def ended(_: Job) -> None:
        if waiting:
            world.scheduler.wake(me)

    job.when_ended(ended)
    try:
        while not job.done:
            world.scheduler.suspend(None)
    finally:
        waiting = False


class Handlers:
    """What runs handler jobs for something set up by urbiscript code: remembers context and tags of its maker."""

    __slots__ = ("__weakref__", "_context", "_entries", "live", "name", "world")

    def __init__(self, world: World, name: str) -> None:
        maker = world.scheduler.running()
        self.world = world
        self.name = name
        self._context = maker.context
        self._entries: list[TagEntry] = list(maker.entries)
        self.live = True
        for entry in self._entries:
            entry.tag.hooks[self] = None

    def frozen(self) -> bool:
        """Whether a tag holds what was set up."""
        return self.world.scheduler.frozen_tags > 0 and any(entry.tag.is_frozen() for entry in self._entries)

    def spawn(self, body: Callable[[], Any], jobs: list[Job] | None = None) -> None:
        """A job under the tags of the maker, added to ``jobs``.

        Raises TooManyJobs to somebody of the same connection, who makes them.  Anybody else goes on, and the maker is
        told.
        """
        scheduler = self.world.scheduler
        try:
            made = scheduler.spawn(body, self.name, context=self._context, entries=self._entries)
        except TooManyJobs as error:
            if self._context is None or (scheduler.current is not None and scheduler.current.payer is self._context):
                raise
            self.fail(error)
        else:
            if jobs is not None:
                jobs.append(made)

    def fail(self, error: Exception) -> None:
        """A condition or a guard failed: tell the maker; the job that happened to evaluate it goes on."""
        if self._context is not None:
            self._context.report(error)
            return

        def tell() -> None:
            raise error

        self.spawn(tell)

    def stopped(self) -> None:
        """A tag of the maker was stopped."""
        if self.live:
            self.live = False
            for entry in self._entries:
                entry.tag.hooks.pop(self, None)
            self.close()

    def close(self) -> None:
        """Undo what was set up."""


class Subscription(Handlers):
    """An ``at`` or ``whenever`` on an event.

    ``accept`` gives the bound values or None; ``enter(match, emission)`` and ``leave(match)`` make the bodies to run,
    or None for nothing.  With a ``duration`` the emission has to last that long before it counts.
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
        # Then the end of an emission does not matter, which saves keeping account of it.
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
        """An emission begins."""
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
        """An emission that was accepted is over."""
        timer = self._timers.pop(emission, None) if self._timers else None
        if timer is not None:
            timer.cancel()
        if self._on.pop(emission, None) is None or self._leave is None or self.frozen():
            return
        body = self._leave(match)
        if body is not None:
            self.spawn(body, emission.jobs)

    def close(self) -> None:
        """The tag was stopped: hear no more, leave what is on."""
        self._event.subscriptions.pop(self, None)
        for timer in self._timers.values():
            timer.cancel()
        for match in self._on.values():
            body = None if self._leave is None else self._leave(match)
            if body is not None:
                self.world.scheduler.spawn(body, self.name, context=self._context)
        self._on.clear()


class Waiter:
    """A ``waituntil`` on an event: parks the running job until an emission is accepted."""

    __slots__ = ("_accept", "_job", "_timers", "match", "world")

    def __init__(self, world: World, accept: Accept) -> None:
        self.world = world
        self._accept = accept
        self._job = world.scheduler.running()
        self.match: Any = None

    def offer(self, emission: Emission) -> None:
        """An emission begins; one that comes while the waiting job is frozen is lost."""
        if self.match is None and not self._job.frozen:
            try:
                self.match = self._accept(emission.payload)
            except Exception as error:
                self.world.scheduler.throw(self._job, error)
            else:
                if self.match is not None:
                    self.world.scheduler.wake(self._job)

    def ended(self, emission: Emission, match: Any) -> None:
        """Ends do not matter to one who waits for a beginning."""

    def wait(self, event: Event) -> Any:
        """Park until an emission is accepted; the bound values."""
        event.subscribe(self)
        try:
            while self.match is None:
                self.world.scheduler.suspend(None)
        finally:
            event.subscriptions.pop(self, None)
        return self.match
