"""Values of the other side, checked before they are used; and its words, made fit for a terminal and a log.

A value of another form is a bad answer, never an error of Python: each check raises BadFrame with one line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BusError

LONGEST_SHOWN: Final = 300
"""Characters that are shown of a text of the other side."""
LONGEST_LINE: Final = 600
"""The same of a whole message to users, which has words of ours too."""
LONGEST_NAME: Final = 200
"""Characters of the name of a service, or of one of its members."""


def show_text(text: object, most: int = LONGEST_SHOWN) -> str:
    r"""A text in one bounded line that a terminal cannot take for a command: control characters become ``\xNN``."""
    words = str(text)[: 2 * most]
    shown = words if words.isprintable() else "".join(map(_escape, words))
    return shown if len(shown) <= most else shown[: most - 3] + "..."


def _escape(letter: str) -> str:
    if letter.isprintable():
        return letter
    code = ord(letter)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def to_number(value: Any) -> float:
    """A finite number.  Raises BadFrame."""
    if not isinstance(value, bool | int | float) or not math.isfinite(value):
        raise _wrong(value, "a number")
    return float(value)


def to_whole(value: Any, low: int, high: int) -> int:
    """A whole number in this range, both ends included.  Raises BadFrame."""
    number = to_number(value)
    if number != int(number) or not low <= int(value) <= high:
        raise _wrong(value, f"a whole number from {low} to {high}")
    return int(value)


def to_text(value: Any, most: int = LONGEST_NAME) -> str:
    """A text of at most so many characters.  Raises BadFrame."""
    if not isinstance(value, str) or len(value) > most:
        raise _wrong(value, f"a text of up to {most} characters")
    return value


def to_row(value: Any, least: int = 0) -> Sequence[Any]:
    """A list or structure of at least so many parts: newer servers add some.  Raises BadFrame."""
    if not isinstance(value, list | tuple) or len(value) < least:
        raise _wrong(value, f"a list of {least} or more values" if least else "a list")
    return value


def is_name(value: Any) -> bool:
    """Whether this can be the name of a service or of a member, and can be shown as it is."""
    return isinstance(value, str) and 0 < len(value) <= LONGEST_NAME and value.isascii() and value.isprintable()


def describe_error(error: Exception) -> str:
    """One line about an error that an answer has caused: in our words, or, for an error of Python, with its kind."""
    ours = isinstance(error, BusError)
    return show_text(error if ours else f"an answer of another form ({type(error).__name__}: {error})", LONGEST_LINE)


def _wrong(value: Any, wanted: str) -> BadFrame:
    return BadFrame(f"the answer has {show_text(repr(value), 40)} where {wanted} should be")
