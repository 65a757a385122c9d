"""Packets of Dynamixel, protocols 1.0 and 2.0, and of Feetech: values to bytes and bytes to values, no I/O, no time.

Protocol 1.0::

    instruction  FF FF ID LEN INST params.. CHK            LEN = params + 2, CHK = inverted low byte of the sum
    status       FF FF ID LEN ERR  params.. CHK

Protocol 2.0::

    instruction  FF FF FD 00 ID LEN_L LEN_H INST   params.. CRC_L CRC_H     LEN = stuffed params + 3
    status       FF FF FD 00 ID LEN_L LEN_H 55 ERR params.. CRC_L CRC_H     LEN = stuffed params + 4

From INST to the last parameter each FF FF FD is followed by one more FD ("stuffing"), so that a header cannot appear
inside; the CRC is over the stuffed bytes. Only the joint answers of the fast reads are not stuffed. Since FF FF FD
cannot overlap itself and the inserted FD cannot begin a new one, plain replacing is exact in both directions.

Feetech has the packets of 1.0, and the SYNC READ of 2.0 in them, with one-byte addresses and sizes.

Sources: https://emanual.robotis.com/docs/en/dxl/protocol1/ and /protocol2/.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Final, Protocol

from urbihw.buses.errors import BadValue
from urbihw.buses.servos.crc import crc16
from urbihw.buses.servos.status import FEETECH, Status

BROADCAST: Final = 0xFE
MAX_ID: Final = {1: 253, 2: 252, FEETECH: 253}
HEADER_1: Final = b"\xff\xff"
HEADER_2: Final = b"\xff\xff\xfd\x00"
# Bytes of a status packet around its parameters.
OVERHEAD: Final = {1: 6, 2: 11, FEETECH: 6}
# Maximum parameters of an answer: the range of LEN in protocol 1.0; no control table is longer in 2.0.
MAX_ANSWER: Final = {1: 253, 2: 2048, FEETECH: 253}
# The AX-12 holds an instruction packet in a buffer of 143 bytes (AX-12 user's manual, "Sync Write").
MAX_PACKET_1: Final = 143
_MAX_PACKET_2 = 65535 + 7
_STATUS = 0x55


class Instruction(IntEnum):
    """Instruction codes; a code exists in the protocols that `*_packet` below accept it for."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A


def encode_1(device: int, instruction: int, params: bytes = b"") -> bytes:
    """Return a protocol 1.0 instruction packet. Raises BadValue for an impossible id or too many parameters."""
    if not 0 <= device <= BROADCAST:
        raise BadValue(f"protocol 1.0 ids are 0..253, or 254 for all, not {device}")
    if len(params) + 6 > MAX_PACKET_1:
        raise BadValue(f"a protocol 1.0 packet holds at most {MAX_PACKET_1} bytes, not {len(params) + 6}")
    body = bytes((device, len(params) + 2, instruction)) + params
    return HEADER_1 + body + bytes((~sum(body) & 0xFF,))


def encode_2(device: int, instruction: int, params: bytes = b"") -> bytes:
    """Return a protocol 2.0 instruction packet, stuffed. Raises BadValue for an impossible id or a packet too long."""
    if not (0 <= device <= MAX_ID[2] or device == BROADCAST):
        raise BadValue(f"protocol 2.0 ids are 0..252, or 254 for all, not {device}")
    body = stuff(bytes((instruction,)) + params)
    if len(body) + 9 > _MAX_PACKET_2:
        raise BadValue(f"a protocol 2.0 packet holds at most {_MAX_PACKET_2} bytes")
    packet = HEADER_2 + bytes((device,)) + (len(body) + 2).to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


def encode(protocol: int, device: int, instruction: int, params: bytes = b"") -> bytes:
    """Return an instruction packet of protocol 1, 2 or FEETECH."""
    return encode_2(device, instruction, params) if protocol == 2 else encode_1(device, instruction, params)


def stuff(data: bytes) -> bytes:
    """Insert FD behind each FF FF FD."""
    return data.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuff(data: bytes) -> bytes:
    """Remove one FD behind each FF FF FD: the inverse of `stuff`."""
    return data.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


