"""One device of the cycle: its health, its reading schedule, and the targets written to it.

A turning servo of the X series keeps turning when worker, daemon and adapter are dead. Its bus watchdog (register 98)
prevents that: it is armed before the first value other than 0 that makes the servo turn, and runs until it is cleared.
The data sheet does not say whether instructions to other servos reset it (unconfirmed), so an armed servo that is not
read otherwise is read every WATCHDOG_CHECK_PERIOD_S.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import packet
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.following import ServoFollower
from urbihw.buses.servos.health import Health
from urbihw.buses.servos.item import ControlTable, ShaftMotion, is_place
from urbihw.buses.servos.kept import EFFORTS, OWN_SPEEDS, PROFILE, KeptRegisters
from urbihw.buses.servos.plan import TORQUE, Block, read_blocks
from urbihw.buses.servos.units import unit_of
from urbihw.frozen import frozen

PLACE: Final = "present_position"
GOAL: Final = "goal_position"
WATCHDOG: Final = "bus_watchdog"
WATCHDOG_COUNTS: Final = 25
"""Time of the watchdog in units of 20 ms: a turning servo of the X series stops after half a second without an
instruction."""
WATCHDOG_CHECK_PERIOD_S: Final = 0.2
"""Seconds between two readings of an armed watchdog; the reading also resets it."""
FOLLOW_S: Final = 0.3
"""Seconds for which the position of a joint is read with each tick after its goal was bound to it."""
YIELD_S: Final = 0.3
"""Seconds for which a servo that answers again takes goals at once, if no motion is asked for: its own goal may have to
come from far."""
FIRED: Final = -1
"""The watchdog's value after it has stopped the servo; the servo accepts no goals until 0 is written."""


@dataclass(slots=True)
class _ReadSchedule:
    """Items that are read at one period."""

    period: float
    names: tuple[str, ...]
    due: float


@frozen
class BlockQuestion:
    """A block to read, with the packet that asks this device for it alone."""

    block: Block
    request: bytes


