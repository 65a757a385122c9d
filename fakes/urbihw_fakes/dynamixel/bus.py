"""The half-duplex bus: which unit answers a request, when, and in which order.

Choices where the sheet is silent: two units that answer at once drive the line together, which is modelled as the
second starting one byte after the first and a 0 winning over a 1; in a group read a unit that must wait for a silent
predecessor stays silent too (`wait_for_predecessor`, seen with protocol 2.0 in DynamixelSDK issue 331; the sheet says
"may" for protocol 1.0). Not covered: bytes of the host during an answer, electrical effects, the boot time of a unit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.dynamixel import packet1, packet2
from urbihw_fakes.dynamixel.framer import BROADCAST, Framer, Request
from urbihw_fakes.dynamixel.unit import STEP, Unit, no_callback
from urbihw_fakes.dynamixel.unit1 import Unit1
from urbihw_fakes.dynamixel.unit2 import Unit2
from urbihw_fakes.errors import NoSuchUnit

GROUP_READS = {
    1: frozenset({packet1.BULK_READ}),
    2: frozenset({packet2.SYNC_READ, packet2.BULK_READ, packet2.FAST_SYNC_READ, packet2.FAST_BULK_READ}),
}


@dataclass(frozen=True, slots=True)
class Reply:
    """The data of one place in the order of answers, `delay` seconds after the one before; may be empty."""

    delay: float
    data: bytes


@dataclass(frozen=True, slots=True)
class Item:
    """One place in a group read or write."""

    unit: int
    address: int
    count: int
    data: bytes = b""


class ServoBus(Device):
    """Units of both protocols on one wire.

    `bus[6]` is the unit with ID 6; iterating gives all units. `wait_for_predecessor`: see the head of this file.
    """

    def __init__(self, units: Iterable[Unit] = (), *, wait_for_predecessor: bool = True, log_size: int = 1000) -> None:
        super().__init__(log_size=log_size)
        self.wait_for_predecessor = wait_for_predecessor
        self._units = list(units)
        self._framer = Framer()
        self._by_id: dict[tuple[int, int], list[Unit]] = {}
        self._stale = False
        self._advanced = -inf
        self._index()

    def __iter__(self) -> Iterator[Unit]:
        return iter(self._units)

    def __getitem__(self, unit: int) -> Unit:
        """The (first) unit with this ID.

        Raises:
            NoSuchUnit: none has it.
        """
        return self._chosen(unit)[0]

    def add(self, unit: Unit) -> None:
        """Add a unit to the bus; two units may have the same ID, and then both answer at once."""
        self._units.append(unit)
        self._index()

    def remove(self, unit: Unit) -> None:
        """Remove a unit from the bus."""
        self._units.remove(unit)
        unit.moved = no_callback
        self._index()

    def tick(self, now: float) -> list[Answer]:
        """Advance all units to `now`, or to less than a step of their physics before; no unit sends unasked.

        A unit that is asked something advances to the time of the request by itself.
        """
        if not 0.0 <= now - self._advanced < STEP:
            for unit in self._units:
                unit.tick(now)
            self._advanced = now
        return []

    def numbers(self) -> tuple[int, ...]:
        """See `Device`: the IDs."""
        return tuple(sorted({unit.id for unit in self._units}))

    def power_off(self, now: float, who: int | None = None) -> None:
        """Switch off the units with ID `who`, or all."""
        for unit in self._chosen(who):
            unit.power_off(now)

    def power_on(self, now: float, who: int | None = None) -> None:
        """Switch on the units with ID `who`, or all."""
        for unit in self._chosen(who):
            unit.power_on(now)

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Answer the requests that these bytes complete."""
        answers: list[Answer] = []
        free = now
        for request in self._framer.feed(data, now - len(data) * self.byte_time, now):
            chained = self.wait_for_predecessor and request.code in GROUP_READS[request.protocol]
            for reply in self._replies(request, now):
                if not reply.data:
                    if chained:
                        break
                    continue
                free += reply.delay + len(reply.data) * self.byte_time
                answers.append(Answer(free, reply.data))
            if self._stale:
                self._index()
        return answers

    # --- dispatch -----------------------------------------------------------------------------------------------

    def _replies(self, request: Request, now: float) -> Iterable[Reply]:
        if request.unit != BROADCAST:
            units = self._listening(request.protocol, request.unit)
            return (self._reply(request.unit, [(unit, unit.execute(request, now)) for unit in units]),)
        if not request.intact:
            return ()
        if request.protocol == 1:
            return self._broadcast1(request, now)
        return self._broadcast2(request, now)

    def _broadcast1(self, request: Request, now: float) -> list[Reply]:
        code, params = request.code, request.params
        units = [unit for unit in self._units if unit.protocol == 1 and self._is_answering(unit)]
        if code == packet1.PING:
            # The answers have no order, so all are sent at once.
            answers = [(unit, unit.execute(request, now)) for unit in units]
            return [self._reply(BROADCAST, answers)]
        if code == packet1.SYNC_WRITE:
            self._write_items(1, _sync_items1(params), now)
        elif code == packet1.BULK_READ:
            return [self._place(1, item, now) for item in _bulk_items1(params)]
        elif code != packet1.READ:
            for unit in units:
                unit.execute(request, now)
        return []

    def _broadcast2(self, request: Request, now: float) -> list[Reply]:
        code, params = request.code, request.params
        if code == packet2.SYNC_WRITE:
            self._write_items(2, _sync_items2(params), now)
        elif code == packet2.BULK_WRITE:
            self._write_items(2, _bulk_write_items2(params), now)
        elif code in (packet2.SYNC_READ, packet2.BULK_READ):
            items = _sync_read_items2(params) if code == packet2.SYNC_READ else _bulk_read_items2(params)
            return [self._place(2, item, now) for item in items]
        elif code in (packet2.FAST_SYNC_READ, packet2.FAST_BULK_READ):
            items = _sync_read_items2(params) if code == packet2.FAST_SYNC_READ else _bulk_read_items2(params)
            return self._joint(list(items), now)
        elif code == packet2.PING:
            ids = sorted({unit.id for unit in self._units if unit.protocol == 2})
            listening = ((unit_id, self._listening(2, unit_id)) for unit_id in ids)
            return [self._reply(i, [(unit, unit.execute(request, now)) for unit in units]) for i, units in listening]
        elif code != packet2.READ:
            for unit in self._units:
                if unit.protocol == 2 and self._is_answering(unit):
                    unit.execute(request, now)
        return []

    def _write_items(self, protocol: int, items: Iterable[Item], now: float) -> None:
        for item in items:
            for unit in self._listening(protocol, item.unit):
                unit.obey(item.address, item.data, now)

    def _place(self, protocol: int, item: Item, now: float) -> Reply:
        """One place in a group read."""
        units = self._listening(protocol, item.unit)
        if protocol == 1:
            units = [unit for unit in units if isinstance(unit, Unit1) and unit.answers_bulk_read]
        return self._reply(item.unit, [(unit, unit.report(item.address, item.count, now)) for unit in units])

    def _joint(self, items: list[Item], now: float) -> list[Reply]:
        """Return the joint packet of a fast group read: each unit adds its block to the bytes really on the bus."""
        wire = b""
        head = packet2.fast_head([item.count for item in items])
        replies: list[Reply] = []
        for item in items:
            answers: list[tuple[Unit, bytes]] = []
            for unit in self._listening(2, item.unit):
                if isinstance(unit, Unit2) and unit.fast_reads and unit.status_level >= 1:
                    error, data = unit.answer_read(item.address, item.count, now)
                    data = data.ljust(item.count, b"\0")
                    block = packet2.fast_block(wire or head, item.unit, error | unit.alert(), data)
                    answers.append((unit, block if wire else head + block))
            reply = self._reply(item.unit, answers)
            if wire and reply.data:
                # Only the first unit waits for its return delay: the blocks follow without a gap.
                reply = Reply(0.0, reply.data)
            wire += reply.data
            replies.append(reply)
        return replies

    # --- the wire -----------------------------------------------------------------------------------------------

    def _reply(self, unit: int, answers: list[tuple[Unit, bytes]]) -> Reply:
        """Return one place in the order of answers, with the collisions of units with one ID and with faults."""
        data = b""
        delay = 0.0
        for answering, status in answers:
            data = _collide(data, status)
            if self.byte_time:
                delay = max(delay, answering.return_delay)
        late, data = self.faults.disturb(unit, data)
        return Reply(delay + late, data)

    def _is_answering(self, unit: Unit) -> bool:
        return unit.powered and unit.accepts_baud(self.baud)

    def _listening(self, protocol: int, unit: int) -> list[Unit]:
        return [found for found in self._by_id.get((protocol, unit), ()) if self._is_answering(found)]

    def _chosen(self, who: int | None) -> list[Unit]:
        chosen = [unit for unit in self._units if who is None or unit.id == who]
        if who is not None and not chosen:
            there = ", ".join(str(unit.id) for unit in self._units)
            raise NoSuchUnit(f"unit {who}: not on this bus; there are {there or 'none'}")
        return chosen

    def _outdate(self) -> None:
        self._stale = True

    def _index(self) -> None:
        self._by_id = {}
        self._stale = False
        for unit in self._units:
            unit.moved = self._outdate
            for number in unit.ids:
                self._by_id.setdefault((unit.protocol, number), []).append(unit)


