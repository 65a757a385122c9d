"""Search for strings in a text of any length, in slices of ``TEXT_SLICE_LENGTH`` characters between which other jobs
get turns.

Each slice overlaps the next one by the length of a possible beginning of a separator.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.values import MAX_STRING_LENGTH, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.stdlib.slices import CHECK_INTERVAL, TEXT_SLICE_LENGTH, give_way

__breakable__ = True

Search = Callable[[int, int], tuple[int, int] | None]
"""Finds the first separator between two positions; returns its begin and end."""

MAX_SEPARATORS_LENGTH: Final = 1000
"""Maximum total length, in characters, of several separators: their expression is compiled without a turn for other
jobs.
"""


def found_separators(world: World, text: str, separators: list[str]) -> Iterator[tuple[int, int]]:
    """The separators in a text: begin and end of each, from left to right.  At the same position, the first separator
    in the list wins.

    Raises Primitive if there are too many separators.
    """
    search = _search_one(text, separators[0]) if len(separators) == 1 else _search_several(text, separators)
    longest = max(map(len, separators))
    step = max(TEXT_SLICE_LENGTH, longest)
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
            if not number % CHECK_INTERVAL:
                COLLECTOR.freeze_existing()
                give_way(world)


def _search_one(text: str, separator: str) -> Search:
    length = len(separator)

    def search(begin: int, end: int) -> tuple[int, int] | None:
        at = text.find(separator, begin, end)
        return None if at < 0 else (at, at + length)

    return search


def _search_several(text: str, separators: list[str]) -> Search:
    if sum(map(len, separators)) > MAX_SEPARATORS_LENGTH:
        raise errors.primitive(f"too long: expected separators of at most {MAX_SEPARATORS_LENGTH} characters in all")
    pattern = re.compile("|".join(map(re.escape, separators)))

    def search(begin: int, end: int) -> tuple[int, int] | None:
        match = pattern.search(text, begin, end)
        return None if match is None else match.span()

    return search


def replaced(world: World, text: str, old: str, new: str) -> str:
    """``text.replace(old, new)`` for a non-empty ``old``.  Raises BadNumber if the result becomes too long."""
    step = max(TEXT_SLICE_LENGTH, 8 * len(old))
    parts: list[str] = []
    at = total = 0
    while at < len(text):
        end = min(at + step, len(text))
        between = text[at:end].split(old)
        rest = min(len(between[-1]), len(old) - 1) if end < len(text) else 0
        between[-1] = between[-1][: len(between[-1]) - rest]
        total += sum(map(len, between)) + (len(between) - 1) * len(new)
        if total > MAX_STRING_LENGTH:
            raise too_long("characters", MAX_STRING_LENGTH)
        parts.append(new.join(between))
        at = end - rest
        if at < len(text):
            give_way(world)
    return "".join(parts)
