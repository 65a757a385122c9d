"""The state of the base, from its frames: cycles, counters that do not wrap, and switched motors and modes.

A cycle is the frames 0x0400 to 0x0407 in order. It ends with its last frame if all of them arrived, else when the next
cycle begins. The values of a missing frame remain for KEPT seconds and are dropped after that. The oldest firmware ends
its cycle with 0x0404 (inferred from CARMEN and old Player, which have five frames), so a base that has never sent more
counts as one with that firmware.

Counters have 32 bits and wrap; differences are computed modulo 2^32. The first reading is the origin. When the base was
off, its counters and its servo frame counter restart, and the totals here continue. A reset is not acknowledged:
readings of the next SETTLING seconds are ignored (segway_rmp), and the first reading after that is zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from urbihw.buses.can.frame import CanFrame
from urbihw.platforms.segway import protocol as p

SETTLING = 0.25
"""Seconds after a reset of the counters."""
KEPT: Final = 0.25
"""Seconds for which the values of a frame are valid."""
_SERVO_FRAME = 0.01
_TOLERANCE = 100
"""Tolerance in servo frames, for clocks and buffered data."""
_OLD = range(p.FIRST, p.LAST_OLD + 1)
_CYCLE = range(p.FIRST, p.LAST + 1)
_ALL = frozenset(_CYCLE)
_MODE = 0x406
_BITS = (*_CYCLE, p.STATUS)
MOVING_MODES: Final = (p.MODES.index("tractor"), p.MODES.index("balance"))
"""Modes in which the motors are on."""
RESET_BITS: Mapping[str, int] = {"right": 1, "left": 2, "yaw": 4, "forward": 8}
SWITCHED_OFF: Final = "the motors of the base were switched off"
SWITCHED_ON: Final = "the motors of the base were switched on"
OTHER_MODE: Final = "the base went into another mode"


def missing_words(bits: int) -> str:
    """Return the frames that a value of "missing" stands for, such as "0x0403, 0x0680"; "" for none."""
    return ", ".join(f"0x{identifier:04X}" for bit, identifier in enumerate(_BITS) if bits >> bit & 1)


def status_missing(bits: int) -> bool:
    """Return whether a value of "missing" contains the status words."""
    return bool(bits >> _BITS.index(p.STATUS) & 1)


class Monitor:
    """Collects frames with the times at which they were read.

    Attributes:
        heard_at: time of the last frame of the base; None before the first.
        cycle_at: time of the end of the last cycle; None before the first.
        off_at: time of the last report of the user interface box that the base is off; None if never.
        old: the base has the oldest firmware.
        restarts: number of detected restarts of the base.
        mode: the last reported mode; None before the first.

    A cycle also has "resets", the number of counter resets: differences across a reset are invalid; and "missing", the
    frames that do not arrive (see `missing_words`).
    """

    def __init__(self) -> None:
        self.heard_at: float | None = None
        self.cycle_at: float | None = None
        self.off_at: float | None = None
        self.old = False
        self.restarts = 0
        self._modern = False
        # The frames of the present cycle; None before the beginning of the first.
        self._seen: set[int] | None = None
        self._last = -1
        self._pending: dict[str, int] = {}
        self._values: dict[str, int] = {}
        # Frame -> time of its last arrival, since `_since`, the time from which the base was heard without a gap.
        self._came: dict[int, float] = {}
        self._since = 0.0
        self._raw: dict[str, int] = {}
        self._totals: dict[str, int] = {}
        self._servo: tuple[int, float] | None = None
        self._settled_at = dict.fromkeys(p.COUNTERS, 0.0)
        self._resets = 0
        self._first = b""
        self._on: bool | None = None
        self.mode: int | None = None
        self._switched = ""

    def add_frame(self, frame: CanFrame, now: float) -> None:
        """Process a frame; unknown frames are ignored."""
        identifier = frame.id
        if identifier == p.SHUTDOWN:
            self.off_at = now
            self._note_motors(False)
            return
        values = p.decode(identifier, frame.data)
        if not values:
            return
        if self.heard_at is None or now - self.heard_at > KEPT:
            self._came, self._since = {}, now
        self.heard_at = self._came[identifier] = now
        if identifier == p.STATUS:
            self._values |= values
            self._note_motors(p.motors_on(values["status1"]))
            return
        if "mode" in values:
            self._note_mode(values["mode"])
        self._add(frame, values, now)

    def drop_partial(self) -> None:
        """Drop the incomplete cycle: the line was interrupted."""
        self._pending, self._seen, self._last = {}, None, -1

    @property
    def latest(self) -> Mapping[str, int]:
        """The values of the last cycle by name, with the status words; empty before the first cycle."""
        if self.cycle_at is None:
            return {}
        known = dict(self._values)
        known["missing"] = sum(1 << _BITS.index(identifier) for identifier in self.missing)
        for identifier in self.missing:
            for name, _, _ in p.MONITOR[identifier]:
                known.pop(name, None)
        if self.old and p.FIRST in self.missing:
            known.pop(p.OLD_BATTERY[0], None)
        return known

    @property
    def missing(self) -> tuple[int, ...]:
        """The frames that do not arrive."""
        if self.heard_at is None:
            return ()
        late = self.heard_at - KEPT
        wanted = _OLD if self.old else (*_CYCLE, p.STATUS)
        return tuple(identifier for identifier in wanted if self._came.get(identifier, self._since) < late)

    @property
    def motors_off(self) -> bool:
        """Whether the motors are known to be off, by the status or by the mode."""
        missing = self.missing
        off = self._on is False and p.STATUS not in missing
        return off or (self.mode not in (None, *MOVING_MODES) and _MODE not in missing)

    def pop_switched(self) -> str:
        """Return what was switched since the last call, however briefly; "" if nothing was."""
        switched, self._switched = self._switched, ""
        return switched

    def reset(self, mask: int, now: float) -> None:
        """Note that the counters of a mask (see `protocol.CONFIGURATIONS`) are being reset."""
        self._resets += 1
        for name, bit in RESET_BITS.items():
            if mask & bit:
                self._totals[name] = 0
                self._settled_at[name] = now + SETTLING

    # ---------------------------------------------------------------- what was switched

    def _note_motors(self, on: bool) -> None:
        before, self._on = self._on, on
        if before is not None and before != on:
            self._note_switch(on)

    def _note_mode(self, mode: int) -> None:
        before, self.mode = self.mode, mode
        if before is None or before == mode:
            return
        drives = mode in MOVING_MODES
        if drives != (before in MOVING_MODES):
            self._note_switch(drives)
        elif drives and not self._switched:
            self._switched = OTHER_MODE

    def _note_switch(self, on: bool) -> None:
        if self._switched != SWITCHED_OFF:
            self._switched = SWITCHED_ON if on else SWITCHED_OFF

    # ---------------------------------------------------------------- cycles

    def _add(self, frame: CanFrame, values: dict[str, int], now: float) -> None:
        """Add a frame to the cycle; a frame whose number is not above the last begins a new cycle."""
        identifier, last = frame.id, self._last
        self._last = identifier
        self._modern |= identifier > p.LAST_OLD
        if identifier == p.FIRST:
            self._first = frame.data
        if identifier == p.FIRST or identifier <= last:
            if self._seen:
                self._finish(now)
            self._seen = set()
        if self._seen is None:
            # The line was opened during a cycle.
            return
        self._seen.add(identifier)
        self._pending |= values
        if self._seen == _ALL:
            self._finish(now)

    def _finish(self, now: float) -> None:
        """End a cycle: use its values."""
        assert self._seen is not None
        values, seen = self._pending, self._seen
        self._pending, self._seen = {}, set()
        self.old = not self._modern
        if self.old and p.FIRST in seen:
            values[p.OLD_BATTERY[0]] = p.old_battery(self._first)
        restarted = "servo_frames" in values and self._began_anew(values["servo_frames"], now)
        self.restarts += restarted
        if restarted:
            # The counters of frames that arrive later have restarted too.
            self._raw.clear()
        for name in p.COUNTERS:
            if name in values:
                values[name] = self._count(name, values[name], now)
        self._values |= values
        self._values["resets"] = self._resets
        self.cycle_at = now

    def _began_anew(self, frames: int, now: float) -> bool:
        """Return whether the servo frame counter shows that the base was off since the last cycle."""
        before, self._servo = self._servo, (frames, now)
        if before is None:
            return False
        expected = round((now - before[1]) / _SERVO_FRAME)
        return abs(p.difference(frames, before[0] + expected, 16)) > _TOLERANCE

    def _count(self, name: str, raw: int, now: float) -> int:
        last, self._raw[name] = self._raw.get(name), raw
        if last is None:
            self._totals.setdefault(name, raw)
        elif now >= self._settled_at[name]:
            self._totals[name] += p.difference(raw, last)
        return self._totals[name]
