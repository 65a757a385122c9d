"""Devices on a pty, on a TCP port, and in memory. Real transports, bounded waits, no sleeps."""

from __future__ import annotations

import os
import select
import socket
import termios
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from fake_talk import packet2

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.device import Answer, Device
from urbihw_fakes.endpoint import MemoryEndpoint, PtyEndpoint, SteppedClock, TcpEndpoint
from urbihw_fakes.errors import AdapterGone, FakeError, UnknownRequest
from urbihw_fakes.serving import Endpoint

WAIT = 5.0  # s at most for anything that must happen

PING = bytes.fromhex("FF FF 06 02 01 F6")
PONG = bytes.fromhex("FF FF 06 02 00 F7")
READ = bytes.fromhex("FF FF 01 04 02 24 08 CC")
PRESENT = bytes.fromhex("FF FF 01 0A 00 00 02 00 00 00 00 78 20 5A")


class Beacon(Device):
    """A device that says a byte every 0.1 s unasked."""

    def __init__(self) -> None:
        super().__init__()
        self._next = 0.1

    def receive(self, data: bytes, now: float) -> list[Answer]:
        return [Answer(now, data)]

    def due(self) -> float | None:
        return self._next

    def tick(self, now: float) -> list[Answer]:
        at, self._next = self._next, self._next + 0.1
        return [Answer(at, b"!")]


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[PtyEndpoint]:
    with PtyEndpoint(Bioloid(), str(tmp_path / "robot")) as endpoint:
        endpoint.start()
        yield endpoint


@pytest.fixture
def tcp() -> Iterator[TcpEndpoint]:
    with TcpEndpoint(Bioloid()) as endpoint:
        endpoint.start()
        yield endpoint


def _ask(descriptor: int, request: bytes, size: int) -> bytes:
    os.write(descriptor, request)
    answer = b""
    while len(answer) < size and select.select([descriptor], [], [], WAIT)[0]:
        answer += os.read(descriptor, size - len(answer))
    return answer


def _hangs_up(read: Callable[[], bytes]) -> bool:
    try:
        return read() == b""
    except OSError:
        return True


def _connect(endpoint: TcpEndpoint) -> socket.socket:
    return socket.create_connection(("127.0.0.1", endpoint.port), timeout=WAIT)


def test_a_pty_answers(pty: PtyEndpoint) -> None:
    assert pty.url == f"serial://{pty.path}"
    line = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    assert _ask(line, PING, 6) == PONG
    assert _ask(line, READ, 14) == PRESENT
    os.close(line)
    # The next peer finds it as before.
    line = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    assert _ask(line, PING, 6) == PONG
    os.close(line)


def test_a_pty_goes_and_comes_back_under_its_path(pty: PtyEndpoint) -> None:
    line = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    _ask(line, bytes.fromhex("FF FF 06 04 03 19 01 D8"), 6)
    pty.unplug()
    assert not os.path.lexists(pty.path)
    assert _hangs_up(lambda: os.read(line, 1))
    os.close(line)
    pty.unplug()
    pty.plug()
    pty.plug()
    line = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    assert _ask(line, PING, 6) == PONG
    # The servos had power all the while.
    assert isinstance(pty.device, Bioloid) and pty.device[6].registers.get("led") == 1
    os.close(line)


def test_a_pty_makes_a_name_and_takes_it_away() -> None:
    endpoint = PtyEndpoint(Bioloid())
    path = endpoint.path
    assert os.path.islink(path)
    endpoint.close()
    endpoint.close()
    assert not os.path.lexists(path)


def test_a_pty_does_not_replace_a_file(tmp_path: Path) -> None:
    (tmp_path / "robot").write_text("mine")
    with pytest.raises(FakeError, match="there is a file already"):
        PtyEndpoint(Bioloid(), str(tmp_path / "robot"))
    assert (tmp_path / "robot").read_text() == "mine"


def test_a_pty_can_follow_the_speed_of_its_peer(tmp_path: Path) -> None:
    kit = Bioloid()
    with PtyEndpoint(kit, str(tmp_path / "robot"), follow_baud=True) as endpoint:
        endpoint.start()
        line = os.open(endpoint.path, os.O_RDWR | os.O_NOCTTY)
        for speed, answers in ((termios.B57600, False), (termios.B1000000, True)):
            mode = termios.tcgetattr(line)
            mode[4] = mode[5] = speed
            termios.tcsetattr(line, termios.TCSANOW, mode)
            kit.log.clear()
            os.write(line, PING)
            if answers:
                assert _ask(line, b"", 6) == PONG
            else:
                # It went through the device and nothing came back.
                _until(lambda: len(kit.log) > 0)
                assert [traffic.way for traffic in kit.log] == [">"]
        os.close(line)


def test_a_pty_follows_a_speed_that_has_no_name(tmp_path: Path) -> None:
    kit = Bioloid()
    with PtyEndpoint(kit, str(tmp_path / "robot"), follow_baud=True) as endpoint:
        endpoint.start()
        for speed in (250_000, 1_000_000, 76_800):
            with serial.Serial(endpoint.path, speed) as line:
                kit.log.clear()
                line.write(PING)
                _until(lambda: len(kit.log) > 0)
            assert kit.baud == speed


def _until(condition: Callable[[], bool]) -> None:
    event = threading.Event()
    for _ in range(int(WAIT / 0.01)):
        if condition():
            return
        event.wait(0.01)
    raise AssertionError("it did not happen")


