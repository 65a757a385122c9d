"""Clients that do what they should not, on the real port of a real server: their neighbour never notices."""

from __future__ import annotations

import random
import re
import time
from collections.abc import Iterator

import pytest
from hostile_lab import Server, looked_after, served

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    yield from served(tmp_path_factory)


@pytest.fixture
def server(process: Server) -> Iterator[Server]:
    yield from looked_after(process)


NOISE = {
    "every byte": bytes(range(256)) * 400,
    "random bytes": random.Random(54000).randbytes(100_000),
    "zeros": bytes(100_000),
    "telnet negotiation": b"\xff\xfb\x01\xff\xfd\x03\xff\xf4\xff\xfd\x06",
    "no text": b'"\xff\xfe\xc3\x28";',
    "half a statement": b"function f() { every (1s) {",
    "half a string": b'"' + b"x" * 100_000,
    "half a comment": b"/* " * 30_000,
    "half a binary": b"BIN 100000000;" + b"x" * 100_000,
    "open brackets": b"[" * 100_000,
    "open parentheses": b"(" * 100_000,
    "open braces": b"{" * 100_000,
    "brackets": b"[" * 50_000 + b"]" * 50_000 + b";",
    "separators": b";,|&" * 10_000,
    "a long name": b"x" * 500_000 + b";",
}


@pytest.mark.parametrize("kind", NOISE)
def test_noise_hurts_nobody_else(server: Server, kind: str) -> None:
    client = server.client()
    client.say(NOISE[kind])
    assert server.neighbour.ask("6 * 7;") == "42"
    client.close()


def test_a_telnet_client_that_negotiates_is_answered(server: Server) -> None:
    client = server.client()
    client.say(b"\xff\xfb\x01\xff\xfd\x03\r\n;")
    client.say(b'"ready";\r\n')
    while client.line() != '"ready"':
        pass
    assert client.ask("1 + 1;") == "2"
    client.close()


def test_a_string_of_a_megabyte_comes_and_goes(server: Server) -> None:
    client = server.client()
    client.say(b'"' + b"x" * 1_000_000 + b'".size;\n')
    assert client.line() == "1000000"
    assert server.neighbour.ask("6 * 7;") == "42"
    client.close()


def test_a_client_that_does_not_read_costs_little(server: Server) -> None:
    before = server.resident()
    client = server.client(receive=4096)
    client.say(b'every| (1ms) echo("x" * 100000);\n')
    end = time.monotonic() + 2
    while time.monotonic() < end:
        assert server.neighbour.ask("6 * 7;") == "42"
        assert server.resident() - before < 60
        time.sleep(0.01)
    client.close()


def test_what_others_say_to_a_client_that_does_not_read_closes_it(server: Server) -> None:
    client = server.client(receive=4096)
    client.ask("var Global.deaf = lobby | 1;")
    before = server.resident()
    server.neighbour.say(b'for| (var i: 300) deaf.echo("x" * 100000);\n')
    assert server.neighbour.ask("6 * 7;") == "42"
    assert server.resident() - before < 60
    server.wait("deaf.connected;", "false")
    assert "does not read: closed with" in server.log()
    server.neighbour.say(b'Global.removeSlot("deaf")|;\n')
    client.close()


def test_three_hundred_clients_that_leave_in_the_middle_leave_nothing(server: Server) -> None:
    for turn in range(300):
        client = server.client()
        client.say(b'every (1s) { 1 }, at (System.ndebug) {}; var t = Tag.new; { t: sleep(1h) }, "half')
        client.close()
        if turn % 50 == 0:
            assert server.neighbour.ask("6 * 7;") == "42"


def test_an_endless_loop_that_yields_is_stopped_from_another_connection(server: Server) -> None:
    client = server.client()
    client.say(b"var Global.stopMe = Tag.new|; stopMe: while (true) { 1; 2 },\n")
    server.wait('Global.hasSlot("stopMe");', "true")
    assert server.neighbour.ask("6 * 7;") == "42"
    assert server.neighbour.ask('stopMe.stop | removeSlot("stopMe") | "stopped";') == '"stopped"'
    client.close()


def test_a_program_that_never_yields_is_named_in_the_log_before_it_gets_an_error(server: Server) -> None:
    client = server.client()
    client.say(b'//#push 7 "greedy.u"\nloop| {};\n')
    assert "held the interpreter for more than 0.5 s" in client.line()
    assert re.search(r"job shell_\d+ holds the interpreter for more than 0\.5 s at greedy\.u:7", server.log())
    client.close()
