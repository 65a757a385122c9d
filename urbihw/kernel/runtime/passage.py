"""Passing through tagged code: what generated code opens, enters and leaves around ``tag: statement``.

``timeout``, ``stopif`` and ``freezeif`` pass through a tag of their own, which a timer or a watched condition stops or
freezes.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Protocol

from urbihw.kernel.runtime.event import Accept, Event, Subscription
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.watch import Watch
from urbihw.kernel.sched.signals import StopTag, supersedes
from urbihw.kernel.sched.tag import Tag, TagEntry
from urbihw.kernel.sched.timequeue import Timer

if TYPE_CHECKING:
    from urbihw.kernel.runtime.conditions import Thunk
    from urbihw.kernel.runtime.world import World


class Passage(Protocol):
    """One passage of one job through tagged code."""

    def enter(self) -> None:
        """Go in; may wait; may raise StopTag when the tag is blocked."""
        ...

    def owns(self, signal: StopTag) -> bool:
        """Whether this passage is the one to be left."""
        ...

    def exit(self) -> None:
        """Go out, however the code ended; harmless if it was never entered."""
        ...


class TagObject(Obj):
    """An urbiscript Tag; a clone of one is its child.  ``above`` is the Tag it derives from: it tags the same code."""

    __slots__ = ("above", "enter_event", "leave_event", "tag")
    for_all = ""
    """For one that others go through who know nothing of it: why it can be stopped but neither blocked nor frozen.  Who
    listens at its events is not waited for."""

    def __init__(self, world: World, protos: list[Obj], tag: Tag) -> None:
        super().__init__(world, protos)
        self.tag = tag
        tag.face = self
        self.above: TagObject | None = protos[0] if protos and isinstance(protos[0], TagObject) else None
        self.enter_event: Event | None = None
        self.leave_event: Event | None = None

    def clone(self) -> TagObject:
        """A child tag."""
        tag = Tag(self.world.scheduler, self.world.fresh_tag_name(), self.tag)
        return TagObject(self.world, [self], tag)

    def open(self) -> Passage:
        """A passage through code under this tag."""
        return TagPassage(self)


class RootTag(TagObject):
    """Tag itself."""

    __slots__ = ()
    for_all = "all tags derive from Tag: use one made by Tag.new"


class TagPassage:
    """A passage through a tag, with its enter and leave events."""

    __slots__ = ("_entered", "_face", "entry")

    def __init__(self, face: TagObject) -> None:
        self._face = face
        self.entry: TagEntry | None = None
        self._entered = False

    def enter(self) -> None:
        """Go in."""
        try:
            self.entry = self._face.tag.enter()
        except StopTag as signal:
            if signal.entry.tag is self._face.tag:
                self.entry = signal.entry
            raise
        self._entered = True
        face: TagObject | None = self._face
        while face is not None:
            if face.enter_event is not None:
                _announce(face, face.enter_event)
            face = face.above

    def owns(self, signal: StopTag) -> bool:
        """Whether this passage is to be left."""
        return signal.entry is self.entry

    def exit(self) -> None:
        """Go out."""
        if self._entered and self.entry is not None:
            self._face.tag.leave(self.entry)
            face: TagObject | None = self._face
            while face is not None:
                if face.leave_event is not None:
                    _announce(face, face.leave_event)
                face = face.above


def _announce(face: TagObject, event: Event) -> None:
    """Emit an event, and let its handlers begin before the running job goes on."""
    if face.for_all:  # in a job of its own: the guards of subscriptions are functions of any program
        face.world.spawn_own(lambda: event.emit([]), "tag")
    elif event.emit([]).jobs:
        leaving = sys.exc_info()[1]
        try:
            face.world.scheduler.yield_()
        except BaseException as thrown:
            if leaving is None or supersedes(thrown, leaving):
                raise


class _Guard:
    """A passage through a tag of its own."""

    __slots__ = ("_entry", "_tag")

    def __init__(self, world: World, name: str) -> None:
        self._tag = Tag(world.scheduler, name)
        self._entry: TagEntry | None = None

    def enter(self) -> None:
        self._entry = self._tag.enter()

    def owns(self, signal: StopTag) -> bool:
        return signal.entry is self._entry

    def exit(self) -> None:
        if self._entry is not None:
            self._tag.leave(self._entry)


class LoopPassage(_Guard):
    """A loop whose body detaches jobs: they are under a tag of the loop, and ``break`` stops them."""

    __slots__ = ()

    def __init__(self, world: World) -> None:
        super().__init__(world, "loop")

    def stop_others(self) -> None:
        """The loop is broken: what it detached ends; the job that runs goes on behind the loop."""
        scheduler, entry = self._tag.scheduler, self._entry
        if entry is not None:
            for job in list(entry.jobs):
                if job is not scheduler.current:
                    scheduler.throw(job, StopTag(entry, None))


class TimeoutPassage(_Guard):
    """``timeout (duration) body``."""

    __slots__ = ("_duration", "_timer", "_world")

    def __init__(self, world: World, duration: float) -> None:
        super().__init__(world, "timeout")
        self._world = world
        self._duration = duration
        self._timer: Timer | None = None

    def enter(self) -> None:
        """Start the clock and go in."""
        scheduler = self._world.scheduler
        deadline = scheduler.clock.now() + self._duration
        self._timer = scheduler.call_at(deadline, lambda: self._tag.stop(self._world.void))
        super().enter()

    def exit(self) -> None:
        """Stop the clock and go out."""
        if self._timer is not None:
            self._timer.cancel()
        super().exit()


class ConditionPassage(_Guard):
    """``stopif (condition) body`` and ``freezeif (condition) body``."""

    __slots__ = ("_condition", "_freezes", "_watch", "_world")

    def __init__(self, world: World, condition: Thunk, freezes: bool) -> None:
        super().__init__(world, "freezeif" if freezes else "stopif")
        self._world = world
        self._condition = condition
        self._freezes = freezes
        self._watch: Watch | None = None

    def enter(self) -> None:
        """Begin to watch and go in."""
        self._entry = self._tag.enter()
        self._watch = Watch(self._world.recorder, self._condition, self._changed, self._fail)
        self._watch.begin()

    def _fail(self, error: Exception) -> None:
        """The condition failed: so does the code under it."""
        if self._entry is not None:
            self._world.scheduler.throw(self._entry.owner, error)

    def _changed(self, value: bool) -> None:
        if not self._freezes:
            if value:
                self._tag.stop(self._world.void)
        elif value:
            self._tag.freeze()
        else:
            self._tag.unfreeze()

    def exit(self) -> None:
        """Watch no more and go out."""
        if self._watch is not None:
            self._watch.stop()
        super().exit()


class EventPassage(_Guard):
    """``stopif (event?) body`` and ``freezeif (event?) body``."""

    __slots__ = ("_accept", "_event", "_freezes", "_subscription", "_world")

    def __init__(self, world: World, event: Event, accept: Accept, freezes: bool) -> None:
        super().__init__(world, "freezeif" if freezes else "stopif")
        self._world = world
        self._event = event
        self._accept = accept
        self._freezes = freezes
        self._subscription: Subscription | None = None

    def enter(self) -> None:
        """Go in and listen."""

        def began(match: object, emission: object) -> None:
            if self._freezes:
                self._tag.freeze()
            else:
                self._tag.stop(self._world.void)

        def ended(match: object) -> None:
            if self._freezes:
                self._tag.unfreeze()

        self._subscription = Subscription(self._world, self._event, self._accept, began, ended, None)
        super().enter()

    def exit(self) -> None:
        """Listen no more and go out."""
        if self._subscription is not None:
            self._subscription.stopped()
        super().exit()


class ScopeTag(TagObject):
    """The tag of a scope, stopped when the scope is left."""

    __slots__ = ()

    def close(self) -> None:
        """The scope is left: stop what runs under its tag, except the job that leaves."""
        current = self.world.scheduler.current
        for entry in list(self.tag.live):
            if current is not None and entry.owner is current:
                self.tag.leave(entry)
        self.tag.stop(self.world.void)
