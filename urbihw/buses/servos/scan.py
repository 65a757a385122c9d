"""The scan of a bus: all 254 ids in less than half a second.

Waiting a full time-out for each silent id would take seconds. But an answer carries its sender's id, so it may arrive
later: each id gets a short slot, long enough for the servo itself (0.5 ms factory return delay), and an answer that an
adapter delivers later is assigned by its id. One long wait at the end collects the rest, and one more ping: answers
come in order, so behind the second answer of a device nothing is on its way any more.

The answers of two devices with the same id collide, or follow each other when their return delays differ. Both leave
traces (noise, two answers); an id with traces is pinged again, and is a conflict if that happens most of the time. An
answer that is only late, on a busy computer, leaves traces too: it is cut in two by a time-out, or comes on the next
ping. So no more answers than pings are no crowd, and a device that cannot be read at once is read again, a little
later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Final

from urbihw.buses.errors import BadFrame, BusError, BusTimeout, DeviceRefused
from urbihw.buses.servos import packet
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice, ServoScan
from urbihw.buses.servos.plan import read_blocks
from urbihw.buses.servos.status import FEETECH, Status
from urbihw.buses.servos.tables import table_of

# Return delay of at most 508 us, processing time, and some jitter of the adapter.  With the ping and its answer it is
# at least as long as a frame of slow USB (1 ms) at up to 2 Mbps, so that two pings never leave in one frame.
_SLOT: Final = 0.0009
_LONGEST_LAST_WAIT: Final = 0.3  # behind answers that came later than that
_LAST_WAIT: Final = 0.025  # longer than the 16 ms of an FTDI adapter that was not set to low latency
_CONFLICT_PINGS: Final = 3
_READ_AGAIN: Final = 3
"""Attempts to read a device that answers pings."""
_HEAD_1: Final = 6
"""Bytes from address 0 that tell the maker and the model, where a ping tells neither."""


class ScanInterrupted(BusError):
    """The scan was interrupted by a stop."""


def scan(
    bus: ServoBus, ids: Iterable[int] | None = None, urgent: Callable[[], bool] = lambda: False,
    echo: bool | None = None,
) -> ServoScan:
    """Find the devices on `bus`, all ids or the given ones.  `echo`: whether the adapter echoes, if that is known.

    With protocol "auto" both are tried, 1.0 first; the first with an answer becomes the protocol of the bus, and
    `bus.protocols` has that of each device. An id that answers in both is a conflict. Nothing is written to any
    device. Raises LinkGone, and ScanInterrupted when `urgent`, called between two ids.
    """
    wanted = None if ids is None else sorted(set(ids))
    bus.echo = _detect_echo(bus) if echo is None else echo
    found: dict[int, ServoDevice] = {}
    conflicts: set[int] = set()
    spoken = []
    bus.protocols = {}
    for protocol in (1, 2) if bus.auto else (bus.protocol,):
        bus.protocol = protocol
        asked = range(packet.MAX_ID[protocol] + 1) if wanted is None else wanted
        known = found.keys() if wanted is not None else set()
        possible = [device for device in asked if device <= packet.MAX_ID[protocol] and device not in known]
        heard, doubtful = _Sweep(bus, urgent).run(possible)
        if wanted is not None and heard:
            # Ids from the settings that did not answer are pinged a second time.
            again, more = _Sweep(bus, urgent).run([device for device in possible if device not in heard])
            heard, doubtful = {**heard, **again}, doubtful | more
        twice = heard.keys() & found.keys()
        conflicts |= twice
        new = {device: status for device, status in heard.items() if device not in twice}
        outcome = _confirm(bus, new, doubtful - twice)
        conflicts.update(outcome.conflicts)
        if new or doubtful:
            spoken.append(protocol)
        for device in outcome.devices:
            if device.id not in found:
                found[device.id] = device
                bus.protocols[device.id] = device.protocol
    if bus.auto:
        bus.protocol = spoken[0] if spoken else 1
    return ServoScan(tuple(found[number] for number in sorted(found.keys() - conflicts)), tuple(sorted(conflicts)))


def _detect_echo(bus: ServoBus) -> bool:
    """Return whether the adapter echoes: send a request without an answer (READ to all), and read it back."""
    bus.echo = False
    bus.link.discard()
    question = packet.read_packet(bus.protocol, packet.BROADCAST, 0, 1)
    bus.send(question)
    heard = b""
    deadline = bus.clock.now() + len(question) * bus.link.byte_time + _LAST_WAIT
    while question not in heard and (data := bus.link.read(64, deadline)):
        heard += data
    return question in heard


class _Sweep:
    """One ping per id; answers are assigned by the sender's id."""

    def __init__(self, bus: ServoBus, urgent: Callable[[], bool]) -> None:
        self._bus = bus
        self._urgent = urgent
        self._decoder = packet.decoder(bus.protocol)
        self._decoder.max_params = 3
        self._sent: dict[int, float] = {}
        self._heard: dict[int, Status] = {}
        self._last_wait = _LAST_WAIT
        self._doubtful: set[int] = set()
        self._last = -1
        """The device that is asked once more, until it has answered; else -1."""

    def run(self, ids: Iterable[int]) -> tuple[dict[int, Status], set[int]]:
        """Return the first answer of each id, and the ids that left traces of trouble."""
        bus = self._bus
        wait = packet.OVERHEAD[bus.protocol] * bus.link.byte_time + _SLOT
        for device in ids:
            if self._urgent():
                # A late answer to a ping must not collide with the next packet.
                self._listen(-1, bus.clock.now() + _LAST_WAIT)
                raise ScanInterrupted("the scan gave way to a stop; ask for it again")
            noise = self._decoder.noise
            ping = packet.ping_packet(bus.protocol, device)
            now = bus.clock.now()
            echoed = self._send(ping)
            self._sent[device] = now + len(ping) * bus.link.byte_time
            self._listen(device, self._sent[device] + wait)
            self._doubt_if_noisy(noise + echoed, now)
        noise, now = self._decoder.noise, bus.clock.now()
        self._listen(-1, now + self._last_wait)
        if self._heard:
            noise += self._collect()
        self._doubt_if_noisy(noise, now)
        return self._heard, self._doubtful

    def _send(self, ping: bytes) -> int:
        """Send a ping; return how many bytes of noise its echo is: in protocol 2.0 it is noise to the decoder."""
        self._bus.link.write(ping)
        if isinstance(self._decoder, packet.Decoder1) and self._bus.echo:
            self._decoder.expect_echo(ping)
        return len(ping) if self._bus.echo and self._bus.protocol == 2 else 0

    def _collect(self) -> int:
        """Listen until a device that was heard has answered once more: then all others have, too.  Returns as
        `_send`."""
        bus, self._last = self._bus, next(iter(self._heard))
        echoed = self._send(packet.ping_packet(bus.protocol, self._last))
        self._listen(-1, bus.clock.now() + _LONGEST_LAST_WAIT)
        return echoed

    def _doubt_if_noisy(self, before: int, since: float) -> None:
        """Doubt the ids that may have caused noise since a time: it comes as late as any other answer may."""
        if self._decoder.noise > before:
            late = since - self._last_wait
            self._doubtful.update(device for device, sent in self._sent.items() if sent > late)

    def _listen(self, device: int, until: float) -> None:
        """Assign answers until `device` has answered or time `until`."""
        bus = self._bus
        answered = False
        while not answered and (data := bus.link.read(256, until)):
            for status in self._decoder.feed(data):
                if status.device not in self._sent:
                    continue
                if status.device == self._last:
                    self._last, answered = -1, True
                    continue
                if status.device in self._heard:
                    self._doubtful.add(status.device)
                    continue
                self._heard[status.device] = status
                answered = answered or status.device == device
                wire = packet.OVERHEAD[bus.protocol] + len(status.params)
                delay = bus.clock.now() - self._sent[status.device] - wire * bus.link.byte_time
                bus.response_timeout.add_delay(delay)
                # Who was held up once, a busy computer or a slow adapter, may be held up as long again.
                self._last_wait = min(max(self._last_wait, 2 * delay), _LONGEST_LAST_WAIT)


