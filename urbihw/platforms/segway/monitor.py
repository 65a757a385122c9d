"""What the base says, put together: cycles, counters that do not wrap, and what was switched in between.

A cycle is the frames 0x0400 to 0x0407 in order. It is over with its last frame when all of them came, else when the
next one begins: then it has what came, and the values of a frame that is missing stay as they were for KEPT seconds and
are gone after that. The oldest firmware stops at 0x0404 (inferred from CARMEN and old Player, which know five), so a
base that never said more is taken at its word.

Counters are 32 bits wide and wrap; differences are taken modulo 2^32. They begin where the base has them. When the base
was off, its counters and its servo frame counter begin anew; then ours go on from where they were. After a reset, which
is not acknowledged, readings of SETTLING seconds do not count (segway_rmp), and what the base then says is zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from urbihw.buses.can.frame import Frame
from urbihw.platforms.segway import protocol as p

SETTLING = 0.25
"""Seconds after a reset of the counters."""
KEPT: Final = 0.25
"""Seconds for which the values of a frame are good."""
_SERVO_FRAME = 0.01
_TOLERANCE = 100
"""Servo frames by which clocks and waiting data may differ."""
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
    """The frames of a number "missing", such as "0x0403, 0x0680"; "" for none."""
    return ", ".join(f"0x{identifier:04X}" for bit, identifier in enumerate(_BITS) if bits >> bit & 1)


def status_missing(bits: int) -> bool:
    """Whether the status words are among the frames of a number "missing"."""
    return bool(bits >> _BITS.index(p.STATUS) & 1)


class Monitor:
    """Takes frames with the time they were read.

    Attributes:
        heard_at: when any frame of the base was last there; None before the first.
        cycle_at: when a cycle was last over; None before the first.
        off_at: when the user interface box last said that the base is off; None if never.
        old: the base has the oldest firmware.
        restarts: how often the base was found to have begun anew.
        mode: as it last told; None before it did.

    A cycle also has "resets", how often the counters were reset: across one of those, differences mean nothing; and
    "missing", the frames that stay out (see `missing_words`).
    """

    def __init__(self) -> None:
        self.heard_at: float | None = None
        self.cycle_at: float | None = None
        self.off_at: float | None = None
        self.old = False
        self.restarts = 0
        self._modern = False
        # The frames of the running cycle; None until a beginning was seen.
        self._seen: set[int] | None = None
        self._last = -1
        self._pending: dict[str, int] = {}
        self._values: dict[str, int] = {}
        # Frame -> when it last came, since the base was last heard without a gap; that began at `_since`.
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

    def take(self, frame: Frame, now: float) -> None:
        """Look at a frame; those of no interest pass by."""
        identifier = frame.id
        if identifier == p.SHUTDOWN:
            self.off_at = now
            self._look_at_motors(False)
            return
        values = p.decode(identifier, frame.data)
        if not values:
            return
        if self.heard_at is None or now - self.heard_at > KEPT:
            self._came, self._since = {}, now
        self.heard_at = self._came[identifier] = now
        if identifier == p.STATUS:
            self._values |= values
            self._look_at_motors(p.motors_on(values["status1"]))
            return
        if "mode" in values:
            self._look_at_mode(values["mode"])
        self._add(frame, values, now)

    def drop_partial(self) -> None:
        """The line was interrupted: what came of a cycle so far does not count."""
        self._pending, self._seen, self._last = {}, None, -1

    @property
    def latest(self) -> Mapping[str, int]:
        """What is known by name, with the status words; empty before the first cycle."""
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
        """The frames that stay out."""
        if self.heard_at is None:
            return ()
        late = self.heard_at - KEPT
        wanted = _OLD if self.old else (*_CYCLE, p.STATUS)
        return tuple(identifier for identifier in wanted if self._came.get(identifier, self._since) < late)

    @property
    def motors_off(self) -> bool:
        """Whether the base is known not to drive: its motors are off, or its mode is one without."""
        missing = self.missing
        off = self._on is False and p.STATUS not in missing
        return off or (self.mode not in (None, *MOVING_MODES) and _MODE not in missing)

    def take_switched(self) -> str:
        """What was switched since the last call, however short: "" if nothing was."""
        switched, self._switched = self._switched, ""
        return switched

    def reset(self, mask: int, now: float) -> None:
        """The counters of a mask (see `protocol.CONFIGURATIONS`) are being reset."""
        self._resets += 1
        for name, bit in RESET_BITS.items():
            if mask & bit:
                self._totals[name] = 0
                self._settled_at[name] = now + SETTLING

    # ---------------------------------------------------------------- what was switched

    def _look_at_motors(self, on: bool) -> None:
        before, self._on = self._on, on
        if before is not None and before != on:
            self._note_switch(on)

    def _look_at_mode(self, mode: int) -> None:
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

    def _add(self, frame: Frame, values: dict[str, int], now: float) -> None:
        """A frame of a cycle; one whose number is not above the last begins a new one."""
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
            # The line was opened in the middle of a cycle.
            return
        self._seen.add(identifier)
        self._pending |= values
        if self._seen == _ALL:
            self._finish(now)

    def _finish(self, now: float) -> None:
        """A cycle is over: what it has counts."""
        assert self._seen is not None
        values, seen = self._pending, self._seen
        self._pending, self._seen = {}, set()
        self.old = not self._modern
        if self.old and p.FIRST in seen:
            values[p.OLD_BATTERY[0]] = p.old_battery(self._first)
        restarted = "servo_frames" in values and self._began_anew(values["servo_frames"], now)
        self.restarts += restarted
        if restarted:
            # Counters that come later have begun anew too.
            self._raw.clear()
        for name in p.COUNTERS:
            if name in values:
                values[name] = self._count(name, values[name], now)
        self._values |= values
        self._values["resets"] = self._resets
        self.cycle_at = now

    def _began_anew(self, frames: int, now: float) -> bool:
        """Whether the servo frame counter is not where it would be had the base been on since it was last told."""
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
