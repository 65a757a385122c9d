"""The back end by the makers' packages: what their faults would do to the wire, and that a stop is not late.

The contract of the wire is tested over both back ends where it stands: `test_bus`, `test_cycle`, `test_stop`,
`test_feetech`.
"""

from __future__ import annotations

import itertools
import random
import sys
from collections.abc import Callable

import pytest
import scservo_sdk  # type: ignore[import-untyped]

from urbihw import buses
from urbihw.buses import messages as m
from urbihw.buses.clock import SimClock
from urbihw.buses.errors import BadFrame, BusTimeout, LinkGone
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos import packet, plan
from urbihw.buses.servos.backend_sdk import SdkBus, split_packets
from urbihw.buses.servos.crc import crc16
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.scan import scan
from urbihw.buses.servos.status import FEETECH
from urbihw.buses.servos.tables import table_for
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.device import Answer
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

from .conftest import Rig
from .test_worker import Bench, of

READ_1 = bytes.fromhex("FFFF 06 04 02 2402 CD")


class Wire:
    """A bus over a wire whose other end says what a test tells it to."""

    def __init__(self, protocol: int = 1) -> None:
        self.clock = SimClock(100.0)
        self.end = PipeEnd(self._receive)
        self.link = buses.open_link("pipe://robot?baud=1000000", Context(self.clock, {"robot": self.end}))
        self.bus = SdkBus(self.link, 2 if protocol == 2 else 1)
        self.sent: list[bytes] = []
        self.answer: Callable[[float], None] = lambda at: None

    def _receive(self, data: bytes, at: float) -> None:
        self.sent.append(data)
        self.answer(at)

    def answers(self, data: bytes) -> None:
        """Answer each packet by these bytes from now on."""
        self.answer = lambda at: self.end.send(data, at + len(data) * 1e-5)


def status_1(device: int, data: bytes) -> bytes:
    """A status packet of protocol 1.0."""
    body = bytes((device, len(data) + 2, 0)) + data
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


def status_2(device: int, data: bytes) -> bytes:
    """A status packet of protocol 2.0: after each FF FF FD of the body follows one more FD."""
    body = (b"\x55\x00" + data).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    head = b"\xff\xff\xfd\x00" + bytes((device,)) + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc16(head).to_bytes(2, "little")


# Faults of dynamixel-sdk.


def test_what_looks_like_a_header_is_sent_stuffed() -> None:
    wire = Wire(2)
    wire.bus.write(1, 116, b"\xff\xff\xfd\x00", answered=False)
    # From the sheet of the protocol: write of FF FF FD 00 to register 116.
    assert wire.sent == [bytes.fromhex("FFFFFD00 01 0A00 03 7400 FFFFFDFD00 21E7")]


def test_stuffing_of_an_answer_is_removed() -> None:
    wire = Wire(2)
    # From the same sheet: a status whose data is FF FF FD FF.
    wire.answers(bytes.fromhex("FFFFFD00 01 0900 55 00 FFFFFDFDFF DA9E"))
    assert wire.bus.read(1, 132, 4) == b"\xff\xff\xfd\xff"


@pytest.mark.parametrize("goal", [0, 0xFDFFFF])
def test_goals_of_more_servos_than_a_packet_of_the_package_holds_are_sent(goal: int) -> None:
    wire = Wire(2)
    runs = plan.write_runs(table_for(1060, 2), ("goal_position",))
    rows = [(number, {"goal_position": goal}) for number in range(253)]
    packets = plan.sync_writes(2, [(runs, rows)])
    wire.bus.send(b"".join(packets))
    assert wire.sent == packets and len(packets) == 2 and all(len(each) <= 1024 for each in packets)


def test_no_payload_is_changed_by_stuffing() -> None:
    wire = Wire(2)
    for size in (4, 5, 6):
        for data in map(bytes, itertools.product((0xFF, 0xFD, 0x00, 0x01), repeat=size)):
            if b"\xff\xff\xfd" in data:
                wire.answers(status_2(1, data))
                assert wire.bus.read(1, 132, size, retries=0) == data


