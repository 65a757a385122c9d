"""What a call of somebody else may cost: the size of its arguments, and calls per second."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from urbihw.buses.errors import BadValue

MOST_ELEMENTS: Final = 512
"""Elements of all arguments of a call together, those of lists in lists included."""
MOST_READ: Final = 4 * MOST_ELEMENTS
"""Elements of a message that are read at all, before they are counted: letters of types are among them."""
MOST_TEXT: Final = 4096
"""Characters of all texts of a call together."""
DEEPEST: Final = 8
"""Lists and maps in each other."""
CALLS_A_SECOND: Final = 100.0
"""Calls per second of one caller, on average."""
CALL_BURST: Final = 32
"""Calls of one caller at once, after a pause."""


class TokenBucket:
    """Bounds how often something happens: ``burst`` times at once, and ``rate`` times a second on average."""

    def __init__(self, rate: float, burst: int, now: float) -> None:
        self._rate, self._burst = rate, burst
        self._tokens = float(burst)
        self._filled_at = now

    def take(self, now: float) -> bool:
        """Take a token; False when there is none."""
        self._fill(now)
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def has_token(self, now: float) -> bool:
        """Whether ``take`` would succeed."""
        self._fill(now)
        return self._tokens >= 1.0

    def is_full(self, now: float) -> bool:
        """Whether it is as good as a new one."""
        self._fill(now)
        return self._tokens >= self._burst

    def _fill(self, now: float) -> None:
        self._tokens = min(float(self._burst), self._tokens + (now - self._filled_at) * self._rate)
        self._filled_at = now


def check_arguments(arguments: Sequence[Any]) -> None:
    """Whether these may be passed on: the interpreter has to copy and to compare them.  Raises BadValue.

    Bytes are bounded by the size of a message alone: they are copied as one piece.
    """
    elements = letters = 0
    # Without recursion, as the depth is not known yet.
    level: list[Any] = list(arguments)
    for _ in range(DEEPEST + 1):
        elements += len(level)
        if elements > MOST_ELEMENTS:
            raise BadValue(f"more than {MOST_ELEMENTS} elements in the arguments")
        inner: list[Any] = []
        for each in level:
            if isinstance(each, str):
                letters += len(each)
            elif isinstance(each, list | tuple):
                inner += each
            elif isinstance(each, dict):
                inner += each
                inner += each.values()
        if letters > MOST_TEXT:
            raise BadValue(f"texts of more than {MOST_TEXT} characters in the arguments")
        if not inner:
            return
        level = inner
    raise BadValue(f"lists in each other deeper than {DEEPEST} in the arguments")
