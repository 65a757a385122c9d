"""Recognition of the expected answer in received bytes; no I/O."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urbihw.buses.servos import packet
from urbihw.buses.servos.crc import crc16
from urbihw.buses.servos.status import Status


def is_answer_of(status: Status, device: int, size: int) -> bool:
    """Return whether this can be the answer of `device` with `size` bytes; a refusal has no data."""
    return status.device == device and (len(status.params) == size or (not status.params and bool(status.refusal)))


def exact_answer(protocol: int, data: bytes, device: int, expected: int) -> Status | None:
    """Return the status if `data` is exactly the answer of `device`, `expected` bytes long, not stuffed; else None."""
    if len(data) != expected:
        return None
    if protocol != 2:
        # FF FF ID LEN ERR .. CHK: the sum of all behind the header ends in FF, so the sum of all ends in FD.
        if data[0] & data[1] != 0xFF or data[2] != device or data[3] != expected - 4 or sum(data) & 0xFF != 0xFD:
            return None
        return None if data[4] & 0x80 else Status(device, data[4], data[5:-1], protocol)
    if data[:4] != packet.HEADER_2 or data[4] != device or data[7] != 0x55 or data[5] | data[6] << 8 != expected - 7:
        return None
    if b"\xff\xff\xfd" in data[8:-2] or crc16(data[:-2]) != data[-2] | data[-1] << 8:
        return None
    return Status(device, data[8], data[9:-2], 2)


class GroupAnswer:
    """Decodes the answers of a group read; `exact`: they may be expected at fixed offsets.

    Attributes:
        missing: ids of the devices that have not answered yet.
        noise: number of bytes that belong to no answer.
    """

    def __init__(
        self, protocol: int, reads: Sequence[tuple[int, int]], decoder: packet.StatusDecoder, exact: bool
    ) -> None:
        self.missing = {device for device, _ in reads}
        self._protocol = protocol
        self._overhead = packet.OVERHEAD[protocol]
        self._next = iter(reads)
        self._awaited = next(self._next, None)
        self._data = b""
        self._decoder = decoder
        self._exact = exact

    @property
    def noise(self) -> int:
        return self._decoder.noise

    def feed(self, data: bytes) -> Iterator[Status]:
        """Add bytes; yield the answers that they complete."""
        self._data += data
        while self._exact and self._awaited is not None:
            device, size = self._awaited
            length = size + self._overhead
            if len(self._data) < length:
                return
            status = exact_answer(self._protocol, self._data[:length], device, length)
            if status is None:
                # Damage, stuffing, or a missing device: use the decoder from here on.
                self._exact = False
                break
            self._data = self._data[length:]
            self._awaited = next(self._next, None)
            self.missing.discard(device)
            yield status
        if not self._exact:
            rest, self._data = self._data, b""
            yield from self._wanted(self._decoder.feed(rest))

    def flush(self) -> Iterator[Status]:
        """End of the bytes: yield the answers that can still be decoded."""
        yield from self._wanted(self._decoder.feed(self._data))
        self._data = b""
        yield from self._wanted(self._decoder.flush())

    def _wanted(self, statuses: Sequence[Status]) -> Iterator[Status]:
        for status in statuses:
            if status.device in self.missing:
                self.missing.discard(status.device)
                yield status