def _place(protocol: int, address: int, size: int | None = None) -> bytes:
    """Address, and size if given, in the width of the protocol."""
    width = 2 if protocol == 2 else 1
    fields = (address,) if size is None else (address, size)
    try:
        return b"".join(number.to_bytes(width, "little") for number in fields)
    except OverflowError as error:
        raise BadValue(f"address {address}, size {size} do not exist in protocol {protocol}.0") from error


def ping_packet(protocol: int, device: int) -> bytes:
    """PING; the answer has no parameters (1.0), or model and firmware (2.0)."""
    return encode(protocol, device, Instruction.PING)


def read_packet(protocol: int, device: int, address: int, size: int) -> bytes:
    """READ `size` bytes from `address`."""
    return encode(protocol, device, Instruction.READ, _place(protocol, address, size))


def write_packet(protocol: int, device: int, address: int, data: bytes) -> bytes:
    """WRITE `data` at `address`."""
    return encode(protocol, device, Instruction.WRITE, _place(protocol, address) + data)


def reboot_packet(device: int) -> bytes:
    """REBOOT, protocol 2.0 only."""
    return encode_2(device, Instruction.REBOOT)


def sync_write_packet(protocol: int, address: int, values: Mapping[int, bytes]) -> bytes:
    """SYNC_WRITE: the same registers of several devices, never answered; all data must have one length."""
    sizes = {len(data) for data in values.values()}
    if len(sizes) != 1:
        raise BadValue("a sync write needs data of one length for each of its devices")
    params = b"".join(bytes((device,)) + data for device, data in values.items())
    return encode(protocol, BROADCAST, Instruction.SYNC_WRITE, _place(protocol, address, sizes.pop()) + params)


def sync_read_packet(
    address: int, size: int, devices: Sequence[int], fast: bool = False, protocol: int = 2
) -> bytes:
    """SYNC READ, protocol 2.0 and FEETECH: one answer per device in list order; `fast` (2.0): one joint answer."""
    code = Instruction.FAST_SYNC_READ if fast else Instruction.SYNC_READ
    return encode(protocol, BROADCAST, code, _place(protocol, address, size) + bytes(devices))


class StatusDecoder(Protocol):
    """Decodes bytes to status packets; noise is skipped and counted, and raises nothing.

    Attributes:
        max_params: answers with a larger length are noise. Set it per request: a damaged length byte
            then cannot swallow the good packets behind it.
        noise: number of bytes skipped so far, with those of damaged packets.
    """

    max_params: int
    noise: int

    def feed(self, data: bytes) -> list[Status]:
        """Process bytes; return the packets they complete."""
        ...

    def flush(self) -> list[Status]:
        """End the input: drop an incomplete packet, and return complete ones behind its header."""
        ...


class _Scanner:
    """The part common to both decoders: a buffer, skipping, flushing."""

    protocol: int

    def __init__(self) -> None:
        self.max_params = MAX_ANSWER[self.protocol]
        self.noise = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Status]:
        self._buffer += data
        found: list[Status] = []
        while (status := self._next_status()) is not None:
            found.append(status)
        return found

    def flush(self) -> list[Status]:
        found: list[Status] = []
        while self._buffer:
            self._skip(1)
            found += self.feed(b"")
        return found

    def _skip(self, count: int) -> None:
        del self._buffer[:count]
        self.noise += count

    def _next_status(self) -> Status | None:
        raise NotImplementedError