def _confirm(bus: ServoBus, heard: dict[int, Status], doubtful: set[int]) -> ServoScan:
    devices: dict[int, ServoDevice] = {}
    crowds = {number: _crowd_at(bus, number) for number in sorted(doubtful)}
    conflicts = [number for number, crowd in crowds.items() if crowd == "many"]
    unread = sorted({*heard, *(number for number, crowd in crowds.items() if crowd == "one")} - {*conflicts})
    damaged: set[int] = set()
    for attempt in range(_READ_AGAIN):
        if attempt and unread:
            # They answered a moment ago: whatever holds up their answers, or those of all, may be over soon.
            bus.discard_until(bus.clock.now() + _LONGEST_LAST_WAIT)
        for number in unread:
            damaged.discard(number)
            try:
                devices[number] = identify(bus, number, None if attempt else heard.get(number))
            except BusTimeout:
                pass
            except BadFrame:
                damaged.add(number)
        unread = [number for number in unread if number not in devices or not devices[number].model]
    conflicts += [number for number in sorted(damaged) if _crowd_at(bus, number) == "many"]
    for number in unread:
        devices.setdefault(number, ServoDevice(number, 0, 0, bus.protocol_of(number), {"status_return_level": 0}))
    found = (devices[number] for number in sorted(devices) if number not in conflicts)
    return ServoScan(tuple(found), tuple(sorted(conflicts)))


