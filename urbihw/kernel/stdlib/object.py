"""Object: slots, prototypes, identity, conversions.  Properties are in ``properties``, descriptions in ``describe``."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.record import lineage
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.values import CallMessage, FloatObject, List, ProtoList
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import Field, native

TABLE = Table("Object")
PROTOS = {"Object": ("Orderable", "Global")}

NOTES = {
    "Object": "What all objects come from: slots, prototypes, identity, conversions.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


# ---------------------------------------------------------------- making objects


@TABLE.primitive("clone")
def clone(world: World, this: Any) -> Any:
    """A fresh object whose only prototype is this one."""
    return FloatObject(world, [this], this) if this.__class__ is float else this.clone()


@TABLE.raw("new", least=0, most=-1)
def new(world: World) -> Any:
    """A clone of this, after its ``init`` was called with the arguments."""

    def run(this: Any, *args: Any) -> Any:
        made = world.send(this, "clone")
        if made is not this:
            world.send(made, "init", *args)
        return made

    return run


@TABLE.primitive("init")
def init(world: World, this: Any) -> None:
    """Nothing: what ``new`` calls unless a prototype defines its own."""


# ---------------------------------------------------------------- slots


@TABLE.primitive("getSlot")
def get_slot(world: World, this: Any, name: str) -> Any:
    """The value of a slot, not called, its own or inherited; raises ``lookup failed``."""
    return world.get_slot(this, name)


@TABLE.primitive("getLocalSlot")
def get_local_slot(world: World, this: Any, name: str) -> Any:
    """The value of a slot of this object itself; raises ``lookup failed``."""
    slots = world.peek_obj(this).slots if _has_own_slots(world, this) else {}
    if name not in slots:
        raise errors.lookup_failed(name)
    return slots[name]


@TABLE.primitive("setSlot")
def set_slot(world: World, this: Any, name: str, value: Any) -> Any:
    """Create a slot; raises ``slot redefinition`` if this object has it already."""
    return world.set_slot(this, name, value)


@TABLE.primitive("setConstSlot")
def set_const_slot(world: World, this: Any, name: str, value: Any) -> Any:
    """Create a slot that cannot be assigned."""
    world.set_slot(this, name, value)
    meta_of(world.as_obj(this), name).constant = True
    return value


@TABLE.primitive("updateSlot")
def update_slot(world: World, this: Any, name: str, value: Any) -> Any:
    """Assign an existing slot, copying an inherited one first; raises ``lookup failed``."""
    return world.update_slot(this, name, value)


@TABLE.primitive("createSlot")
def create_slot(world: World, this: Any, name: str) -> None:
    """Create a slot without a value; raises ``slot redefinition``."""
    world.set_slot(this, name, world.void)


@TABLE.primitive("removeSlot", "removeLocalSlot")
def remove_slot(world: World, this: Any, name: str) -> Any:
    """Remove a slot of this object, if it has it; returns this."""
    if _has_own_slots(world, this):
        world.ops.remove_slot(this, name)
    return this


@TABLE.primitive("copySlot")
def copy_slot(world: World, this: Any, source: str, name: str) -> None:
    """Make a slot with the same value as another one."""
    world.set_slot(this, name, _source(world, this, source, "copySlot"))


@TABLE.primitive("cloneSlot")
def clone_slot(world: World, this: Any, source: str, name: str) -> None:
    """Make a slot with a clone of the value of another one."""
    world.set_slot(this, name, world.send(_source(world, this, source, "cloneSlot"), "clone"))


def _source(world: World, this: Any, name: str, routine: str) -> Any:
    if world.peek_obj(this).find(name) is None:
        raise errors.Raised("Lookup", f"lookup failed: {name}", routine, name=name)
    return world.get_slot(this, name)


@TABLE.primitive("hasSlot")
def has_slot(world: World, this: Any, name: str) -> bool:
    """Whether this object has the slot, its own or inherited."""
    world.recorder.read(this, name)
    return world.peek_obj(this).find(name) is not None


@TABLE.primitive("hasLocalSlot")
def has_local_slot(world: World, this: Any, name: str) -> bool:
    """Whether this object itself has the slot."""
    world.recorder.read(this, name)
    return _has_own_slots(world, this) and name in world.peek_obj(this).slots


@TABLE.primitive("locateSlot")
def locate_slot(world: World, this: Any, name: str) -> Any:
    """The object from which a slot comes, nil if there is none."""
    holder = world.peek_obj(this).find(name)
    if holder is None:
        return world.nil
    return this if holder is world.peek_obj(this) and _has_own_slots(world, this) else holder


@TABLE.primitive("localSlotNames")
def local_slot_names(world: World, this: Any) -> Any:
    """The names of this object's own slots, in alphabetical order."""
    names = sorted(world.peek_obj(this).slots) if _has_own_slots(world, this) else []
    return world.new_list([world.string(name) for name in names])


