"""CAN buses by url: each interface that needs no hardware, and what goes wrong with one."""

from __future__ import annotations

import errno
import os
import select
import socket
import struct
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress

import can
import pytest

from urbihw import buses
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort, can_port
from urbihw.buses.can.slcan import SlcanText
from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import BadUrl, BusTimeout, LinkGone, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeEnd

HELLO = CanFrame(0x413, bytes.fromhex("014C004E00000000"))
GROUP, PORT = "239.74.163.2", 43197


def opened(url: str) -> CanPort:
    return can_port(buses.open(url))


class Adapter:
    """The far end of an slcan port: a terminal of which we hold the other side."""

    def __init__(self) -> None:
        self.ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path = os.ttyname(self._theirs)
        self.url = f"can://slcan{self.path}?sleep_after_open=0"

    def say(self, text: bytes) -> None:
        os.write(self.ours, text)

    def heard(self) -> bytes:
        return os.read(self.ours, 4096)

    def hears(self, wanted: bytes) -> bool:
        """Whether this comes; what was written comes in pieces, as the system likes."""
        heard = b""
        while wanted not in heard and select.select((self.ours,), (), (), 5.0)[0]:
            heard += self.heard()
        return wanted in heard

    def unplug(self) -> None:
        for descriptor in (self.ours, self._theirs):
            with suppress(OSError):
                os.close(descriptor)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    made = Adapter()
    yield made
    made.unplug()


def soon(port: CanPort) -> float:
    return port.clock.now() + 5.0


# ---------------------------------------------------------------- what they have in common


def _virtual(stack: ExitStack) -> tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]:
    far = stack.enter_context(can.Bus("a test", "virtual"))
    return "can://virtual/a test", *_bus_end(far)


def _multicast(stack: ExitStack) -> tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]:
    try:
        far = stack.enter_context(can.Bus(GROUP, "udp_multicast", port=PORT, hop_limit=0))
    except (can.CanError, OSError) as error:
        pytest.skip(f"no multicast here: {error}")
    return f"can://udp_multicast/{GROUP}?port={PORT}&hop_limit=0", *_bus_end(far)


def _bus_end(far: can.BusABC) -> tuple[Callable[[CanFrame], None], Callable[[], CanFrame]]:
    def say(frame: CanFrame) -> None:
        far.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))

    def hear() -> CanFrame:
        message = far.recv(5.0)
        assert message is not None
        return CanFrame(message.arbitration_id, bytes(message.data))

    return say, hear


def _slcan(stack: ExitStack) -> tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]:
    made = Adapter()
    stack.callback(made.unplug)
    text = SlcanText()
    waiting: list[CanFrame] = []

    def hear() -> CanFrame:
        while not waiting:
            waiting.extend(text.feed(made.heard()))
        return waiting.pop(0)

    return made.url, lambda frame: made.say(f"t{frame.id:03X}{len(frame.data)}{frame.data.hex()}\r".encode()), hear


@pytest.fixture(params=[_virtual, _multicast, _slcan], ids=["virtual", "udp_multicast", "slcan"])
def far(request: pytest.FixtureRequest) -> Iterator[tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]]:
    with ExitStack() as stack:
        yield request.param(stack)


def test_frames_pass_both_ways(far: tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]) -> None:
    url, say, hear = far
    with opened(url) as port:
        say(CanFrame(0x401, b""))
        say(HELLO)
        got: list[CanFrame] = []
        while len(got) < 2:
            got += port.receive(10, soon(port))
        assert got == [CanFrame(0x401, b""), HELLO]
        assert port.bytes_read == sum(frame.wire_bytes for frame in got)
        port.send(CanFrame(0x412, bytes(8)))
        frame = hear()
        while frame.id != 0x412:  # multicast brings its own frames back
            frame = hear()
        assert frame == CanFrame(0x412, bytes(8))
        assert port.bytes_written == frame.wire_bytes


def test_nothing_comes_until_the_deadline(far: tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]) -> None:
    with opened(far[0]) as port:
        deadline = port.clock.now() + 0.01
        assert port.receive(10, deadline) == []
        assert port.clock.now() >= deadline - 0.001
        assert port.receive(10, 0.0) == []


def test_no_more_than_asked_for_is_taken(far: tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]) -> None:
    url, say, _ = far
    with opened(url) as port:
        for number in range(5):
            say(CanFrame(number, b""))
        got = port.receive(2, soon(port))
        assert len(got) <= 2
        while len(got) < 5:
            got += port.receive(2, soon(port))
        assert [frame.id for frame in got] == [0, 1, 2, 3, 4]


def test_closing_twice_is_fine_and_use_after_it_is_an_error(
    far: tuple[str, Callable[[CanFrame], None], Callable[[], CanFrame]]
) -> None:
    port = opened(far[0])
    port.close()
    port.close()
    with pytest.raises(LinkGone, match="is closed"):
        port.send(HELLO)
    with pytest.raises(LinkGone, match="is closed"):
        port.receive(1, 0.0)
    port.open()
    port.close()


