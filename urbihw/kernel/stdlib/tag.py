"""Tag: a handle that controls the code running under it.

Source: manual, specs/tag.  ``sched.tag`` has the mechanism; ``Tag.scope`` and ``scopeTag`` are compiled.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.tagscope import TagObject, TagObjectScope
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.support import send_line
from urbihw.kernel.value import Value

TABLE = Table("Tag")

NOTES = {
    "Tag.tags": "The tags that were used without a declaration, as slots.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class MarkedTag(TagObject):
    """A child tag that prints a message when code under it begins, ends, or both."""

    __slots__ = ("begins", "ends")

    def __init__(self, parent: TagObject, begins: bool, ends: bool) -> None:
        tag = Tag(parent.world.scheduler, parent.tag.name, parent.tag)
        super().__init__(parent.world, [parent], tag)
        self.begins = begins
        self.ends = ends

    def clone(self) -> MarkedTag:
        """A child tag with the same messages."""
        return MarkedTag(self, self.begins, self.ends)

    def open(self) -> MarkedTagScope:
        """A scope that prints the messages."""
        return MarkedTagScope(self)


class MarkedTagScope(TagObjectScope):
    """The scope of a MarkedTag."""

    __slots__ = ("_marked",)

    def __init__(self, marked: MarkedTag) -> None:
        super().__init__(marked)
        self._marked = marked

    def enter(self) -> None:
        """Enter the scope, and print the message."""
        super().enter()
        if self._marked.begins:
            send_line(self._marked.world, starred(f"{self._marked.tag.name}: begin"))

    def exit(self) -> None:
        """Leave the scope, and print the message if the scope was entered."""
        entered = self._entered
        super().exit()
        if entered and self._marked.ends:
            send_line(self._marked.world, starred(f"{self._marked.tag.name}: end"))


def _marks(this: TagObject) -> tuple[bool, bool]:
    return (this.begins, this.ends) if isinstance(this, MarkedTag) else (False, False)


@TABLE.primitive("init")
def init(world: World, this: TagObject, name: str | None = None) -> None:
    """Make a tag, with a name if one is given."""
    if name is not None:
        this.tag.name = name


@TABLE.primitive("name")
def name(world: World, this: TagObject) -> str:
    """The name of this tag."""
    return this.tag.name


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: TagObject) -> str:
    """``Tag<name>``."""
    return f"Tag<{this.tag.name}>"


# ---------------------------------------------------------------- commands


@TABLE.primitive("stop")
def stop(world: World, this: TagObject, value: Value = None) -> None:
    """Stop all code under this tag; the tagged statement returns the value, void by default."""
    this.tag.stop(world.void if value is None else value)


@TABLE.primitive("block")
def block(world: World, this: TagObject, value: Value = None) -> None:
    """Stop all code under this tag, and skip code that enters it until ``unblock``; the skipped statement returns the
    value, void by default.

    Raises Primitive for Tag itself and for the tag of a connection, which other jobs need.
    """
    _check(this)
    this.tag.block(world.void if value is None else value)


def _check(this: TagObject) -> None:
    if this.freeze_refusal:
        raise errors.primitive(this.freeze_refusal)


@TABLE.primitive("unblock")
def unblock(world: World, this: TagObject) -> None:
    """Allow code to run under this tag again."""
    this.tag.unblock()


@TABLE.primitive("blocked")
def blocked(world: World, this: TagObject) -> bool:
    """Whether this tag, or one of its parents, is blocked."""
    return this.tag.blocker() is not None


@TABLE.primitive("freeze")
def freeze(world: World, this: TagObject) -> None:
    """Suspend all code under this tag, and code that enters it, until ``unfreeze``.

    Raises Primitive for Tag itself and for the tag of a connection, which other jobs need.
    """
    _check(this)
    this.tag.freeze()


@TABLE.primitive("unfreeze")
def unfreeze(world: World, this: TagObject) -> None:
    """Resume the code under this tag."""
    this.tag.unfreeze()


@TABLE.primitive("frozen")
def frozen(world: World, this: TagObject) -> bool:
    """Whether this tag, or one of its parents, is frozen."""
    return this.tag.is_frozen()


@TABLE.primitive("scope")
def scope(world: World, this: Value) -> None:
    """``Tag.scope``: a new tag that is stopped at the end of the enclosing scope.

    It is compiled directly in the scope.  Called as a function it has no scope and raises an error.
    """
    raise errors.primitive("must be called as `Tag.scope' in the scope that it is for")


# ---------------------------------------------------------------- entering and leaving


@TABLE.primitive("enter")
def enter(world: World, this: TagObject) -> Value:
    """The event that is emitted when code under this tag begins."""
    if this.enter_event is None:
        this.enter_event = Event(world, [world.event_proto])
    return this.enter_event


@TABLE.primitive("leave")
def leave(world: World, this: TagObject) -> Value:
    """The event that is emitted when code under this tag ends in any way."""
    if this.leave_event is None:
        this.leave_event = Event(world, [world.event_proto])
    return this.leave_event


@TABLE.primitive("begin")
def begin(world: World, this: TagObject) -> Value:
    """A child tag that prints ``NAME: begin`` when code under it begins."""
    return MarkedTag(this, True, _marks(this)[1])


@TABLE.primitive("end")
def end(world: World, this: TagObject) -> Value:
    """A child tag that prints ``NAME: end`` when code under it ends."""
    return MarkedTag(this, _marks(this)[0], True)


def install(world: World, programs: Any) -> None:
    """Install ``Tag.tags``, whose slots are the tags used without declaration, visible to all connections."""
    world.tag_proto.slots["tags"] = world.tags
    world.global_.protos.insert(0, world.tags)
    world.record.open_ended.append(world.tags)