def _crowd_at(bus: ServoBus, device: int) -> str:
    """Ping a doubtful id a few times and decode all answers: "none", "one", or "many" devices; many answer more often
    than they are asked, or with noise."""
    ping = packet.ping_packet(bus.protocol, device)
    bus.discard_until(bus.clock.now() + bus.response_timeout.allowance)
    # One decoder for all pings: an answer that a time-out has cut in two is whole, and no noise.
    decoder = packet.decoder(bus.protocol)
    decoder.max_params = 3
    noisy = answers = 0
    for number in range(_CONFLICT_PINGS):
        noise = decoder.noise
        bus.send(ping)
        deadline = bus.clock.now() + (len(ping) + 2 * 14) * bus.link.byte_time + bus.response_timeout.allowance
        while data := bus.link.read(64, deadline):
            answers += sum(status.device == device for status in decoder.feed(data))
        if number == _CONFLICT_PINGS - 1:
            answers += sum(status.device == device for status in decoder.flush())
        noisy += decoder.noise > noise
    if 2 * (noisy + max(0, answers - _CONFLICT_PINGS)) > _CONFLICT_PINGS:
        return "many"
    return "one" if answers else "none"  # Noise alone is no device: a wire may have it at any id.


def identify(bus: ServoBus, number: int, pong: Status | None = None) -> ServoDevice:
    """Return the description of a device; `pong` is its answer to a ping if there was one.

    A device that answers nothing but pings (status return level 0) gets model 0.
    Raises BusTimeout, BadFrame, LinkGone.
    """
    protocol = bus.protocol_of(number)
    if pong is None or (protocol == 2 and len(pong.params) != 3):
        pong = bus.ping(number)
    try:
        about = pong.params if protocol == 2 else bus.read(number, 0, _HEAD_1)
    except (BusTimeout, DeviceRefused):
        return ServoDevice(number, 0, 0, protocol, {"status_return_level": 0})
    if protocol != 2:
        protocol = bus.protocols[number] = _maker_of(number, about)
    if protocol == FEETECH:
        model = int.from_bytes(about[3:5], "big" if about[2] else "little")
        firmware = about[0] * 100 + about[1]
    else:
        model, firmware = about[0] | about[1] << 8, about[2]
    found = ServoDevice(number, model, firmware, protocol)
    return replace(found, setup=_setup(bus, found))


def _maker_of(number: int, about: bytes) -> int:
    """Return the protocol of a device that answers the packets of 1.0, from its registers 0 to 5.

    Dynamixel: model, model, firmware, ID, baud rate, delay. Feetech: firmware, firmware, byte order (0 or 1), model,
    model, ID. Where the ID is at both places by chance, the model number that has a table decides.
    """
    if about[5] != number or about[2] > 1:
        return 1
    if about[3] != number:
        return FEETECH
    table = table_of(int.from_bytes(about[3:5], "big" if about[2] else "little"))
    return FEETECH if table is not None and table.protocol == FEETECH else 1


def _setup(bus: ServoBus, device: ServoDevice) -> dict[str, int]:
    number, table = device.id, device.table
    values: dict[str, int] = {}
    if table is not None:
        for block in read_blocks(table, table.setup_items, bus.protocol_of(number)):
            try:
                values.update(block.unpack(bus.read(number, block.address, block.size)))
            except (BusTimeout, DeviceRefused):
                continue
    return values
