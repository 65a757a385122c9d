"""Arguments of bound functions and callbacks: urbiscript values to the types that annotations ask for.

``float``, ``int``, ``str``, ``bool`` (anything, by its truth), ``bytes`` (a Binary or a String), ``list``, ``list[T]``,
``dict``, ``dict[str, T]``, ``tuple``, ``UBinary``, ``UImage``, ``USound``, ``UVar`` (itself, or the name of one),
``UObject`` and classes of devices, ``T | None``, ``Any`` or nothing (whatever it is, as a Python value); any other name
is that of a class of the runtime.  What does not fit is ``unexpected VALUE for argument N, expected a TYPE``.
"""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Union

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Nil, Obj, Void
from urbihw.kernel.runtime.values import Dictionary, FloatObject, List, String, Tuple
from urbihw.kernel.uobject.binary import UBinary, UImage, USound, make_binary
from urbihw.kernel.uobject.uvalue import Device, from_urbi

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Convert = Callable[[Any, int | None], Any]
"""Given an urbiscript value and the number of the argument, the Python value."""


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of a function by parameter; text where they cannot be resolved."""
    plain = inspect.unwrap(function)
    plain = plain.func if isinstance(plain, functools.partial) else plain
    try:
        return typing.get_type_hints(plain)
    except Exception:
        return dict(getattr(plain, "__annotations__", {}))


def wrong(world: World, index: int | None, value: Any, expected: str) -> errors.UrbiError:
    """``unexpected VALUE for argument INDEX, expected a TYPE``; of a Binary only the header is shown."""
    if not isinstance(value, BinaryObject):
        return world.type_error(index, value, expected)
    where = "" if index is None else f" for argument {index}"
    head = f"BIN {len(value.content)} {value.keywords}".rstrip()
    article = "an" if expected[:1] in "AEIOU" else "a"
    return errors.Raised("ArgumentType", f"unexpected {head}{where}, expected {article} {expected}")


def converter(world: World, wanted: Any) -> Convert:
    """What converts to a type, given as a class, a generic or a text."""
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
        return _instance(world, Tuple, "Tuple", from_urbi)
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
    if issubclass(wanted, Device):
        return _device(world, wanted)
    return _by_name(world, wanted.__name__)


def _simple(world: World) -> dict[type, Convert]:
    def to_float(value: Any, index: int | None) -> float:
        if value.__class__ is float:
            return float(value)
        if isinstance(value, FloatObject):
            return value.value
        raise wrong(world, index, value, "Float")

    def to_int(value: Any, index: int | None) -> int:
        number = to_float(value, index)
        if number - number != 0 or number != int(number):
            raise errors.bad_number("BadInteger", f"expected integer, got {world.text(value)}")
        return int(number)

    def to_str(value: Any, index: int | None) -> str:
        if not isinstance(value, String):
            raise wrong(world, index, value, "String")
        return value.s

    def to_bytes(value: Any, index: int | None) -> bytes:
        if isinstance(value, BinaryObject):
            return bytes(value.content)
        if isinstance(value, String):
            return value.s.encode("latin-1", "replace")
        raise wrong(world, index, value, "Binary")

    return {float: to_float, int: to_int, str: to_str, bytes: to_bytes, bool: lambda value, index: bool(value)}


def _optional(world: World, inner: tuple[Any, ...]) -> Convert:
    choices = [converter(world, one) for one in inner if one is not type(None)]

    def convert(value: Any, index: int | None) -> Any:
        if len(choices) < len(inner) and isinstance(value, Nil | Void):
            return None
        for choice in choices[:-1]:
            try:
                return choice(value, index)
            except errors.UrbiError:
                continue
        return choices[-1](value, index)

    return convert


def _list(world: World, member: Convert | None) -> Convert:
    def convert(value: Any, index: int | None) -> Any:
        if not isinstance(value, List):
            raise wrong(world, index, value, "List")
        if member is None:
            return from_urbi(value)
        return [member(one, index) for one in value.l]

    return convert


def _dict(world: World, member: Convert | None) -> Convert:
    def convert(value: Any, index: int | None) -> Any:
        if not isinstance(value, Dictionary):
            raise wrong(world, index, value, "Dictionary")
        if member is None:
            return from_urbi(value)
        return {key: member(one, index) for key, one in value.d.items()}

    return convert


def _instance(world: World, kind: type, name: str, give: Callable[[Any], Any]) -> Convert:
    def convert(value: Any, index: int | None) -> Any:
        if not isinstance(value, kind):
            raise wrong(world, index, value, name)
        return give(value)

    return convert


def _binary(world: World, wanted: type[UBinary]) -> Convert:
    name = {UImage: "Binary with an image", USound: "Binary with a sound"}.get(wanted, "Binary")

    def convert(value: Any, index: int | None) -> Any:
        made = make_binary(value.content, value.keywords) if isinstance(value, BinaryObject) else None
        if not isinstance(made, wanted):
            raise wrong(world, index, value, name)
        return made

    return convert


def _uvar(world: World) -> Convert:
    def convert(value: Any, index: int | None) -> Any:
        found: Any = world.uobjects.var(value.s) if isinstance(value, String) else value
        if type(found).__name__ != "UVar":
            raise wrong(world, index, value, "UVar")
        return found

    return convert


def _device(world: World, wanted: type) -> Convert:
    def convert(value: Any, index: int | None) -> Any:
        face = world.uobjects.object(value.s) if isinstance(value, String) else value
        python = getattr(face, "python", None)
        if isinstance(python, wanted):
            return python
        if wanted.__name__ == "UObject" and isinstance(face, Obj) and not isinstance(face, String):
            return face
        raise wrong(world, index, value, wanted.__name__)

    return convert


def _by_name(world: World, name: str) -> Convert:
    """By the name of an annotation that cannot be resolved, or of a class of the runtime."""
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

    def convert(value: Any, index: int | None) -> Any:
        python = getattr(value, "python", None)
        for one in (python, value):
            if any(kind.__name__ == plain for kind in type(one).__mro__):
                return one
        raise wrong(world, index, value, plain.removesuffix("Object"))

    return convert
