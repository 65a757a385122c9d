"""Tag: a handle on the code that runs under it.

Source: manual, specs/tag.  The mechanism is ``sched.tag``; ``Tag.scope`` and ``scopeTag`` belong to the compiler.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.passage import TagObject, TagPassage
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.support import say

TABLE = Table("Tag")

NOTES = {
    "Tag.tags": "The tags that were used without being declared, as slots.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class MarkedTag(TagObject):
    """A child tag that says when code under it begins, ends, or both."""

    __slots__ = ("begins", "ends")

    def __init__(self, parent: TagObject, begins: bool, ends: bool) -> None:
        tag = Tag(parent.world.scheduler, parent.tag.name, parent.tag)
        super().__init__(parent.world, [parent], tag)
        self.begins = begins
        self.ends = ends

    def clone(self) -> MarkedTag:
        """A child that says the same."""
        return MarkedTag(self, self.begins, self.ends)

    def open(self) -> MarkedPassage:
        """A passage that says so."""
        return MarkedPassage(self)


class MarkedPassage(TagPassage):
    """A passage through a MarkedTag."""

    __slots__ = ("_marked",)

    def __init__(self, marked: MarkedTag) -> None:
        super().__init__(marked)
        self._marked = marked

    def enter(self) -> None:
        """Go in, and say so."""
        super().enter()
        if self._marked.begins:
            say(self._marked.world, starred(f"{self._marked.tag.name}: begin"))

    def exit(self) -> None:
        """Go out, and say so if ever gone in."""
        entered = self._entered
        super().exit()
        if entered and self._marked.ends:
            say(self._marked.world, starred(f"{self._marked.tag.name}: end"))


def _marks(this: TagObject) -> tuple[bool, bool]:
    return (this.begins, this.ends) if isinstance(this, MarkedTag) else (False, False)


@TABLE.primitive("init")
def init(world: World, this: TagObject, name: str | None = None) -> None:
    """A tag, named if a name is given."""
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
def stop(world: World, this: TagObject, value: Any = None) -> None:
    """Stop all code under this tag; what it was part of goes on with a value, void if none is given."""
    this.tag.stop(world.void if value is None else value)


@TABLE.primitive("block")
def block(world: World, this: TagObject, value: Any = None) -> None:
    """Stop all code under this tag, and skip all code that comes to it until ``unblock``; it is worth a value, void if
    none is given.

    Raises Primitive for Tag itself and for the tag of a connection, which others need.
    """
    _check(this)
    this.tag.block(world.void if value is None else value)


def _check(this: TagObject) -> None:
    if this.for_all:
        raise errors.primitive(this.for_all)


@TABLE.primitive("unblock")
def unblock(world: World, this: TagObject) -> None:
    """Let code run under this tag again."""
    this.tag.unblock()


@TABLE.primitive("blocked")
def blocked(world: World, this: TagObject) -> bool:
    """Whether this tag, or one it derives from, is blocked."""
    return this.tag.blocker() is not None


@TABLE.primitive("freeze")
def freeze(world: World, this: TagObject) -> None:
    """Hold all code under this tag, and all that comes to it, until ``unfreeze``.

    Raises Primitive for Tag itself and for the tag of a connection, which others need.
    """
    _check(this)
    this.tag.freeze()


@TABLE.primitive("unfreeze")
def unfreeze(world: World, this: TagObject) -> None:
    """Let the code under this tag go on."""
    this.tag.unfreeze()


@TABLE.primitive("frozen")
def frozen(world: World, this: TagObject) -> bool:
    """Whether this tag, or one it derives from, is frozen."""
    return this.tag.is_frozen()


@TABLE.primitive("scope")
def scope(world: World, this: Any) -> None:
    """``Tag.scope``: a fresh tag that is stopped at the end of the scope it is written in.

    The compiler makes it, where it stands in the text: as a function, called from wherever, it knows no scope and says
    so.
    """
    raise errors.primitive("must be called as `Tag.scope' in the scope that it is for")


# ---------------------------------------------------------------- entering and leaving


@TABLE.primitive("enter")
def enter(world: World, this: TagObject) -> Any:
    """The event emitted whenever code under this tag begins."""
    if this.enter_event is None:
        this.enter_event = Event(world, [world.event_proto])
    return this.enter_event


@TABLE.primitive("leave")
def leave(world: World, this: TagObject) -> Any:
    """The event emitted whenever code under this tag ends, in whatever way."""
    if this.leave_event is None:
        this.leave_event = Event(world, [world.event_proto])
    return this.leave_event


@TABLE.primitive("begin")
def begin(world: World, this: TagObject) -> Any:
    """A child tag that says ``NAME: begin`` whenever code under it begins."""
    return MarkedTag(this, True, _marks(this)[1])


@TABLE.primitive("end")
def end(world: World, this: TagObject) -> Any:
    """A child tag that says ``NAME: end`` whenever code under it ends."""
    return MarkedTag(this, _marks(this)[0], True)


def install(world: World, programs: Any) -> None:
    """Tags used without declaration are slots of ``Tag.tags``, where all can see them."""
    world.tag_proto.slots["tags"] = world.tags
    world.global_.protos.insert(0, world.tags)
    world.record.open_ended.append(world.tags)
