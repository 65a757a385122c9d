"""Dictionary: values with String keys.  Iteration is in the order of the keys.

Source: manual, specs/dictionary.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Plain
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Forms, Table
from urbihw.kernel.runtime.values import Dictionary, List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.exception import init_key_error
from urbihw.kernel.stdlib.members import equal, same_members
from urbihw.kernel.stdlib.slices import NestedWalk, in_slices, sort_in_slices
from urbihw.kernel.stdlib.tuple import pair
from urbihw.kernel.value import Value

__breakable__ = True

TABLE = Table("Dictionary")
PROTOS = {
    "Dictionary": ("Comparable", "Container", "RangeIterable", "Object"),
    "Dictionary.KeyError": ("Exception.KeyError",),
}

NOTES = {
    "Dictionary.KeyError": "Exception.KeyError, thrown when a key does not exist; its slot `key` is the key.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def _dict(world: World, value: Value) -> dict[str, Any]:
    if not isinstance(value, Dictionary):
        raise world.type_error(None, value, "Dictionary")
    return value.d


def _key(world: World, value: Value) -> str:
    return world.checks.to_str(value, 1)


def missing(world: World, key: Value) -> errors.ThrownError:
    """The error ``missing key: K``, an object with the slot ``key``."""
    error = Plain(world, [world.classes["Dictionary.KeyError"]])
    init_key_error(world, error, world.from_python(key))
    return errors.ThrownError(error)


@TABLE.primitive("init")
def init(world: World, this: Dictionary, *args: Value) -> Value:
    """Map each odd argument, a String, to the argument after it; returns this dictionary."""
    if len(args) % 2:
        raise errors.primitive(f"expected an even number of arguments, given {len(args)}")
    for key, value in zip(args[::2], args[1::2], strict=True):
        this.d[_key(world, key)] = value
    this.touch()
    return this


# ---------------------------------------------------------------- one key


@TABLE.raw("[]", "get", least=1)
def get(world: World) -> Any:
    """The value of a key.  Raises Dictionary.KeyError if there is none."""

    def run(this: Value, key: Value) -> Value:
        value = _dict(world, this).get(key if key.__class__ is str else _key(world, key))
        if value is None:
            raise missing(world, key)
        return value

    return Forms(run, one=run, takes_text=True)


@TABLE.primitive("getWithDefault")
def get_with_default(world: World, this: Dictionary, key: Value, default: Value) -> Value:
    """The value of a key, or the default value if there is none."""
    return this.d.get(_key(world, key), default)


@TABLE.raw("[]=", least=2)
def set_item(world: World) -> Any:
    """Map a key to a value; returns the value."""

    def run(this: Value, key: Value, value: Value) -> Value:
        content = this.d if this.__class__ is Dictionary else _dict(world, this)
        content[key if key.__class__ is str else _key(world, key)] = value
        if this.meta is not None:
            this.touch()
        return value

    return Forms(run, two=run, takes_text=True)


@TABLE.primitive("set")
def set_(world: World, this: Dictionary, key: Value, value: Value) -> Value:
    """Map a key to a value; returns this dictionary."""
    this.d[_key(world, key)] = value
    this.touch()
    return this


@TABLE.primitive("erase")
def erase(world: World, this: Dictionary, key: Value) -> Value:
    """Remove a key; returns this dictionary.  Raises Dictionary.KeyError if there is none."""
    if _key(world, key) not in this.d:
        raise missing(world, key)
    del this.d[_key(world, key)]
    this.touch()
    return this


@TABLE.primitive("has")
def has(world: World, this: Dictionary, key: Value) -> bool:
    """Whether a key has a value."""
    return _key(world, key) in this.d


@TABLE.primitive("hasNot")
def has_not(world: World, this: Dictionary, key: Value) -> bool:
    """Whether a key has no value."""
    return _key(world, key) not in this.d


# ---------------------------------------------------------------- the whole


@TABLE.raw("size", least=0)
def size(world: World) -> Any:
    """The number of keys."""

    def run(this: Value) -> float:
        return float(len(_dict(world, this)))

    return run


@TABLE.primitive("empty")
def empty(world: World, this: Dictionary) -> bool:
    """Whether the dictionary is empty."""
    return not this.d


@TABLE.primitive("asBool")
def as_bool(world: World, this: Dictionary) -> bool:
    """Whether the dictionary is not empty."""
    return bool(this.d)


@TABLE.primitive("clear")
def clear(world: World, this: Dictionary) -> Value:
    """Remove all keys; returns this dictionary."""
    this.d.clear()
    this.touch()
    return this


@TABLE.primitive("keys")
def keys(world: World, this: Dictionary) -> Value:
    """The keys, in order."""
    return world.new_list([world.string(key) for key in in_slices(world, _ordered(world, this.d))])


@TABLE.primitive("asList")
def as_list(world: World, this: Dictionary) -> Value:
    """The list of Pairs (key, value), in the order of the keys."""
    return _pairs(world, this)


def _pairs(world: World, this: Dictionary) -> List:
    now = dict(this.d)
    keys = in_slices(world, _ordered(world, now))
    return world.new_list([pair(world, world.string(key), now[key]) for key in keys])


def _ordered(world: World, content: dict[str, Value]) -> list[str]:
    """The keys, in order."""
    return sort_in_slices(world, list(content))


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: Dictionary) -> str:
    """The dictionary as a literal; ``[...]`` for a dictionary within itself."""
    now = dict(this.d)
    with NestedWalk(world, this) as walk:
        if walk.inside:
            return "[...]"
        keys = walk.members(_ordered(world, now))
        content = ", ".join([f"{escaped(key)} => {world.printable(now[key])}" for key in keys])
    return f"[{content or ' => '}]"


@TABLE.primitive("==")
def equals(world: World, this: Dictionary, other: Value) -> bool:
    """Whether the other dictionary has the same keys with equal values (or is the list that ``asList`` returns)."""
    return _equal(world, this, other)


@TABLE.primitive("!=")
def differs(world: World, this: Dictionary, other: Value) -> bool:
    """``!(this == other)``."""
    return not _equal(world, this, other)


def _equal(world: World, this: Dictionary, other: Value) -> bool:
    if isinstance(other, List):
        return same_members(world, _pairs(world, this).l, other.l)
    if not isinstance(other, Dictionary) or len(this.d) != len(other.d):
        return False
    mine, others = dict(this.d), dict(other.d)
    if not all(key in others for key in in_slices(world, list(mine))):
        return False
    with NestedWalk(world) as walk:
        return all(equal(world, mine[key], others[key]) for key in walk.members(_ordered(world, mine)))


@TABLE.primitive("matchAgainst")
def match_against(world: World, this: Dictionary, handler: Value, pattern: Any) -> bool:
    """Whether a pattern (a Dictionary with some of the keys) matches; its values are compared by the handler's
    ``matchPattern``."""
    if not isinstance(pattern, Dictionary):
        return False
    mine, wanted = dict(this.d), dict(pattern.d)
    if not all(key in mine for key in in_slices(world, list(wanted))):
        return False
    keys = in_slices(world, _ordered(world, wanted))
    return all(bool(world.send(handler, "matchPattern", wanted[key], mine[key])) for key in keys)
