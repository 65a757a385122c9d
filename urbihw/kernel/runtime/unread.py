"""Caught errors whose slots are made when a program reads them: message, location, backtrace.

Most programs catch an error and go on.  So an error is noted at the throw, as the instructions that led to it and the
parts of its message, and its slots are made when one of them is used.  They are then as they were at the throw.  A note
refers to code, not to frames, and to names, not to objects: an error keeps no variables alive.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import Stack
from urbihw.kernel.runtime.location import make_frames, make_location
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.record import lineage
from urbihw.kernel.runtime.spelling import MAX_ANCESTORS, suggestion

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

_NOTE = ""
"""The key of the note among the slots; no slot has an empty name."""
_raw = Obj.__dict__["slots"]


class UnreadError(Plain):
    """An error whose slots are not complete; it becomes a Plain when they are."""

    __slots__ = ()

    @property
    def slots(self) -> dict[str, Any]:  # type: ignore[override]
        """The slots, which are made now."""
        slots: dict[str, Any] = _raw.__get__(self)
        self.__class__ = Plain  # type: ignore[assignment]
        slots.pop(_NOTE)(slots)
        return slots


def make_unread(world: World, raised: errors.Raised, find_stack: Callable[[], Stack]) -> Obj:
    """The object of an error of native code."""
    base = world.exception_proto
    made = Plain(world, [world.classes.get(f"Exception.{raised.kind}", base)])
    message, routine, more = raised.message, raised.routine, raised.slots
    spelling = _note_spelling(world, raised) if isinstance(raised, errors.LookupFailed) else None

    def fill(slots: dict[str, Any]) -> None:
        stack = find_stack()
        slots["message"] = world.string(message if spelling is None else message + spelling())
        name = stack.routine if routine == "" else routine
        if name is not None:
            slots["routine"] = world.string(name)
        for slot, value in more.items():
            slots[slot] = world.from_python(value)
        locate(world, slots, stack)

    made.slots[_NOTE] = fill
    made.__class__ = UnreadError
    return made


def locate_later(value: Obj, find_stack: Callable[[], Stack]) -> None:
    """Give an error that a program has made its location and its backtrace when one of its slots is used."""
    world = value.world
    if value.__class__ is Plain and value.cache is None:
        value.slots[_NOTE] = lambda slots: locate(world, slots, find_stack())
        value.__class__ = UnreadError
        return
    locate(world, value.slots, find_stack())
    if value.cache is not None:
        world.flush()


def locate(world: World, slots: dict[str, Any], stack: Stack) -> None:
    """Add location and backtrace to the slots of an error."""
    slots["location"] = make_location(world, stack.location)
    slots["backtrace"] = make_frames(world, stack)


def _note_spelling(world: World, raised: errors.LookupFailed) -> Callable[[], str] | None:
    """What is added to the message of a failed look-up, found when it is asked for; None for nothing."""
    if raised.target is None:
        return None
    kind = world.classes.get("Exception.Lookup")
    if kind is None or not kind.slots.get("fixSpelling"):
        return None
    name: str = raised.slots["name"]
    own: list[str] = []
    ancestor, lines, is_shared = world.peek_obj(raised.target), world.lookups.library, world.record.is_shared
    for _ in range(MAX_ANCESTORS):
        protos = ancestor.protos
        if ancestor in lines or len(protos) != 1:
            break
        own += ancestor.slots  # the object itself is not kept: it may be large
        ancestor = protos[0] if protos[0].__class__ is not float else world.peek_obj(protos[0])
    library = lines.get(ancestor)
    if library is None:
        line = [world.peek_obj(each) for each in lineage(world, ancestor)[:MAX_ANCESTORS]]
        library = [each.slots for each in line if is_shared(each)]
        if len(library) == len(line):
            lines[ancestor] = library
        else:
            own += [name for each in line if not is_shared(each) for name in each.slots]
    counts = list(map(len, library))  # what is added later stands behind these

    def found() -> str:
        known = (slot for slots, count in zip(library, counts, strict=True) for slot in islice(slots, count))
        return suggestion(name, {*own, *known})

    return found
