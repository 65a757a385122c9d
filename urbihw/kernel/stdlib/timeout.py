"""Timeout: a tag with a time limit for its code.

Source: manual, specs/timeout.  Each execution of code under it has a count-down and a child tag of its own.
"""

from __future__ import annotations

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.tagscope import TagObject
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.signals import StopTag
from urbihw.kernel.sched.tag import Tag, TagEntry
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.stdlib.object import as_string as object_text

TABLE = Table("Timeout")


class TimeoutObject(TagObject):
    """An urbiscript Timeout: a tag with a duration."""

    __slots__ = ("duration", "throws", "timed_out")

    def __init__(self, world: World, protos: list[Obj], parent: Tag | None = None) -> None:
        super().__init__(world, protos, Tag(world.scheduler, "timeout", parent))
        self.duration = 0.0
        self.throws = True
        self.timed_out = False

    def clone(self) -> TimeoutObject:
        """A Timeout with the same duration."""
        made = TimeoutObject(self.world, [self], self.tag)
        made.duration, made.throws = self.duration, self.throws
        return made

    def open(self) -> CountDown:
        """A scope with its own count-down."""
        return CountDown(self)


class CountDown:
    """The scope of a Timeout."""

    __slots__ = ("_entry", "_face", "_fired", "_left", "_tag", "_timer")

    def __init__(self, face: TimeoutObject) -> None:
        self._face = face
        self._tag = Tag(face.world.scheduler, face.tag.name, face.tag)
        self._entry: TagEntry | None = None
        self._timer: Timer | None = None
        self._fired = False
        self._left = False

    def enter(self) -> None:
        """Enter the scope and start the count-down."""
        try:
            self._entry = self._tag.enter()
        except StopTag as signal:
            if signal.entry.tag is self._tag:
                self._entry = signal.entry
            raise
        self._face.timed_out = False
        scheduler = self._face.world.scheduler
        self._timer = scheduler.call_at(scheduler.clock.now() + self._face.duration, self._fire)

    def _fire(self) -> None:
        self._fired = True
        self._face.timed_out = True
        self._tag.stop(self._face.world.void)

    def owns(self, signal: StopTag) -> bool:
        """Whether the stop signal belongs to this scope."""
        self._left = signal.entry is self._entry
        return self._left

    def exit(self) -> None:
        """Leave the scope.  Raises ``X has timed out.`` if the time limit was reached before the end of the code."""
        if self._timer is not None:
            self._timer.cancel()
            if self._entry is not None:
                self._tag.leave(self._entry)
        if self._fired and self._left and self._face.throws:
            raise errors.Raised("Exception", f"{self._face.world.text(self._face)} has timed out.", None)


CLASSES = {"Timeout": TimeoutObject}
PROTOS = {"Timeout": ("Tag",)}


@TABLE.primitive("init")
def init(world: World, this: TimeoutObject, duration: float, throws: bool = True) -> None:
    """Make a tag with a time limit of ``duration`` seconds; an exception is raised at the limit unless ``throws`` is
    false.
    """
    this.duration = duration
    this.throws = throws


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: TimeoutObject) -> str:
    """As any object, and not as a Tag."""
    text: str = object_text(world, this)
    return text


@TABLE.primitive("timedOut")
def timed_out(world: World, this: TimeoutObject) -> bool:
    """Whether the time limit was reached in the last use."""
    return this.timed_out


@TABLE.primitive("launch")
def launch(world: World, this: TimeoutObject) -> None:
    """Start a count-down; at its end it stops the code that is then under this tag."""

    def fire() -> None:
        this.timed_out = True
        this.tag.stop(world.void)

    scheduler = world.scheduler
    scheduler.call_at(scheduler.clock.now() + this.duration, fire)
