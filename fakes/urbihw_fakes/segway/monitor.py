"""The frames that the base sends unasked, made from its measured values."""

from __future__ import annotations

import math
from dataclasses import dataclass

from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.segway import frames as f

BUILD = 2032
"""Firmware of the base in the available log; the words after it, and the one in 0x0405, are copied from the log."""
_NO_MEANING = (0x0504, 0x0D35, 0x0423)
_TORQUE_FILLER = 0x0080
_WAKE_CONTROL = 0x0005


@dataclass(frozen=True, slots=True)
class Reading:
    """One monitoring cycle in SI units; `frames` is in servo frames, `velocity` and `turn` are the command in counts,
    `left_count` ... the raw integrators."""

    pitch: float = 0.0
    pitch_rate: float = 0.0
    roll: float = 0.0
    roll_rate: float = 0.0
    left_speed: float = 0.0
    right_speed: float = 0.0
    yaw_rate: float = 0.0
    frames: int = 0
    left_count: int = 0
    right_count: int = 0
    forward_count: int = 0
    yaw_count: int = 0
    left_torque: float = 0.0
    right_torque: float = 0.0
    mode: int = f.BALANCE
    gain: int = 0
    box_volts: float = 0.0
    volts: float = 0.0
    velocity: int = 0
    turn: int = 0
    build: int = BUILD


def cycle(reading: Reading, model: f.Model) -> list[CanFrame]:
    """Return the eight frames of a monitoring cycle."""
    angles = (reading.pitch, reading.pitch_rate, reading.roll, reading.roll_rate)
    return [
        f.frame(0x400, reading.build, *_NO_MEANING),
        f.frame(0x401, *(round(value * f.PER_RADIAN) for value in angles)),
        f.frame(
            0x402,
            round(reading.left_speed * model.speed),
            round(reading.right_speed * model.speed),
            round(reading.yaw_rate * f.PER_RADIAN),
            reading.frames,
        ),
        f.frame(0x403, *f.double(reading.left_count), *f.double(reading.right_count)),
        f.frame(0x404, *f.double(reading.forward_count), *f.double(reading.yaw_count)),
        f.frame(
            0x405, round(reading.left_torque * model.torque), round(reading.right_torque * model.torque), _TORQUE_FILLER
        ),
        f.frame(0x406, reading.mode, reading.gain, box_count(reading.box_volts), round(reading.volts * 4)),
        f.frame(0x407, reading.velocity, reading.turn),
    ]


def old_cycle(reading: Reading, model: f.Model) -> list[CanFrame]:
    """Return the five frames of the oldest firmware, with the battery in the first."""
    first, *rest = cycle(reading, model)[:5]
    return [f.frame(first.id, reading.build, 0, round(reading.volts * 4)), *rest]


def status(first: int, second: int) -> CanFrame:
    """The status words of a monitor message."""
    return f.frame(f.STATUS, _WAKE_CONTROL, first, second)


def box_heartbeat(volts: float) -> CanFrame:
    """Return the heartbeat of the user interface box while the base is on."""
    return f.frame(f.BOX, 0, 0, box_count(volts))


def box_alone(volts: float) -> list[CanFrame]:
    """Return the frames of the box while the base is off."""
    return [f.frame(f.SHUTDOWN, 0, 0, box_count(volts)), f.frame(f.BOX_STATE, 0xAA40)]


def box_count(volts: float) -> int:
    """Return the count for the voltage of the box's battery: 1.4 V + 12.5 mV per count."""
    return round((volts - 1.4) / 0.0125)


def turns(yaw: float) -> float:
    """Convert radians to turns."""
    return yaw / math.tau
