"""The traffic of a servo bus, decoded: Dynamixel 1.0 and 2.0, and Feetech; no I/O and no time.

Registers have the names of the device's control table. Its model is known from the daemon, or learned from the traffic
(a ping of protocol 2.0, a read of the model number); otherwise the commonest table of the protocol is assumed, which
the line says (``as AX-12``). Requests and answers of protocol 1.0 look alike: bytes that were written are requests;
where nothing was written, because the tool only listens on the wire, an answer is what follows a request to its sender.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.servos import units
from urbihw.buses.servos.crc import crc16
from urbihw.buses.servos.item import ControlTable, Item
from urbihw.buses.servos.packet import BROADCAST, HEADER_1, HEADER_2, split_fast, unstuff
from urbihw.buses.servos.status import FEETECH, Status, refusal_words, state_words
from urbihw.buses.servos.tables import table_for, table_named, table_of
from urbihw.buses.trace import Cut, Direction, StreamDecoder, TracedPacket, hex_of, with_unit

_PING, _READ, _WRITE, _REG_WRITE = 0x01, 0x02, 0x03, 0x04
_SYNC_READ, _SYNC_WRITE, _FAST_SYNC_READ = 0x82, 0x83, 0x8A
_BULK_READ, _BULK_WRITE, _FAST_BULK_READ = 0x92, 0x93, 0x9A
_STATUS: Final = 0x55
_NAMES: Final = {
    _PING: "ping", _READ: "read", _WRITE: "write", _REG_WRITE: "reg write", 0x05: "action", 0x06: "factory reset",
    0x08: "reboot", 0x0B: "calibrate", 0x10: "clear", 0x20: "control table backup", _SYNC_READ: "sync read",
    _SYNC_WRITE: "sync write", _FAST_SYNC_READ: "fast sync read", _BULK_READ: "bulk read", _BULK_WRITE: "bulk write",
    _FAST_BULK_READ: "fast bulk read",
}  # fmt: skip
_ASSUMED: Final = {1: "AX-12", 2: "XL430", FEETECH: "STS"}
_MODEL_SIZE: Final = 2

Place = tuple[int, int]
"""Address and number of registers."""
_PINGED: Final[Place] = (0, 0)


class ServoDecoder(StreamDecoder):
    """Decodes the traffic of a servo bus.

    Attributes:
        protocol_1: what packets of protocol 1.0 are: 1, or FEETECH.
    """

    half_duplex = True

    def __init__(self, devices: Sequence[Mapping[str, Any]] = (), protocol_1: int = 1) -> None:
        super().__init__()
        self.protocol_1 = protocol_1
        self._tables: dict[tuple[int, int], ControlTable] = {}
        """(id, protocol) -> table of a device whose model is known."""
        self._expected: dict[int, Place | None] = {}
        self._joint: list[tuple[int, Place]] = []
        self._everybody = False
        self._asked_at = 0.0
        self._last_request = b""
        self._has_echo = False
        self._writes_seen = False
        for device in devices:
            number, model, protocol = (device.get(name, 0) for name in ("id", "model", "protocol"))
            if not all(isinstance(each, int) for each in (number, model, protocol)):
                continue  # It comes from another process.
            if model and protocol in _ASSUMED:
                self._tables[number, protocol] = table_for(model, protocol)
                if protocol == FEETECH:
                    self.protocol_1 = FEETECH

    # Cutting.

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin."""
        start = data.find(HEADER_1)
        if start < 0:
            noise = len(data) - data.endswith(HEADER_1[:1])
            return Cut(noise, noise=True) if noise else None
        if start:
            return Cut(start, noise=True)
        if len(data) < 4:
            return None
        if data[2] == 0xFF:
            return Cut(1, noise=True)
        return self._cut_2(data) if data[:4] == HEADER_2 else self._cut_1(data)

    @staticmethod
    def _cut_1(data: bytearray) -> Cut | None:
        if data[3] < 2:
            return Cut(2, noise=True)
        return _whole(data, data[3] + 4)

    @staticmethod
    def _cut_2(data: bytearray) -> Cut | None:
        if len(data) < 7:
            return None
        length = data[5] | data[6] << 8
        return _whole(data, length + 7) if length >= 3 else Cut(3, noise=True)

    # Decoding.

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        """Return the packet, and before a request what was not answered before it."""
        self._writes_seen = self._writes_seen or direction == ">"
        two = data.startswith(HEADER_2)
        number = data[4] if two else data[2]
        if _is_damaged(data, two):
            return [TracedPacket(time, direction, _name(number), "?", "", "bad", "the checksum is wrong", data)]
        body = unstuff(data[7:-2]) if two else data[4:-1]
        if direction == "<" and self._is_echo(data):
            return [TracedPacket(time, direction, _name(number), "echo", "", "ok", data=data)]
        repeated = not self._writes_seen and data == self._last_request
        if not repeated and self._is_status(direction, number, body, two):
            rest = body[1:] if two else body
            return [self._status(time, direction, number, rest, data, two)]
        missing = self._silent()
        self._last_request, self._asked_at = data, time
        what, detail = self._request(number, body[0], body[1:], 2 if two else self.protocol_1)
        return [*missing, TracedPacket(time, direction, _name(number), what, detail, "ok", data=data)]

    def flush(self) -> list[TracedPacket]:
        """Return what is left, and who has not answered."""
        return super().flush() + self._silent()

    def _is_echo(self, data: bytes) -> bool:
        """Return whether the adapter returns what was written: a ping alone may also be an answer with an alarm."""
        same = self._writes_seen and data == self._last_request
        if same and (self._has_echo or data[4:5] != bytes((_PING,)) or data.startswith(HEADER_2)):
            self._has_echo = True
            self._last_request = b""
            return True
        return False

    def _is_status(self, direction: Direction, number: int, body: bytes, two: bool) -> bool:
        if two:
            return body[0] == _STATUS
        if direction == ">":
            return False
        unknown = body[0] not in _NAMES
        return unknown or self._writes_seen or self._is_expected(number, len(body) - 1)

    def _is_expected(self, number: int, size: int) -> bool:
        """Return whether an answer of a device with so many bytes of data fits what was asked."""
        if number not in self._expected:
            return self._everybody
        place = self._expected[number]
        return size in (0, place[1] if place else 0)

    def _silent(self) -> list[TracedPacket]:
        """Return a packet for each device that was asked for something and has not answered; forget them."""
        found = [
            TracedPacket(self._asked_at, "<", _name(number), "no answer", problem="no answer")
            for number, place in self._expected.items()
            if place is not None
        ]
        self._expected, self._joint, self._everybody = {}, [], False
        return found

    # Requests.

    def _request(self, number: int, code: int, params: bytes, protocol: int) -> tuple[str, str]:
        what = _NAMES.get(code, f"instruction 0x{code:02X}")
        width = 2 if protocol == 2 else 1
        if protocol == 1 and code == _SYNC_READ:
            # Dynamixel has it in protocol 2.0 only.
            self.protocol_1 = protocol = FEETECH
        if code in (_SYNC_READ, _FAST_SYNC_READ, _SYNC_WRITE):
            return what, self._group(code, params, width, protocol)
        if code in (_BULK_READ, _FAST_BULK_READ, _BULK_WRITE):
            return what, self._bulk(code, params, protocol)
        if code == _PING:
            self._everybody = number == BROADCAST
            if number != BROADCAST:
                self._expected[number] = _PINGED
        elif code == _READ and len(params) == 2 * width:
            place = _place(params, width)
            self._expected[number] = place
            return what, self._names(number, protocol, place)
        elif code in (_WRITE, _REG_WRITE) and len(params) > width:
            # Whether a write is answered depends on the status return level, so a silent servo is not counted as
            # missing.
            self._expected[number] = None
            return what, self._values(number, protocol, int.from_bytes(params[:width], "little"), params[width:])
        else:
            self._expected[number] = None
        return what, hex_of(params)

    def _group(self, code: int, params: bytes, width: int, protocol: int) -> str:
        if len(params) < 2 * width:
            return hex_of(params)
        place, rest = _place(params, width), params[2 * width :]
        if code == _SYNC_WRITE:
            step = place[1] + 1
            rows = [rest[at : at + step] for at in range(0, len(rest), step)]
            return "; ".join(f"{row[0]}: {self._values(row[0], protocol, place[0], row[1:])}" for row in rows)
        if code == _FAST_SYNC_READ:
            self._expect_joint([(number, place) for number in rest])
        else:
            self._expected |= dict.fromkeys(rest, place)
        return f"{', '.join(map(str, rest))}: {self._names(rest[0] if rest else BROADCAST, protocol, place)}"

    def _bulk(self, code: int, params: bytes, protocol: int) -> str:
        if protocol != 2:
            rows = [(part[1], (part[2], part[0])) for part in _parts(params[1:], 3)]
        elif code == _BULK_WRITE:
            return self._bulk_write(params)
        else:
            rows = [(part[0], _place(part[1:], 2)) for part in _parts(params, 5)]
        if code == _FAST_BULK_READ:
            self._expect_joint(rows)
        else:
            self._expected |= dict(rows)
        return "; ".join(f"{number}: {self._names(number, protocol, place)}" for number, place in rows)

    def _bulk_write(self, params: bytes) -> str:
        found = []
        while len(params) >= 5:
            address, size = _place(params[1:5], 2)
            found.append(f"{params[0]}: {self._values(params[0], 2, address, params[5 : 5 + size])}")
            params = params[5 + size :]
        return "; ".join(found)

    def _expect_joint(self, rows: list[tuple[int, Place]]) -> None:
        """Expect one answer with the registers of several devices."""
        self._joint = rows
        self._expected |= dict(rows)

    # Answers.

    def _status(
        self, time: float, direction: Direction, number: int, body: bytes, data: bytes, two: bool
    ) -> TracedPacket:
        protocol = 2 if two else self.protocol_1
        if two and number == BROADCAST:
            return self._joint_status(time, direction, data)
        status = Status(number, body[0] if body else 0, body[1:], protocol)
        words = [refusal_words(status.refusal, protocol), state_words(status.state, protocol)]
        place = self._expected.pop(number, _PINGED if self._everybody else None)
        if place is None:
            detail = hex_of(status.params)
        elif place == _PINGED:
            detail = self._pinged(number, status.params, protocol)
        else:
            self._learn(number, protocol, place[0], status.params)
            detail = self._values(number, protocol, place[0], status.params)
            if len(status.params) != place[1] and not status.refusal:
                words.append(f"{len(status.params)} bytes instead of {place[1]}")
        return TracedPacket(
            time, direction, _name(number), "status", detail, "ok", ", ".join(filter(None, words)), data
        )

    def _joint_status(self, time: float, direction: Direction, data: bytes) -> TracedPacket:
        """Return the packet of a joint answer: fast reads."""
        rows, self._joint = self._joint, []
        found = split_fast(data, [size for _, (_, size) in rows])
        detail = []
        for status, (number, place) in zip(found, rows, strict=False):
            self._expected.pop(number, None)
            detail.append(f"{number}: {self._values(number, 2, place[0], status.params)}")
        problem = "" if len(found) == len(rows) else f"{len(rows) - len(found)} of {len(rows)} are missing in it"
        return TracedPacket(time, direction, "all", "status", "; ".join(detail), "ok", problem, data)

    def _pinged(self, number: int, params: bytes, protocol: int) -> str:
        if len(params) < 3:
            return hex_of(params)
        self._learn(number, protocol, 0, params[:2])
        model = params[0] | params[1] << 8
        table = table_of(model)
        return f"{table.models[model] if table else f'model {model}'}, firmware {params[2]}"

    def _learn(self, number: int, protocol: int, address: int, data: bytes) -> None:
        """Take over the model from an answer that has it."""
        at = (3 if protocol == FEETECH else 0) - address
        if 0 <= at <= len(data) - _MODEL_SIZE:
            table = table_of(data[at] | data[at + 1] << 8)
            if table is not None and (table.protocol == FEETECH) == (protocol == FEETECH):
                self._tables[number, protocol] = table

    # Registers.

    def _table(self, number: int, protocol: int) -> ControlTable:
        return self._tables.get((number, protocol)) or table_named(_ASSUMED[protocol])

    def _names(self, number: int, protocol: int, place: Place) -> str:
        """Return the names of registers, the first and the last of many."""
        names = [item.name for item in _items(self._table(number, protocol), place)]
        if len(names) > 4:
            names = [names[0], "...", names[-1]]
        return f"{', '.join(names)} @{place[0]}:{place[1]}".lstrip() + self._assumption(number, protocol)

    def _values(self, number: int, protocol: int, address: int, data: bytes) -> str:
        """Return registers and their values, in SI units and raw."""
        table = self._table(number, protocol)
        shown, at = [], address
        for item in _items(table, (address, len(data))):
            if item.address > at:
                shown.append(f"@{at} {hex_of(data[at - address : item.address - address])}")
            if item.address >= at:
                shown.append(_value(item, item.unpack(data[item.address - address : item.end - address])))
                at = item.end
        if at < address + len(data):
            shown.append(f"@{at} {hex_of(data[at - address :])}")
        return ", ".join(shown) + self._assumption(number, protocol)

    def _assumption(self, number: int, protocol: int) -> str:
        return "" if (number, protocol) in self._tables else f" (as {_ASSUMED[protocol]})"


