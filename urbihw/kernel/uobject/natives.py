"""How urbiscript sees UObject and UVar (manual, sections 20.67 to 20.69)."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.uvar import UVar

UVAR = Table("UVar")


@UVAR.primitive("new")
def new(world: World, this: Any, holder: Any, name: str) -> Any:
    """Hook a variable: ``UVar.new(object, "slot")`` makes the slot, or keeps the value of the one there is."""
    obj = world.as_obj(holder)
    old = obj.slots.get(name)
    if isinstance(old, UVar):
        return old
    return UVar(world, obj, name, value=old)


@UVAR.primitive("copy")
def copy(world: World, this: UVar, holder: Any, name: str) -> Any:
    """Let another slot share this variable."""
    this.put(world.as_obj(holder), name)
    return this


@UVAR.primitive("notifyChange")
def notify_change(world: World, this: UVar, handle: Any, code: Any) -> None:
    """Call a function each time the variable is written to."""
    this.notify_change(lambda: world.invoke(code, this, (), "notifyChange"))


@UVAR.primitive("notifyAccess")
def notify_access(world: World, this: UVar, handle: Any, code: Any) -> None:
    """Call a function each time the variable is read."""
    this.notify_access(lambda: world.invoke(code, this, (), "notifyAccess"))


@UVAR.primitive("owned")
def owned(world: World, this: UVar) -> bool:
    """Whether the variable holds a target and a sensed value."""
    return this.owned


@UVAR.primitive("val")
def val(world: World, this: UVar) -> Any:
    """The value that outsiders read."""
    return this.read(this)


@UVAR.primitive("target")
def target(world: World, this: UVar) -> Any:
    """What was last written to the variable."""
    return world.from_python(this.target)


@UVAR.primitive("age")
def age(world: World, this: UVar) -> float:
    """Seconds since the value was taken."""
    return this.age()


def install(world: World) -> None:
    """Put UObject, UVar and ``uobjects_handle`` into Global."""
    UVAR.install(world, world.uvar_proto)
    for name, proto in (("UVar", world.uvar_proto), ("UObject", world.uobject_proto)):
        proto.slots["type"] = world.string(name)
        world.global_.slots[name] = proto
    world.global_.slots["uobjects_handle"] = Plain(world, [world.object])
    world.flush()
