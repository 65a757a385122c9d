"""The packets of a Pioneer that are sent on request; no I/O.

``PACKETS`` holds the device and the decoder of each packet type.  Sources: the
ARCOS chapter of the Pioneer 3 manual, MobileSim, ARIA (``ArRobotConfigPacketReader.cpp``, ``ArAnalogGyro.cpp``,
``ArRobotJoyHandler.cpp``, ``ArRobotBatteryPacketReader.cpp``).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

CONFIG: Final = 0x20
RESET_NOTICES: Final = (0xFE, 0xFF)

_TEXT = "text"
_CONFIG_FIELDS: Final[tuple[tuple[str, str], ...]] = (
    ("class", _TEXT), ("subclass", _TEXT), ("serial", _TEXT), ("four_motors", "B"),
    ("rot_vel_top", "H"), ("trans_vel_top", "H"), ("rot_accel_top", "H"), ("trans_accel_top", "H"), ("pwm_max", "H"),
    ("name", _TEXT), ("sip_cycle", "B"), ("host_baud", "B"), ("aux_baud", "B"), ("gripper", "H"),
    ("front_sonar", "H"), ("rear_sonar", "B"), ("low_battery", "H"), ("rev_count", "H"), ("watchdog", "H"),
    ("p2mpacs", "B"), ("stall_val", "H"), ("stall_count", "H"), ("joy_vel", "H"), ("joy_rvel", "H"),
    ("rot_vel_max", "H"), ("trans_vel_max", "H"), ("rot_accel", "H"), ("rot_decel", "H"),
    ("rot_kp", "H"), ("rot_kv", "H"), ("rot_ki", "H"), ("trans_accel", "H"), ("trans_decel", "H"),
    ("trans_kp", "H"), ("trans_kv", "H"), ("trans_ki", "H"), ("front_bumps", "B"), ("rear_bumps", "B"),
    ("charger", "B"), ("sonar_cycle", "B"), ("auto_baud", "B"), ("gyro_type", "B"), ("drift_factor", "h"),
    ("aux2_baud", "B"), ("aux3_baud", "B"), ("ticks_mm", "H"), ("shutdown_volts", "H"), ("firmware", _TEXT),
    ("gyro_cw", "H"), ("gyro_ccw", "H"), ("kinematics_delay", "B"), ("lat_vel_top", "H"), ("lat_accel_top", "H"),
    ("lat_vel_max", "H"), ("lat_accel", "H"), ("lat_decel", "H"), ("charge_threshold", "H"), ("pdb_port", "B"),
    ("gyro_rate_limit", "H"), ("high_temp_shutdown", "b"), ("power_bits", "H"), ("battery_type", "B"),
    ("charge_low", "H"), ("charge_shutdown", "H"), ("bootloader", _TEXT), ("config_flags", "I"),
    ("gyro_firmware", "h"),
)  # fmt: skip


def parse_config(body: bytes) -> dict[str, int | str]:
    """CONFIGpac by name, without its type byte.  Old firmware ends early: what is missing is 0 or ""."""
    values: dict[str, int | str] = {}
    at = 0
    for name, kind in _CONFIG_FIELDS:
        if kind == _TEXT:
            end = body.find(0, at)
            end = len(body) if end < 0 else end
            values[name] = body[at:end].decode("latin-1")
            at = end + 1
            continue
        layout = struct.Struct("<" + kind)
        values[name] = layout.unpack_from(body, at)[0] if at + layout.size <= len(body) else 0
        at += layout.size
    return values


def parse_names(body: bytes) -> tuple[str, str, str]:
    """Name, class and subclass from the answer to SYNC2, without its type byte.  Raises BadFrame."""
    names = body.split(b"\0")
    if len(names) < 3:
        raise BadFrame("the answer to SYNC2 does not hold three names")
    name, kind, subclass = (word.decode("latin-1") for word in names[:3])
    return name, kind, subclass


class _BodyReader:
    """Reads numbers from a packet body, one after the other."""

    def __init__(self, body: bytes) -> None:
        self._body = body
        self._at = 0

    def read_value(self, layout: str) -> int:
        form = struct.Struct("<" + layout)
        if self._at + form.size > len(self._body):
            raise BadFrame(f"a packet of {len(self._body)} bytes ends early")
        (value,) = form.unpack_from(self._body, self._at)
        self._at += form.size
        return int(value)

    def read_list(self, layout: str) -> list[int]:
        return [self.read_value(layout) for _ in range(self.read_value("B"))]


def _encoders(body: bytes) -> dict[str, Any]:
    reader = _BodyReader(body)
    return {"left": reader.read_value("i"), "right": reader.read_value("i")}


def _inputs(body: bytes) -> dict[str, Any]:
    reader = _BodyReader(body)
    return {"digital_in": reader.read_list("B"), "digital_out": reader.read_list("B"), "analog": reader.read_list("H")}


def _gyro(body: bytes) -> dict[str, Any]:
    reader = _BodyReader(body)
    readings = [(reader.read_value("H"), reader.read_value("B")) for _ in range(reader.read_value("B"))]
    if not readings:
        return {}
    return {"rate": sum(rate for rate, _ in readings) / len(readings), "temperature": readings[-1][1]}


def _joystick(body: bytes) -> dict[str, Any]:
    reader = _BodyReader(body)
    names = (("button1", "B"), ("button2", "B"), ("x", "H"), ("y", "H"), ("throttle", "H"))
    return {name: reader.read_value(layout) for name, layout in names}


def _batteries(body: bytes) -> dict[str, Any]:
    reader = _BodyReader(body)
    count, size = reader.read_value("B"), reader.read_value("B")
    return {"batteries": [[reader.read_value("B") for _ in range(size)] for _ in range(count)]}


def _bytes(body: bytes) -> dict[str, Any]:
    return {"data": body}


@frozen
class PacketType:
    """A packet type: the ``device`` whose values it holds, and ``read``, which decodes the body after the type byte."""

    device: str
    read: Callable[[bytes], dict[str, Any]]


PACKETS: Final[dict[int, PacketType]] = {
    0x90: PacketType("encoder", _encoders),
    0xF0: PacketType("io", _inputs),
    0x98: PacketType("gyro", _gyro),
    0xF8: PacketType("joystick", _joystick),
    0xE0: PacketType("gripper", _bytes),
    0xFA: PacketType("battery", _batteries),
    0xB0: PacketType("aux1", _bytes),
    0xB8: PacketType("aux2", _bytes),
    0x9A: PacketType("imu", _bytes),
    0xA0: PacketType("arm", _bytes),
    0xA1: PacketType("arm_info", _bytes),
}
"""Packet type -> what it is.  SIPs, CONFIGpac, the answers of the handshake and simulator packets are not here."""

REQUESTS: Final[dict[str, str]] = {
    "encoder": "ENCODER",
    "io": "IOREQUEST",
    "gyro": "GYRO",
    "joystick": "JOYREQUEST",
    "gripper": "GRIPPERPACREQUEST",
    "battery": "BATTERYINFO",
}
"""Device -> the command with which its packets are switched on (2, the gyro 1) and off (0)."""


# --- the laser of MobileSim, transmitted over the robot's own line ----------------------------------------------------

SIM_LASER: Final = (0x60, 0x61)
_SIM_LONGEST: Final = 1000


class SimLaser:
    """Assembles the scans of MobileSim: packets 0x60 and 0x61 hold at most 32 readings each."""

    def __init__(self) -> None:
        self._ranges: list[int] = []
        self._seen = 0

    def feed(self, kind: int, body: bytes) -> list[int] | None:
        """Add a packet without its type byte; with the last one return all ranges in mm, from right to left.

        Raises BadFrame.
        """
        reader = _BodyReader(body)
        if kind == SIM_LASER[0]:
            for _ in range(3):
                reader.read_value("h")
        total, first, number = reader.read_value("h"), reader.read_value("h"), reader.read_value("B")
        if not 0 < total <= _SIM_LONGEST or first < 0 or first + number > total:
            raise BadFrame(f"a laser packet says {number} readings from {first} on, of {total}")
        if first == 0 or len(self._ranges) != total:
            self._ranges, self._seen = [0] * total, 0
        for index in range(first, first + number):
            self._ranges[index] = reader.read_value("H")
            if kind == SIM_LASER[1]:
                reader.read_value("B")
                reader.read_value("H")
        self._seen += number
        if self._seen < total:
            return None
        ranges, self._ranges, self._seen = self._ranges, [], 0
        return ranges
