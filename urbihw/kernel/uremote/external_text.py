"""Text output of a server for a remote: lines with values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.values import Dictionary, List, String
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.frames import latin
from urbihw.kernel.uremote.remote import number_text, quoted

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def message(world: World, now: float, channel: str, bare: bool, value: Any, direct: bool = False) -> bytes:
    """Format the line ``[stamp:channel] value``.

    A Python list is a list of its members.  If ``direct``, devices and variables among them are sent as strings with
    their names, as functions of remotes expect.  ``bare`` is for remotes of this implementation: names of devices are
    unquoted.  Numbers have all their digits.
    """
    parts: list[bytes] = [f"[{int(now * 1000 + 1e-6):08d}:{channel}] ".encode("latin-1")]
    if isinstance(value, list):
        parts.append(b"[")
        for index, member in enumerate(value):
            if index:
                parts.append(b", ")
            name = _name(world, member) if direct else None
            if name is None:
                _put(world, parts, member, bare and index > 0)
            else:
                parts.append(quoted(name).encode("latin-1"))
        parts.append(b"]")
    else:
        _put(world, parts, value, bare)
    parts.append(b"\n")
    return b"".join(parts)


def _name(world: World, value: Any) -> str | None:
    """The name of a device or a variable; None for other values."""
    if isinstance(value, UVar):
        return value.full_name
    if isinstance(value, Obj) and not isinstance(value, String):
        name = value.slots.get("__uobjectName")
        return name.s if isinstance(name, String) else None
    return None


def _put(world: World, parts: list[bytes], value: Any, bare: bool) -> None:
    if value.__class__ is float:
        parts.append(number_text(value).encode("latin-1"))
    elif isinstance(value, BinaryObject):
        head = f" {value.keywords}" if value.keywords else ""
        parts.append(f"BIN {len(value.content)}{head}\n".encode("latin-1"))
        parts.append(bytes(value.content))
    elif isinstance(value, String):
        parts.append(quoted(value.s).encode("latin-1"))
    elif isinstance(value, List):
        parts.append(b"[")
        for index, member in enumerate(value.l):
            if index:
                parts.append(b", ")
            _put(world, parts, member, bare)
        parts.append(b"]")
    elif isinstance(value, Dictionary):
        parts.append(b"[")
        for index, (key, member) in enumerate(value.d.items()):
            parts.append(b", " if index else b"")
            parts.append(quoted(key).encode("latin-1") + b" => ")
            _put(world, parts, member, bare)
        parts.append(b"]" if value.d else b" => ]")
    elif bare and (name := _name(world, value)) is not None:
        parts.append(name.encode("latin-1"))
    else:
        parts.append(latin(world.text(world.send(value, "asToplevelPrintable")) if value is not world.nil else "nil"))
