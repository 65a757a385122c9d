"""The traffic of a CANopen bus with CiA 402 drives, decoded; no I/O and no time.

A PDO carries what its mapping says. The mapping is not in the traffic, so the one that urbihw sets up is assumed
(`cia402.RECEIVED`, `cia402.SENT`); data of another length is shown as bytes. Counts of a drive are raw: what they are
in SI units is in its gear objects. Source: CiA 301 (identifiers, NMT, SDO), CiA 402-2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.can import cia402
from urbihw.buses.can.emergencies import emergency_text
from urbihw.buses.can.frame import MOST_DATA, STANDARD_IDS
from urbihw.buses.trace import Direction, FrameDecoder, TracedPacket, hex_of

_NMT, _SYNC, _TIME, _SDO_ANSWER, _SDO_REQUEST, _HEARTBEAT = 0x000, 0x080, 0x100, 0x580, 0x600, 0x700
_COMMANDS: Final = {1: "start", 2: "stop", 0x80: "pre-operational", 0x81: "reset node", 0x82: "reset communication"}
_STATES: Final = {0: "boot-up", 4: "stopped", 5: "operational", 0x7F: "pre-operational"}
_OBJECTS: Final = {
    0x1000: ("device_type", 4), 0x1001: ("error_register", 1), 0x1008: ("device_name", 4),
    cia402.WATCHED: ("consumer_heartbeat", 4), cia402.HEARTBEAT: ("producer_heartbeat", 2),
    cia402.CONNECTION_LOST: ("abort_connection_option", 2), cia402.ERROR: ("error_code", 2),
    cia402.CONTROL: ("control_word", 2), cia402.STATUS: ("status_word", 2), cia402.MODE: ("mode", 1),
    cia402.MODE_SHOWN: ("mode_display", 1), cia402.PLACE: ("position", 4), cia402.SPEED: ("velocity", 4),
    cia402.TARGET_TORQUE: ("target_torque", 2), cia402.RATED_TORQUE: ("rated_torque", 4),
    cia402.TORQUE_SHOWN: ("torque", 2), cia402.TARGET_PLACE: ("target_position", 4),
    cia402.TARGET_SPEED: ("target_velocity", 4), cia402.HOMING_METHOD: ("homing_method", 1),
    cia402.SUPPORTED: ("supported_modes", 4), 0x6081: ("profile_velocity", 4), 0x6083: ("profile_acceleration", 4),
    0x6085: ("quick_stop_deceleration", 4), 0x607D: ("position_limit", 4), 0x6099: ("homing_speed", 4),
    0x608F: ("encoder_resolution", 4),
}  # fmt: skip
"""Index -> name and number of bytes."""
_UNSIGNED: Final = {cia402.CONTROL, cia402.STATUS, cia402.ERROR}
_SENT: Final = cia402.SENT | cia402.SENT_TORQUE
_RECEIVED: Final = cia402.RECEIVED | cia402.RECEIVED_TORQUE


class CanopenDecoder(FrameDecoder):
    """Decodes the frames of a CANopen bus."""

    def decode(self, time: float, direction: Direction, identifier: int, data: bytes) -> TracedPacket:
        """Return the packet of a frame."""
        raw = identifier.to_bytes(2, "big") + data
        if identifier >= STANDARD_IDS or len(data) > MOST_DATA:
            return TracedPacket(time, direction, "", "?", hex_of(data), problem="no frame of 11 bits", data=raw)
        node, base = identifier & 0x7F, identifier & 0x780
        device = str(node) if node else ""
        what, detail, problem = _content(base, node, data)
        if not what:
            what, problem = f"0x{identifier:03X}", "no identifier of CANopen"
        return TracedPacket(time, direction, device, what, detail, "ok", problem, raw)


def canopen(devices: Sequence[Mapping[str, Any]]) -> CanopenDecoder:
    """Return a decoder; the devices need not be known."""
    return CanopenDecoder()


def _content(base: int, node: int, data: bytes) -> tuple[str, str, str]:
    """Return what a frame is, its content, and what is wrong; "" for an unknown identifier."""
    if base == _NMT and not node:
        who = f"node {data[1]}" if len(data) > 1 and data[1] else "all"
        return "NMT", f"{_COMMANDS.get(data[0] if data else -1, hex_of(data))} {who}", "" if len(data) == 2 else "short"
    if base == _SYNC and not node:
        return "sync", hex_of(data), ""
    if base == _SYNC:
        return _emergency(data)
    if base == _TIME:
        return ("time", hex_of(data), "") if not node else ("", "", "")
    if base in (_SDO_ANSWER, _SDO_REQUEST):
        return _sdo(base == _SDO_REQUEST, data)
    if base == _HEARTBEAT:
        return "heartbeat", _STATES.get(data[0] & 0x7F, hex_of(data)) if data else "", "" if data else "empty"
    if 0x180 <= base <= 0x500 and node:
        number, received = (base - 0x100) // 0x100, not base & 0x80
        if received:
            return f"RPDO{base // 0x100 - 1}", _pdo(_RECEIVED.get(base // 0x100 - 1, ()), data), ""
        return f"TPDO{number + 1}", _pdo(_SENT.get(number + 1, ()), data), ""
    return "", hex_of(data), ""


def _emergency(data: bytes) -> tuple[str, str, str]:
    if len(data) < 3:
        return "emergency", hex_of(data), "short"
    code = int.from_bytes(data[:2], "little")
    text = f"0x{code:04X} register 0x{data[2]:02X} {hex_of(data[3:])}".rstrip()
    return "emergency", text, emergency_text(code) if code else ""


def _pdo(indices: Sequence[int], data: bytes) -> str:
    sizes = [_OBJECTS[index][1] for index in indices]
    if not indices or sum(sizes) != len(data):
        return hex_of(data)
    shown, at = [], 0
    for index, size in zip(indices, sizes, strict=True):
        shown.append(_value(index, 0, data[at : at + size]))
        at += size
    return ", ".join(shown)


def _sdo(request: bool, data: bytes) -> tuple[str, str, str]:
    """Return the content of an SDO: expedited transfers with their value, the segments of others as bytes."""
    who = "SDO request" if request else "SDO answer"
    if len(data) < 4:
        return who, hex_of(data), "short"
    command, index, sub = data[0], data[1] | data[2] << 8, data[3]
    kind = command >> 5
    if command == 0x80:
        return f"{who} abort", _object(index, sub), f"abort code 0x{int.from_bytes(data[4:8], 'little'):08X}"
    if kind == (1 if request else 2):
        verb = "write" if request else "value"
        if command & 2:
            size = 4 - (command >> 2 & 3) if command & 1 else 4
            return f"{who} {verb}", _value(index, sub, data[4 : 4 + size]), ""
        return f"{who} {verb}", f"{_object(index, sub)} of {int.from_bytes(data[4:8], 'little')} bytes follows", ""
    if kind == (2 if request else 3):
        return f"{who} {'read' if request else 'written'}", _object(index, sub), ""
    return f"{who} segment", hex_of(data), ""


def _object(index: int, sub: int) -> str:
    name = _OBJECTS.get(index, ("object", 0))[0]
    return f"{name} {index:04X}:{sub}"


def _value(index: int, sub: int, data: bytes) -> str:
    number = int.from_bytes(data, "little", signed=index not in _UNSIGNED)
    name = _object(index, sub) if sub or index not in _OBJECTS else _OBJECTS[index][0]
    if index == cia402.STATUS:
        return f"{name} 0x{number:04X} ({cia402.state_of(number)})"
    if index in _UNSIGNED:
        return f"{name} 0x{number:04X}"
    if index in (cia402.MODE, cia402.MODE_SHOWN):
        return f"{name} {number} ({cia402.MODES.get(number, 'none')})"
    return f"{name} {number}"
