"""The standard packet (SIP) that a Pioneer sends periodically, and the unwrapping of its positions; no I/O.

    type x    y    theta left right battery stall control flags compass N   [number range] * N
    u8   u16  u16  s16   s16  s16   u8      u16   s16     u16   u8      u8   u8     u16
    gripper  analog port  analog  digital in  digital out
    u8       u8           u8      u8          u8

Behind that come fields that only newer firmware sends (``_TAIL``); reading ends where the body does, as in ARIA.
Sources: the ARCOS chapter of the Pioneer 3 manual, ARIA (``ArRobot.cpp``), MobileSim (``EmulatePioneer.cc``).
"""

from __future__ import annotations

import struct
from dataclasses import field
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

STOPPED, MOVING = 0x32, 0x33

_HEAD: Final = struct.Struct("<BHHhhhBHhHBB")
_IO: Final = struct.Struct("<BBBBB")
_TAIL: Final = tuple(
    (name, struct.Struct(layout))
    for name, layout in (
        ("battery_x10", "<H"),
        ("charge_state", "<B"),
        ("rotation", "<h"),
        ("faults", "<H"),
        ("sideways", "<h"),
        ("temperature", "<b"),
        ("charge", "<B"),
        ("clock", "<I"),
        ("flags3", "<I"),
    )
)
_SONAR: Final = struct.Struct("<BH")

MOTORS_ON: Final = 1
SONARS_ON: Final = 0b11110
STOP_BUTTON: Final = 1 << 5
FULL_TURN: Final = 4096
"""Angle units of a turn: ARIA, Player and MobileSim agree, the ARCOS manual of 2005 says degrees."""


@frozen
class Sip:
    """One packet, in raw counts.

    Attributes:
        moving: the controller says that it moves (MobileSim never does).
        x, y: position, 15 bits; theta: heading in 1/4096 turn.
        left, right: speeds of the wheels.
        battery: 0.1 V.
        stall: low byte left wheel and rear bumpers, high byte right wheel and front bumpers.
        flags: motors (bit 0), sonar arrays (1 to 4), STOP button (5) ...
        sonars: (number, range) of those that fired since the last packet.
        tail: what newer firmware adds, by name: battery_x10, charge_state, rotation (0.1 deg/s), faults, sideways,
            temperature (degrees C), charge (percent), clock (us), flags3.
    """

    moving: bool
    x: int
    y: int
    theta: int
    left: int
    right: int
    battery: int
    stall: int
    control: int
    flags: int
    compass: int
    sonars: tuple[tuple[int, int], ...]
    gripper: int
    analog_port: int
    analog: int
    digital_in: int
    digital_out: int
    tail: dict[str, int] = field(default_factory=dict)


def parse(body: bytes) -> Sip:
    """Take a body of type 0x32 or 0x33 apart.  Raises BadFrame when it is too short."""
    if len(body) < _HEAD.size:
        raise BadFrame(f"a SIP of {len(body)} bytes is too short")
    kind, x, y, theta, left, right, battery, stall, control, flags, compass, count = _HEAD.unpack_from(body)
    at = _HEAD.size + count * _SONAR.size
    if len(body) < at + _IO.size:
        raise BadFrame(f"a SIP of {len(body)} bytes has no room for {count} sonars")
    sonars = tuple(_SONAR.iter_unpack(body[_HEAD.size : at]))
    tail = {}
    end = at + _IO.size
    for name, layout in _TAIL:
        if len(body) < end + layout.size:
            break
        (tail[name],) = layout.unpack_from(body, end)
        end += layout.size
    gripper, analog_port, analog, digital_in, digital_out = _IO.unpack_from(body, at)
    return Sip(
        kind == MOVING, x & 0x7FFF, y & 0x7FFF, theta, left, right, battery, stall, control, flags, compass, sonars,
        gripper, analog_port, analog, digital_in, digital_out, tail,
    )  # fmt: skip


class Odometer:
    """Counts on what wraps: x and y have 15 bits, the heading 4096 steps a turn; absolute values mean nothing.

    Attributes:
        x, y, theta: counts since the first packet.
    """

    def __init__(self) -> None:
        self.x = self.y = self.theta = 0
        self._last: tuple[int, int, int] | None = None

    def add_sip(self, sip: Sip) -> None:
        """Add how far the robot went since the last packet."""
        now = sip.x, sip.y, sip.theta % FULL_TURN
        last, self._last = self._last or now, now
        self.x += _step(now[0] - last[0], 0x8000)
        self.y += _step(now[1] - last[1], 0x8000)
        self.theta += _step(now[2] - last[2], FULL_TURN)

    def restart(self) -> None:
        """The robot may have been reset or carried: the next packet says where its counts begin."""
        self._last = None


def _step(difference: int, wrap: int) -> int:
    """The shortest way between two counts that wrap."""
    return (difference + wrap // 2) % wrap - wrap // 2


def front_bumpers(stall: int, count: int) -> tuple[bool, ...]:
    """The front bumpers, leftmost first (ROSARIA's order)."""
    return tuple(bool(stall >> 8 + 1 + number & 1) for number in range(count))


def rear_bumpers(stall: int, count: int) -> tuple[bool, ...]:
    """The rear bumpers, leftmost first: their bits begin at the right (ROSARIA's order)."""
    return tuple(bool(stall >> count - number & 1) for number in range(count))
