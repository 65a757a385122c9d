"""UObject, UVar and ``uobjects`` as urbiscript sees them (manual, sections 20.67 to 20.69; release notes of 2.1)."""

from __future__ import annotations

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
from urbihw.kernel.uobject.host import Host, TextRunner
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.uobject import UObjectFace
from urbihw.kernel.uobject.uvar import UVar, check_hookable, hook
from urbihw.kernel.value import Value

UVAR = Table("UVar")
UOBJECT = Table("UObject")
UOBJECTS = Table("uobjects")
SYSTEM = Table("System")

TIME_SLICE_S: Final = 0.01
"""Maximum time in seconds without a turn for other jobs while a program makes variables: one statement may make
thousands.
"""


# ---------------------------------------------------------------- UObject


@UOBJECT.primitive("asString")
def as_string(world: World, this: Value) -> Value:
    """The name of the first slot of Global that holds a device, such as ``motor6``; without one as other objects."""
    name = world.global_name(this) if isinstance(this, UObjectFace) and this.python is not None else None
    return world.invoke(world.object.slots["asString"], this, (), "asString") if name is None else world.string(name)


# ---------------------------------------------------------------- UVar


@UVAR.primitive("new")
def new(world: World, this: Value, holder: Value, name: str) -> Value:
    """Hook a variable: ``UVar.new(object, "slot")`` makes the slot; an existing slot keeps its value.

    A program that makes very many variables gives other jobs turns.
    """
    made = hook(world, world.as_obj(holder), name)
    if world.scheduler.running().context is not None:
        world.scheduler.give_way(TIME_SLICE_S)
    return made


@UVAR.primitive("copy")
def copy(world: World, this: UVar, holder: Value, name: str) -> Value:
    """Share this variable with another slot.  A slot with another variable or with a function is left unchanged."""
    target = world.as_obj(holder)
    if isinstance(target.slots.get(name), UVar):
        raise errors.redefinition(name)
    check_hookable(target, name)
    this.add_slot(target, name)
    return this


@UVAR.primitive("notifyChange")
def notify_change(world: World, this: UVar, handle: Value, code: Value = None) -> None:
    """Register a function that is called at each write of the variable."""
    this.notify_change(_NativeCallback(world, this, handle if code is None else code, "notifyChange"))


@UVAR.primitive("notifyAccess")
def notify_access(world: World, this: UVar, handle: Value, code: Value = None) -> None:
    """Register a function that is called at each read of the variable."""
    this.notify_access(_NativeCallback(world, this, handle if code is None else code, "notifyAccess"))


class _NativeCallback:
    """A callback that runs with the lobby of the connection that registered it, whichever job writes the variable."""

    def __init__(self, world: World, var: UVar, function: Value, name: str) -> None:
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

    def tell(self, error: Exception, what: str) -> bool:
        """Report a failure to the connection that registered the function; False if there is none any more."""
        if self.context is None or not self.context.connected:
            return False
        self.context.report(error)
        self.context.output.line(f"!!!    {what}", "error")
        return True


@UVAR.primitive("unnotify")
def unnotify(world: World, this: UVar) -> None:
    """Remove the callbacks that this connection registered."""
    context = world.scheduler.running().context
    this.unnotify_where(lambda handler: isinstance(handler, _NativeCallback) and handler.context is context)


@UVAR.primitive("owned")
def owned(world: World, this: UVar) -> bool:
    """Whether the variable holds both a target and a sensed value."""
    return this.owned


@UVAR.primitive("val")
def val(world: World, this: UVar) -> Value:
    """The value for readers other than the owner."""
    return this.read(this)


@UVAR.primitive("target")
def target(world: World, this: UVar) -> Value:
    """The last value written to the variable."""
    return this.current(True)


@UVAR.primitive("age")
def age(world: World, this: UVar) -> float:
    """Seconds since the value was measured."""
    return this.age()


@UVAR.primitive("timestamp")
def timestamp(world: World, this: UVar) -> float:
    """Time of the measurement of the value, in seconds of the server's clock."""
    return this.stamp


# ---------------------------------------------------------------- UObject


