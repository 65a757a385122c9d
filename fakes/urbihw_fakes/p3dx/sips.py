"""The packets that a controller sends, as bytes; their bodies, to be framed by ``codec``."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

TAIL_LAYOUT = (
    ("battery_x10", "H"),
    ("charge_state", "B"),
    ("rotation", "h"),
    ("faults", "H"),
    ("sideways", "h"),
    ("temperature", "b"),
    ("charge", "B"),
)


@dataclass
class SipFields:
    """The fields of a SIP, in raw counts; ``tail``: the fields after the digital outputs, in order, by name."""

    moving: bool = False
    x: int = 0
    y: int = 0
    theta: int = 0
    left: int = 0
    right: int = 0
    battery: int = 0
    stall: int = 0
    control: int = 0
    flags: int = 0
    compass: int = 0
    sonars: Sequence[tuple[int, int]] = ()
    gripper: int = 0
    analog_port: int = 0
    analog: int = 0
    digital_in: int = 0xFF
    digital_out: int = 0xFF
    tail: dict[str, int] = field(default_factory=dict)

    def body(self) -> bytes:
        """The body of the packet, as bytes."""
        data = struct.pack(
            "<BHHhhhBHhHBB", 0x33 if self.moving else 0x32, self.x & 0x7FFF, self.y & 0x7FFF, self.theta, self.left,
            self.right, self.battery, self.stall, self.control, self.flags, self.compass, len(self.sonars),
        )  # fmt: skip
        data += b"".join(struct.pack("<BH", number, distance) for number, distance in self.sonars)
        data += bytes([self.gripper, self.analog_port, self.analog, self.digital_in, self.digital_out])
        for name, layout in TAIL_LAYOUT:
            if name not in self.tail:
                break
            data += struct.pack("<" + layout, self.tail[name])
        return data


@dataclass
class Settings:
    """The flash settings of a controller, as in CONFIGpac."""

    kind: str = "Pioneer"
    subclass: str = "p3dx-sh"
    serial: str = "SIM1"
    name: str = "fake"
    rot_vel_top: int = 360
    trans_vel_top: int = 1500
    rot_accel_top: int = 300
    trans_accel_top: int = 2000
    pwm_max: int = 400
    sip_cycle: int = 100
    host_baud: int = 0
    low_battery: int = 115
    rev_count: int = 16570
    watchdog: int = 2000
    stall_val: int = 200
    stall_count: int = 200
    rot_vel_max: int = 100
    trans_vel_max: int = 750
    rot_accel: int = 100
    trans_accel: int = 300
    front_bumps: int = 0
    rear_bumps: int = 0
    sonar_cycle: int = 40
    auto_baud: int = 2
    gyro_type: int = 0
    gripper: int = 0
    ticks_mm: int = 138
    shutdown_volts: int = 110
    firmware: str = "2.0"

    def body(self) -> bytes:
        """CONFIGpac up to the gyro's calibration, as an ARCOS 2.0 sends it."""

        def text(value: str) -> bytes:
            return value.encode("latin-1") + b"\0"

        def words(*values: int) -> bytes:
            return struct.pack(f"<{len(values)}H", *values)

        return b"".join(
            [
                b"\x20", text(self.kind), text(self.subclass), text(self.serial), b"\0",
                words(self.rot_vel_top, self.trans_vel_top, self.rot_accel_top, self.trans_accel_top, self.pwm_max),
                text(self.name), bytes([self.sip_cycle, self.host_baud, 0]),
                words(self.gripper, 1), b"\1", words(self.low_battery, self.rev_count, self.watchdog), b"\0",
                words(self.stall_val, self.stall_count, 400, 100, self.rot_vel_max, self.trans_vel_max),
                words(self.rot_accel, self.rot_accel, 40, 20, 0, self.trans_accel, self.trans_accel, 40, 30, 0),
                bytes([self.front_bumps, self.rear_bumps, 0, self.sonar_cycle, self.auto_baud, self.gyro_type]),
                words(0), b"\0\0", words(self.ticks_mm, self.shutdown_volts), text(self.firmware), words(0, 0),
            ]
        )  # fmt: skip


def names(settings: Settings) -> bytes:
    """The answer to SYNC2."""
    words = (settings.name, settings.kind, settings.subclass)
    return b"\2" + b"".join(word.encode("latin-1") + b"\0" for word in words)


def encoders(left: int, right: int) -> bytes:
    """A packet ENCODERpac: the counts of both wheels."""
    return b"\x90" + struct.pack("<ii", left, right)


def inputs(digital_in: Sequence[int], digital_out: Sequence[int], analog: Sequence[int]) -> bytes:
    """A packet IOpac: inputs and outputs."""
    data = bytes([0xF0, len(digital_in), *digital_in, len(digital_out), *digital_out, len(analog)])
    return data + struct.pack(f"<{len(analog)}H", *analog)


def gyro(rates: Sequence[int], temperature: int) -> bytes:
    """A packet GYROpac: the readings of the gyro."""
    return bytes([0x98, len(rates)]) + b"".join(struct.pack("<HB", rate, temperature) for rate in rates)


def joystick(button1: bool, button2: bool, x: int, y: int, throttle: int) -> bytes:
    """A packet JOYSTICKpac: stick and buttons."""
    return b"\xf8" + struct.pack("<BBHHH", button1, button2, x, y, throttle)


def batteries(charges: Sequence[int]) -> bytes:
    """BATTERYpac: flags and the charge of each battery in percent."""
    return bytes([0xFA, len(charges), 5]) + b"".join(bytes([0, 0, 0, charge, charge]) for charge in charges)


def sim_scan(pose: tuple[int, int, int], ranges: Sequence[int], *, long: bool) -> list[bytes]:
    """A laser scan as MobileSim sends it: packets of at most 32 readings."""
    packets = []
    for first in range(0, len(ranges), 32):
        part = ranges[first : first + 32]
        head = struct.pack("<hhB", len(ranges), first, len(part))
        if long:
            readings = b"".join(struct.pack("<HBH", value, 0, 0) for value in part)
            packets.append(b"\x61" + head + readings + b"\0\0")
        else:
            packets.append(b"\x60" + struct.pack("<hhh", *pose) + head + struct.pack(f"<{len(part)}H", *part))
    return packets
