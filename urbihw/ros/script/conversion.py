"""Messages of ROS as values of urbiscript, and back.

Texts of ROS are UTF-8; a String of urbiscript has one character for each byte.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.library import BinaryObject, Dictionary, List, String, Truth, Tuple, Value, World, errors

MAX_DEPTH: Final = 40


def value_of(world: World, said: Any) -> Value:
    """The value of a part of a message."""
    if isinstance(said, str):
        return world.string(said.encode("utf-8", "surrogateescape").decode("latin-1"))
    if isinstance(said, bytes):
        return BinaryObject(world, [world.classes["Binary"]], "", said)
    if isinstance(said, list):
        return world.new_list([value_of(world, each) for each in said])
    if isinstance(said, dict):
        return world.dictionary({str(key): value_of(world, each) for key, each in said.items()})
    return world.from_python(said)


def message_of(world: World, value: Value, place: str = "message", depth: int = 0) -> Any:
    """The part of a message that a value stands for.  Raises Exception.Primitive, with the place in the message."""
    if depth > MAX_DEPTH:
        raise errors.primitive(f"{place}: nests more than {MAX_DEPTH} deep, or contains itself")
    if value.__class__ is float:
        return value
    if isinstance(value, String):
        return value.s.encode("latin-1", "replace").decode("utf-8", "surrogateescape")
    if isinstance(value, Truth):
        return value.value
    if isinstance(value, BinaryObject):
        return bytes(value.content)
    if isinstance(value, List | Tuple):
        return [message_of(world, each, f"{place}[{i}]", depth + 1) for i, each in enumerate(value.l)]
    if isinstance(value, Dictionary):
        return {key: message_of(world, each, f'{place}["{key}"]', depth + 1) for key, each in value.d.items()}
    raise errors.primitive(f"{place}: a message holds numbers, strings, lists and dictionaries, not "
                           f"{world.printable(value)[:80]}")
