"""Who comes in, how much each may cost, and how connections end: real sockets, a real server and its neighbour."""

from __future__ import annotations

import contextlib
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hostile_lab import TIMEOUT_S, Client, Server, looked_after, served, until

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    yield from served(tmp_path_factory)


@pytest.fixture
def server(process: Server) -> Iterator[Server]:
    yield from looked_after(process)


# ---------------------------------------------------------------- browsers

EVIL = '*/;Global.evil = 1|;\nvar Global.evil = 1|;\n"\n;var Global.evil = 1|;\n'

PAGES = {
    "a form": f"POST / HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: {len(EVIL)}\r\n\r\n{EVIL}",
    "files": f"POST / HTTP/1.1\r\nContent-Type: multipart/form-data; boundary=b\r\n\r\n--b\r\n\r\n{EVIL}\r\n--b--\r\n",
    "an image": "GET /;var%20Global.evil=1; HTTP/1.1\r\nHost: x\r\n\r\n",
    "an url with a statement": "GET //;var\tGlobal.evil=1; HTTP/1.1\r\n\r\n",
    "http 0.9": "GET /;var\tGlobal.evil=1;\r\n",
    "a socket": f"GET / HTTP/1.1\r\nUpgrade: websocket\r\nSec-WebSocket-Key: x\r\n\r\n{EVIL}",
    "kept alive": f"HEAD / HTTP/1.1\r\nConnection: keep-alive\r\n\r\nPOST / HTTP/1.1\r\n\r\n{EVIL}",
    "a preflight": f"OPTIONS / HTTP/1.1\r\nOrigin: http://evil\r\n\r\n{EVIL}",
    "a method of its own": f"FROB /;var\tGlobal.evil=1; HTTP/1.1\r\n\r\n{EVIL}",
    "tls": f"\x16\x03\x01\x02\x00{EVIL}",
    "turn": f"\x00\x03\x00\x50{EVIL}",
}


@pytest.mark.parametrize("cut", ["at once", "body later", "byte by byte"])
@pytest.mark.parametrize("kind", PAGES)
def test_a_web_page_runs_nothing(server: Server, kind: str, cut: str) -> None:
    data = PAGES[kind].encode("latin-1")
    head = data.index(b"\r\n") + 2 if b"\r\n" in data else 2
    client = server.client()
    pieces = {"at once": [data], "body later": [data[:head], data[head:]]}.get(cut, [bytes((one,)) for one in data])
    for piece in pieces:
        client.say(piece)
        if cut == "body later":
            time.sleep(0.02)
    heard = client.rest()
    assert heard.count(b"*** urbihw: ") == 1
    assert (b"HTTP/1.1 400 Bad Request\r\n" in heard) == (kind not in ("tls", "turn"))
    assert server.neighbour.ask('Global.hasSlot("evil");') == "false"
    client.close()


def test_a_page_that_tries_again_and_again_is_one_line_in_the_log(tmp_path: Path) -> None:
    with contextlib.closing(Server(tmp_path)) as server:
        for _ in range(200):
            client = server.client()
            client.say(b"GET / HTTP/1.1\r\n\r\n")
            assert client.rest().startswith(b"HTTP/1.1 400")
            client.close()
        log = [line for line in server.log().splitlines() if "HTTP" in line]
        assert len(log) == 1 and "127.0.0.1:" in log[0]
        server.process.send_signal(signal.SIGTERM)
        server.process.wait(TIMEOUT_S)
        assert re.search(r"199 more like this in a minute: client \S+ refused: it speaks HTTP", server.log())


# ---------------------------------------------------------------- what is not read

FLOOD = b'for| (var i: 60000) echo("%s" % (i + 1000000) + "x" * 990);\n'
"""60 MB of lines, in one atomic loop."""


