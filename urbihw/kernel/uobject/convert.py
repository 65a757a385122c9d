"""Conversion of arguments of bound functions and callbacks: urbiscript values to the annotated Python types.

Supported annotations: ``float``, ``int``, ``str``, ``bool`` (the truth of any value), ``bytes`` (a Binary or a String),
``list``, ``list[T]``, ``dict``, ``dict[str, T]``, ``tuple``, ``UBinary``, ``UImage``, ``USound``, ``UVar`` (a variable
or its name), ``UObject`` and device classes, ``T | None``, ``Any`` or no annotation (any value, converted to Python).
Any other name is that of a runtime class.  A value of another type raises ``unexpected VALUE for argument N, expected a
TYPE``.
"""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Union

from urbihw.kernel import errors
from urbihw.kernel.runtime.arguments import Check
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Nil, Obj, Void
from urbihw.kernel.runtime.values import Dictionary, String, Tuple
from urbihw.kernel.uobject.binary import UBinary, UImage, USound, make_binary
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import PythonDevice, from_urbi
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Convert = Check
"""A function of an urbiscript value and the number of the argument; it returns the Python value."""


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of a function, by parameter; an annotation that cannot be resolved stays a string."""
    plain = inspect.unwrap(function)
    plain = plain.func if isinstance(plain, functools.partial) else plain
    try:
        return typing.get_type_hints(plain)
    except Exception:
        return dict(getattr(plain, "__annotations__", {}))


def converter(world: World, wanted: Any) -> Convert:
    """The converter to a type, which is given as a class, a generic type or a string."""
    if isinstance(wanted, str):
        return _by_name(world, wanted)
    origin = typing.get_origin(wanted)
    inner = typing.get_args(wanted)
    if origin in (Union, types.UnionType):
        return _optional(world, inner)
    if origin is list or wanted is list:
        return _list(world, converter(world, inner[0]) if inner else None)
    if origin is dict or wanted is dict:
        return _dict(world, converter(world, inner[1]) if len(inner) > 1 else None)
    if origin is tuple or wanted is tuple:
        return _tuple(world)
    if wanted in (inspect.Parameter.empty, Any, object):
        return lambda value, index: from_urbi(value)
    if isinstance(wanted, type):
        return _class(world, wanted)
    return lambda value, index: from_urbi(value)


def _class(world: World, wanted: type) -> Convert:
    simple = _simple(world).get(wanted)
    if simple is not None:
        return simple
    if issubclass(wanted, UBinary):
        return _binary(world, wanted)
    if wanted.__name__ == "UVar":
        return _uvar(world)
    if issubclass(wanted, PythonDevice):
        return _device(world, wanted)
    return _by_name(world, wanted.__name__)


def _simple(world: World) -> dict[type, Convert]:
    """The converters to basic types that the library checks too, and to ``bytes``."""

    def to_bytes(value: Value, index: int | None) -> bytes:
        if isinstance(value, BinaryObject):
            return bytes(value.content)
        if isinstance(value, String):
            return value.s.encode("latin-1", "replace")
        raise world.type_error(index, value, "Binary")

    checks = world.checks
    return {
        float: checks.to_float, int: checks.to_int, str: checks.to_str, bool: checks.to_bool, bytes: to_bytes,
    }  # fmt: skip


def _optional(world: World, inner: tuple[Any, ...]) -> Convert:
    choices = [converter(world, one) for one in inner if one is not type(None)]

    def convert(value: Value, index: int | None) -> Value:
        if len(choices) < len(inner) and isinstance(value, Nil | Void):
            return None
        for choice in choices[:-1]:
            try:
                return choice(value, index)
            except errors.ThrownError:
                continue
        return choices[-1](value, index)

    return convert


def _list(world: World, member: Convert | None) -> Convert:
    check = world.checks.to_list

    def convert(value: Value, index: int | None) -> Value:
        members = check(value, index)
        return [from_urbi(one) if member is None else member(one, index) for one in members]

    return convert


def _dict(world: World, member: Convert | None) -> Convert:
    check = _check(world, Dictionary)

    def convert(value: Value, index: int | None) -> Value:
        members = check(value, index).d
        return {key: from_urbi(one) if member is None else member(one, index) for key, one in members.items()}

    return convert


def _tuple(world: World) -> Convert:
    check = _check(world, Tuple)
    return lambda value, index: from_urbi(check(value, index))


def _check(world: World, kind: type[Obj]) -> Check:
    check = world.checks.of(kind)
    assert check is not None
    return check


def _binary(world: World, wanted: type[UBinary]) -> Convert:
    name = {UImage: "Binary with an image", USound: "Binary with a sound"}.get(wanted, "Binary")

    def convert(value: Value, index: int | None) -> Value:
        made = make_binary(value.content, value.keywords) if isinstance(value, BinaryObject) else None
        if not isinstance(made, wanted):
            raise world.type_error(index, value, name)
        return made

    return convert


def _uvar(world: World) -> Convert:
    def convert(value: Value, index: int | None) -> Value:
        found: Any = registry_of(world).var(value.s) if isinstance(value, String) else value
        if type(found).__name__ != "UVar":
            raise world.type_error(index, value, "UVar")
        return found

    return convert


def _device(world: World, wanted: type) -> Convert:
    def convert(value: Value, index: int | None) -> Value:
        face = registry_of(world).object(value.s) if isinstance(value, String) else value
        python = getattr(face, "python", None)
        if isinstance(python, wanted):
            return python
        if wanted.__name__ == "UObject" and isinstance(face, Obj) and not isinstance(face, String):
            return face
        raise world.type_error(index, value, getattr(wanted, "uname", "") or wanted.__name__)

    return convert


def _by_name(world: World, name: str) -> Convert:
    """The converter for an annotation that cannot be resolved, or for the name of a runtime class."""
    kinds: dict[str, type] = {"float": float, "int": int, "str": str, "bool": bool, "bytes": bytes}
    plain = name.removesuffix(" | None")
    if plain in kinds:
        made = _simple(world)[kinds[plain]]
        return made if plain == name else lambda value, index: None if isinstance(value, Nil) else made(value, index)
    if plain.startswith("list"):
        return _list(world, None)
    if plain.startswith("dict"):
        return _dict(world, None)
    if plain in ("Any", "object", ""):
        return lambda value, index: from_urbi(value)

    def convert(value: Value, index: int | None) -> Value:
        python = getattr(value, "python", None)
        for one in (python, value):
            if any(kind.__name__ == plain for kind in type(one).__mro__):
                return one
        raise world.type_error(index, value, plain.removesuffix("Object"))

    return convert
