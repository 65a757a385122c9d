"""The record of the library as it was when start-up was complete, and restoring it.

All connections share the prototypes of the library and the robot's objects, and a program may change them.  Three
mechanisms limit the damage that one program can do to the others:

- Some slots are *protected*: System and ending the server, the robot and its stop.  No program can remove, replace or
  hide them.  ``SlotOps.put_slot``, ``SlotOps.remove_slot`` and ``Obj.set_protos`` check this for the few protected
  names.
- A function that a program has put into a shared object and that holds the interpreter is replaced by the recorded one
  at once, and at the second time for good (``restore_held``), since it would hold up every caller.
- The prototypes and slots of all shared objects are *recorded*, and so are later changes by the robot's own code.  When
  a connection is opened, slots that were removed or replaced by an implausible value are restored; other redefinitions
  are reported, and ``reset`` restores them too.  Added slots are reported only where they hide a function of the
  library.  A slot with a plain value is a variable, and its value is not compared; nil, true and false are plain
  values in all single objects.  (In a class they are the defaults of its objects.)
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from types import CodeType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Code, Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import plain_type
from urbihw.kernel.runtime.slot import SlotMeta, meta_of
from urbihw.kernel.runtime.slots import OPERATORS
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.runtime.watch import ConditionWatch
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")

ABSENT: Final[Any] = object()
"""Represents the value of a slot that does not exist."""
PRINTING: Final = ("asToplevelPrintable", "asPrintable", "asString")
"""The slots with which the top level prints values."""
MAX_HOLDS: Final = 2
"""How often functions in the place of a library function may hold the interpreter, before no other one is accepted."""
MAX_NAMED: Final = 6
"""Maximum number of changes named in one line."""


class ProtectedSlot(NamedTuple):
    """A protected slot: looked up from ``anchor``, it must be found in ``holder``."""

    anchor: Obj
    holder: Obj


class RecordedObject(NamedTuple):
    """The record of one shared object.

    ``is_class``: it is a prototype, not a single object; ``is_robots``: it was made by the robot, not by the library.
    """

    name: str
    obj: Obj
    protos: list[Any]
    slots: dict[str, Any]
    meta: dict[str, SlotMeta]
    is_class: bool
    is_robots: bool


class Changes:
    """The result of a comparison with the record: the slots that were restored, and those that differ and stay."""

    def __init__(self) -> None:
        self.back: dict[str, None] = {}
        self.different: dict[str, None] = {}


class Adoption:
    """Code of the robot that runs: what was there when it began, or when the library was recorded meanwhile."""

    def __init__(self, names: Iterable[str], kept: Iterable[Obj]) -> None:
        self.names = set(names)
        """The slots of Global."""
        self.begin(kept)

    def begin(self, kept: Iterable[Obj]) -> None:
        """What differs from now on is a change."""
        self.before = {obj: (dict(obj.slots), list(obj.protos)) for obj in kept}


class Record:
    """The record of one world.  ``protected`` has the slots that no program can change, by name."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.protected: dict[str, list[ProtectedSlot]] = {}
        self.open_ended: list[Obj] = []
        """Objects to which programs and devices add slots all the time: only their functions are recorded."""
        self._kept: dict[Obj, RecordedObject] = {}
        self._by_name: dict[str, RecordedObject] = {}
        self._functions: set[str] = set()
        self._robots: set[str] = set()  # slots of Global that its own code has made
        self._adoptions: list[Adoption] = []
        self._librarys: frozenset[str] = frozenset()  # slots of Global before there was a robot
        self._quick: tuple[Any, ...] = ()
        self._logged: set[tuple[str, str]] = set()
        self._holds: Counter[str] = Counter()
        self._printers: list[RecordedObject] = []
        self._printing = self._watch_printing()

    # ---------------------------------------------------------------- what is owed

    def protect(self, anchor: Obj, *names: str) -> None:
        """Protect these slots of an object with their present values."""
        for name in names:
            holder = anchor.find(name)
            if holder is None:
                continue
            self.protected.setdefault(name, []).append(ProtectedSlot(anchor, holder))
            meta = meta_of(holder, name)
            if meta.accessor is None:
                meta.constant = True

    def is_shared(self, obj: Value) -> bool:
        """Whether an object belongs to the library or the robot."""
        return isinstance(obj, Obj) and obj in self._kept

    def has(self, obj: Obj, name: str) -> bool:
        """Whether a slot of a shared object is recorded."""
        kept = self._kept.get(obj)
        return kept is not None and name in kept.slots

    def is_librarys(self, name: str) -> bool:
        """Whether a slot of Global belongs to the library: neither the robot nor a program has made it."""
        return name in self._librarys

    def guard(self, obj: Obj, name: str) -> None:
        """Raise an error if making or replacing a slot of this protected name would replace or hide a protected
        slot.
        """
        for owed in self.protected[name]:
            if owed.holder is obj or _would_hide(self._world, obj, owed):
                raise errors.protected_slot(name)

    def guard_removal(self, obj: Obj, name: str) -> None:
        """Raise an error if removing a slot of this protected name would remove a protected slot."""
        if any(owed.holder is obj for owed in self.protected[name]):
            raise errors.protected_slot(name)

    def lost(self) -> str:
        """The name of a protected slot that a look-up does not find any more, "" if all are found; to be called after
        prototypes have changed.
        """
        for name, all_owed in self.protected.items():
            for owed in all_owed:
                if owed.anchor.find(name) is not owed.holder:
                    return name
        return ""

    # ---------------------------------------------------------------- the record

    def note_library(self) -> None:
        """The library is complete: what Global gets from now on belongs to the robot and to programs."""
        self._librarys = frozenset(self._world.global_.slots)

    def take_snapshot(self) -> None:
        """Record the library as it is now."""
        world = self._world
        for adoption in self._adoptions:
            self._robots |= world.global_.slots.keys() - adoption.names
        self._kept.clear()
        self._by_name.clear()
        self._record_reachable([("Global", world.global_)])
        self._quick = (world.generic_floats, world.quick_strings, world.quick_lists)
        for adoption in self._adoptions:
            adoption.begin(self._kept)

    def _record_reachable(self, roots: list[tuple[str, Any]]) -> None:
        """Record the objects that can be reached from these roots and are not recorded yet."""
        for name, obj in _shared(self._world, roots, self._kept):
            some = obj in self.open_ended
            slots = {slot: value for slot, value in obj.slots.items() if not some or isinstance(value, Executable)}
            meta = {slot: each for slot, each in (obj.meta or {}).items() if each.accessor or each.constant}
            is_robots = name.partition(".")[0] in self._robots
            kept = RecordedObject(name, obj, list(obj.protos), slots, meta, _is_class(name, slots), is_robots)
            self._kept[obj] = kept
            self._by_name.setdefault(name, kept)
            self._functions.update(slot for slot, value in slots.items() if isinstance(value, Executable))
        self._printers = [kept for kept in self._kept.values() if kept.is_class and kept.obj not in self.open_ended]
        self._printing.stop()
        self._printing = self._watch_printing()
        self._printing.begin()

    def adopt(self, run: Callable[[], Any]) -> None:
        """Run code of the robot itself, and record its changes of shared objects.

        Before the first snapshot, all changes are part of the record.  The code may wait, and a snapshot be taken
        meanwhile.  Raises what ``run`` raises.
        """
        adoption = Adoption(self._world.global_.slots, self._kept)
        self._adoptions.append(adoption)
        try:
            run()
        finally:
            self._adoptions.remove(adoption)
            self._robots |= self._world.global_.slots.keys() - adoption.names
            changed = [
                root for obj, (slots, protos) in adoption.before.items() if obj.slots != slots or obj.protos != protos
                for root in self._adopted(obj, slots, protos)
            ]  # fmt: skip
            if changed:
                self._record_reachable(changed)

    def _adopted(self, obj: Obj, slots: dict[str, Any], protos: list[Value]) -> Iterator[tuple[str, Any]]:
        """Record the changes of an object, and return the new values with their names."""
        kept = self._kept[obj]
        if obj.protos != protos:
            kept.protos[:] = obj.protos
        prefix = "" if obj is self._world.global_ else f"{kept.name}."
        for name in slots.keys() | obj.slots.keys():
            value = obj.slots.get(name, ABSENT)
            if value is slots.get(name, ABSENT):
                continue
            if value is ABSENT:
                kept.slots.pop(name, None)
            elif obj not in self.open_ended or isinstance(value, Executable):
                kept.slots[name] = value
                yield prefix + name, value
            if isinstance(value, Executable):
                self._functions.add(name)

    def original(self, obj: Obj, name: str) -> Any:
        """The value of a slot of a shared object as it was recorded."""
        return self._kept[obj].slots[name]

    def check(self) -> list[str]:
        """Restore broken slots when a connection is opened; return the lines that report these and other differences.

        The first call takes the snapshot, unless that was done.
        """
        if not self._kept:
            self.take_snapshot()
        changes = Changes()
        for kept in self._kept.values():
            obj = kept.obj
            if obj.slots != kept.slots or obj.protos != kept.protos:
                self._restore(kept, changes, thorough=False)
        if self._adoptions:
            changes.different.clear()  # They may be the robot's own, which are recorded when its code has run.
        self._finish(changes)
        self._log(changes)
        lines = []
        if changes.back:
            lines.append(f"put back in the library: {listed(changes.back)}")
        if changes.different:
            lines.append(f"changed in the library: {listed(changes.different)}; System.resetLibrary brings it back")
        return lines

    def reset(self, what: Value = None) -> list[str]:
        """Restore all objects, one object, or the slot with a name such as ``String.size``; return the names of the
        restored slots.

        Variables keep their values unless they are named.  Raises Primitive if there is no such object or slot in the
        record.
        """
        changes = Changes()
        if what is None:
            for kept in self._kept.values():
                self._restore(kept, changes, thorough=True)
        else:
            kept, slot = self._meant(what)
            if slot == "protos" and slot not in kept.slots:
                self._mend_protos(kept, changes, thorough=True)
            elif slot:
                self._put_back(kept, slot, changes)
            else:
                self._restore(kept, changes, thorough=True)
        self._finish(changes)
        return list(changes.back)

    def _meant(self, what: Value) -> tuple[RecordedObject, str]:
        if not isinstance(what, str):
            kept = self._kept.get(self._world.peek_obj(what))
            if kept is None:
                raise errors.primitive(f"{plain_type(self._world.peek_obj(what))} is no object of the library")
            return kept, ""
        if what in self._by_name:
            return self._by_name[what], ""
        holder, _, slot = what.rpartition(".")
        kept = self._by_name.get(holder or "Global")
        if kept is None or (slot not in kept.slots and slot != "protos"):
            raise errors.primitive(f"there is no {what} in the library")
        return kept, slot

    # ---------------------------------------------------------------- functions that hold the interpreter

    def is_replaced(self, codes: Collection[CodeType]) -> bool:
        """Whether one of these functions was put by a program in the place of a function of the library."""
        return next(self._replaced(codes), None) is not None

    def restore_held(self, codes: Collection[CodeType]) -> list[str]:
        """Restore the library functions in whose place a program has put one of these, which held the interpreter;
        return their names.  One that had to be restored ``MAX_HOLDS`` times is protected from then on.
        """
        changes = Changes()
        for kept, name in list(self._replaced(codes)):
            self._put_back(kept, name, changes)
            self._holds[f"{kept.name}.{name}"] += 1
            if self._holds[f"{kept.name}.{name}"] == MAX_HOLDS:
                self.protect(kept.obj, name)
        self._finish(changes)
        self._log(changes)
        return list(changes.back)

    def _replaced(self, codes: Collection[CodeType]) -> Iterator[tuple[RecordedObject, str]]:
        """The slots with one of these functions in the place of a recorded one.  No value is compared: that might run
        a function of a program."""
        for kept in self._kept.values():
            for name, now in kept.obj.slots.items():
                if isinstance(now, Code) and now is not kept.slots.get(name) \
                        and getattr(now.fn, "__code__", None) in codes \
                        and (name in kept.slots or name in self._functions and self._hides(kept.obj, name)):
                    yield kept, name

    # ---------------------------------------------------------------- printing

    @property
    def printing_changed(self) -> bool:
        """Whether a program has changed a slot that prints the values of the library."""
        return self._printing.value

    def restore_printing(self, may_stay: Callable[[Any], bool]) -> list[str]:
        """Restore the printing slots, except those whose new value (``ABSENT`` for a removed slot) ``may_stay``; return
        their names.  The changes are logged.
        """
        changes = Changes()
        for kept in self._printers:
            for name in PRINTING:
                now = kept.obj.slots.get(name, ABSENT)
                if now is not kept.slots.get(name, ABSENT) and not may_stay(now):
                    self._put_back(kept, name, changes)
        self._finish(changes)
        self._log(changes)
        return list(changes.back)

    def _watch_printing(self) -> ConditionWatch:
        """Compare the printing slots whenever one of them changes, and only then."""
        return ConditionWatch(self._world.recorder, self._prints_otherwise, lambda value: None, lambda error: None)

    def _prints_otherwise(self) -> bool:
        differs = False
        for kept in self._printers:
            for name in PRINTING:
                self._printing.depend(meta_of(kept.obj, name))
                differs |= kept.obj.slots.get(name, ABSENT) is not kept.slots.get(name, ABSENT)
        return differs

    # ---------------------------------------------------------------- putting back

    def _restore(self, kept: RecordedObject, changes: Changes, thorough: bool) -> None:
        """Compare one object with its record; ``thorough`` restores all slots."""
        self._mend_protos(kept, changes, thorough)
        slots = kept.obj.slots
        for name, value in kept.slots.items():
            now = slots.get(name, ABSENT)
            if now is not value:
                self._compare_slot(kept, name, value, now, changes, thorough)
        if kept.obj in self.open_ended:
            return
        for name in (slots.keys() - kept.slots.keys()) & self._functions:
            if not self._hides(kept.obj, name):
                continue
            if thorough:
                self._put_back(kept, name, changes)
            else:
                changes.different[f"{kept.name}.{name}"] = None

    def _compare_slot(
        self, kept: RecordedObject, name: str, value: Value, now: Value, changes: Changes, thorough: bool
    ) -> None:
        """Restore or report a slot whose value differs from the record."""
        if now is not ABSENT:
            if not (kept.is_class and name == "type") and self._is_variable(kept, name, value):
                return
            if not thorough and self._may_stand_for(now, value):
                changes.different[f"{kept.name}.{name}"] = None
                return
        self._put_back(kept, name, changes)

    def _is_variable(self, kept: RecordedObject, name: str, value: Value) -> bool:
        """Whether a slot has a plain value: the library and the robot change it themselves while they run."""
        if isinstance(value, Executable):
            return False
        if not self.is_shared(value):
            return True
        world = self._world
        # A class of the library has constants; one of the robot, a behaviour for instance, has its state.
        plain = any(value is constant for constant in (world.nil, world.true, world.false))
        return plain and (kept.is_robots or not kept.is_class)

    def _may_stand_for(self, now: Value, value: Value) -> bool:
        """Whether the new value is a plausible redefinition of a function or an object of the library."""
        if isinstance(value, Executable):
            return isinstance(now, Executable)
        if not self.is_shared(value):
            return now.__class__ is value.__class__
        if "type" in value.slots and not (isinstance(now, Obj) and "type" in now.slots):
            return False  # only a class replaces a class: 3 is no Float
        kin = value if "type" in value.slots or not value.protos else value.protos[0]
        return kin is not self._world.object and self._world.is_a(now, kin)

    def _put_back(self, kept: RecordedObject, name: str, changes: Changes) -> None:
        obj = kept.obj
        if obj.slots.get(name, ABSENT) is kept.slots.get(name, ABSENT):
            return
        if name in kept.slots:
            obj.slots[name] = kept.slots[name]
        else:
            del obj.slots[name]
        recorded = kept.meta.get(name)
        if recorded is not None:
            obj.meta = {} if obj.meta is None else obj.meta
            obj.meta[name] = recorded
        elif obj.meta is not None and name in obj.meta:  # the conditions that watch the slot go on watching it
            obj.meta[name].accessor = None
            obj.meta[name].constant = False
        changes.back[f"{kept.name}.{name}"] = None

    def _mend_protos(self, kept: RecordedObject, changes: Changes, thorough: bool) -> None:
        obj = kept.obj
        if len(obj.protos) == len(kept.protos) and all(map(_same, obj.protos, kept.protos)):
            return
        added = [proto for proto in obj.protos if not _among(proto, kept.protos)]
        exact = thorough and kept.is_class
        if exact or not all(_among(proto, obj.protos) for proto in kept.protos):
            obj.protos = list(kept.protos) if exact else [*added, *kept.protos]
            changes.back[f"{kept.name}.protos"] = None
        elif added and kept.is_class:
            changes.different[f"{kept.name}.protos"] = None

    def _hides(self, obj: Obj, name: str) -> bool:
        """Whether an added slot hides a function that was inherited."""
        for above in lineage(self._world, obj)[1:]:
            kept = self._kept.get(above)
            if kept is not None and name in kept.slots:
                return isinstance(kept.slots[name], Executable)
        return False

    def _finish(self, changes: Changes) -> None:
        if not changes.back:
            return
        world = self._world
        world.flush()
        self._printing.touched()
        if not any(map(self._operators_differ, (world.float_proto, world.string_proto, world.list_proto))):
            world.generic_floats, world.quick_strings, world.quick_lists = self._quick

    def _operators_differ(self, proto: Obj) -> bool:
        kept = self._kept[proto]
        return any(proto.slots.get(name) is not kept.slots.get(name) for name in OPERATORS)

    def _log(self, changes: Changes) -> None:
        """Log changes, each once."""
        for names, what in ((changes.back, "put back what a program spoilt"), (changes.different, "a program changed")):
            fresh = [name for name in names if (name, what) not in self._logged]
            if fresh:
                self._logged.update((name, what) for name in fresh)
                log.warning("library: %s: %s", what, listed(fresh))