def test_tcp_answers_one_peer_after_the_other(tcp: TcpEndpoint) -> None:
    assert tcp.url == f"socket://127.0.0.1:{tcp.port}"
    for _ in range(2):
        with _connect(tcp) as peer:
            assert _ask(peer.fileno(), PING, 6) == PONG


def test_tcp_goes_and_comes_back_on_its_port(tcp: TcpEndpoint) -> None:
    with _connect(tcp) as peer:
        assert _ask(peer.fileno(), PING, 6) == PONG
        tcp.unplug()
        assert _hangs_up(lambda: peer.recv(1))
        with pytest.raises(OSError):
            _connect(tcp)
    tcp.plug()
    with _connect(tcp) as peer:
        assert _ask(peer.fileno(), PING, 6) == PONG


def test_a_group_read_comes_whole(tmp_path: Path) -> None:
    with TcpEndpoint(Bioloid.x_series(18)) as endpoint:
        endpoint.start()
        with _connect(endpoint) as peer:
            ids = " ".join(f"{unit:02X}" for unit in range(1, 19))
            answer = _ask(peer.fileno(), packet2(254, f"82 7E 00 0A 00 {ids}"), 18 * 21)
            assert [answer[at + 4] for at in range(0, 18 * 21, 21)] == list(range(1, 19))


@pytest.mark.parametrize("kind", [PtyEndpoint, TcpEndpoint])
def test_pacing_takes_at_least_the_time_of_the_wire(kind: type[PtyEndpoint] | type[TcpEndpoint]) -> None:
    now = [0.0]
    sent: list[tuple[float, bytes]] = []
    endpoint = kind(Bioloid(), pace=1_000_000, clock=lambda: now[0])
    endpoint._send = lambda data: sent.append((now[0], data))  # type: ignore[method-assign]
    endpoint._feed_device(PING, 0.0)
    # 6 bytes, 500 us of return delay, 6 bytes: 620 us.
    for microseconds in (100, 600, 619):
        now[0] = microseconds * 1e-6
        endpoint._deliver(now[0])
    assert sent == []
    assert endpoint._select_timeout(now[0]) == 0.0
    now[0] = 0.000621
    endpoint._deliver(now[0])
    assert sent == [(0.000621, PONG)]
    assert endpoint._select_timeout(now[0]) is None
    endpoint.close()


def test_spinning_needs_pacing() -> None:
    with pytest.raises(UnknownRequest, match="give pace"):
        PtyEndpoint(Bioloid(), spin=True)


def test_calls_come_back_with_result_or_error(tcp: TcpEndpoint) -> None:
    assert isinstance(tcp.device, Bioloid)
    kit = tcp.device
    assert tcp.call(lambda: kit[6].id) == 6
    with pytest.raises(LookupError):
        tcp.call(lambda: kit[66])


def test_descriptors_of_others_are_watched(tcp: TcpEndpoint) -> None:
    out, into = os.pipe()
    got: list[bytes] = []
    tcp.call(lambda: tcp.watch(out, lambda: got.append(os.read(out, 10))))
    os.write(into, b"hello")
    _until(lambda: got == [b"hello"])
    tcp.call(lambda: tcp.unwatch(out))
    os.close(into)
    os.close(out)


def test_stop_ends_serve_from_another_thread() -> None:
    endpoint: Endpoint = TcpEndpoint(Bioloid())
    thread = threading.Thread(target=endpoint.serve)
    thread.start()
    endpoint.stop()
    thread.join(WAIT)
    assert not thread.is_alive()
    endpoint.close()


def test_unasked_bytes_come_in_time() -> None:
    with TcpEndpoint(Beacon(), clock=lambda: 0.35) as endpoint:
        endpoint.start()
        with _connect(endpoint) as peer:
            # 0.1, 0.2 and 0.3 may have gone before there was anybody; an answer comes all the same.
            assert _ask(peer.fileno(), b"?", 1) in (b"?", b"!")
    memory = MemoryEndpoint(Beacon(), SteppedClock())
    assert memory.read(3, timeout=0.25) == b"!!"
    assert memory.clock.now() == pytest.approx(0.25)


def test_memory_reads_without_waiting_for_real() -> None:
    clock = SteppedClock()
    memory = MemoryEndpoint(Bioloid(), clock)
    memory.write(PING + READ)
    assert memory.read(6) == PONG
    assert memory.read(100) == PRESENT
    assert memory.read(1, timeout=3600.0) == b""
    assert clock.now() == 3600.0


def test_memory_waits_for_late_and_paced_answers() -> None:
    clock = SteppedClock()
    kit = Bioloid()
    kit.faults.start("late", 6, amount=0.2)
    memory = MemoryEndpoint(kit, clock)
    memory.write(PING)
    assert memory.read(6, timeout=0.1) == b""
    assert memory.read(6, timeout=0.2) == PONG
    assert clock.now() == pytest.approx(0.2)
    kit.faults.stop()
    memory = MemoryEndpoint(kit, clock, pace=1_000_000)
    memory.write(PING)
    assert memory.read(6, timeout=1.0) == PONG
    assert clock.now() == pytest.approx(0.2 + 620e-6)


def test_memory_unplugged() -> None:
    memory = MemoryEndpoint(Bioloid(), SteppedClock())
    memory.write(PING)
    memory.unplug()
    for action in (lambda: memory.write(PING), lambda: memory.read(1)):
        with pytest.raises(AdapterGone):
            action()
    memory.plug()
    assert memory.read(6, timeout=0.1) == b""
    memory.write(PING)
    assert memory.read(6) == PONG