class Decoder1(_Scanner):
    """Incremental decoder of protocol 1.0 status packets, and of those of Feetech.

    A request and an answer look alike in protocol 1.0 (a ping is, byte for byte, the answer "input voltage error"), so
    an echo cannot be recognised afterwards: on a line with echo, announce each packet with `expect_echo`.
    """

    def __init__(self, protocol: int = 1) -> None:
        self.protocol = protocol
        super().__init__()
        self._echo = b""

    def expect_echo(self, packet: bytes) -> None:
        """Drop these bytes if they are received next; a damaged echo is left as noise."""
        self._echo += packet

    def feed(self, data: bytes) -> list[Status]:
        """Process bytes; return the packets they complete."""
        if self._echo:
            data = self._drop_echo(data)
        return super().feed(data)

    def _drop_echo(self, data: bytes) -> bytes:
        # Leading noise before the echo is left to the scanner: only an exact run is an echo.
        count = min(len(data), len(self._echo))
        if data[:count] == self._echo[:count]:
            self._echo = self._echo[count:]
            return data[count:]
        self._echo = b""
        return data

    def _next_status(self) -> Status | None:
        buffer = self._buffer
        while True:
            start = buffer.find(HEADER_1)
            if start < 0:
                # A lone FF at the end may be the first half of a header.
                self._skip(len(buffer) - (1 if buffer.endswith(b"\xff") else 0))
                return None
            if start:
                self._skip(start)
            if len(buffer) < 4:
                if len(buffer) == 3 and buffer[2] == 0xFF:
                    self._skip(1)
                    continue
                return None
            size = buffer[3] + 4
            if buffer[2] > MAX_ID[1] or not 6 <= size <= self.max_params + 6 or (len(buffer) > 4 and buffer[4] & 0x80):
                self._skip(1)
                continue
            if len(buffer) < size:
                return None
            if sum(buffer[2:size]) & 0xFF != 0xFF:
                self._skip(1)
                continue
            status = Status(buffer[2], buffer[4], bytes(buffer[5 : size - 1]), self.protocol)
            del buffer[:size]
            return status


class Decoder2(_Scanner):
    """Incremental decoder of protocol 2.0 status packets; an echo is no status packet and is skipped as noise."""

    protocol = 2

    def _next_status(self) -> Status | None:
        buffer = self._buffer
        while True:
            start = buffer.find(b"\xff\xff\xfd")
            if start < 0:
                keep = 2 if buffer.endswith(b"\xff\xff") else 1 if buffer.endswith(b"\xff") else 0
                self._skip(len(buffer) - keep)
                return None
            if start:
                self._skip(start)
            if len(buffer) < 8:
                if len(buffer) > 3 and buffer[3] != 0:
                    self._skip(1)
                    continue
                return None
            length = buffer[5] | buffer[6] << 8
            # Stuffing lengthens the parameters by a third at the very most.
            plausible = 4 <= length <= self.max_params * 4 // 3 + 4
            if buffer[3] or buffer[4] > MAX_ID[2] or buffer[7] != _STATUS or not plausible:
                self._skip(1)
                continue
            size = length + 7
            if len(buffer) < size:
                return None
            packet = bytes(buffer[:size])
            if crc16(packet[:-2]) != packet[-2] | packet[-1] << 8:
                self._skip(1)
                continue
            del buffer[:size]
            body = packet[8:-2]
            if b"\xff\xff\xfd" in body:
                # Neither the 55 before the body nor the error byte can be part of FF FF FD.
                body = unstuff(body)
            return Status(packet[4], body[0], body[1:], 2)


def decoder(protocol: int) -> Decoder1 | Decoder2:
    """Return a fresh decoder for protocol 1, 2 or FEETECH."""
    return Decoder2() if protocol == 2 else Decoder1(protocol)


def split_fast(data: bytes, sizes: Sequence[int]) -> list[Status]:
    """Split a joint answer of FAST SYNC READ, as far as it is complete.

    `sizes` is the length of each device's data in order. The answer is `FF FF FD 00 FE LEN_L LEN_H 55`, then per
    device `ERR ID data CRC_L CRC_H`, each CRC over everything before it. A missing device cuts the packet: the blocks
    before the cut are returned. Leading noise is skipped; a damaged first block gives an empty list.
    """
    start = data.find(HEADER_2 + b"\xfe")
    if start < 0 or len(data) < start + 8 or data[start + 7] != _STATUS:
        return []
    position = start + 8
    crc = crc16(data[start:position])
    found = []
    for size in sizes:
        end = position + 2 + size
        if len(data) < end + 2:
            break
        crc = crc16(data[position:end], crc)
        if crc != data[end] | data[end + 1] << 8:
            break
        found.append(Status(data[position + 1], data[position], data[position + 2 : end], 2))
        crc = crc16(data[end : end + 2], crc)
        position = end + 2
    return found
