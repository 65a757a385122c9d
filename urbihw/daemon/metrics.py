"""``/metrics`` on an address of this machine, for Prometheus.

A thread of its own serves it and asks the bus worker, so it answers while a program holds the interpreter.  It serves
one path by GET, to few clients at a time, each within a deadline.  A web page in a browser of this machine cannot read
the answer: it has no CORS headers, and a request for another host (DNS rebinding) is refused.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import re
import socket
import threading
from pathlib import Path
from typing import Any, Final

from urbihw.daemon.control_client import ControlledWorker, NoWorker
from urbihw.daemon.metrics_text import CONTENT_TYPE, render

MAX_CLIENTS: Final = 8
"""Connections at a time; a further one replaces the oldest without a whole request, or is closed if there is none."""
MAX_HEAD_BYTES: Final = 8192
DEADLINE_S: Final = 5.0
"""Seconds for a whole request, its answer included; then the connection is cut."""
KEPT_S: Final = 0.2
"""Seconds for which an answer of the worker is given again."""
_END_TIMEOUT_S: Final = 2.0
_ADDRESS: Final = re.compile(r"(?:\[(?P<v6>[0-9a-fA-F:]+)\]|(?P<v4>[0-9.]+)):(?P<port>[0-9]{1,5})")
_HOST: Final = re.compile(r"(?:localhost|127(?:\.[0-9]{1,3}){3}|\[::1\])(?::[0-9]{1,5})?", re.IGNORECASE)


def parse_address(text: str) -> tuple[str, int]:
    """Host and port of the setting.  Raises ValueError with a hint if it is no address of this machine alone."""
    found = _ADDRESS.fullmatch(text)
    if found is None:
        raise ValueError(f'wants an address and a port such as "127.0.0.1:9100", not {text!r}')
    host, port = found["v6"] or found["v4"], int(found["port"])
    try:
        local = ipaddress.ip_address(host).is_loopback
    except ValueError as error:
        raise ValueError(f"{host!r} is no address; write 127.0.0.1") from error
    if not local:
        raise ValueError(f"other machines reach {host}, and there is no access control here; write 127.0.0.1")
    if not 0 < port <= 65535:
        raise ValueError(f"{port} is no port; give a number from 1 to 65535")
    return host, port


class MetricsServer:
    """Serves the metrics of one robot.  Raises OSError when the address cannot be used."""

    def __init__(self, address: tuple[str, int]) -> None:
        host = address[0]
        self._socket = socket.create_server(address, family=socket.AF_INET6 if ":" in host else socket.AF_INET)
        self._thread: threading.Thread | None = None
        self._loop = asyncio.new_event_loop()
        self._control = Path()
        self._robot = ""
        self._clients = 0
        # Connections without a whole request, the oldest first.
        self._waiting: dict[asyncio.StreamWriter, None] = {}
        self._kept = ("", -KEPT_S)
        self._asking = asyncio.Lock()

    @property
    def port(self) -> int:
        """The port it listens on."""
        number: int = self._socket.getsockname()[1]
        return number

    def start(self, control: Path) -> None:
        """Begin to serve the robot whose worker listens at a path."""
        self._control, self._robot = control, control.stem
        self._thread = threading.Thread(target=self._run, name="metrics", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the port."""
        if self._thread is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_END_TIMEOUT_S)
        if self._thread is None or not self._thread.is_alive():
            self._loop.close()
        self._socket.close()

    # ---------------------------------------------------------------- in the thread

    def _run(self) -> None:
        loop = self._loop
        server = loop.run_until_complete(
            asyncio.start_server(self._serve, sock=self._socket, limit=MAX_HEAD_BYTES)
        )
        loop.run_forever()
        server.close()
        loop.run_until_complete(_cancel_all())

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request of a client."""
        room = self._clients < MAX_CLIENTS or self._cut_oldest()
        self._clients += 1
        try:
            if room:
                async with asyncio.timeout(DEADLINE_S):
                    self._waiting[writer] = None
                    head = await reader.readuntil(b"\r\n\r\n")
                    self._waiting.pop(writer, None)
                    writer.write(await self._answer(head))
                    await writer.drain()
                    writer.close()
                    await writer.wait_closed()
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # a client that is slow, talks too much, or has gone
        finally:
            self._clients -= 1
            self._waiting.pop(writer, None)
            writer.transport.abort()

    def _cut_oldest(self) -> bool:
        """Cut the oldest connection without a whole request; returns whether there was one."""
        oldest = next(iter(self._waiting), None)
        if oldest is None:
            return False
        del self._waiting[oldest]
        oldest.transport.abort()
        return True

    async def _answer(self, head: bytes) -> bytes:
        first, *lines = head.decode("latin-1").split("\r\n")
        words = first.split(" ")
        hosts = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("host:")]
        if len(words) != 3 or not words[2].startswith("HTTP/1."):
            return _reply("400 Bad Request", "not HTTP\n")
        if len(hosts) != 1 or not _HOST.fullmatch(hosts[0]):
            return _reply("403 Forbidden", "only for this machine, by its own name or address\n")
        if words[0] != "GET":
            return _reply("405 Method Not Allowed", "only GET\n", "Allow: GET\r\n")
        if words[1].partition("?")[0] != "/metrics":
            return _reply("404 Not Found", "there is /metrics\n")
        return _reply("200 OK", await self._text())

    async def _text(self) -> str:
        """The metrics; requests that come together share an answer of the worker."""
        async with self._asking:
            text, at = self._kept
            if self._loop.time() - at > KEPT_S:
                text = render(self._robot, await self._ask())
                self._kept = text, self._loop.time()
            return text

    async def _ask(self) -> dict[str, Any] | None:
        """The answer of the worker; None without one."""
        with contextlib.suppress(NoWorker):
            return await ControlledWorker(self._control).ask("health")
        return None


async def _cancel_all() -> None:
    """Cut the connections of all clients."""
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def _reply(status: str, text: str, more: str = "") -> bytes:
    body = text.encode("utf-8", "replace")
    return (
        f"HTTP/1.1 {status}\r\nContent-Type: {CONTENT_TYPE}\r\nContent-Length: {len(body)}\r\n{more}"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
        "Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n"
    ).encode() + body
