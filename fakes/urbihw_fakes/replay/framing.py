"""Bytes of a host -> requests, for each protocol that a recording may be of.

A driver may write two requests at once that were two writes yesterday, so requests are cut by the lengths in them. The
layouts are those of the makers' manuals, as in the simulated robots of these protocols.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Framing:
    """The way to tell packets of a protocol apart.

    `size` says how many bytes the packet at the head of the buffer has: 0 when more must come first, -1 when a byte
    belongs to no packet. `kind` is what two requests have in common that differ only in the values they write. `unit`
    is who sends an answer, None if it does not tell; `units` are those that may answer a request.
    """

    size: Callable[[bytes], int]
    kind: Callable[[bytes], bytes]
    unit: Callable[[bytes], int | None] = lambda answer: None
    units: Callable[[bytes], Iterable[int]] = lambda request: ()


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


_ASKING: Final = {0x01, 0x82, 0x8A, 0x92, 0x9A}
"""Instructions to all that are answered: ping, sync read and fast sync read, bulk read and fast bulk read."""


def _dynamixel_unit(packet: bytes) -> int:
    return packet[4] if packet[2:4] == b"\xfd\x00" else packet[2]


def _dynamixel_units(request: bytes) -> Iterable[int]:
    """The one of the request; all for a ping or a read of a group, which answers one after the other."""
    unit = _dynamixel_unit(request)
    if unit != 0xFE:
        return (unit,)
    instruction = request[7] if request[2:4] == b"\xfd\x00" else request[4]
    return range(0xFF) if instruction in _ASKING else ()


def _arcos_size(buffer: bytes) -> int:
    """`FA FB count ...`."""
    if not b"\xfa\xfb".startswith(buffer[:2]):
        return -1
    return 3 + buffer[2] if len(buffer) >= 3 and 3 + buffer[2] <= len(buffer) else 0


def _head(length: int) -> Callable[[bytes], bytes]:
    return lambda request: request[:length]


WHOLE: Final = Framing(_whole, _head(3))
"""Each write is a request: transports that keep telegrams apart, and protocols that are not known here."""
SERVOS: Final = Framing(_dynamixel_size, _dynamixel_kind, _dynamixel_unit, _dynamixel_units)
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
