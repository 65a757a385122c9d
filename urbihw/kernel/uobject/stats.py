"""Durations of bound functions, callbacks and timers: ``uobjects.enableStats``, ``getStats``, ``clearStats``.

Source: manual, release notes of 2.1 (average, least and greatest duration, and number of calls, of all bound functions
called, timers included).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol
from weakref import WeakSet


class SelfMeasuring(Protocol):
    """Something that measures itself only while statistics are enabled, so that it costs nothing at other times."""

    def set_measuring(self, on: bool) -> None:
        """Switch the measurement on or off."""
        ...


class Stats:
    """Durations in seconds, by the name of the called function; nothing is measured unless ``enabled``."""

    def __init__(self) -> None:
        self._enabled = False
        self._entries: dict[str, list[float]] = {}
        self._watched: WeakSet[SelfMeasuring] = WeakSet()

    @property
    def enabled(self) -> bool:
        """Whether the measurement is on."""
        return self._enabled

    @enabled.setter
    def enabled(self, on: bool) -> None:
        self._enabled = on
        for one in self._watched:
            one.set_measuring(on)

    def add_measured(self, one: SelfMeasuring) -> None:
        """Notify ``one`` whenever the measurement is switched on or off."""
        self._watched.add(one)
        if self._enabled:
            one.set_measuring(True)

    def add(self, name: str, seconds: float) -> None:
        """Count one call of a function."""
        entry = self._entries.get(name)
        if entry is None:
            self._entries[name] = [seconds, seconds, seconds, 1.0]
            return
        entry[0] += seconds
        entry[1] = min(entry[1], seconds)
        entry[2] = max(entry[2], seconds)
        entry[3] += 1

    def timed(self, name: str, action: Callable[[], Any]) -> Any:
        """Run ``action``, and count the call if enabled."""
        if not self.enabled:
            return action()
        began = time.perf_counter()
        try:
            return action()
        finally:
            self.add(name, time.perf_counter() - began)

    def get(self) -> dict[str, list[float]]:
        """The statistics: name -> [average, minimum, maximum, number of calls]."""
        return {name: [total / n, least, most, n] for name, (total, least, most, n) in self._entries.items()}

    def clear(self) -> None:
        """Clear all counts and times."""
        self._entries.clear()
