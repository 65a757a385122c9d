"""The base class of devices: binds Python attributes to urbiscript slots, methods to urbiscript functions.

In the manual's words: ``variable()`` is UBindVar, ``owned()`` is UBindVar and UOwned (and ``reading()`` is an owned one
that nobody else may write), ``@function`` is UBindFunction,
``event()`` is UBindEvent, ``notify_change`` is UNotifyChange, ``set_update`` is USetUpdate, ``set_timer`` is
USetTimer.  Periods are in seconds.  All callbacks run in the kernel's thread; a callback must not block.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, overload

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Row, build
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.host import Host

F = TypeVar("F", bound=Callable[..., Any])


class _Bound:
    """A class attribute that becomes a slot of each instance."""

    def __init__(self) -> None:
        self.slot = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.slot = self.slot or name


class variable(_Bound):  # noqa: N801 - reads as a declaration
    """A bound variable (UBindVar) with an initial value; on an instance, its UVar."""

    owned = False
    writable = True

    def __init__(self, value: Any = None, name: str = "") -> None:
        super().__init__()
        self.initial = value
        self.slot = name

    @overload
    def __get__(self, instance: None, owner: type) -> variable: ...

    @overload
    def __get__(self, instance: UObject, owner: type) -> UVar: ...

    def __get__(self, instance: UObject | None, owner: type) -> UVar | variable:
        return self if instance is None else instance.variables[self.slot]


class owned(variable):  # noqa: N801
    """An owned variable (UOwned): a target written by urbiscript, a value sensed by the device."""

    owned = True


class reading(owned):  # noqa: N801
    """A bound variable that only the device writes; urbiscript that assigns it is told so."""

    writable = False


class event(_Bound):  # noqa: N801
    """A bound event (UBindEvent); on an instance, its UEvent."""

    def __init__(self, name: str = "") -> None:
        super().__init__()
        self.slot = name

    @overload
    def __get__(self, instance: None, owner: type) -> event: ...

    @overload
    def __get__(self, instance: UObject, owner: type) -> UEvent: ...

    def __get__(self, instance: UObject | None, owner: type) -> UEvent | event:
        return self if instance is None else instance.events[self.slot]


@overload
def function(method: str) -> Callable[[F], F]: ...


@overload
def function(method: F) -> F: ...


def function(method: F | str) -> F | Callable[[F], F]:
    """Bind a method (UBindFunction), under its own name or ``@function("name")``; annotations give the conversions.

    A ValueError that it raises is an error in urbiscript, with the same words.
    """
    if isinstance(method, str):
        name = method

        def named(inner: F) -> F:
            inner.__urbi_name__ = name  # type: ignore[attr-defined]
            return inner

        return named
    method.__urbi_name__ = method.__name__  # type: ignore[attr-defined]
    return method


class UEvent:
    """An event of a device."""

    def __init__(self, world: World, face: Event) -> None:
        self._world = world
        self._face = face

    def emit(self, *payload: Any) -> None:
        """Emit the event with a payload of Python values and devices; handlers run as jobs."""
        values = [self._world.from_python(value.face if isinstance(value, UObject) else value) for value in payload]

        def emit() -> None:
            self._face.emit(values)

        self._world.soon(emit)


class UObjectFace(Obj):
    """How urbiscript sees a device: the object whose slots are bound."""

    __slots__ = ("host", "kind", "python")

    def __init__(self, world: World, protos: list[Obj], host: Host, kind: type[UObject]) -> None:
        super().__init__(world, protos)
        self.host = host
        self.kind = kind
        self.python: UObject | None = None

    def clone(self) -> UObjectFace:
        """A new instance, in both worlds; ``new`` then calls ``init``."""
        made = UObjectFace(self.world, [self], self.host, self.kind)
        made.python = self.kind(self.host, made)
        return made


class UObject:
    """Base of all devices.  Derive, declare, and write ``init``; do not override ``__init__``."""

    uname: ClassVar[str] = ""
    """The name of the urbiscript class; the Python name if empty."""

    def __init__(self, host: Host, face: UObjectFace) -> None:
        self.host = host
        self.face = face
        self.variables: dict[str, UVar] = {}
        self.events: dict[str, UEvent] = {}
        self._timers: dict[int, Timer] = {}
        self._timer_count = 0
        self._update: int | None = None
        for declared in bound_attributes(type(self)):
            if isinstance(declared, variable):
                self.bind_var(declared.slot, declared.initial, owned=declared.owned, writable=declared.writable)
            elif isinstance(declared, event):
                self.bind_event(declared.slot)

    # ---------------------------------------------------------------- binding

    def bind_var(self, name: str, value: Any = None, *, owned: bool = False, writable: bool = True) -> UVar:
        """Bind one more variable of this instance (UBindVar, UOwned); not ``writable``: see ``reading``."""
        made = UVar(self.host.world, self.face, name, owned=owned, value=value)
        if not writable:
            made.notify_change(_refuse, owner=True)
        self.variables[name] = made
        return made

    def bind_event(self, name: str) -> UEvent:
        """Bind one more event of this instance (UBindEvent)."""
        world = self.host.world
        face = Event(world, [world.event_proto])
        world.ops.put(self.face, name, face)
        made = self.events[name] = UEvent(world, face)
        return made

    def put_slot(self, name: str, value: Any) -> None:
        """Make a plain slot of this instance, holding a Python value or another device."""
        world = self.host.world
        world.ops.put(self.face, name, value.face if isinstance(value, UObject) else world.from_python(value))

    def init(self, *args: Any, **named: Any) -> Any:
        """Called by ``new`` with its arguments; override with the arguments you want."""

    # ---------------------------------------------------------------- notification

    def notify_change(self, var: UVar, callback: Callable[..., Any]) -> None:
        """Call ``callback`` after each write of a variable, one's own or another's (UNotifyChange)."""
        var.notify_change(callback, owner=self.variables.get(var.name) is var)

    def notify_access(self, var: UVar, callback: Callable[..., Any]) -> None:
        """Call ``callback`` before each read of a variable (UNotifyAccess)."""
        var.notify_access(callback)

    # ---------------------------------------------------------------- timers

    def set_timer(self, period: float, callback: Callable[[], Any]) -> int:
        """Call ``callback`` every ``period`` seconds; the handle for ``remove_timer`` (USetTimer)."""
        scheduler = self.host.world.scheduler
        self._timer_count += 1
        handle = self._timer_count

        def tick() -> None:
            due = self._timers[handle].deadline + period
            self._timers[handle] = scheduler.call_at(max(due, scheduler.clock.now()), tick)
            self.host.guarded(callback, f"timer of {type(self).__name__}")

        self._timers[handle] = scheduler.call_at(scheduler.clock.now() + period, tick)
        return handle

    def remove_timer(self, handle: int) -> None:
        """End a timer; harmless twice."""
        timer = self._timers.pop(handle, None)
        if timer is not None:
            timer.cancel()

    def set_update(self, period: float) -> None:
        """Call ``update`` every ``period`` seconds; a negative period ends it (USetUpdate)."""
        if self._update is not None:
            self.remove_timer(self._update)
            self._update = None
        if period >= 0:
            self._update = self.set_timer(period, self.update)

    def update(self) -> None:
        """Called periodically once ``set_update`` was; override."""

    def destroy(self) -> None:
        """End the timers of this instance."""
        for handle in list(self._timers):
            self.remove_timer(handle)


def _refuse() -> None:
    raise ValueError("this slot can only be read")


def bound_attributes(kind: type[UObject]) -> list[_Bound]:
    """The declarations of a class and its bases, bases first."""
    found: dict[str, _Bound] = {}
    for base in reversed(kind.__mro__):
        for name, value in vars(base).items():
            if isinstance(value, _Bound):
                found[name] = value
    return list(found.values())


def bound_functions(kind: type[UObject]) -> dict[str, str]:
    """urbiscript name to Python name of the bound methods; ``init`` is always bound."""
    names = {"init": "init"}
    for python, value in inspect.getmembers(kind, inspect.isfunction):
        urbi = getattr(value, "__urbi_name__", None)
        if urbi is not None:
            names[urbi] = python
    return names


def install_functions(world: World, kind: type[UObject], face: UObjectFace) -> None:
    """Make the bound methods of a class slots of its urbiscript prototype."""
    for urbi, python in bound_functions(kind).items():
        face.slots[urbi] = build(world, urbi, Row((urbi,), _caller(getattr(kind, python), python), "checked", 0, 0))


def _caller(method: Callable[..., Any], python: str) -> Callable[..., Any]:
    """``fn(world, this, *args)`` for a method, with the signature that ``primitive`` reads its checks from."""

    def run(world: Any, this: Any, *args: Any) -> Any:
        try:
            result = getattr(this.python, python)(*args)
        except ValueError as refusal:
            raise errors.primitive(str(refusal)) from refusal
        if isinstance(result, UObject):
            return result.face
        if isinstance(result, list):
            return [member.face if isinstance(member, UObject) else member for member in result]
        return result

    parameters = list(inspect.signature(method).parameters.values())[1:]
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    head = [inspect.Parameter("world", kind), inspect.Parameter("this", kind, annotation="UObjectFace")]
    typed = [parameter.replace(annotation=_type_name(parameter.annotation)) for parameter in parameters]
    run.__signature__ = inspect.Signature([*head, *typed])  # type: ignore[attr-defined]
    return run


def _type_name(annotation: Any) -> str:
    if annotation is inspect.Parameter.empty:
        return "Any"
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
