"""The work of built-in functions on much data, in slices between which other jobs and the sockets get their turn.

A built-in function is over at once for what programs usually have, as a statement within ``|`` must be.  One that goes
through much data gives way after each ``AIR`` seconds, inside ``|`` too.  It works on what its arguments were when it
was called, and what it changes it changes in one go at the end.  With a simulated clock nothing gives way: no time
passes there.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, Final, TypeVar

from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.collector import COLLECTOR

__breakable__ = True

T = TypeVar("T")
Key = Callable[[Any], Any] | None

AIR: Final = 0.005
"""Seconds after which a function that goes through much data gives way."""
FEW: Final = 2000
"""So many members, those of lists in a list counted too, are gone through in one go."""
MANY_CALLS: Final = 10_000
"""For so many members a function of the program is called in one go, as ``for|`` does."""
SLICE: Final = 256
"""Members between two looks at the time."""
RUN: Final = 8192
"""Members that are sorted in one go."""
TEXT: Final = 32 * 1024
"""Characters that are gone through in one go."""


def give_way(world: World) -> None:
    """Let others have their turn if this round has lasted long.  Raises what is thrown at the job.

    What a condition reads meanwhile in another job is not taken for read by the one that waits here.
    """
    scheduler, recorder = world.scheduler, world.recorder
    job = scheduler.current
    if job is None or job.done:
        return
    watch, recorder.active = recorder.active, None
    try:
        scheduler.give_way(AIR)
    finally:
        recorder.active = watch


def in_slices(world: World, members: Sequence[T]) -> Iterable[T]:
    """The members as they are now; between slices of more than ``FEW`` of them others may run."""
    now = members[:]
    first = now[0] if now else None
    weight = len(first.l) if first.__class__ is List else 1
    if len(now) * weight <= FEW:
        return now
    return chain.from_iterable(_slices(world, now, SLICE // weight if 1 <= weight <= SLICE else 1))


def calls(world: World, members: Sequence[T]) -> Iterable[T]:
    """The members as they are now, to call a function of the program on each."""
    now = members[:]
    return now if len(now) <= MANY_CALLS else chain.from_iterable(_slices(world, now, SLICE))


def _slices(world: World, members: Sequence[T], size: int) -> Iterator[Sequence[T]]:
    with COLLECTOR:
        for at in range(0, len(members), size):
            COLLECTOR.leave_alone()
            give_way(world)
            yield members[at : at + size]


def text_slices(world: World, text: str) -> Iterator[str]:
    """A text in pieces of ``TEXT`` characters, of which an empty one has none."""
    for at in range(0, len(text), TEXT):
        if at:
            give_way(world)
        yield text[at : at + TEXT]


def sort_in_slices(world: World, members: list[Any], key: Key = None) -> None:
    """``members.sort(key=key)``, for a list that nobody else knows."""
    if len(members) <= RUN:
        members.sort(key=key)
        return
    runs = []
    for at in range(0, len(members), RUN):
        give_way(world)
        runs.append(sorted(members[at : at + RUN], key=key))
    while len(runs) > 1:
        runs = [_merged(world, runs[at : at + RUN // SLICE], key) for at in range(0, len(runs), RUN // SLICE)]
    members[:] = runs[0]


def _merged(world: World, runs: list[list[Any]], key: Key) -> list[Any]:
    """Sorted lists as one; of equal members those of the first list come first.

    They are cut at the same members into some ``RUN`` each time, which Python's sort merges.
    """
    ranked = key if key is not None else lambda member: member
    steps = [ranked(run[at]) for run in runs for at in range(SLICE, len(run), SLICE)]
    steps.sort()
    bounds = steps[len(runs) :: max(1, RUN // SLICE)]
    begins = [0] * len(runs)
    merged: list[Any] = []
    for bound in [*bounds, None]:
        piece: list[Any] = []
        for index, run in enumerate(runs):
            end = len(run) if bound is None else bisect_left(run, bound, begins[index], key=key)
            piece += run[begins[index] : end]
            begins[index] = end
        piece.sort(key=key)
        merged += piece
        give_way(world)
    return merged
