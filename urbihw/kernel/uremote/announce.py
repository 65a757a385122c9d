"""How a remote says what it has: classes, instances, variables, functions and events, as statements of urbiscript.

Source: remote UObject protocol, sections 3 and 11; ``own`` and ``arity`` are words of this server only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from urbihw.kernel.uobject.functions import arity, bound_functions

if TYPE_CHECKING:
    from urbihw.kernel.uobject.uobject import UObject

MOST_ARGUMENTS = 7
"""The greatest number of arguments of an event that is asked for."""


def class_lines(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    """The pieces of the chain that declares a class."""
    yield f"class {name}{{}}"
    yield f"external object {name}"
    yield from _functions(name, kind, extended)
    yield from init_lines(name, kind, extended)


def instance_lines(name: str, device: UObject, extended: bool) -> Iterator[str]:
    """The pieces of the chain that declares an instance, but its values and its ``init``."""
    yield f"class {name}{{}}"
    yield f"external object {name}"
    for slot, var in device.variables.items():
        yield from var_lines(name, slot, name, extended and var.owned, extended and not var.writable)
    for slot in device.events:
        yield event_line(name, slot)
    yield from _functions(name, type(device), extended)


def var_lines(name: str, slot: str, source: str, owned: bool, protected: bool) -> Iterator[str]:
    """A variable that is to be told of."""
    yield f"if (!isdef({name}.{slot})) var {name}.{slot}"
    yield f"external var {name}.{slot} from {source}"
    if owned:
        yield f'{name}.getSlot("{slot}").own'
    if protected:
        yield f'{name}.getSlot("{slot}").protect'


def event_line(name: str, slot: str) -> str:
    """An event, made if it is not there."""
    return f"try{{var {name}.{slot} = Event.new()}} catch(var e) {{}}"


def function_lines(name: str, slot: str, method: Callable[..., Any], extended: bool) -> Iterator[str]:
    """A function; where the server knows only one number of arguments, it is the least."""
    least, most = arity(method)
    yield f"external function ({least}) {name}.{slot} from {name}"
    if extended and least != most:
        yield f'UObject.arity("{name}.{slot}", {least}, {most})'


def init_lines(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    """``init``, which comes last: to the server that means that the object is complete."""
    yield from function_lines(name, "init", _bound(kind.init), extended)


def _functions(name: str, kind: type[UObject], extended: bool) -> Iterator[str]:
    names = bound_functions(kind)
    for urbi, python in names.items():
        if urbi != "init":
            yield from function_lines(name, urbi, _bound(getattr(kind, python)), extended)


def _bound(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method without its ``self``."""

    def stand_in(*args: Any) -> None: ...

    parameters = list(inspect.signature(method).parameters.values())[1:]
    stand_in.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return stand_in


def arities(handler: Callable[..., Any]) -> range:
    """The numbers of arguments that a handler of an event takes."""
    least, most = arity(handler)
    return range(least, (MOST_ARGUMENTS if most < 0 else most) + 1)
