"""The survey of a servo line: every id, at every speed, in every protocol, without writing anything.

Pinging 254 ids takes 0.3 s at 1 Mbps and seconds at 9600 bps, so a speed is first tried with a broadcast ping:

- Protocol 1.0 (Dynamixel, Feetech): all answer at once. What arrives is damaged if there are several, but it shows that
  somebody is there, and then all ids are pinged. The AX-12 manual promises that answer; the SCS servos of Feetech are
  not known to give it, so at their factory speeds all ids are pinged in any case.
- Protocol 2.0: the answers come in order of the ids, each in a slot of up to 3 ms (the time that the maker's own SDK
  allows), 0.8 s in all. At 1 Mbps and above it is faster to ping each id.

`thorough` pings every id at every speed. Only pings and reads are sent. Sources: AX-12 user's manual, PING; e-manual,
protocol 2.0, PING; DynamixelSDK, `protocol2_packet_handler`, broadcastPing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Final

from urbihw.buses.errors import BadFrame, BadUrl, BusTimeout, DeviceRefused
from urbihw.buses.link import Link
from urbihw.buses.servos import packet
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.plan import read_blocks
from urbihw.buses.servos.scan import scan
from urbihw.frozen import frozen

BAUDS: Final = (
    1_000_000, 57_600, 115_200, 500_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 400_000, 250_000, 200_000,
    128_000, 76_800, 38_400, 19_200, 9_600,
)  # fmt: skip
"""The speeds that servos are set to, the common ones first: AX and MX, X series, Feetech."""
_BAUDS_2: Final = {9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000}
_FACTORY_BAUDS_SCS: Final = {500_000, 1_000_000}
_FASTEST_1: Final = 3_000_000
_FAST_2: Final = 1_000_000
_SLOT_2: Final = 0.003
_AFTER_SLOTS_2: Final = 0.016
_ADAPTER_DELAY: Final = 0.022  # longer than the 16 ms of an FTDI adapter that was not set to low latency
_LONGEST_LISTENING: Final = 0.5  # longer than the answers of 254 servos at 57600 bps
_RETURN_DELAY: Final = 0.001  # at most 508 us, and processing time
_STATUS_BYTES_2: Final = 14
LIVE: Final = (
    "return_delay_time", "min_voltage_limit", "max_voltage_limit", "torque_enable", "torque_limit", "hardware_error",
    "present_voltage", "present_temperature",
)  # fmt: skip
"""The registers that a survey reads beside those of the set-up, where a model has them."""

Progress = Callable[[float, str], None]
"""Called with the part that is done, 0..1, and what is being done."""


@frozen(slots=False)
class SurveyedServo:
    """A device as the survey found it.

    Attributes:
        device: its description.
        baud: the speed at which it answers, bits per second.
        values: raw values of LIVE and of its set-up items, as far as it has them and answered.
        state: the state bits of its answer to a ping: see `status.state_words`.
    """

    device: ServoDevice
    baud: int
    values: Mapping[str, int] = field(default_factory=dict)
    state: int = 0


@frozen(slots=False)
class ServoSurvey:
    """Outcome of a survey.

    Attributes:
        servos: in order of speed, as tried, and id.
        conflicts: (speed, id) pairs that more than one device answers to.
        bauds: the speeds that were tried.
        seconds: the time that it took.
    """

    servos: tuple[SurveyedServo, ...]
    conflicts: tuple[tuple[int, int], ...]
    bauds: tuple[int, ...]
    seconds: float


def survey(
    line: ServoLine,
    bauds: Sequence[int] = BAUDS,
    protocols: Sequence[int] = (1, 2),
    *,
    thorough: bool = False,
    progress: Progress = lambda part, what: None,
) -> ServoSurvey:
    """Find all devices on a line; a speed that the port does not have is left out. Raises LinkGone, Unavailable."""
    start = line.link.clock.now()
    servos: list[SurveyedServo] = []
    conflicts: list[tuple[int, int]] = []
    tried = []
    echo: bool | None = None  # of the adapter: the same at all speeds
    for index, baud in enumerate(bauds):
        try:
            link = line.set_speed(baud)
        except BadUrl:
            continue
        tried.append(baud)
        meter = _Meter(progress, index, len(bauds), baud)
        wanted = _wanted_ids(link, protocols, thorough)
        if not wanted:
            continue
        bus = ServoBus(link, "auto" if len(wanted) > 1 else 1 if 1 in wanted else 2)
        found = scan(bus, None if 1 in wanted else wanted[2], meter.tick, echo)
        echo = bus.echo
        servos += [read_live(bus, device) for device in found.devices]
        conflicts += [(baud, number) for number in found.conflicts]
    progress(1.0, "done")
    return ServoSurvey(tuple(servos), tuple(conflicts), tuple(tried), line.link.clock.now() - start)


class _Meter:
    """Progress within one speed, told by the scan between two ids."""

    def __init__(self, progress: Progress, index: int, count: int, baud: int) -> None:
        self._progress = progress
        self._index = index
        self._count = count
        self._baud = baud
        self._pings = 0
        progress(index / count, f"{baud} bps")

    def tick(self) -> bool:
        """Count a ping; never interrupts the scan."""
        self._pings += 1
        if self._pings % 16 == 0:
            part = min(self._pings / (2 * packet.BROADCAST), 1.0)
            self._progress((self._index + part) / self._count, f"{self._baud} bps")
        return False


def _wanted_ids(link: Link, protocols: Sequence[int], thorough: bool) -> dict[int, list[int] | None]:
    """Return the ids to ping at one speed (None: all), by protocol; nothing where no device answers.  Raises
    LinkGone."""
    wanted: dict[int, list[int] | None] = {}
    if 1 in protocols and (thorough or link.baud in _FACTORY_BAUDS_SCS or _anybody_1(link)):
        wanted[1] = None
    if 2 in protocols and (thorough or link.baud in _BAUDS_2):
        ids = None if thorough or link.baud >= _FAST_2 else _answers_2(link)
        if ids != []:
            wanted[2] = ids
    return wanted


def _anybody_1(link: Link) -> bool:
    """Return whether anything answers a broadcast ping of protocol 1.0; the echo of an adapter is no answer."""
    if link.baud > _FASTEST_1:
        return False
    ping = packet.ping_packet(1, packet.BROADCAST)
    data = b"".join(_listen(link, ping, (len(ping) + 6) * link.byte_time + _RETURN_DELAY + _ADAPTER_DELAY))
    return bool(data.replace(ping, b"", 1) if data.startswith(ping) else data)


def _answers_2(link: Link) -> list[int] | None:
    """Return the ids that answer a broadcast ping of protocol 2.0; None if bytes came that are no whole answer."""
    ping = packet.ping_packet(2, packet.BROADCAST)
    decoder = packet.decoder(2)
    decoder.max_params = 3
    slots = packet.MAX_ID[2] * _SLOT_2 + (len(ping) + _STATUS_BYTES_2) * link.byte_time
    data = b"".join(_listen(link, ping, slots + _AFTER_SLOTS_2))
    data = data.removeprefix(ping)
    statuses = [*decoder.feed(data), *decoder.flush()]
    return None if decoder.noise else sorted({status.device for status in statuses})


def _listen(link: Link, request: bytes, seconds: float) -> Iterator[bytes]:
    """Send a request; yield all that arrives in that time, and what follows it closely, but no endless garbage."""
    link.discard()
    link.write(request)
    deadline = link.clock.now() + seconds
    last = deadline + _LONGEST_LISTENING
    while data := link.read(1024, deadline):
        yield data
        deadline = min(max(deadline, link.clock.now() + _ADAPTER_DELAY), last)


def read_live(bus: ServoBus, device: ServoDevice) -> SurveyedServo:
    """Return a device with its live values and its state; what it does not answer is left out. Raises LinkGone."""
    values = dict(device.setup)
    table = device.table
    if table is not None:
        names = [name for name in LIVE if name in table.items]
        for block in read_blocks(table, names, device.protocol):
            try:
                values.update(block.unpack(bus.read(device.id, block.address, block.size)))
            except (BusTimeout, BadFrame, DeviceRefused):
                continue
    try:
        state = bus.ping(device.id).state
    except (BusTimeout, BadFrame):
        state = 0
    return SurveyedServo(device, bus.link.baud, values, state)
