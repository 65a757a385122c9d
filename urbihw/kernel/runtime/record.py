"""What the library was when start-up was complete, and the way back to it.

All connections share the prototypes of the library and the robot's objects, and a program may change them.  Two things
stand against one program spoiling them for everybody:

- Some slots are *owed* to everybody: System and how to end the server, the robot and its stop.  No program can remove,
  replace or hide them; ``SlotOps.put``, ``SlotOps.remove_slot`` and ``Obj.set_protos`` ask here, and only for the few
  names that are owed.
- Of all shared objects their prototypes and slots are *recorded*, and what the robot's own code changes later too.
  When a connection is opened, what was removed or replaced by something that cannot be meant is put back; other
  definitions that a program gave are told of.  ``reset`` puts those back too.  Slots that were added are told of only
  where they hide a function of the library, and a slot that holds a mere value is a variable: its value is not
  compared.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import plain_type
from urbihw.kernel.runtime.slot import SlotMeta, meta_of
from urbihw.kernel.runtime.slots import OPERATORS
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.runtime.watch import Watch

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")

ABSENT: Final[Any] = object()
"""Stands for a slot that is not there."""
PRINTING: Final = ("asToplevelPrintable", "asPrintable", "asString")
"""The slots by which the top level prints the values of everybody."""
NAMED: Final = 6
"""How many changes one line names."""


class Owed(NamedTuple):
    """A slot that everybody finds from ``anchor`` in ``holder``."""

    anchor: Obj
    holder: Obj


class Kept(NamedTuple):
    """One shared object as it was: ``is_class`` if it is a prototype and no single thing."""

    name: str
    obj: Obj
    protos: list[Any]
    slots: dict[str, Any]
    meta: dict[str, SlotMeta]
    is_class: bool


class Changes:
    """What a comparison with the record brought to light: what was put back, and what is different and stays."""

    def __init__(self) -> None:
        self.back: dict[str, None] = {}
        self.different: dict[str, None] = {}


class Record:
    """The record of one world.  ``owed`` has the slots that no program can touch, by their names."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.owed: dict[str, list[Owed]] = {}
        self.open_ended: list[Obj] = []
        """Objects whose slots come and go as programs and devices do: only their functions are recorded."""
        self._kept: dict[Obj, Kept] = {}
        self._by_name: dict[str, Kept] = {}
        self._functions: set[str] = set()
        self._quick: tuple[Any, ...] = ()
        self._logged: set[tuple[str, str]] = set()
        self._printers: list[Kept] = []
        self._printing = self._watch_printing()

    # ---------------------------------------------------------------- what is owed

    def owe(self, anchor: Obj, *names: str) -> None:
        """No program can take these slots from an object any more; they are what they should be by now."""
        for name in names:
            holder = anchor.find(name)
            if holder is None:
                continue
            self.owed.setdefault(name, []).append(Owed(anchor, holder))
            meta = meta_of(holder, name)
            if meta.accessor is None:
                meta.constant = True

    def is_shared(self, obj: Any) -> bool:
        """Whether an object belongs to the library or the robot."""
        return isinstance(obj, Obj) and obj in self._kept

    def has(self, obj: Obj, name: str) -> bool:
        """Whether a slot of a shared object is recorded."""
        kept = self._kept.get(obj)
        return kept is not None and name in kept.slots

    def guard(self, obj: Obj, name: str) -> None:
        """A slot of this name, which is owed, is to be made or replaced; raises if that is not for programs."""
        for owed in self.owed[name]:
            if owed.holder is obj or _comes_first(self._world, obj, owed):
                raise errors.owed(name)

    def guard_removal(self, obj: Obj, name: str) -> None:
        """A slot of this name, which is owed, is to be removed; raises if that is not for programs."""
        if any(owed.holder is obj for owed in self.owed[name]):
            raise errors.owed(name)

    def lost(self) -> str:
        """The name of an owed slot that is not found where it was, "" if all are: to be asked when prototypes have
        changed."""
        for name, all_owed in self.owed.items():
            for owed in all_owed:
                if owed.anchor.find(name) is not owed.holder:
                    return name
        return ""

    # ---------------------------------------------------------------- the record

    def take(self) -> None:
        """Record the library as it is now."""
        world = self._world
        self._kept.clear()
        self._by_name.clear()
        self._keep([("Global", world.global_)])
        self._quick = (world.generic_floats, world.quick_strings, world.quick_lists)

    def _keep(self, roots: list[tuple[str, Any]]) -> None:
        """Record what can be reached from these objects and is not yet recorded."""
        for name, obj in _shared(self._world, roots, self._kept):
            some = obj in self.open_ended
            slots = {slot: value for slot, value in obj.slots.items() if not some or isinstance(value, Executable)}
            meta = {slot: each for slot, each in (obj.meta or {}).items() if each.accessor or each.constant}
            kept = self._kept[obj] = Kept(name, obj, list(obj.protos), slots, meta, "type" in slots)
            self._by_name.setdefault(name, kept)
            self._functions.update(slot for slot, value in slots.items() if isinstance(value, Executable))
        self._printers = [kept for kept in self._kept.values() if kept.is_class and kept.obj not in self.open_ended]
        self._printing.stop()
        self._printing = self._watch_printing()
        self._printing.begin()

    def adopt(self, run: Callable[[], Any]) -> None:
        """Run code of the robot itself: what it changes in shared objects is what they should be from then on.

        Before the record was taken that is so of everything.  Raises what ``run`` raises.
        """
        before = {obj: (dict(obj.slots), list(obj.protos)) for obj in self._kept}
        try:
            run()
        finally:
            changed = [
                root for obj, (slots, protos) in before.items() if obj.slots != slots or obj.protos != protos
                for root in self._adopted(obj, slots, protos)
            ]  # fmt: skip
            if changed:
                self._keep(changed)

    def _adopted(self, obj: Obj, slots: dict[str, Any], protos: list[Any]) -> Iterator[tuple[str, Any]]:
        """Record what has changed in an object; the new values with their names."""
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
        """A connection is opened: put back what is spoilt; the lines that tell of that, and of what is different.

        The first call takes the record, unless that was done.
        """
        if not self._kept:
            self.take()
        changes = Changes()
        for kept in self._kept.values():
            obj = kept.obj
            if obj.slots != kept.slots or obj.protos != kept.protos:
                self._mend(kept, changes, thorough=False)
        self._finish(changes)
        self._log(changes)
        lines = []
        if changes.back:
            lines.append(f"put back in the library: {listed(changes.back)}")
        if changes.different:
            lines.append(f"changed in the library: {listed(changes.different)}; System.resetLibrary brings it back")
        return lines

    def reset(self, what: Any = None) -> list[str]:
        """Bring back all of the record, or one object of it, or what a name such as ``String.size`` means; the names of
        what was put back.

        Variables are left as they are unless named.  Raises Primitive if there is no such thing in the record.
        """
        changes = Changes()
        if what is None:
            for kept in self._kept.values():
                self._mend(kept, changes, thorough=True)
        else:
            kept, slot = self._meant(what)
            if slot == "protos" and slot not in kept.slots:
                self._mend_protos(kept, changes, thorough=True)
            elif slot:
                self._put_back(kept, slot, changes)
            else:
                self._mend(kept, changes, thorough=True)
        self._finish(changes)
        return list(changes.back)

    def _meant(self, what: Any) -> tuple[Kept, str]:
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

    # ---------------------------------------------------------------- printing

    @property
    def reprinted(self) -> bool:
        """Whether a program has changed how the values of the library are printed."""
        return self._printing.value

    def mend_printing(self, may_stay: Callable[[Any], bool]) -> list[str]:
        """Put the slots that print back unless ``may_stay`` says so of what a program put there (``ABSENT`` if it
        removed the slot); their names.  It is logged."""
        changes = Changes()
        for kept in self._printers:
            for name in PRINTING:
                now = kept.obj.slots.get(name, ABSENT)
                if now is not kept.slots.get(name, ABSENT) and not may_stay(now):
                    self._put_back(kept, name, changes)
        self._finish(changes)
        self._log(changes)
        return list(changes.back)

    def _watch_printing(self) -> Watch:
        """Look at the slots that print whenever one of them changes, and never else."""
        return Watch(self._world.recorder, self._prints_otherwise, lambda value: None, lambda error: None)

    def _prints_otherwise(self) -> bool:
        differs = False
        for kept in self._printers:
            for name in PRINTING:
                self._printing.depend(meta_of(kept.obj, name))
                differs |= kept.obj.slots.get(name, ABSENT) is not kept.slots.get(name, ABSENT)
        return differs

    # ---------------------------------------------------------------- putting back

    def _mend(self, kept: Kept, changes: Changes, thorough: bool) -> None:
        """Compare one object with its record; ``thorough`` puts everything back."""
        self._mend_protos(kept, changes, thorough)
        slots = kept.obj.slots
        for name, value in kept.slots.items():
            now = slots.get(name, ABSENT)
            if now is not value:
                self._judge(kept, name, value, now, changes, thorough)
        if kept.obj in self.open_ended:
            return
        for name in (slots.keys() - kept.slots.keys()) & self._functions:
            if not self._hides(kept.obj, name):
                continue
            if thorough:
                self._put_back(kept, name, changes)
            else:
                changes.different[f"{kept.name}.{name}"] = None

    def _judge(self, kept: Kept, name: str, value: Any, now: Any, changes: Changes, thorough: bool) -> None:
        """A slot has another value than the recorded one."""
        if now is not ABSENT:
            if not isinstance(value, Executable) and not self.is_shared(value) and name != "type":
                return  # a variable
            if not thorough and self._may_stand_for(now, value):
                changes.different[f"{kept.name}.{name}"] = None
                return
        self._put_back(kept, name, changes)

    def _may_stand_for(self, now: Any, value: Any) -> bool:
        """Whether somebody may have meant to define a function or an object of the library anew."""
        if isinstance(value, Executable):
            return isinstance(now, Executable)
        if not self.is_shared(value):
            return now.__class__ is value.__class__
        if "type" in value.slots and not (isinstance(now, Obj) and "type" in now.slots):
            return False  # a class is stood for by a class: 3 is no Float
        kin = value if "type" in value.slots or not value.protos else value.protos[0]
        return kin is not self._world.object and self._world.is_a(now, kin)

    def _put_back(self, kept: Kept, name: str, changes: Changes) -> None:
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
        elif obj.meta is not None and name in obj.meta:  # who watches the slot goes on watching it
            obj.meta[name].accessor = None
            obj.meta[name].constant = False
        changes.back[f"{kept.name}.{name}"] = None

    def _mend_protos(self, kept: Kept, changes: Changes, thorough: bool) -> None:
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
        """Say changes in the log, each once."""
        for names, what in ((changes.back, "put back what a program spoilt"), (changes.different, "a program changed")):
            fresh = [name for name in names if (name, what) not in self._logged]
            if fresh:
                self._logged.update((name, what) for name in fresh)
                log.warning("library: %s: %s", what, listed(fresh))


