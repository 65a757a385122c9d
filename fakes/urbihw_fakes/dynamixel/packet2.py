"""Protocol 2.0, device side: CRC, byte stuffing, bytes of requests and answers, no I/O.

    request   FF FF FD 00  ID  LEN_L LEN_H  INST        params...  CRC_L CRC_H     LEN = params + 3
    status    FF FF FD 00  ID  LEN_L LEN_H  55    ERR   params...  CRC_L CRC_H     LEN = params + 4

Source: ROBOTIS e-manual, protocol 2.0.
"""

from __future__ import annotations

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
FACTORY_RESET = 0x06
REBOOT = 0x08
CLEAR = 0x10
STATUS = 0x55
SYNC_READ = 0x82
SYNC_WRITE = 0x83
FAST_SYNC_READ = 0x8A
BULK_READ = 0x92
BULK_WRITE = 0x93
FAST_BULK_READ = 0x9A

ERR_RESULT = 1
ERR_INSTRUCTION = 2
ERR_CRC = 3
ERR_RANGE = 4
ERR_LENGTH = 5
ERR_LIMIT = 6
ERR_ACCESS = 7
ALERT = 0x80

HEADER = b"\xff\xff\xfd\x00"
MAX_PAUSE = 0.0015  # seconds between two bytes after which a unit forgets the packet

_PATTERN = b"\xff\xff\xfd"


def _crc_row(byte: int) -> int:
    value = byte << 8
    for _ in range(8):
        value = (value << 1) ^ (0x8005 if value & 0x8000 else 0)
    return value & 0xFFFF


_CRC_TABLE = tuple(_crc_row(byte) for byte in range(256))


def crc(data: bytes, start: int = 0) -> int:
    """CRC-16 with polynomial 0x8005, nothing reflected or inverted; `start` goes on from an earlier result."""
    value = start
    table = _CRC_TABLE
    for byte in data:
        value = ((value << 8) & 0xFF00) ^ table[(value >> 8) ^ byte]
    return value


def stuff(body: bytes) -> bytes:
    """Put an FD behind every FF FF FD, so that no header shows up inside a packet."""
    return body.replace(_PATTERN, b"\xff\xff\xfd\xfd") if _PATTERN in body else body


def unstuff(body: bytes) -> bytes:
    """Take away the FD behind every FF FF FD."""
    return body.replace(b"\xff\xff\xfd\xfd", _PATTERN) if _PATTERN in body else body


def status(unit: int, error: int, params: bytes = b"") -> bytes:
    """A whole status packet, stuffed."""
    body = stuff(bytes((STATUS, error)) + params)
    head = HEADER + bytes((unit,)) + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc(head).to_bytes(2, "little")


def fast_head(blocks: list[int]) -> bytes:
    """Start of the joint answer to a fast group read, for blocks of these many data bytes each; never stuffed."""
    length = 1 + sum(size + 4 for size in blocks)
    return HEADER + b"\xfe" + length.to_bytes(2, "little") + bytes((STATUS,))


def fast_block(before: bytes, unit: int, error: int, data: bytes) -> bytes:
    """One unit's part of the joint answer; its CRC covers everything on the wire `before` it as well."""
    block = bytes((error, unit)) + data
    return block + crc(before + block).to_bytes(2, "little")
