"""Frames of ARCOS and of the SICK laser, on the robot's side of the wire."""

from __future__ import annotations

from dataclasses import dataclass

ARCOS_LONGEST = 258
SICK_LONGEST = 900


def arcos_checksum(body: bytes) -> int:
    """Words of two bytes, high byte first, added up; an odd byte at the end is XORed in."""
    total = 0
    for place in range(0, len(body) - 1, 2):
        total = (total + (body[place] * 256 + body[place + 1])) % 65536
    return total ^ body[-1] if len(body) % 2 else total


def arcos_packet(body: bytes) -> bytes:
    """A whole packet of ARCOS around a body."""
    total = arcos_checksum(body)
    return b"\xfa\xfb" + bytes([len(body) + 2]) + body + bytes([total // 256, total % 256])


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the host: ``value`` is its integer argument, ``text`` its string argument."""

    number: int
    value: int = 0
    text: bytes = b""


def parse_command(body: bytes) -> Command | None:
    """Decode the command in a packet body; None when its argument is invalid."""
    number, rest = body[0], body[1:]
    if not rest:
        return Command(number)
    kind, data = rest[0], rest[1:]
    if kind in (0x3B, 0x1B) and len(data) >= 2:
        value = data[0] + 256 * data[1]
        return Command(number, -value if kind == 0x1B else value)
    if kind == 0x2B and data and len(data) > data[0]:
        return Command(number, text=bytes(data[1 : 1 + data[0]]))
    return None


class ArcosReader:
    """Decodes packets from a byte stream as the controller does: invalid ones are dropped silently."""

    def __init__(self) -> None:
        self._seen = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The bodies that are complete."""
        self._seen += data
        found: list[bytes] = []
        while True:
            start = self._seen.find(b"\xfa\xfb")
            if start < 0:
                self._seen = self._seen[-1:] if self._seen.endswith(b"\xfa") else b""
                return found
            self._seen = self._seen[start:]
            if len(self._seen) < 3 or len(self._seen) < self._seen[2] + 3:
                return found
            end = self._seen[2] + 3
            whole = self._seen[:end]
            if whole[2] >= 3 and whole[-2:] == arcos_packet(whole[3:-2])[-2:]:
                found.append(whole[3:-2])
                self._seen = self._seen[end:]
            else:
                self._seen = self._seen[2:]


def sick_crc(data: bytes) -> bytes:
    """The two bytes at the end of a telegram."""
    crc, previous = 0, 0
    for byte in data:
        crc = ((crc & 0x7FFF) << 1) ^ 0x8005 if crc & 0x8000 else crc << 1
        crc ^= byte + previous * 256
        previous = byte
    return bytes([crc % 256, crc // 256])


def sick_telegram(payload: bytes, address: int) -> bytes:
    """A whole telegram of the laser around a body."""
    data = bytes([2, address, len(payload) % 256, len(payload) // 256]) + payload
    return data + sick_crc(data)


class SickReader:
    """Telegrams out of a stream: (payload, whether it is whole)."""

    def __init__(self) -> None:
        self._seen = b""

    def feed(self, data: bytes) -> list[tuple[bytes, bool]]:
        """Payloads addressed to laser 0; False with those whose check sum is wrong."""
        self._seen += data
        found: list[tuple[bytes, bool]] = []
        while True:
            start = self._seen.find(b"\x02")
            self._seen = self._seen[start:] if start >= 0 else b""
            if len(self._seen) < 4:
                return found
            size = self._seen[2] + 256 * self._seen[3]
            if self._seen[1] != 0 or not 1 <= size <= SICK_LONGEST:
                self._seen = self._seen[1:]
                continue
            end = size + 6
            if len(self._seen) < end:
                return found
            good = sick_crc(self._seen[: end - 2]) == self._seen[end - 2 : end]
            found.append((self._seen[4 : end - 2], good))
            self._seen = self._seen[end:] if good else self._seen[1:]