def test_a_flood_that_is_not_read_waits_and_a_slow_reader_gets_all_of_it(server: Server) -> None:
    before, client = server.resident(), server.client(receive=65536)
    client.say(FLOOD)
    for _ in range(50):
        began = time.monotonic()
        assert server.neighbour.ask("6 * 7;") == "42"
        assert time.monotonic() - began < 10
        assert server.resident() - before < 40
        time.sleep(0.01)
    source = random.Random(1)
    heard = bytearray()
    while b"1059999" not in heard[-1100:]:
        data = client.socket.recv(source.randrange(1, 400_000))
        assert data
        heard += data
        assert server.resident() - before < 40
    lines = heard.decode("latin-1").splitlines()
    numbers = [line.partition("*** ")[2][:7] for line in lines]
    assert numbers == [str(number + 1000000) for number in range(60000)]
    client.close()


def test_jobs_that_wait_for_a_reader_end_with_it(server: Server) -> None:
    client = server.client(receive=4096)
    client.say(b'for (var i: 50) { loop| echo("x" * 10000), };\n')
    client.socket.recv(1, socket.MSG_PEEK)  # they have begun
    time.sleep(0.3)
    client.close()


# ---------------------------------------------------------------- the end of the input


def half_close(server: Server, data: bytes) -> bytes:
    """Say something, end the sending side, and hear all."""
    client = server.client()
    client.say(data)
    client.socket.shutdown(socket.SHUT_WR)
    heard = client.rest()
    client.close()
    return b"\n".join(line.partition(b"] ")[2] for line in heard.splitlines())


@pytest.mark.parametrize(
    ("said", "heard"),
    [
        (b"1;2;3;", b"1\n2\n3"),
        (b'sleep(300ms); echo("late");', b"*** late"),
        (b'echo("a"); sleep(100ms); echo("b"); sleep(100ms); echo("c");', b"*** a\n*** b\n*** c"),
        (b'every (50ms) echo("x"), sleep(120ms); 1;', re.compile(rb"(\*\*\* x\n)+1")),
        (b"1; half", b"1"),
        (b"var x = 6| x /2;", b"3"),
        (b"12 /4;", b"3"),
        (b"at (true) {}; 1;", b"1"),
        (b"1;quit;2;", b"1"),
        (b"", b""),
        (b'lobby.write("x" * 20000000);', b""),
    ],
    ids=lambda value: value[:30].decode() if isinstance(value, bytes) else "some",
)
def test_a_client_that_has_ended_its_sending_side_is_answered(
    server: Server, said: bytes, heard: bytes | re.Pattern[bytes]
) -> None:
    answer = half_close(server, said)
    assert answer == heard if isinstance(heard, bytes) else heard.fullmatch(answer)
    assert "Traceback" not in server.log()


@pytest.mark.parametrize("how", ["closed", "reset", "killed"])
def test_a_client_that_is_gone_ends_at_once_whatever_it_runs(server: Server, how: str) -> None:
    said = b'var Global.mine = lobby|; sleep(1h); echo("never");\n'
    if how == "killed":
        program = f"import socket,time;s=socket.create_connection(('127.0.0.1',{server.port}));s.sendall({said!r});"
        process = subprocess.Popen((sys.executable, "-c", program + "time.sleep(100)"))
        server.wait('Global.hasSlot("mine");', "true")
        process.kill()
        process.wait()
    else:
        client = server.client()
        client.say(said)
        server.wait('Global.hasSlot("mine");', "true")
        if how == "reset":
            client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.close()
    until(lambda: server.neighbour.ask("mine.connected;") == "false")
    server.neighbour.say(b'Global.removeSlot("mine")|;\n')


def test_a_client_that_leaves_after_it_ended_its_sending_side_is_gone_with_its_next_line(server: Server) -> None:
    client = server.client()
    client.say(b'var Global.mine = lobby|; every (100ms) echo("x");\n')
    server.wait('Global.hasSlot("mine");', "true")
    client.socket.shutdown(socket.SHUT_WR)
    client.line()
    assert server.neighbour.ask("mine.connected;") == "true"
    client.close()
    until(lambda: server.neighbour.ask("mine.connected;") == "false")
    server.neighbour.say(b'Global.removeSlot("mine")|;\n')


