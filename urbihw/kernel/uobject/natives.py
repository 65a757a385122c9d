"""How urbiscript sees UObject, UVar and ``uobjects`` (manual, sections 20.67 to 20.69; release notes of 2.1)."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.errors import DeviceError
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.uobject import UObjectFace
from urbihw.kernel.uobject.uvar import UVar, check_hookable, hook

UVAR = Table("UVar")
UOBJECT = Table("UObject")
UOBJECTS = Table("uobjects")
SYSTEM = Table("System")

HOOK_CHANGED = "URBI_UVAR_HOOK_CHANGED"
AIR: Final = 0.01
"""Seconds after which others have a turn while a program makes variables: thousands may be made in one statement."""


# ---------------------------------------------------------------- UVar


@UVAR.primitive("new")
def new(world: World, this: Any, holder: Any, name: str) -> Any:
    """Hook a variable: ``UVar.new(object, "slot")`` makes the slot, or keeps the value of the one there is.

    Others have a turn when a program makes very many.
    """
    made = hook(world, world.as_obj(holder), name)
    if world.scheduler.running().context is not None:
        world.scheduler.give_way(AIR)
    return made


@UVAR.primitive("copy")
def copy(world: World, this: UVar, holder: Any, name: str) -> Any:
    """Let another slot share this variable; one that has another variable, or a function, is left alone."""
    target = world.as_obj(holder)
    if isinstance(target.slots.get(name), UVar):
        raise errors.redefinition(name)
    check_hookable(target, name)
    this.put(target, name)
    return this


@UVAR.primitive("notifyChange")
def notify_change(world: World, this: UVar, handle: Any, code: Any = None) -> None:
    """Call a function each time the variable is written to."""
    this.notify_change(_Handler(world, this, handle if code is None else code, "notifyChange"))


@UVAR.primitive("notifyAccess")
def notify_access(world: World, this: UVar, handle: Any, code: Any = None) -> None:
    """Call a function each time the variable is read."""
    this.notify_access(_Handler(world, this, handle if code is None else code, "notifyAccess"))


class _Handler:
    """A callback that speaks to the connection of who set it, whoever writes the variable."""

    def __init__(self, world: World, var: UVar, function: Any, name: str) -> None:
        self.context = world.scheduler.running().context
        self._run: Callable[[], Any] = lambda: world.invoke(function, var, (), name)
        self._scheduler = world.scheduler

    def __call__(self) -> None:
        job = self._scheduler.current
        if job is None:
            self._run()
            return
        before, job.context = job.context, self.context
        try:
            self._run()
        finally:
            job.context = before


@UVAR.primitive("unnotify")
def unnotify(world: World, this: UVar) -> None:
    """Forget the functions that this connection wanted to be called."""
    context = world.scheduler.running().context
    this.unnotify_where(lambda handler: isinstance(handler, _Handler) and handler.context is context)


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
    return this.current(True)


@UVAR.primitive("age")
def age(world: World, this: UVar) -> float:
    """Seconds since the value was taken."""
    return this.age()


@UVAR.primitive("timestamp")
def timestamp(world: World, this: UVar) -> float:
    """When the value was taken, in seconds of the server's clock."""
    return this.stamp


# ---------------------------------------------------------------- UObject


@UOBJECT.raw("new", least=0, most=-1)
def make(world: World) -> Any:
    """A clone of this, after its ``init`` was called with the arguments; if that fails the clone is destroyed.

    A number other than 0 that ``init`` gives is a failure too.
    """

    def run(this: Any, *args: Any) -> Any:
        made = world.send(this, "clone")
        if made is this or made.__class__ is float:
            return made
        if "__uobjectName" not in made.slots:
            registry_of(world).add(f"obj_{world.uid(made)}", made)
        try:
            answer = world.send(made, "init", *args)
            if answer.__class__ is float and answer:
                kind = world.type_name(this)
                raise errors.primitive(f"{kind} construction failed: init returned {world.text(answer)}.", "new")
        except Exception:
            destroy(world, made)
            raise
        return made

    return run


@UOBJECT.primitive("destroy")
def destroy(world: World, this: Any) -> None:
    """End a device, in both worlds: it is no slot of ``uobjects`` any more.

    Raises an urbiscript error for a class of the server, and for a device that the server has not for a program's sake.
    """
    if not isinstance(this, UObjectFace):
        _destroy_foreign(world, this)
    elif this.python is None or this.lasting:
        raise errors.primitive(f"{world.text(this.slots['__uobjectName'])} belongs to this server, which needs it")
    else:
        this.python.destroy()


def _destroy_foreign(world: World, this: Any) -> None:
    """``destroy`` of an object of another process, or of urbiscript."""
    registry = registry_of(world)
    name = this.slots.get("__uobjectName") if isinstance(this, Obj) else None
    if not isinstance(name, String):
        return
    owner = registry.owners.get(this)
    if owner is None:
        registry.remove(name.s, this)
        return
    owner.destroy(next(known for known, face in owner.objects.items() if face is this))


# ---------------------------------------------------------------- uobjects


@UOBJECTS.primitive("enableStats")
def enable_stats(world: World, this: Any, on: Any) -> None:
    """Whether calls of bound functions, callbacks and timers are measured."""
    registry_of(world).stats.enabled = bool(on)


@UOBJECTS.primitive("getStats")
def get_stats(world: World, this: Any) -> dict[str, list[float]]:
    """Name of what was called to [average, least, greatest duration in seconds, number of calls]."""
    return registry_of(world).stats.get()


@UOBJECTS.primitive("clearStats")
def clear_stats(world: World, this: Any) -> None:
    """Forget what was measured."""
    registry_of(world).stats.clear()


# ---------------------------------------------------------------- System


@SYSTEM.primitive("loadModule", "loadLibrary")
def load_module(world: World, this: Any, module: Any) -> None:
    """Import a Python module, to be found in URBI_UOBJECT_PATH, and register its UObjects."""
    try:
        registry_of(world).load_module(world.text(module))
    except DeviceError as error:
        raise errors.primitive(str(error)) from error


class HookChanged:
    """The slot ``UVar.hookChanged``."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry

    def read(self, target: Any) -> Any:
        """Whether variables made from now on have the event ``changed``."""
        return self._registry.world.boolean(self._registry.hook_changed)

    def write(self, target: Any, value: Any) -> Any:
        """Somebody switches it."""
        self._registry.hook_changed = bool(value)
        return value


def install(world: World) -> Registry:
    """Put UObject, UVar, ``uobjects`` and ``uobjects_handle`` into Global; the registry of the world."""
    slots = world.global_.slots
    for name, proto in (("UVar", world.uvar_proto), ("UObject", world.uobject_proto)):
        proto.slots["type"] = world.string(name)
        slots[name] = world.classes[name] = proto
    holder = slots["uobjects"]
    assert isinstance(holder, Obj)
    registry = world.uobjects = Registry(world, holder)
    world.record.open_ended.append(holder)
    registry.hook_changed = HOOK_CHANGED not in os.environ
    UVAR.install(world, world.uvar_proto)
    UOBJECT.install(world, world.uobject_proto)
    UOBJECTS.install(world, holder)
    SYSTEM.install(world, slots["System"])
    hook = HookChanged(registry)
    world.uvar_proto.slots["hookChanged"] = make_primitive(world, "hookChanged", hook.read, 0, 0)
    meta_of(world.uvar_proto, "hookChanged").accessor = hook
    slots["uobjects_handle"] = Plain(world, [world.object])
    world.flush()
    return registry
