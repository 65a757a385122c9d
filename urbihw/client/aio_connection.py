"""A connection of the client library in an event loop of asyncio; ``aio`` is what programs see of it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from urbihw.client.connection import FIRST_PAUSE_S, MAX_PAUSE_S, Statement
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import dial
from urbihw.client.dialect import Native
from urbihw.client.errors import AccessDenied, CannotConnect, ClientError, ConnectionLost, TimedOut
from urbihw.client.lines import BadLine
from urbihw.client.login import explain_close
from urbihw.client.session import Message, Question, Session
from urbihw.client.streams import ShotStream, Stream
from urbihw.client.where import Where, explain_absence


class _Protocol(asyncio.Protocol):
    """One connection."""

    def __init__(self, session: Session, lost: Callable[[], None]) -> None:
        self.session = session
        self._lost = lost
        self._transport: asyncio.BaseTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection is open."""
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Bytes of the server."""
        try:
            self.session.feed(data)
        except BadLine:
            assert self._transport is not None
            self._transport.close()

    def connection_lost(self, error: Exception | None) -> None:
        """The connection has ended."""
        self._lost()


class AsyncConnection:
    """A connection in an event loop; ``open`` connects."""

    def __init__(
        self,
        where: Where,
        credentials: Credentials,
        timeout: float,
        reconnect: bool,
        on_message: Callable[[Message], None],
    ) -> None:
        self.where = where
        self.timeout = timeout
        self.closed = False
        self.connects = 0
        self._credentials = credentials
        self._reconnect = reconnect
        self._on_message = on_message
        self._transport: asyncio.Transport | None = None
        self._session = Session(on_message)
        self._connecting = asyncio.Lock()
        self._streams: list[Stream] = []

    @property
    def connected(self) -> bool:
        """Whether there is a connection."""
        return self._transport is not None

    async def ask(
        self, statement: Statement, timeout: float | None, located: bool = False, keep: bool = False
    ) -> Any:
        await self._need_connection(self.timeout)
        session = self._session
        question = session.open_question(located)
        text = statement(session.dialect, question.channel)
        try:
            return await self._answer(session, question, text, timeout)
        finally:
            if not question.done and not keep and session is self._session:
                self.tell(session.dialect.end(question.channel))

    async def _answer(self, session: Session, question: Question, text: str, timeout: float | None) -> Any:
        answered = asyncio.Event()
        question.wake = answered.set
        try:
            self.tell(text)
            async with asyncio.timeout(timeout):
                await answered.wait()
        except TimeoutError:
            raise TimedOut(f"{self.where} did not answer within {timeout:g} s: is it busy?") from None
        finally:
            session.close_question(question)
        return question.result()

    def tell(self, text: str) -> None:
        """Send a statement."""
        if self._transport is not None:
            self._transport.write(text.encode("latin-1"))

    async def open_stream(self, stream: Stream) -> None:
        def text(dialect: Native, channel: str) -> str:
            self._session.add_stream(stream)
            return stream.start_text(dialect, channel)

        await self.ask(text, self.timeout)
        self._streams.append(stream)

    async def close_stream(self, stream: Stream) -> None:
        """End a stream; a second call does nothing."""
        stream.closed = True
        stream.wake()
        if stream not in self._streams:
            return
        self._streams.remove(stream)
        if self.connected:
            try:
                await self.ask(stream.stop_text, self.timeout)
            except ClientError:
                pass  # it has ended with the connection
            self._session.remove_stream(stream)

    async def next_item(self, stream: Stream, timeout: float | None) -> Any:
        """The next item; None when it was closed.  Raises TimedOut, or why there is no connection."""
        come = asyncio.Event()
        stream.wake = come.set
        try:
            async with asyncio.timeout(timeout):
                while not stream.closed:
                    await self._need_connection(timeout)
                    if stream.items:
                        item = stream.next_item()
                        if isinstance(stream, ShotStream):
                            self.tell(self._session.dialect.ready(stream.channel))
                        return item
                    if stream.failed is not None:
                        raise stream.failed
                    come.clear()
                    await come.wait()
        except TimeoutError:
            raise stream.silence(self.where, timeout or 0.0) from None
        return None

    async def open(self) -> None:
        """Connect.  Raises CannotConnect, AccessDenied or TimedOut."""
        session = Session(self._on_message)
        try:
            async with asyncio.timeout(self.timeout):
                protocol = _Protocol(session, lambda: self._lost(session))
                made, _ = await dial(self.where, self._credentials, lambda: protocol)
        except Denied as error:
            raise AccessDenied(str(error)) from None
        except (OSError, UnicodeError) as error:
            raise CannotConnect(explain_absence(self.where, error)) from None
        self._transport, self._session = made, session
        try:
            await self._greet(session)
            for stream in self._streams:
                await self._begin_again(session, stream)
        except BaseException:
            made.abort()
            self._transport = None
            raise
        self.connects += 1

    async def _greet(self, session: Session) -> None:
        asked = time.time()
        question, text = session.hello()
        await self._answer(session, question, text, self.timeout)
        session.take_hello(question, asked, time.time())

    async def _begin_again(self, session: Session, stream: Stream) -> None:
        stream.begin_again()
        session.add_stream(stream)
        question = session.open_question()
        try:
            await self._answer(session, question, stream.start_text(session.dialect, question.channel), self.timeout)
        except (ConnectionLost, TimedOut):
            raise
        except ClientError as error:
            stream.failed = error

    async def _need_connection(self, timeout: float | None) -> None:
        if self._transport is not None:
            return
        limit = None if timeout is None else time.monotonic() + timeout
        async with self._connecting:
            pause = FIRST_PAUSE_S
            while self._transport is None:
                if self.closed or not self._reconnect:
                    raise ConnectionLost(f"the connection to {self.where} is closed: connect again")
                try:
                    await self.open()
                except AccessDenied:
                    raise
                except ClientError:
                    if limit is not None and time.monotonic() + pause >= limit:
                        raise
                    await asyncio.sleep(pause)
                    pause = min(2 * pause, MAX_PAUSE_S)

    def _lost(self, session: Session) -> None:
        lines = session.lines
        reason = explain_close(self.where, lines.last, lines.stamped, self._credentials.words)

        def error() -> ClientError:
            if isinstance(reason, Denied):
                return AccessDenied(str(reason))
            return ConnectionLost(f"{self.where}: {reason or 'it closed the connection'}")

        if session is self._session:
            self._transport = None
        session.lose(error)

    def close(self) -> None:
        """Close the connection."""
        self.closed = True
        for stream in self._streams:
            stream.closed = True
            stream.wake()
        if self._transport is not None:
            self._transport.abort()
            self._transport = None
