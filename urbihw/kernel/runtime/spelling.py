"""What somebody may have meant who wrote the name of a slot that does not exist.

Source: manual, specs/exception, ``Exception.Lookup.fixSpelling``.  How near a name must be it does not say: here, one
slip (a character too many, too few, another one, or two that changed places) in a short name, two in a longer one, and
the case of letters.  Names of up to three characters are near to everything, so nothing is said of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.runtime.record import lineage

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

SHORT, LONG = 4, 5
"""How long a name must be to allow for one slip, and for two."""
MOST_ANCESTORS: Final = 1000
"""How many objects are asked for their names: an error message is not worth more."""


def suggestion(world: World, target: Any, name: str) -> str:
    """`` (possible misspelling of NAME)`` for a slot that was looked for in ``target``, or nothing."""
    names = {slot for ancestor in lineage(world, target)[:MOST_ANCESTORS] for slot in world.peek_obj(ancestor).slots}
    near = nearest(name, names)
    return f" (possible misspelling of {near})" if near else ""


def nearest(name: str, names: Iterable[str]) -> str:
    """The name nearest to a misspelt one, "" if none is near enough; of several, one that begins alike, then one whose
    length differs least."""
    most = (len(name) >= SHORT) + (len(name) >= LONG)
    letters = set(name)
    near = []
    for other in names:
        if not other.isidentifier() or len(other) < SHORT or abs(len(other) - len(name)) > most:
            continue
        if name.lower() == other.lower():
            near.append((0, False, 0, other))
        if len(letters ^ set(other)) > 2 * most:
            continue
        far, strange = slips(name, other), name[0] != other[0]
        if far + strange <= most:  # who slips seldom does so at the first letter
            near.append((far, strange, abs(len(other) - len(name)), other))
    return min(near)[-1] if near else ""


def slips(a: str, b: str, pause: Callable[[], object] = lambda: None) -> int:
    """How many characters too many, too few or wrong, or neighbours that changed places, lie between two words.

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
