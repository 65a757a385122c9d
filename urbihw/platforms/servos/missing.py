"""Which devices of a servo bus are expected and have not answered yet."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from urbihw.platforms.devicelog import DeviceLog


class MissingDevices:
    """Their numbers, in the order in which they were told; ``show`` is called with them after each change."""

    def __init__(self, log: DeviceLog, show: Callable[[list[float]], None]) -> None:
        self._log = log
        self._show = show
        self._numbers: dict[int, None] = {}
        self._looked_for: frozenset[int] = frozenset()

    def open(self, ids: Collection[int]) -> None:
        """The robot is about to be opened; only devices of these ids are looked for, of all if there are none."""
        self._looked_for = frozenset(ids)
        if ids:
            numbers = " ".join(map(str, sorted(self._looked_for)))
            self._log.info("only ids %s are looked for (options.ids); other devices on the bus are left out", numbers)

    def reload(self, ids: Collection[int], expected: Iterable[int]) -> None:
        """The settings were read again: what they do not name any more is not missing."""
        before, self._looked_for = self._looked_for, frozenset(ids)
        if before != self._looked_for:
            self._log.info("options.ids: other devices are looked for when the link to the robot opens again")
        if self._looked_for:
            named = self._looked_for | {*expected}
            self._numbers = {number: None for number in self._numbers if number in named}
        self._show([*map(float, self._numbers)])

    def add(self, number: int) -> None:
        """A device that was not found yet is silent."""
        self._numbers[number] = None
        self._show([*map(float, self._numbers)])

    def found(self, number: int) -> None:
        """A device has answered for the first time: it is missing no more."""
        if number in self._numbers:
            del self._numbers[number]
            self._show([*map(float, self._numbers)])

    def words(self) -> str:
        """The end of the status of the robot."""
        return f", missing: {' '.join(map(str, self._numbers))}" if self._numbers else ""
