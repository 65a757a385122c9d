"""A connection of the client library in an event loop of asyncio: it does the steps of ``core`` there."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from time import monotonic
from typing import Concatenate, ParamSpec

from urbihw.client.core import (
    KEEP_ALIVE,
    ClientCore,
    CoreOwner,
    Dial,
    Drain,
    LeaseTerm,
    Pause,
    R,
    Send,
    Statement,
    Step,
    Steps,
    Wait,
)
from urbihw.client.credentials import Credentials
from urbihw.client.dial import dial
from urbihw.client.lines import MAX_LINE_BYTES
from urbihw.client.session import OnLine, Question, Session
from urbihw.client.where import Where

P = ParamSpec("P")


class _Protocol(asyncio.Protocol):
    """The protocol of one connection, for asyncio."""

    def __init__(self, owner: AsyncConnection, session: Session) -> None:
        self._owner = owner
        self._session = session

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection is open."""
        assert isinstance(transport, asyncio.Transport)
        self._owner.take(self._session, transport)

    def data_received(self, data: bytes) -> None:
        """Bytes of the server."""
        self._owner.feed(self._session, data)

    def connection_lost(self, error: Exception | None) -> None:
        """The connection has ended."""
        self._owner.feed(self._session, b"")


def _awaited(
    command: Callable[Concatenate[ClientCore, P], Steps[R]],
) -> Callable[Concatenate[AsyncConnection, P], Awaitable[R]]:
    """The method that does the steps of a command."""
    def method(self: AsyncConnection, /, *args: P.args, **kwargs: P.kwargs) -> Awaitable[R]:
        return self.run(command(self.core, *args, **kwargs))

    return method


class AsyncConnection(CoreOwner):
    """A connection in an event loop; ``open`` connects.

    Attributes:
        core: its state.
        transport: that of the present connection; None without one.
    """

    def __init__(
        self,
        where: Where,
        credentials: Credentials,
        timeout: float,
        reconnect: bool,
        on_line: OnLine,
        asks_first: bool = True,
        max_line: int = MAX_LINE_BYTES,
        on_lost: Callable[[], None] = lambda: None,
        lease: float = 0.0,
    ) -> None:
        """``on_lost`` is called when the connection has ended; the other arguments are those of ``ClientCore``."""
        self.core = ClientCore(
            where, credentials, timeout, reconnect, on_line, self._hang_up, asks_first, max_line, lease
        )
        self.transport: asyncio.Transport | None = None
        self._on_lost = on_lost
        self._waiting: list[tuple[Callable[[], bool], Callable[[], None]]] = []
        """What is waited for, and what is called once it is there."""

    # Commands: what is asked for, returned and raised stands in ``ClientCore``.
    ask = _awaited(ClientCore.ask)
    open_stream = _awaited(ClientCore.open_stream)
    close_stream = _awaited(ClientCore.close_stream)
    next_item = _awaited(ClientCore.next_item)
    begin_lease = _awaited(ClientCore.begin_lease)
    end_lease = _awaited(ClientCore.end_lease)

    async def open(self) -> None:
        """Connect.  Raises CannotConnect, AccessDenied or TimedOut."""
        await self.run(self.core.connect(monotonic() + self.timeout))
        for term in self.core.leases:
            self.feed_lease(term)

    def feed_lease(self, term: LeaseTerm) -> None:
        """Give the signs of life of a lease, until it ends or the program closes the connection."""
        if self.core.closed or term not in self.core.leases:
            return
        if self.core.is_fed(term):
            self.sign_of_life()
        asyncio.get_running_loop().call_later(term.pause, self.feed_lease, term)

    def sign_of_life(self) -> None:
        """Send what keeps a lease."""
        self.send(KEEP_ALIVE)

    def begin(self, statement: Statement, answered: Callable[[Question], None]) -> Callable[[], None]:
        """Send a statement at once; ``answered`` gets its question with the Line of the answer, or why there is none.

        Returns what ends the waiting; the server goes on with the statement.
        """
        session = self.core.session
        question = session.open_question(located=True, raw=True)
        waiter = (lambda: question.done), (lambda: answered(question))
        self._waiting.append(waiter)

        def end() -> None:
            session.close_question(question)
            if waiter in self._waiting:
                self._waiting.remove(waiter)

        self.send(statement(session.dialect, question.channel))
        return end

    def send(self, text: str) -> None:
        """Send a text, a character for each byte.  Does nothing without a connection."""
        if self.transport is not None:
            self.transport.write(text.encode("latin-1"))

    def close(self) -> None:
        """Close the connection to the server."""
        self.core.close()
        self._wake()

    # ---------------------------------------------------------------- steps

    async def run(self, steps: Steps[R], step: Step | None = None) -> R:
        """Do the steps of a command, from ``step`` on, and return its result."""
        try:
            step = next(steps) if step is None else step
            while True:
                try:
                    await self._do(step)
                except BaseException as error:
                    step = steps.throw(error)
                else:
                    step = next(steps)
        except StopIteration as end:
            result: R = end.value
            return result
        finally:
            self._wake()

    async def _do(self, step: Step) -> None:
        if isinstance(step, Wait):
            await self._wait(step)
        elif isinstance(step, Send):
            self.send(step.text)
        elif isinstance(step, Dial):
            await self._dial(step.timeout)
        elif isinstance(step, Pause):
            await asyncio.sleep(step.seconds)
        elif isinstance(step, Drain):
            await asyncio.sleep(0)

    async def _wait(self, step: Wait) -> None:
        self._wake()  # what others wait for may have changed since the last step
        if step.ready():
            return
        left = None if step.limit is None else step.limit - monotonic()
        come = asyncio.Event()
        waiter = step.ready, come.set
        self._waiting.append(waiter)
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await come.wait()
        finally:
            if waiter in self._waiting:
                self._waiting.remove(waiter)

    def _wake(self) -> None:
        for waiter in [each for each in self._waiting if each[0]()]:
            if waiter in self._waiting:
                self._waiting.remove(waiter)
                waiter[1]()

    async def _dial(self, timeout: float) -> None:
        session = self.core.session
        async with asyncio.timeout(timeout):
            try:
                await dial(self.core.where, self.core.credentials, lambda: _Protocol(self, session))
            except BaseException:
                self.core.lose("it was interrupted")  # it may be connected already
                raise

    # ---------------------------------------------------------------- what the transport tells

    def take(self, session: Session, transport: asyncio.Transport) -> None:
        """The connection of a session is open; one that the program has closed meanwhile is not wanted."""
        if session is not self.core.session or self.core.closed:
            transport.abort()
            return
        self.transport = transport
        self.core.connected = True

    def feed(self, session: Session, data: bytes) -> None:
        """Bytes of the connection of a session; b"" is its end."""
        self.core.feed(session, data)
        self._wake()

    def _hang_up(self) -> None:
        transport, self.transport = self.transport, None
        if transport is not None:
            transport.abort()
            self._wake()
            self._on_lost()
