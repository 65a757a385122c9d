"""Suggestions for misspelt names of slots.

Source: manual, specs/exception, ``Exception.Lookup.fixSpelling``.  The manual does not define how near a name must be.
Here it may differ by one slip (an additional, missing or wrong character, or two swapped ones) in a short name, by two
slips in a longer name, and by the case of letters.  Names of up to three characters are near to too many others, so
there are no suggestions for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

MIN_LENGTH_ONE_SLIP, MIN_LENGTH_TWO_SLIPS = 4, 5
"""Minimum length of a name that may have one slip, or two."""
MAX_LENGTH: Final = 100
"""Maximum length of a name with a suggestion; the time of a comparison grows with the square of the length."""
MAX_ANCESTORS: Final = 1000
"""Maximum number of objects whose slots are searched for a suggestion."""


def suggestion(name: str, names: Iterable[str]) -> str:
    """`` (possible misspelling of NAME)`` for a slot that was not found among these names, or ""."""
    near = nearest(name, names)
    return f" (possible misspelling of {near})" if near else ""


def nearest(name: str, names: Iterable[str]) -> str:
    """The name nearest to a misspelt one, "" if none is near enough.  Among several, a name with the same first letter
    is preferred, then the name with the nearest length.
    """
    if len(name) > MAX_LENGTH:
        return ""
    most = (len(name) >= MIN_LENGTH_ONE_SLIP) + (len(name) >= MIN_LENGTH_TWO_SLIPS)
    letters = set(name)
    near = []
    for other in names:
        if not other.isidentifier() or len(other) < MIN_LENGTH_ONE_SLIP or abs(len(other) - len(name)) > most:
            continue
        if name.lower() == other.lower():
            near.append((0, False, 0, other))
        if len(letters ^ set(other)) > 2 * most:
            continue
        far, strange = slips(name, other), name[0] != other[0]
        if far + strange <= most:  # the first letter is seldom wrong
            near.append((far, strange, abs(len(other) - len(name)), other))
    return min(near)[-1] if near else ""


def slips(a: str, b: str, pause: Callable[[], object] = lambda: None) -> int:
    """The number of slips between two words: additional, missing or wrong characters, and swapped neighbours.

    That is the Damerau-Levenshtein distance (a swap is of neighbours that nothing else touches).  ``pause()`` is called
    after each character of the first.
    """
    before: list[int] = []
    last = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        row = [i]
        for j, y in enumerate(b, 1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        before, last = last, row
        pause()
    return last[-1]