def dynamixel(devices: Sequence[Mapping[str, Any]]) -> ServoDecoder:
    """Return a decoder for a bus where packets of protocol 1.0 are those of Dynamixel."""
    return ServoDecoder(devices)


def feetech(devices: Sequence[Mapping[str, Any]]) -> ServoDecoder:
    """Return a decoder for a bus where packets of protocol 1.0 are those of Feetech."""
    return ServoDecoder(devices, FEETECH)


def _whole(data: bytearray, size: int) -> Cut | None:
    """Return the cut of a packet, None if it is not whole; in a damaged one the next one may begin."""
    if len(data) < size:
        return None
    inner = data.find(HEADER_1, 3, size)
    damaged = inner > 0 and _is_damaged(bytes(data[:size]), data[:4] == HEADER_2)
    return Cut(inner, noise=True) if damaged else Cut(size)


def _is_damaged(data: bytes, two: bool) -> bool:
    if two:
        # Byte stuffing keeps a header out of a packet; without this look each header of a row of them costs a CRC over
        # all that follow.
        if data.find(HEADER_2, 4, len(data) - 2) > 0:
            return True
        return crc16(data[:-2]) != data[-2] | data[-1] << 8
    return sum(data[2:]) & 0xFF != 0xFF


def _name(number: int) -> str:
    return "all" if number == BROADCAST else str(number)


def _place(params: bytes, width: int) -> Place:
    return int.from_bytes(params[:width], "little"), int.from_bytes(params[width : 2 * width], "little")


def _parts(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data) - size + 1, size)]


def _items(table: ControlTable, place: Place) -> list[Item]:
    address, size = place
    return [item for item in table.items.values() if address <= item.address and item.end <= address + size]


def _value(item: Item, raw: int) -> str:
    unit = units.unit_of(item)
    if item.unit == "count":
        return f"{item.name} {raw}"
    try:
        return with_unit(item.name, raw, unit.to_si(raw), unit.symbol)
    except (ArithmeticError, ValueError, IndexError):
        return f"{item.name} {raw}"
