"""Connecting to a server, for programs of asyncio: with a protocol of their own, or with streams."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable
from typing import Generic, TypeVar

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.entrance import Answer, question
from urbihw.client.secure import context, failed
from urbihw.client.where import Where

P = TypeVar("P", bound=asyncio.Protocol)


async def dial(where: Where, credentials: Credentials, factory: Callable[[], P]) -> tuple[asyncio.Transport, P]:
    """A connection with a protocol of one's own.  Raises OSError, UnicodeError or Denied.

    It asks nothing for which ``connect`` has had an answer with the same credentials, and should ask nothing else.
    """
    loop = asyncio.get_running_loop()
    if where.path is not None:
        return await loop.create_unix_connection(factory, str(where.path))
    if not where.tls:
        return await loop.create_connection(factory, where.host, where.port)
    try:
        transport, entrance = await loop.create_connection(
            lambda: _Entrance(where, credentials, factory()), where.host, where.port, ssl=context(), server_hostname=""
        )
    except ssl.SSLError as error:
        raise failed(where, error) from error
    try:
        rest = await entrance.entered
    except BaseException:
        transport.abort()
        raise
    entrance.hand_over()
    # Who called is to know the connection before it hears anything.
    if rest:
        loop.call_soon(entrance.protocol.data_received, rest)
    loop.call_soon(transport.resume_reading)
    return transport, entrance.protocol


async def streams(where: Where, credentials: Credentials) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A connection as ``asyncio.open_connection`` gives it.  Raises what ``dial`` raises."""
    reader = asyncio.StreamReader()
    transport, protocol = await dial(where, credentials, lambda: asyncio.StreamReaderProtocol(reader))
    return reader, asyncio.StreamWriter(transport, protocol, reader, asyncio.get_running_loop())


class _Entrance(asyncio.Protocol, Generic[P]):
    """Speaks for a protocol until the server has let us in, and then hands the connection over to it."""

    def __init__(self, where: Where, credentials: Credentials, protocol: P) -> None:
        self.protocol = protocol
        self.entered: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        """What came behind the answer."""
        self._handed_over = False
        self._where = where
        self._credentials = credentials
        self._answer = Answer(where, credentials)
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """TLS is there: who is it?"""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        certificate = transport.get_extra_info("ssl_object").getpeercert(binary_form=True) or b""
        try:
            self._credentials.judge(self._where, certificate)
            transport.write(question(self._where, self._credentials))
        except Denied as error:
            self._fail(error)

    def data_received(self, data: bytes) -> None:
        """The answer, or a part of it."""
        try:
            rest = self._answer.feed(data)
        except (Denied, OSError) as error:
            self._fail(error)
            return
        if rest is not None and not self.entered.done():
            self._transport.pause_reading()
            self.entered.set_result(rest)

    def hand_over(self) -> None:
        """From now on the connection is the protocol's."""
        self._handed_over = True
        self._transport.set_protocol(self.protocol)
        self.protocol.connection_made(self._transport)

    def connection_lost(self, error: Exception | None) -> None:
        """There will be no answer, or the end came in the moment in which the connection was handed over."""
        if self._handed_over:
            self.protocol.connection_lost(error)
        elif not self.entered.done():
            self.data_received(b"")

    def _fail(self, error: Exception) -> None:
        if not self.entered.done():
            self.entered.set_exception(error)
