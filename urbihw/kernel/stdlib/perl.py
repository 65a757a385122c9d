r"""Perl's regular expressions for Python's ``re``: what one writes otherwise, and what means another thing there.

``[[:alpha:]]`` and its like, ``\z`` and ``\Z``, ``\h``, ``\Q...\E``, ``\<`` and ``\>`` are written in Python's words.
All else is the same in both, or an error of ``re``: ``\K``, ``\R``, ``\p{...}``, ``(?R)``.
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
"""The names of characters that stand between ``[:`` and ``:]`` in a set."""

ESCAPES = {"z": r"\Z", "Z": r"(?=\n?\Z)", "h": r"[ \t]", "<": r"\b(?=\w)", ">": r"\b(?<=\w)"}
ESCAPES_IN_SETS = {"h": r" \t"}

_LITERAL = r"\\Q(?P<literal>.*?)(?:\\E|\Z)|\\(?P<escape>.)"
_OUTSIDE = re.compile(_LITERAL + r"|(?P<open>\[\^?\]?)|.", re.DOTALL)
_INSIDE = re.compile(_LITERAL + r"|\[:(?P<name>\^?\w*):\]|(?P<close>\])|.", re.DOTALL)
_KEPT = "[&|~"
"""Python keeps these in sets for operations that it does not have yet, and warns."""


class NotPerl(ValueError):
    """The expression names characters that there are not."""


def to_python(expression: str) -> str:
    """The same expression for Python.  Raises NotPerl."""
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
        elif inside:
            parts.append(_in_set(match[0], part["name"], parts[-1]))
            inside = part["close"] is None
        else:
            parts.append(match[0])
            inside = part["open"] is not None
    return "".join(parts)


def _in_set(text: str, name: str | None, before: str) -> str:
    """A character of a set, or a name of characters."""
    if name is None:
        return f"\\{text}" if text in _KEPT or text == before == "-" else text
    if name not in CHARACTERS:
        raise NotPerl(f"invalid character class name: {name}")
    return CHARACTERS[name]
