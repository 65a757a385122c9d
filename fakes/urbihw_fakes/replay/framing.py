"""Bytes of a host -> requests, for each protocol that a recording may be of.

A driver may write two requests at once that were two writes yesterday, so requests are cut by the lengths in them. The
layouts are those of the makers' manuals, as in the simulated robots of these protocols.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Framing:
    """The way to tell requests of a protocol apart.

    `size` says how many bytes the request at the head of the buffer has: 0 when more must come first, -1 when a byte
    belongs to no request. `kind` is what two requests have in common that differ only in the values they write.
    """

    size: Callable[[bytes], int]
    kind: Callable[[bytes], bytes]


def _whole(buffer: bytes) -> int:
    return len(buffer)


def _dynamixel_size(buffer: bytes) -> int:
    """`FF FF id length ...`, or `FF FF FD 00 id length length ...`."""
    if not b"\xff\xff".startswith(buffer[:2]):
        return -1
    if len(buffer) < 4:
        return 0
    if buffer[2:4] == b"\xfd\x00":
        size = 7 + int.from_bytes(buffer[5:7], "little") if len(buffer) >= 7 else 0
    elif buffer[2] == 0xFF or buffer[3] < 2:
        return -1
    else:
        size = 4 + buffer[3]
    return size if 0 < size <= len(buffer) else 0


def _dynamixel_kind(request: bytes) -> bytes:
    """Unit, instruction, address, and for a read the number of bytes."""
    is_second = request[2:4] == b"\xfd\x00"
    body = request[7:-2] if is_second else request[4:-1]
    unit, address = request[4:5] if is_second else request[2:3], 3 if is_second else 2
    return unit + (body if body[:1] == b"\x02" else body[:address])


def _arcos_size(buffer: bytes) -> int:
    """`FA FB count ...`."""
    if not b"\xfa\xfb".startswith(buffer[:2]):
        return -1
    return 3 + buffer[2] if len(buffer) >= 3 and 3 + buffer[2] <= len(buffer) else 0


def _head(length: int) -> Callable[[bytes], bytes]:
    return lambda request: request[:length]


WHOLE: Final = Framing(_whole, _head(3))
"""Each write is a request: transports that keep telegrams apart, and protocols that are not known here."""
SERVOS: Final = Framing(_dynamixel_size, _dynamixel_kind)
FRAMINGS: Final[Mapping[str, Framing]] = {
    "bioloid": SERVOS,
    "chain": SERVOS,
    "so101": SERVOS,
    "p3dx": Framing(_arcos_size, lambda request: request[3:5]),
}
"""Platform -> framing; the others have `WHOLE`."""


def framing_of(platform: str) -> Framing:
    """Return the framing of a platform."""
    return FRAMINGS.get(platform, WHOLE)
