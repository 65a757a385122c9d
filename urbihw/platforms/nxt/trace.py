"""The traffic of an NXT, decoded; no I/O and no time.

On USB each chunk is a telegram; over Bluetooth each has its length in front. The first chunk tells which it is.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from urbihw.buses.errors import BusError
from urbihw.buses.trace import Chunk, Cut, Direction, StreamDecoder, TracedPacket, hex_of, with_unit
from urbihw.platforms.nxt import protocol as p

_NO_REPLY, _REPLY = 0x80, 0x02
_KINDS: Final = (0x00, 0x01, _REPLY, 0x80, 0x81)
_DIRECT: Final = (
    "STARTPROGRAM", "STOPPROGRAM", "PLAYSOUNDFILE", "PLAYTONE", "SETOUTPUTSTATE", "SETINPUTMODE", "GETOUTPUTSTATE",
    "GETINPUTVALUES", "RESETINPUTSCALEDVALUE", "MESSAGEWRITE", "RESETMOTORPOSITION", "GETBATTERYLEVEL",
    "STOPSOUNDPLAYBACK", "KEEPALIVE", "LSGETSTATUS", "LSWRITE", "LSREAD", "GETCURRENTPROGRAMNAME", "",
    "MESSAGEREAD",
)  # fmt: skip
"""Opcode -> name (c_cmd.c)."""
_SYSTEM_NAMES: Final = {
    0x80: "OPENREAD", 0x81: "OPENWRITE", 0x82: "READ", 0x83: "WRITE", 0x84: "CLOSE", 0x85: "DELETE",
    0x86: "FINDFIRST", 0x87: "FINDNEXT", 0x88: "GET FIRMWARE VERSION", 0x89: "OPENWRITELINEAR",
    0x8A: "OPENREADLINEAR", 0x8B: "OPENWRITEDATA", 0x8C: "OPENAPPENDDATA", 0x90: "FINDFIRSTMODULE",
    0x91: "FINDNEXTMODULE", 0x92: "CLOSEMODULE", 0x94: "IOMAPREAD", 0x95: "IOMAPWRITE", p.BOOT: "BOOT",
    0x98: "SET BRICK NAME", 0x9B: "GET DEVICE INFO", 0xA0: "DELETE USER FLASH", 0xA1: "POLLLENGTH", 0xA2: "POLL",
    0xA4: "BLUETOOTH RESET",
}  # fmt: skip


class NxtDecoder(StreamDecoder):
    """Decodes the telegrams of a brick."""

    half_duplex = True

    def __init__(self) -> None:
        super().__init__()
        self._has_lengths: bool | None = None

    def feed(self, chunk: Chunk) -> list[TracedPacket]:
        """Return the telegrams that this chunk completes."""
        if self._has_lengths is None and chunk.data:
            self._has_lengths = len(chunk.data) > 2 and int.from_bytes(chunk.data[:2], "little") == len(chunk.data) - 2
        if self._has_lengths:
            return super().feed(chunk)
        return self.decode(chunk.time, chunk.direction, chunk.data) if chunk.data else []

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin, over Bluetooth."""
        if len(data) < 3:
            return None
        size = data[0] | data[1] << 8
        if not 2 <= size <= p.LONGEST or data[2] not in _KINDS:
            return Cut(1, noise=True)
        return Cut(size + 2) if len(data) >= size + 2 else None

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        """Return the packet of a telegram."""
        telegram = data[2:] if self._has_lengths else data
        if len(telegram) < 2 or telegram[0] not in _KINDS:
            return [TracedPacket(time, direction, "", "?", hex_of(data), problem="no telegram", data=data)]
        if telegram[0] == _REPLY:
            return [self._reply(time, direction, telegram, data)]
        opcode, body = telegram[1], telegram[2:]
        detail = _request(opcode, body) + (", no reply wanted" if telegram[0] & _NO_REPLY else "")
        return [
            TracedPacket(time, direction, _device(opcode, body), _name(opcode), detail.removeprefix(", "), data=data)
        ]

    @staticmethod
    def _reply(time: float, direction: Direction, telegram: bytes, data: bytes) -> TracedPacket:
        opcode, status = telegram[1], telegram[2] if len(telegram) > 2 else 0
        if len(telegram) < 3:
            return TracedPacket(time, direction, "", f"reply {_name(opcode)}", problem="no status", data=data)
        problem = p.MEANINGS.get(status, f"status 0x{status:02X}") if status else ""
        detail = ""
        if not status:
            try:
                detail = _REPLIES.get(opcode, _other_reply)(telegram)
            except (BusError, struct.error) as error:
                detail, problem = hex_of(telegram[3:]), str(error)
        device = _device(opcode, telegram[3:4]) if opcode in (0x06, 0x07) else ""
        return TracedPacket(time, direction, device, f"reply {_name(opcode)}", detail, problem=problem, data=data)