def test_an_exception_in_a_transaction_does_not_block_the_next(rig: Rig) -> None:
    bus = SdkBus(rig.link)
    assert bus.read(6, 3, 1) == b"\x06"
    rig.end.unplug()
    with pytest.raises(LinkGone):
        bus.read(6, 3, 1)
    rig.end.replug()
    assert bus.read(6, 3, 1) == b"\x06"


def test_a_silent_servo_takes_nothing_of_a_group_from_the_others(x_rig: Rig) -> None:
    bus = SdkBus(x_rig.link, 2)
    cycle = Cycle(bus, scan(bus).devices, 0.01)
    for number in cycle.members:
        cycle.watch(number, ("present_position",), 0.0, x_rig.clock.now())
    x_rig.kit.faults.start("silence", 3)
    for _ in range(5):
        assert set(cycle.tick(x_rig.clock.now()).values) == set(cycle.members) - {3}
        x_rig.clock.sleep_until(x_rig.clock.now() + 0.01)


# Faults of feetech-servo-sdk.


def test_old_data_of_a_group_is_never_taken_as_new(make_rig: Callable[[FeetechBus], Rig]) -> None:
    rig = make_rig(FeetechBus([FeetechServo("STS3215", number) for number in (1, 2, 3)]))
    bus = SdkBus(rig.link, "auto")
    cycle = Cycle(bus, scan(bus).devices, 0.01)
    for number in cycle.members:
        cycle.watch(number, ("present_position",), 0.0, rig.clock.now())
    assert set(cycle.tick(rig.clock.now()).values) == {1, 2, 3}
    for number in (2, 3):
        rig.kit.faults.start("silence", number)
    rig.clock.sleep_until(rig.clock.now() + 0.01)
    assert set(cycle.tick(rig.clock.now()).values) == {1}


def test_a_late_answer_to_a_group_answers_no_later_question() -> None:
    wire = Wire()
    wire.bus.protocols = {1: FEETECH, 2: FEETECH}

    def late(at: float) -> None:
        wire.end.send(status_1(1, b"\x0a\x00"), at + 1e-4)
        wire.end.send(status_1(2, b"\x0b\x00"), at + 0.06)

    wire.answer = late
    request = packet.sync_read_packet(56, 2, [1, 2], protocol=FEETECH)
    assert [status.device for status in wire.bus.ask_group(request, [(1, 2), (2, 2)])] == [1]
    wire.clock.sleep_until(wire.clock.now() + 0.1)
    wire.answers(status_1(2, b"\x16\x00"))
    assert wire.bus.read(2, 60, 2) == b"\x16\x00"


@pytest.mark.parametrize("order", [0, 1])
def test_the_byte_order_of_the_package_changes_nothing(make_rig: Callable[[FeetechBus], Rig], order: int) -> None:
    rig = make_rig(FeetechBus([FeetechServo("STS3215", 1, position=2500), FeetechServo("SCS0009", 2, position=300)]))
    bus = SdkBus(rig.link, "auto")
    cycle = Cycle(bus, scan(bus).devices, 0.01)
    for number in cycle.members:
        cycle.watch(number, ("present_position",), 0.0, rig.clock.now())
    scservo_sdk.PacketHandler(order)
    try:
        values = cycle.tick(rig.clock.now()).values
    finally:
        scservo_sdk.PacketHandler(0)
    assert values == {1: {"present_position": 2500}, 2: {"present_position": 300}}


# Lines that are not as they should be.


@pytest.mark.parametrize("protocol", [1, 2])
def test_noise_ends_in_an_error_of_ours_and_the_next_answer_is_read(protocol: int) -> None:
    wire = Wire(protocol)
    chance = random.Random(15)
    alphabet = b"\xff\xff\xff\xfd\xfd\x00\x01\x02\x04\x55\x06\xfa"
    for _ in range(300):
        wire.answers(bytes(chance.choices(alphabet, k=chance.randrange(1, 40))))
        begin = wire.clock.now()
        try:
            assert len(wire.bus.read(1, 36, 8, retries=0)) == 8
        except (BusTimeout, BadFrame) as error:
            assert "device 1" in str(error)
        assert wire.clock.now() - begin < 0.1
    wire.answers(status_2(1, bytes(8)) if protocol == 2 else status_1(1, bytes(8)))
    assert wire.bus.read(1, 36, 8, retries=0) == bytes(8)


