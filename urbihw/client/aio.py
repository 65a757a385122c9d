"""The client library for asyncio: ``robot = await urbihw.client.aio.connect("robot.local")``.

As ``urbihw.connect``, but what asks the server is awaited: ``await robot.motor6.val``,
``await robot.motor6.val.set(0.5)``, ``async for t, v in robot.watch("motor6.val")``.  A robot belongs to one event
loop.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Generator
from pathlib import Path
from types import TracebackType
from typing import Any, Never

from urbihw.client.connection import FIRST_PAUSE_S, MAX_PAUSE_S, Statement
from urbihw.client.credentials import Denied
from urbihw.client.dial import dial
from urbihw.client.dialect import Native
from urbihw.client.errors import AccessDenied, CannotConnect, ClientError, ConnectionLost, TimedOut
from urbihw.client.lines import BadLine
from urbihw.client.literals import (
    CONSTANTS,
    checked_name,
    checked_path,
    checked_rate,
    checked_text,
    literal,
    written_path,
)
from urbihw.client.login import explain_close
from urbihw.client.robot import DEFAULT_PORT, MAX_KEPT_MESSAGES, credentials_of, split_address
from urbihw.client.session import Found, Message, Question, Session
from urbihw.client.streams import EventStream, SampleStream, ShotStream, Stream
from urbihw.client.where import Where, where_is


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
        self, where: Where, credentials: Any, timeout: float, reconnect: bool, on_message: Callable[[Message], None]
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

    async def ask(self, statement: Statement, timeout: float | None, located: bool = False) -> Any:
        """As ``Connection.ask``."""
        await self._need_connection(self.timeout)
        session = self._session
        question = session.open_question(located)
        return await self._answer(session, question, statement(session.dialect, question.channel), timeout)

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
        """As ``Connection.open_stream``."""
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
            raise CannotConnect(f"cannot connect to {self.where}: {getattr(error, 'strerror', None) or error}; is the "
                                "server running, is this its port?") from None
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
        reason = explain_close(self.where, lines.last, lines.stamped, "tls=True")

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


class AsyncSlot:
    """A slot by its path: ``await slot`` reads it, ``await slot.set(0.5)`` writes it, ``await slot(1)`` calls the
    function in it; its attributes are the slots of the object in it.  Nothing is asked before.
    """

    _connection: AsyncConnection
    _path: str

    def __init__(self, connection: AsyncConnection, path: str) -> None:
        object.__setattr__(self, "_connection", connection)
        object.__setattr__(self, "_path", path and checked_path(path))

    def slot(self, name: str) -> AsyncSlot:
        """A slot by its name or path from here, also one named like a method: ``robot.slot("run")``."""
        return AsyncSlot(self._connection, f"{self._path}.{name}" if self._path else name)

    def __getattr__(self, name: str) -> AsyncSlot:
        """A slot by its name."""
        if name.startswith("_"):
            raise AttributeError(name)
        return self.slot(name)

    def __setattr__(self, name: str, value: Never) -> None:
        """Raises AttributeError: an assignment cannot wait for the server."""
        path = f"{self._path}.{name}" if self._path else name
        raise AttributeError(f"an assignment cannot be awaited: await robot.{path}.set(value) writes the slot")

    def __dir__(self) -> list[str]:
        """Its methods; the server is not asked."""
        return sorted(name for name in dir(type(self)) if not name.startswith("_"))

    def __getitem__(self, key: str | int) -> AsyncSlot:
        """A slot by its name, or a member."""
        return self.slot(key) if isinstance(key, str) else AsyncSlot(self._connection, f"{self._path}[{int(key)}]")

    def __await__(self) -> Generator[Any, None, Any]:
        """Read it."""
        return self._get().__await__()

    async def _get(self) -> Any:
        path, limit = self._path, self._connection.timeout
        return self._wrapped(await self._connection.ask(lambda dialect, channel: dialect.read(channel, path), limit))

    async def set(self, value: Any, timeout: float | None = None, **modifiers: Any) -> None:
        """Write it, as ``Slot.set``."""
        path, text = self._path, literal(value)
        if path in CONSTANTS:
            raise ValueError(f"{path} is a constant of urbiscript")
        if not modifiers:
            limit = self._connection.timeout if timeout is None else timeout
            await self._connection.ask(lambda dialect, channel: dialect.write(channel, path, text), limit)
            return
        words = "".join(f" {checked_name(name)}:{literal(each)}" for name, each in modifiers.items())
        await self._connection.ask(
            lambda dialect, channel: dialect.evaluate(channel, f"{written_path(path)} = {text}{words} | nil"), timeout
        )

    async def __call__(self, *args: Any, timeout: float | None = None) -> Any:
        """Call the function in it, as ``Slot``."""
        path = written_path(self._path)
        body = f"{path}({', '.join(map(literal, args))})" if args else path
        answer = await self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout)
        return self._wrapped(answer)

    def urbiscript_path(self) -> str:
        """How it is written in urbiscript."""
        return written_path(self._path) or "lobby"

    def _wrapped(self, answer: Any) -> Any:
        if isinstance(answer, Found):
            return AsyncSlot(self._connection, self._path if answer.kind == "function" else answer.printed)
        if isinstance(answer, list):
            return [self._wrapped(member) for member in answer]
        if isinstance(answer, dict):
            return {key: self._wrapped(member) for key, member in answer.items()}
        return answer

    def __repr__(self) -> str:
        """The path."""
        return f"<{type(self).__name__} {self._path}>"


class AsyncItems:
    """What a server sends; ``async for``, and ``async with`` to end it."""

    def __init__(self, connection: AsyncConnection, stream: Stream, timeout: float | None) -> None:
        self._connection = connection
        self._stream = stream
        self._timeout = timeout
        self._begun = False

    @property
    def lost(self) -> int:
        """The number of items left out so far."""
        return self._stream.lost

    async def begin(self) -> None:
        """Subscribe; otherwise done at the first item."""
        if not self._begun:
            self._begun = True
            await self._connection.open_stream(self._stream)

    async def close(self) -> None:
        """End it."""
        await self._connection.close_stream(self._stream)

    def __aiter__(self) -> AsyncItems:
        """Itself."""
        return self

    async def __anext__(self) -> Any:
        """The next item.  Raises TimedOut, or why there is no connection."""
        await self.begin()
        item = await self._connection.next_item(self._stream, self._timeout)
        if item is None:
            raise StopAsyncIteration
        return item

    async def __aenter__(self) -> AsyncItems:
        """Subscribe."""
        await self.begin()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        await self.close()


class AsyncRobot(AsyncSlot):
    """A connection to the server of a robot."""

    messages: deque[Message]

    def __init__(self, connection: AsyncConnection, messages: deque[Message]) -> None:
        super().__init__(connection, "")
        object.__setattr__(self, "messages", messages)

    async def run(self, text: str, tag: str = "", timeout: float | None = None) -> Any:
        """As ``Robot.run``."""
        if tag:
            checked_name(tag)
        checked_text(text)
        answer = await self._connection.ask(lambda dialect, channel: dialect.run(channel, text, tag), timeout, True)
        return self._wrapped(answer)

    async def stop(self, tag: str) -> None:
        """As ``Robot.stop``."""
        checked_name(tag)
        await self._connection.ask(lambda dialect, channel: dialect.stop(channel, tag), self._connection.timeout)

    def watch(self, *slots: str, hz: float = 10.0, timeout: float | None = None) -> AsyncItems:
        """As ``Robot.watch``."""
        return AsyncItems(self._connection, SampleStream(tuple(map(checked_path, slots)), checked_rate(hz)), timeout)

    def pictures(self, slot: str, hz: float = 10.0, timeout: float | None = None) -> AsyncItems:
        """As ``Robot.pictures``."""
        return AsyncItems(self._connection, ShotStream(checked_path(slot), checked_rate(hz)), timeout)

    def events(self, event: str, timeout: float | None = None) -> AsyncItems:
        """As ``Robot.events``."""
        return AsyncItems(self._connection, EventStream(written_path(checked_path(event))), timeout)

    def __repr__(self) -> str:
        """The address."""
        state = "" if self._connection.connected else ", not connected"
        return f"<AsyncRobot at {self._connection.where}{state}>"

    async def close(self) -> None:
        """End the connection."""
        self._connection.close()
        await asyncio.sleep(0)

    async def __aenter__(self) -> AsyncRobot:
        """Itself."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the connection."""
        await self.close()


async def connect(
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    *,
    token: str = "",
    token_file: str | Path | None = None,
    tls: bool | None = None,
    trust: bool = False,
    timeout: float = 10.0,
    reconnect: bool = True,
    on_message: Callable[[Message], None] | None = None,
) -> AsyncRobot:
    """Connect to a server; the arguments and errors are those of ``urbihw.connect``."""
    messages: deque[Message] = deque(maxlen=MAX_KEPT_MESSAGES)
    where = where_is(*split_address(host, port), tls)
    credentials = credentials_of(token, token_file, trust)
    connection = AsyncConnection(where, credentials, timeout, reconnect, on_message or messages.append)
    await connection.open()
    return AsyncRobot(connection, messages)