def test_a_bus_in_memory_takes_simulated_time_only() -> None:
    clock = BusSimClock(5.0)
    heard: list[bytes] = []
    end = PipeEnd(lambda data, at: heard.append(data))
    record = struct.pack("=IB3x8s", 0x401, 2, b"\x01\x02")
    with can_port(buses.open("can://pipe/x", Context(clock, {"x": end}))) as port:
        end.send(record * 2 + record[:7], 5.5)
        assert port.receive(10, 5.4) == []
        assert port.receive(10, 6.0) == [CanFrame(0x401, b"\x01\x02")] * 2
        assert clock.now() == 5.5
        end.send(record[7:], 5.6)
        assert port.receive(10, 6.0) == [CanFrame(0x401, b"\x01\x02")]
        port.send(HELLO)
        assert heard == [struct.pack("=IB3x8s", 0x413, 8, HELLO.data)]
        end.unplug()
        with pytest.raises(LinkGone, match="unplugged"):
            port.send(HELLO)
        with pytest.raises(LinkGone, match="unplugged"):
            port.receive(1, 7.0)
    with pytest.raises(Unavailable, match="unplugged"):
        buses.open("can://pipe/x", Context(clock, {"x": end}))


# ---------------------------------------------------------------- nothing that comes is trusted


def test_frames_of_other_kinds_are_left_out() -> None:
    with can.Bus("kinds", "virtual") as other, opened("can://virtual/kinds") as port:
        other.send(can.Message(arbitration_id=0x401, is_extended_id=True, data=b"1"))
        other.send(can.Message(arbitration_id=0x401, is_extended_id=False, is_remote_frame=True))
        other.send(can.Message(arbitration_id=0x401, is_extended_id=False, is_error_frame=True))
        other.send(can.Message(arbitration_id=0x401, is_extended_id=False, is_fd=True, data=bytes(12)))
        other.send(can.Message(arbitration_id=0x402, is_extended_id=False, data=b"1"))
        assert port.receive(10, soon(port)) == [CanFrame(0x402, b"1")]


def test_datagrams_that_are_no_frames_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as stack:
        url, say, _ = _multicast(stack)
        port = stack.enter_context(opened(url))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            for junk in (b"", b"hello", b"\x81\xa1x\x01", b"\xc1" * 4000, b"\x80"):
                stranger.sendto(junk, (GROUP, PORT))
        say(HELLO)
        got: list[CanFrame] = []
        while not got:
            got += port.receive(100, soon(port))
        assert got == [HELLO]
        assert port.damaged >= 4


def test_text_that_is_no_frame_is_counted(adapter: Adapter) -> None:
    with opened(adapter.url) as port:
        adapter.say(b"\r\a?\xff\xfe\rt40\rt4019\rt40128\rt9990\rtGGG0\rT000004010\rz\rt4010\r")
        got: list[CanFrame] = []
        while not got:
            got += port.receive(10, soon(port))
        assert got == [CanFrame(0x401, b"")]
        assert port.damaged == 6


def test_an_endless_line_does_not_fill_the_memory() -> None:
    text = SlcanText()
    for _ in range(1000):
        assert text.feed(b"t" * 1000) == []
    assert text.pop_damaged_count() == 1000
    assert text.feed(b"\rt4010\r") == [CanFrame(0x401, b"")]


def test_text_in_pieces() -> None:
    text = SlcanText()
    assert text.feed(b"t401") == []
    assert text.feed(b"2AB") == []
    assert text.feed(b"CD\rt4") == [CanFrame(0x401, b"\xab\xcd")]
    assert text.feed(b"010\r") == [CanFrame(0x401, b"")]


# ---------------------------------------------------------------- what goes wrong


def test_an_adapter_is_opened_for_500_kbit(adapter: Adapter) -> None:
    with opened(adapter.url):
        assert adapter.hears(b"S6\r")
    with opened(f"{adapter.url}&bitrate=250000"):
        assert adapter.hears(b"S5\r")


def test_an_unplugged_adapter_is_link_gone_and_can_be_closed(adapter: Adapter) -> None:
    with opened(adapter.url) as port:
        adapter.unplug()
        with pytest.raises(LinkGone, match="unplugged"):
            port.receive(10, soon(port))
        with pytest.raises(LinkGone, match="unplugged"):
            port.send(HELLO)


def test_an_adapter_in_use_says_so(adapter: Adapter) -> None:
    with opened(adapter.url), pytest.raises(Unavailable, match="is in use by another program"):
        opened(adapter.url)