@pytest.mark.parametrize("protocol", [1, 2])
def test_a_line_that_never_falls_silent_ends_at_the_time_out(protocol: int) -> None:
    wire = Wire(protocol)
    begin = wire.clock.now()
    for number in range(20_000):
        wire.end.send(b"\xff\x00", begin + number * 2e-5)
    with pytest.raises(BadFrame, match="device 1"):
        wire.bus.read(1, 36, 8, retries=0)
    assert wire.clock.now() - begin < 0.05


# Packages that are not there.


def _hide(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    for name in names:
        monkeypatch.setitem(sys.modules, name, None)


def test_a_missing_package_is_told_in_one_line(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    _hide(monkeypatch, "dynamixel_sdk", "scservo_sdk")
    bench = Bench(rig, m.Configure(dead_man=0, options={"backend": "sdk"}))
    (state,) = of(m.LinkState, bench.run(0.1))
    assert not state.up
    assert state.reason.startswith(
        'pipe://robot?baud=1000000: backend = "sdk" needs the Python package dynamixel-sdk for these servos: '
    )
    assert "\n" not in state.reason
    bench.close()


def test_feetech_servos_need_the_package_of_feetech_only(
    make_rig: Callable[[FeetechBus], Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    _hide(monkeypatch, "dynamixel_sdk")
    rig = make_rig(FeetechBus([FeetechServo("STS3215", 1)]))
    assert [device.name for device in scan(SdkBus(rig.link, "auto")).devices] == ["STS3215"]


def test_the_package_of_feetech_is_named_for_its_servos(
    make_rig: Callable[[FeetechBus], Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    _hide(monkeypatch, "scservo_sdk")
    rig = make_rig(FeetechBus([FeetechServo("STS3215", 1)]))
    with pytest.raises(LinkGone, match="needs the Python package feetech-servo-sdk"):
        scan(SdkBus(rig.link, "auto"))


# Stops.


class Stopping(Bioloid):
    """A kit that calls `on_read` when servo 3 is asked, and notes when a sync write comes after that."""

    def __init__(self) -> None:
        super().__init__(baud=1_000_000)
        self.on_read: Callable[[], None] | None = None
        self.asked_at = self.stopped_at = 0.0

    def feed(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes of the host."""
        if self.on_read is not None and data.startswith(b"\xff\xff\x03\x04\x02"):
            call, self.on_read = self.on_read, None
            self.asked_at = now
            call()
        if self.asked_at and not self.stopped_at and b"\xff\xff\xfe" in data:
            self.stopped_at = now
        return super().feed(data, now)


@pytest.mark.parametrize("backend", ["own", "sdk"])
@pytest.mark.parametrize("silent", [(), (3,), (3, 4, 5, 7, 8)])
def test_a_stop_comes_between_two_transactions(
    make_rig: Callable[[Bioloid], Rig], silent: tuple[int, ...], backend: str
) -> None:
    kit = Stopping()
    rig = make_rig(kit)
    bench = Bench(rig, m.Configure(dead_man=0, options={"backend": backend}))
    bench.run(0.6)
    bench.tell(*(m.Watch(number, ("present_position", "present_speed")) for number in range(1, 19)))
    bench.run(0.3)
    bench.tell(m.Targets({(6, "goal_position"): 1000, (6, "moving_speed"): 100}))
    bench.run(0.3)
    for number in silent:
        kit.faults.start("silence", number)
    kit.on_read = lambda: bench.tell(m.Stop(epoch=1, reason="test"))
    bench.run(0.2)
    place = kit.servo(6).position
    # One transaction at the most: its wire time, and where the servo is silent, the learnt time-out and its repetition.
    assert 0 < kit.stopped_at - kit.asked_at < (0.010 if silent else 0.002)
    bench.run(1.0)
    kit.tick(rig.clock.now())
    assert kit.servo(6).position == pytest.approx(place, abs=2)
    assert 520 < place < 900
    bench.close()


def test_runs_of_packets_are_split_at_their_lengths() -> None:
    run = [READ_1, packet.write_packet(2, 2, 116, b"\xff\xff\xfd\x00"), packet.ping_packet(1, 253)]
    assert list(split_packets(b"".join(run))) == run
