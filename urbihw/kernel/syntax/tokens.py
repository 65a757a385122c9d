"""The words and signs of urbiscript as tables: keywords, old spellings, operators, units, string escapes.

A token has a kind, a value and a span.  The kind of a keyword or sign is its text (``if``, ``<=``); a synonym has the
kind of what it stands for.  The other kinds are NAME, FLOAT (with angles), TIME (a duration), STRING, BINARY, and END,
the end of input.  Source: the sections Identifiers, Keywords and Literals of the language chapter of the manual.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from urbihw.kernel.syntax.location import Span


class Token(NamedTuple):
    """A word or sign of a program; the value is a str, a float, or (keywords, data) for BINARY."""

    kind: str
    value: str | float | tuple[str, str]
    span: Span

    @property
    def text(self) -> str:
        """The value of a NAME, STRING, keyword or sign."""
        assert isinstance(self.value, str)
        return self.value


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


KEYWORDS = _words(
    """
    assert at bitand bitor break call case catch class closure compl const continue default do else emit enum every
    external finally for freezeif function if in loop new not onleave return stopif switch this throw timeout try var
    waituntil whenever while
    """
)

# Slots of Global that are the only objects of their kinds: no keywords, but nothing is assigned to them.
CONSTANTS = frozenset(["false", "nil", "true", "void"])

# Names that are keywords in front of another name where a statement begins; later than 2.3.
CONTEXTUAL = frozenset(["get", "set"])

# Names that are keywords where no name may stand: behind ``at``; later than 2.3.
CONTEXTUAL_INSIDE = frozenset(["sync"])

# Other spellings; foreach and loopn are the deprecated names of two forms of for.
SYNONYMS = {
    "and": "&&",
    "and_eq": "&=",
    "foreach": "for",
    "loopn": "for",
    "not_eq": "!=",
    "or": "||",
    "or_eq": "|=",
    "xor": "^",
    "xor_eq": "^=",
}

IGNORED = frozenset(["private", "protected", "public"])

# The last two are deprecated and have no meaning any more.
RESERVED = _words(
    """
    asm auto bool char const_cast delete double dynamic_cast explicit export extern float friend goto inline int
    long mutable namespace register reinterpret_cast short signed sizeof static_cast struct template typedef typeid
    typename union unsigned using virtual volatile wchar_t
    static internal
    """
)

SIGNS = _words(
    """
    ; , | & : ! ? ~ . -> => ( ) [ ] { } = += -= *= /= %= ^= &= |= ++ --
    && || == != === !== ~= =~= < <= > >= << >> ^ + - * / % **
    """
)

# The factor by which a duration is multiplied to give seconds, and how much of an angle's unit makes a radian:
# dividing by that gives 200grad == pi to the last bit, multiplying by pi / 200 does not.
DURATIONS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
ANGLES = {"rad": 1.0, "deg": 180 / math.pi, "grad": 200 / math.pi}

ESCAPES = {
    "\\": "\\",
    '"': '"',
    "'": "'",
    "a": "\a",
    "b": "\b",
    "f": "\f",
    "n": "\n",
    "r": "\r",
    "t": "\t",
    "v": "\v",
}

# The name of a kind in an error message, where that is not its text.  The original quotes the comma, and `not` is the
# same token as `!` there.
_SHOWN = {
    "NAME": "identifier",
    "FLOAT": "float",
    "TIME": "duration",
    "STRING": "string",
    "BINARY": "binary",
    "END": "end of command",
    "not": "!",
    ",": '","',
}


def shown(kind: str) -> str:
    """The name of a token kind in an error message."""
    return _SHOWN.get(kind, kind)


def is_identifier(name: str) -> bool:
    """Whether a name can be written without quotes."""
    if not (name.isascii() and name.isidentifier()):
        return False
    return not (name in KEYWORDS or name in SYNONYMS or name in RESERVED or name in IGNORED)


def escaped(text: str, quote: str = '"') -> str:
    """The text of a string as the server prints it between quotes: ``\\\\``, ``\\"``, ``\\n``, ``\\t``, ``\\xNN``."""
    if text.isascii() and text.isprintable() and "\\" not in text and quote not in text:
        return text
    return "".join(_escape(character, quote) for character in text)


def _escape(character: str, quote: str) -> str:
    if character in ("\\", quote):
        return "\\" + character
    if character == "\n":
        return "\\n"
    if character == "\t":
        return "\\t"
    if " " <= character <= "~":
        return character
    return f"\\x{ord(character):02x}"
