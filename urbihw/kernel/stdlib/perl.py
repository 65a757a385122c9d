r"""Translation of Perl's regular expressions to Python's ``re``, where both differ.

``[[:alpha:]]`` and the other classes, ``\z`` and ``\Z``, ``\h``, ``\Q...\E``, ``\<`` and ``\>``, and named groups
(``(?<name>...)``, ``\k<name>``) are translated.  All other syntax is the same in both, or an error of ``re``: ``\K``,
``\R``, ``\p{...}``, ``(?R)``.
"""

from __future__ import annotations

import re
import string

CHARACTERS = {
    "alnum": "0-9A-Za-z",
    "alpha": "A-Za-z",
    "blank": r" \t",
    "cntrl": r"\x00-\x1f\x7f",
    "digit": "0-9",
    "graph": r"\x21-\x7e",
    "lower": "a-z",
    "print": r"\x20-\x7e",
    "punct": re.escape(string.punctuation),
    "space": r"\s",
    "upper": "A-Z",
    "word": r"\w",
    "xdigit": "0-9A-Fa-f",
}
"""The names of character classes, written between ``[:`` and ``:]`` in a set."""

ESCAPES = {"z": r"\Z", "Z": r"(?=\n?\Z)", "h": r"[ \t]", "<": r"\b(?=\w)", ">": r"\b(?<=\w)"}
ESCAPES_IN_SETS = {"h": r" \t"}

_LITERAL = r"\\Q(?P<literal>.*?)(?:\\E|\Z)|\\(?P<escape>.)"
_NAMED = r"\\k<(?P<back>\w+)>|(?P<group>\(\?<)(?![=!])"
_OUTSIDE = re.compile(_NAMED + "|" + _LITERAL + r"|(?P<open>\[\^?\]?)|.", re.DOTALL)
_INSIDE = re.compile(_LITERAL + r"|\[:(?P<name>\^?\w*):\]|(?P<close>\])|.", re.DOTALL)
_KEPT = "[&|~"
"""Python reserves these characters in sets for future operations, and warns."""


class NotPerl(ValueError):
    """The expression uses an unknown character class."""


def to_python(expression: str) -> str:
    """Translate an expression to Python's syntax.  Raises NotPerl."""
    parts: list[str] = []
    inside = False
    position = 0
    while match := (_INSIDE if inside else _OUTSIDE).match(expression, position):
        position = match.end()
        part = match.groupdict()
        if part["literal"] is not None:
            parts.append(re.escape(part["literal"]))
        elif part["escape"] is not None:
            parts.append((ESCAPES_IN_SETS if inside else ESCAPES).get(part["escape"], match[0]))
        elif part.get("back") is not None:
            parts.append(f"(?P={part['back']})")
        elif part.get("group") is not None:
            parts.append("(?P<")
        elif inside:
            parts.append(_in_set(match[0], part["name"], parts[-1]))
            inside = part["close"] is None
        else:
            parts.append(match[0])
            inside = part["open"] is not None
    return "".join(parts)


def _in_set(text: str, name: str | None, before: str) -> str:
    """Translate a character, or a character class, within a set."""
    if name is None:
        return f"\\{text}" if text in _KEPT or text == before == "-" else text
    if name not in CHARACTERS:
        raise NotPerl(f"invalid character class name: {name}")
    return CHARACTERS[name]
