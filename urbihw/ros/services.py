"""Services: calls of those of other nodes, and those that this node offers."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any
from urllib.parse import urlsplit

from urbihw.ros.errors import PeerError, RosError
from urbihw.ros.framing import encode_header, frame
from urbihw.ros.messages import ServiceType
from urbihw.ros.streams import RosStream, connect

Answering = Callable[[dict[str, Any]], Awaitable[Mapping[str, Any]]]
"""Makes the response of a request.  Raises RosError, whose text the caller gets."""


async def probe(uri: str, service: str, node: str) -> dict[str, str]:
    """What a service tells of its type: ``type``, ``md5sum``.  Raises RosError."""
    stream = await _dial(uri)
    try:
        return await stream.greet({"callerid": node, "service": service, "md5sum": "*", "probe": "1"})
    except EOFError as error:
        raise PeerError(f"service {service} has closed the connection") from error
    finally:
        stream.close()


class ServiceCaller:
    """Calls one service, one call after the other; with ``keep_open`` over one connection."""

    def __init__(self, service: str, uri: str, kind: ServiceType, node: str, keep_open: bool) -> None:
        self.kind = kind
        self._service, self._uri, self._node, self._keep_open = service, uri, node, keep_open
        self._stream: RosStream | None = None
        self._turn = asyncio.Lock()

    async def call(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """The response.  Raises RosError: a wrong field, no service, or the service's own error."""
        data = self.kind.request.encode(request)
        async with self._turn:
            try:
                return await self._call(data)
            except (OSError, EOFError) as error:
                self.close()
                raise PeerError(f"service {self._service} has closed the connection") from error
            except BaseException:
                self.close()
                raise

    async def _call(self, data: bytes) -> dict[str, Any]:
        if self._stream is None:
            self._stream = stream = await _dial(self._uri)
            await stream.greet({"callerid": self._node, "service": self._service, "md5sum": self.kind.md5,
                                "type": self.kind.name, "persistent": str(int(self._keep_open))})
        stream = self._stream
        stream.writer.write(frame(data))
        succeeded = await stream.receive_byte()
        answer = await stream.receive()
        if not self._keep_open:
            self.close()
        if not succeeded:
            raise PeerError(f"service {self._service}: {answer.decode('utf-8', 'replace')[:300]}")
        return self.kind.response.decode(answer)

    def close(self) -> None:
        """Close the connection; the next call opens another one."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None


class OfferedService:
    """A service of this node."""

    def __init__(self, name: str, kind: ServiceType, answer: Answering) -> None:
        self.name, self.kind = name, kind
        self._answer = answer
        self._serving: set[asyncio.Task[Any]] = set()

    def close(self) -> None:
        """Send away all callers, also those that wait for an answer."""
        for task in self._serving:
            task.cancel()

    async def serve(self, stream: RosStream, fields: Mapping[str, str], node: str) -> None:
        """Serve a caller until it goes.  Raises PeerError with the reason of a refusal."""
        task = asyncio.current_task()
        assert task is not None
        self._serving.add(task)
        try:
            await self._serve(stream, fields, node)
        finally:
            self._serving.discard(task)

    async def _serve(self, stream: RosStream, fields: Mapping[str, str], node: str) -> None:
        kind = self.kind
        if fields.get("md5sum") not in ("*", kind.md5):
            raise PeerError(f"service {self.name} has type {kind.name}, md5sum {kind.md5}, "
                            f"not {fields.get('md5sum')}")
        stream.writer.write(encode_header({
            "callerid": node, "type": kind.name, "md5sum": kind.md5, "request_type": kind.request.name,
            "response_type": kind.response.name,
        }))  # fmt: skip
        again = fields.get("probe") != "1"
        while again:
            data = await stream.receive()
            try:
                response = kind.response.encode(await self._answer(kind.request.decode(data)))
            except RosError as error:
                stream.writer.write(b"\0" + frame(str(error).encode()))
            else:
                stream.writer.write(b"\1" + frame(response))
            await stream.writer.drain()
            again = fields.get("persistent") == "1"
        # What is written must arrive before the end.
        await stream.writer.drain()
        stream.writer.write_eof()
        await stream.wait_closed()


async def _dial(uri: str) -> RosStream:
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not uri.startswith("rosrpc://") or not host or not port:
        raise PeerError(f"{uri[:200]!r} is no address of a service: rosrpc://HOST:PORT is one")
    return await connect(host, port)
