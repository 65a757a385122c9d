"""The driver of a Dynamixel bus: messages of the worker to `Cycle` and back.

It outlives the link: watches, known devices and the set of moved servos are kept while the adapter is unplugged;
targets are dropped, so that nothing moves by itself when it returns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadValue
from urbihw.buses.link import Port, byte_link
from urbihw.buses.messages import (
    Configure,
    DeviceState,
    Found,
    FromWorker,
    GuestsGone,
    Limit,
    Refused,
    Reply,
    Request,
    Samples,
    Watch,
)
from urbihw.buses.readings import Reading
from urbihw.buses.servos.access import access_device, clear_watchdogs, has_fired, steps_of
from urbihw.buses.servos.bodywatch import BodyWatch
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.cycle import Cycle, Tick
from urbihw.buses.servos.device import DeviceInfo, ServoDevice, ServoScan, describe_devices, info_of, same_kind
from urbihw.buses.servos.item import magnitude_of, number_of
from urbihw.buses.servos.kept import KeptRegisters
from urbihw.buses.servos.member import GOAL, WATCHDOG_COUNTS, Member
from urbihw.buses.servos.options import ServoBusOptions
from urbihw.buses.servos.plan import TORQUE
from urbihw.buses.servos.readings import reading_of
from urbihw.buses.servos.scan import ScanInterrupted, scan
from urbihw.buses.servos.stop import (
    StopPatrol,
    execute_pending_stops,
    full_stop,
    give_back,
    hold_here,
    safe_stop,
    stop_what_moves,
)
from urbihw.buses.servos.toss import enter_toss_mode, has_toss_speed, request_toss_mode
from urbihw.buses.servos.unheld import explain_target, explain_writes, is_speed_after, leaves_place
from urbihw.buses.servos.units import unit_of

# Seconds between scans of a bus without devices (robot switched off?); a scan writes nothing.
_SCAN_PERIOD_S = 3.0
_GONE = "it does not answer"
_UNREAD = "it answers pings, and its registers cannot be read: a busy computer, or status return level 0"


class ServoDriver(Driver):
    """The driver of the family "servos"; `urbihw.buses.driver.Driver` describes the calls of the engine.

    Verbs: "read", "write"; "write_all" writes the pairs (item, value) of `value` one after the other, until one is
    refused, and returns them; the value `PRESENT_POSITION` stands for the servo's position at that moment; "ping"
    returns the model number, "reboot" restarts a protocol 2.0 device, "scan" searches devices on all ids (0.5 s during
    which the cycle pauses: not while the robot moves; a stop ends it), posts `Found` and returns the number of devices.
    The item "state" holds the lasting error bits of the answers when they change, in words:
    `urbihw.buses.servos.status.state_words`.
    """

    slow_verbs = frozenset({"scan"})
    device_info = DeviceInfo
    knows_motion = True

    def __init__(self) -> None:
        self._settings = Configure()
        self._options = ServoBusOptions()
        self._cycle: Cycle | None = None
        self._patrol = StopPatrol()
        self._body = BodyWatch()
        self._known: dict[int, ServoDevice] = {}
        self._conflicts: tuple[int, ...] = ()
        """The ids to which several devices answered in the last scan."""
        self._expected: tuple[int, ...] = ()
        self._unread: set[int] = set()
        self._urgent: Callable[[], bool] = no_stop
        self._moved: set[int] = set()
        self._kept: dict[int, tuple[str, KeptRegisters]] = {}
        self._watches: dict[tuple[int, str], float] = {}
        self._next_scan_at = 0.0
        self._told: dict[int, DeviceInfo] = {}
        """The devices as the last `Found` described them."""
        self._guests: set[int] = set()
        """The ids of another robot, found while no device of the own one answered."""

    def configure(self, settings: Configure) -> None:
        """Apply settings; the protocol and the ids take effect with the next `attach`. Raises BadSetting."""
        self._options = ServoBusOptions.of(settings.options)
        self._settings = settings
        self._body.options = self._options
        if self._cycle is not None:
            self._cycle.period = 1 / settings.rate
            self._cycle.fast = self._options.fast_read

    @property
    def _ids(self) -> tuple[int, ...] | None:
        """The ids to scan, None for all."""
        return self._options.ids or None

    def expect_devices(self, devices: tuple[Any, ...]) -> None:
        """Scan for the devices of an earlier worker only: this takes less time than scanning all ids.

        One that does not answer then is lost, not forgotten.
        """
        self._expected = tuple(device.id for device in devices if isinstance(device, DeviceInfo))

    def attach(self, port: Port) -> list[FromWorker]:
        """Find the devices on an open link: all (or the configured) ones the first time, the known ones later."""
        bus = ServoBus(byte_link(port), self._options.protocol)
        if self._options.controller:
            enter_toss_mode(bus.link)
        outcome = self._scan_bus(bus, sorted(self._known) if self._known else self._expected or self._ids)
        if self._known and 2 * len(outcome.devices) < len(self._known):
            # Another robot may have been plugged in.
            outcome = self._scan_bus(bus, self._ids)
        self._identify_robot([info_of(device) for device in outcome.devices])
        gone = self._sort_out_guests(outcome)
        return [*gone, *self._start_cycle(bus, outcome, self._absent_devices(bus, outcome))]

    def _sort_out_guests(self, outcome: ServoScan) -> list[FromWorker]:
        """Return `GuestsGone` for the devices of another robot, if the own one is back without them.

        Devices are those of another robot if they were found while nothing of the own one answered.
        """
        present = {device.id for device in outcome.devices}
        expected = {*self._options.ids, *(each.id for each in self._settings.expected)}
        own = (self._told.keys() | expected) - self._guests
        if not self._told or not present:
            return []
        if not present & own:
            self._guests |= present
            return []
        gone, self._guests = self._guests, self._guests & present
        gone = gone - present
        for number in gone:
            self._known.pop(number, None)
            self._told.pop(number, None)
        self._moved -= gone
        return [GuestsGone(tuple(sorted(gone)))] if gone else []

    def _absent_devices(self, bus: ServoBus, outcome: ServoScan) -> list[ServoDevice]:
        """Return the devices that are known or expected and did not answer to a scan, and those that it could not read:
        they are found when they answer."""
        expected = {*self._options.ids, *(each.id for each in self._settings.expected), *self._unread, *self._expected}
        wanted = {
            number: ServoDevice(number, 0, 0, bus.protocol_of(number)) for number in sorted(expected)
        } | self._known
        # A known device is kept even when its answer was damaged: it may be turning, and must be stopped.
        there = {device.id for device in outcome.devices} | ({*outcome.conflicts} - self._known.keys())
        return [device for number, device in wanted.items() if number not in there]

    def _identify_robot(self, found: list[DeviceInfo]) -> None:
        """Set `identity`: it stays while only known devices answer; servos have no serial numbers."""
        if not all(same_kind(self._told.get(info.id), info) for info in found) or (found and not self.identity):
            self.identity = describe_devices(found)

    def detach(self) -> None:
        """Drop the cycle and its targets; remember which servos were moved, and what was written to them."""
        if self._cycle is not None:
            self._moved = {number for number, member in self._cycle.members.items() if member.moved}
            members = self._cycle.members
            self._kept |= {number: (info_of(member.device).family, member.kept) for number, member in members.items()}
            self._cycle = None

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Execute one tick of the cycle; `meanwhile` is called while the wire is busy. Raises LinkGone."""
        cycle = self._cycle
        if cycle is None:
            return []
        self._urgent = urgent
        if not cycle.members:
            return self._scan_if_due(cycle, now)
        for member in cycle.motors():
            member.yield_profile(now)
        tick = cycle.tick(now, meanwhile, urgent)
        self._request_toss_if_silent(cycle, now)
        execute_pending_stops(cycle)
        if tick.fired:
            # They stand and accept no goals. So long a silence on the bus counts as a stop of the whole robot.
            which = ", ".join(map(str, tick.fired))
            self.halted = f"servo {which} stopped by itself: it got no packet for {WATCHDOG_COUNTS * 0.02:g} s"
            clear_watchdogs(cycle, tick.fired)
        bodies = self._body.look(cycle.motors(), cycle.bus.clock.now())
        self.stopped_devices = bodies.stopped
        if bodies.slack:
            # It waits for no answer: one that is missing must not end the tick.
            safe_stop(cycle, torque_off=True, devices=bodies.slack)
        back = [number for number, change in tick.changes if change.new == "back"]
        give_back(cycle, back)
        clear_watchdogs(cycle, [number for number in back if has_fired(cycle.members[number].device)])
        found = self._newly_found(cycle, tick) + self._changed_devices(cycle, back)
        return found + _tick_messages(tick) + bodies.reports

    def set_target(self, device: Any, item: str, value: Any) -> None:
        if self._cycle is None:
            return
        if self.regains_force(device, item, value):
            hold_here(self._cycle.bus, self._cycle.members[device])
        self._cycle.set_target(device, item, value)

    def lead(self, goals: Mapping[tuple[Any, str], Any]) -> None:
        if self._cycle is not None:
            for (device, item), raw in goals.items():
                self._cycle.set_target(device, item, raw, moves=False)

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Begin, change or end a watch."""
        for item in message.items:
            if message.period is None:
                self._watches.pop((message.device, item), None)
            else:
                self._watches[message.device, item] = message.period
        if self._cycle is None:
            return []
        try:
            self._cycle.watch(message.device, message.items, message.period, now)
        except BadValue as error:
            for item in message.items:
                self._watches.pop((message.device, item), None)
            return [Refused(message.device, ", ".join(message.items), str(error))]
        return []

    def execute_request(self, message: Request) -> list[FromWorker]:
        if self._cycle is None:
            raise BadValue("the link is down")
        if message.verb == "scan":
            found = self._rescan(self._cycle)
            return [*found, Reply(message.reply_id, True, len(self._known))]
        return [Reply(message.reply_id, True, access_device(self._cycle, message))]

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the robot, or some devices. Raises LinkGone."""
        if self._cycle is None:
            return
        if devices is None:
            full_stop(self._cycle, self._settings.torque_off_on_stop)
        else:
            safe_stop(self._cycle, self._settings.torque_off_on_stop, devices)

    def stop_again(self) -> None:
        """Stop wheels, and joints that another master moves. Raises LinkGone."""
        if self._cycle is not None:
            self._patrol.stop_again(self._cycle)

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Stop servos that move after the first `attach`; return their ids. Raises LinkGone."""
        return () if self._cycle is None else stop_what_moves(self._cycle)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Goals of all kinds, speeds of wheels, and torque on: an AX servo then goes to its last goal."""
        member = None if self._cycle is None else self._cycle.members.get(device)
        return member is not None and (member.moves(item) or (item == TORQUE and value != 0))

    def request_moves(self, request: Request) -> bool:
        """As `moves`, and a mode in which the servo turns; of several writes one is enough.

        Several writes may switch to such a mode without a motion: they set the speed before and after.
        """
        if request.verb == "write_all":
            return any(self.moves(request.device, item, value) for item, value in request.value)
        if request.verb != "write" or self._cycle is None or request.device not in self._cycle.members:
            return False
        member = self._cycle.members[request.device]
        turns = member.begins_to_turn(request.item, request.value)
        return turns or self.moves(request.device, request.item, request.value)

    def unheld_target(self, device: Any, item: str, value: Any, limits: Mapping[tuple[Any, str], Limit]) -> str:
        member = self._table_member(device)
        return "" if member is None else explain_target(member, item, value, limits)

    def unheld_request(self, request: Request, limits: Mapping[tuple[Any, str], Limit]) -> str:
        member = self._table_member(request.device)
        if member is None:
            return ""
        return explain_writes(member, steps_of(request), request.verb == "write", limits)

    def rests(self, request: Request, at: int) -> bool:
        """A speed of 0 behind the writes that make a wheel of a joint; for a joint that is its full speed."""
        member, steps = self._table_member(request.device), steps_of(request)
        name, raw = steps[at]
        if member is None or raw:
            return False
        return is_speed_after(member, steps[:at], name) and is_speed_after(member, steps, name)

    def displaced(self, request: Request) -> tuple[Any, ...]:
        """Torque, mode, restart and the end of an effort of 0; until then its goal is where it was sent last."""
        member = self._table_member(request.device)
        leaves = request.verb == "reboot" or (member is not None and leaves_place(member, steps_of(request)))
        return (request.device,) if leaves else ()

    def limits_changed(self, limits: Mapping[tuple[Any, str], Limit]) -> None:
        """Judge the speed of bodies by them."""
        self._body.limits = limits

    def regains_force(self, device: Any, item: str, value: Any) -> bool:
        """A register of `EFFORTS` was 0: the joint goes on from where it is, as after torque on."""
        member = self._table_member(device)
        return member is not None and member.regains_force(item, value)

    def _table_member(self, device: Any) -> Member | None:
        """Return a member with a control table."""
        member = None if self._cycle is None else self._cycle.members.get(device)
        return None if member is None or member.device.table is None else member

    def pose(self, device: Any, item: str) -> float | None:
        """The present position as last read, for the goal position; nan before that."""
        if item != GOAL:
            return None
        if self._cycle is None or device not in self._cycle.members:
            return math.nan
        member = self._cycle.members[device]
        member.follow(self._cycle.bus.clock.now())
        return math.nan if member.place is None else member.place

    def reach(self, device: Any, item: str, pace: float, now: float) -> tuple[float, float] | None:
        """Bounds for the goal of a joint, around the position as last read: see `ServoFollower`."""
        member = None if self._cycle is None else self._cycle.members.get(device)
        if item != GOAL or member is None:
            return None
        if member.device.table is None:
            # It was expected, and has not told yet what it is.
            return math.nan, math.nan
        return member.reach(pace, self._options.push, now)

    def joints(self) -> Iterable[tuple[Any, str]]:
        return () if self._cycle is None else [(member.device.id, GOAL) for member in self._cycle.motors()]

    def standing_goal(self, device: Any, item: str) -> float | None:
        member = self._table_member(device)
        return None if item != GOAL or member is None else member.standing_goal

    def signed(self, device: Any, item: str, raw: Any) -> float:
        """The speed of an AX wheel has its direction in a bit; the speed of a joint is without a limit at 0."""
        bit = self._direction_bit(device, item)
        if raw == 0 and bit is None and self._is_unlimited_at_zero(device, item):
            return math.inf
        return float(raw if bit is None else number_of(raw, bit))

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """Return the raw target of a signed number: the inverse of `signed`."""
        bit = self._direction_bit(device, item)
        if math.isinf(signed):
            return 0
        return round(signed) if bit is None else magnitude_of(round(signed), bit)

    def _is_unlimited_at_zero(self, device: Any, item: str) -> bool:
        """Whether 0 of a register of a joint is no limit."""
        member = self._table_member(device)
        if member is None or item not in member.table.items:
            return False
        mode = member.device.mode
        turns = mode is not None and mode.effector == item
        return not turns and math.isinf(unit_of(member.table.items[item]).to_si(0))

    def _direction_bit(self, device: Any, item: str) -> int | None:
        member = None if self._cycle is None else self._cycle.members.get(device)
        mode = None if member is None else member.device.mode
        return mode.direction_bit if mode is not None and mode.effector == item else None

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return a measured value or a target in SI units, with the range of the model."""
        member = None if self._cycle is None else self._cycle.members.get(device)
        return None if member is None else reading_of(member.device, item, raw)

    def errors(self) -> dict[str, int]:
        """Return failures since `attach`, by kind."""
        return {} if self._cycle is None else asdict(self._cycle.bus.counters)

    def turnaround(self) -> float:
        return 0.0 if self._cycle is None else self._cycle.bus.response_timeout.mean

    def _start_cycle(self, bus: ServoBus, outcome: ServoScan, lost: Iterable[ServoDevice]) -> list[FromWorker]:
        """Start a cycle with the devices that a scan found and those that are expected but absent."""
        absent = list(lost)
        self._conflicts = outcome.conflicts
        cycle = Cycle(bus, [*outcome.devices, *absent], 1 / self._settings.rate, self._options.fast_read)
        self._cycle = cycle
        self._known = {device.id: device for device in (*outcome.devices, *absent) if device.is_known}
        messages: list[FromWorker] = [self._found(outcome.devices)]
        now = bus.clock.now()
        self._next_scan_at = now + _SCAN_PERIOD_S
        for device in absent:
            change = cycle.members[device.id].health.declare_lost(now, _UNREAD if device.id in self._unread else _GONE)
            if change is not None:
                messages.append(DeviceState(device.id, change.old, change.new, change.reason))
        clear_watchdogs(cycle, [device.id for device in outcome.devices if has_fired(device)])
        for number in self._moved & cycle.members.keys():
            cycle.members[number].moved = True
        self._keep_registers(cycle, [device.id for device in outcome.devices])
        for (device_id, item), period in list(self._watches.items()):
            if device_id not in cycle.members:
                # It may come back with the robot that it belongs to.
                continue
            messages += self.watch(Watch(device_id, (item,), period), now)
        return messages

    def _keep_registers(self, cycle: Cycle, there: Iterable[int]) -> None:
        """Servos that are still of the model that they were have what was written to them; those that are there get it
        again, since they may have been without power."""
        for number in self._kept.keys() & cycle.members.keys():
            member, (family, kept) = cycle.members[number], self._kept[number]
            if info_of(member.device).family == family:
                member.kept = kept
        give_back(cycle, there)

    def _newly_found(self, cycle: Cycle, tick: Tick) -> list[FromWorker]:
        """Return `Found` for expected devices that answer for the first time."""
        news = [number for number, change in tick.changes if change.new == "back" and number not in self._known]
        for number in news:
            self._known[number] = cycle.members[number].device
        return [self._found([self._known[number] for number in news])] if news else []

    def _changed_devices(self, cycle: Cycle, back: Iterable[int]) -> list[FromWorker]:
        """Return `Found` for devices that are back as another model or firmware; another model stops the robot.

        Its items may have the same names and mean other angles: no movement goes on with it.
        """
        devices = [cycle.members[number].device for number in back]
        told = self._told
        changed = [each for each in devices if each.id in told and not same_kind(told[each.id], info_of(each))]
        for device in changed:
            before = told[device.id]
            if before.family != info_of(device).family:
                self.halted = f"{device.name} answers to id {device.id}, not {before.name}"
        return [self._found(changed)] if changed else []

    def _found(self, devices: Iterable[ServoDevice]) -> Found:
        infos = tuple(map(info_of, devices))
        self._told |= {info.id: info for info in infos}
        return Found(infos, self._conflicts)

    def _scan_if_due(self, cycle: Cycle, now: float) -> list[FromWorker]:
        if now < self._next_scan_at:
            return []
        self._next_scan_at = now + _SCAN_PERIOD_S
        try:
            messages = self._rescan(cycle)
        except ScanInterrupted:
            # A stop goes first; the search is made again later.
            return []
        self._next_scan_at = cycle.bus.clock.now() + _SCAN_PERIOD_S
        return messages if self._known else []

    def _request_toss_if_silent(self, cycle: Cycle, now: float) -> None:
        """Where all devices of a CM-5 are lost, it may have been switched off and on, which ends its toss mode."""
        if now < self._next_scan_at or not has_toss_speed(cycle.bus.link):
            return
        self._next_scan_at = now + _SCAN_PERIOD_S
        if all(member.health.state == "lost" for member in cycle.members.values()):
            request_toss_mode(cycle.bus.link)

    def _scan_bus(
        self, bus: ServoBus, ids: Iterable[int] | None, urgent: Callable[[], bool] = no_stop
    ) -> ServoScan:
        """Return the devices that could be read; those that could not are in `_unread`.

        Where nothing answers at the speed of a CM-5, it may be one that is not in toss mode yet.
        """
        outcome = scan(bus, ids, urgent)
        if not outcome.devices and not outcome.conflicts and has_toss_speed(bus.link):
            enter_toss_mode(bus.link)
            outcome = scan(bus, ids, urgent)
        self._unread = {device.id for device in outcome.devices if not device.model}
        return ServoScan(tuple(device for device in outcome.devices if device.model), outcome.conflicts)

    def _rescan(self, cycle: Cycle) -> list[FromWorker]:
        auto, protocol, protocols = cycle.bus.auto, cycle.bus.protocol, cycle.bus.protocols
        cycle.bus.auto = self._options.protocol == "auto"
        try:
            outcome = self._scan_bus(cycle.bus, self._ids, self._urgent)
        except ScanInterrupted:
            cycle.bus.auto, cycle.bus.protocol, cycle.bus.protocols = auto, protocol, protocols
            raise
        self.detach()
        self._known = {}
        gone = self._sort_out_guests(outcome)
        return [*gone, *self._start_cycle(cycle.bus, outcome, self._absent_devices(cycle.bus, outcome))]


def _tick_messages(tick: Tick) -> list[FromWorker]:
    messages: list[FromWorker] = [
        DeviceState(device, change.old, change.new, change.reason) for device, change in tick.changes
    ]
    if tick.values:
        messages.append(Samples(max(tick.times.values()), tick.values, tick.times))
    return messages
