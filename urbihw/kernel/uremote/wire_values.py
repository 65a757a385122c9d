"""Conversion between values of a remote's own kernel and values in messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Obj, Truth
from urbihw.kernel.runtime.values import Dictionary, List, String, Tuple
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.frames import SlotName

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.uobject import UObject


def to_wire(value: Any) -> Any:
    """Convert an urbiscript value of this kernel for a message; devices are converted to their names."""
    if value.__class__ is float:
        return value
    if isinstance(value, UVar):
        return value.full_name
    if isinstance(value, List | Tuple):
        return [to_wire(member) for member in value.l]
    if isinstance(value, Dictionary):
        return {key: to_wire(member) for key, member in value.d.items()}
    if isinstance(value, Obj) and not isinstance(value, String | BinaryObject | Truth):
        name = value.slots.get("__uobjectName")
        if isinstance(name, String):
            return SlotName(name.s)
    plain = from_urbi(value)
    return value.world.text(value) if isinstance(plain, Obj) else plain


def from_wire(world: World, devices: Mapping[str, UObject], value: Any) -> Any:
    """Convert a received value to an urbiscript value of this kernel."""
    if isinstance(value, SlotName):
        device = devices.get(value.name)
        return world.string(value.name) if device is None else device.face
    if isinstance(value, list):
        return world.new_list([world.nil if one is None else from_wire(world, devices, one) for one in value])
    if isinstance(value, dict):
        return world.dictionary({key: from_wire(world, devices, one) for key, one in value.items()})
    return world.nil if value is None else to_urbi(world, value)
