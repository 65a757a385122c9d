"""Protocol 1.0, device side: bytes of requests and answers, no I/O.

    request   FF FF  ID  LEN  INST  params...  CHK        LEN = params + 2
    status    FF FF  ID  LEN  ERR   params...  CHK        CHK = inverted low byte of the sum from ID on

Source: ROBOTIS e-manual, protocol 1.0.
"""

from __future__ import annotations

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
RESET = 0x06
SYNC_WRITE = 0x83
BULK_READ = 0x92

ERR_VOLTAGE = 0x01
ERR_ANGLE = 0x02
ERR_HEAT = 0x04
ERR_RANGE = 0x08
ERR_CHECKSUM = 0x10
ERR_OVERLOAD = 0x20
ERR_INSTRUCTION = 0x40

MAX_PAUSE = 0.1  # seconds between two bytes after which a unit forgets the packet


def checksum(body: bytes) -> int:
    """Checksum of everything between the header and the checksum itself."""
    return ~sum(body) & 0xFF


def status(unit: int, error: int, params: bytes = b"") -> bytes:
    """A whole status packet."""
    body = bytes((unit, len(params) + 2, error)) + params
    return b"\xff\xff" + body + bytes((checksum(body),))
