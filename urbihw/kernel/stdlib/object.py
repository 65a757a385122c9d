"""Object: slots, prototypes, identity, conversions.  ``properties`` has the properties of slots, ``describe`` the
descriptions.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import CheckedPrimitive, Forms, Table
from urbihw.kernel.runtime.record import lineage
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.values import CallMessage, FloatObject, List, ProtoList
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import Field, native
from urbihw.kernel.value import Value

TABLE = Table("Object")
PROTOS = {"Object": ("Orderable", "Global")}

NOTES = {
    "Object": "The ancestor of all objects: slots, prototypes, identity, conversions.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


# ---------------------------------------------------------------- making objects


@TABLE.primitive("clone")
def clone(world: World, this: Value) -> Value:
    """A new object whose only prototype is this one."""
    return FloatObject(world, [this], this) if this.__class__ is float else this.clone()


@TABLE.raw("new", least=0, most=-1)
def new(world: World) -> Any:
    """Clone this object and call ``init`` of the clone with the arguments."""
    method, invoke = world.ops.method, world.invoke

    def made_of(this: Value) -> Any:
        found: Any = method(this, "clone")
        if found.__class__ is CheckedPrimitive and found.source is clone:
            return this.clone() if this.__class__ is not float else clone(world, this)
        return invoke(found, this, (), "clone")

    def run(this: Value, *args: Value) -> Value:
        made = made_of(this)
        if made is not this:
            world.send(made, "init", *args)
        return made

    def run0(this: Value) -> Value:
        made = made_of(this)
        if made is not this:
            world.ops.send0(made, "init")
        return made

    def run1(this: Value, argument: Value) -> Value:
        made = made_of(this)
        if made is not this:
            world.send1(made, "init", argument)
        return made

    return Forms(run, run0, run1)


@TABLE.primitive("init")
def init(world: World, this: Value) -> None:
    """No operation: the constructor called by ``new`` unless a prototype defines its own."""


# ---------------------------------------------------------------- slots


@TABLE.primitive("getSlot")
def get_slot(world: World, this: Value, name: str) -> Value:
    """The value of a local or inherited slot, without calling it.  Raises ``lookup failed``."""
    return world.get_slot(this, name)


@TABLE.primitive("getLocalSlot")
def get_local_slot(world: World, this: Value, name: str) -> Value:
    """The value of a slot of this object itself.  Raises ``lookup failed``."""
    slots = world.peek_obj(this).slots if _has_own_slots(world, this) else {}
    if name not in slots:
        raise errors.lookup_failed(name)
    return slots[name]


@TABLE.primitive("setSlot")
def set_slot(world: World, this: Value, name: str, value: Value) -> Value:
    """Create a slot.  Raises ``slot redefinition`` if this object already has it."""
    return world.set_slot(this, name, value)


@TABLE.primitive("setConstSlot")
def set_const_slot(world: World, this: Value, name: str, value: Value) -> Value:
    """Create a slot that cannot be assigned."""
    world.set_slot(this, name, value)
    meta_of(world.as_obj(this), name).constant = True
    return value


@TABLE.primitive("updateSlot")
def update_slot(world: World, this: Value, name: str, value: Value) -> Value:
    """Assign an existing slot; an inherited slot is copied first.  Raises ``lookup failed``."""
    if value is world.void:
        raise errors.unexpected_void()
    return world.ops.update_plainly(world.as_obj(this), this, name, value)


@TABLE.primitive("createSlot")
def create_slot(world: World, this: Value, name: str) -> None:
    """Create a slot without a value.  Raises ``slot redefinition``."""
    world.set_slot(this, name, world.void)


@TABLE.primitive("removeSlot", "removeLocalSlot")
def remove_slot(world: World, this: Value, name: str) -> Value:
    """Remove a slot of this object, if it exists; returns this object."""
    if _has_own_slots(world, this):
        world.ops.remove_slot(this, name)
    return this


@TABLE.primitive("copySlot")
def copy_slot(world: World, this: Value, source: str, name: str) -> None:
    """Create a slot with the same value as another slot."""
    world.set_slot(this, name, _source(world, this, source, "copySlot"))


@TABLE.primitive("cloneSlot")
def clone_slot(world: World, this: Value, source: str, name: str) -> None:
    """Create a slot with a clone of the value of another slot."""
    world.set_slot(this, name, world.send(_source(world, this, source, "cloneSlot"), "clone"))


def _source(world: World, this: Value, name: str, routine: str) -> Value:
    if world.peek_obj(this).find(name) is None:
        raise errors.Raised("Lookup", f"lookup failed: {name}", routine, name=name)
    return world.get_slot(this, name)


@TABLE.primitive("hasSlot")
def has_slot(world: World, this: Value, name: str) -> bool:
    """Whether this object has the slot, local or inherited."""
    world.recorder.read(this, name)
    return world.peek_obj(this).find(name) is not None


@TABLE.primitive("hasLocalSlot")
def has_local_slot(world: World, this: Value, name: str) -> bool:
    """Whether this object itself has the slot."""
    world.recorder.read(this, name)
    return _has_own_slots(world, this) and name in world.peek_obj(this).slots


@TABLE.primitive("locateSlot")
def locate_slot(world: World, this: Value, name: str) -> Value:
    """The object in which the slot is found, nil if there is none."""
    holder = world.peek_obj(this).find(name)
    if holder is None:
        return world.nil
    return this if holder is world.peek_obj(this) and _has_own_slots(world, this) else holder


@TABLE.primitive("localSlotNames")
def local_slot_names(world: World, this: Value) -> Value:
    """The names of this object's local slots, in alphabetical order."""
    names = sorted(world.peek_obj(this).slots) if _has_own_slots(world, this) else []
    return world.new_list([world.string(name) for name in names])


