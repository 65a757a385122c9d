"""The safe stop: what the wire sees when the master says Stop, falls silent, or dies.

Servos that turn (wheel, velocity, current, PWM mode) get 0. Joints that the gateway has moved hold where they are:
their goal becomes their present position, within their limits. Joints that nobody moved are left alone: limp ones
stay limp, since on AX servos writing a goal switches the torque on. Torque stays as it was unless asked otherwise.
First comes what needs no question: turning servos, and joints whose position was read a moment ago. The others are
asked one after the other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Final

from urbihw.buses.dynamixel import plan
from urbihw.buses.dynamixel.bus import DynamixelBus
from urbihw.buses.dynamixel.cycle import Cycle
from urbihw.buses.dynamixel.item import Motion
from urbihw.buses.dynamixel.member import GOAL, PLACE, Member
from urbihw.buses.dynamixel.plan import TORQUE
from urbihw.buses.dynamixel.units import unit_of
from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused

# A SYNC_WRITE is confirmed by nobody, so it is said twice.
_TIMES = 2
HERE: Final = "here"
"""As a goal: where the servo is when that is written."""
ARRIVED: Final = 0.05
"""Radians between goal and place within which a joint has arrived; a load makes it stay behind by some."""
FRESH: Final = 0.05
"""Seconds for which a position that was read is good enough to hold at."""


def safe_stop(cycle: Cycle, torque_off: bool = False, devices: Collection[int] | None = None) -> None:
    """Stop the servos of `cycle`, all or some, and forget their targets (`torque_off`: switch off).

    A servo that is lost gets the packets too (it may hear without being heard), but cannot be told to hold.
    Raises LinkGone.
    """
    bus = cycle.bus
    motors = [member for member in cycle.motors() if devices is None or member.device.id in devices]
    for member in motors:
        member.forget()
    fresh = bus.clock.now() - FRESH
    held = [member for member in motors if _holds(member)]
    quick = {m.device.id: values for m in motors if (values := _zero(m))}
    quick |= {m.device.id: _hold(m) for m in held if m.place_at >= fresh and m.health.state == "ok"}
    _write(bus, motors, quick)
    for member in held:
        if member.device.id in quick:
            member.moved = member.stop_owed = False
        elif member.health.state != "lost" and (known := _look(bus, member)) is not None:
            _write(bus, [member], {member.device.id: _hold(member) if known else {}})
            member.moved = member.stop_owed = False
        else:
            # It does not say where it is, so it cannot be told to hold: as soon as it does.
            member.stop_owed = True
    if torque_off:
        _write(bus, motors, {member.device.id: {TORQUE: 0} for member in motors})
    for member in motors:
        member.moved = member.moved and member.stop_owed


def pay_stops(cycle: Cycle) -> None:
    """Stop the joints that could not be told to hold when the robot was stopped, and answer again. Raises LinkGone."""
    owed = [member for member in cycle.motors() if member.stop_owed and member.health.state == "ok"]
    if owed:
        safe_stop(cycle, devices=[member.device.id for member in owed])


def stop_what_moves(cycle: Cycle) -> tuple[int, ...]:
    """Stop the servos that are moving although this cycle has moved none, and tell which those are. Raises LinkGone."""
    bus = cycle.bus
    moving = []
    for member in cycle.motors():
        mode = member.device.mode
        effector = None if mode is None or mode.motion is Motion.POSITION else member.table.item(mode.effector)
        try:
            if effector is not None:
                goes = effector.unpack(bus.read(member.device.id, effector.address, effector.size)) != 0
            else:
                goes = _is_on_its_way(bus, member)
        except (BusTimeout, BadFrame, DeviceRefused):
            continue
        if goes:
            member.moved = True
            moving.append(member.device.id)
    if moving:
        safe_stop(cycle, devices=moving)
    return tuple(moving)


def _is_on_its_way(bus: DynamixelBus, member: Member) -> bool:
    """Whether a joint that has torque goes to its goal: it may be slow, and then says that it does not move."""
    number, item = member.device.id, member.table.item
    torque, moving, goal, place = (item(name) for name in (TORQUE, "moving", GOAL, PLACE))
    if not torque.unpack(bus.read(number, torque.address, torque.size)):
        return False
    if moving.unpack(bus.read(number, moving.address, moving.size)):
        return True
    wanted = goal.unpack(bus.read(number, goal.address, goal.size))
    left = abs(wanted - place.unpack(bus.read(number, place.address, place.size)))
    count = unit_of(place).to_si(1) - unit_of(place).to_si(0)
    return left * count > ARRIVED


def _write(bus: DynamixelBus, members: Iterable[Member], values: Mapping[int, Mapping[str, int]]) -> None:
    groups: list[plan.WriteGroup] = []
    for member in members:
        wanted = values.get(member.device.id)
        if wanted:
            groups.append((plan.write_runs(member.table, wanted), [(member.device.id, wanted)]))
    packets = b"".join(plan.sync_writes(bus.protocol, groups))
    if packets:
        for _ in range(_TIMES):
            bus.send(packets)


def _zero(member: Member) -> dict[str, int]:
    mode = member.device.mode
    return {mode.effector: 0} if mode is not None and mode.motion is Motion.RATE else {}


def _holds(member: Member) -> bool:
    """Whether it is a joint that we have moved."""
    mode = member.device.mode
    return member.moved and (mode is None or mode.motion is Motion.POSITION)


def _look(bus: DynamixelBus, member: Member) -> bool | None:
    """Read where a joint is; False if it is limp (it may have lost power) and stays so, None if it is silent."""
    present, torque = member.table.item(PLACE), member.table.item(TORQUE)
    try:
        if not torque.unpack(bus.read(member.device.id, torque.address, torque.size)):
            return False
        member.place = present.unpack(bus.read(member.device.id, present.address, present.size))
    except (BusTimeout, BadFrame, DeviceRefused):
        return None
    member.place_at = bus.clock.now()
    return True


def _hold(member: Member) -> dict[str, int]:
    return {} if member.place is None else {GOAL: _within_limits(member, member.place)}


def _within_limits(member: Member, place: int) -> int:
    """A goal outside the limits would be refused, and the servo would go on moving."""
    goal = member.table.item(GOAL)
    low, high = goal.low, goal.high
    mode, setup = member.device.mode, member.device.setup
    if mode is not None and mode.limits and all(name in setup for name in mode.limits):
        low, high = (setup[name] for name in mode.limits)
    return min(max(place, low), high)


def here(bus: DynamixelBus, member: Member) -> int:
    """Where a servo is now, as a goal for it. Raises what `bus.read` raises."""
    present = member.table.item(PLACE)
    member.place = present.unpack(bus.read(member.device.id, present.address, present.size))
    member.place_at = bus.clock.now()
    return _within_limits(member, member.place)
