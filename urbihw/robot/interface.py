"""Interface: the slots that kinds of devices must have (manual, chapter 22, "Interface").

A kind is an object such as ``Interface.RotationalMotor``; a device implements it by having it as a prototype.  The
slots of a kind are *promises*, each an accessor.  Since ``addProto`` puts a kind in front of the device's own class, a
promise yields to any other slot of that name in the device or its other prototypes.  If there is none, the promise
returns:

- the result of its rule in urbiscript (``rule``: a pair of functions to read and to write);
- the slot that it points to, or that points to it (``val`` and ``angle`` are the same), if the device has that slot;
- for a read of an optional slot, its default value in the manual, or nil;
- otherwise an error with the names of the slot and the kind.

The kinds themselves are declared in ``interface.u``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel.library import (
    Dictionary,
    Executable,
    List,
    Obj,
    Plain,
    Table,
    Value,
    World,
    describers_of,
    errors,
    meta_of,
    peek_meta,
    prototype,
)
from urbihw.kernel.library import (
    as_string as object_text,
)
from urbihw.robot.interface_notes import NOTES as NOTES

TABLE = Table("Interface")
MAKER = Table("Interface.Promises")
TABLES = [TABLE, MAKER]


class Promise(Executable):
    """A slot that devices of a kind must or may have."""

    __slots__ = ("basis", "default", "getter", "kind", "name", "needed", "other", "setter")

    def __init__(self, world: World, kind: str, name: str, *, needed: bool, default: Value) -> None:
        super().__init__(world, [world.primitive_proto])
        self.kind = kind
        self.name = name
        self.needed = needed
        self.default = default
        self.other = ""
        self.basis = ""
        self.getter: Any = None
        self.setter: Any = None

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Called when the slot is read, or called with arguments."""
        holder = provider(self.world, this, self.name)
        if holder is not None:
            return self._call_slot(holder, self.name, this, args)
        if self.getter is not None and self._has_basis(this):
            return self.world.invoke(self.getter, this, args, self.name)
        holder = provider(self.world, this, self.other) if self.other else None
        if holder is not None:
            return self._call_slot(holder, self.other, this, args)
        if self.needed or self.getter is not None or args:
            raise self._missing_slot_error()
        return self.default

    def read(self, target: Value) -> Value:
        """Called when the slot is read."""
        return self.call(target, ())

    def write(self, target: Value, value: Value) -> Value:
        """Called when the slot is assigned."""
        name = self.name
        holder = provider(self.world, target, name)
        if holder is None and self.setter is not None and self._has_basis(target):
            self.world.invoke(self.setter, target, (value,), name)
            return value
        if holder is None and self.other:
            name = self.other
            holder = provider(self.world, target, name)
        if holder is None:
            if self.getter is not None and self._has_basis(target):
                raise errors.primitive("this slot can only be read", name)
            raise self._missing_slot_error()
        meta = peek_meta(holder, name)
        if holder is target or (meta is not None and (meta.accessor is not None or meta.constant)):
            return self._write(holder, name, target, value)
        self.world.ops.put_slot(self.world.as_obj(target), name, value)
        return value

    def is_provided(self, target: Value) -> bool:
        """Whether a device has the slot."""
        world = self.world
        if provider(world, target, self.name) is not None:
            return True
        if self.getter is not None:
            return self._has_basis(target)
        return bool(self.other) and provider(world, target, self.other) is not None

    def _has_basis(self, target: Value) -> bool:
        """Whether a device has the slot that the rule uses."""
        holder = self.world.peek_obj(target).find(self.basis)
        basis = None if holder is None else holder.slots[self.basis]
        return basis.is_provided(target) if isinstance(basis, Promise) else holder is not None

    def _call_slot(self, holder: Obj, name: str, this: Value, args: tuple[Value, ...]) -> Value:
        return self.world.invoke(self.world.ops.get_slot(holder, name), this, args, name)

    def _write(self, holder: Obj, name: str, target: Value, value: Value) -> Value:
        meta = peek_meta(holder, name)
        if meta is not None and meta.constant:
            raise errors.constness()
        if meta is not None and meta.accessor is not None:
            return meta.accessor.write(target, value)
        return self.world.update_slot(holder, name, value)

    def _missing_slot_error(self) -> errors.Raised:
        if self.needed:
            return errors.primitive(f"this {self.kind} does not provide the slot", self.name)
        return errors.primitive(f"this {self.kind} does not have the optional slot", self.name)


def provider(world: World, target: Value, name: str, beside: tuple[Obj, ...] = ()) -> Obj | None:
    """The object among a device and its ancestors, but those of ``beside``, that has a slot of this name which is no
    promise; None if there is none.
    """
    seen = {id(one) for one in beside}

    def search(obj: Obj) -> Obj | None:
        if id(obj) in seen:
            return None
        seen.add(id(obj))
        if name in obj.slots and not isinstance(obj.slots[name], Promise):
            return obj
        for proto in obj.protos:
            if isinstance(proto, Obj):
                found = search(proto)
                if found is not None:
                    return found
        return None

    return search(world.peek_obj(target))


