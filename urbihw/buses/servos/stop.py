"""The safe stop, executed when the master sends Stop, falls silent, or dies.

Servos that turn (wheel, velocity, current, PWM mode) get 0. Joints that this driver has moved hold their position:
their goal becomes their present position, and the error by which they carry a weight, within their limits. A joint that
this driver has not moved is read: it gets a goal only if it is on its way, since another master moves it. Limp ones
stay limp, since on AX servos writing a goal switches the torque on. Torque is unchanged unless `torque_off`. Turning
servos and joints with a recent position are stopped first, since that needs no reading; the others are read one by one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Final

from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused
from urbihw.buses.servos import plan
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.item import ShaftMotion, number_of
from urbihw.buses.servos.member import GOAL, PLACE, Member
from urbihw.buses.servos.plan import TORQUE
from urbihw.buses.servos.units import unit_of

# A SYNC_WRITE is not acknowledged, so it is sent twice.
_REPEATS = 2
PRESENT_POSITION: Final = "here"
"""A goal value that stands for the position of the servo at the time of the write."""
ARRIVED_WITHIN_RAD: Final = 0.05
"""Distance to the goal in rad within which a joint has arrived; under load it stops short of its goal."""
JOINTS_AT_A_TIME: Final = 4
"""Joints that are looked at in one call while an emergency stop holds: each takes up to four transactions."""
FRESH_S: Final = 0.05
"""Age in s up to which a position is recent enough to hold at."""


def safe_stop(cycle: Cycle, torque_off: bool = False, devices: Collection[int] | None = None) -> None:
    """Stop the servos of `cycle`, all or some, and drop their targets (`torque_off`: also switch the torque off).

    A lost servo gets the packets too (it may receive although its answers are lost), but cannot be told to hold, since
    its position is unknown. Raises LinkGone.
    """
    bus = cycle.bus
    motors = [member for member in cycle.motors() if devices is None or member.device.id in devices]
    for member in motors:
        member.drop_targets()
    now = bus.clock.now()
    held = [member for member in motors if _is_moved_joint(member)]
    quick = {m.device.id: values for m in motors if (values := _zero_goal(m))}
    fresh = (m for m in held if m.place_at >= now - FRESH_S and m.health.state == "ok")
    quick |= {m.device.id: _hold_goal(m, now) for m in fresh}
    _write(bus, motors, quick)
    for member in held:
        if member.device.id in quick:
            member.moved = member.stop_pending = False
        elif member.health.state != "lost" and (known := _read_position(bus, member)) is not None:
            _write(bus, [member], {member.device.id: _hold_goal(member, now) if known else {}})
            member.moved = member.stop_pending = False
        else:
            # Its position cannot be read: the stop stays pending until it answers again.
            member.stop_pending = True
    if torque_off:
        _write(bus, motors, {member.device.id: {TORQUE: 0} for member in motors})
        for member in motors:
            # At once, not when it is read again: a goal that is led would switch the torque of an AX servo on.
            member.note_state({TORQUE: 0}, bus.clock.now())
    for member in motors:
        member.moved = member.moved and member.stop_pending


def full_stop(cycle: Cycle, torque_off: bool = False) -> None:
    """Stop all servos, also joints that another master has set moving. Raises LinkGone."""
    others = [] if torque_off else _unmoved_joints(cycle.motors())
    safe_stop(cycle, torque_off)
    stop_what_moves(cycle, others)


class StopPatrol:
    """Stops what another master moves while an emergency stop holds: wheels at each call, joints a few at a time."""

    def __init__(self) -> None:
        self._turn = 0

    def stop_again(self, cycle: Cycle) -> None:
        """Stop the wheels, and look at the next joints. Raises LinkGone."""
        motors = list(cycle.motors())
        safe_stop(cycle, devices=[member.device.id for member in motors if _zero_goal(member)])
        joints = _unmoved_joints(motors)
        begin = self._turn = 0 if self._turn >= len(joints) else self._turn
        self._turn += JOINTS_AT_A_TIME
        stop_what_moves(cycle, joints[begin : self._turn])


def hold_here(bus: ServoBus, member: Member) -> None:
    """Make the present position the goal of a joint that is about to get its force back. Raises LinkGone.

    The torque goes off and on while it is limp: a servo with a profile would else come back from the old goal.
    """
    member.pending.pop(GOAL, None)
    if _read_position(bus, member):
        member.follower.forget()
        goal = _hold_goal(member, bus.clock.now())
        for values in ({TORQUE: 0}, {TORQUE: 1}, goal):
            _write(bus, [member], {member.device.id: values})
        member.written.update(goal)


def give_back(cycle: Cycle, numbers: Iterable[int]) -> None:
    """Write what servos that are back may have forgotten; it goes before any goal. Raises LinkGone."""
    _write_kept(cycle.bus, [cycle.members[number] for number in numbers])


def give_back_after_mode(bus: ServoBus, member: Member) -> None:
    """Write what a servo of protocol 2.0 has reset by itself as its mode changed. Raises LinkGone."""
    if member.device.protocol == 2:
        # Targets of the old mode are no longer what the registers hold.
        member.written.clear()
        _write_kept(bus, [member])


def _write_kept(bus: ServoBus, members: Iterable[Member]) -> None:
    values = {member.device.id: member.kept.given_back(member.device.mode) for member in members if member.has_motor}
    _write(bus, members, values)


def execute_pending_stops(cycle: Cycle) -> None:
    """Execute the pending stops of joints that answer again. Raises LinkGone."""
    pending = [member for member in cycle.motors() if member.stop_pending and member.health.state == "ok"]
    if pending:
        safe_stop(cycle, devices=[member.device.id for member in pending])


def stop_what_moves(cycle: Cycle, members: Iterable[Member] | None = None) -> tuple[int, ...]:
    """Stop those of the servos (None: of all) that are moving although this cycle has not moved them; tell which.

    One that turns and does not answer gets the stop all the same: it may hear. Raises LinkGone.
    """
    bus = cycle.bus
    moving = []
    silent = []
    for member in cycle.motors() if members is None else members:
        mode = member.device.mode
        effector = None if mode is None or mode.motion is ShaftMotion.POSITION else member.table.item(mode.effector)
        try:
            if effector is not None:
                raw = effector.unpack(bus.read(member.device.id, effector.address, effector.size))
                bit = None if mode is None else mode.direction_bit
                goes = (raw if bit is None else number_of(raw, bit)) != 0
            else:
                goes = _is_on_its_way(bus, member)
        except (BusTimeout, BadFrame, DeviceRefused):
            silent.append(member.device.id)
            continue
        if goes:
            member.moved = True
            moving.append(member.device.id)
    if moving or silent:
        safe_stop(cycle, devices=[*moving, *silent])
    return tuple(moving)


def _is_on_its_way(bus: ServoBus, member: Member) -> bool:
    """Return whether a joint with torque is away from its goal: a slow one reports that it does not move."""
    number, item = member.device.id, member.table.item
    torque, goal, place = (item(name) for name in (TORQUE, GOAL, PLACE))
    if not torque.unpack(bus.read(number, torque.address, torque.size)):
        return False
    wanted = goal.unpack(bus.read(number, goal.address, goal.size))
    if wanted == member.goal:
        # The goal is ours: a weight has pulled it off; with each further goal there it would give way more.
        return False
    moving = member.table.items.get("moving")
    if moving is not None and moving.unpack(bus.read(number, moving.address, moving.size)):
        return True
    left = abs(wanted - place.unpack(bus.read(number, place.address, place.size)))
    count = unit_of(place).to_si(1) - unit_of(place).to_si(0)
    return left * count > ARRIVED_WITHIN_RAD


def _write(bus: ServoBus, members: Iterable[Member], values: Mapping[int, Mapping[str, int]]) -> None:
    """Write values, unacknowledged, and record them: what a servo then tells of them is no sign of a start."""
    groups: dict[int, list[plan.WriteGroup]] = {}
    for member in members:
        wanted = values.get(member.device.id)
        if wanted:
            group = plan.write_runs(member.table, wanted), [(member.device.id, wanted)]
            groups.setdefault(member.device.protocol, []).append(group)
            member.kept.record(member.table, member.device.mode, wanted)
    packets = b"".join(each for protocol, one in groups.items() for each in plan.sync_writes(protocol, one))
    if packets:
        for _ in range(_REPEATS):
            bus.send(packets)


def _zero_goal(member: Member) -> dict[str, int]:
    mode = member.device.mode
    return {mode.effector: 0} if mode is not None and mode.motion is ShaftMotion.RATE else {}


def _is_moved_joint(member: Member) -> bool:
    """Return whether it is a joint that this cycle has moved."""
    mode = member.device.mode
    return member.moved and (mode is None or mode.motion is ShaftMotion.POSITION)


def _unmoved_joints(motors: Iterable[Member]) -> list[Member]:
    """Return the joints that answer and that this cycle has not moved."""
    joints = [m for m in motors if m.device.mode is None or m.device.mode.motion is ShaftMotion.POSITION]
    return [member for member in joints if not member.moved and member.health.state == "ok"]


def _read_position(bus: ServoBus, member: Member) -> bool | None:
    """Read the position of a joint; False if it has no torque (after a loss of power), None if it does not answer."""
    present, torque = member.table.item(PLACE), member.table.item(TORQUE)
    try:
        stiff = torque.unpack(bus.read(member.device.id, torque.address, torque.size))
        member.note_state({TORQUE: stiff}, bus.clock.now())
        if not stiff:
            return False
        place = present.unpack(bus.read(member.device.id, present.address, present.size))
    except (BusTimeout, BadFrame, DeviceRefused):
        return None
    member.add_place(place, bus.clock.now())
    return True


def _hold_goal(member: Member, now: float) -> dict[str, int]:
    """Return the targets that hold a joint where it is, and record its goal."""
    if member.place is None:
        return {}
    rest = member.follower.rest(member.place, member.goal)
    return member.hold_at(_within_limits(member, round(rest)), now)


def _within_limits(member: Member, place: int) -> int:
    """Return a position within the limits: the servo refuses a goal outside them, and would keep moving."""
    low, high = member.goal_range
    return min(max(place, low), high)


def read_position_goal(bus: ServoBus, member: Member) -> int:
    """Read the position of a servo and return it as a goal, within the limits. Raises as `bus.read`."""
    present = member.table.item(PLACE)
    place = present.unpack(bus.read(member.device.id, present.address, present.size))
    member.add_place(place, bus.clock.now())
    return _within_limits(member, place)