def lineage(world: World, value: Any) -> list[Any]:
    """An object, its prototypes, theirs, and so on, each once, in the order in which slots are looked up."""
    found: list[Any] = []
    seen: set[int] = set()
    todo = [value]
    while todo:
        ancestor = todo.pop()
        if id(ancestor) not in seen:
            seen.add(id(ancestor))
            found.append(ancestor)
            todo.extend(reversed(world.protos_of(ancestor)))
    return found


def _comes_first(world: World, obj: Obj, owed: Owed) -> bool:
    """Whether a slot of ``obj`` would hide the owed one."""
    for ancestor in lineage(world, owed.anchor):
        if ancestor is owed.holder:
            return False
        if ancestor is obj:
            return True
    return False


def _shared(world: World, roots: list[tuple[str, Any]], known: Iterable[Obj]) -> Iterator[tuple[str, Obj]]:
    """What all connections share, by name: all that can be reached from the roots, nearest first, but what is known."""
    seen: set[int] = set(map(id, known))
    todo = list(roots)
    for path, obj in todo:
        if not isinstance(obj, Obj) or isinstance(obj, Executable) or obj.of_connection or id(obj) in seen:
            continue
        seen.add(id(obj))
        if obj.slots or not isinstance(obj, String | List | Tuple | Dictionary):
            yield path, obj
        prefix = "" if obj is world.global_ else f"{path}."
        todo += [(prefix + name, value) for name, value in obj.slots.items()]
        todo += [(plain_type(proto), proto) for proto in obj.protos if isinstance(proto, Obj)]


def _same(a: Any, b: Any) -> bool:
    return a is b


def _among(value: Any, values: Iterable[Any]) -> bool:
    return any(value is other for other in values)


def listed(names: Iterable[str]) -> str:
    """Some of the names, in one line."""
    shown: Sequence[str] = list(names)
    more = f" and {len(shown) - NAMED} more" if len(shown) > NAMED else ""
    return ", ".join(shown[:NAMED]) + more
