"""The keys of ``urbihw drive``: which speeds the keys of a terminal ask for, and for how long.

A terminal tells when a key is pressed and when it repeats, not when it is released.  So a key counts as held for
``FIRST_HOLD_S`` after it was pressed, the longest usual delay of the repetition, and then for ``REPEAT_HOLD_S`` after
each repetition.
"""

from __future__ import annotations

import re
from enum import Enum
from typing import Final, NamedTuple

FIRST_HOLD_S: Final = 0.75
"""Seconds for which a key counts as held before it repeats."""
REPEAT_HOLD_S: Final = 0.25
"""Seconds for which a key counts as held after a repetition: the slowest usual rate is 10 in a second."""
STEP: Final = 1.1
"""Factor of the keys + and -."""
LEAST_FULL, MOST_FULL = 0.01, 20.0
"""Bounds of the full speeds, m/s and rad/s; the least is still shown as something."""


class Wish(NamedTuple):
    """Shares of the full speeds, -1 to 1: forward, and to the left."""

    forward: float = 0.0
    left: float = 0.0


STAND: Final = Wish()


class KeyOrder(Enum):
    """The keys that are no movement."""

    FASTER = "faster"
    SLOWER = "slower"
    SUSPEND = "suspend"
    LEAVE = "leave"


MOVES: Final[dict[str, Wish]] = {
    **dict.fromkeys(("w", "i", "up"), Wish(1, 0)),
    **dict.fromkeys(("s", ",", "down"), Wish(-1, 0)),
    **dict.fromkeys(("a", "j", "left"), Wish(0, 1)),
    **dict.fromkeys(("d", "l", "right"), Wish(0, -1)),
    "u": Wish(1, 1),
    "o": Wish(1, -1),
    "m": Wish(-1, -1),
    ".": Wish(-1, 1),
}
ORDERS: Final = {
    "+": KeyOrder.FASTER,
    "=": KeyOrder.FASTER,
    "-": KeyOrder.SLOWER,
    "\x1a": KeyOrder.SUSPEND,
    **dict.fromkeys(("q", "\x03", "\x04", "\x1c"), KeyOrder.LEAVE),
}
"""\x03 is Ctrl-C, \x04 Ctrl-D, \x1a Ctrl-Z, \x1c Ctrl-\\."""
HELP: Final = """  w s a d, arrows   forward, backward, turn left, turn right: as long as the key is held
  u o m .           arcs; forward left, forward right, backward
  + -               faster, slower
  space             stop (so does any other key)
  q, Ctrl-C         leave; Ctrl-Z: suspend"""

_KEYS: Final = re.compile(r"\x1b[\[O][0-9;]*([A-Za-z~])|\x1b|(.)", re.DOTALL)
_ARROWS: Final = {"A": "up", "B": "down", "C": "right", "D": "left"}


def change_full(full: float, order: KeyOrder) -> float:
    """A full speed after one of the keys + and -."""
    return max(LEAST_FULL, min(MOST_FULL, full * STEP if order is KeyOrder.FASTER else full / STEP))


class Keys:
    """The state of the keys; times are in seconds."""

    def __init__(self) -> None:
        self._wish = STAND
        self._until = 0.0

    def feed(self, text: str, now: float) -> list[KeyOrder]:
        """Take what the terminal sent; returns the keys in it that are no movement.  An unknown key stops."""
        orders = []
        for arrow, letter in _KEYS.findall(text):
            key = _ARROWS.get(arrow, "") if arrow else letter.lower()
            order = ORDERS.get(key)
            if order is not None:
                orders.append(order)
            else:
                self._press(MOVES.get(key, STAND), now)
        return orders

    def _press(self, wish: Wish, now: float) -> None:
        repeats = wish == self._wish and now <= self._until
        self._wish = wish
        self._until = now + (REPEAT_HOLD_S if repeats else FIRST_HOLD_S)

    def release(self) -> None:
        """No key is held any more."""
        self._wish = STAND

    def wish(self, now: float) -> Wish:
        """What the held key asks for."""
        if now > self._until:
            self._wish = STAND
        return self._wish
