"""Structural pattern matching: a pattern is a small tuple built by generated code.

``("bind",)`` matches any value; ``("value", v)`` a value equal to v, or one that ``v.match`` or its own
``matchAgainst`` accepts, where a class defines these; ``("list", patterns)`` and ``("tuple", patterns)``
that container with as many members; ``("dict", [(key, pattern), ...])`` a dictionary with at least these keys.  A match
gives the bound values in the order of their bindings in the source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def match(world: World, pattern: tuple[Any, ...], value: Value) -> list[Any] | None:
    """The values bound by matching ``value`` against ``pattern``, or None when it does not match."""
    bound: list[Any] = []
    return bound if _match(world, pattern, value, bound) else None


def match_payload(world: World, patterns: list[tuple[Any, ...]], payload: list[Value]) -> list[Any] | None:
    """Match an event's payload: as many values as patterns."""
    return _match_all(world, patterns, payload, [])


def _match_all(
    world: World, patterns: list[tuple[Any, ...]], values: list[Value], bound: list[Value]
) -> list[Any] | None:
    if len(patterns) != len(values):
        return None
    for pattern, value in zip(patterns, values, strict=True):
        if pattern[0] == "bind":  # the most frequent case
            bound.append(value)
        elif not _match(world, pattern, value, bound):
            return None
    return bound


def _match(world: World, pattern: tuple[Any, ...], value: Value, bound: list[Value]) -> bool:
    kind = pattern[0]
    if kind == "bind":
        bound.append(value)
        return True
    if kind == "value":
        return _match_value(world, pattern[1], value)
    if kind == "dict":
        if not isinstance(value, Dictionary):
            return False
        for key, inner in pattern[1]:
            name = key.s if isinstance(key, String) else world.text(key)
            if name not in value.d or not _match(world, inner, value.d[name], bound):
                return False
        return True
    wanted = List if kind == "list" else Tuple
    if not isinstance(value, wanted):
        return False
    return _match_all(world, pattern[1], value.l, bound) is not None


def _match_value(world: World, wanted: Value, value: Value) -> bool:
    if (wanted.__class__ not in _LITERALS and decides(world, wanted, "match")
            or value.__class__ not in _LITERALS and decides(world, value, "matchAgainst")):
        handler = world.send(world.classes["Pattern"], "new", wanted)
        return bool(world.send(handler, "matchPattern", wanted, value))
    return bool(world.ops.equal(wanted, value))


def decides(world: World, value: Value, name: str) -> bool:
    """Whether a value has a function for patterns: one that takes two arguments, the handler and the other part.  The
    ``match`` of a Regexp takes only a text."""
    holder = world.peek_obj(value).find(name)
    found = None if holder is None else holder.slots[name]
    return isinstance(found, Executable) and found.takes(2)


_LITERALS = (float, String, List, Tuple, Dictionary)
"""The classes of the values that are compared, though they have a ``matchAgainst`` for Pattern."""
