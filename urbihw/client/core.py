"""The commands of a connection, for every kind of program: what is sent, what is waited for, when to connect again.

A command is a generator.  It yields what it needs, a ``Step``, and its driver does that: ``connection`` with a blocking
socket and any number of threads, ``aio_connection`` in an event loop.  Between two steps nothing else runs in the core:
a thread holds the lock of its connection, and an event loop runs one callback at a time.  So the core knows neither
threads nor loops nor sockets, and there is one text for both.  (A loop in a thread would be another way to have one
text, but each call would cross between two threads twice, which takes longer than all the rest of a short command.)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from contextlib import suppress
from time import monotonic, time
from typing import Any, Final, NamedTuple, TypeVar

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dialect import Native
from urbihw.client.errors import AccessDenied, CannotConnect, ClientError, ConnectionLost, TimedOut, UrbiError
from urbihw.client.lines import MAX_LINE_BYTES, BadLine
from urbihw.client.login import explain_close
from urbihw.client.session import OnLine, Question, Session
from urbihw.client.streams import ShotStream, Stream
from urbihw.client.where import Where, explain_absence, why
from urbihw.frozen import frozen

FIRST_PAUSE_S, MAX_PAUSE_S = 0.1, 2.0
"""Seconds before the second attempt to connect again, and the maximum of the doubled pauses."""
KEEP_ALIVE: Final = "\n"
"""What keeps a lease: the server reads it at once, and has nothing to do."""
KEEP_ALIVE_SHARE: Final = 0.25
"""Time between two of them, as a share of the lease."""
SHORTEST_DIAL_S: Final = 0.1
"""Seconds that an attempt to connect has, also when less is left."""
Statement = Callable[[Native, str], str]
"""Makes the text of a statement, for a dialect and the channel of its answer."""


@frozen(slots=False, eq=False)
class LeaseTerm:
    """A lease of a connection: seconds of silence until the server stops what the connection has moved.

    Raises ValueError for a lease without a time: the library would give signs of life without a pause.

    Attributes:
        seconds: 0.1 to 3600, which the server checks.
        fed: whether the library gives the signs of life, as long as the program is not held; else the program does.
    """

    seconds: float
    fed: bool

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise ValueError(f"a lease lasts for 0.1 s to 3600 s, not {self.seconds:g} s")

    @property
    def pause(self) -> float:
        """Seconds between two signs of life."""
        return KEEP_ALIVE_SHARE * self.seconds


class Dial(NamedTuple):
    """Connect within so many seconds, and set ``connected``.  Raises OSError, UnicodeError or Denied."""

    timeout: float


class Send(NamedTuple):
    """Send a text, a character for each byte, until a time (``time.monotonic``; None: a usual one).  Nothing is done
    without a connection.  Raises TimedOut or ConnectionLost if the server does not read."""

    text: str
    limit: float | None = None


class Wait(NamedTuple):
    """Receive until ``ready()``, or until a time; the end of the connection counts if ``ready`` asks for it."""

    ready: Callable[[], bool]
    limit: float | None = None


class Pause(NamedTuple):
    """Do nothing for so many seconds."""

    seconds: float


class Drain(NamedTuple):
    """Receive what has come, without waiting."""


Step = Dial | Send | Wait | Pause | Drain
R = TypeVar("R")
Steps = Generator[Step, None, R]


class ClientCore:
    """One connection, which may be made again and again.

    Attributes:
        connected: whether there is a connection, as far as is known; set by the driver, reset by ``lose``.
        closed: whether the program has ended it.
        connects: how often it was connected.
        fault: why this side gave the connection up; empty if it did not.
        session: what is asked and watched on the present connection.
    """

    def __init__(
        self,
        where: Where,
        credentials: Credentials,
        timeout: float,
        reconnect: bool,
        on_line: OnLine,
        hang_up: Callable[[], None],
        asks_first: bool = True,
        max_line: int = MAX_LINE_BYTES,
        lease: float = 0.0,
    ) -> None:
        """``timeout``: seconds to connect, and for an answer; ``reconnect``: whether a command connects again;
        ``on_line`` gets what the server says without being asked; ``hang_up`` closes the socket; ``asks_first``: ask
        what the server can, before anything else.  Without that ``on_line`` gets all lines, from the first one on, and
        all servers are addressed in the same way (``PlainDialect``).
        ``max_line``: bytes of the longest line of the server.  ``lease``: ``lobby.lease`` of each connection in
        seconds, 0 for none; the driver sends ``KEEP_ALIVE`` with a ``LeaseTerm.pause`` while it is in force.
        """
        self.leases = [LeaseTerm(lease, True)] if lease else []
        """The leases that have begun and not ended; the last one is in force."""
        self.where = where
        self.credentials = credentials
        self.timeout = timeout
        self.connected = self.closed = False
        self.connects = 0
        self.fault = ""
        self._reconnect = reconnect
        self._on_line = on_line
        self._hang_up = hang_up
        self._asks_first = asks_first
        self._max_line = max_line
        self._connecting = False
        self._changes_lease = False
        """A change of the lease waits for its answer."""
        self._streams: list[Stream] = []
        self._forgotten: deque[Stream] = deque()
        """Streams that nothing reads any more, which the server still sends."""
        self.session = self._new_session()

    def _new_session(self) -> Session:
        return Session(self._on_line, self._asks_first, self._max_line)

    # ---------------------------------------------------------------- commands

    def ask(
        self, statement: Statement, timeout: float | None, located: bool = False, raw: bool = False, keep: bool = False
    ) -> Steps[Any]:
        """The answer to a statement.  Raises UrbiError, TimedOut, ConnectionLost, or why there is no connection.

        ``timeout`` in seconds, None without a limit; ``located``: locations in errors are those of the user's text;
        ``raw``: the answer is the Line; ``keep``: the server goes on with the statement when the waiting ends before
        the answer.
        """
        limit = None if timeout is None else monotonic() + timeout
        if self._connecting or not self.connected:
            yield from self._need_connection(monotonic() + self.timeout)
        while self._forgotten:
            yield from self.close_stream(self._forgotten.popleft())
        session = self.session
        question = session.open_question(located, raw)
        text = statement(session.dialect, question.channel)
        try:
            yield Send(text, limit)
            yield Wait(lambda: question.done, limit)
        finally:
            session.close_question(question)
            if not (question.done or keep):
                with suppress(ClientError):
                    yield Send(session.dialect.end(question.channel))
        if not question.done:
            raise TimedOut(f"{self.where} did not answer within {timeout:g} s: is it busy, or the statement longer?")
        return question.result()

    def wait(self, ready: Callable[[], bool], timeout: float | None) -> Steps[None]:
        """Receive until ``ready()``, for so many seconds, or until the end of the connection."""
        yield Wait(lambda: ready() or not self.connected, None if timeout is None else monotonic() + timeout)

    def open_stream(self, stream: Stream) -> Steps[None]:
        """Begin a stream.  It goes on after a reconnection.  Raises what ``ask`` raises."""
        def text(dialect: Native, channel: str) -> str:
            self.session.add_stream(stream)
            return stream.start_text(dialect, channel)

        try:
            yield from self.ask(text, self.timeout)
        except BaseException:
            self.session.remove_stream(stream)
            raise
        self._streams.append(stream)

    def close_stream(self, stream: Stream) -> Steps[None]:
        """End a stream; a second call does nothing."""
        stream.closed = True
        if stream not in self._streams:
            return
        self._streams.remove(stream)
        if not self.connected:
            return
        with suppress(ClientError):  # it has ended with the connection
            yield from self.ask(stream.stop_text, self.timeout)
        self.session.remove_stream(stream)

    def forget_stream(self, stream: Stream) -> None:
        """End a stream that nothing reads any more; the collector may call it anywhere, so the server hears it
        later."""
        if not stream.closed and self.connected:
            stream.closed = True
            self._forgotten.append(stream)

    def next_item(self, stream: Stream, timeout: float | None) -> Steps[Any]:
        """The next item of a stream; None when it was closed.  Raises TimedOut, or why there is no connection.

        What has come is read first, so that a slow program gets the newest items, and the others are counted.
        """
        limit = None if timeout is None else monotonic() + timeout
        while not stream.closed:
            if self._connecting or not self.connected:
                yield from self._need_connection(limit)
            yield Drain()
            yield Wait(lambda: bool(stream.items or stream.closed or stream.failed or not self.connected), limit)
            if stream.items:
                item = stream.next_item()
                if isinstance(stream, ShotStream):
                    with suppress(ClientError):  # the next reading tells the reason
                        yield Send(self.session.dialect.ready(stream.channel))
                return item
            if stream.failed is not None:
                raise stream.failed
            if limit is not None and monotonic() >= limit:
                raise stream.silence(self.where, timeout or 0.0)
        return None

    def begin_lease(self, term: LeaseTerm) -> Steps[None]:
        """Let a lease take the place of the one before it.  Raises what ``ask`` raises; the one before it is in force
        then."""
        yield from self._await_change()
        self.leases.append(term)
        try:
            yield from self._change_lease(keep=False)
        except BaseException as error:
            self.leases.remove(term)
            if self.connected and not isinstance(error, UrbiError | GeneratorExit):  # the server may have begun it
                with suppress(ClientError):
                    yield from self._change_lease(keep=True)
            raise

    def end_lease(self, term: LeaseTerm) -> Steps[None]:
        """End a lease: what the connection has moved stops, and the lease before it is in force again.  Raises what
        ``ask`` raises; nothing is done without a connection, whose end has stopped it."""
        self.leases.remove(term)
        yield from self._await_change()
        if self.connected:
            with suppress(ConnectionLost):
                yield from self._change_lease(keep=True, before="lobby.releaseDevices | ")

    def _await_change(self) -> Steps[None]:
        """Wait until no other change of the lease waits for its answer: the server refuses what was sent before the
        lease in force had begun."""
        while self._changes_lease:
            yield Wait(lambda: not self._changes_lease)

    def _change_lease(self, keep: bool, before: str = "") -> Steps[None]:
        """Tell the server which lease is in force, after ``_await_change``.  A refused change is sent again: the server
        also refuses what it reads together with what was sent before the lease in force had begun."""
        self._changes_lease = True

        def text(dialect: Native, channel: str) -> str:
            return dialect.evaluate(channel, before + self._lease_text())

        try:
            try:
                yield from self.ask(text, self.timeout, keep=keep)
            except UrbiError:
                yield from self.ask(text, self.timeout, keep=keep)
        finally:
            self._changes_lease = False

    def is_fed(self, term: LeaseTerm) -> bool:
        """Whether the library is to give a sign of life for a lease now: it is in force, and the program does not."""
        return term.fed and self.leases[-1:] == [term]

    def _lease_text(self) -> str:
        return f"lobby.lease = {self.leases[-1].seconds if self.leases else 0.0!r}"

    def close(self) -> None:
        """Close the connection; what waits ends with ConnectionLost."""
        self.closed = True
        for stream in self._streams:
            stream.closed = True
        self.lose("closed by this program")

    # ---------------------------------------------------------------- connecting

    def connect(self, limit: float) -> Steps[None]:
        """Connect, greet, and begin what was watched.  Raises CannotConnect, AccessDenied or TimedOut."""
        session = self.session = self._new_session()
        self.fault = ""
        try:
            yield Dial(max(SHORTEST_DIAL_S, limit - monotonic()))
        except Denied as error:
            raise AccessDenied(str(error)) from None
        except (OSError, UnicodeError) as error:
            raise CannotConnect(explain_absence(self.where, error), why(error)) from None
        try:
            if self.closed:
                raise self._closed_error()
            if not self.connected:
                raise self._error()
            if self._asks_first:
                yield from self._greet(session, limit)
            if self.leases:
                question = session.open_question()
                text = session.dialect.evaluate(question.channel, self._lease_text())
                yield from self._ask_now(session, question, text, limit)
            for stream in [stream for stream in self._streams if not stream.closed]:
                yield from self._begin_again(session, stream, limit)
        except BaseException:
            self.lose("it was interrupted")
            raise
        self.connects += 1

    def _greet(self, session: Session, limit: float) -> Steps[None]:
        asked = time()
        question, text = session.hello()
        yield from self._ask_now(session, question, text, limit)
        session.take_hello(question, asked, time())
        # The first answer was late, as the server has compiled the question: the second one tells the time better.
        asked = time()
        question = session.open_question()
        yield from self._ask_now(session, question, session.dialect.evaluate(question.channel, "System.time"), limit)
        told = question.stamp / 1000 if session.dialect.has_short_numbers else question.result()
        session.set_offset(told, asked, time())

    def _begin_again(self, session: Session, stream: Stream, limit: float) -> Steps[None]:
        """Begin a stream on a new connection; one that cannot begin tells it to its reader."""
        stream.begin_again()
        session.add_stream(stream)
        question = session.open_question()
        try:
            yield from self._ask_now(session, question, stream.start_text(session.dialect, question.channel), limit)
        except (ConnectionLost, TimedOut):
            raise
        except ClientError as error:
            stream.failed = error

    def _ask_now(self, session: Session, question: Question, text: str, limit: float) -> Steps[None]:
        """Ask while no other command can.  Raises what ``ask`` raises."""
        yield Send(text, limit)
        yield Wait(lambda: question.done, limit)
        if not question.done:
            raise TimedOut(f"{self.where} said nothing in time: is it busy, is it an urbiscript server?")
        session.close_question(question)
        question.result()

    def _need_connection(self, limit: float | None) -> Steps[None]:
        """Return when there is a connection.  Raises ConnectionLost if it must not be made again, or why it cannot be
        made until the limit."""
        yield Wait(lambda: not self._connecting or self.closed, limit)
        if self.connected and not self._connecting:
            return
        if self.closed or not self._reconnect:
            raise self._closed_error()
        if self._connecting:
            raise TimedOut(f"cannot connect to {self.where} in time")
        self._connecting = True
        try:
            yield from self._connect_again(limit)
        finally:
            self._connecting = False

    def _connect_again(self, limit: float | None) -> Steps[None]:
        pause = FIRST_PAUSE_S
        while True:
            try:
                yield from self.connect(monotonic() + self.timeout if limit is None else limit)
                return
            except AccessDenied:
                raise
            except ClientError:
                if self.closed or limit is not None and monotonic() + pause >= limit:
                    raise
            yield Pause(pause)
            if self.closed:
                raise self._closed_error()
            pause = min(2 * pause, MAX_PAUSE_S)

    # ---------------------------------------------------------------- what the driver tells

    def feed(self, session: Session, data: bytes) -> None:
        """Bytes of the connection of a session; b"" is its end."""
        if session is not self.session or not self.connected:
            return
        if not data:
            self.lose()
            return
        try:
            session.feed(data)
        except BadLine as error:
            self.lose(f"{error}; is that an urbiscript server?")

    def lose(self, fault: str = "") -> None:
        """The connection has ended, or this side gives it up because of a fault."""
        if not self.connected:
            return
        self.connected = False
        self.fault = fault
        self.session.lose(self._error)
        self._hang_up()

    def close_reason(self) -> str | Denied:
        """Why the connection has ended: in words, or Denied if to try again would not help."""
        if self.fault:
            return self.fault
        lines = self.session.lines
        reason = explain_close(self.where, lines.last, lines.stamped, self.credentials.words)
        return reason if isinstance(reason, Denied) else str(reason or "it closed the connection")

    def _closed_error(self) -> ConnectionLost:
        return ConnectionLost(f"the connection to {self.where} is closed: connect again")

    def _error(self) -> ClientError:
        reason = self.close_reason()
        return AccessDenied(str(reason)) if isinstance(reason, Denied) else ConnectionLost(f"{self.where}: {reason}")


class CoreOwner:
    """What both kinds of connection tell of their core."""

    core: ClientCore

    @property
    def where(self) -> Where:
        """The address of the server."""
        return self.core.where

    @property
    def timeout(self) -> float:
        """Seconds to connect, and for an answer."""
        return self.core.timeout

    @property
    def connected(self) -> bool:
        """Whether there is a connection, as far as is known."""
        return self.core.connected
