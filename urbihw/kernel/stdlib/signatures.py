"""System.signatureOf: the formal arguments of functions, for consoles and the reference.  Not in the manual."""

from __future__ import annotations

import inspect
from typing import Any

from urbihw.kernel.runtime.code import Code, LazyPrimitive, Primitive
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("System")


def arguments(function: Any) -> str:
    """The formal arguments of a function, in parentheses; nothing if there are none."""
    if isinstance(function, LazyPrimitive):
        names = ["expression..."] if function.most < 0 else ["expression"] * function.most
    elif isinstance(function, Primitive):
        names = [_parameter_text(parameter) for parameter in _parameters(function)]
    elif isinstance(function, Code):
        formals = function.info.node.formals
        names = ["argument..."] if formals is None else [_formal_text(one) for one in formals]
    else:
        names = []
    return f"({', '.join(names)})" if names else ""


def _parameters(function: Primitive) -> list[inspect.Parameter]:
    """Those of the Python function behind a built-in that stand for arguments."""
    method = getattr(function.source, "__urbi_method__", None)
    if method is not None:  # of a device
        return list(inspect.signature(method).parameters.values())
    whole = list(inspect.signature(function.source).parameters.values())
    if [parameter.name for parameter in whole] == ["world"]:  # a factory of the function that is called
        whole = list(inspect.signature(function.fn).parameters.values())
    return whole[2:] if whole[0].name == "world" else whole[1:]


def _parameter_text(parameter: inspect.Parameter) -> str:
    """``keepEmpty = false``, ``members...``, ``[end]`` where there is no default to name."""
    head, *rest = parameter.name.strip("_").split("_")
    name = head + "".join(word.capitalize() for word in rest)
    if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
        return f"{name}..."
    if parameter.default is inspect.Parameter.empty:
        return name
    if parameter.default is None:
        return f"[{name}]"
    return f"{name} = {_shown_default(parameter.default)}"


def _shown_default(value: Any) -> str:
    """A default value as urbiscript has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:g}" if isinstance(value, int | float) else "..."


def _formal_text(one: Any) -> str:
    """A formal argument of a function in urbiscript; one with a default in brackets."""
    if one.variadic:
        return f"{one.name}..."
    return one.name if one.default is None else f"[{one.name}]"


@TABLE.primitive("signatureOf")
def signature_of(world: World, this: Value, holder: Value, name: str) -> str:
    """The formal arguments of the function in a slot, such as ``(name, raw)``; "" if there are none, or no function."""
    obj = world.peek_obj(holder).find(name)
    return "" if obj is None else arguments(obj.slots[name])
