"""What is on the bus of an RMP: identifiers, words, and the numbers of each model.

A frame has four words of 16 bits ("slots"), big-endian. A number of 32 bits takes two of them, the low word first.

    0x0400-0x0407  base to host, the monitoring cycle, every 10 ms
    0x0412         shut down; also what the user interface box sends while the base is off
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
"""Velocity command at full scale; it stands for 8 mph."""
FULL_SPEED = 3.576
"""That speed, m/s."""
FULL_TURN = 1024
"""Turn command at full scale."""
PER_RADIAN = 446.9071
"""Counts per rad and per rad/s: 7.8 per degree."""

DISABLED, TRACTOR, BALANCE, POWER_DOWN = range(4)

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
"""By name; "400" is one half of it, which is a base like an RMP 200."""


def frame(identifier: int, *words: int) -> CanFrame:
    """A frame of up to four words; missing ones are 0, and each is cut to its 16 bits."""
    return CanFrame(identifier, _WORDS.pack(*(word & _WORD for word in (*words, 0, 0, 0, 0)[:4])))


def words(data: bytes) -> tuple[int, int, int, int]:
    """The four words of 8 data bytes, as they are."""
    first, second, third, fourth = _WORDS.unpack(data)
    return first, second, third, fourth


def signed(word: int) -> int:
    """A word as a two's complement number."""
    return word - 0x10000 if word & 0x8000 else word


def double(value: int) -> tuple[int, int]:
    """A number of 32 bits as two words, the low one first; it wraps."""
    return value & _WORD, value >> 16 & _WORD
