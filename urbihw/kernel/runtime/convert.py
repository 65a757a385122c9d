"""Conversion between Python values and urbiscript values.

==============  =========================
Python          urbiscript
==============  =========================
None            void (nil, on the way back, is None too)
bool            true, false
int, float      Float
str, bytes      String (one character per byte)
list            List
tuple           Tuple
dict            Dictionary (keys become strings)
==============  =========================

Other urbiscript objects are not converted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from urbihw.kernel.runtime.object import Nil, Obj, Truth, Void
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def from_python(world: World, value: Value) -> Value:
    """The urbiscript value for a Python one; raises TypeError if there is none."""
    if value.__class__ is float or isinstance(value, Obj):
        return value
    if value is None:
        return world.void
    if isinstance(value, bool):
        return world.boolean(value)
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, str):
        return world.string(value)
    if isinstance(value, bytes | bytearray):
        return world.string(value.decode("latin-1"))
    if isinstance(value, list):
        return world.new_list([from_python(world, member) for member in value])
    if isinstance(value, tuple):
        return world.new_tuple([from_python(world, member) for member in value])
    if isinstance(value, dict):
        return world.dictionary({str(key): from_python(world, member) for key, member in value.items()})
    raise TypeError(f"no urbiscript value for a Python {type(value).__name__}")


def to_python(value: Value) -> Value:
    """The Python value for an urbiscript one; objects without a Python equivalent stay as they are."""
    if isinstance(value, String):
        return value.s
    if isinstance(value, Truth):
        return value.value
    if isinstance(value, Void | Nil):
        return None
    if isinstance(value, List):
        return [to_python(member) for member in value.l]
    if isinstance(value, Tuple):
        return tuple(to_python(member) for member in value.l)
    if isinstance(value, Dictionary):
        return {key: to_python(member) for key, member in value.d.items()}
    return value
