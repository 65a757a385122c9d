"""Looking for texts in a text, however long it is: ``TEXT`` characters at a time, others in between.

A piece of the text that is gone through overlaps the next by what may be the beginning of a separator.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.values import MOST_CHARACTERS, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.stdlib.slices import SLICE, TEXT, give_way

__breakable__ = True

Search = Callable[[int, int], tuple[int, int] | None]
"""Finds the first separator that lies between two places: its begin and end."""

MOST_SEPARATORS: Final = 1000
"""Characters that several separators may have together: they are compiled while the others wait."""


def found_separators(world: World, text: str, separators: list[str]) -> Iterator[tuple[int, int]]:
    """Where the separators are, begin and end of each, from left to right; in one place the first that fits counts.

    Raises Primitive if there are too many separators.
    """
    search = _search_one(text, separators[0]) if len(separators) == 1 else _search_several(text, separators)
    longest = max(map(len, separators))
    step = max(TEXT, longest)
    at = number = 0
    with COLLECTOR:
        while at < len(text):
            end = at + step
            found = search(at, min(end + longest - 1, len(text)))
            if found is None or found[0] >= end:
                at = end
                give_way(world)
                continue
            yield found
            at = found[1]
            number += 1
            if not number % SLICE:
                COLLECTOR.leave_alone()
                give_way(world)


def _search_one(text: str, separator: str) -> Search:
    length = len(separator)

    def search(begin: int, end: int) -> tuple[int, int] | None:
        at = text.find(separator, begin, end)
        return None if at < 0 else (at, at + length)

    return search


def _search_several(text: str, separators: list[str]) -> Search:
    if sum(map(len, separators)) > MOST_SEPARATORS:
        raise errors.primitive(f"too long: expected separators of at most {MOST_SEPARATORS} characters in all")
    pattern = re.compile("|".join(map(re.escape, separators)))

    def search(begin: int, end: int) -> tuple[int, int] | None:
        match = pattern.search(text, begin, end)
        return None if match is None else match.span()

    return search


def replaced(world: World, text: str, old: str, new: str) -> str:
    """``text.replace(old, new)``, for an ``old`` that is not empty.  Raises BadNumber if that becomes too long."""
    step = max(TEXT, 8 * len(old))
    parts: list[str] = []
    at = total = 0
    while at < len(text):
        end = min(at + step, len(text))
        between = text[at:end].split(old)
        rest = min(len(between[-1]), len(old) - 1) if end < len(text) else 0
        between[-1] = between[-1][: len(between[-1]) - rest]
        total += sum(map(len, between)) + (len(between) - 1) * len(new)
        if total > MOST_CHARACTERS:
            raise too_long("characters", MOST_CHARACTERS)
        parts.append(new.join(between))
        at = end - rest
        if at < len(text):
            give_way(world)
    return "".join(parts)
