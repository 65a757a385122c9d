"""One suite for every kind of link that can be opened here, then what is particular to each."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import socket
import tempfile
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.metadata import entry_points
from pathlib import Path

import pytest
import serial

from urbihw import buses
from urbihw.buses.clock import BusRealClock, BusSimClock
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Context, Link, Url, split_parameters
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.spy import SpyLink
from urbihw_nao_fakes.tls import Identity


class Peer:
    """The other end of a link under test."""

    def __init__(self, url: str, context: Context, send: Callable[[bytes], None], take: Callable[[int], bytes]) -> None:
        self.url, self.context, self.send, self.take = url, context, send, take
        self.hang_up: Callable[[], None] = lambda: None


def _pty(stack: ExitStack) -> Peer:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    ends = [ours, theirs]
    peer = Peer(os.ttyname(theirs), Context(), lambda data: _write(ours, data), lambda size: os.read(ours, size))

    def hang_up() -> None:
        while ends:
            os.close(ends.pop())

    stack.callback(hang_up)
    peer.hang_up = hang_up
    return peer


def _tcp(stack: ExitStack) -> Peer:
    server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
    accepted: list[socket.socket] = []

    def peer_socket() -> socket.socket:
        if not accepted:
            accepted.append(stack.enter_context(server.accept()[0]))
        return accepted[0]

    peer = Peer(
        f"socket://127.0.0.1:{server.getsockname()[1]}",
        Context(),
        lambda data: peer_socket().sendall(data),
        lambda size: peer_socket().recv(size),
    )
    peer.hang_up = lambda: peer_socket().close()
    return peer


def _pipe(_: ExitStack) -> Peer:
    clock = BusSimClock()
    got = bytearray()
    end = PipeEnd(lambda data, at: got.extend(data))

    def take(size: int) -> bytes:
        data = bytes(got[:size])
        del got[:size]
        return data

    peer = Peer("pipe://test", Context(clock, {"test": end}), lambda data: end.send(data, clock.now()), take)
    peer.hang_up = end.unplug
    return peer


def _spy(stack: ExitStack) -> Peer:
    inner = _pipe(stack)
    inner.url = f"spy://{inner.url}"
    return inner


def _usb(stack: ExitStack) -> Peer:
    bus = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    listener = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    listener.bind(str(bus / "0000"))
    listener.listen()
    claimed: list[socket.socket] = []

    def accept() -> None:
        with contextlib.suppress(OSError):
            while True:
                claimed.append(stack.enter_context(listener.accept()[0]))
                claimed[-1].send(b"claimed")

    acceptor = threading.Thread(target=accept)
    acceptor.start()
    stack.callback(acceptor.join)
    stack.callback(lambda: listener.shutdown(socket.SHUT_RDWR))

    def send(data: bytes) -> None:
        for start in range(0, len(data), 64):
            claimed[-1].send(data[start : start + 64])

    url = f"usb://0694:0002?backend=urbihw_fakes.nxt.usb_backend:bus&at={bus}"
    peer = Peer(url, Context(), send, lambda size: claimed[-1].recv(size))
    peer.hang_up = lambda: claimed[-1].close()
    return peer


def _spykee(stack: ExitStack) -> Peer:
    """The link of one platform; what it adds is tested with that."""
    peer = _tcp(stack)
    peer.url = peer.url.replace("socket://", "spykee://")
    return peer


def _qi(stack: ExitStack) -> Peer:
    peer = _tcp(stack)
    peer.url = peer.url.replace("socket://", "qi://")
    return peer


def _qis(stack: ExitStack) -> Peer:
    """The same over TLS; the handshake is part of opening the link, so somebody must answer meanwhile."""
    server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
    context = Identity().context
    accepted: list[socket.socket] = []
    shaken = threading.Event()

    def accept() -> None:
        with contextlib.suppress(OSError):
            plain = stack.enter_context(server.accept()[0])
            accepted.append(stack.enter_context(context.wrap_socket(plain, server_side=True)))
            shaken.set()

    acceptor = threading.Thread(target=accept)
    acceptor.start()
    stack.callback(acceptor.join)
    stack.callback(lambda: server.shutdown(socket.SHUT_RDWR))

    def peer_socket() -> socket.socket:
        assert shaken.wait(5.0)
        return accepted[0]

    url = f"qis://127.0.0.1:{server.getsockname()[1]}"
    peer = Peer(url, Context(), lambda data: peer_socket().sendall(data), lambda size: peer_socket().recv(size))
    peer.hang_up = lambda: peer_socket().close()
    return peer


PEERS = {
    "serial": _pty, "socket": _tcp, "spykee": _spykee, "qi": _qi, "qis": _qis, "pipe": _pipe, "spy": _spy, "usb": _usb,
}  # fmt: skip


def _write(fd: int, data: bytes) -> None:
    os.write(fd, data)


@pytest.fixture(params=sorted(PEERS))
def peer(request: pytest.FixtureRequest) -> Iterator[Peer]:
    with ExitStack() as stack:
        yield PEERS[request.param](stack)


@pytest.fixture
def link(peer: Peer) -> Iterator[Link]:
    with buses.open_link(peer.url, peer.context) as opened:
        yield opened


def soon(link: Link) -> float:
    """A deadline that nothing on this machine needs to exhaust."""
    return link.clock.now() + 5.0


def test_bytes_pass_both_ways_unchanged(peer: Peer, link: Link) -> None:
    data = bytes(range(256))
    link.write(data)
    got = b""
    while len(got) < 256:
        got += peer.take(256)
    peer.send(data)
    back = b""
    while len(back) < 256:
        back += link.read(256, soon(link))
    assert (got, back) == (data, data)
    assert (link.bytes_written, link.bytes_read) == (256, 256)


def test_reading_returns_what_there_is_and_never_more_than_asked(peer: Peer, link: Link) -> None:
    peer.send(b"abcdef")
    assert link.read(1, soon(link)) == b"a"
    rest = b""
    while len(rest) < 5:
        rest += link.read(100, soon(link))
    assert rest == b"bcdef"


def test_a_deadline_in_the_past_still_collects_and_returns_at_once(peer: Peer, link: Link) -> None:
    start = link.clock.now()
    assert link.read(10, start - 1.0) == b""
    assert link.clock.now() - start < 1.0
    peer.send(b"x")
    assert link.read(10, soon(link)) == b"x"


def test_nothing_to_read_ends_at_the_deadline(link: Link) -> None:
    deadline = link.clock.now() + 0.01
    assert link.read(10, deadline) == b""
    assert link.clock.now() >= deadline


def test_discard_empties_the_input(peer: Peer, link: Link) -> None:
    peer.send(b"old")
    assert link.read(1, soon(link)) == b"o"
    assert link.discard() == 2
    assert link.read(10, link.clock.now()) == b""


def test_closing_twice_is_fine_and_use_after_it_is_an_error(peer: Peer, link: Link) -> None:
    link.close()
    link.close()
    assert not link.is_open
    with pytest.raises(LinkGone, match="is closed"):
        link.write(b"x")
    with pytest.raises(LinkGone, match="is closed"):
        link.read(1, 0.0)


def test_opening_again_works(peer: Peer) -> None:
    one_connection = peer.url.startswith(("socket", "spykee", "qi"))
    for _ in range(1 if one_connection else 2):
        with buses.open_link(peer.url, peer.context) as opened:
            opened.write(b"x")
            assert peer.take(1) == b"x"


def test_a_vanished_peer_is_link_gone(peer: Peer, link: Link) -> None:
    link.write(b"x")
    assert peer.take(1) == b"x"
    peer.hang_up()
    with pytest.raises(LinkGone, match="unplugged"):
        for _ in range(3):
            link.read(1, soon(link))


def test_every_row_is_covered() -> None:
    # A CAN bus moves frames, not bytes: `test_can_port` is about it; libqi has a session: `test_qi_contract`.
    assert {*PEERS, "can", "libqi", "libqis", "mujoco", "ipc", "tcp", "webots"} == {
        *buses.BUSES, *(row.name for row in entry_points(group=buses.ENTRY_POINTS)),
    }  # fmt: skip


def test_urls() -> None:
    plain = Url.parse("/dev/ttyUSB0?baud=57600")
    assert (plain.scheme, plain.target, dict(plain.options)) == ("serial", "/dev/ttyUSB0", {"baud": "57600"})
    assert Url.parse("serial:///dev/ttyUSB0").target == "/dev/ttyUSB0"
    with pytest.raises(BadUrl, match="one spy:// is enough"):
        Url.parse("spy://spy:///dev/ttyUSB0")
    spied = Url.parse("spy:///dev/ttyUSB0?baud=57600")
    assert (spied.target, dict(spied.options)) == ("/dev/ttyUSB0?baud=57600", {})


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("", "names no port"),
        ("socket://", "names no port"),
        ("teapot://x", "unknown kind 'teapot'; known: .*serial, "),
        ("/dev/null?baud=fast", 'baud: wants a number such as 57600 or 1000000, not "fast"'),
        ("/dev/null?baud=0", "baud: wants a number such as 57600 or 1000000, not 0"),
        ("/dev/null?boud=1", r"bus url '/dev/null\?boud=1': boud: no such parameter; did you mean baud\?"),
        ("spy:///dev/null?boud=1", r"boud: no such parameter; did you mean baud\?"),
        ("socket://localhost:1?serial=1", "serial: no such parameter; there is: baud"),
        ("/dev/null?baud", "key=value"),
        ("/dev/null\nfake = true", r"bus url '/dev/null\\nfake = true' contains unprintable characters"),
        ("socket://localhost", "write socket://host:port"),
        ("socket://localhost:99999", "write socket://host:port"),
    ],
)
def test_bad_urls_say_how_to_write_them(url: str, message: str) -> None:
    with pytest.raises(BadUrl, match=message):
        buses.open(url)


def test_the_speed_of_a_wire() -> None:
    assert buses.port_for("/dev/ttyUSB0?baud=57600", Context()).baud == 57_600
    assert buses.port_for("/dev/ttyUSB0", Context()).baud == 1_000_000


@pytest.mark.parametrize(
    ("url", "port", "own"),
    [
        ("/dev/a?baud=9600&laser=/dev/b?baud=500000", "/dev/a?baud=9600", {"laser": "/dev/b?baud=500000"}),
        ("spy:///dev/a?laser=sim", "spy:///dev/a", {"laser": "sim"}),
        ("/dev/a?baud=9600", "/dev/a?baud=9600", {}),
        ("/dev/a", "/dev/a", {}),
    ],
)
def test_what_is_meant_for_the_robot_is_taken_off_the_url(url: str, port: str, own: dict[str, str]) -> None:
    assert split_parameters(url, {"laser"}) == (port, own)


@pytest.mark.parametrize("kind", ["/dev/null", "/dev", "{file}", "{fifo}"])
def test_what_is_no_serial_port_is_said_to_be_none(kind: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "fifo")
    path = kind.format(file=tmp_path / "file", fifo=tmp_path / "fifo")
    with pytest.raises(Unavailable, match=rf"^{path} is no serial port( but a \w+)?; .*urbihw doctor"):
        buses.open(path)


def test_no_such_port() -> None:
    with pytest.raises(Unavailable, match=r"no such port: /dev/ttyUSB77; is the adapter plugged in\?"):
        buses.open("/dev/ttyUSB77")


def test_a_port_without_permission_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port /dev/ttyUSB0: Permission denied")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(Unavailable, match="group dialout"):
        buses.open("/dev/ttyUSB0")


def test_a_port_in_use_says_so() -> None:
    with ExitStack() as stack:
        peer = _pty(stack)
        with buses.open(peer.url), pytest.raises(Unavailable, match="is in use by another program"):
            buses.open(peer.url)


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(Unavailable, match=f"cannot connect to 127.0.0.1:{port}"):
        buses.open(f"socket://127.0.0.1:{port}")


def test_no_such_pipe() -> None:
    with pytest.raises(Unavailable, match="no such pipe: nowhere; known: none"):
        buses.open("pipe://nowhere")


def test_spy_prints_hex_and_times() -> None:
    output = io.StringIO()
    clock = BusSimClock(5.0)
    end = PipeEnd()
    spy = SpyLink(Url.parse("spy://pipe://x?baud=1000"), Context(clock, {"x": end}), output)
    with spy:
        spy.write(b"\xff\x01")
        end.send(b"\xfe", clock.now() + 0.5)
        spy.read(1, clock.now() + 1.0)
    assert spy.baud == 1000
    assert output.getvalue() == "0.000000  > FF 01\n0.500000  < FE\n"


def test_pipe_takes_wire_time() -> None:
    arrived: list[float] = []
    clock = BusSimClock()
    end = PipeEnd(lambda data, at: arrived.append(at))
    with buses.open_link("pipe://x?baud=1000", Context(clock, {"x": end})) as link:
        link.write(b"ab")
        link.write(b"c")
    assert arrived == pytest.approx([0.02, 0.03])


def test_real_clock_does_not_sleep_into_the_past() -> None:
    clock = BusRealClock()
    start = clock.now()
    clock.sleep_until(start - 1.0)
    clock.sleep_until(start + 0.002)
    assert 0.0018 < clock.now() - start < 1.0


class Babbler(Link):
    """Sends without end."""

    def _open(self) -> None: ...

    def _close(self) -> None: ...

    def _read(self, size: int, deadline: float) -> bytes:
        return bytes(size)

    def _write(self, data: bytes) -> None: ...


def test_what_babbles_without_end_is_discarded_in_part() -> None:
    with Babbler(Url.parse("pipe://babbler"), Context(BusSimClock())) as link:
        assert link.discard() == 65536
