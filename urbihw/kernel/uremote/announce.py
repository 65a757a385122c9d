"""Announcements of a remote: its classes, instances, variables, functions and events, as urbiscript statements.

Source: remote UObject protocol, sections 3 and 11; ``own`` and ``arity`` exist only in this server.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from urbihw.kernel.uobject.functions import arity, bound_functions

if TYPE_CHECKING:
    from urbihw.kernel.uobject.uobject import UObject

MAX_ARGUMENTS = 7
"""Maximum number of arguments of a subscribed event."""


def class_lines(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    """The statements that declare a class, in order."""
    yield f"class {name}{{}}"
    yield f"external object {name}"
    yield from _functions(name, kind, extended)
    yield from init_lines(name, kind, extended)


def instance_lines(name: str, device: UObject, extended: bool) -> Iterator[str]:
    """The statements that declare an instance, without its values and its ``init``."""
    yield f"class {name}{{}}"
    yield f"external object {name}"
    for slot, var in device.variables.items():
        yield from var_lines(name, slot, name, extended and var.owned, extended and not var.writable)
    for slot in device.events:
        yield event_line(name, slot)
    yield from _functions(name, type(device), extended)


def var_lines(name: str, slot: str, source: str, owned: bool, protected: bool) -> Iterator[str]:
    """The declaration of a variable whose changes are to be notified."""
    yield f"if (!isdef({name}.{slot})) var {name}.{slot}"
    yield f"external var {name}.{slot} from {source}"
    if owned:
        yield f'{name}.getSlot("{slot}").own'
    if protected:
        yield f'{name}.getSlot("{slot}").protect'


def event_line(name: str, slot: str) -> str:
    """The declaration of an event, which is made if it does not exist."""
    return f"try{{var {name}.{slot} = Event.new()}} catch(var e) {{}}"


def function_lines(name: str, slot: str, method: Callable[..., Any], extended: bool) -> Iterator[str]:
    """The declaration of a function; a server that supports only one number of arguments gets the minimum."""
    least, most = arity(method)
    yield f"external function ({least}) {name}.{slot} from {name}"
    if extended and least != most:
        yield f'UObject.arity("{name}.{slot}", {least}, {most})'


def init_lines(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    """The declaration of ``init``, which comes last: for the server, the object is complete then."""
    yield from function_lines(name, "init", _bound(kind.init), extended)


def _functions(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    for urbi, bound in bound_functions(kind).items():
        if urbi != "init":
            yield from function_lines(name, urbi, _bound(bound.method), extended)


def _bound(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method without its ``self`` parameter."""

    def stand_in(*args: Any) -> None: ...

    parameters = list(inspect.signature(method).parameters.values())[1:]
    stand_in.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return stand_in


def arities(handler: Callable[..., Any]) -> range:
    """The numbers of arguments that a handler of an event accepts."""
    least, most = arity(handler)
    return range(least, (MAX_ARGUMENTS if most < 0 else most) + 1)
