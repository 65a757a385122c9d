"""The last lines of the process's log, for programs and panels.

``server.log_tap`` has the handler that brings the lines here, in the kernel's thread.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.world import World

MAX_ENTRIES: Final = 200


class ServerLog:
    """The log of one process.

    Attributes: entries: the last entries, each with its number ``n``, the kernel's time of its arrival, and the other
    fields of the handler. logged: the urbiscript event that is emitted with each entry.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._count = 0
        self.entries: deque[dict[str, Any]] = deque(maxlen=MAX_ENTRIES)
        self.logged: Event = world.event_proto.clone()

    def add(self, entry: Mapping[str, Any]) -> None:
        """Keep an entry, and emit the event.  In the kernel's thread."""
        self._count += 1
        world = self._world
        kept = {"n": self._count, "time": round(world.scheduler.clock.now(), 3), **entry}
        self.entries.append(kept)
        if self.logged.subscriptions:
            world.spawn_own(lambda: self.logged.emit([world.from_python(kept)]), "log")
