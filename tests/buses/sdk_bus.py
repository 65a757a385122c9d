"""Transactions through the makers' packages, as witnesses of our own: dynamixel-sdk and feetech-servo-sdk.

Their packet handlers make the packets, send them, and receive and check the answers. `SdkBus` replaces the transactions
of `TransactionChannel`; retries, refusals, and all that is built on them (`cycle`, `stop`, the requests of `driver`) is
the same over both. The pings of `scan` are ours in both: the packages show neither the noise nor the double
answers that tell that two servos have one id.

The packages have faults (dynamixel-sdk 4.1, feetech-servo-sdk 1.0, both read and tried), which this module contains:
  - They poll without a pause, measure on the wall clock, and open files only: `_Port` waits on our link instead, with
    the learnt time-out. A line that never falls silent ends at that time-out, too.
  - Feetech's `clearPort` discards no input: `_Port.clearPort` does, before each transaction.
  - An exception leaves a port "in use" for ever: the flag is reset before each transaction.
  - Group reads end at the first missing servo, drop the error bytes, and Feetech's keep old data as if it was new. They
    are not used: the answers to a group are received one by one, each with its sender and its error byte.
  - dynamixel-sdk sends packets unstuffed, and removes stuffing wrongly: both are replaced.
  - Its fast read checks one of the checksums only: a plain SYNC READ is sent instead.
  - feetech-servo-sdk has one byte order for the whole process. It applies to words only; here all data are bytes.
What remains: one question is on the wire at a time, so answers are decoded while the wire is idle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue, BusTimeout
from urbihw.buses.link import Link
from urbihw.buses.servos import packet
from urbihw.buses.servos.answers import is_answer_of
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.status import FEETECH, Status
from urbihw.buses.servos.transactions import Meanwhile, ProtocolChoice, Single

_SUCCESS: Final = 0
_FAILURE: Final = -1
_CHUNK: Final = 4096
_BODY_2: Final = 7
"""Bytes of a packet of protocol 2.0 before its instruction."""


class _Port:
    """A link as the port of a packet handler: the part of `PortHandler` that the handlers call.

    Attributes:
        is_using: the handlers' own flag.
        wire_end: when the last byte sent will have left.
        damaged: packets of this transaction that came damaged.
    """

    def __init__(self, link: Link, transmit: Callable[[bytes], float], clear: Callable[[], None]) -> None:
        self.is_using = False
        self.wire_end = 0.0
        self.damaged = 0
        self._link = link
        self._transmit = transmit
        self._clear = clear
        self._received = b""
        self._deadline = 0.0
        self._over = True

    def expect(self, deadline: float) -> None:
        """Set the time-out of the transaction."""
        self._deadline = deadline
        self._over = False
        self.damaged = 0

    @property
    def is_exhausted(self) -> bool:
        """Whether the time-out has passed and all that had arrived was taken."""
        return self._over and not self._received

    # Called by the packages.

    def clearPort(self) -> None:
        """Discard all input."""
        self._received = b""
        self._clear()

    def writePort(self, data: Sequence[int]) -> int:
        """Send; return the number of bytes. Raises LinkGone."""
        self.wire_end = self._transmit(bytes(data))
        return len(data)

    def readPort(self, size: int) -> bytes:
        """Return up to `size` bytes as soon as some are there, b"" at the time-out. Raises LinkGone."""
        if size <= 0:
            return b""
        if not self._received and not self._over:
            # What has arrived by then counts, even if this process was late.
            self._over = self._link.clock.now() >= self._deadline
            self._received = self._link.read(_CHUNK, self._deadline)
            self._over = self._over or not self._received
        part, self._received = self._received[:size], self._received[size:]
        return part

    def isPacketTimeout(self) -> bool:
        """Whether the time-out has passed."""
        return self._over


class _PacketHandler:
    """The packet handler of a package.

    Attributes:
        package: its name.
        protocol: that it speaks here: 1, 2 or FEETECH.
    """

    def __init__(self, package: str, protocol: int, handler: Any) -> None:
        self.package = package
        self.protocol = protocol
        self._handler = handler
        self._receive_options: tuple[bool, ...] = (False,) if protocol == 2 else ()
        """In protocol 2.0: whether the answer is the joint one of a fast read."""
        if protocol == 2:
            handler.addStuffing = _stuff_in_place
            handler.removeStuffing = lambda raw: _with_body(raw, packet.unstuff)

    def transmit(self, port: _Port, request: bytes) -> None:
        """Send a packet, whose header and checksum the package makes anew. Raises BadValue, LinkGone."""
        raw = _with_body(request, packet.unstuff) if self.protocol == 2 else list(request)
        port.is_using = False
        result = self._handler.txPacket(port, raw)
        port.is_using = False
        if result != _SUCCESS:
            raise BadValue(f"{self.package} does not send this packet of {len(request)} bytes (its result is {result})")

    def receive(self, port: _Port) -> Iterator[Status]:
        """Yield the status packets that arrive before the time-out, and count the damaged ones. Raises LinkGone."""
        while not port.is_exhausted:
            try:
                raw, result = self._handler.rxPacket(port, *self._receive_options)
            except (IndexError, TypeError, ValueError):
                # From the package: bytes that it did not expect.
                raw, result = b"?", _FAILURE
            status = _status(bytes(raw), self.protocol) if result == _SUCCESS else None
            if status is not None:
                yield status
            elif raw:
                port.damaged += 1


class SdkBus(ServoBus):
    """A bus whose transactions are those of the makers' packages; see `TransactionChannel` for their contract.

    A package is loaded with the first device that needs it. Where it is missing, the transaction raises LinkGone: the
    link is closed, and the reason told in one line.
    """

    def __init__(self, link: Link, protocol: ProtocolChoice = 1) -> None:
        super().__init__(link, protocol)
        self._port = _Port(link, self._transmit_bytes, self._discard_input)
        self._handlers: dict[int, _PacketHandler] = {}

    def send(self, data: bytes) -> None:
        """Send one or more packets without an answer. Raises LinkGone."""
        for each in split_packets(data):
            self._handler(2 if each.startswith(packet.HEADER_2) else 1).transmit(self._port, each)

    def ask(
        self,
        request: bytes,
        device: int,
        size: int,
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
        brief: bool = False,
    ) -> Status:
        handler = self._handler(self.protocol_of(device))
        allowance = self.response_timeout.brief_allowance if brief else self.response_timeout.allowance
        answer_time = self._begin(handler, prefix, request, size + packet.OVERHEAD[handler.protocol], allowance)
        if meanwhile is not None:
            meanwhile()
        for status in handler.receive(self._port):
            if is_answer_of(status, device, size):
                self.response_timeout.add_delay(self.clock.now() - answer_time)
                return status
            self._record_late_answer(status.device)
        self._overdue = (device, answer_time)
        raise self._missing_answer(device, self._port.damaged)

    def ask_each(
        self,
        questions: Sequence[Single],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
        urgent: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[int, Status | BusTimeout | BadFrame]]:
        """As `TransactionChannel.ask_each`; but the wire is idle while an answer is processed."""
        failed: set[int] = set()
        for index, (request, device, size) in enumerate(questions):
            if device in failed:
                continue
            if index and urgent():
                return
            answer: Status | BusTimeout | BadFrame
            try:
                answer = self.ask(request, device, size, prefix, meanwhile)
            except (BusTimeout, BadFrame) as error:
                failed.add(device)
                answer = error
            prefix, meanwhile = b"", None
            yield index, answer

    def ask_group(
        self,
        request: bytes,
        reads: Sequence[tuple[int, int]],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
    ) -> Iterator[Status]:
        handler = self._handler(self.protocol_of(reads[0][0]))
        missing = dict(reads)
        total = sum(size + packet.OVERHEAD[handler.protocol] for _, size in reads)
        answer_time = self._begin(handler, prefix, request, total, self.response_timeout.allowance)
        if meanwhile is not None:
            meanwhile()
        for status in handler.receive(self._port):
            if status.device in missing and is_answer_of(status, status.device, missing[status.device]):
                del missing[status.device]
                yield status
            else:
                self._record_late_answer(status.device)
            if not missing:
                self.response_timeout.add_delay(self.clock.now() - answer_time)
                return
        self._count_failures(len(missing), self._port.damaged)

    def ask_joint(
        self,
        request: bytes,
        reads: Sequence[tuple[int, int]],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
    ) -> list[Status]:
        """As `TransactionChannel.ask_joint`, by a plain SYNC READ of the same registers."""
        address = int.from_bytes(request[_BODY_2 + 1 : _BODY_2 + 3], "little")
        plain = packet.sync_read_packet(address, reads[0][1], [device for device, _ in reads])
        return list(self.ask_group(plain, reads, prefix, meanwhile))

    def _begin(self, handler: _PacketHandler, prefix: bytes, request: bytes, expected: int, allowance: float) -> float:
        """Send; return when the last of the `expected` bytes of the answer would be in without any delay."""
        self.send(prefix)
        handler.transmit(self._port, request)
        answer_time = self._port.wire_end + expected * self.link.byte_time
        self._port.expect(answer_time + allowance)
        return answer_time

    def _transmit_bytes(self, data: bytes) -> float:
        """Send, and read back the echo of a one-wire adapter; return when the last byte will have left."""
        end = self._dispatch(data)
        if self.echo:
            self._discard_echo(len(data))
        return end

    def _discard_input(self) -> None:
        if self._overdue is not None:
            self._collect_overdue()
        self.link.discard()

    def _handler(self, protocol: int) -> _PacketHandler:
        """Return the handler of a protocol."""
        handler = self._handlers.get(protocol)
        if handler is None:
            handler = self._handlers[protocol] = _load_handler(protocol)
        return handler


def _load_handler(protocol: int) -> _PacketHandler:
    """Import the package for a protocol."""
    if protocol == FEETECH:
        import scservo_sdk  # type: ignore[import-untyped]

        return _PacketHandler("feetech-servo-sdk", protocol, scservo_sdk.PacketHandler(0))
    import dynamixel_sdk  # type: ignore[import-untyped]

    return _PacketHandler("dynamixel-sdk", protocol, dynamixel_sdk.PacketHandler(float(protocol)))


def split_packets(data: bytes) -> Iterator[bytes]:
    """Yield the packets of a run of whole instruction packets."""
    start = 0
    while start < len(data):
        if data[start : start + 4] == packet.HEADER_2:
            end = start + _BODY_2 + (data[start + 5] | data[start + 6] << 8)
        else:
            end = start + 4 + data[start + 3]
        yield data[start:end]
        start = end


def _with_body(raw: Sequence[int], change: Callable[[bytes], bytes]) -> list[int]:
    """Return a packet of protocol 2.0 with its instruction and parameters changed by `change`, and its length with it.

    The checksum stays; behind it may be more in `raw`, which is left out.
    """
    end = _BODY_2 + (raw[5] | raw[6] << 8)
    body = change(bytes(raw[_BODY_2 : end - 2]))
    return [*raw[:5], *(len(body) + 2).to_bytes(2, "little"), *body, *raw[end - 2 : end]]


def _stuff_in_place(raw: list[int]) -> None:
    raw[:] = _with_body(raw, packet.stuff)


def _status(raw: bytes, protocol: int) -> Status | None:
    """Return the status of a packet that a package found whole; None if its length is impossible."""
    if protocol == 2:
        end = _BODY_2 + (raw[5] | raw[6] << 8)
        return Status(raw[4], raw[8], raw[9 : end - 2], 2) if 11 <= end <= len(raw) else None
    end = raw[3] + 4
    return Status(raw[2], raw[4], raw[5 : end - 1], protocol) if 6 <= end <= len(raw) else None
