"""One base, or the two halves of an RMP 400 as one: a monitor for each, and their common values.

The halves are two RMPs with two wheels each, front and back, which get the same commands (Player, libsegwayrmp).
Speeds, distances and angles are the means of both, voltages the lower ones, faults those of either. The motors count as
on when they are on in both; a value that one half does not report is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from urbihw.buses.can.frame import CanFrame
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway.monitor import OTHER_MODE, SWITCHED_OFF, SWITCHED_ON, Monitor

N = TypeVar("N", int, float)
_LOWEST: Final = {"battery", "box_battery", "mode", "build", "gain"}
_EITHER: Final = {"status2", "missing"}
_SEVERITY: Final = ("", OTHER_MODE, SWITCHED_ON, SWITCHED_OFF)


class Bases:
    """The monitors of all bases on the lines of a driver, with the attributes of one (see `Monitor`)."""

    def __init__(self) -> None:
        self._monitors = [Monitor()]

    def set_count(self, count: int) -> None:
        """Watch this number of bases; the state of those that stay is kept."""
        self._monitors = [*self._monitors, Monitor()][:count]

    def add_frame(self, which: int, frame: CanFrame, now: float) -> None:
        """Process a frame of a base, by its number from 0."""
        self._monitors[which].add_frame(frame, now)

    def drop_partial(self) -> None:
        """Drop incomplete cycles: a line was interrupted."""
        for monitor in self._monitors:
            monitor.drop_partial()

    def reset(self, mask: int, now: float) -> None:
        """Note that the counters of a mask are being reset in all bases."""
        for monitor in self._monitors:
            monitor.reset(mask, now)

    @property
    def heard_at(self) -> float | None:
        """Time of the last frame of the base that has been silent longest; None before the first."""
        return self._least(lambda monitor: monitor.heard_at)

    @property
    def cycle_at(self) -> float | None:
        """Time until which all bases have ended a cycle; None before the first."""
        return self._least(lambda monitor: monitor.cycle_at)

    @property
    def off_at(self) -> float | None:
        """Time of the last report that a base is off."""
        return max((each.off_at for each in self._monitors if each.off_at is not None), default=None)

    @property
    def old(self) -> bool:
        """Whether a base has the oldest firmware."""
        return any(monitor.old for monitor in self._monitors)

    @property
    def restarts(self) -> int:
        """The number of detected restarts."""
        return sum(monitor.restarts for monitor in self._monitors)

    @property
    def mode(self) -> int | None:
        """The mode of all bases; the lower one if they differ."""
        return self._least(lambda monitor: monitor.mode)

    @property
    def motors_off(self) -> bool:
        """Whether the motors of a base are known to be off."""
        return any(monitor.motors_off for monitor in self._monitors)

    def pop_switched(self) -> str:
        """Return the gravest of what was switched since the last call; "" if nothing was."""
        return max((monitor.pop_switched() for monitor in self._monitors), key=_SEVERITY.index)

    def silent_words(self, since: float) -> str:
        """Return which base has said nothing since a time."""
        if len(self._monitors) == 1:
            return "it says nothing"
        silent = [
            word
            for word, monitor in zip(("first", "second"), self._monitors, strict=True)
            if monitor.heard_at is None or monitor.heard_at < since
        ]
        return f"its {' and its '.join(silent)} half says nothing"

    @property
    def latest(self) -> Mapping[str, int]:
        """The common values of the last cycles; empty before the first."""
        first = self._monitors[0].latest
        if len(self._monitors) == 1:
            return first
        second = self._monitors[1].latest
        return {name: _merged(name, value, second[name]) for name, value in first.items() if name in second}

    def _least(self, value: Callable[[Monitor], N | None]) -> N | None:
        values = [value(monitor) for monitor in self._monitors]
        known = [each for each in values if each is not None]
        return min(known) if len(known) == len(values) else None


def _merged(name: str, one: int, other: int) -> int:
    if name == "status1":
        # The bits of what is on are set when they are in both, all others when they are in one.
        return ((one | other) & ~p.ENABLED) | (one & other & p.ENABLED)
    if name in _EITHER:
        return one | other
    return min(one, other) if name in _LOWEST else round((one + other) / 2)