def _collide(first: bytes, second: bytes) -> bytes:
    """Return two answers sent at once: the second begins one byte later, and a 0 on the line wins."""
    if not first or not second:
        return first or second
    size = max(len(first), len(second) + 1)
    one = first.ljust(size, b"\xff")
    other = (b"\xff" + second).ljust(size, b"\xff")
    return bytes(a & b for a, b in zip(one, other, strict=True))


# --- parameters of the group instructions -------------------------------------------------------------------------


def _sync_items1(params: bytes) -> Iterator[Item]:
    """Address, L, then (ID, L bytes) each; an incomplete last one is dropped."""
    if len(params) < 2:
        return
    address, count = params[0], params[1]
    for at in range(2, len(params) - count, count + 1):
        yield Item(params[at], address, count, params[at + 1 : at + 1 + count])


def _bulk_items1(params: bytes) -> Iterator[Item]:
    """0x00, then (count, ID, address) each; of a repeated ID only the first counts."""
    seen: set[int] = set()
    for at in range(1, len(params) - 2, 3):
        count, unit, address = params[at : at + 3]
        if unit not in seen:
            seen.add(unit)
            yield Item(unit, address, count)


def _short(params: bytes, at: int) -> int:
    return params[at] | params[at + 1] << 8


def _sync_items2(params: bytes) -> Iterator[Item]:
    """addr16, len16, then (ID, data) each."""
    if len(params) < 4:
        return
    address, count = _short(params, 0), _short(params, 2)
    for at in range(4, len(params) - count, count + 1):
        yield Item(params[at], address, count, params[at + 1 : at + 1 + count])


def _sync_read_items2(params: bytes) -> Iterator[Item]:
    """addr16, len16, then the IDs."""
    if len(params) < 4:
        return
    address, count = _short(params, 0), _short(params, 2)
    for unit in params[4:]:
        yield Item(unit, address, count)


def _bulk_read_items2(params: bytes) -> Iterator[Item]:
    """(ID, addr16, len16) each."""
    for at in range(0, len(params) - 4, 5):
        yield Item(params[at], _short(params, at + 1), _short(params, at + 3))


def _bulk_write_items2(params: bytes) -> Iterator[Item]:
    """(ID, addr16, len16, data) each."""
    at = 0
    while at + 5 <= len(params):
        count = _short(params, at + 3)
        data = params[at + 5 : at + 5 + count]
        if len(data) == count:
            yield Item(params[at], _short(params, at + 1), count, data)
        at += 5 + count