def lineage(world: World, value: Value) -> list[Any]:
    """An object, its prototypes, theirs, and so on, each once, in the order in which slots are looked up."""
    found: list[Any] = []
    seen: set[int] = set()
    todo = [value]
    while todo:
        ancestor = todo.pop()
        if id(ancestor) not in seen:
            seen.add(id(ancestor))
            found.append(ancestor)
            todo += (world.protos_of(ancestor) if ancestor.__class__ is float else ancestor.protos)[::-1]
    return found


def _is_class(name: str, slots: dict[str, Any]) -> bool:
    """Whether an object is a class: its slot ``type`` has its own name.  That of the robot says what kind it is."""
    kind = slots.get("type")
    return isinstance(kind, String) and kind.s == name.rpartition(".")[2]


def _would_hide(world: World, obj: Obj, owed: ProtectedSlot) -> bool:
    """Whether a slot of ``obj`` would hide the protected slot."""
    for ancestor in lineage(world, owed.anchor):
        if ancestor is owed.holder:
            return False
        if ancestor is obj:
            return True
    return False


def _shared(world: World, roots: list[tuple[str, Any]], known: Iterable[Obj]) -> Iterator[tuple[str, Obj]]:
    """The shared objects by name: all objects that can be reached from the roots, nearest first, without the known
    ones.
    """
    seen: set[int] = set(map(id, known))
    todo = list(roots)
    for path, obj in todo:
        if not isinstance(obj, Obj) or isinstance(obj, Executable) or obj.is_per_connection or id(obj) in seen:
            continue
        seen.add(id(obj))
        if obj.slots or not isinstance(obj, String | List | Tuple | Dictionary):
            yield path, obj
        prefix = "" if obj is world.global_ else f"{path}."
        todo += [(prefix + name, value) for name, value in obj.slots.items()]
        todo += [(plain_type(proto), proto) for proto in obj.protos if isinstance(proto, Obj)]


def _same(a: Value, b: Value) -> bool:
    return a is b


def _among(value: Value, values: Iterable[Value]) -> bool:
    return any(value is other for other in values)


def listed(names: Iterable[str]) -> str:
    """Some of the names, in one line."""
    shown: Sequence[str] = list(names)
    more = f" and {len(shown) - MAX_NAMED} more" if len(shown) > MAX_NAMED else ""
    return ", ".join(shown[:MAX_NAMED]) + more
