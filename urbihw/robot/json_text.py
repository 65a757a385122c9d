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

from urbihw.kernel.library import BinaryObject, FloatObject, Nil, String, Truth, Value, Void, World
from urbihw.robot.nested_text import NestedText

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
    return _JsonText(world, most).text(value)


class _JsonText(NestedText):
    """Writes one value as JSON."""

    between = ": "

    def dictionary(self, members: list[str]) -> str:
        return f"{{{', '.join(members)}}}"

    def string(self, text: str) -> str:
        return json_string(text)

    def plain(self, value: Value) -> str:
        if value.__class__ is float:
            return json_number(value)
        if isinstance(value, String):
            self.check_length(len(value.s))
            return json_string(value.s)
        if isinstance(value, Truth):
            return "true" if value.value else "false"
        if value is None or isinstance(value, Void | Nil):
            return "null"
        if isinstance(value, FloatObject):
            return json_number(value.value)
        if isinstance(value, BinaryObject):
            return f'{{"bytes": {len(value.content)}, "keywords": {json_string(value.keywords)}}}'
        return json_string(self.world.printable(value))
