"""The cyclic work on one bus: write changed targets, read what is due, spend no time on lost devices.

One call of `Cycle.tick` is one tick. It has no thread and no clock of its own: the caller passes the time, and the bus
advances it by waiting for answers (on a `SimClock` that is a jump).

A tick in order:
  1. the SYNC_WRITE packets of all changed targets (`plan.sync_writes`); they are sent in one write together with the
     first question, since no device answers them;
  2. the reads of healthy devices that are due; where both protocols are spoken, those of 1.0 first. Protocol 1.0 and
     Feetech SCS: one READ per device and block. Protocol 2.0 and Feetech STS: one SYNC READ per block (FAST if all
     support it), then single READs for missing answers, because a silent device can silence those behind it in the
     list;
  3. one single READ for each suspect device. They come last, because each may cost a whole time-out;
  4. a ping to one lost device whose probe is due.
The wire is kept busy: the next question is sent first, then the last answer is decoded while the servo prepares the
next one. A lost device costs only its pings: a cycle with 5 of 18 lost spends 20 time-outs a second on them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from urbihw.buses.errors import BadFrame, BadValue, BusTimeout, DeviceRefused
from urbihw.buses.servos import packet, plan
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.health import Change
from urbihw.buses.servos.kept import EFFORTS
from urbihw.buses.servos.member import FIRED, PLACE, WATCHDOG, BlockQuestion, Member
from urbihw.buses.servos.plan import Block
from urbihw.buses.servos.scan import identify
from urbihw.buses.servos.status import Status, state_of

STATE_ITEM = "state"
_RESTARTED = "it has started anew: it was without power for a moment, or its torque went off by itself"
# A retry may start only within this share of the tick, so that one bad device does not take the time of the others.
_RETRY_SHARE = 0.6
_CHECKSUM_1 = 0x10
_CRC_2 = 3
_Read = tuple[Member, tuple[BlockQuestion, ...]]


@dataclass(slots=True)
class Tick:
    """The results of one tick.

    Attributes:
        values: device -> item -> raw count.
        times: device -> arrival of its answer.
        changes: (device, change of its health) in order.
        fired: devices that were stopped by their own bus watchdog.
    """

    values: dict[int, dict[str, int]] = field(default_factory=dict)
    times: dict[int, float] = field(default_factory=dict)
    changes: list[tuple[int, Change]] = field(default_factory=list)
    fired: list[int] = field(default_factory=list)


class Cycle:
    """The devices of one bus and the work of each tick.

    Attributes:
        bus: the wire.
        members: id -> device, in order of id.
        period: seconds between ticks; limits retries, and the tolerance of due times.
        fast: FAST SYNC READ may be used.
    """

    def __init__(self, bus: ServoBus, devices: Iterable[ServoDevice], period: float, fast: bool = True) -> None:
        self.bus = bus
        self.members = {device.id: Member(device) for device in sorted(devices, key=lambda device: device.id)}
        bus.protocols = {number: member.device.protocol for number, member in self.members.items()}
        self.period = period
        self.fast = fast
        self._prefix = b""
        self._retry_until = 0.0
        self._meanwhile: Callable[[], None] | None = None
        self._urgent: Callable[[], bool] = lambda: False
        self._runs: dict[tuple[str, tuple[str, ...]], tuple[Block, ...]] = {}
        self._group_requests: dict[tuple[int, int, tuple[int, ...], bool], bytes] = {}

    def member(self, device: int) -> Member:
        """Return a member by id. Raises BadValue."""
        try:
            return self.members[device]
        except KeyError:
            raise BadValue(f"there is no device {device} on {self.bus.link.url.text}") from None

    def motors(self) -> list[Member]:
        """Return the members with a motor."""
        return [member for member in self.members.values() if member.has_motor]

    def set_target(self, device: int, name: str, raw: int, moves: bool = True) -> None:
        """Set a target, sent at the next tick; dropped when the device is lost: see `Member`. Raises BadValue."""
        member = self.member(device)
        member.set_target(name, raw, moves)
        if member.health.state == "lost":
            member.pending.clear()

    def watch(self, device: int, names: Iterable[str], period: float | None, now: float) -> None:
        """Read `names` of a device each `period` seconds, see `Member.watch`. Raises BadValue."""
        members = list(self.members)
        # Without SYNC READ each device costs a question of its own, so slow items are spread over their period.
        alone = device in self.members and not self.members[device].answers_sync_read
        spread = members.index(device) / len(members) if alone else 0.0
        self.member(device).watch(names, period, now + spread * (period or 0.0))

    def tick(
        self, now: float, meanwhile: Callable[[], None] | None = None, urgent: Callable[[], bool] = lambda: False
    ) -> Tick:
        """Execute the tick at time `now`; `meanwhile` is called once while the wire is busy. Raises LinkGone.

        `urgent` is called between two transactions; when it returns true, the remaining reads are left out.
        """
        tick = Tick()
        self._meanwhile = meanwhile
        self._urgent = urgent
        self._retry_until = now + self.period * _RETRY_SHARE
        self._prefix = self._pop_write_packets()
        healthy, suspects, lost = self._collect_due_reads(now)
        alone = [read for read in healthy if not read[0].answers_sync_read]
        if alone:
            self._read_each(alone, tick)
        if len(alone) < len(healthy) and not (alone and urgent()):
            self._read_groups([read for read in healthy if read[0].answers_sync_read], tick)
        for member, questions in suspects:
            if not urgent():
                self._read_alone(member, questions, tick)
        if lost and not urgent():
            self._probe_lost(lost, tick)
        if self._prefix:
            self.bus.send(self._pop_prefix())
        self._run_meanwhile()
        return tick

    def _run_meanwhile(self) -> None:
        """Call `meanwhile`, if this tick has not called it yet."""
        chore, self._meanwhile = self._meanwhile, None
        if chore is not None:
            chore()

    # Writing.

    def _pop_write_packets(self) -> bytes:
        """Return the packets of all changed targets, and mark these as sent."""
        alike: dict[tuple[str, tuple[str, ...]], list[Member]] = {}
        for member in self.members.values():
            if member.pending and (due := member.sendable()):
                alike.setdefault((member.table.name, tuple(due)), []).append(member)
        if not alike:
            return b""
        groups: dict[int, list[plan.WriteGroup]] = {}
        for key, members in alike.items():
            runs = self._runs.get(key)
            if runs is None:
                runs = self._runs[key] = plan.write_runs(members[0].table, key[1])
            protocol = members[0].device.protocol
            groups.setdefault(protocol, []).append((runs, [(each.device.id, each.sendable()) for each in members]))
        packets = [each for protocol, one in groups.items() for each in plan.sync_writes(protocol, one)]
        for members in alike.values():
            for member in members:
                member.mark_sent(self.bus.clock.now())
        return b"".join(packets)

    def _pop_prefix(self) -> bytes:
        prefix, self._prefix = self._prefix, b""
        return prefix

    # Reading.

    def _collect_due_reads(self, now: float) -> tuple[list[_Read], list[_Read], list[Member]]:
        """Return the reads due of healthy devices, the reads due of suspects, and the lost devices."""
        healthy: list[_Read] = []
        suspects: list[_Read] = []
        lost: list[Member] = []
        for member in self.members.values():
            state = member.health.state
            if state == "lost":
                lost.append(member)
                continue
            names = member.pop_due_items(now, self.period / 2)
            if names:
                (suspects if state == "suspect" else healthy).append((member, member.questions(names)))
        return healthy, suspects, lost

    def _read_each(self, asked: Iterable[_Read], tick: Tick) -> None:
        """Read healthy devices one after the other; a missing answer is retried once if this tick has time left."""
        bus = self.bus
        pairs = [(member, question) for member, questions in asked for question in questions]
        requests = [(question.request, member.device.id, question.block.size) for member, question in pairs]
        for index, answer in bus.ask_each(requests, self._pop_prefix(), self._run_meanwhile, self._urgent):
            member, question = pairs[index]
            if isinstance(answer, Status) and not (answer.error and _request_was_damaged(answer)):
                self._store_answer(member, question.block, answer, tick)
            elif isinstance(answer, Status):
                # The next question is already on the wire; the next tick asks this one again.
                bus.counters.refused += 1
            elif bus.clock.now() < self._retry_until:
                bus.counters.retried += 1
                self._read_alone(member, (question,), tick)
            else:
                self._record_miss(member, str(answer), tick)

    def _read_alone(self, member: Member, questions: Iterable[BlockQuestion], tick: Tick) -> None:
        """Read the blocks of one device, one after the other, until an answer is missing."""
        for question in questions:
            try:
                status = self.bus.ask(
                    question.request, member.device.id, question.block.size, self._pop_prefix(), self._run_meanwhile
                )
            except (BusTimeout, BadFrame) as error:
                self._record_miss(member, str(error), tick)
                return
            self._store_answer(member, question.block, status, tick)

    def _read_groups(self, asked: Iterable[_Read], tick: Tick) -> None:
        groups: dict[tuple[int, int, int], list[tuple[Member, BlockQuestion]]] = {}
        for member, questions in asked:
            for question in questions:
                place = (member.device.protocol, question.block.address, question.block.size)
                groups.setdefault(place, []).append((member, question))
        for (protocol, address, size), pairs in groups.items():
            if tick.values and self._urgent():
                return
            if len(pairs) == 1:
                self._read_alone(pairs[0][0], pairs[0][1:], tick)
            else:
                self._read_group(protocol, address, size, pairs, tick)

    def _read_group(
        self, protocol: int, address: int, size: int, pairs: list[tuple[Member, BlockQuestion]], tick: Tick
    ) -> None:
        bus = self.bus
        ids = tuple(member.device.id for member, _ in pairs)
        fast = self.fast and all(_supports_fast_read(member.device) for member, _ in pairs)
        key = (address, size, ids, fast)
        request = self._group_requests.get(key)
        if request is None:
            request = self._group_requests[key] = packet.sync_read_packet(address, size, ids, fast, protocol)
        damaged = bus.counters.damaged
        ask: Callable[..., Iterable[Status]] = bus.ask_joint if fast else bus.ask_group
        waiting = dict(zip(ids, pairs, strict=True))
        for status in ask(request, [(number, size) for number in ids], self._pop_prefix(), self._run_meanwhile):
            member, question = waiting.pop(status.device)
            self._store_answer(member, question.block, status, tick)
        first_missing = True
        for member, question in waiting.values():
            if self._urgent():
                return
            if first_missing and bus.counters.damaged == damaged:
                # The first missing device was silent; those behind it may only have waited for its answer.
                self._record_miss(member, "does not answer", tick)
            else:
                self._read_alone(member, (question,), tick)
            first_missing = False

    # What answers mean.

    def _store_answer(self, member: Member, block: Block, status: Status, tick: Tick) -> None:
        number = status.device
        if member.health.state == "lost":
            # Lost during this tick: only a probe brings it back.
            return
        change = member.health.record_answer()
        if change is not None:
            tick.changes.append((number, change))
        error = status.error
        if len(status.params) != block.size:
            self.bus.counters.refused += 1
            return
        values = block.unpack(status.params)
        if member.has_restarted(values, alarmed=bool(status.state)):
            self._lose_restarted(member, tick)
            return
        member.note_state(values, self.bus.clock.now())
        if PLACE in values:
            member.add_place(values[PLACE], self.bus.clock.now())
        for name in EFFORTS.keys() & values.keys():
            member.note_effort(name, values[name])
        if WATCHDOG in values:
            _check_watchdog(member, values, tick)
        if error or member.state:
            state = state_of(error, status.protocol)
            if state != member.state:
                member.state = values[STATE_ITEM] = state
        if number in tick.values:
            tick.values[number].update(values)
        elif values:
            tick.values[number] = values
        else:
            return
        tick.times[number] = self.bus.clock.now()

    def _lose_restarted(self, member: Member, tick: Tick) -> None:
        """A servo that has started anew is lost, and comes back with the next tick: what it has forgotten is written
        before it gets any goal, and that begins where it is then."""
        now = self.bus.clock.now()
        self._note_loss(member, member.health.declare_lost(now, _RESTARTED), tick)
        member.health.next_probe = now

    def _record_miss(self, member: Member, reason: str, tick: Tick) -> None:
        member.in_doubt = member.has_motor
        self._note_loss(member, member.health.record_miss(self.bus.clock.now(), reason), tick)

    def _note_loss(self, member: Member, change: Change | None, tick: Tick) -> None:
        if change is not None:
            tick.changes.append((member.device.id, change))
            if change.new == "lost":
                member.drop_targets()
                member.forget_place()

    # The lost.

    def _probe_lost(self, lost: Iterable[Member], tick: Tick) -> None:
        """Ping the lost device whose probe is due first, if it is due."""
        now = self.bus.clock.now()
        member = min(lost, key=lambda member: member.health.next_probe, default=None)
        if member is None or member.health.next_probe > now:
            return
        number = member.device.id
        protocol = self.bus.protocol_of(number)
        size = 3 if protocol == 2 else 0
        ping = packet.ping_packet(protocol, number)
        try:
            # It may have lost power, or be another device with the same id: identify it again.
            pong = self.bus.ask(ping, number, size, self._pop_prefix(), brief=True)
            found = identify(self.bus, number, pong)
            if member.must_be_complete and not found.is_complete:
                raise BusTimeout(f"device {number} answers pings, but not yet what it is asked")
            member.update_device(found)
        except (BusTimeout, BadFrame, DeviceRefused):
            member.health.record_probe(self.bus.clock.now(), False)
            if self.bus.auto and not member.device.is_known:
                # It is expected, but its protocol is unknown: the next probe tries the other one.
                self.bus.protocols[number] = 3 - protocol
            return
        member.drop_targets()
        member.come_back(self.bus.clock.now())
        change = member.health.record_probe(self.bus.clock.now(), True)
        if change is not None:
            tick.changes.append((number, change))


def _check_watchdog(member: Member, values: dict[str, int], tick: Tick) -> None:
    """Evaluate the register of the bus watchdog; it stays in the samples only if it is watched."""
    left = values[WATCHDOG] if member.is_watched(WATCHDOG) else values.pop(WATCHDOG)
    if left == FIRED:
        tick.fired.append(member.device.id)
    if member.armed and left <= 0:
        # It fired, or never received the packet that arms it, or lost power: arm it again while the servo turns.
        member.armed = False
        member.rearm_watchdog()


def _request_was_damaged(status: Status) -> bool:
    return bool(status.refusal & _CHECKSUM_1) if status.protocol == 1 else status.refusal == _CRC_2


def _supports_fast_read(device: ServoDevice) -> bool:
    table = device.table
    return table is not None and table.fast_firmware is not None and device.firmware >= table.fast_firmware
