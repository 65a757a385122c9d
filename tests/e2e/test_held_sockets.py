"""Sockets of programs belong to the connection that opened them: real ones, on the real clock."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from faults_lab import Daemon, wait_for
from hostile_lab import CENSUS, Client, Server
from moving_robots import RIGS

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.stdlib.held_socket import MAX_SOCKETS
from urbihw.kernel.stdlib.socket_channel import MAX_UNHANDLED_SIZE

pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0
"""Seconds until an answer that does not come is given up."""


class Talk:
    """Connections to a kernel on the real clock."""

    def __init__(self) -> None:
        self._woken = threading.Event()
        self.kernel = Kernel(wake_host=self._woken.set)
        self.kernel.programs.quiet = True
        self.lobby = self.kernel.open_lobby("127.0.0.1")

    def say(self, text: str, lobby: Lobby | None = None) -> list[str]:
        """Type something and wait until all of it ran; the lines that came, without time stamps."""
        lobby = lobby or self.lobby
        lobby.feed(f'{text}\n"that was all";\n'.encode("latin-1"))
        lines: list[str] = []
        said = ""

        def heard() -> bool:
            nonlocal said
            said += lobby.output.take_bytes().decode("latin-1")
            lines[:] = [line.partition("] ")[2] for line in said.splitlines()]
            return '"that was all"' in lines

        self.until(heard)
        return lines[: lines.index('"that was all"')]

    def until(self, done: object) -> None:
        """Run until something is so."""
        assert callable(done)
        end = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < end, "it did not happen in time"
            self.kernel.run()
            self._woken.wait(0.01)
            self._woken.clear()

    def pass_time(self, seconds: float) -> None:
        """Run for some time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)


@pytest.fixture
def talk() -> Talk:
    return Talk()


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    """Somebody who listens."""
    with socket.create_server(("127.0.0.1", 0)) as made:
        made.settimeout(TIMEOUT_S)
        yield made


def dial(peer: socket.socket) -> str:
    """The statement that connects to somebody."""
    return f'connect("127.0.0.1", {peer.getsockname()[1]})'


def read_all(talk: Talk, end: socket.socket) -> bytes:
    """What comes until the other side closes."""
    end.setblocking(False)
    heard = bytearray()
    over: list[bool] = []

    def read() -> bool:
        with contextlib.suppress(BlockingIOError):
            while data := end.recv(65536):
                heard.extend(data)
            over.append(True)
        return bool(over)

    talk.until(read)
    return bytes(heard)


def test_a_socket_ends_with_the_connection_and_its_finally_clauses_speak(talk: Talk, peer: socket.socket) -> None:
    other = talk.kernel.open_lobby()
    made = (
        "var Global.s = Socket.new|; s." + dial(peer) + '; detach({ try { sleep(1h) } finally { s.write("stop") } });'
    )
    assert talk.say(made + "s.isConnected;")[-1] == "true"
    assert talk.say("at (s.disconnected?) echo(1);", other) == []
    end, _ = peer.accept()
    with end:
        talk.lobby.close()
        assert read_all(talk, end) == b"stop"
    talk.until(lambda: talk.say("s.isConnected;", other)[-1] == "false")
    assert talk.say('s.write("x");', other)[0].endswith("write: socket not connected")


def test_a_server_and_who_was_accepted_end_with_the_connection(talk: Talk) -> None:
    other = talk.kernel.open_lobby()
    talk.say('var Global.s = Server.new|; s.listen("127.0.0.1", 0);')
    address = "127.0.0.1", int(talk.say("s.port;")[0])
    with socket.create_connection(address) as end:
        talk.until(lambda: talk.say("s.sockets.size;", other) == ["1"])
        talk.lobby.close()
        assert read_all(talk, end) == b""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(address)
    assert talk.say("s.port;", other)[0].endswith("port: server not listening")
    assert talk.say("s.sockets.size;", other) == ["0"]
    assert talk.say(f's.listen("127.0.0.1", {address[1]}); s.port;', other) == [str(address[1])]


def test_what_files_of_the_start_open_stays(talk: Talk, peer: socket.socket) -> None:
    done: list[str] = []
    talk.kernel.host.run("var Global.s = Socket.new| s." + dial(peer), "start.u", done.append)
    talk.until(lambda: done == [""])
    talk.lobby.close()
    talk.pass_time(0.2)
    assert talk.say("s.isConnected;", talk.kernel.open_lobby()) == ["true"]


def test_so_many_sockets_and_no_more(talk: Talk, peer: socket.socket) -> None:
    made = f"var l = []|; for (var i : {MAX_SOCKETS}) {{ var s = Socket.new| s.{dial(peer)}| l << s }};"
    talk.say(made)
    (wrong, *_) = talk.say(f"Socket.new.{dial(peer)};")
    assert wrong.endswith(f"connect: too many sockets: this connection has {MAX_SOCKETS}; close one")
    assert talk.say(f"Socket.new.{dial(peer)};", talk.kernel.open_lobby()) == []
    talk.say("l[0].disconnect;")
    talk.until(lambda: talk.say("l[0].isConnected;") == ["false"])
    assert talk.say(f"Socket.new.{dial(peer)};") == []


