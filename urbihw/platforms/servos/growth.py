"""How the tree of a robot grows when devices are found, also when they come one after the other."""

from __future__ import annotations

from collections.abc import Callable

from urbihw.platforms.servos.devices import ServoBusDevice


class TreeGrowth:
    """Lets the library of a platform add new devices to the tree: one growth after the other.

    The job of a growth gives way to others.  Two of them at the same time would both make the slots of the same
    devices.  So a growth that is asked for while one is under way begins at its end.
    """

    def __init__(
        self,
        run: Callable[[Callable[[str], None]], None],
        grown: Callable[[ServoBusDevice], None],
        failed: Callable[[str], None],
    ) -> None:
        """``run(done)`` starts a growth, which ends with ``done(problem)``; ``grown`` gets each device that it has
        added, ``failed`` its problem.
        """
        self._run = run
        self._grown = grown
        self._failed = failed
        self._waiting: list[ServoBusDevice] = []
        self._under_way: list[ServoBusDevice] | None = None
        """The new devices that the present growth adds; None while there is none."""
        self._is_asked_again = False
        self.is_complete = False
        """Whether the tree has had all devices once."""

    def add(self, device: ServoBusDevice) -> None:
        """Let the next growth add this device."""
        self._waiting.append(device)

    def begin(self) -> None:
        """Let the tree grow, now or behind the growth under way."""
        if self._under_way is not None:
            self._is_asked_again = True
            return
        self._under_way, self._waiting, self._is_asked_again = self._waiting, [], False
        self._run(self._end)

    def _end(self, problem: str) -> None:
        devices, self._under_way = self._under_way or [], None
        if problem:
            self._failed(problem)
        for device in devices:
            self._grown(device)
        if self._is_asked_again:
            self.begin()
        else:
            self.is_complete = True
