"""Python's garbage collector, kept from holding everybody up.

A collection of all objects goes through each of them: a tenth of a second for a million, again and again while there
are more and more of them.  What is *frozen* is not gone through.  It is freed all the same when nobody refers to it;
only what refers to itself in a circle has to wait until it is thawed.

- Long work freezes what exists between its steps, and thaws it when it is over.
- In a server a collection of all objects that took long freezes what it left.  So the next one has only the new
  objects to go through.  Once in a while a collection goes through all of them, and when memory is short.

The collector belongs to the process, so there is one ``COLLECTOR``.  To be used in the thread of the scheduler.
"""

from __future__ import annotations

import gc
import time
from types import TracebackType
from typing import Any, Final

OLDEST: Final = 2
"""The generation of Python's collector that has all objects."""
LONG: Final = 0.01
"""Seconds that a collection may take before what it leaves is frozen."""
EVERY: Final = 60.0
"""Seconds after which a collection goes through all objects again."""


class Collector:
    """To be entered by long work, and guarded by a server."""

    def __init__(self) -> None:
        self._working = 0
        self._guards = 0
        self._began = 0.0
        self._thawed = 0.0

    def __enter__(self) -> Collector:
        self._working += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._working -= 1
        if not self._working and not self._guards:
            gc.unfreeze()

    def works(self) -> bool:
        """Whether long work is being done."""
        return self._working > 0

    def leave_alone(self) -> None:
        """Between two steps of long work: freeze what exists by now."""
        gc.freeze()

    def guard(self) -> None:
        """Keep collections short from now on, until ``release``."""
        self._guards += 1
        if self._guards == 1:
            self._thawed = time.monotonic()
            gc.callbacks.append(self._collecting)

    def release(self) -> None:
        """The server ends."""
        self._guards -= 1
        if not self._guards:
            gc.callbacks.remove(self._collecting)
            gc.unfreeze()

    def collect(self) -> None:
        """Memory is short: free whatever nobody uses."""
        gc.unfreeze()
        self._thawed = time.monotonic()
        gc.collect()

    def _collecting(self, phase: str, about: dict[str, Any]) -> None:
        """A collection begins or ends."""
        if about["generation"] != OLDEST:
            return
        now = time.monotonic()
        if phase == "stop":
            if now - self._began > LONG:
                gc.freeze()
            return
        self._began = now
        if now - self._thawed > EVERY:
            self._thawed = now
            gc.unfreeze()


COLLECTOR: Final = Collector()
"""That of this process."""
