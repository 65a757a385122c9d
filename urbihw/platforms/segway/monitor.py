"""What the base says, put together: whole cycles, counters that do not wrap, and whether it was off in between.

A cycle is the frames 0x0400 to 0x0407 in order; it counts when all of them came. The oldest firmware stops at 0x0404
(inferred from CARMEN and old Player, which know five), so a base that never said more is taken at its word.

Counters are 32 bits wide and wrap; differences are taken modulo 2^32. They begin where the base has them. When the base
was off, its counters and its servo frame counter begin anew; then ours go on from where they were. After a reset, which
is not acknowledged, readings of SETTLING seconds do not count (segway_rmp), and what the base then says is zero.
"""

from __future__ import annotations

from collections.abc import Mapping

from urbihw.buses.can.frame import Frame
from urbihw.platforms.segway import protocol as p

SETTLING = 0.25
"""Seconds after a reset of the counters."""
_SERVO_FRAME = 0.01
_TOLERANCE = 100
"""Servo frames by which clocks and waiting data may differ."""
_OLD = frozenset(range(p.FIRST, p.LAST_OLD + 1))
_ALL = frozenset(range(p.FIRST, p.LAST + 1))
RESET_BITS: Mapping[str, int] = {"right": 1, "left": 2, "yaw": 4, "forward": 8}


class Monitor:
    """Takes frames with the time they were read.

    Attributes:
        heard_at: when a whole cycle was last there; None before the first.
        off_at: when the user interface box last said that the base is off; None if never.
        old: the base has the oldest firmware.
        restarts: how often the base was found to have begun anew.

    A cycle also has "resets", how often the counters were reset: across one of those, differences mean nothing.
    """

    def __init__(self) -> None:
        self.heard_at: float | None = None
        self.off_at: float | None = None
        self.old = False
        self.restarts = 0
        self._modern = False
        self._seen: set[int] = set()
        self._pending: dict[str, int] = {}
        self._status: dict[str, int] = {}
        self._latest: dict[str, int] = {}
        self._raw: dict[str, int] = {}
        self._totals: dict[str, int] = {}
        self._settled_at = dict.fromkeys(p.COUNTERS, 0.0)
        self._resets = 0
        self._first = b""

    def take(self, frame: Frame, now: float) -> None:
        """Look at a frame; those of no interest pass by."""
        identifier = frame.id
        if identifier == p.SHUTDOWN:
            self.off_at = now
            return
        values = p.decode(identifier, frame.data)
        if not values:
            return
        if identifier == p.STATUS:
            self._status = values
            return
        if identifier == p.FIRST:
            self._finish_old(now)
            self._seen, self._pending, self._first = set(), {}, frame.data
        self._seen.add(identifier)
        self._pending.update(values)
        self._modern |= identifier > p.LAST_OLD
        if identifier == p.LAST and self._seen == _ALL:
            self.old = False
            self._finish(now)

    def drop_partial(self) -> None:
        """The line was interrupted: what came of a cycle so far does not count."""
        self._seen, self._pending = set(), {}

    @property
    def latest(self) -> Mapping[str, int]:
        """The last whole cycle by name, with the last status words; empty before the first."""
        return self._latest | self._status if self._latest else {}

    def reset(self, mask: int, now: float) -> None:
        """The counters of a mask (see `protocol.CONFIGURATIONS`) are being reset."""
        self._resets += 1
        for name, bit in RESET_BITS.items():
            if mask & bit:
                self._totals[name] = 0
                self._settled_at[name] = now + SETTLING

    def _finish_old(self, now: float) -> None:
        if not self._modern and self._seen == _OLD:
            self.old = True
            self._pending["battery"] = p.old_battery(self._first)
            self._finish(now)

    def _finish(self, now: float) -> None:
        values = self._pending
        self._pending, self._seen = {}, set()
        restarted = self.heard_at is not None and self._began_anew(values["servo_frames"], now - self.heard_at)
        self.restarts += restarted
        for name in p.COUNTERS:
            values[name] = self._count(name, values[name], restarted, now)
        values["resets"] = self._resets
        self.heard_at, self._latest = now, values

    def _began_anew(self, frames: int, elapsed: float) -> bool:
        """Whether the servo frame counter is not where it would be had the base been on since the last cycle."""
        last = self._latest["servo_frames"]
        expected = round(elapsed / _SERVO_FRAME)
        return abs(p.difference(frames, last + expected, 16)) > _TOLERANCE

    def _count(self, name: str, raw: int, restarted: bool, now: float) -> int:
        last, self._raw[name] = self._raw.get(name), raw
        if last is None:
            self._totals.setdefault(name, raw)
        elif not restarted and now >= self._settled_at[name]:
            self._totals[name] += p.difference(raw, last)
        return self._totals[name]
