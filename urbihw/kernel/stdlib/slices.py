"""Primitives on large data work in slices, between which other jobs and the sockets get turns.

A primitive ends at once for data of the usual size, as a statement within ``|`` must.  A primitive on large data gives
other jobs turns after each ``TIME_SLICE_S`` seconds, even inside ``|``.  It works on its arguments as they were at the
call, and changes data in one step at the end.  With a simulated clock there are no turns, because no time passes.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, Final, TypeVar

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.value import Value

__breakable__ = True

T = TypeVar("T")
Key = Callable[[Any], Any] | None

TIME_SLICE_S: Final = 0.005
"""Time slice in seconds after which a primitive on large data gives other jobs a turn."""
MAX_ATOMIC_MEMBERS: Final = 2000
"""Number of members, including those of nested lists, that are processed without a turn for other jobs."""
MAX_ATOMIC_CALLS: Final = 10_000
"""Number of members for which a function of the program is called without a turn for other jobs, like in ``for|``."""
CHECK_INTERVAL: Final = 256
"""Number of members between two checks of the time."""
SORT_RUN_SIZE: Final = 8192
"""Number of members that are sorted in one step."""
TEXT_SLICE_LENGTH: Final = 32 * 1024
"""Number of characters that are processed in one step."""


def give_way(world: World) -> None:
    """Give other jobs a turn if the present round has lasted long.  Raises the exception thrown into the job, such as a
    stop.
    """
    job = world.scheduler.current
    if job is not None and not job.done:
        world.scheduler.give_way(TIME_SLICE_S)


def in_slices(world: World, members: Sequence[T]) -> Iterable[T]:
    """The members at the time of the call; other jobs may run between slices if there are more than
    ``MAX_ATOMIC_MEMBERS``.
    """
    now = members[:]
    first = now[0] if now else None
    weight = len(first.l) if first.__class__ is List else 1
    if len(now) * weight <= MAX_ATOMIC_MEMBERS:
        return now
    return chain.from_iterable(_slices(world, now, CHECK_INTERVAL // weight if 1 <= weight <= CHECK_INTERVAL else 1))


class NestedWalk:
    """A part of a walk through a nested structure, such as the printing of a list that contains lists: a context
    manager around each list.  The members of all parts of a walk are counted together, because a list that contains
    itself many times is small at each level.

    ``inside`` tells whether an outer part of the walk is at the same container: a container may contain itself.
    """

    __slots__ = ("_container", "_job", "_met", "_outer", "_outermost", "_world", "inside")

    def __init__(self, world: World, container: Obj | None = None) -> None:
        self._world = world
        self._job = world.scheduler.current
        self._container = container
        self._outer: NestedWalk | None = None if self._job is None else self._job.walk
        self._outermost: NestedWalk | None = None if self._outer is None else self._outer._outermost or self._outer
        """The outermost part; None for this one, since a part that refers to itself waits for Python's collector."""
        self._met = 0
        """The number of members met so far, in the outermost part."""
        self.inside = container is not None and self._is_inside()

    def _is_inside(self) -> bool:
        part = self._outer
        while part is not None and part._container is not self._container:
            part = part._outer
        return part is not None

    def __enter__(self) -> NestedWalk:
        if self._job is not None:
            self._job.walk = self
        return self

    def __exit__(self, *failure: object) -> None:
        if self._job is not None:
            self._job.walk = self._outer
        self._container = self._outer = None  # the part may live longer

    def members(self, members: Sequence[T]) -> Iterable[T]:
        """The members of this part, as ``in_slices``; other jobs may run before them if the walk has met more than
        ``MAX_ATOMIC_MEMBERS``.
        """
        outermost = self._outermost or self
        outermost._met += len(members)
        if outermost._met > MAX_ATOMIC_MEMBERS:
            give_way(self._world)
        return in_slices(self._world, members)


def calls(world: World, members: Sequence[T]) -> Iterable[T]:
    """The members at the time of the call, for calls of a function of the program with each."""
    now = members[:]
    return now if len(now) <= MAX_ATOMIC_CALLS else chain.from_iterable(_slices(world, now, CHECK_INTERVAL))


def _slices(world: World, members: Sequence[T], size: int) -> Iterator[Sequence[T]]:
    with COLLECTOR:
        for at in range(0, len(members), size):
            COLLECTOR.freeze_existing()
            give_way(world)
            yield members[at : at + size]
        if isinstance(members, list):
            world.remains.free(members)


def text_slices(world: World, text: str) -> Iterator[str]:
    """A text in pieces of ``TEXT_SLICE_LENGTH`` characters; an empty text has none."""
    for at in range(0, len(text), TEXT_SLICE_LENGTH):
        if at:
            give_way(world)
        yield text[at : at + TEXT_SLICE_LENGTH]


def sort_in_slices(world: World, members: list[Value], key: Key = None) -> list[Value]:
    """``sorted(members, key=key)``, for a list that nothing else refers to and that is not used any more."""
    if len(members) <= SORT_RUN_SIZE:
        members.sort(key=key)
        return members
    runs = []
    for at in range(0, len(members), SORT_RUN_SIZE):
        give_way(world)
        runs.append(sorted(members[at : at + SORT_RUN_SIZE], key=key))
    world.remains.free(members)
    ways = SORT_RUN_SIZE // CHECK_INTERVAL
    while len(runs) > 1:
        longer = []
        while runs:
            longer.append(_merged(world, runs[:ways], key))
            for run in runs[:ways]:
                world.remains.free(run)
            del runs[:ways]
        runs = longer
    return runs[0]


def _merged(world: World, runs: list[list[Value]], key: Key) -> list[Any]:
    """Merge sorted lists; among equal members, those of the first list come first.

    The lists are cut at the same values into pieces of about ``SORT_RUN_SIZE`` members, which Python's sort merges, and
    pieces of equal members.
    """
    ranked = key if key is not None else lambda member: member
    steps = [ranked(run[at]) for run in runs for at in range(CHECK_INTERVAL, len(run), CHECK_INTERVAL)]
    steps.sort()
    begins = [0] * len(runs)
    merged: list[Any] = []

    def take(ends: list[int]) -> list[Any]:
        """The members up to these ends, which are the next begins."""
        piece = [member for run, begin, end in zip(runs, begins, ends, strict=True) for member in run[begin:end]]
        begins[:] = ends
        give_way(world)
        return piece

    for bound in steps[len(runs) :: max(1, SORT_RUN_SIZE // CHECK_INTERVAL)]:
        lower = [bisect_left(run, bound, begin, key=key) for run, begin in zip(runs, begins, strict=True)]
        merged += sorted(take(lower), key=key)
        # Any number of members may equal the bound; they are in order as they are.
        merged += take([bisect_right(run, bound, begin, key=key) for run, begin in zip(runs, begins, strict=True)])
    merged += sorted(take(list(map(len, runs))), key=key)
    return merged
