"""Requests to one servo, outside the cycle: it is read, written, identified, or restarted."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from urbihw.buses.errors import BadValue, BusError, LinkGone
from urbihw.buses.messages import Request
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.eeprom import write_register
from urbihw.buses.servos.indirect import check_indirect
from urbihw.buses.servos.item import ShaftMotion, is_place
from urbihw.buses.servos.member import FIRED, GOAL, WATCHDOG, WATCHDOG_COUNTS, Member
from urbihw.buses.servos.plan import TORQUE
from urbihw.buses.servos.scan import identify
from urbihw.buses.servos.stop import PRESENT_POSITION, give_back_after_mode, hold_here, read_position_goal
from urbihw.buses.servos.unheld import check_line


def access_device(cycle: Cycle, message: Request) -> Any:
    """Execute a request for one device, and return what it yields.  Raises BusError with the reason why not."""
    bus = cycle.bus
    member = cycle.member(message.device)
    if message.verb == "ping":
        member.update_device(identify(bus, message.device))
        return member.device.model
    if message.verb == "reboot":
        if member.device.protocol != 2:
            raise BadValue("only devices of protocol 2.0 can be rebooted; switch the power off and on")
        bus.reboot(message.device)
        member.drop_targets()
        member.forget_place()
        return 0
    if message.verb == "write_all":
        return tuple((name, _write(bus, member, name, value)) for name, value in message.value)
    if message.verb == "write":
        return _write(bus, member, message.item, message.value)
    item = member.table.item(message.item)
    value = item.unpack(bus.read(message.device, item.address, item.size))
    if item.name in member.table.setup_items:
        member.record_write(item.name, value, bus.clock.now())
    return value


def steps_of(request: Request) -> tuple[tuple[str, Any], ...]:
    """Return the writes of a request."""
    if request.verb == "write_all":
        return tuple(request.value)
    return ((request.item, request.value),) if request.verb == "write" else ()


def has_fired(device: ServoDevice) -> bool:
    """Return whether the bus watchdog of a servo has stopped it."""
    return device.setup.get(WATCHDOG) == FIRED


def clear_watchdogs(cycle: Cycle, numbers: Iterable[int]) -> None:
    """Clear the bus watchdog of servos that it has stopped, so that they accept goals again.  Raises LinkGone.

    The data sheet does not say whether such a servo keeps its last goal, so in a turning mode 0 is written right after.
    """
    for number in numbers:
        member = cycle.members[number]
        mode = member.device.mode
        try:
            _write(cycle.bus, member, WATCHDOG, 0)
            if mode is not None and mode.motion is ShaftMotion.RATE:
                _write(cycle.bus, member, mode.effector, 0)
        except LinkGone:
            raise
        except BusError:
            # No answer: the cycle will declare it lost, and identify it again on its return.
            continue


def _write(bus: ServoBus, member: Member, name: str, wanted: Any) -> int:
    """Write an item, and wait for the acknowledgement if the device sends one.

    An AX servo whose goal lies outside the limits that it was just given executes the write but reports an error, and
    an acknowledgement may get lost; so without an acknowledgement the register is read back. Raises as `bus.write`.
    """
    item = member.table.item(name)
    if item.access != "RW":
        raise BadValue(f"{item.name} of {member.table.name} can only be read")
    if wanted == PRESENT_POSITION:
        wanted = read_position_goal(bus, member)
    value = int(wanted)
    check_line(name, value)
    if is_place(name):
        check_indirect(bus, member, item, value)
    if member.regains_force(name, value):
        hold_here(bus, member)
    if value and member.must_arm_watchdog(name):
        _write(bus, member, WATCHDOG, WATCHDOG_COUNTS)
    try:
        write_register(bus, member.device, item, value)
    except BusError as error:
        if isinstance(error, LinkGone) or item.unpack(bus.read(member.device.id, item.address, item.size)) != value:
            raise
    member.record_write(item.name, value, bus.clock.now())
    if name in member.table.mode_items:
        give_back_after_mode(bus, member)
    if name == TORQUE and value:
        _read_goal(bus, member)
    return value


def _read_goal(bus: ServoBus, member: Member) -> None:
    """Look up the goal that a servo has taken by itself with its torque: the error from it is what it carries."""
    item = member.table.items.get(GOAL)
    if item is None:
        return
    try:
        member.written[GOAL] = member.goal = item.unpack(bus.read(member.device.id, item.address, item.size))
    except LinkGone:
        raise
    except BusError:
        return