@TABLE.primitive("slotNames", "allSlotNames")
def slot_names(world: World, this: Any) -> Any:
    """The names of all slots, inherited ones too, in alphabetical order."""
    names = {name for value in lineage(world, this) for name in world.peek_obj(value).slots}
    return world.new_list([world.string(name) for name in sorted(names)])


def _has_own_slots(world: World, this: Any) -> bool:
    return this.__class__ is not float or id(this) in world.float_slots


# ---------------------------------------------------------------- prototypes


@TABLE.primitive("protos")
def protos(world: World, this: Any) -> Any:
    """The list of prototypes; change it or assign it to change them."""
    return ProtoList(world, world.list_protos, this)


@TABLE.primitive("setProtos")
def set_protos(world: World, this: Any, wanted: list) -> None:  # type: ignore[type-arg]
    """Replace the prototypes by those of a list."""
    world.as_obj(this).set_protos(list(wanted))


@TABLE.primitive("addProto")
def add_proto(world: World, this: Any, proto: Any) -> Any:
    """Put a prototype in front of the others, unless it is one already; returns this."""
    obj = world.as_obj(this)
    if not any(known is proto for known in obj.protos):
        obj.set_protos([proto, *obj.protos])
    return this


@TABLE.primitive("removeProto")
def remove_proto(world: World, this: Any, proto: Any) -> Any:
    """Take a prototype away, if it is one; returns this."""
    obj = world.as_obj(this)
    obj.set_protos([known for known in obj.protos if known is not proto])
    return this


@TABLE.primitive("allProtos")
def all_protos(world: World, this: Any) -> Any:
    """This object, its prototypes, theirs, and so on, each once, in the order of look-up."""
    return world.new_list(lineage(world, this))


@TABLE.primitive("isA")
def is_a(world: World, this: Any, proto: Any) -> bool:
    """Whether the argument is this or one of its ancestors."""
    return world.is_a(this, proto)


@TABLE.primitive("isProto")
def is_proto(world: World, this: Any) -> bool:
    """Whether this object is a prototype: it has a ``type`` of its own."""
    return _has_own_slots(world, this) and "type" in world.peek_obj(this).slots


# ---------------------------------------------------------------- what it is


@TABLE.primitive("isNil")
def is_nil(world: World, this: Any) -> bool:
    """Whether this is nil."""
    return this is world.nil


@TABLE.primitive("isVoid")
def is_void(world: World, this: Any) -> bool:
    """Whether this is void: never, for an Object."""
    return False


@TABLE.primitive("uid", "$id")
def uid(world: World, this: Any) -> str:
    """What tells this object from all others."""
    return world.uid(this)


@TABLE.primitive("===")
def same(world: World, this: Any, that: Any) -> bool:
    """Whether both are the same object."""
    return this is that


@TABLE.primitive("!==")
def not_same(world: World, this: Any, that: Any) -> bool:
    """Whether they are two objects."""
    return this is not that