@UOBJECT.raw("new", least=0, most=-1)
def make(world: World) -> Any:
    """Clone this object and call ``init`` of the clone with the arguments.  If ``init`` fails, the clone is destroyed.

    A non-zero number as the result of ``init`` is a failure too.
    """

    def run(this: Value, *args: Value) -> Value:
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
def destroy(world: World, this: Value) -> None:
    """Destroy a device, in Python and in urbiscript; its slot is removed from ``uobjects``.

    Raises an urbiscript error for a class of the server and for a device that the server itself made.
    """
    if not isinstance(this, UObjectFace):
        _destroy_foreign(world, this)
    elif this.python is None or this.lasting:
        raise errors.primitive(f"{world.text(this.slots['__uobjectName'])} belongs to this server, which needs it")
    else:
        this.python.destroy()


def _destroy_foreign(world: World, this: Value) -> None:
    """Destroy an object of another process, or a urbiscript object."""
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
def enable_stats(world: World, this: Value, on: Value) -> None:
    """Switch the measurement of bound functions, callbacks and timers on or off."""
    registry_of(world).stats.enabled = bool(on)


@UOBJECTS.primitive("getStats")
def get_stats(world: World, this: Value) -> dict[str, list[float]]:
    """The statistics: name -> [average, minimum, maximum duration in seconds, number of calls]."""
    return registry_of(world).stats.get()


@UOBJECTS.primitive("clearStats")
def clear_stats(world: World, this: Value) -> None:
    """Clear the statistics of all calls."""
    registry_of(world).stats.clear()


# ---------------------------------------------------------------- System


@SYSTEM.primitive("loadModule", "loadLibrary")
def load_module(world: World, this: Value, module: Any) -> None:
    """Import a Python module from URBI_UOBJECT_PATH and register its UObjects."""
    try:
        registry_of(world).host.load_module(world.text(module))
    except DeviceError as error:
        raise errors.primitive(str(error)) from error


class HookChanged:
    """The slot ``UVar.hookChanged``: whether new variables have the event ``changed``."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry

    def read(self, target: Value) -> Value:
        """Whether new variables have the event ``changed``."""
        return self._registry.world.boolean(self._registry.hook_changed)

    def write(self, target: Value, value: Value) -> Value:
        """Switch the event ``changed`` of new variables on or off."""
        self._registry.hook_changed = bool(value)
        return value


class RemoveThrowing:
    """The slot ``removeThrowingCallbacks`` of a variable: whether a callback that fails is removed; in UVar, the
    initial value for new variables (manual, release notes of 2.0 RC 2).
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry

    def read(self, target: Value) -> Value:
        """Whether a function given to ``notifyChange`` or ``notifyAccess`` is removed when it fails."""
        return self._registry.world.boolean(self._of(target).remove_throwing)

    def write(self, target: Value, value: Value) -> Value:
        """Switch the removal on or off."""
        self._of(target).remove_throwing = bool(value)
        return value

    def _of(self, target: Value) -> UVar | Registry:
        return target if isinstance(target, UVar) else self._registry


def install(world: World, programs: TextRunner) -> Host:
    """Install UObject, UVar, ``uobjects`` and ``uobjects_handle`` in Global; returns the host of the world's
    devices.
    """
    slots = world.global_.slots
    for name, proto in (("UVar", world.uvar_proto), ("UObject", world.uobject_proto)):
        proto.slots["type"] = world.string(name)
        slots[name] = world.classes[name] = proto
    host = Host(world, programs)
    registry = host.registry
    world.record.open_ended.append(registry.holder)
    UVAR.install(world, world.uvar_proto)
    UOBJECT.install(world, world.uobject_proto)
    # A device without a switch of its own is on; "load" of Object would look for a file.
    world.uobject_proto.slots["load"] = 1.0
    UOBJECTS.install(world, registry.holder)
    SYSTEM.install(world, slots["System"])
    for name, switch in (("hookChanged", HookChanged(registry)), ("removeThrowingCallbacks", RemoveThrowing(registry))):
        world.uvar_proto.slots[name] = make_primitive(world, name, switch.read, 0, 0)
        meta_of(world.uvar_proto, name).accessor = switch
    slots["uobjects_handle"] = Plain(world, [world.object])
    world.flush()
    return host