@TABLE.primitive("slotNames", "allSlotNames")
def slot_names(world: World, this: Value) -> Value:
    """The names of all slots, including inherited ones, in alphabetical order."""
    names = {name for value in lineage(world, this) for name in world.peek_obj(value).slots}
    return world.new_list([world.string(name) for name in sorted(names)])


def _has_own_slots(world: World, this: Value) -> bool:
    return this.__class__ is not float or id(this) in world.float_slots


# ---------------------------------------------------------------- prototypes


@TABLE.primitive("protos")
def protos(world: World, this: Value) -> Value:
    """The list of prototypes; modify or assign it to change the prototypes."""
    return ProtoList(world, world.list_protos, this)


@TABLE.primitive("setProtos")
def set_protos(world: World, this: Value, wanted: list) -> None:  # type: ignore[type-arg]
    """Replace the prototypes by the members of a list."""
    world.as_obj(this).set_protos(list(wanted))


@TABLE.primitive("addProto")
def add_proto(world: World, this: Value, proto: Value) -> Value:
    """Add a prototype before the others, unless it is already one; returns this object."""
    obj = world.as_obj(this)
    if not any(known is proto for known in obj.protos):
        obj.set_protos([proto, *obj.protos])
    return this


@TABLE.primitive("removeProto")
def remove_proto(world: World, this: Value, proto: Value) -> Value:
    """Remove a prototype, if it is one; returns this object."""
    obj = world.as_obj(this)
    obj.set_protos([known for known in obj.protos if known is not proto])
    return this


@TABLE.primitive("allProtos")
def all_protos(world: World, this: Value) -> Value:
    """This object and all its ancestors, each once, in the order of lookup."""
    return world.new_list(lineage(world, this))


@TABLE.primitive("isA")
def is_a(world: World, this: Value, proto: Value) -> bool:
    """Whether the argument is this object or one of its ancestors."""
    return world.is_a(this, proto)


@TABLE.primitive("isProto")
def is_proto(world: World, this: Value) -> bool:
    """Whether this object is a prototype, i.e. has a ``type`` slot of its own."""
    return _has_own_slots(world, this) and "type" in world.peek_obj(this).slots


# ---------------------------------------------------------------- what it is


@TABLE.primitive("isNil")
def is_nil(world: World, this: Value) -> bool:
    """Whether this value is nil."""
    return this is world.nil


@TABLE.primitive("isVoid")
def is_void(world: World, this: Value) -> bool:
    """Whether this value is void; always false for an Object."""
    return False


@TABLE.primitive("uid", "$id")
def uid(world: World, this: Value) -> str:
    """A string that identifies this object uniquely."""
    return world.uid(this)


@TABLE.primitive("===")
def same(world: World, this: Value, that: Value) -> bool:
    """Whether both are the same object."""
    return this is that


@TABLE.primitive("!==")
def not_same(world: World, this: Value, that: Value) -> bool:
    """Whether both are different objects."""
    return this is not that


@TABLE.primitive("==")
def equal(world: World, this: Value, that: Value) -> bool:
    """Whether both are the same object, unless redefined."""
    return this is that


