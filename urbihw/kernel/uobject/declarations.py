"""Declarations in a device class: its variables, events and functions.

In the manual's words: ``variable()`` is UBindVar, ``owned()`` is UBindVar and UOwned (and ``reading()`` is an owned one
that only the device may write), ``event()`` is UBindEvent, ``@function`` is UBindFunction, ``@threaded`` is
UBindThreadedFunction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, overload

from urbihw.kernel.uobject.part import DevicePart, declaring_classes
from urbihw.kernel.uobject.threads import Lock

if TYPE_CHECKING:
    from urbihw.kernel.uobject.uevent import UEvent
    from urbihw.kernel.uobject.uobject import UObject
    from urbihw.kernel.uobject.uvar import UVar

F = TypeVar("F", bound=Callable[..., Any])


class BoundAttribute:
    """A class attribute that becomes a slot of each instance; in a part, a slot of its device."""

    def __init__(self) -> None:
        self.slot = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.slot = self.slot or name


class variable(BoundAttribute):
    """A bound variable (UBindVar) with an initial value; on an instance, the attribute is its UVar."""

    owned = False
    writable = True

    def __init__(self, value: Any = None, name: str = "") -> None:
        super().__init__()
        self.initial = value
        self.slot = name

    @overload
    def __get__(self, instance: None, owner: type) -> variable: ...

    @overload
    def __get__(self, instance: UObject | DevicePart, owner: type) -> UVar: ...

    def __get__(self, instance: UObject | DevicePart | None, owner: type) -> UVar | variable:
        return self if instance is None else instance.variables[self.slot]


class owned(variable):
    """An owned variable (UOwned): urbiscript writes its target, the device reports its sensed value."""

    owned = True


class reading(owned):
    """A bound variable that only the device writes; an assignment from urbiscript raises an error."""

    writable = False


class event(BoundAttribute):
    """A bound event (UBindEvent); on an instance, the attribute is its UEvent."""

    def __init__(self, name: str = "") -> None:
        super().__init__()
        self.slot = name

    @overload
    def __get__(self, instance: None, owner: type) -> event: ...

    @overload
    def __get__(self, instance: UObject | DevicePart, owner: type) -> UEvent: ...

    def __get__(self, instance: UObject | DevicePart | None, owner: type) -> UEvent | event:
        return self if instance is None else instance.events[self.slot]


@overload
def function(method: str) -> Callable[[F], F]: ...


@overload
def function(method: F) -> F: ...


def function(method: F | str) -> F | Callable[[F], F]:
    """Bind a method (UBindFunction) under its own name or, with ``@function("name")``, under another.  The annotations
    determine the conversions of the arguments (see ``convert``).

    A ValueError raised by the method becomes an urbiscript error with the same message.
    """
    if isinstance(method, str):
        name = method

        def named(inner: F) -> F:
            inner.__urbi_name__ = name  # type: ignore[attr-defined]
            return inner

        return named
    method.__urbi_name__ = method.__name__  # type: ignore[attr-defined]
    return method


def threaded(lock: Lock = Lock.NONE, name: str = "") -> Callable[[F], F]:
    """Bind a method that runs in a thread while the calling job waits (UBindThreadedFunction).

    ``lock`` selects the functions that must not run at the same time; ``name`` is the urbiscript name.
    """

    def bind(method: F) -> F:
        method.__urbi_name__ = name or method.__name__  # type: ignore[attr-defined]
        method.__urbi_lock__ = lock  # type: ignore[attr-defined]
        return method

    return bind


def bound_attributes(kind: type[UObject]) -> list[BoundAttribute]:
    """The declarations of a class, its bases and its parts, base classes first."""
    found: dict[str, BoundAttribute] = {}
    for holder in declaring_classes(kind):
        for value in vars(holder).values():
            if isinstance(value, BoundAttribute):
                found[value.slot] = value
    return list(found.values())