def test_no_such_adapter() -> None:
    with pytest.raises(Unavailable, match=r"no such port: /dev/ttyNONE; is the adapter plugged in\?"):
        opened("can://slcan/dev/ttyNONE")


def test_no_permission_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(Unavailable, match="group|usermod -aG dialout"):
        opened("can://slcan/dev/ttyACM0")


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (errno.ENODEV, "sudo ip link set can7 up type can bitrate 500000"),
        (errno.EAFNOSUPPORT, "the kernel of this system has no CAN"),
        (errno.EIO, "cannot open can://socketcan/can7"),
    ],
)
def test_kernel_interfaces_say_what_to_do(monkeypatch: pytest.MonkeyPatch, number: int, message: str) -> None:
    def refuse(*_: object, **__: object) -> can.BusABC:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(Unavailable, match=message):
        opened("can://socketcan/can7")


class Stuck:
    """A bus that refuses everything with one error."""

    def __init__(self, error: Exception) -> None:
        self._error = error

    def send(self, message: can.Message) -> None:
        raise self._error

    def recv(self, timeout: float) -> can.Message | None:
        raise self._error

    def shutdown(self) -> None:
        raise self._error


@pytest.mark.parametrize(
    ("error", "kind", "message"),
    [
        (can.CanTimeoutError("late"), BusTimeout, "is it terminated"),
        (can.CanOperationError("Transmit buffer full", errno.ENOBUFS), BusTimeout, "is it terminated"),
        (can.CanOperationError("Network is down", errno.ENETDOWN), LinkGone, "ip link set can7 up"),
        (can.CanOperationError("No such device", errno.ENODEV), LinkGone, "was it unplugged"),
        (OSError(errno.EIO, "broken"), LinkGone, "was it unplugged"),
    ],
)
def test_errors_of_an_open_bus(
    monkeypatch: pytest.MonkeyPatch, error: Exception, kind: type[Exception], message: str
) -> None:
    monkeypatch.setattr(can, "Bus", lambda *_, **__: Stuck(error))
    with opened("can://socketcan/can7") as port:
        with pytest.raises(kind, match=message):
            port.send(HELLO)
        if kind is LinkGone:
            with pytest.raises(LinkGone, match=message):
                port.receive(1, 0.0)


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("can://", "names no port"),
        ("can://socketcan", "write can://INTERFACE/CHANNEL"),
        ("can://virtual/x?bitrate=fast", 'bitrate: wants a number such as 500000, not "fast"'),
        ("can://virtual/x?bitrate=0", "bitrate: wants a number such as 500000, not 0"),
        ("can://virtual/x?bitrat=500000", r"bitrat: no such parameter; did you mean bitrate\?"),
        ("can://udp_multicast/239.74.163.2?hop=0", "hop: no such parameter; there are: .*hop_limit"),
        ("can://pipe/x?fd=true", "fd: no such parameter; there is: bitrate"),
        ("can://socketcn/can0", r"socketcn: no such interface of python-can; did you mean socketcan\?"),
    ],
)
def test_urls_without_sense(url: str, message: str) -> None:
    with pytest.raises(BadUrl, match=message):
        buses.open(url)


def test_an_unknown_interface_lists_those_there_are() -> None:
    with pytest.raises(BadUrl, match="teapot: no such interface of python-can; there are: .*slcan"):
        buses.open("can://teapot/x")


def test_an_interface_whose_library_is_missing_takes_what_it_is_given() -> None:
    # What it would take is not known; that the library is missing is said when it is opened.
    assert CanPort(Url.parse("can://etas/x?colour=red"), Context()).options["colour"] == "red"


def test_what_is_no_serial_port_is_said_to_be_none() -> None:
    with pytest.raises(Unavailable, match="^/dev/null is no serial port; "):
        buses.open("can://slcan/dev/null")


def test_a_serial_port_is_no_can_bus(adapter: Adapter) -> None:
    with buses.open(adapter.path) as port, pytest.raises(BadUrl, match="is no CAN bus"):
        can_port(port)


def test_a_can_bus_cannot_be_spied_on_as_bytes() -> None:
    with pytest.raises(BadUrl, match="moves no bytes"):
        buses.open("spy://can://virtual/x")


def test_options_reach_the_interface_as_what_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, object] = {}

    def take(channel: str, interface: str, **options: object) -> Stuck:
        seen.update(options, channel=channel, interface=interface)
        return Stuck(OSError())

    monkeypatch.setattr(can, "Bus", take)
    port = CanPort(Url.parse("can://kvaser/0?bitrate=250000&single_handle=true&tseg1=0.5&driver_mode=x"), Context())
    with port:
        assert port.byte_time == 8 / 250000
    assert seen == {
        "channel": "0",
        "interface": "kvaser",
        "bitrate": 250000,
        "single_handle": True,
        "tseg1": 0.5,
        "driver_mode": "x",
        "ignore_config": True,
    }