@TABLE.primitive("!=")
def unequal(world: World, this: Value, that: Value) -> bool:
    """The negation of ``==``."""
    return not world.send(this, "==", that)


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asBool")
def as_bool(world: World, this: Value) -> bool:
    """Whether this value counts as true: any value but false, nil, 0 and empty containers.  Conditions call it if a
    program redefines it."""
    return this.default_truth() if isinstance(this, Obj) else bool(this)


@TABLE.primitive("as")
def as_(world: World, this: Value, kind: Any) -> Value:
    """The result of ``this.asType``, where Type is the type of the argument."""
    return world.send(this, "as" + world.type_name(kind))


@TABLE.primitive("asString")
def as_string(world: World, this: Value) -> str:
    """The type name of a prototype; ``Type_0x...`` for other objects."""
    name = world.type_name(this)
    return name if is_proto(world, this) else f"{name}_{world.uid(this)}"


@TABLE.primitive("asObject")
def as_object(world: World, this: Value) -> Value:
    """This value: everything is an Object."""
    return this


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: Value) -> Value:
    """``asString``, unless redefined."""
    return world.send(this, "asString")


@TABLE.primitive("asToplevelPrintable")
def as_toplevel_printable(world: World, this: Value) -> Value:
    """The text that the top level prints: ``asPrintable``, unless redefined."""
    return world.send(this, "asPrintable")


# ---------------------------------------------------------------- truth and in-place operators


@TABLE.primitive("!")
def not_(world: World, this: Value) -> bool:
    """Whether this value counts as false."""
    return not this


@TABLE.lazy("&&", least=1, most=1)
def and_(world: World, message: CallMessage) -> Value:
    """This value if it counts as false; otherwise the argument, which is evaluated only then."""
    return message.eval_at(0) if message.target else message.target


@TABLE.lazy("||", least=1, most=1)
def or_(world: World, message: CallMessage) -> Value:
    """This value if it counts as true; otherwise the argument, which is evaluated only then."""
    return message.target or message.eval_at(0)


def _in_place(operator: str) -> None:
    @TABLE.raw(operator + "=", least=1)
    def in_place(world: World) -> Any:
        """The result of ``this operator that``."""
        return lambda this, that: world.send1(this, operator, that)


for _operator in "+-*/^%":
    _in_place(_operator)


# ---------------------------------------------------------------- calling


@TABLE.primitive("apply")
def apply(world: World, this: Value, args: list) -> Value:  # type: ignore[type-arg]
    """This value, for uniformity with ``Code.apply``: the list has one member, which is ignored."""
    if len(args) != 1:
        raise errors.arity(len(args), 1)
    return this


@TABLE.primitive("bounce")
def bounce(world: World, this: Value, name: str) -> Value:
    """A function of one argument that calls the argument's method ``name`` without arguments."""
    return native(world, name, lambda _, target: world.send(target, name), 1)


@TABLE.primitive("callMessage")
def call_message(world: World, this: Value, message: Value) -> Value:
    """Send a call message to this object instead of its target."""
    args = world.get_slot(message, "args")
    if not isinstance(args, List):
        raise world.type_error(1, args, "List")
    return send_lazies(world, this, world.text(world.get_slot(message, "message")), this, args.l)


def send_lazies(world: World, target: Value, name: str, sender: Value, lazies: list[Value]) -> Value:
    """Call ``target.name`` with unevaluated arguments; they are evaluated for functions with strict parameters."""
    code = world.ops.method(target, name)
    if not code.strict:
        return code.call_lazy(world.lazy_message(code, target, name, sender, lazies))
    values = tuple([lazy.force() for lazy in lazies])
    if world.void in values:
        raise errors.unexpected_void()
    given = len(values)
    least, most = getattr(code, "least", 0), getattr(code, "most", 0)
    if hasattr(code, "info"):
        least, most = code.info.least, code.info.most
    if given < least or 0 <= most < given:
        raise errors.arity(given, least, most, routine=name)
    return code.call(target, values)


@TABLE.primitive("getPeriod")
def get_period(world: World, this: Value) -> float:
    """Deprecated: use ``System.period``.  Period in seconds."""
    return world.period


def install(world: World, programs: Any) -> None:
    """Make the slot ``protos`` of objects assignable."""

    def write(target: Value, value: Value) -> None:
        if not isinstance(value, List):
            raise world.type_error(1, value, "List", "protos")
        world.as_obj(target).set_protos([*value.l])

    meta_of(world.object, "protos").accessor = Field(lambda this: protos(world, this), write)


