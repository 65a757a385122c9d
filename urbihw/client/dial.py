"""Connects to a server with asyncio, with a protocol of the caller."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable
from typing import Generic, TypeVar

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.login import LoginReply, login_line
from urbihw.client.secure import context, failed
from urbihw.client.where import Where

P = TypeVar("P", bound=asyncio.Protocol)


async def dial(where: Where, credentials: Credentials, factory: Callable[[], P]) -> tuple[asyncio.Transport, P]:
    """Connect with a protocol of the caller.  Raises OSError, UnicodeError or Denied.

    Questions to the user block the loop: call ``connect`` with the same credentials first, which keep its answers.
    """
    loop = asyncio.get_running_loop()
    if where.path is not None:
        return await loop.create_unix_connection(factory, str(where.path))
    if not where.tls:
        return await loop.create_connection(factory, where.host, where.port)
    try:
        transport, login = await loop.create_connection(
            lambda: _LoginProtocol(where, credentials, factory()),
            where.host, where.port, ssl=context(), server_hostname="",
        )
    except ssl.SSLError as error:
        raise failed(where, error, credentials.words) from error
    try:
        rest = await login.logged_in
    except BaseException:
        transport.abort()
        raise
    login.hand_over()
    # The caller must have the connection before its protocol gets data.
    if rest:
        loop.call_soon(login.protocol.data_received, rest)
    loop.call_soon(transport.resume_reading)
    return transport, login.protocol


class _LoginProtocol(asyncio.Protocol, Generic[P]):
    """Logs in to the server, then hands the connection over to the protocol of the caller."""

    def __init__(self, where: Where, credentials: Credentials, protocol: P) -> None:
        self.protocol = protocol
        self.logged_in: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        """The bytes received behind the answer, once the login has succeeded."""
        self._handed_over = False
        self._where = where
        self._credentials = credentials
        self._answer = LoginReply(where, credentials)
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """TLS is established: check the certificate, and send the token."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        certificate = transport.get_extra_info("ssl_object").getpeercert(binary_form=True) or b""
        try:
            self._credentials.check_certificate(self._where, certificate)
            transport.write(login_line(self._where, self._credentials))
        except Denied as error:
            self._fail(error)

    def data_received(self, data: bytes) -> None:
        """Handle the answer of the server, or a part of it."""
        try:
            rest = self._answer.feed(data)
        except (Denied, OSError) as error:
            self._fail(error)
            return
        if rest is not None and not self.logged_in.done():
            self._transport.pause_reading()
            self.logged_in.set_result(rest)

    def hand_over(self) -> None:
        """Hand the connection over to the protocol of the caller."""
        self._handed_over = True
        self._transport.set_protocol(self.protocol)
        self.protocol.connection_made(self._transport)

    def connection_lost(self, error: Exception | None) -> None:
        """The connection was lost before the answer, or while it was handed over."""
        if self._handed_over:
            self.protocol.connection_lost(error)
        elif not self.logged_in.done():
            self.data_received(b"")

    def _fail(self, error: Exception) -> None:
        if not self.logged_in.done():
            self.logged_in.set_exception(error)
