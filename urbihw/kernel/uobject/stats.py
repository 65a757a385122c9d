"""How long bound functions, callbacks and timers take: ``uobjects.enableStats``, ``getStats``, ``clearStats``.

Source: manual, release notes of 2.1 (average, least and greatest duration, and number of calls, of all bound functions
called, timers included).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol
from weakref import WeakSet


class Measured(Protocol):
    """What measures itself while statistics are wanted, so that it costs nothing at other times."""

    def measured(self, on: bool) -> None:
        """Measure, or do not."""
        ...


class Stats:
    """Durations by the name of what ran, in seconds; nothing is measured unless ``enabled``."""

    def __init__(self) -> None:
        self._enabled = False
        self._entries: dict[str, list[float]] = {}
        self._watched: WeakSet[Measured] = WeakSet()

    @property
    def enabled(self) -> bool:
        """Whether anything is measured."""
        return self._enabled

    @enabled.setter
    def enabled(self, on: bool) -> None:
        self._enabled = on
        for one in self._watched:
            one.measured(on)

    def watch(self, one: Measured) -> None:
        """Tell something whenever measuring begins or ends."""
        self._watched.add(one)
        if self._enabled:
            one.measured(True)

    def add(self, name: str, seconds: float) -> None:
        """One more call."""
        entry = self._entries.get(name)
        if entry is None:
            self._entries[name] = [seconds, seconds, seconds, 1.0]
            return
        entry[0] += seconds
        entry[1] = min(entry[1], seconds)
        entry[2] = max(entry[2], seconds)
        entry[3] += 1

    def timed(self, name: str, action: Callable[[], Any]) -> Any:
        """Run something and count it, if enabled."""
        if not self.enabled:
            return action()
        began = time.perf_counter()
        try:
            return action()
        finally:
            self.add(name, time.perf_counter() - began)

    def get(self) -> dict[str, list[float]]:
        """Name to [average, least, greatest, number of calls]."""
        return {name: [total / n, least, most, n] for name, (total, least, most, n) in self._entries.items()}

    def clear(self) -> None:
        """Forget what was measured."""
        self._entries.clear()
