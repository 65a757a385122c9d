"""Keeps the pauses of Python's garbage collector short.

A full collection visits each object.  That takes a tenth of a second for a million objects, and happens again and again
while their number grows.  The collector does not visit *frozen* objects.  Frozen objects are still freed when their
last reference goes; only reference cycles stay until they are thawed.

- Long work freezes the existing objects between its steps, and thaws them when it is over.
- In a server, the objects that survive a slow full collection are frozen, so that the next one visits only the objects
  made since.  All objects are visited once a minute, and when memory is short.

The collector belongs to the process, so there is one ``COLLECTOR``.  It must be used in the scheduler's thread.
"""

from __future__ import annotations

import gc
import time
from types import TracebackType
from typing import Any, Final

OLDEST_GENERATION: Final = 2
"""The generation of Python's collector that contains all objects."""
SLOW_COLLECTION_S: Final = 0.01
"""Duration of a full collection, in seconds, from which the surviving objects are frozen."""
FULL_COLLECTION_PERIOD_S: Final = 60.0
"""Seconds after which frozen objects are thawed for a collection of all objects."""


class Collector:
    """The settings of Python's collector: a context manager around long work; a server calls ``guard`` and
    ``release``.
    """

    def __init__(self) -> None:
        self._working = 0
        self._guards = 0
        self._froze = False
        self._began = 0.0
        self._thawed = 0.0

    def __enter__(self) -> Collector:
        self._working += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._working -= 1
        if self._froze and not self._working and not self._guards:
            self._froze = False
            gc.unfreeze()

    def is_busy(self) -> bool:
        """Whether long work is in progress."""
        return self._working > 0

    def freeze_existing(self) -> None:
        """Freeze all existing objects; to be called between two steps of long work."""
        self._froze = True
        gc.freeze()

    def guard(self) -> None:
        """Keep collections short from now on, until ``release``."""
        self._guards += 1
        if self._guards == 1:
            self._thawed = time.monotonic()
            gc.callbacks.append(self._note_collection)

    def release(self) -> None:
        """Undo ``guard``, when the server ends."""
        self._guards -= 1
        if not self._guards:
            gc.callbacks.remove(self._note_collection)
            gc.unfreeze()

    def collect(self) -> None:
        """Free all unreachable objects, since memory is short."""
        gc.unfreeze()
        self._thawed = time.monotonic()
        gc.collect()

    def _note_collection(self, phase: str, about: dict[str, Any]) -> None:
        """Callback of Python's collector: a collection begins or ends."""
        if about["generation"] != OLDEST_GENERATION:
            return
        now = time.monotonic()
        if phase == "stop":
            if now - self._began > SLOW_COLLECTION_S:
                gc.freeze()
            return
        self._began = now
        if now - self._thawed > FULL_COLLECTION_PERIOD_S:
            self._thawed = now
            gc.unfreeze()


COLLECTOR: Final = Collector()
"""The collector of this process."""
