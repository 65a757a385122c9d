"""Values and errors as text without running urbiscript, for clients of a kernel whose printing slots are broken.

The texts are those of the library; a program may redefine or remove ``asString`` and the like.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import Stack
from urbihw.kernel.runtime.object import Nil, Obj, Truth, Void
from urbihw.kernel.runtime.values import Dictionary, FloatObject, List, String, Tuple
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

ESCAPES: Final = {
    "\b": "\\b", "\f": "\\f", "\n": "\\n", "\r": "\\r", "\t": "\\t", "\v": "\\v", '"': '\\"', "\\": "\\\\",
}  # fmt: skip
_ESCAPED: Final = str.maketrans({
    chr(code): ESCAPES.get(chr(code), f"\\x{code:02x}")
    for code in range(256) if chr(code) in ESCAPES or not " " <= chr(code) <= "~"
})  # fmt: skip
MAX_DEPTH: Final = 20
"""Maximum depth of containers in a text; a list may contain itself."""
MAX_SHOWN_MEMBERS: Final = 1000
"""Maximum number of members of containers in a text."""


def float_text(value: float) -> str:
    """The text of a number: all digits if it is integral and fits 64 bits, else six significant digits."""
    if value.is_integer() and abs(value) < 2.0**63:
        return str(int(value))
    return f"{value:g}"


def escaped(text: str) -> str:
    """A text as a string literal, quotes included; bytes that are no printable ASCII as ``\\xNN``."""
    return '"' + text.translate(_ESCAPED) + '"'


def plain_text(world: World, value: Value) -> str:
    """Any value as the library prints it at top level; a value without such a text by its class and identity."""
    return _Shown(world).text(value, 0)


class _Shown:
    """The text of one value under construction; ``_left`` is the number of members of containers that may follow."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._left = MAX_SHOWN_MEMBERS

    def text(self, value: Value, depth: int) -> str:
        if value.__class__ is float:
            return float_text(value)
        if isinstance(value, FloatObject):
            return float_text(value.value)
        if isinstance(value, String):
            return escaped(value.s)
        if isinstance(value, Truth):
            return "true" if value.value else "false"
        if isinstance(value, Nil | Void):
            return "nil" if isinstance(value, Nil) else "void"
        if isinstance(value, List):
            return f"[{self._members(value.l, depth)}]"
        if isinstance(value, Tuple):
            return f"({self._members(value.l, depth)})"
        if isinstance(value, Dictionary):
            return f"[{self._members(list(value.d.items()), depth)}]"
        return f"{plain_type(value)}_{self._world.uid(value)}"

    def _members(self, members: list[Value], depth: int) -> str:
        parts: list[str] = []
        for member in members:
            if depth == MAX_DEPTH or not self._left:
                parts.append("...")
                break
            self._left -= 1
            if member.__class__ is tuple:
                parts.append(f"{escaped(member[0])} => {self.text(member[1], depth + 1)}")
            else:
                parts.append(self.text(member, depth + 1))
        return ", ".join(parts)


def plain_type(value: Obj) -> str:
    """The ``type`` of an object if it is a String, else ``Object``."""
    holder = value.find("type")
    kind = None if holder is None else holder.slots.get("type")
    return kind.s if isinstance(kind, String) else "Object"


def plain_error(world: World, error: errors.ThrownError, stack: Stack) -> list[str]:
    """The lines that report an uncaught error, without the leading ``!!!``."""
    if isinstance(error, errors.Raised):
        routine = stack.routine if error.routine == "" else error.routine
        head = f"{routine}: {error.message}" if routine else error.message
    else:
        message = error.value.slots.get("message") if isinstance(error.value, Obj) else None
        head = message.s if isinstance(message, String) else plain_text(world, error.value)
    if stack.location is not None:
        head = f"{stack.location}: {head}"
    return [head, *stack.lines()]