def nxt(devices: Sequence[Mapping[str, Any]]) -> NxtDecoder:
    """Return a decoder; the devices need not be known."""
    return NxtDecoder()


def _name(opcode: int) -> str:
    name = _DIRECT[opcode] if opcode < len(_DIRECT) else _SYSTEM_NAMES.get(opcode, "")
    return name or f"opcode 0x{opcode:02X}"


def _device(opcode: int, body: bytes) -> str:
    """Return the motor or the port that a telegram is about, "" for none."""
    if not body:
        return ""
    if opcode in (0x04, 0x06, 0x0A):
        return p.OUTPUTS[body[0]] if body[0] < len(p.OUTPUTS) else "all" if body[0] == p.ALL_OUTPUTS else str(body[0])
    if opcode in (0x05, 0x07, 0x08, 0x0E, 0x0F, 0x10):
        return f"port {body[0] + 1}"
    return ""


def _request(opcode: int, body: bytes) -> str:
    if opcode == 0x04 and len(body) == 10:
        _, power, mode, regulation, ratio, run, limit = struct.unpack("<BbBBbBI", body)
        return (f"power {power} %, mode {mode}, regulation {regulation}, ratio {ratio}, run state {run}, "
                f"limit {limit} deg")
    if opcode == 0x03 and len(body) == 4:
        frequency, milliseconds = struct.unpack("<HH", body)
        return f"{frequency} Hz, {milliseconds / 1000:g} s"
    if opcode == 0x05 and len(body) == 3:
        return f"type {body[1]}, mode 0x{body[2]:02X}"
    if opcode == 0x0F and len(body) >= 3:
        return f"write {hex_of(body[3:])}, then read {body[2]} bytes"
    if opcode in (0x06, 0x07, 0x0E, 0x10):
        return ""
    return hex_of(body)


def _other_reply(reply: bytes) -> str:
    return hex_of(reply[3:])


def _output_state(reply: bytes) -> str:
    state = p.parse_output_state(reply)
    return (f"power {state.power} %, mode {state.mode}, run state {state.run_state}, limit {state.limit} deg, "
            f"rotation {state.rotation} deg, block {state.block} deg")


def _input_values(reply: bytes) -> str:
    values = p.parse_input_values(reply)
    valid = "" if values.valid else ", not valid yet"
    return f"type {values.kind}, raw {values.raw}, normalised {values.normalised}, scaled {values.scaled}{valid}"


def _battery(reply: bytes) -> str:
    level = p.parse_battery(reply)
    return with_unit("battery", level, level / 1000, "V")


def _version(reply: bytes) -> str:
    found = p.parse_version(reply)
    return f"firmware {'.'.join(map(str, found.firmware))}, protocol {'.'.join(map(str, found.protocol))}"


def _info(reply: bytes) -> str:
    found = p.parse_device_info(reply)
    return f"{found.name}, {found.address}, {found.free} bytes free"


_REPLIES: Final[dict[int, Callable[[bytes], str]]] = {
    0x06: _output_state,
    0x07: _input_values,
    0x0B: _battery,
    0x0D: lambda reply: f"sleeps after {p.parse_sleep_limit(reply) / 1000:g} s",
    0x0E: lambda reply: f"{p.parse_ls_status(reply)} bytes ready",
    0x10: lambda reply: hex_of(p.parse_ls_read(reply)),
    0x88: _version,
    0x9B: _info,
}
"""Opcode -> the content of its reply; the functions raise BusError."""