class KindObject(Obj):
    """A kind of device; objects that derive from it are ordinary objects."""

    __slots__ = ("name",)
    describes_heirs = True

    def __init__(self, world: World, parent: Obj, name: str) -> None:
        super().__init__(world, [parent])
        self.name = name
        self.slots["type"] = world.string(name)
        self.slots["as" + name] = world.object.slots["acceptVoid"]

    def clone(self) -> Obj:
        """Make a device of this kind."""
        return Plain(self.world, [self])

    def promised(self, name: str) -> Promise:
        """The promise of a slot that this kind itself declares."""
        slot = self.slots.get(name)
        if not isinstance(slot, Promise):
            raise errors.primitive(f"{self.name} itself promises no slot {name}")
        return slot

    def promise(self, promise: Promise, unit: Any) -> None:
        """Declare a slot that devices of the kind promise."""
        self.world.ops.put_slot(self, promise.name, promise)
        meta = meta_of(self, promise.name)
        meta.accessor = promise
        meta.properties = {"unit": unit}


def kinds_of(world: World, target: Value) -> list[KindObject]:
    """The kinds of a device, the nearest first; each kind before its own prototypes."""
    return [one for one in describers_of(world.peek_obj(target)) if isinstance(one, KindObject)]


@MAKER.primitive("kind")
def kind(world: World, this: Value, parent: Obj, name: str, needs: Dictionary, offers: Any = None) -> Value:
    """Make a kind of device that derives from ``parent``, as a slot of Interface.

    ``needs`` are the required slots of each such device, name => unit; ``offers`` are the optional slots, name =>
    [unit, default].  The unit is a property of the slot: ``Interface.Battery.voltage->unit``.
    """
    made = KindObject(world, parent, name)
    for slot, unit in needs.d.items():
        made.promise(Promise(world, name, slot, needed=True, default=None), unit)
    for slot, row in offers.d.items() if isinstance(offers, Dictionary) else ():
        if not (isinstance(row, List) and len(row.l) == 2):
            raise errors.primitive(f"{name}: {slot} => [unit, default] expected")
        unit, default = row.l
        made.promise(Promise(world, name, slot, needed=False, default=default), unit)
    world.ops.put_slot(prototype(world, "Interface"), name, made)
    return made


@MAKER.primitive("points")
def points(world: World, this: Value, kind: KindObject, specific: str) -> None:
    """Declare that ``val`` points to another slot of a kind: a device with one of them has both."""
    pointed = kind.promised(specific)
    unit = meta_of(kind, specific).properties or {}
    pointer = Promise(world, kind.name, "val", needed=True, default=None)
    kind.promise(pointer, unit["unit"])
    pointer.other, pointed.other = specific, "val"


@MAKER.primitive("rule")
def rule(world: World, this: Value, kind: KindObject, name: str, basis: str, getter: Any, setter: Any = None) -> None:
    """Define functions that read and write a promised slot of a kind, for devices that have ``basis`` instead of the
    slot.
    """
    promise = kind.promised(name)
    promise.basis, promise.getter, promise.setter = basis, getter, setter


@MAKER.primitive("missing")
def missing(world: World, this: Value, device: Any) -> Value:
    """The names of the required slots that a device does not have, in alphabetical order."""
    return _names(world, device, lambda promise: promise.needed and not promise.is_provided(device))


@MAKER.primitive("needs")
def needs(world: World, this: Value, device: Any) -> Value:
    """The names of the required slots of a kind, or of the kinds of a device, in alphabetical order."""
    return _names(world, device, lambda promise: promise.needed)


@MAKER.primitive("offers")
def offers(world: World, this: Value, device: Any) -> Value:
    """The names of the optional slots of a kind, or of the kinds of a device, in alphabetical order."""
    return _names(world, device, lambda promise: not promise.needed)


@TABLE.primitive("load")
def load(world: World, this: Value, *args: Value) -> Value:
    """``load`` of the device itself, for motors their power; ``load`` of Object would look for a file."""
    holder = provider(world, this, "load", (prototype(world, "Interface"), world.object, world.global_))
    if holder is None:
        raise errors.lookup_failed("load")
    return world.invoke(world.ops.get_slot(holder, "load"), this, args, "load")


@TABLE.primitive("asString")
def as_string(world: World, this: Value) -> str:
    """The name of the first slot of Global that holds a device, such as ``motor6``; without one as other objects."""
    return world.global_name(this) or object_text(world, this)


def _names(world: World, device: Any, wanted: Callable[[Promise], bool]) -> Any:
    """The promises of a device, those of nearer kinds first."""
    seen: dict[str, Promise] = {}
    for obj in kinds_of(world, device):
        for name, slot in obj.slots.items():
            if isinstance(slot, Promise):
                seen.setdefault(name, slot)
    return world.new_list([world.string(name) for name, slot in sorted(seen.items()) if wanted(slot)])


@TABLE.primitive("interfaces")
def interfaces(world: World, this: Value, *device: Any) -> Value:
    """The kinds that a device implements, the nearest first: ``device.interfaces`` or ``Interface.interfaces(device)``.
    ``Interface.interfaces`` without argument returns all kinds."""
    if len(device) > 1:
        raise errors.arity(len(device), 0, 1)
    if not device and this is prototype(world, "Interface"):
        return world.new_list([slot for _, slot in sorted(this.slots.items()) if isinstance(slot, KindObject)])
    return world.new_list(list(kinds_of(world, device[0] if device else this)))
