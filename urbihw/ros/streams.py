"""Connections of TCPROS with asyncio: the handshake of both sides, frames."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Mapping
from typing import Final

from urbihw.ros.errors import PeerError
from urbihw.ros.framing import MAX_FRAME_BYTES, MAX_HEADER_BYTES, decode_header, encode_header, length_of

HANDSHAKE_TIMEOUT_S: Final = 5.0
READ_AHEAD_BYTES: Final = 1 << 20


class RosStream:
    """One connection, with messages as frames in both directions."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self.writer = writer
        raw = writer.get_extra_info("socket")
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)

    async def receive_header(self) -> dict[str, str]:
        """The fields that the other side sends first.  Raises PeerError, OSError or EOFError."""
        try:
            async with asyncio.timeout(HANDSHAKE_TIMEOUT_S):
                return decode_header(await self._receive(MAX_HEADER_BYTES))
        except TimeoutError as error:
            raise PeerError(f"a peer does not shake hands within {HANDSHAKE_TIMEOUT_S:g} s") from error

    async def greet(self, fields: Mapping[str, str]) -> dict[str, str]:
        """Send our fields, and return those of the answer.  Raises PeerError with the reason of a refusal."""
        self.writer.write(encode_header(fields))
        found = await self.receive_header()
        if "error" in found:
            raise PeerError(found["error"][:300])
        return found

    async def receive(self) -> bytes:
        """The next message.  Raises PeerError for one that is too large, EOFError at the end."""
        return await self._receive(MAX_FRAME_BYTES)

    async def receive_byte(self) -> int:
        """The byte before the answer of a service: 1 for success."""
        return (await self._reader.readexactly(1))[0]

    async def _receive(self, limit: int) -> bytes:
        length = length_of(await self._reader.readexactly(4), limit)
        return await self._reader.readexactly(length)

    async def wait_closed(self) -> None:
        """Wait until the other side has closed the connection; what it sends is dropped."""
        with contextlib.suppress(OSError):
            while await self._reader.read(1 << 12):
                pass

    def close(self) -> None:
        """Close the connection; what is not sent is lost if the other side does not read."""
        if self.writer.transport.get_write_buffer_size():
            self.writer.transport.abort()
        else:
            self.writer.close()


async def connect(host: str, port: int) -> RosStream:
    """Open a connection.  Raises PeerError."""
    try:
        async with asyncio.timeout(HANDSHAKE_TIMEOUT_S):
            return RosStream(*await asyncio.open_connection(host, port, limit=READ_AHEAD_BYTES))
    except TimeoutError as error:
        raise PeerError(f"{host}:{port} does not answer within {HANDSHAKE_TIMEOUT_S:g} s") from error
    except (OSError, ValueError, OverflowError) as error:
        # Names that cannot be encoded are a ValueError, ports above 65535 an OverflowError.
        raise PeerError(f"{host[:200]}:{port}: {getattr(error, 'strerror', None) or error}") from error
