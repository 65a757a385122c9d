"""One device as the cycle sees it: its health, what is read of it and when, what was written to it.

A servo of the X series that turns goes on turning when worker, daemon and adapter are dead. Its bus watchdog (register
98) ends that: it is armed in front of the first value other than 0 that makes the servo turn, and runs on until
somebody clears it. The sheet does not say whether instructions to others keep it quiet (unconfirmed), so an armed servo
that is not read anyway is looked at every WATCHDOG_LOOK.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from urbihw.buses.dynamixel import packet
from urbihw.buses.dynamixel.device import Device
from urbihw.buses.dynamixel.health import Health
from urbihw.buses.dynamixel.item import Motion, Table
from urbihw.buses.dynamixel.plan import Block, read_blocks
from urbihw.buses.errors import BadValue

PLACE: Final = "present_position"
GOAL: Final = "goal_position"
WATCHDOG: Final = "bus_watchdog"
WATCHDOG_COUNTS: Final = 25
"""Of 20 ms: after half a second without an instruction a servo of the X series that turns stops by itself."""
WATCHDOG_LOOK: Final = 0.2
"""Seconds between two looks at an armed watchdog: a look is also what keeps it quiet, if nothing else is read."""
FIRED: Final = -1
"""What the watchdog reads when it has stopped the servo; the servo takes no goals until 0 is written."""


@dataclass(slots=True)
class _Rhythm:
    """Items that are read at one period."""

    period: float
    names: tuple[str, ...]
    due: float


@dataclass(frozen=True, slots=True)
class Question:
    """A block to read, with the packet that asks this device for it alone."""

    block: Block
    request: bytes


class Member:
    """A device that takes part in the cycle.

    Attributes:
        device: what it said of itself; `meet` renews it.
        health: ok, suspect, lost, back.
        pending: targets not yet sent, item -> raw.
        written: targets it has, item -> raw; empty when we do not know.
        moved: we have told it to move since it was last stopped.
        stop_owed: it was to stop, and could not be told where to hold.
        place: the present position as last read, raw; None before that.
        place_at: when that was.
        state: the lasting error bits of its answers as last reported.
        armed: its bus watchdog runs.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self._table = device.table
        self.health = Health()
        self.pending: dict[str, int] = {}
        self.written: dict[str, int] = {}
        self.moved = False
        self.stop_owed = False
        self.place: int | None = None
        self.place_at = -math.inf
        self.state = 0
        self.armed = device.setup.get(WATCHDOG, 0) > 0
        self._look_due = 0.0
        self._rhythms: list[_Rhythm] = []
        self._questions: dict[tuple[str, ...], tuple[Question, ...]] = {}

    @property
    def table(self) -> Table:
        """Its control table. Raises BadValue for a model we have no table of."""
        if self._table is None:
            raise BadValue(f"device {self.device.id} is {self.device.name}, which urbihw has no control table of")
        return self._table

    @property
    def has_motor(self) -> bool:
        """False for a sensor, and for a device that we have no table of."""
        return self._table is not None and self._table.has_motor

    @property
    def must_be_whole(self) -> bool:
        """Whether it counts as there only when it tells all of itself: it did so before, or was never met.

        Others (status return level 0) answer nothing but pings.
        """
        return self.device.is_whole or not self.device.is_known

    def meet(self, device: Device) -> None:
        """Take in what the device says of itself now: it may be in another mode, or another device."""
        self.device = device
        self.armed = device.setup.get(WATCHDOG, 0) > 0
        if device.table is not self._table:
            self._table = device.table
            self._questions.clear()
            self._rhythms.clear()

    def aim(self, name: str, raw: int) -> None:
        """Take a new target for the next tick. Raises BadValue for an item or a value that cannot be a target."""
        item = self.table.item(name)
        if item.access != "RW" or item.area != "R":
            raise BadValue(f"{name} of {self.table.name} cannot be a target (write it with a Request)")
        item.check(raw)
        if self.moves(name):
            self.stop_owed = False
        if self.written.get(name) == raw:
            self.pending.pop(name, None)
        else:
            self.pending[name] = raw
            if raw and self.must_arm(name):
                self.pending[WATCHDOG] = WATCHDOG_COUNTS

    def must_arm(self, name: str) -> bool:
        """Whether the watchdog is to be armed before this item is given a value other than 0: the servo then turns."""
        mode = self.device.mode
        turns = mode is not None and mode.motion is Motion.RATE and name == mode.effector
        return turns and not self.armed and WATCHDOG in self.table.items

    def rearm(self) -> None:
        """The watchdog does not run: arm it with the next tick if the servo was told to turn."""
        if any(raw and self.must_arm(name) for name, raw in self.written.items()):
            self.pending[WATCHDOG] = WATCHDOG_COUNTS

    def sent(self) -> None:
        """Note that the pending targets are on the wire."""
        if not self.moved:
            self.moved = any(map(self.moves, self.pending))
        # Not among what is written: a stop forgets that, and the watchdog runs on.
        self.armed = self.armed or bool(self.pending.pop(WATCHDOG, 0))
        self.written.update(self.pending)
        self.pending.clear()

    def wrote(self, name: str, raw: int) -> None:
        """Note that one item was written apart from the targets, so that what we know of the device stays true."""
        if self.moves(name):
            self.moved, self.stop_owed = True, False
        self.written[name] = raw
        self.pending.pop(name, None)
        if name == WATCHDOG:
            self.armed = raw > 0
        if name in self.table.setup_items:
            self.device = replace(self.device, setup={**self.device.setup, name: raw})

    def moves(self, name: str) -> bool:
        """Does writing this item move the shaft? The speed of a joint does not; in an unknown mode anything may."""
        mode = self.device.mode
        return name.startswith("goal_") or (name == "moving_speed" and (mode is None or mode.motion is Motion.RATE))

    def forget(self) -> None:
        """Drop what is pending and what we believe it has: it may have lost power, or somebody stopped it."""
        self.pending.clear()
        self.written.clear()

    def watch(self, names: Iterable[str], period: float | None, now: float) -> None:
        """Read `names` each `period` seconds (0: every tick; None: never) from `now` on. Raises BadValue."""
        names = tuple(dict.fromkeys(names))
        read_blocks(self.table, names, self.device.protocol)
        for rhythm in self._rhythms:
            rhythm.names = tuple(name for name in rhythm.names if name not in names)
        self._rhythms = [rhythm for rhythm in self._rhythms if rhythm.names]
        if period is None or not names:
            return
        for rhythm in self._rhythms:
            if rhythm.period == period:
                rhythm.names += names
                return
        self._rhythms.append(_Rhythm(period, names, now))

    def due(self, now: float, tolerance: float) -> tuple[str, ...]:
        """Return the items to read at a tick at `now`, and plan their next time."""
        names: tuple[str, ...] = ()
        for rhythm in self._rhythms:
            if rhythm.due <= now + tolerance:
                names += rhythm.names
                rhythm.due += rhythm.period
                if rhythm.due <= now:
                    # Late: go on from here, reading twice at once makes nothing fresher.
                    rhythm.due = now + rhythm.period
        if self.armed and self._look_due <= now + tolerance:
            # At the same tick for all, so that they are asked together.
            self._look_due = math.floor((now + tolerance) / WATCHDOG_LOOK + 1) * WATCHDOG_LOOK
            names = (*names, *(() if WATCHDOG in names else (WATCHDOG,)))
        return names

    def is_watched(self, name: str) -> bool:
        """Whether anybody wants to hear of an item."""
        return any(name in rhythm.names for rhythm in self._rhythms)

    def questions(self, names: tuple[str, ...]) -> tuple[Question, ...]:
        """Return how to ask for `names`; computed once."""
        known = self._questions.get(names)
        if known is None:
            protocol = self.device.protocol
            known = self._questions[names] = tuple(
                Question(block, packet.read_packet(protocol, self.device.id, block.address, block.size))
                for block in read_blocks(self.table, names, protocol)
            )
        return known