class Member:
    """A device that takes part in the cycle.

    Attributes:
        device: its description; `update_device` replaces it.
        health: ok, suspect, lost, back.
        pending: targets not yet sent, item -> raw.
        written: targets that the device has, item -> raw; empty when unknown.
        moved: it was given a motion since it was last stopped.
        stop_pending: a stop could not be executed yet, because its position could not be read.
        goal: the goal position that the servo has, raw; None while it is unknown.
        stiff: whether its torque is on; None while that is unknown.
        stiff_at: time at which that was known last.
        profile: its register PROFILE, raw; None while it is unknown.
        place: the present position as last read, raw; None before that.
        place_at: time of that reading.
        state: the lasting error bits of its answers as last reported.
        armed: its bus watchdog is running.
        follower: how its shaft follows its goal.
        limp_by: the registers of EFFORTS that are 0.
        kept: what it forgets with its power.
        in_doubt: an answer was missing: it may have been without power since, and gets no goal until it was looked at.
    """

    def __init__(self, device: ServoDevice) -> None:
        self.device = device
        self._table = device.table
        self.health = Health()
        self.pending: dict[str, int] = {}
        self.written: dict[str, int] = {}
        self.moved = False
        self.stop_pending = False
        self.goal: int | None = None
        self.stiff: bool | None = None
        self.stiff_at = -math.inf
        self.place: int | None = None
        self.place_at = -math.inf
        self.state = 0
        self.armed = device.setup.get(WATCHDOG, 0) > 0
        self.limp_by: set[str] = set()
        self.kept = KeptRegisters()
        self.in_doubt = False
        self._followed_until = -math.inf
        self._asks_for_goal = False
        self.profile: int | None = None
        self._profile_kept: int | None = None
        self._own_pace = math.inf
        self._yields_until = -math.inf
        self._moves_next = False
        self.follower = ServoFollower(*self._follows())
        self._watchdog_check_due = 0.0
        self._schedules: list[_ReadSchedule] = []
        self._questions: dict[tuple[str, ...], tuple[BlockQuestion, ...]] = {}

    @property
    def table(self) -> ControlTable:
        """Its control table. Raises BadValue for a device that has not told its model."""
        if self._table is None:
            raise BadValue(f"device {self.device.id} has not told its model, so its registers are unknown")
        return self._table

    @property
    def has_motor(self) -> bool:
        """False for a sensor, and for a device of an unknown model."""
        return self._table is not None and self._table.has_motor

    @property
    def answers_sync_read(self) -> bool:
        """Whether it can be read together with others."""
        return self._table is not None and self._table.sync_read

    @property
    def must_be_complete(self) -> bool:
        """Whether a lost device counts as back only with a complete description: it had one before, or had none at all.

        Other devices (status return level 0) answer nothing but pings.
        """
        return self.device.is_complete or not self.device.is_known

    def update_device(self, device: ServoDevice) -> None:
        """Replace the description of the device: it may be in another mode, or be another device."""
        if device.mode != self.device.mode:
            # Places of a wheel and of a joint are not counted alike: a jump between them is no motion.
            self.follower.forget()
        self.device = device
        self.armed = device.setup.get(WATCHDOG, 0) > 0
        if device.table is not self._table:
            self._table = device.table
            self.follower = ServoFollower(*self._follows())
            self._questions.clear()
            self._schedules.clear()

    def _follows(self) -> tuple[float, float]:
        """Return how it follows its goal: see `ServoFollower`."""
        if self._table is None or PLACE not in self._table.items:
            return 0.0, 0.0
        lag, full = self._table.follows
        unit = unit_of(self._table.items[PLACE])
        return lag, full / abs(unit.to_si(1) - unit.to_si(0))

    @property
    def count(self) -> float:
        """Rad for one count of its position."""
        unit = unit_of(self.table.item(PLACE))
        return abs(unit.to_si(1) - unit.to_si(0))

    def follow(self, now: float) -> None:
        """Read its position with each tick from now on: its goal is bound to it."""
        self._followed_until = now + FOLLOW_S

    @property
    def goal_range(self) -> tuple[int, int]:
        """The lowest and the highest goal that the servo takes."""
        goal, mode, setup = self.table.item(GOAL), self.device.mode, self.device.setup
        if mode is not None and mode.limits and all(name in setup for name in mode.limits):
            low, high = (setup[name] for name in mode.limits)
            return low, high
        return goal.low, goal.high

    @property
    def standing_goal(self) -> float | None:
        """The goal by which a joint with torque stands, nan while it is unknown; None for what is no such joint.

        While it is unknown, or something disturbs the joint, goal and torque are read with each tick: on AX servos to
        write a goal would switch the torque on.
        """
        mode = self.device.mode
        is_joint = self.has_motor and (mode is None or mode.motion is ShaftMotion.POSITION)
        if not is_joint or self.stiff is False or self.stop_pending or self.health.state != "ok":
            self._asks_for_goal = False
            return None
        since = self.follower.disturbed_since
        self._asks_for_goal = self.goal is None or not self.stiff or since is not None
        is_sure = self.stiff and (since is None or self.stiff_at >= since or self.device.protocol != 1)
        return self.goal if self.goal is not None and is_sure else math.nan

    def has_restarted(self, values: Mapping[str, int], alarmed: bool) -> bool:
        """Take a reading; return whether it tells that the servo was without power: its torque is off, or one of its
        registers has changed, and neither was written. An alarm (`alarmed`) takes the torque, too.
        """
        went_limp = bool(self.stiff) and values.get(TORQUE) == 0 and not alarmed
        if TORQUE in values:
            self.in_doubt = False
        return self.kept.has_lost(values) or went_limp

    def note_state(self, values: Mapping[str, int], now: float) -> None:
        """Take goal and torque, as written or as read."""
        if TORQUE in values:
            if values[TORQUE] and not self.stiff:
                # With its torque a servo may take another goal by itself.
                self.goal = None
            self.stiff, self.stiff_at = bool(values[TORQUE]), now
        self.profile = values.get(PROFILE, self.profile)
        for name in OWN_SPEEDS:
            if name in values:
                fastest = abs(unit_of(self.table.item(name)).to_si(values[name]))
                self._own_pace = fastest / self.count if fastest else math.inf
        if GOAL in values:
            self.goal = values[GOAL]
            if GOAL in self.written:
                self.written[GOAL] = values[GOAL]

    def reach(self, pace: float, push: float, now: float) -> tuple[float, float]:
        """Return the lowest and the highest goal that it can follow: see `ServoFollower.reach`; nan while unknown.

        `pace` is the highest speed that is wanted, in counts per second; its own register may bound it to less.
        """
        self.follow(now)
        place = math.nan if self.place is None else self.place
        bounds = self.follower.reach(place, now - self.place_at, min(pace, self._own_pace), push)
        low, high = self.goal_range
        return min(max(bounds[0], low), high), min(max(bounds[1], low), high)

    def note_effort(self, name: str, raw: int) -> None:
        """Take a value of a register of EFFORTS, as written or as read."""
        if raw:
            self.limp_by.discard(name)
        elif EFFORTS[name] in ("", *self.table.items):
            self.limp_by.add(name)

    def regains_force(self, name: str, raw: object) -> bool:
        """Return whether a write gives a limp joint its force back: it may have been turned since its last goal."""
        mode = self.device.mode
        return bool(raw) and name in self.limp_by and (mode is None or mode.motion is ShaftMotion.POSITION)

    def add_place(self, place: int, now: float) -> None:
        """Take a measured position."""
        self.place, self.place_at = place, now
        self.follower.add_reading(place, now, self.goal)

    def forget_place(self) -> None:
        """Its position is unknown: it may be moved by hand meanwhile."""
        self.place, self.place_at = None, -math.inf
        self.goal = self.stiff = None
        self.follower.forget()

    def come_back(self, now: float) -> None:
        """It answers again: meanwhile it may have been turned by hand, and its own goal stayed behind."""
        self.in_doubt = False
        self._yields_until = now + YIELD_S

    def yield_profile(self, now: float) -> None:
        """Let the servo take a goal at once while something disturbs the joint, and at its own speed again after that.

        A servo with a profile leads its own goal to the one that it is given, which a hand may overtake: when the hand
        lets go, that goal is far behind.
        """
        if not self._gives_way(now):
            if self._profile_kept is not None and self.health.state == "ok":
                self.pending[PROFILE] = self._profile_kept
        elif GOAL in self.pending and self._yields():
            self.pending[PROFILE] = 0

    def hold_at(self, goal: int, now: float) -> dict[str, int]:
        """Return the targets that hold a joint at a goal, which is taken at once if something disturbs it."""
        self.goal = goal
        self._moves_next = False
        if not self._gives_way(now) or not self._yields():
            return {GOAL: goal}
        self.profile = 0
        return {PROFILE: 0, GOAL: goal}

    def _gives_way(self, now: float) -> bool:
        """Return whether the joint is disturbed, or was out of sight a moment ago, and no motion of it is asked for."""
        return self.follower.disturbed_since is not None or (now < self._yields_until and not self._moves_next)

    def _yields(self) -> bool:
        """Return whether its profile must be switched off for a goal that is taken at once; it is kept then."""
        if not self.profile or not self._is_unlimited_at_zero(PROFILE):
            return False
        self._profile_kept = self.profile
        return True

    def _is_unlimited_at_zero(self, name: str) -> bool:
        return math.isinf(unit_of(self.table.item(name)).to_si(0))

    def set_target(self, name: str, raw: int, moves: bool = True) -> None:
        """Set a target for the next tick. Raises BadValue for an item or a value that cannot be a target.

        `moves`: it is a motion that was asked for; false for a goal that is led along with the joint.
        """
        item = self.table.item(name)
        if item.access != "RW" or item.area != "R" or name in self.table.mode_items:
            raise BadValue(f"{name} of {self.table.name} cannot be a target (write it with a Request)")
        item.check(raw)
        if self.moves(name) and moves:
            self.stop_pending = False
            self._moves_next = True
        if name == PROFILE and self._profile_kept is not None:
            self._profile_kept = raw
        elif self.written.get(name) == raw and not self._lets_stand(name, raw):
            self.pending.pop(name, None)
        else:
            self.pending[name] = raw
            if raw and self.must_arm_watchdog(name):
                self.pending[WATCHDOG] = WATCHDOG_COUNTS

    def _lets_stand(self, name: str, raw: int) -> bool:
        """Return whether a target lets a wheel stand: it is written anew, for another master may turn it."""
        mode = self.device.mode
        return not raw and mode is not None and mode.motion is ShaftMotion.RATE and name == mode.effector

    def must_arm_watchdog(self, name: str) -> bool:
        """Return whether a value other than 0 of this item makes the servo turn while its watchdog is not armed."""
        mode = self.device.mode
        turns = mode is not None and mode.motion is ShaftMotion.RATE and name == mode.effector
        return turns and not self.armed and WATCHDOG in self.table.items

    def rearm_watchdog(self) -> None:
        """Arm the watchdog with the next tick if a target makes the servo turn."""
        if any(raw and self.must_arm_watchdog(name) for name, raw in self.written.items()):
            self.pending[WATCHDOG] = WATCHDOG_COUNTS

    def sendable(self) -> Mapping[str, int]:
        """Return the targets to send now: while it is in doubt where and how a joint is, its goal waits."""
        if not self.in_doubt or GOAL not in self.pending:
            return self.pending
        return {name: raw for name, raw in self.pending.items() if name != GOAL}

    def mark_sent(self, now: float) -> None:
        """Record that the `sendable` targets are on the wire."""
        sent = dict(self.sendable())
        self.pending = {name: raw for name, raw in self.pending.items() if name not in sent}
        if not self.pending:
            self.moved = self.moved or self._moves_next
            self._moves_next = False
        # Kept apart from `written`: a stop clears that, while the watchdog keeps running.
        self.armed = self.armed or bool(sent.pop(WATCHDOG, 0))
        for name in EFFORTS.keys() & sent.keys():
            self.note_effort(name, sent[name])
        if sent.get(PROFILE):
            self._profile_kept = None
        self.kept.record(self.table, self.device.mode, sent)
        self.note_state(sent, now)
        self.written.update(sent)

    def record_write(self, name: str, raw: int, now: float) -> None:
        """Record the write of one item by a request, so that `written` and `setup` agree with the device."""
        if self.moves(name):
            self.moved, self.stop_pending = True, False
        elif name == TORQUE and not raw:
            self.follower.forget()
            # It is limp: a stop has nothing to hold, and on AX servos to write a goal would switch the torque on.
            self.moved = self.stop_pending = False
        if name in EFFORTS:
            self.note_effort(name, raw)
        self.kept.record(self.table, self.device.mode, {name: raw})
        self.note_state({name: raw}, now)
        if name == PROFILE:
            self._profile_kept = None
        self.written[name] = raw
        self.pending.pop(name, None)
        if name == WATCHDOG:
            self.armed = raw > 0
        if name in self.table.mode_items:
            self.goal = None
        if name in self.table.setup_items:
            self.device = replace(self.device, setup={**self.device.setup, name: raw})

    def moves(self, name: str) -> bool:
        """Return whether writing this item moves the shaft, or may: not the speed of a joint, but that of a wheel.

        Goals are kept by the servo and count in the mode that it is switched to, and a register that is known by its
        place only may be anything.
        """
        if name.startswith("goal_") or is_place(name):
            return True
        mode = self.device.mode
        modes = self.table.modes if mode is None and self._table is not None else (mode,)
        return any(mode is not None and name == mode.effector for mode in modes)

    def begins_to_turn(self, name: str, raw: object) -> bool:
        """Return whether writing this item makes a servo with torque turn, by switching to a mode that does.

        Models of protocol 1.0 change their mode while the torque is on, and then obey a speed that was written before.
        """
        table, device = self._table, self.device
        if table is None or table.protocol != 1 or name not in table.mode_items or not isinstance(raw, int):
            return False
        values = {**device.setup, name: raw}
        new = table.mode_of(values) if all(each in values for each in table.mode_items) else None
        return new is not None and new is not device.mode and new.motion is ShaftMotion.RATE

    def drop_targets(self) -> None:
        """Drop pending targets and the record of written ones: the device may have lost power, or was stopped."""
        self._moves_next = False
        self.pending.clear()
        self.written.clear()

    def watch(self, names: Iterable[str], period: float | None, now: float) -> None:
        """Read `names` each `period` seconds (0: every tick; None: never) from `now` on. Raises BadValue."""
        names = tuple(dict.fromkeys(names))
        read_blocks(self.table, names, self.device.protocol)
        for rhythm in self._schedules:
            rhythm.names = tuple(name for name in rhythm.names if name not in names)
        self._schedules = [rhythm for rhythm in self._schedules if rhythm.names]
        if period is None or not names:
            return
        for rhythm in self._schedules:
            if rhythm.period == period:
                rhythm.names += names
                return
        self._schedules.append(_ReadSchedule(period, names, now))

    def pop_due_items(self, now: float, tolerance: float) -> tuple[str, ...]:
        """Return the items to read in the tick at `now`, and schedule their next reading."""
        names: tuple[str, ...] = ()
        for rhythm in self._schedules:
            if rhythm.due <= now + tolerance:
                names += rhythm.names
                rhythm.due += rhythm.period
                if rhythm.due <= now:
                    # Late: continue from now; catching up on missed readings gives no fresher values.
                    rhythm.due = now + rhythm.period
        if now < self._followed_until and PLACE not in names:
            names = (*names, PLACE)
        if self._asks_for_goal:
            known = self.table.items
            names = (*names, *(name for name in (GOAL, TORQUE, PROFILE) if name in known and name not in names))
        names = self._with_witnesses(names)
        if self.armed and self._watchdog_check_due <= now + tolerance:
            # At the same tick for all devices, so that one group read asks them together.
            period = WATCHDOG_CHECK_PERIOD_S
            self._watchdog_check_due = math.floor((now + tolerance) / period + 1) * period
            names = (*names, *(() if WATCHDOG in names else (WATCHDOG,)))
        return names

    def _with_witnesses(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return what is read, and beside the torque what tells whether the servo has forgotten what was written."""
        if not (self.in_doubt or self.kept.is_unread or TORQUE in names):
            return names
        wanted = (*self.kept.witnesses, *((TORQUE,) if self.in_doubt else ()))
        return (*names, *(name for name in wanted if name not in names))

    def is_watched(self, name: str) -> bool:
        """Return whether an item is part of a watch."""
        return any(name in rhythm.names for rhythm in self._schedules)

    def questions(self, names: tuple[str, ...]) -> tuple[BlockQuestion, ...]:
        """Return the read packets for `names`, cached."""
        known = self._questions.get(names)
        if known is None:
            protocol = self.device.protocol
            known = self._questions[names] = tuple(
                BlockQuestion(block, packet.read_packet(protocol, self.device.id, block.address, block.size))
                for block in read_blocks(self.table, names, protocol)
            )
        return known
