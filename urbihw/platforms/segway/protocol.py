"""Frames of an RMP: conversion between words and values. Bytes only.

A frame has four words of 16 bits, big-endian. A value of 32 bits takes two of them, the low word first:

    0x0413 host to base: | velocity s16 | turn s16 | configuration u16 | parameter u16 |     it is also the heartbeat
    0x0400 ... 0x0407 base to host, every 10 ms, in this order: the monitoring cycle, rows of MONITOR
    0x0680 base: status words           0x0412 user interface box: the base is off; from the host: switch it off

Source of each fact: libsegwayrmp (81f7971), Player, CARMEN, and Orca's hydrosegwayrmpacfr, which cites the maker's
interface guide and holds a bus log. Where they disagree, a coefficient can be set; see README.md.
"""

from __future__ import annotations

import struct
from typing import Final

FIRST, LAST_OLD, LAST = 0x400, 0x404, 0x407
"""First frame of a cycle, the last of the oldest firmware (inferred from CARMEN), the last of all others."""
SHUTDOWN, COMMAND, STATUS = 0x412, 0x413, 0x680

MOST_VELOCITY, MOST_TURN = 1176, 1024
"""Counts of a full-scale command, the largest that may be sent."""
MODES: Final = ("disabled", "tractor", "balance", "power down")
"""Operational modes by number; the last is a command only."""
GAINS: Final = ("light", "tall", "heavy")
"""Controller gain schedules by number."""
ALL_INTEGRATORS = 0x0F

CONFIGURATIONS: Final = {
    "velocity_scale": (10, 16),
    "acceleration_scale": (11, 16),
    "turn_scale": (12, 16),
    "gain": (13, 2),
    "current_limit": (14, 256),
    "lockout": (15, 1),
    "mode": (16, 3),
    "reset": (50, ALL_INTEGRATORS),
}
"""Name -> (command, largest parameter). "reset" takes bits: 1 right wheel, 2 left wheel, 4 yaw, 8 forward."""

_SIGNED, _UNSIGNED, _LONG = "signed", "unsigned", "long"
MONITOR: Final[dict[int, tuple[tuple[str, int, str], ...]]] = {
    0x400: (("build", 0, _UNSIGNED),),
    0x401: (("pitch", 0, _SIGNED), ("pitch_rate", 1, _SIGNED), ("roll", 2, _SIGNED), ("roll_rate", 3, _SIGNED)),
    0x402: (
        ("left_speed", 0, _SIGNED),
        ("right_speed", 1, _SIGNED),
        ("yaw_rate", 2, _SIGNED),
        ("servo_frames", 3, _UNSIGNED),
    ),
    0x403: (("left", 0, _LONG), ("right", 2, _LONG)),
    0x404: (("forward", 0, _LONG), ("yaw", 2, _LONG)),
    0x405: (("left_torque", 0, _SIGNED), ("right_torque", 1, _SIGNED)),
    0x406: (("mode", 0, _UNSIGNED), ("gain", 1, _UNSIGNED), ("box_battery", 2, _UNSIGNED), ("battery", 3, _UNSIGNED)),
    0x407: (("velocity", 0, _SIGNED), ("turn", 1, _SIGNED)),
    STATUS: (("status1", 1, _UNSIGNED), ("status2", 2, _UNSIGNED)),
}
"""Frame -> (name, first word, kind) of what it holds; other words mean nothing."""
OLD_BATTERY: Final = ("battery", 2, _UNSIGNED)
"""The battery in frame 0x0400 of the oldest firmware, which has no 0x0406 (CARMEN)."""
COUNTERS: Final = ("left", "right", "forward", "yaw")

LOW_VOLTAGE: Final = 66.0
"""Volts of the base below which its battery is low (Orca)."""

_MOTORS_ON = 0x0080
ENABLED: Final = _MOTORS_ON | 0x0100
"""The bits of the first status word that report no fault: motors on, balance mode."""
_WORD_1: Final = {
    0x0001: "safety shutdown",
    0x0004: "safety shutdown 2",
    0x0008: "motors disabled on request",
    0x0010: "speed limited to 4 mph",
    0x0020: "speed limited to 0 mph",
    0x0040: "system integrity fault",
    0x0200: "yaw transient",
    0x0400: "battery empty hazard",
    0x1000: "wheel slip",
    0x2000: "motor feedback fault",
    0x4000: "battery low",
}
_WORD_2: Final = {
    0x01: "pitch angle limit",
    0x02: "emergency stop switch open",
    0x04: "position error limit",
    0x08: "maximum velocity exceeded",
    0x10: "battery empty",
    0x20: "battery temperature",
    0x40: "roll angle limit",
    0x80: "bus voltage low",
}
"""Side A in the low byte, side B in the high one."""

_WORDS = struct.Struct(">4H")
_COMMAND = struct.Struct(">2h2H")


def command(velocity: int, turn: int, configuration: int = 0, parameter: int = 0) -> bytes:
    """Data of 0x0413; velocity and turn are cut to their limits."""
    return _COMMAND.pack(
        max(-MOST_VELOCITY, min(MOST_VELOCITY, velocity)),
        max(-MOST_TURN, min(MOST_TURN, turn)),
        configuration,
        parameter,
    )


def decode(identifier: int, data: bytes) -> dict[str, int]:
    """Return the values of a frame by name; none for a frame that is not in MONITOR or not 8 bytes long."""
    rows = MONITOR.get(identifier)
    if rows is None or len(data) != _WORDS.size:
        return {}
    words = _WORDS.unpack(data)
    return {name: _value(words, place, kind) for name, place, kind in rows}


def old_battery(data: bytes) -> int:
    """Return the battery in 0x0400 of the oldest firmware."""
    return _value(_WORDS.unpack(data), OLD_BATTERY[1], OLD_BATTERY[2])


def difference(new: int, old: int, bits: int = 32) -> int:
    """Return the signed difference of a counter that wraps."""
    half = 1 << bits - 1
    return (new - old + half) % (half * 2) - half


def motors_on(status1: int) -> bool:
    """Return whether the motors are enabled."""
    return bool(status1 & _MOTORS_ON)


def fault_words(status1: int, status2: int) -> str:
    """Return the faults of the status words as a text; "" for none."""
    found = [text for bit, text in _WORD_1.items() if status1 & bit]
    sides = (status2 | status2 >> 8) & 0xFF
    found += [text for bit, text in _WORD_2.items() if sides & bit]
    return ", ".join(found)


def _value(words: tuple[int, ...], place: int, kind: str) -> int:
    if kind == _LONG:
        return difference(words[place] | words[place + 1] << 16, 0)
    return difference(words[place], 0, 16) if kind == _SIGNED else words[place]
