"""The safe stop: what the wire sees when the master says Stop, falls silent, or dies.

Servos that turn (wheel, velocity, current, PWM mode) get 0. Joints that the gateway has moved hold where they are:
their goal becomes their present position, within their limits. Joints that nobody moved are left alone: limp ones
stay limp, since on AX servos writing a goal switches the torque on. Torque stays as it was unless asked otherwise.
Turning servos come first, because holding needs a read per joint.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from urbihw.buses.dynamixel import plan
from urbihw.buses.dynamixel.bus import DynamixelBus
from urbihw.buses.dynamixel.cycle import Cycle
from urbihw.buses.dynamixel.item import Motion
from urbihw.buses.dynamixel.member import Member
from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused

# A SYNC_WRITE is confirmed by nobody, so it is said twice.
_TIMES = 2


def safe_stop(cycle: Cycle, torque_off: bool = False) -> None:
    """Stop all servos of `cycle` and forget all targets; `torque_off`: switch the motors off as well.

    A servo that is lost gets the packets too (it may hear without being heard), but cannot be told to hold.
    Raises LinkGone.
    """
    motors = [member for member in cycle.members.values() if member.device.table is not None and member.table.has_motor]
    for member in motors:
        member.forget()
    _write(cycle.bus, motors, {m.device.id: zero for m in motors if (zero := _zero(m))})
    _write(cycle.bus, motors, {m.device.id: hold for m in motors if (hold := _hold(cycle.bus, m))})
    if torque_off:
        _write(cycle.bus, motors, {member.device.id: {"torque_enable": 0} for member in motors})
    for member in motors:
        member.moved = False


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


def _hold(bus: DynamixelBus, member: Member) -> dict[str, int]:
    mode = member.device.mode
    if not member.moved or member.health.state == "lost" or (mode is not None and mode.motion is not Motion.POSITION):
        return {}
    present = member.table.item("present_position")
    try:
        place = present.unpack(bus.read(member.device.id, present.address, present.size))
    except (BusTimeout, BadFrame, DeviceRefused):
        return {}
    goal = member.table.item("goal_position")
    low, high = goal.low, goal.high
    setup = member.device.setup
    if mode is not None and mode.limits and all(name in setup for name in mode.limits):
        # A goal outside the limits would be refused, and the servo would go on moving.
        low, high = (setup[name] for name in mode.limits)
    return {goal.name: min(max(place, low), high)}
