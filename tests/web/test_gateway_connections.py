"""Connections that say nothing, too many of them, what is no request, wrong codes, lines of the log, floods."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import ssl
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from browser_lab import WAIT_S, Site, site

from urbihw.daemon import secrets, tls
from urbihw.daemon.secrets import WrongSecrets
from urbihw.web import connections, gateway
from urbihw.web.session import WebSession


def play(folder: Path, test: Callable[[Site], Awaitable[None]], context: ssl.SSLContext | None = None) -> None:
    async def run() -> None:
        async with site(folder, context) as made:
            await test(made)

    asyncio.run(run())


async def connect(made: Site) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    return await asyncio.open_connection("127.0.0.1", made.gateway.port)


async def end(*writers: asyncio.StreamWriter) -> None:
    for writer in writers:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


async def is_closed(reader: asyncio.StreamReader) -> bool:
    """Whether the gateway closes a connection while the test waits."""
    with contextlib.suppress(ConnectionError):
        async with asyncio.timeout(WAIT_S):
            await reader.read()
    return True


def strangers(made: Site) -> int:
    return sum(not each.is_known for each in made.connections.open)


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(WAIT_S):
        while not holds():
            await asyncio.sleep(0.01)


@pytest.mark.parametrize("said", [
    b"", b"GET / HTTP/1.1\r\nHost: 127", b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
])  # fmt: skip
def test_a_connection_without_a_whole_request_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    monkeypatch.setattr(connections, "IDLE_S", 0.3)

    async def test(made: Site) -> None:
        browser = await made.browser("view")
        reader, writer = await connect(made)
        writer.write(said)
        assert await is_closed(reader)
        await end(writer)
        assert (await browser.ask("stop"))["confirmed"], "a WebSocket has its own signs of life"

    play(tmp_path, test)


def test_many_connections_that_are_not_paired_leave_room_for_those_that_are(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        client = await made.paired("view", "bob")
        assert (await client.get(f"{made.base}/")).status == 200
        before = [each for each in made.connections.open if each.is_known]
        assert len(before) == 2
        opened = [await connect(made) for _ in range(connections.MAX_STRANGERS_OF_ADDRESS + 40)]
        assert all([await is_closed(reader) for reader, _ in opened[:40]])
        assert strangers(made) <= connections.MAX_STRANGERS_OF_ADDRESS
        assert all(each in made.connections.open for each in before)
        assert (await made.paired("view", "carl")) and (await browser.ask("stop"))["confirmed"]
        await end(*(writer for _, writer in opened))
        await until(lambda: strangers(made) == 0 or strangers(made) == 1)

    play(tmp_path, test)


def test_one_address_does_not_take_the_places_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MAX_STRANGERS", 6)
    names = iter(["10.0.0.1"] * 5 + ["10.0.0.2"] * 2 + ["10.0.0.1"] * 20)
    monkeypatch.setattr(connections, "origin_of", lambda peer: next(names))

    async def test(made: Site) -> None:
        opened = [await connect(made) for _ in range(27)]
        await until(lambda: len(made.connections.open) == 6)
        assert [each.address for each in made.connections.open].count("10.0.0.2") == 2
        await end(*(writer for _, writer in opened))

    play(tmp_path, test)


@pytest.mark.parametrize(("peer", "origin"), [
    (("192.168.1.5", 1), "192.168.1.5"), (("::ffff:192.168.1.5", 1, 0, 0), "192.168.1.5"),
    (("2001:db8::1", 1, 0, 0), "2001:db8::/64"), (("2001:db8::ffff:1", 1, 0, 0), "2001:db8::/64"),
    (("fe80::1%eth0", 1, 0, 2), "fe80::/64"), ("", ""),
])  # fmt: skip
def test_addresses_of_one_machine_count_as_one(peer: Any, origin: str) -> None:
    assert connections.origin_of(peer) == origin


@pytest.mark.parametrize("said", [
    b"nonsense\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
    b"GET / HTTP/9.9\r\nConnection: close\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost 127.0.0.1\r\n\r\n", b"GET /" + b"x" * 9000 + b" HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\nConnection: close\r\n" + b"X: 1\r\n" * 200 + b"\r\n",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: x\r\n\r\n",
    b"GET /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
    b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nExpect: 1\r\nConnection: close\r\n\r\n",
])  # fmt: skip
def test_no_answer_tells_versions(tmp_path: Path, said: bytes) -> None:
    async def test(made: Site) -> None:
        reader, writer = await connect(made)
        writer.write(said)
        async with asyncio.timeout(WAIT_S):
            answer = (await reader.read()).lower()
        assert answer.startswith(b"http/") and b"server: urbihw\r\n" in answer
        assert b"python" not in answer and b"aiohttp" not in answer
        await end(writer)

    play(tmp_path, test)


def test_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HANDSHAKE_S", 0.5)
    tls.make(tmp_path)

    async def test(made: Site) -> None:
        browser = await made.browser("view")
        for said in (b"", b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00"):
            reader, writer = await connect(made)
            writer.write(said)
            assert await is_closed(reader), "no handshake"
            await end(writer)
        await until(lambda: strangers(made) == 0)
        assert (await browser.ask("stop"))["confirmed"]
        assert made.base.startswith("https:")

    play(tmp_path, test, tls.context(tls.files("", "", tmp_path)))


@pytest.mark.parametrize("said", [b"X: 1\r\n", b"\r\nGET /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_a_head_and_requests_ahead_of_the_answers_are_bounded(tmp_path: Path, said: bytes) -> None:
    async def test(made: Site) -> None:
        reader, writer = await connect(made)
        writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + said * (connections.MAX_AHEAD_BYTES // len(said)))
        async with asyncio.timeout(WAIT_S):
            try:
                answers = await reader.read()
            except ConnectionResetError:
                answers = b""
        assert len(answers) < connections.MAX_AHEAD_BYTES
        assert not made.connections.open
        await end(writer)

    play(tmp_path, test)


def test_wrong_codes_are_answered_later_and_later_and_logged_once_but_a_right_one_passes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    waits: list[float] = []
    fail = WrongSecrets.fail

    def note(self: WrongSecrets, address: str) -> float:
        waits.append(fail(self, address))
        return 0.0

    monkeypatch.setattr(WrongSecrets, "fail", note)

    async def test(made: Site) -> None:
        client = made.client()
        for number in range(8):
            assert (await client.get(f"{made.base}/pair?c=wrong{number}")).status == 403
        assert await made.paired("drive", "anna")
        assert (await client.get(f"{made.base}/pair?c=wrong")).status == 403

    play(tmp_path, test)
    assert waits == [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0, 0.25]
    assert caplog.messages.count("a wrong or old pairing code from 127.0.0.1") == 1
    assert any(each.startswith("8 more like this") and "pairing code" in each for each in caplog.messages)
    assert "browser of anna (drive) paired from 127.0.0.1" in caplog.messages


def test_wrong_codes_are_forgotten_and_their_addresses_bounded() -> None:
    now = 0.0
    made = WrongSecrets(0.25, 8.0, lambda: now)
    assert [made.fail("a") for _ in range(3)] == [0.25, 0.5, 1.0]
    now = secrets.FORGET_S + 1
    assert made.fail("a") == 0.25
    for number in range(secrets.MAX_ADDRESSES):
        made.fail(str(number))
    assert made.fail("a") == 0.25, "it had been quiet for longest"


def test_lines_of_the_log_are_bounded(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)

    async def test(made: Site) -> None:
        client = await made.paired("view")
        for _ in range(20):
            socket = await client.ws_connect(f"{made.base}/ws")
            await socket.close()

    play(tmp_path, test)
    opened = [each for each in caplog.messages if each.startswith("browser of anna (view) from")]
    assert len(opened) == 3
    assert "17 more like this in a minute: browser of anna (view) from 127.0.0.1" in caplog.messages


def test_one_browser_does_not_take_all_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gateway, "MAX_TABS", 3)

    async def test(made: Site) -> None:
        client = await made.paired("view")
        sockets = [await client.ws_connect(f"{made.base}/ws") for _ in range(3)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await client.ws_connect(f"{made.base}/ws")
        assert refused.value.status == 503
        assert (await (await made.browser("view", "bob")).ask("stop"))["confirmed"]
        for each in sockets:
            await each.close()

    play(tmp_path, test)


def test_a_stop_does_not_wait_behind_the_requests_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    served = 0
    take = WebSession._take

    def count(self: WebSession, request: Mapping[str, Any], is_too_fast: bool) -> None:
        nonlocal served
        served += request.get("do") == "tree"
        take(self, request, is_too_fast)

    monkeypatch.setattr(WebSession, "_take", count)

    async def test(made: Site) -> None:
        floods = [await made.browser("view", f"flood{number}") for number in range(4)]
        victim = await made.browser("view", "victim")
        for flood in floods:
            for _ in range(2000):
                await flood.socket.send_str('{"id": 1, "do": "tree"}')
        assert (await victim.ask("stop"))["confirmed"]
        assert made.worker.asked == ["stop victim (panel)"]
        assert served < 6000, "the stop has waited for all requests of the others"

    play(tmp_path, test)


def test_a_stop_of_a_browser_that_asks_too_much_is_obeyed(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        for number in range(600):
            await browser.socket.send_str(json.dumps({"id": f"t{number}", "do": "tree"}))
        assert (await browser.ask("estop"))["confirmed"]

    play(tmp_path, test)
