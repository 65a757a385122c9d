"""Transactions on one half-duplex Dynamixel wire: one request, its answers, no retry. `bus` adds retries.

Theory. The wire is half duplex: a request, its answers, the next request. A time-out is the wire time of the answer
plus the allowance of `ResponseTimeoutEstimator`. After a time-out the answer may still arrive (a slow adapter); the
channel expects it, updates the estimator with its delay, and accepts it as the answer to a later request only if sender
and size match: these are the same registers, slightly older, provided that a device that missed is not asked at once
for other registers of that size. The cycle ensures this. An answer that is exactly the expected one is recognised with
a few slices; everything else (noise, echo, the answer of another device, stuffing) goes through the decoder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from urbihw.buses.errors import BadFrame, BusTimeout
from urbihw.buses.link import Link
from urbihw.buses.servos import packet
from urbihw.buses.servos.answers import GroupAnswer, exact_answer, is_answer_of
from urbihw.buses.servos.response_timeout import ResponseTimeoutEstimator
from urbihw.buses.servos.status import Status

ProtocolChoice = Literal[1, 2, "auto"]
# One question: request, device, bytes of data in its answer.
Single = tuple[bytes, int, int]
Meanwhile = Callable[[], None]
# Seconds to wake up before the end of a long answer: time to decode the first part, and margin for a late wake-up.
_WAKE_BEFORE = 0.0005
# A Linux terminal holds 4096 bytes for a reader that sleeps; stay well below.
_SYSTEM_BUFFER = 2000


@dataclass(slots=True)
class ServoCounters:
    """Failed transactions since the bus was opened, by reason."""

    timeouts: int = 0
    damaged: int = 0
    refused: int = 0
    retried: int = 0


class TransactionChannel:
    """Requests and answers over an open link.

    `send`, `ask`, `ask_each`, `ask_group` and `ask_joint` are all that is asked of it: the tests replace these five by
    the makers' packages.

    Attributes:
        link: the wire; the channel does not close it.
        protocol: the present protocol; with "auto" it is 1 until a scan has found devices.
        protocols: device -> protocol, where both are spoken on one wire; `protocol` is that of all others.
        auto: the scan determines the protocol.
        echo: the adapter returns our own bytes; determined by the scan.
        patience: the learnt time-out.
        counters: failures so far.
    """

    def __init__(self, link: Link, protocol: ProtocolChoice = 1) -> None:
        self.link = link
        self.clock = link.clock
        self.auto = protocol == "auto"
        self.protocol: int = 1 if protocol == "auto" else protocol
        self.protocols: dict[int, int] = {}
        self.echo = False
        self.response_timeout = ResponseTimeoutEstimator()
        self.counters = ServoCounters()
        self._wire_free_at = 0.0
        self._overdue: tuple[int, float] | None = None

    def protocol_of(self, device: int) -> int:
        """Return the protocol of a device."""
        return self.protocols.get(device, self.protocol)

    def send(self, data: bytes) -> None:
        """Send one or more packets without an answer. Raises LinkGone."""
        if self._overdue is not None:
            self._collect_overdue()
        now = self.clock.now()
        self.link.write(data)
        self._wire_free_at = max(now, self._wire_free_at) + len(data) * self.link.byte_time
        if self.echo:
            self._discard_echo(len(data))

    def ask(
        self,
        request: bytes,
        device: int,
        size: int,
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
        brief: bool = False,
    ) -> Status:
        """Send `request` and return the answer of `device` with `size` bytes of data.

        `prefix` holds packets without an answer that are sent in the same write, before the request; `meanwhile` is
        called while they are on the wire. `brief`: wait for `ResponseTimeoutEstimator.brief_allowance` only.
        Raises BusTimeout, BadFrame, LinkGone. A refusal is returned, not raised: see `Status.refusal`.
        """
        wire_end = self._dispatch(prefix + request)
        if meanwhile is not None:
            meanwhile()
        allowance = self.response_timeout.brief_allowance if brief else self.response_timeout.allowance
        status, data = self._read_exact_answer(device, size, wire_end, allowance)
        return status or self._decode_until_answer(prefix + request, device, size, data, wire_end, allowance)

    def ask_each(
        self,
        questions: Sequence[Single],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
        urgent: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[int, Status | BusTimeout | BadFrame]]:
        """Ask one device after the other; yield (index, answer or error) in order.

        When an answer is yielded the next question is already on the wire, so the caller may process it without delay
        of the wire. After an error nothing is on the wire and the caller may ask again; further questions to that
        device are left out. `prefix`, `meanwhile`: as `ask`. `urgent` is called before each question but the first;
        when it returns true, the rest is left out, and nothing is on the wire. Raises LinkGone.
        """
        failed: set[int] = set()
        sent = prefix + questions[0][0]
        wire_end = self._dispatch(sent)
        if meanwhile is not None:
            meanwhile()
        for index, (_, device, size) in enumerate(questions):
            if device in failed:
                continue
            following = _next_question(questions, index, failed)
            allowance = self.response_timeout.allowance
            status, data = self._read_exact_answer(device, size, wire_end, allowance)
            if status is None:
                try:
                    status = self._decode_until_answer(sent, device, size, data, wire_end, allowance)
                except (BusTimeout, BadFrame) as error:
                    failed.add(device)
                    yield index, error
                    if urgent():
                        return
                    following = _next_question(questions, index, failed)
                    if following:
                        sent, wire_end = following, self._dispatch(following)
                    continue
            leaves = bool(following) and urgent()
            if following and not leaves:
                sent, wire_end = following, self._dispatch(following)
            yield index, status
            if leaves:
                return

    def _read_exact_answer(
        self, device: int, size: int, wire_end: float, allowance: float
    ) -> tuple[Status | None, bytes]:
        """Wait for exactly the expected answer; return it, or None and the bytes that arrived instead."""
        if self.echo:
            # A one-wire adapter: our own bytes come first.
            return None, b""
        protocol = self.protocols.get(device, self.protocol)
        expected = size + packet.OVERHEAD[protocol]
        answer_time = wire_end + expected * self.link.byte_time
        deadline = answer_time + allowance
        read = self.link.read
        data = read(expected, deadline)
        while 0 < len(data) < expected:
            more = read(expected - len(data), deadline)
            if not more:
                break
            data += more
        status = exact_answer(protocol, data, device, expected)
        if status is not None:
            self.response_timeout.add_delay(self.clock.now() - answer_time)
        return status, data

    def ask_group(
        self,
        request: bytes,
        reads: Sequence[tuple[int, int]],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
    ) -> Iterator[Status]:
        """Send a sync or bulk read; yield the answers as they arrive. `reads`: (device, size) in order.

        Devices with no answer or a damaged one are missing in the result, and counted in `counters`. The caller
        processes an answer while the next ones are still on the wire. `prefix`, `meanwhile`: as `ask`.
        """
        wire_end = self._dispatch(prefix + request)
        if meanwhile is not None:
            meanwhile()
        protocol = self.protocol_of(reads[0][0])
        overhead = packet.OVERHEAD[protocol]
        total = sum(size + overhead for _, size in reads) + (len(prefix + request) if self.echo else 0)
        longest = (max(size for _, size in reads) + overhead) * self.link.byte_time
        answer_time = wire_end + total * self.link.byte_time
        self._sleep_until_answer(total, answer_time)
        longest_data = max(size for _, size in reads)
        # With an echo in front nothing is exactly where it is expected.
        decoder = self._decoder(protocol, longest_data, prefix + request)
        group = GroupAnswer(protocol, reads, decoder, not self.echo)
        deadline = max(wire_end, self.clock.now()) + longest + self.response_timeout.allowance
        while group.missing and (data := self.link.read(max(total, overhead), deadline)):
            total -= len(data)
            yield from group.feed(data)
            # The next answer follows at once; a longer gap means that a device is missing.
            deadline = self.clock.now() + longest + self.response_timeout.allowance
        if not group.missing:
            self.response_timeout.add_delay(self.clock.now() - answer_time)
            return
        yield from group.flush()
        if group.missing:
            self._count_failures(len(group.missing), group.noise)

    def _sleep_until_answer(self, total: int, answer_time: float) -> None:
        """Sleep while a long answer arrives, instead of waking up for each part of it.

        The system buffers the bytes meanwhile; missing ones are noticed at the end.
        """
        wake = answer_time - _WAKE_BEFORE
        if total < _SYSTEM_BUFFER and wake > self.clock.now():
            self.clock.sleep_until(wake)

    def ask_joint(
        self,
        request: bytes,
        reads: Sequence[tuple[int, int]],
        prefix: bytes = b"",
        meanwhile: Meanwhile | None = None,
    ) -> list[Status]:
        """Send a FAST SYNC READ; return the parts of the joint answer that are whole. As `ask_group`."""
        wire_end = self._dispatch(prefix + request)
        if meanwhile is not None:
            meanwhile()
        size = 8 + sum(size + 4 for _, size in reads) + (len(prefix + request) if self.echo else 0)
        answer_time = wire_end + size * self.link.byte_time
        self._sleep_until_answer(size, answer_time)
        data = b""
        deadline = answer_time + self.response_timeout.allowance
        while len(data) < size and (more := self.link.read(size - len(data), deadline)):
            data += more
            # A missing device cuts the answer short: wait no longer than the remaining bytes take.
            deadline = self.clock.now() + (size - len(data)) * self.link.byte_time + self.response_timeout.allowance
        if self.echo and data.startswith(prefix + request):
            data = data[len(prefix + request) :]
        found = packet.split_fast(data, [size for _, size in reads])
        missing = len(reads) - len(found)
        if missing:
            self._count_failures(missing, len(data) - sum(size + 4 for _, size in reads[: len(found)]) - 8)
        else:
            self.response_timeout.add_delay(self.clock.now() - answer_time)
        return found

    # Inside a transaction.

    def _dispatch(self, data: bytes) -> float:
        """Send; return when the last byte will have left."""
        if self._overdue is not None:
            self._collect_overdue()
        now = self.clock.now()
        self.link.write(data)
        start = now if now > self._wire_free_at else self._wire_free_at
        self._wire_free_at = end = start + len(data) * self.link.byte_time
        return end

    def _decode_until_answer(
        self, sent: bytes, device: int, size: int, data: bytes, wire_end: float, allowance: float
    ) -> Status:
        """Decode all bytes until `device` has answered or the time-out."""
        protocol = self.protocol_of(device)
        overhead = packet.OVERHEAD[protocol]
        decoder = self._decoder(protocol, size, sent)
        answer_time = wire_end + (size + overhead) * self.link.byte_time
        deadline = answer_time + allowance
        while True:
            for status in decoder.feed(data):
                if is_answer_of(status, device, size):
                    self.response_timeout.add_delay(self.clock.now() - answer_time)
                    return status
                self._record_late_answer(status.device)
            data = self.link.read(size + overhead + len(sent), deadline)
            if not data:
                break
        for status in decoder.flush():
            if is_answer_of(status, device, size):
                return status
        self._overdue = (device, answer_time)
        # The echo of our own bytes does not count as a damaged answer.
        noise = decoder.noise - (len(sent) if self.echo and protocol == 2 else 0)
        raise self._missing_answer(device, noise)

    def _decoder(self, protocol: int, max_params: int, sent: bytes) -> packet.StatusDecoder:
        """Return a decoder for the answers to `sent`, whose echo it drops if there is one."""
        decoder = packet.decoder(protocol)
        decoder.max_params = max(max_params, 1)
        if self.echo and isinstance(decoder, packet.Decoder1):
            decoder.expect_echo(sent)
        return decoder

    def _missing_answer(self, device: int, noise: int) -> BadFrame | BusTimeout:
        """Count a missing answer and return the error to raise: damaged if there was noise."""
        self._count_failures(1, noise)
        if noise > 0:
            return BadFrame(f"the answer of device {device} on {self.link.url.text} came damaged")
        return BusTimeout(f"device {device} on {self.link.url.text} does not answer; is it powered and plugged in?")

    def _count_failures(self, missing: int, noise: int) -> None:
        if noise > 0:
            self.counters.damaged += missing
        else:
            self.counters.timeouts += missing

    def _collect_overdue(self) -> None:
        """Read the bytes that arrived after a time-out: a late answer among them updates the estimator."""
        data = b""
        while more := self.link.read(1024, self.clock.now()):
            data += more
        if data and self._overdue is not None:
            for status in packet.decoder(self.protocol_of(self._overdue[0])).feed(data):
                self._record_late_answer(status.device)

    def _record_late_answer(self, device: int) -> None:
        if self._overdue is not None and self._overdue[0] == device:
            self.response_timeout.add_delay(self.clock.now() - self._overdue[1])
            self._overdue = None

    def _discard_echo(self, size: int) -> None:
        deadline = self._wire_free_at + self.response_timeout.allowance
        while size > 0 and (data := self.link.read(size, deadline)):
            size -= len(data)


def _next_question(questions: Sequence[Single], index: int, failed: set[int]) -> bytes:
    """Return the next request after `index` to a device that has not failed, b"" for none."""
    for position in range(index + 1, len(questions)):
        if questions[position][1] not in failed:
            return questions[position][0]
    return b""
