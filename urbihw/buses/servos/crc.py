"""CRC-16 of Dynamixel protocol 2.0: polynomial 0x8005, initial value 0, no reflection, no final XOR.

Source: ROBOTIS e-manual, protocol 2.0; catalogue name CRC-16/UMTS, check value 0xFEE8 for b"123456789".
"""

from __future__ import annotations

from typing import Final

_POLYNOMIAL = 0x8005


def _entry(index: int) -> int:
    crc = index << 8
    for _ in range(8):
        crc = (crc << 1) ^ _POLYNOMIAL if crc & 0x8000 else crc << 1
    return crc & 0xFFFF


_TABLE: Final = tuple(_entry(index) for index in range(256))


def crc16(data: bytes | bytearray, crc: int = 0) -> int:
    """Return the CRC of `data`, continuing from `crc`."""
    table = _TABLE
    for byte in data:
        crc = ((crc & 0xFF) << 8) ^ table[(crc >> 8) ^ byte]
    return crc