@TABLE.primitive("==")
def equal(world: World, this: Any, that: Any) -> bool:
    """Whether both are the same object, unless redefined."""
    return this is that


@TABLE.primitive("!=")
def unequal(world: World, this: Any, that: Any) -> bool:
    """The contrary of ``==``."""
    return not world.send(this, "==", that)


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asBool")
def as_bool(world: World, this: Any) -> bool:
    """Whether this counts as true."""
    return bool(this)


@TABLE.primitive("as")
def as_(world: World, this: Any, kind: Any) -> Any:
    """``this.asType``, where Type is the type of the argument."""
    return world.send(this, "as" + world.type_name(kind))


@TABLE.primitive("asString")
def as_string(world: World, this: Any) -> str:
    """The type of a prototype, ``Type_0x...`` for others."""
    name = world.type_name(this)
    return name if is_proto(world, this) else f"{name}_{world.uid(this)}"


@TABLE.primitive("asObject")
def as_object(world: World, this: Any) -> Any:
    """This: everything is an Object."""
    return this


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: Any) -> Any:
    """``asString``, unless redefined."""
    return world.send(this, "asString")


@TABLE.primitive("asToplevelPrintable")
def as_toplevel_printable(world: World, this: Any) -> Any:
    """What the top level prints: ``asPrintable``, unless redefined."""
    return world.send(this, "asPrintable")


# ---------------------------------------------------------------- truth and in-place operators


@TABLE.primitive("!")
def not_(world: World, this: Any) -> bool:
    """Whether this counts as false."""
    return not this


@TABLE.lazy("&&", least=1, most=1)
def and_(world: World, message: CallMessage) -> Any:
    """The argument, evaluated only if this counts as true; else this."""
    return message.eval_at(0) if message.target else message.target


@TABLE.lazy("||", least=1, most=1)
def or_(world: World, message: CallMessage) -> Any:
    """This if it counts as true; else the argument, evaluated only then."""
    return message.target or message.eval_at(0)


def _in_place(operator: str) -> None:
    @TABLE.raw(operator + "=", least=1)
    def in_place(world: World) -> Any:
        """``this operator that``."""
        return lambda this, that: world.send1(this, operator, that)


for _operator in "+-*/^%":
    _in_place(_operator)


# ---------------------------------------------------------------- calling


@TABLE.primitive("apply")
def apply(world: World, this: Any, args: list) -> Any:  # type: ignore[type-arg]
    """This, for the likeness with ``Code.apply``: the list has one member, which is ignored."""
    if len(args) != 1:
        raise errors.arity(len(args), 1)
    return this


@TABLE.primitive("bounce")
def bounce(world: World, this: Any, name: str) -> Any:
    """A function of one argument that calls the argument's method ``name`` without arguments."""
    return native(world, name, lambda _, target: world.send(target, name), 1)


@TABLE.primitive("callMessage")
def call_message(world: World, this: Any, message: Any) -> Any:
    """Send a call message to this instead of to its target."""
    args = world.get_slot(message, "args")
    if not isinstance(args, List):
        raise world.type_error(1, args, "List")
    return send_lazies(world, this, world.text(world.get_slot(message, "message")), this, args.l)


def send_lazies(world: World, target: Any, name: str, sender: Any, lazies: list[Any]) -> Any:
    """``target.name`` with unevaluated arguments: strict functions get them evaluated."""
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
def get_period(world: World, this: Any) -> float:
    """Deprecated: use ``System.period``.  In seconds."""
    return world.period


def install(world: World, programs: Any) -> None:
    """``protos`` can be assigned."""

    def write(target: Any, value: Any) -> None:
        if not isinstance(value, List):
            raise world.type_error(1, value, "List", "protos")
        world.as_obj(target).set_protos([*value.l])

    meta_of(world.object, "protos").accessor = Field(lambda this: protos(world, this), write)


