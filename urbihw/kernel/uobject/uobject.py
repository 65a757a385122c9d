"""The base class of devices: binds Python attributes to urbiscript slots, methods to urbiscript functions.

``declarations`` has the declarations of a class; this module has the operations of an instance: ``bind_var`` and
``bind_function`` are UBindVar and UBindFunction after construction, ``notify_change`` is UNotifyChange, ``set_update``
is USetUpdate, ``set_timer`` is USetTimer, ``var`` is UVar by name; ``send`` and ``call`` have the same names in the C++
API.  Periods are in seconds.

All callbacks run in the kernel's thread and must not block it; only functions bound as ``threaded`` may block.  All
methods may be called from any thread.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.uobject.callback import Callback
from urbihw.kernel.uobject.declarations import bound_attributes, event, variable
from urbihw.kernel.uobject.functions import bound_functions, class_function, instance_function
from urbihw.kernel.uobject.part import DevicePart, declaring_classes, parts_of
from urbihw.kernel.uobject.threads import Lock
from urbihw.kernel.uobject.timers import Timers
from urbihw.kernel.uobject.uevent import Handler, UEvent, UEventListener
from urbihw.kernel.uobject.uvalue import PythonDevice, to_urbi
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.host import Host


class UObjectFace(Obj):
    """A device as urbiscript sees it: the object that has the bound slots."""

    __slots__ = ("host", "kind", "lasting", "python")

    def __init__(self, world: World, protos: list[Obj], host: Host, kind: type[UObject]) -> None:
        super().__init__(world, protos)
        self.host = host
        self.kind = kind
        self.python: UObject | None = None
        self.lasting = False
        """Whether the server itself made the device, so that no program may destroy it."""

    def clone(self) -> UObjectFace:
        """Make a new instance, in Python and in urbiscript; ``new`` then calls ``init``."""
        return self.make(self.host.registry.fresh_name())

    def make(self, name: str) -> UObjectFace:
        """Make a new instance under a unique name."""
        made = UObjectFace(self.world, [self], self.host, self.kind)
        self.host.registry.add(name, made)
        try:
            made.python = self.kind(self.host, made)
        except Exception:
            self.host.registry.remove(name, made)
            raise
        self.host.made(made.python)
        return made


class UObject(PythonDevice):
    """Base class of all devices.  Derive from it, add declarations, and write ``init``; do not override
    ``__init__``.
    """

    uname: ClassVar[str] = ""
    """The name of the urbiscript class; the Python name if empty."""
    slot_words: ClassVar[Mapping[str, tuple[str, str]]] = {}
    """Slot -> what it means, and its unit ("1" for a number without unit, "" for what is no number): for ``help`` and
    ``->unit``.  Those of base classes and of parts count too."""
    parts: ClassVar[tuple[type[DevicePart], ...]] = ()
    """The classes of the parts (see ``part``) that ``init`` makes; those of base classes count too."""

    @classmethod
    def urbi_class(cls) -> str:
        """The name of the urbiscript class."""
        return cls.uname or cls.__name__

    def __init__(self, host: Host, face: UObjectFace) -> None:
        self.host = host
        self.face: UObjectFace = face
        self.variables: dict[str, UVar] = {}
        self.events: dict[str, UEvent] = {}
        self._made_parts: dict[type[DevicePart], DevicePart] = {}
        self._timers = Timers(host, self.urbi_class(), isinstance(self, UObjectHub))
        self._hooks: list[tuple[UVar, Callback]] = []
        self._listeners: list[tuple[UEvent, UEventListener]] = []
        self._hubs: list[UObjectHub] = []
        for declared in bound_attributes(type(self)):
            if isinstance(declared, variable):
                self.bind_var(declared.slot, declared.initial, owned=declared.owned, writable=declared.writable)
            elif isinstance(declared, event):
                self.bind_event(declared.slot)

    @property
    def unique_name(self) -> str:
        """The unique name of this instance: its slot in ``uobjects``."""
        return self.host.world.text(self.face.slots["__uobjectName"])

    @classmethod
    def describe_slot(cls, name: str) -> tuple[str, str]:
        """The meaning and the unit of a slot from ``slot_words``; empty where nothing is known."""
        for holder in reversed(declaring_classes(cls)):
            found = vars(holder).get("slot_words", {}).get(name)
            if found is not None:
                return found  # type: ignore[no-any-return]
        return "", ""

    @classmethod
    def describe_function(cls, name: str) -> str:
        """The docstring of the method that is the function of this name; empty where there is none."""
        bound = bound_functions(cls).get(name)
        return "" if bound is None else bound.method.__doc__ or ""

    def add_part(self, part: DevicePart) -> None:
        """Called by a new part.  Raises TypeError for one whose class the class of this device does not name."""
        if type(part) not in parts_of(type(self)):
            raise TypeError(f"{type(part).__name__} is not among the parts of {type(self).__name__}")
        self._made_parts[type(part)] = part

    def part(self, kind: type[DevicePart]) -> DevicePart:
        """The part of a class."""
        return self._made_parts[kind]

    # ---------------------------------------------------------------- binding

    def bind_var(self, name: str, value: Any = None, *, owned: bool = False, writable: bool = True) -> UVar:
        """Bind one more variable of this instance (UBindVar, UOwned).  If not ``writable``, only the device writes it
        (see ``reading``).
        """
        return self.host.registry.call(lambda: self._bind_var(name, value, owned, writable))

    def _bind_var(self, name: str, value: Any, owned: bool, writable: bool) -> UVar:
        made = UVar(self.host.world, self.face, name, owned=owned, value=value)
        if not writable:
            made.protect()
        self.variables[name] = made
        unit = self.describe_slot(name)[1]
        if unit:
            made.set_property("unit", unit)
        self.host.bound_var(self, made)
        return made

    def bind_event(self, name: str) -> UEvent:
        """Bind one more event of this instance (UBindEvent)."""
        return self.host.registry.call(lambda: self._bind_event(name))

    def _bind_event(self, name: str) -> UEvent:
        world = self.host.world
        face = Event(world, [world.event_proto])
        world.ops.put_slot(self.face, name, face)
        made = self.events[name] = UEvent(world, face)
        self.host.bound_event(self, name, made)
        return made

    def bind_function(self, method: Callable[..., Any], name: str = "", lock: Lock | None = None) -> None:
        """Bind one more function of this instance (UBindFunction); with a ``lock`` it runs in a thread."""
        urbi = name or method.__name__

        def bind() -> None:
            world = self.host.world
            world.ops.put_slot(self.face, urbi, instance_function(world, urbi, method, lock))
            self.host.bound_function(self, urbi, method)

        self.host.registry.call(bind)

    def put_slot(self, name: str, value: Any) -> None:
        """Make a plain slot of this instance that holds a Python value or another device."""
        self.host.registry.call(lambda: self.host.put_slot(self, name, value))

    def init(self, *args: Any, **named: Any) -> Any:
        """Called by ``new`` with its arguments.  Override it with the parameters of your device.

        A ValueError ends the construction with its message; so does a non-zero number as the result.
        """

    # ---------------------------------------------------------------- others

    def var(self, name: str) -> UVar:
        """The variable ``object.slot`` of any object; a plain slot is hooked.

        Raises ValueError if there is no such object.
        """
        return self.host.var(name)

    def send(self, text: str) -> None:
        """Run urbiscript at the server, in a job of its own; an error in it is logged."""
        self.host.send(text, self.urbi_class())

    def call(self, target: str, function: str, *args: Any) -> None:
        """Call ``target.function(args)`` at the server, in a job of its own; an error in it is logged."""
        self.host.call(target, function, *args)

    def register(self, hub: type[UObjectHub]) -> None:
        """Become a member of a hub (URegister)."""
        found = self.host.hub(hub)
        found.members.append(self)
        self._hubs.append(found)

    def set_thread_limit(self, limit: int) -> None:
        """Set the maximum number of threads for threaded functions of the whole kernel."""
        if limit < 1:
            raise ValueError(f"the number of threads cannot be limited to {limit}")
        self.host.registry.threads.limit = limit

    # ---------------------------------------------------------------- notification

    def notify_change(self, var: UVar | str, callback: Callable[..., Any]) -> None:
        """Call ``callback`` after each write of a variable (UNotifyChange).  The variable may be any device's; it is
        given itself or by name.
        """
        found = self.var(var) if isinstance(var, str) else var
        owner = self.variables.get(found.name) is found

        def hook() -> None:
            self._hooks.append((found, found.notify_change(callback, owner=owner)))
            self.host.notified(self, found)

        self.host.registry.call(hook)

    def notify_access(self, var: UVar | str, callback: Callable[..., Any]) -> None:
        """Call ``callback`` before each read of a variable (UNotifyAccess).  In a remote process, where reads cannot be
        observed, ``callback`` is called every ``System.period``."""
        found = self.var(var) if isinstance(var, str) else var

        def hook() -> None:
            self._hooks.append((found, found.notify_access(callback)))
            self.host.access_notified(self, found)

        self.host.registry.call(hook)

    def at_event(self, which: UEvent | str, begun: Handler | None, ended: Handler | None = None) -> None:
        """Call ``begun(*payload)`` when an event begins and ``ended(*payload)`` when it ends.  The event is given
        itself or by name.
        """
        found = self.host.event(which) if isinstance(which, str) else which

        def listen() -> None:
            self._listeners.append((found, found.listen(begun, ended)))
            self.host.listened(self, found, begun or ended)

        self.host.registry.call(listen)

    # ---------------------------------------------------------------- timers

    def set_timer(self, period: float, callback: Callable[[], Any]) -> int:
        """Call ``callback`` every ``period`` seconds, before a pass of urbiscript (USetTimer); 0 selects
        ``System.period``.

        Returns the handle for ``remove_timer``.
        """
        return self.host.registry.call(lambda: self._timers.add(period, callback))

    def remove_timer(self, handle: int) -> None:
        """Remove a timer; a second call has no effect."""
        self.host.registry.call(lambda: self._timers.remove(handle))

    def set_update(self, period: float) -> None:
        """Call ``update`` every ``period`` seconds, after a pass of urbiscript (USetUpdate); a negative one ends it."""
        self.host.registry.call(lambda: self._timers.set_update(period, self.update))

    def update(self) -> Any:
        """Called periodically after ``set_update``.  Override."""

    # ---------------------------------------------------------------- life

    def on_connected(self) -> None:
        """Called when the server is connected (again); only in a remote process.  Override."""

    def on_disconnected(self) -> None:
        """Called when the connection to the server is lost; only in a remote process.  Override."""

    def destroy(self) -> None:
        """Destroy this instance: its timers, its callbacks on other variables, its slot in ``uobjects``.  A second call
        has no effect.
        """
        self.host.registry.call(self._destroy)

    def _destroy(self) -> None:
        self._timers.clear()
        for var, callback in self._hooks:
            if self.variables.get(var.name) is not var:
                var.unnotify(callback)
        for heard, listener in self._listeners:
            heard.remove_listener(listener)
        for hub in self._hubs:
            if self in hub.members:
                hub.members.remove(self)
        self._hooks, self._listeners, self._hubs = [], [], []
        self.host.destroyed(self)


class UObjectHub(UObject):
    """A device that acts for a group of devices: one instance per hub class, whose ``update`` runs after those of the
    devices.
    """

    def __init__(self, host: Host, face: UObjectFace) -> None:
        self.members: list[UObject] = []
        super().__init__(host, face)


def install_functions(world: World, kind: type[UObject], face: UObjectFace) -> None:
    """Store the bound methods of a class and its parts as slots of its urbiscript prototype."""
    for urbi, bound in bound_functions(kind).items():
        face.slots[urbi] = class_function(world, urbi, bound)
        unit = kind.describe_slot(urbi)[1]
        if unit:
            # A function without arguments that tells a number: ``help`` calls it.
            meta_of(face, urbi).properties = {"unit": to_urbi(world, unit)}