def test_who_is_accepted_counts(talk: Talk) -> None:
    talk.say('var Global.s = Server.new|; s.listen("127.0.0.1", 0);')
    address = "127.0.0.1", int(talk.say("s.port;")[0])
    with contextlib.ExitStack() as stack:
        ends = [stack.enter_context(socket.create_connection(address)) for _ in range(MAX_SOCKETS)]
        talk.until(lambda: talk.say("s.sockets.size;") == [str(MAX_SOCKETS - 1)])
        assert read_all(talk, ends[-1]) == b""
        ends[0].close()
        talk.until(lambda: talk.say("s.sockets.size;") == [str(MAX_SOCKETS - 2)])
        stack.enter_context(socket.create_connection(address))
        talk.until(lambda: talk.say("s.sockets.size;") == [str(MAX_SOCKETS - 1)])


def test_attempts_that_are_given_up_count_until_they_are_over(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    go = threading.Event()
    real = socket.getaddrinfo

    def slow(*arguments: object, **more: object) -> object:
        go.wait(TIMEOUT_S)
        return real(*arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    tries = f'for ({MAX_SOCKETS}) timeout (1ms) Socket.new.connect("127.0.0.1", 9);'
    talk.say(tries)
    (wrong, *_) = talk.say('Socket.new.connect("127.0.0.1", 9);')
    assert "too many sockets" in wrong
    go.set()
    talk.until(lambda: "Connection refused" in talk.say('Socket.new.connect("127.0.0.1", 9);')[0])


def test_handlers_that_do_not_keep_up_let_the_other_side_wait(talk: Talk, peer: socket.socket) -> None:
    """What waits for handlers is bounded, not only what waits for the events."""
    talk.say(f"var n = 0|; var s = Socket.new|; at (s.received?(var d)) {{ n += d.size | sleep(1h) }}; s.{dial(peer)};")
    end, _ = peer.accept()
    with end:
        end.setblocking(False)
        sent, last = 0, time.monotonic()

        def stuck() -> bool:
            nonlocal sent, last
            try:
                sent += end.send(b"x" * 65536)
                last = time.monotonic()
            except BlockingIOError:
                pass
            return time.monotonic() - last > 0.5 and float(talk.say("n;")[0]) >= MAX_UNHANDLED_SIZE

        talk.until(stuck)
        (told,) = talk.say("n;")
        assert float(told) < MAX_UNHANDLED_SIZE + 2 * 65536
        assert sent > float(told)


def test_many_small_pieces_are_few_events(talk: Talk, peer: socket.socket) -> None:
    """Who sends bytes one by one makes no work for each of them."""
    talk.say(
        "var n = 0|; var e = 0|; var s = Socket.new|; "
        f"at (s.received?(var d)) {{ n += d.size | e += 1 | sleep(1ms) }}; s.{dial(peer)};"
    )
    end, _ = peer.accept()
    with end:
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for _ in range(5000):
            end.send(b"x")
        talk.until(lambda: talk.say("n;") == ["5000"])
    assert float(talk.say("e;")[0]) < 500


def test_sync_write_waits_until_all_is_gone(talk: Talk, peer: socket.socket) -> None:
    size = 40_000_000  # more than the operating system holds
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
    talk.say(f'var s = Socket.new|; s.{dial(peer)}; var x = "x" * {size}|; var gone = false|;')
    talk.say("detach({ s.syncWrite(x) | gone = true })|; sleep(200ms);")
    end, _ = peer.accept()
    with end:
        assert talk.say("gone;") == ["false"]
        talk.say("detach({ waituntil(gone) | s.disconnect })|;")
        assert len(read_all(talk, end)) == size
    assert talk.say("gone;") == ["true"]


def test_all_sockets_of_a_kernel_are_served_by_one_thread(talk: Talk, peer: socket.socket) -> None:
    before = threading.active_count()
    talk.say(f"var l = []|; for (var i : 40) {{ var s = Socket.new| s.{dial(peer)}| l << s }};")
    assert threading.active_count() <= before + 1


def test_a_serial_port(talk: Talk) -> None:
    end, side = os.openpty()
    try:
        made = f'var s = Socket.new|; at (s.received?(var d)) echo(d); s.connectSerial("{os.ttyname(side)}", 9600);'
        assert talk.say(made) == []
        os.write(end, b"there")
        talk.until(lambda: "there" in talk.lobby.output.take_bytes().decode())
        talk.say('s.syncWrite("back");')
        assert os.read(end, 100) == b"back"
    finally:
        os.close(side)
        os.close(end)
    talk.until(lambda: talk.say("s.isConnected;") == ["false"])


# ---------------------------------------------------------------- clients of our own port


GROW = (
    'function Global.grow() {{ var s = Socket.new| s.connect("127.0.0.1", {port})| s.write("Global.grow();\\n") }}|;'
    " for| (100) {{ try {{ grow() }} catch {{}} }};"
)
"""A program whose Sockets are clients that do the same."""


def test_clients_that_a_program_makes_are_bounded_and_end_with_it(tmp_path_factory: pytest.TempPathFactory) -> None:
    server = Server(tmp_path_factory.mktemp("held"))
    try:
        before = int(server.neighbour.ask("Lobby.instances.size;"))
        maker = server.client()
        maker.say(GROW.format(port=server.port).encode())
        server.wait("Lobby.instances.size;", str(before + 1 + MAX_SOCKETS))
        assert maker.ask("grow();").endswith(
            f"connect: too many sockets: this connection has {MAX_SOCKETS}; close one"
        )
        maker.close()
        server.wait(CENSUS, server.at_rest)
        assert "Traceback" not in server.log()
    finally:
        server.close()


TURN = (
    'var s = Socket.new|; s.connect("127.0.0.1", {port}); sleep(0.3s);'
    ' s.write("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2;\n"); sleep(1h);'
)
"""A program that lets a client of its own turn a wheel, and goes on."""


@pytest.mark.parametrize("half", [False, True], ids=["closed", "only its sending side"])
def test_what_a_client_of_a_program_moves_stops_with_the_program(tmp_path: Path, half: bool) -> None:
    (rig,) = (rig for rig in RIGS if rig.name == "Bioloid, a wheel")
    end, look = rig.make()
    with end:
        end.start()
        daemon = Daemon(tmp_path, "bioloid", end.url)
        with contextlib.closing(daemon), contextlib.closing(Client(daemon.port)) as maker:
            maker.say(TURN.format(port=daemon.port).encode() + b"\n")
            wait_for(lambda: end.call(look) > 60, "the wheel to turn")
            if half:
                maker.socket.shutdown(socket.SHUT_WR)
            else:
                maker.close()
            wait_for(lambda: end.call(look) < 1, "the wheel to stop")


def test_a_client_of_a_program_is_as_old_as_the_program_also_when_it_connects_anew(
    talk: Talk, peer: socket.socket
) -> None:
    scheduler = talk.kernel.scheduler

    def order_of_newcomer() -> int | None:
        connected: list[tuple[str, int]] = []
        peer.settimeout(0.0)

        def accepted() -> bool:
            with contextlib.suppress(BlockingIOError):
                end, address = peer.accept()
                connected.append(address)
                end.close()
            return bool(connected)

        talk.until(accepted)
        newcomer = talk.kernel.open_lobby("127.0.0.1")
        newcomer.find_maker(connected[0])
        return newcomer.ordered

    connect = f"{{ var s = Socket.new; s.{dial(peer)}; sleep(1h) }}"
    other = talk.kernel.open_lobby("127.0.0.1")
    talk.lobby.feed(f"sleep(0.1s); {connect};".encode())
    talk.kernel.run()
    era = scheduler.begin_era()
    assert order_of_newcomer() == era - 1
    other.feed(f"{connect};".encode())
    assert order_of_newcomer() == era
    talk.kernel.host.run(f"sleep(0.1s); {connect};", "begun.u")
    talk.kernel.run()
    scheduler.begin_era()
    assert order_of_newcomer() == era
    assert talk.kernel.open_lobby("127.0.0.1").ordered is None


AGAIN = (
    'for (var i : 100) { try { var s = Socket.new; s.connect("127.0.0.1", PORT); sleep(0.1s);'
    ' s.write("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2;\n"); sleep(0.1s); s.disconnect }'
    " catch {} };"
)
"""A program that lets clients of its own turn a wheel, one after the other."""


def test_a_socket_that_connects_to_the_server_after_a_release_moves_nothing(tmp_path: Path) -> None:
    (rig,) = (rig for rig in RIGS if rig.name == "Bioloid, a wheel")
    end, look = rig.make()
    with end:
        end.start()
        daemon = Daemon(tmp_path, "bioloid", end.url)
        with contextlib.closing(daemon), contextlib.closing(Client(daemon.port)) as maker:
            maker.say(AGAIN.replace("PORT", str(daemon.port)).encode())
            wait_for(lambda: end.call(look) > 60, "the wheel to turn")
            daemon.order(do="estop", who="test")
            wait_for(lambda: end.call(look) < 1, "the wheel to stop")
            time.sleep(0.5)
            daemon.order(do="release", who="test")
            before = daemon.log().count("want to move")
            wait_for(lambda: daemon.log().count("want to move") > before, "another try")
            time.sleep(0.5)
            assert end.call(look) < 1
