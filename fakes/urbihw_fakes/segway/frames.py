"""The frames on the bus of an RMP: identifiers, words, and the scales of each model.

A frame has four words of 16 bits ("slots"), big-endian. A number of 32 bits takes two of them, the low word first.

    0x0400-0x0407  base to host, the monitoring cycle, every 10 ms
    0x0412         shut down; also sent by the user interface box while the base is off
    0x0413         motion and configuration command, and the heartbeat
    0x0680, 0x0688 status words of the base; heartbeat of the box
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from urbihw_fakes.can.node import CanFrame

CYCLE = tuple(range(0x400, 0x408))
SHUTDOWN = 0x412
COMMAND = 0x413
BOX_STATE = 0x414
STATUS = 0x680
BOX = 0x688

FULL_VELOCITY = 1176
"""Velocity command at full scale, which is 8 mph."""
FULL_SPEED = 3.576
"""That speed, m/s."""
FULL_TURN = 1024
"""Turn command at full scale."""
PER_RADIAN = 446.9071
"""Counts per rad and per rad/s: 7.8 per degree."""

DISABLED, TRACTOR, BALANCE, POWER_DOWN = range(4)
"""Operating modes."""

# Configuration commands: the third word of 0x0413; the fourth is the parameter.
NO_CONFIGURATION = 0
SET_VELOCITY_SCALE = 10
SET_ACCELERATION_SCALE = 11
SET_TURN_SCALE = 12
SET_GAIN_SCHEDULE = 13
SET_CURRENT_LIMIT = 14
SET_LOCKOUT = 15
SET_MODE = 16
RESET_INTEGRATORS = 50

_WORDS = struct.Struct(">4H")
_WORD = 0xFFFF


@dataclass(frozen=True, slots=True)
class Model:
    """The scale of one model's firmware, in counts per unit: m/s, m, turn, N m."""

    speed: float
    distance: float
    turn: float
    torque: float


MODELS = {
    "50": Model(401, 40181, 117031, 1463),
    "100": Model(401, 40181, 117031, 1463),
    "200": Model(332, 33215, 112644, 1094),
    "400": Model(332, 33215, 112644, 1094),
}
"""The models by name; "400" is one half of an RMP 400, a base like an RMP 200."""


def frame(identifier: int, *words: int) -> CanFrame:
    """Return a frame of up to four words, each cut to 16 bits; missing words are 0."""
    return CanFrame(identifier, _WORDS.pack(*(word & _WORD for word in (*words, 0, 0, 0, 0)[:4])))


def words(data: bytes) -> tuple[int, int, int, int]:
    """Return the four unsigned words of 8 data bytes."""
    first, second, third, fourth = _WORDS.unpack(data)
    return first, second, third, fourth


def signed(word: int) -> int:
    """Return a word as a two's complement number."""
    return word - 0x10000 if word & 0x8000 else word


def double(value: int) -> tuple[int, int]:
    """Return a number as two words, the low one first, modulo 2^32."""
    return value & _WORD, value >> 16 & _WORD
