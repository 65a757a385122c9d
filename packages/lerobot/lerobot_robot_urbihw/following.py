"""The newest values of slots: the daemon sends them, a thread keeps the last, so that reading takes no time."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from urbihw.client.robot import Robot


class NewestValues:
    """Follows slots from its making until ``close``."""

    def __init__(self, robot: Robot, slots: Sequence[str], hz: float, timeout: float) -> None:
        """Raises ClientError, also when nothing comes within ``timeout`` seconds."""
        self._watch = robot.watch(*slots, hz=hz, timeout=timeout)
        self._newest = next(self._watch)
        self._why = ""
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        try:
            for sample in self._watch:
                self._newest = sample
        except Exception as error:  # told by the next reading
            self._why = str(error)

    def read(self, max_age: float) -> tuple[Any, ...]:
        """The values.  Raises ConnectionError when they are older than ``max_age`` seconds or cannot be read."""
        at, values = self._newest
        age = time.time() - at
        if self._why or age > max_age:
            raise ConnectionError(self._why or f"no sample for {age:.2f} s: the link is lost, or the daemon is busy")
        if None in values:
            raise ConnectionError(f"not readable: {self._watch.errors or self._watch.slots}")
        return values

    def close(self) -> None:
        """End it; a second call does nothing."""
        self._watch.close()
        self._thread.join(5)
