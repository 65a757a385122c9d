"""Values of urbiscript as JSON texts (RFC 8259), in ASCII.

===========================  ==========================================
urbiscript                   JSON
===========================  ==========================================
Float                        number; nan and inf are null
true, false                  true, false
nil, void                    null
String                       string; its bytes are read as UTF-8, or else as latin-1
List, Tuple                  array
Dictionary                   object
Binary                       ``{"bytes": size, "keywords": text}``
any other object             its printed form, as a string
===========================  ==========================================
"""

from __future__ import annotations

import json
from typing import Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Nil, Truth, Void
from urbihw.kernel.runtime.values import Dictionary, FloatObject, List, String, Tuple
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

MAX_DEPTH: Final = 20
"""Maximum nesting of lists and dictionaries."""
MAX_LENGTH: Final = 64 * 1024
"""Maximum length of the text of one value."""


def json_number(value: float) -> str:
    """A number; null for nan and inf."""
    return repr(value) if value - value == 0.0 else "null"


def json_string(text: str) -> str:
    """A text of urbiscript, one character per byte, as a JSON string."""
    if not text.isascii():
        try:
            text = text.encode("latin-1").decode("utf-8")
        except UnicodeError:
            pass  # not UTF-8: each byte is a character
    return json.dumps(text)


def json_of(world: World, value: Value, most: int = MAX_LENGTH) -> str:
    """The JSON text of a value.  Raises an urbiscript error when it is longer than ``most`` characters or too deep, and
    what the printing of an object raises.
    """
    if value.__class__ is float:
        return json_number(value)
    return _Writer(world, most).text(value, 0)


class _Writer:
    """Writes one value, and counts its characters: a list may contain another one many times."""

    def __init__(self, world: World, most: int) -> None:
        self._world = world
        self._most = most
        self._left = most

    def text(self, value: Value, depth: int) -> str:
        """The text of a value or of a member."""
        if depth > MAX_DEPTH:
            raise errors.primitive(f"the value nests deeper than {MAX_DEPTH}", None)
        if isinstance(value, List | Tuple):
            made = f"[{', '.join([self.text(member, depth + 1) for member in value.l])}]"
            self._count(2 + 2 * len(value.l))
        elif isinstance(value, Dictionary):
            members = [f"{self._counted(json_string(key))}: {self.text(member, depth + 1)}"
                       for key, member in value.d.items()]
            made = f"{{{', '.join(members)}}}"
            self._count(2 + 4 * len(members))
        else:
            made = self._counted(self._plain(value))
        return made

    def _plain(self, value: Value) -> str:
        if value.__class__ is float:
            return json_number(value)
        if isinstance(value, String):
            self._check(len(value.s))
            return json_string(value.s)
        if isinstance(value, Truth):
            return "true" if value.value else "false"
        if value is None or isinstance(value, Void | Nil):
            return "null"
        if isinstance(value, FloatObject):
            return json_number(value.value)
        if isinstance(value, BinaryObject):
            return f'{{"bytes": {len(value.content)}, "keywords": {json_string(value.keywords)}}}'
        return json_string(self._world.printable(value))

    def _counted(self, text: str) -> str:
        self._count(len(text))
        return text

    def _count(self, length: int) -> None:
        self._check(length)
        self._left -= length

    def _check(self, length: int) -> None:
        if length > self._left:
            raise errors.primitive(f"the value is longer than {self._most} characters", None)
