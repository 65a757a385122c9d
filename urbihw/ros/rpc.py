"""XML-RPC over HTTP with asyncio: calls with a time-out, and a server with bounded requests.

The standard library encodes and decodes XML-RPC; its own client and server know no time-outs and no bounds.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import xmlrpc.client
from collections.abc import Callable, Mapping
from typing import Any, Final
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError

from urbihw.ros.errors import PeerError

log = logging.getLogger("urbihw.ros")

MAX_BODY_BYTES: Final = 4 << 20
MAX_HEAD_BYTES: Final = 16 << 10
CALL_TIMEOUT_S: Final = 5.0
IDLE_TIMEOUT_S: Final = 30.0
"""Seconds after which a silent connection to the server is closed."""
MAX_CONNECTIONS: Final = 128
Handler = Callable[[list[Any]], Any]
"""Takes the parameters of a call, and returns ``[code, message, value]``."""


async def call(uri: str, method: str, *params: Any, timeout: float = CALL_TIMEOUT_S) -> Any:
    """The answer to a call.  Raises PeerError, also after ``timeout`` seconds."""
    try:
        async with asyncio.timeout(timeout):
            return await _call(uri, method, params)
    except TimeoutError as error:
        raise PeerError(f"{uri} does not answer within {timeout:g} s") from error
    except (OSError, EOFError, ValueError) as error:
        raise PeerError(f"{uri}: {getattr(error, 'strerror', None) or error}") from error


async def _call(uri: str, method: str, params: tuple[Any, ...]) -> Any:
    parts = urlsplit(uri)
    if parts.scheme != "http" or not parts.hostname or not parts.port:
        raise PeerError(f"{uri[:200]!r} is no address: http://HOST:PORT is one")
    body = xmlrpc.client.dumps(params, method, allow_none=False).encode()
    reader, writer = await asyncio.open_connection(parts.hostname, parts.port, limit=MAX_HEAD_BYTES)
    try:
        writer.write(
            f"POST {parts.path or '/'} HTTP/1.1\r\nHost: {parts.netloc}\r\nContent-Type: text/xml\r\n"
            f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n".encode() + body
        )
        await writer.drain()
        first, fields = await _read_head(reader)
        if " 200" not in first:
            raise PeerError(f"{uri} answers {first[:80]!r}")
        return _loads(await _read_body(reader, fields))[0][0]
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


def _loads(data: bytes) -> tuple[tuple[Any, ...], str | None]:
    """The parameters and the method of a call, or the answer as its only parameter.  Raises PeerError."""
    try:
        return xmlrpc.client.loads(data)
    except xmlrpc.client.Fault as error:
        raise PeerError(f"refused: {error.faultString}"[:300]) from error
    except (ExpatError, xmlrpc.client.Error, ValueError, TypeError, LookupError, RecursionError) as error:
        raise PeerError(f"no XML-RPC: {error}"[:300]) from error


async def _read_head(reader: asyncio.StreamReader) -> tuple[str, dict[str, str]]:
    """The first line of a request or an answer, and the fields of its head.  Raises EOFError at the end."""
    try:
        head = await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError as error:
        raise PeerError("a head of HTTP that is too long") from error
    first, *rows = head.decode("latin-1").split("\r\n")
    pairs = (row.partition(":") for row in rows if row)
    return first, {name.strip().lower(): value.strip() for name, _, value in pairs}


async def _read_body(reader: asyncio.StreamReader, fields: Mapping[str, str]) -> bytes:
    size = fields.get("content-length", "")
    if not size.isdecimal() or len(size) > 9 or int(size) > MAX_BODY_BYTES:
        raise PeerError(f"a body of {size[:20] or 'unknown'} bytes")
    return await reader.readexactly(int(size))


class RpcServer:
    """Answers calls by a table of handlers.  ``uri`` is the address for others, once it has started."""

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self.uri = ""
        self._handlers = handlers
        self._server: asyncio.Server | None = None
        self._connections: set[asyncio.Task[None]] = set()

    async def start(self, host: str) -> None:
        """Listen on a free port of an address.  Raises OSError."""
        self._server = await asyncio.start_server(self._accept, host, 0, limit=MAX_HEAD_BYTES)
        port = self._server.sockets[0].getsockname()[1]
        self.uri = f"http://{f'[{host}]' if ':' in host else host}:{port}/"

    async def close(self) -> None:
        """Stop listening, and end the connections."""
        if self._server is not None:
            self._server.close()
        await cancel_all(self._connections)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._connections) >= MAX_CONNECTIONS:
            writer.transport.abort()
            return
        task = asyncio.get_running_loop().create_task(self._serve(reader, writer))
        self._connections.add(task)
        task.add_done_callback(self._connections.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            again = True
            while again:
                async with asyncio.timeout(IDLE_TIMEOUT_S):
                    first, fields = await _read_head(reader)
                    # A web page can make a browser send anything else to a port of this machine.
                    if fields.get("content-type", "").partition(";")[0] != "text/xml" or "origin" in fields:
                        raise PeerError("a request that is not one of ROS")
                    params, method = _loads(await _read_body(reader, fields))
                    answer = xmlrpc.client.dumps((self._answer(method or "", [*params]),), methodresponse=True).encode()
                    again = first.endswith("HTTP/1.1") and fields.get("connection", "").lower() != "close"
                    writer.write(
                        b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n%s\r\n"
                        % (len(answer), b"" if again else b"Connection: close\r\n") + answer
                    )
                    await writer.drain()
        except (PeerError, OSError, EOFError) as error:
            log.debug("a caller has gone: %s", error)
        finally:
            writer.transport.abort() if writer.transport.get_write_buffer_size() else writer.close()

    def _answer(self, method: str, params: list[Any]) -> Any:
        handler = self._handlers.get(method)
        if handler is None:
            return [-1, f"no method {method[:80]}", 0]
        try:
            return handler(params)
        except (IndexError, TypeError, ValueError, KeyError) as error:
            return [-1, f"wrong parameters: {error}"[:200], 0]


async def cancel_all(tasks: set[asyncio.Task[None]]) -> None:
    """End tasks, and wait for their end."""
    waiting = [task for task in tasks if task is not asyncio.current_task()]
    for task in waiting:
        task.cancel()
    await asyncio.gather(*waiting, return_exceptions=True)
