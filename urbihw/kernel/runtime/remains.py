"""Large lists are freed in slices after their last reference is gone.

Python frees a list with all its members at once: a list of two million strings holds the interpreter for 0.13 s.
"""

from __future__ import annotations

import sys
import weakref
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.sched.scheduler import Scheduler

if TYPE_CHECKING:
    from urbihw.kernel.runtime.values import List

LARGE: Final = 50_000
"""Number of members from which a list is freed in slices: 3 ms."""
SLICE_SIZE: Final = 2048
"""Number of members that are freed between two looks at the clock."""
TIME_SLICE_S: Final = 0.003
"""Seconds in each round for freeing: about as much as a job may take to make other members meanwhile."""
_OWN_REFERENCES: Final = 3
"""References to the members of a List when it goes, as ``sys.getrefcount`` counts them: that of the List, which is
cleared after its weak references, that of a variable, and that of the count itself."""


class Remains:
    """The members of large lists of one kernel that are not freed yet."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._followed: dict[weakref.ref[List], list[Any]] = {}
        self._lists: list[list[Any]] = []

    def follow(self, holder: List) -> None:
        """Free the members of a List in slices when it is gone."""
        self._followed[weakref.ref(holder, self._gone)] = holder.l

    def free(self, values: list[Any]) -> None:
        """Free the members of a Python list in slices if it is large; the caller gives up the only reference to it."""
        if len(values) < LARGE:
            return
        self._lists.append(values)
        if len(self._lists) == 1:
            self._scheduler.post(self._free_slice)

    def _gone(self, holder: weakref.ref[List]) -> None:
        values = self._followed.pop(holder)
        if sys.getrefcount(values) == _OWN_REFERENCES:  # no loop over it goes on
            self.free(values)

    def _free_slice(self) -> None:
        now = self._scheduler.clock.now
        end = now() + TIME_SLICE_S
        while self._lists:
            values = self._lists[-1]
            del values[-SLICE_SIZE:]
            if not values:
                self._lists.pop()
            if now() > end:
                break
        if self._lists:
            self._scheduler.post(self._free_slice)
