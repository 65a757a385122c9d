"""Conversion of values between device code and urbiscript: ``runtime.convert``, and binaries, devices, variables.

================================  =================================================
device code                       urbiscript
================================  =================================================
None, bool, number, str           void, Boolean, Float, String
NIL                               nil
list, tuple, dict                 List, Tuple, Dictionary, of these values
UBinary, UImage, USound           Binary
bytes                             String (one character per byte)
UObject                           the object whose slots it has (its ``face``)
UVar                              itself: ``camera.getSlot("val")``
================================  =================================================

Any other urbiscript object is passed unchanged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.convert import to_python
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.uobject.binary import UBinary, make_binary

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


class _Nil:
    """The type of ``NIL``."""

    __slots__ = ()


NIL: Final = _Nil()
"""The urbiscript nil, for a slot whose value the device can never know; None is void."""


class PythonDevice:
    """The Python object behind an urbiscript object; the base of UObject."""

    __slots__ = ()
    face: Obj


def to_urbi(world: World, value: Any, keep: bool = False) -> Any:
    """The urbiscript value of a Python value.  Raises TypeError if there is none.

    ``keep`` keeps a reference to the buffer of a binary instead of a copy.
    """
    if value.__class__ is float or isinstance(value, Obj):
        return value
    if isinstance(value, UBinary):
        content = value.data if keep or isinstance(value.data, bytes) else bytes(value.data)
        return BinaryObject(world, [world.classes["Binary"]], value.keywords, content)
    if isinstance(value, PythonDevice):
        return value.face
    if isinstance(value, list):
        return world.new_list([to_urbi(world, member) for member in value])
    if isinstance(value, tuple):
        return world.new_tuple([to_urbi(world, member) for member in value])
    if isinstance(value, dict):
        return world.dictionary({str(key): to_urbi(world, member) for key, member in value.items()})
    return world.nil if value is NIL else world.from_python(value)


def from_urbi(value: Any) -> Any:
    """The Python value of an urbiscript value."""
    if value.__class__ is float:
        return value
    if isinstance(value, String):
        return value.s
    if isinstance(value, BinaryObject):
        return make_binary(value.content, value.keywords)
    if isinstance(value, List):
        return [from_urbi(member) for member in value.l]
    if isinstance(value, Tuple):
        return tuple(from_urbi(member) for member in value.l)
    if isinstance(value, Dictionary):
        return {key: from_urbi(member) for key, member in value.d.items()}
    python = getattr(value, "python", None)
    return to_python(value) if python is None else python