# ---------------------------------------------------------------- many


def descriptors(server: Server) -> int:
    return len(list(Path(f"/proc/{server.process.pid}/fd").iterdir()))


def is_answered(server: Server) -> bool:
    """Whether one more client is let in."""
    with contextlib.closing(Client(server.port)) as client:
        return client.ask("1;") == "1"


def test_one_client_too_many_is_told_so(tmp_path: Path) -> None:
    with contextlib.closing(Server(tmp_path)) as server:
        clients = [server.client() for _ in range(255)]
        assert [client.ask("1;") for client in clients] == ["1"] * 255
        for _ in range(50):
            late = server.client()
            assert late.rest() == b"*** urbihw: too many connections (256); close one, or raise max_clients\n"
            late.close()
        assert server.neighbour.ask("6 * 7;") == "42"
        assert len(server.log().splitlines()) == 1
        clients.pop().close()
        until(lambda: is_answered(server))
        for client in clients:
            client.close()


def test_without_descriptors_accepting_pauses_and_nobody_else_notices(tmp_path: Path) -> None:
    with contextlib.closing(Server(tmp_path, descriptors=40)) as server:
        clients = [server.client() for _ in range(80)]
        until(lambda: "no connection can be accepted" in server.log())
        slowest = 0.0
        for _ in range(200):
            began = time.monotonic()
            assert server.neighbour.ask("6 * 7;") == "42"
            slowest = max(slowest, time.monotonic() - began)
            time.sleep(0.005)
        assert slowest < 10
        assert len(server.log().splitlines()) == 1
        assert server.process.poll() is None
        for client in clients[:60]:
            client.close()
        assert clients[-1].ask("40 + 2;") == "42"
        for client in clients[60:]:
            client.close()
        until(lambda: descriptors(server) < 30)
        assert resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE)[0] == 40


# ---------------------------------------------------------------- what is sent ahead


def send_ahead(client: Client, size: int) -> int:
    """Send statements for as long as they are taken, so many bytes at most; how many were."""
    client.socket.settimeout(1)
    statement, sent = b"1|;" + b" " * 1000, 0
    with contextlib.suppress(TimeoutError):
        while sent < size:
            client.socket.sendall(statement)
            sent += len(statement)
    client.socket.settimeout(TIMEOUT_S)
    return sent


def test_what_is_sent_ahead_waits_on_the_clients_side(server: Server) -> None:
    before, client = server.resident(), server.client()
    server.neighbour.say(b"var Global.goOn = false|;\n")
    client.say(b"waituntil(goOn);\n")
    sent = send_ahead(client, 60_000_000)
    assert sent < 40_000_000
    assert server.resident() - before < 40
    server.neighbour.say(b"Global.goOn = true|;\n")
    client.say(b"\n;40 + 2;\n")
    assert client.line() == "42"
    server.neighbour.say(b'Global.removeSlot("goOn")|;\n')
    client.close()


@pytest.mark.parametrize("how", ["closed", "reset"])
def test_who_is_gone_is_noticed_although_nothing_is_read_from_it(server: Server, how: str) -> None:
    client = server.client()
    client.say(b"var Global.mine = lobby|; sleep(1h);\n")
    server.wait('Global.hasLocalSlot("mine");', "true")
    # More than is read ahead, and less than would fill the window: an end behind that is known when it is read.
    send_ahead(client, 1_300_000)
    assert server.neighbour.ask("mine.connected;") == "true"
    if how == "reset":
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()
    until(lambda: server.neighbour.ask("mine.connected;") == "false")
    server.neighbour.say(b'Global.removeSlot("mine")|;\n')
