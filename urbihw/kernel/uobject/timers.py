"""The timers of one device: those of ``set_timer`` run before a pass of urbiscript, ``update`` runs after it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched.timequeue import Timer

if TYPE_CHECKING:
    from urbihw.kernel.uobject.host import Host


class Timers:
    """Periodic calls; a late call is not repeated to catch up."""

    def __init__(self, host: Host, owner: str, hub: bool) -> None:
        self._host = host
        self._owner = owner
        self._hub = hub
        self._timers: dict[int, Timer] = {}
        self._count = 0
        self._update: int | None = None

    def add(self, period: float, callback: Callable[[], Any]) -> int:
        """Call ``callback`` every ``period`` seconds, or every ``System.period`` if ``period`` is 0.  Returns the
        handle.
        """
        scheduler = self._host.world.scheduler
        each = period if period > 0 else self._host.world.period
        self._count += 1
        handle = self._count
        name = f"timer of {self._owner}"

        def tick() -> None:
            due = self._timers[handle].deadline + each
            self._timers[handle] = scheduler.call_at(max(due, scheduler.clock.now()), tick)
            self._host.registry.guarded(callback, name)

        self._timers[handle] = scheduler.call_at(scheduler.clock.now() + each, tick)
        return handle

    def remove(self, handle: int) -> None:
        """Remove a timer; a second call has no effect."""
        timer = self._timers.pop(handle, None)
        if timer is not None:
            timer.cancel()

    def set_update(self, period: float, update: Callable[[], Any]) -> None:
        """Call ``update`` every ``period`` seconds at the end of a round; a negative period ends it."""
        if self._update is not None:
            self.remove(self._update)
            self._update = None
        if period >= 0:
            name = f"update of {self._owner}"

            def due() -> None:
                handle = self._update
                self._host.registry.after_round(
                    lambda: None if self._update != handle else self._host.registry.guarded(update, name), self._hub
                )

            self._update = self.add(period, due)

    def clear(self) -> None:
        """Remove all timers of the device."""
        self._update = None
        for handle in list(self._timers):
            self.remove(handle)
