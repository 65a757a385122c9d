"""A gateway without a daemon, and browsers that speak the protocol: each message is checked against its schema."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import aiohttp
import jsonschema

from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.web import gateway as gateway_module
from urbihw.web.connections import Connections, accepting
from urbihw.web.gateway import Gateway
from urbihw.web.settings import WebSettings

SCHEMA = json.loads(Path(gateway_module.__file__).with_name("protocol.json").read_text())
WAIT_S = 10.0


def check(message: Any, kind: str) -> None:
    """Compare a message with the schema of its kind."""
    jsonschema.Draft202012Validator({**SCHEMA, "oneOf": [{"$ref": f"#/$defs/{kind}"}]}).validate(message)


class Daemon:
    """A server that answers questions of the gateway with a value each; ``said`` is all that it was sent."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.said = ""
        self.value = "1"
        self.delay = 0.0
        self.before = b""
        """What it says before the answer to a request for pictures."""
        self.open = 0
        self._server: asyncio.Server

    async def start(self) -> None:
        self._server = await asyncio.start_unix_server(self._serve, str(self.path))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.open += 1
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
            while line := await reader.readline():
                text = line.decode("utf-8", "surrogateescape")
                self.said += text
                if "__web.picture(" in text:
                    writer.write(self.before)
                for mark in ('Channel.new("', 'lobby.answerSlot("'):
                    channel = text.partition(mark)[2].partition('"')[0]
                    if channel.startswith("_client"):
                        await asyncio.sleep(self.delay)
                        value = self.value if "answerSlot" not in mark else f'["", {self.value}]'
                        writer.write(f"[00000001:{channel}] {value}\n".encode())
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
        self.open -= 1

    def close(self) -> None:
        self._server.close()


class Worker:
    """A control socket; ``asked`` are the verbs but for health, ``heard`` the last question; of each verb in ``dies``
    it ends once without an answer.  ``state`` is a part of each answer."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.asked: list[str] = []
        self.dies: list[str] = []
        self.heard: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self._server: asyncio.Server

    async def start(self) -> None:
        self._server = await asyncio.start_unix_server(self._serve, str(self.path))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        told = json.loads(await reader.readline())
        if told["do"] in self.dies:
            self.dies.remove(told["do"])
            writer.close()
            return
        if told["do"] != "health":
            self.asked.append(f"{told['do']} {told.get('who', '')}".strip())
            self.heard = told
        state = {"ok": True, "do": told["do"], "epoch": 1, "estop": "", "link": True, "time": 1.0, "last_stop": None,
                 "bus": {"rate": 100.0, "load": 0.4, "late": 0}, "devices": []}  # fmt: skip
        writer.write(json.dumps(state | self.state).encode() + b"\n")
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()

    def close(self) -> None:
        self._server.close()


class Browser:
    """A paired browser."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.events: list[dict[str, Any]] = []
        self._number = 0

    async def ask(self, do: str, **fields: Any) -> dict[str, Any]:
        """The answer to a request."""
        self._number += 1
        request = {"id": self._number, "do": do, **fields}
        await self.socket.send_json(request)
        return await self.answer(self._number)

    async def answer(self, number: int | None) -> dict[str, Any]:
        """The answer to a request of this number."""
        while True:
            message = await self._read()
            if "event" not in message and message["id"] == number:
                return message

    async def event(self, name: str, fits: Callable[[dict[str, Any]], bool] = lambda told: True) -> dict[str, Any]:
        """The next event of a name that fits."""
        while True:
            message = await self._read()
            if message.get("event") == name and fits(message):
                return message

    async def _read(self) -> dict[str, Any]:
        message: dict[str, Any] = await self.socket.receive_json(timeout=WAIT_S)
        check(message, "event" if "event" in message else "answer")
        return message


class Site:
    """A gateway on a free port with its daemon and its worker."""

    def __init__(self, gateway: Gateway, daemon: Daemon, worker: Worker, connections: Connections) -> None:
        self.gateway, self.daemon, self.worker, self.connections = gateway, daemon, worker, connections
        scheme = "http" if gateway.settings.tls is None else "https"
        self.base = f"{scheme}://127.0.0.1:{gateway.port}"
        self._clients: list[aiohttp.ClientSession] = []
        self._browsers: list[Browser] = []

    def client(self) -> aiohttp.ClientSession:
        """A browser without a cookie."""
        jar = aiohttp.CookieJar(unsafe=True)
        made = aiohttp.ClientSession(cookie_jar=jar, connector=aiohttp.TCPConnector(ssl=False))
        self._clients.append(made)
        return made

    async def paired(self, role: str = "full", name: str = "anna") -> aiohttp.ClientSession:
        """A browser with a cookie."""
        client = self.client()
        code = self.gateway.pairings.make_code(name, role, self.gateway.port)
        async with client.get(f"{self.base}/pair", params={"c": code}, allow_redirects=False) as answer:
            assert answer.status == 303
        return client

    async def browser(self, role: str = "full", name: str = "anna") -> Browser:
        """A browser that has the page open."""
        client = await self.paired(role, name)
        made = Browser(await client.ws_connect(f"{self.base}/ws"))
        self._browsers.append(made)
        await made.event("hello")
        return made

    async def close(self) -> None:
        """Close all browsers."""
        for browser in self._browsers:
            await browser.socket.close()
        for client in self._clients:
            await client.close()


@contextlib.asynccontextmanager
async def site(folder: Path, tls: ssl.SSLContext | None = None) -> AsyncIterator[Site]:
    """A gateway while the block runs."""
    daemon, worker = Daemon(folder / "daemon.socket"), Worker(folder / "worker.sock")
    await daemon.start()
    await worker.start()
    listener = socket.create_server(("127.0.0.1", 0))
    settings = WebSettings(Where(str(daemon.path), 1), Credentials(environment={}), folder, worker.path, "toy", tls=tls)
    gateway = Gateway(settings, listener.getsockname()[1])
    running = asyncio.create_task(gateway.run())
    try:
        async with accepting(gateway.app, listener, tls) as connections:
            made = Site(gateway, daemon, worker, connections)
            try:
                yield made
            finally:
                await made.close()
                await gateway.close()
    finally:
        listener.close()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        daemon.close()
        worker.close()
        while daemon.open:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)  # the transports of asyncio close in their own time
