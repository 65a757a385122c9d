"""at, whenever and waituntil on Boolean expressions, and on events: the verbs that generated code calls.

Each takes Python functions compiled from the urbiscript clauses.  Bodies run as jobs of their own.

No condition is polled: a ``ConditionWatch`` is notified by the places that the condition read (module ``watch``), an
event notifies its subscriptions, and ``~ duration`` sets a timer when the condition becomes true.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.event import (
    Accept,
    Emission,
    Event,
    Handlers,
    Subscription,
    Synchronous,
    SyncSubscription,
    Waiter,
)
from urbihw.kernel.runtime.watch import ConditionWatch
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.sched.waiting import Completion
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Thunk = Callable[[], Any]


def bound(body: Callable[..., Any], match: Sequence[Any]) -> Thunk:
    """A handler with the bound values of its pattern as arguments."""
    return partial(body, *match) if match else body


class AtExpression(Handlers):
    """``at (expression ~ duration) body onleave leave``."""

    __slots__ = ("_body", "_duration", "_leave", "_on", "_timer", "_watch")

    def __init__(self, world: World, condition: Thunk, duration: float | None, body: Thunk, leave: Thunk | None):
        super().__init__(world, "at")
        self._body = body
        self._leave = leave
        self._duration = duration
        self._timer: Timer | None = None
        self._on = False
        self._watch = ConditionWatch(world.recorder, condition, self._edge, self.fail)
        self._watch.begin()

    def _edge(self, value: bool) -> None:
        if self.frozen():
            return
        if not value:
            self._fall()
        elif self._duration is None:
            self._rise()
        else:
            scheduler = self.world.scheduler
            self._timer = scheduler.call_at(scheduler.clock.now() + self._duration, self._rise)

    def _rise(self) -> None:
        self._timer = None
        self._on = True
        self.spawn(self._body)

    def _fall(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._on:
            self._on = False
            if self._leave is not None:
                self.spawn(self._leave)

    def close(self) -> None:
        """End the ``at`` when its tag is stopped; if the condition is true, its ``onleave`` runs."""
        self._watch.stop()
        if self._timer is not None:
            self._timer.cancel()
        if self._on and self._leave is not None:
            self.spawn_last(self._leave)


class SyncAtExpression(Synchronous, AtExpression):
    """``at sync (expression ~ duration) body onleave leave``."""

    __slots__ = ()


class Edge:
    """The present truth of a watched expression; one job may wait until it changes.

    With a duration, the expression counts as true only after it was true for that long.
    """

    __slots__ = ("_changed", "_duration", "_job", "_timer", "_watch", "_world", "value")

    def __init__(self, world: World, condition: Thunk, duration: float | None) -> None:
        self._world = world
        self._duration = duration
        self._job = world.scheduler.running()
        self._timer: Timer | None = None
        self._changed: Completion[None] = Completion(world.scheduler)
        self.value = False
        self._watch = ConditionWatch(world.recorder, condition, self._edge, self._fail)
        self._watch.begin()

    def _edge(self, value: bool) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if value and self._duration is not None:
            scheduler = self._world.scheduler
            self._timer = scheduler.call_at(scheduler.clock.now() + self._duration, lambda: self._set(True))
        else:
            self._set(value)

    def _fail(self, error: Exception) -> None:
        """Pass an error of the condition to the job that waits."""
        self._world.scheduler.throw(self._job, error)

    def _set(self, value: bool) -> None:
        self.value = value
        self._changed.complete(None)

    def wait_change(self) -> None:
        """Park the job until the truth changes."""
        before = self.value
        while self.value == before:
            self._changed = Completion(self._world.scheduler)
            self._changed.wait()

    def stop(self) -> None:
        """Stop watching the condition."""
        self._watch.stop()
        if self._timer is not None:
            self._timer.cancel()


class Conditions:
    """The verbs of one world."""

    def __init__(self, world: World) -> None:
        self.world = world

    def at_expr(self, condition: Thunk, duration: Value, body: Thunk, leave: Thunk | None) -> None:
        """``at (condition ~ duration) body onleave leave``."""
        AtExpression(self.world, condition, duration, body, leave)

    def at_event(
        self, event: Value, accept: Accept, duration: Value, body: Callable[..., Any], leave: Callable[..., Any] | None
    ) -> None:
        """``at (event?(...) ~ duration) body onleave leave``; bodies take the bound values."""
        self._subscribe(Subscription, event, accept, duration, body, leave)

    def at_sync_expr(self, condition: Thunk, duration: Value, body: Thunk, leave: Thunk | None) -> None:
        """``at sync (condition ~ duration) body onleave leave``."""
        SyncAtExpression(self.world, condition, duration, body, leave)

    def at_sync_event(
        self, event: Value, accept: Accept, duration: Value, body: Callable[..., Any], leave: Callable[..., Any] | None
    ) -> None:
        """``at sync (event?(...) ~ duration) body onleave leave``."""
        self._subscribe(SyncSubscription, event, accept, duration, body, leave)

    def _subscribe(
        self,
        kind: type[Subscription],
        event: Value,
        accept: Accept,
        duration: Value,
        body: Callable[..., Any],
        leave: Callable[..., Any] | None,
    ) -> None:
        def entered(match: Any, _: Emission) -> Thunk:
            return partial(body, *match) if match else body

        left = None if leave is None else partial(bound, leave)
        kind(self.world, self._event(event), accept, entered, left, duration)

    def whenever_expr(self, condition: Thunk, duration: Value, body: Thunk, otherwise: Thunk | None) -> None:
        """``whenever (condition) body else otherwise``: runs one of the two bodies again and again."""
        scheduler = self.world.scheduler

        def loop() -> None:
            edge = Edge(self.world, condition, duration)
            try:
                while True:
                    chosen = body if edge.value else otherwise
                    if chosen is None:
                        edge.wait_change()
                    else:
                        chosen()
                        scheduler.yield_()
            finally:
                edge.stop()

        scheduler.spawn(loop, "whenever", parent=scheduler.running())

    def whenever_event(
        self,
        event: Value,
        accept: Accept,
        duration: Value,
        body: Callable[..., Any],
        otherwise: Callable[..., Any] | None,
    ) -> None:
        """``whenever (event?(...)) body else otherwise``."""
        source = self._event(event)
        scheduler = self.world.scheduler

        def entered(match: Any, emission: Emission) -> Thunk:
            def loop() -> None:
                body(*match)
                scheduler.yield_()
                while emission.on:
                    body(*match)
                    scheduler.yield_()

            return loop

        Subscription(self.world, source, accept, entered, None, duration)
        if otherwise is not None:
            rest = otherwise

            def off() -> None:
                while True:
                    source.wait_until_over()
                    rest()
                    scheduler.yield_()

            scheduler.spawn(off, "whenever", parent=scheduler.running())

    def wait_expr(self, condition: Thunk, duration: Value) -> None:
        """``waituntil (condition ~ duration)``."""
        edge = Edge(self.world, condition, duration)
        try:
            if not edge.value:
                edge.wait_change()
        finally:
            edge.stop()

    def wait_event(self, event: Value, accept: Accept) -> Any:
        """``waituntil (event?(...))``; the bound values."""
        return Waiter(self.world, accept).wait(self._event(event))

    def emit(self, event: Value, payload: list[Value], duration: Value = None) -> Any:
        """``event!(payload) ~ duration``; void."""
        if event.__class__ is Event and "emit" not in event.slots:
            if duration is None:
                event.begin(payload).stop()
            else:
                event.emit(payload, duration)
        elif duration is None:
            self.world.send(event, "emit", *payload)
        else:
            self._event(event).emit(payload, duration)
        return self.world.void

    def _event(self, event: Value) -> Event:
        if not isinstance(event, Event):
            raise self.world.type_error(None, event, "Event", None)
        return event
