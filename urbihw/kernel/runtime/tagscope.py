"""The scope of a tag, which generated code opens, enters and leaves around ``tag: statement``.

``timeout``, ``stopif`` and ``freezeif`` have a scope with its own tag, which a timer or a watched condition stops or
freezes.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Protocol

from urbihw.kernel.runtime.event import Accept, Event, Subscription
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.watch import ConditionWatch
from urbihw.kernel.sched.signals import StopTag, supersedes
from urbihw.kernel.sched.tag import Tag, TagEntry
from urbihw.kernel.sched.timequeue import Timer

if TYPE_CHECKING:
    from urbihw.kernel.runtime.conditions import Thunk
    from urbihw.kernel.runtime.world import World


class TagScope(Protocol):
    """One run of tagged code by one job."""

    def enter(self) -> None:
        """Enter the tag; waits while it is frozen; raises StopTag when it is blocked."""
        ...

    def owns(self, signal: StopTag) -> bool:
        """Whether the signal stops this code, and not an outer scope."""
        ...

    def exit(self) -> None:
        """Leave the tag, however the code ended; does nothing if the tag was not entered."""
        ...


class TagObject(Obj):
    """An urbiscript Tag; its clones are its children.  ``above`` is the Tag that it derives from, which tags the same
    code.
    """

    __slots__ = ("above", "enter_event", "leave_event", "tag")
    freeze_refusal = ""
    """The reason why the tag can be stopped but neither blocked nor frozen, "" for other tags.  The handlers of the
    events of such a tag are not waited for."""

    def __init__(self, world: World, protos: list[Obj], tag: Tag) -> None:
        super().__init__(world, protos)
        self.tag = tag
        tag.face = self
        self.above: TagObject | None = protos[0] if protos and isinstance(protos[0], TagObject) else None
        self.enter_event: Event | None = None
        self.leave_event: Event | None = None

    def clone(self) -> TagObject:
        """Make a tag that is a child of this one."""
        tag = Tag(self.world.scheduler, self.world.fresh_tag_name(), self.tag)
        return TagObject(self.world, [self], tag)

    def open(self) -> TagScope:
        """A scope for code under this tag."""
        return TagObjectScope(self)


class RootTag(TagObject):
    """The object ``Tag``, from which tags are cloned."""

    __slots__ = ()
    freeze_refusal = "all tags derive from Tag: use one made by Tag.new"


class TagObjectScope:
    """The scope of an urbiscript tag, with the events ``enter`` and ``leave``."""

    __slots__ = ("_entered", "_face", "entry")

    def __init__(self, face: TagObject) -> None:
        self._face = face
        self.entry: TagEntry | None = None
        self._entered = False

    def enter(self) -> None:
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
        """Whether the signal stops this code."""
        return signal.entry is self.entry

    def exit(self) -> None:
        if self._entered and self.entry is not None:
            self._face.tag.leave(self.entry)
            face: TagObject | None = self._face
            while face is not None:
                if face.leave_event is not None:
                    _announce(face, face.leave_event)
                face = face.above


def _announce(face: TagObject, event: Event) -> None:
    """Emit an event; its handlers begin before the running job goes on."""
    if face.freeze_refusal:  # in its own job: the guards of subscriptions may be functions of other programs
        face.world.spawn_own(lambda: event.emit([]), "tag")
    elif event.emit([]).jobs:
        leaving = sys.exc_info()[1]
        try:
            face.world.scheduler.yield_()
        except BaseException as thrown:
            if leaving is None or supersedes(thrown, leaving):
                raise


class _OwnTagScope:
    """A scope with its own tag."""

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


class LoopScope(_OwnTagScope):
    """A loop whose body detaches jobs: they run under a tag of the loop, and ``break`` stops them."""

    __slots__ = ()

    def __init__(self, world: World) -> None:
        super().__init__(world, "loop")

    def stop_others(self) -> None:
        """Stop the detached jobs, because of a ``break``; the running job goes on after the loop."""
        scheduler, entry = self._tag.scheduler, self._entry
        if entry is not None:
            for job in list(entry.jobs):
                if job is not scheduler.current:
                    scheduler.throw(job, StopTag(entry, None))


class TimeoutScope(_OwnTagScope):
    """``timeout (duration) body``."""

    __slots__ = ("_duration", "_timer", "_world")

    def __init__(self, world: World, duration: float) -> None:
        super().__init__(world, "timeout")
        self._world = world
        self._duration = duration
        self._timer: Timer | None = None

    def enter(self) -> None:
        """Start the timer and enter."""
        scheduler = self._world.scheduler
        deadline = scheduler.clock.now() + self._duration
        self._timer = scheduler.call_at(deadline, lambda: self._tag.stop(self._world.void))
        super().enter()

    def exit(self) -> None:
        """Cancel the timer and leave."""
        if self._timer is not None:
            self._timer.cancel()
        super().exit()


class ConditionScope(_OwnTagScope):
    """``stopif (condition) body`` and ``freezeif (condition) body``."""

    __slots__ = ("_condition", "_freezes", "_watch", "_world")

    def __init__(self, world: World, condition: Thunk, freezes: bool) -> None:
        super().__init__(world, "freezeif" if freezes else "stopif")
        self._world = world
        self._condition = condition
        self._freezes = freezes
        self._watch: ConditionWatch | None = None

    def enter(self) -> None:
        """Start watching the condition and enter."""
        self._entry = self._tag.enter()
        self._watch = ConditionWatch(self._world.recorder, self._condition, self._changed, self._fail)
        self._watch.begin()

    def _fail(self, error: Exception) -> None:
        """Raise an error of the condition in the code under the tag."""
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
        """Stop watching and leave."""
        if self._watch is not None:
            self._watch.stop()
        super().exit()


class EventScope(_OwnTagScope):
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
        """Enter and subscribe to the event."""

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
        if self._subscription is not None:
            self._subscription.stopped()
        super().exit()


class ScopeTag(TagObject):
    """The tag of a scope, stopped when the scope is left."""

    __slots__ = ()

    def close(self) -> None:
        """Stop the code under the tag, except the running job, when the scope is left."""
        current = self.world.scheduler.current
        for entry in list(self.tag.live):
            if current is not None and entry.owner is current:
                self.tag.leave(entry)
        self.tag.stop(self.world.void)
