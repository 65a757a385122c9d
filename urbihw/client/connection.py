"""A blocking connection of the client library, for any number of threads.

It has no thread of its own: the thread that waits for an answer reads the socket, also for the others; the others
wait until their answer has come or the reader leaves.  So a command costs no more than the way to the server and
back, and nothing is left behind when a program ends or is interrupted: Ctrl-C ends the waiting of the main thread
only (``interrupts``).
"""

from __future__ import annotations

import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from time import monotonic, time
from typing import Any, Final

from urbihw.client.connect import ClientSocket, connect, has_unread
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dialect import Native
from urbihw.client.errors import AccessDenied, CannotConnect, ClientError, ConnectionLost, TimedOut
from urbihw.client.interrupts import DEFERRAL, uninterrupted
from urbihw.client.lines import BadLine
from urbihw.client.login import explain_close
from urbihw.client.session import Message, Question, Session
from urbihw.client.streams import Stream
from urbihw.client.where import Where, explain_absence

CHUNK: Final = 64 * 1024
"""Bytes read at once.  Above 128 KiB each reading maps and unmaps memory, which costs 0.05 ms."""
MAX_CHUNKS: Final = 64
"""Maximum number of pieces that are read before an item is handed out: a server may send faster than they are read."""
SEND_TIMEOUT_S: Final = 10.0
"""Maximum seconds for the server to accept data."""
SHORTEST_SEND_S: Final = 0.01
"""Seconds that a statement has to be sent, also when less is left of its timeout."""
FIRST_PAUSE_S, MAX_PAUSE_S = 0.1, 2.0
"""Seconds before the second attempt to connect again, and the maximum of the doubled pauses."""
Statement = Callable[[Native, str], str]
"""Makes the text of a statement, for a dialect and the channel of its answer."""


class Connection:
    """Connected when made.  Raises CannotConnect, AccessDenied or TimedOut."""

    @uninterrupted
    def __init__(
        self,
        where: Where,
        credentials: Credentials,
        timeout: float,
        reconnect: bool,
        on_message: Callable[[Message], None],
        asks_first: bool = True,
    ) -> None:
        """``timeout``: seconds to connect, and for an answer; ``reconnect``: whether a command connects again;
        ``asks_first``: ask what the server can, before anything else.  Without that all that comes is a message, from
        the first line on, and all servers are addressed in the same way (``Plain``).
        """
        self.where = where
        self.timeout = timeout
        self.closed = False
        self.connects = 0
        """The number of times that it has connected."""
        self._credentials = credentials
        self._reconnect = reconnect
        self._on_message = on_message
        self._messages: deque[Message] = deque()
        """Messages of the data that was read last: they are handed out at once."""
        self._asks_first = asks_first
        self.fault = ""
        """Why this side gave the connection up; empty if it did not."""
        self._turn = threading.Condition(threading.Lock())
        self._sending = threading.Lock()
        self._led = False
        """Whether a thread reads the socket, or connects."""
        self._socket: ClientSocket | None = None
        self._reading: ClientSocket | None = None
        """The socket from which a thread reads, who then closes it."""
        self._poll = select.poll()
        self._streams: list[Stream] = []
        self._forgotten: deque[Stream] = deque()
        """Streams without a reader, which the server still sends."""
        self._session = Session(self._messages.append, asks_first)
        with self._turn:
            self._led = True
        try:
            self._connect(monotonic() + timeout)
        finally:
            self._end_lead()

    @property
    def connected(self) -> bool:
        """Whether there is a connection, as far as is known."""
        return self._socket is not None

    @property
    def rest(self) -> bytes:
        """What came behind the last line feed."""
        return self._session.lines.rest

    # ---------------------------------------------------------------- for the objects above

    @uninterrupted
    def send(self, text: str) -> None:
        """Send a text, a character for each byte.  Does nothing without a connection; raises ConnectionLost if the
        server does not read."""
        self._send(text)

    @uninterrupted
    def wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Read until ``ready()``, for so many seconds, or until the end of the connection."""
        self._wait(ready, None if timeout is None else monotonic() + timeout)

    @uninterrupted
    def ask(
        self, statement: Statement, timeout: float | None, located: bool = False, raw: bool = False, keep: bool = False
    ) -> Any:
        """The answer to a statement.  Raises UrbiError, TimedOut, ConnectionLost, or why there is no connection.

        ``timeout`` in seconds, None without a limit; ``located``: locations in errors are those of the user's text;
        ``raw``: the answer is the Line; ``keep``: the server goes on with the statement when the waiting ends before
        the answer.
        """
        limit = None if timeout is None else monotonic() + timeout
        self._need_connection(monotonic() + self.timeout)
        while self._forgotten:
            self.close_stream(self._forgotten.popleft())
        with self._turn:
            session = self._session
            question = session.open_question(located, raw)
            text = statement(session.dialect, question.channel)
        try:
            self._send(text, limit)
            self._wait(lambda: question.done or session is not self._session, limit)
        finally:
            with self._turn:
                session.close_question(question)
            if not question.done and not keep and session is self._session:
                with suppress(ClientError):
                    self._send(session.dialect.end(question.channel))
        if not question.done and session is not self._session or self._socket is None and not question.done:
            raise ConnectionLost(f"{self.where}: the connection ended before the answer")
        if not question.done:
            raise TimedOut(f"{self.where} did not answer within {timeout:g} s: is it busy, or the statement longer?")
        return question.result()

    @uninterrupted
    def open_stream(self, stream: Stream) -> None:
        """Begin a stream.  It goes on after a reconnection.  Raises what ``ask`` raises."""
        def text(dialect: Native, channel: str) -> str:
            self._session.add_stream(stream)
            return stream.start_text(dialect, channel)

        try:
            self.ask(text, self.timeout)
        except BaseException:
            with self._turn:
                self._session.remove_stream(stream)
            raise
        with self._turn:
            self._streams.append(stream)

    @uninterrupted
    def close_stream(self, stream: Stream) -> None:
        """End a stream, also from another thread; a second call does nothing."""
        with self._turn:
            known = stream in self._streams
            if known:
                self._streams.remove(stream)
            stream.closed = True
            self._turn.notify_all()
        if not known or not self.connected:
            return
        try:
            self.ask(stream.stop_text, self.timeout)
        except ClientError:
            pass  # it has ended with the connection
        with self._turn:
            self._session.remove_stream(stream)

    @uninterrupted
    def next_item(self, stream: Stream, timeout: float | None) -> Any:
        """The next item of a stream; None when it was closed.  Raises TimedOut, or why there is no connection.

        What has come is read first, so that a slow program gets the newest items, and the others are counted.
        """
        limit = None if timeout is None else monotonic() + timeout
        while not stream.closed:
            self._need_connection(limit)
            self._read_what_has_come()
            self._wait(lambda: bool(stream.items or stream.closed or stream.failed) or self._socket is None, limit)
            with self._turn:
                if stream.items:
                    return stream.next_item()
            if stream.failed is not None:
                raise stream.failed
            if limit is not None and monotonic() >= limit:
                raise stream.silence(self.where, timeout or 0.0)
        return None

    @uninterrupted
    def want_next(self, stream: Stream) -> None:
        """Tell the server that the program takes one more Binary."""
        with self._turn:
            text = self._session.dialect.ready(stream.channel)
        if text and not stream.closed:
            with suppress(ClientError):  # the next reading tells it
                self._send(text)

    def forget_stream(self, stream: Stream) -> None:
        """End a stream without a reader; the collector may call it anywhere, so the server hears of it later."""
        if stream.closed or self._socket is None:
            return
        stream.closed = True
        self._forgotten.append(stream)

    @uninterrupted
    def close(self) -> None:
        """Close the connection, also from another thread; what waits ends with ConnectionLost."""
        with self._turn:
            self.closed = True
            for stream in self._streams:
                stream.closed = True
        self._lose("closed by this program")

    # ---------------------------------------------------------------- reading

    def _wait(self, ready: Callable[[], bool], limit: float | None) -> None:
        """Return when ``ready()``, at the limit, or when the connection is lost."""
        with self._turn:
            while not ready():
                left = None if limit is None else limit - monotonic()
                if left is not None and left <= 0 or self._socket is None:
                    return
                if self._led:
                    with DEFERRAL.waiting:
                        self._turn.wait(left)
                    continue
                self._led = True
                self._turn.release()
                try:
                    data = self._receive(left)
                finally:
                    self._turn.acquire()
                    self._led = False
                    self._turn.notify_all()
                if data is not None:
                    self._feed(data)
                    self._hand_out()

    def _hand_out(self) -> None:
        """Hand out messages; under the lock, which is free while the function of the program runs."""
        while self._messages:
            message = self._messages.popleft()
            self._turn.release()
            try:
                with DEFERRAL.waiting:
                    self._on_message(message)
            finally:
                self._turn.acquire()

    def _read_what_has_come(self) -> None:
        """Read without waiting, unless another thread reads."""
        with self._turn:
            if self._led:
                return
            self._led = True
        try:
            for _ in range(MAX_CHUNKS):
                data = self._receive(0)
                if data is None:
                    return
                with self._turn:
                    self._feed(data)
                    self._hand_out()
        finally:
            self._end_lead()

    def _receive(self, timeout: float | None) -> bytes | None:
        """What has come within so many seconds; None for nothing, b"" for the end."""
        made = self._socket
        if made is None:
            return None
        self._reading = made
        try:
            if not has_unread(made):
                with DEFERRAL.waiting:
                    ready = self._poll.poll(None if timeout is None else timeout * 1000)
                if not ready:
                    return None
            return made.recv(CHUNK)
        except TimeoutError:
            return None  # a part of a record of TLS
        except OSError:
            return b""
        finally:
            self._reading = None
            if self._socket is not made:
                made.close()

    def _feed(self, data: bytes) -> None:
        """Hand on what has come; under the lock."""
        if data:
            try:
                self._session.feed(data)
            except BadLine as error:
                self.fault = f"{error}; is that an urbiscript server?"
                self._drop(self.fault)
        elif self._socket is not None:
            self._drop(self.close_reason())

    def _end_lead(self) -> None:
        with self._turn:
            self._led = False
            self._turn.notify_all()

    # ---------------------------------------------------------------- sending

    def _send(self, text: str, limit: float | None = None) -> None:
        """Send a statement until the limit.  A part of one cannot be taken back, so the connection ends then."""
        made = self._socket
        if made is None:
            return
        left = SEND_TIMEOUT_S if limit is None else min(SEND_TIMEOUT_S, max(SHORTEST_SEND_S, limit - monotonic()))
        if not self._sending.acquire(timeout=left):
            raise TimedOut(f"{self.where} does not read what it is sent: is it busy?")
        try:
            made.settimeout(left)
            made.sendall(text.encode("latin-1"))
            made.settimeout(SEND_TIMEOUT_S)
        except TimeoutError:
            self.fault = "it does not read what it is sent"
            self._lose(self.fault)
            raise ConnectionLost(f"{self.where}: {self.fault}") from None
        except OSError:
            pass  # the reader learns the reason
        finally:
            self._sending.release()

    # ---------------------------------------------------------------- connecting

    def _need_connection(self, limit: float | None) -> None:
        """Return when there is a connection.  Raises ConnectionLost if it must not be made again, or why it cannot be
        made until the limit."""
        if self._socket is not None:
            return
        with self._turn:
            while self._led and self._socket is None and not self.closed:
                with DEFERRAL.waiting:
                    self._turn.wait(None if limit is None else max(0.0, limit - monotonic()))
                if limit is not None and monotonic() >= limit:
                    break
            if self._socket is not None:
                return
            if self.closed or not self._reconnect:
                raise ConnectionLost(f"the connection to {self.where} is closed: connect again")
            if self._led:
                raise TimedOut(f"cannot connect to {self.where} in time")
            self._led = True
        try:
            self._connect_again(limit)
        finally:
            self._end_lead()

    def _connect_again(self, limit: float | None) -> None:
        pause = FIRST_PAUSE_S
        while True:
            try:
                self._connect(monotonic() + self.timeout if limit is None else limit)
                return
            except AccessDenied:
                raise
            except ClientError:
                if self.closed or limit is not None and monotonic() + pause >= limit:
                    raise
            with DEFERRAL.waiting:
                threading.Event().wait(pause)
            pause = min(2 * pause, MAX_PAUSE_S)

    def _connect(self, limit: float) -> None:
        """Connect, greet, and begin what was watched; by the thread that leads."""
        try:
            with DEFERRAL.waiting:
                made = connect(self.where, self._credentials, max(0.1, limit - monotonic()))
        except Denied as error:
            raise AccessDenied(str(error)) from None
        except (OSError, UnicodeError) as error:
            raise CannotConnect(explain_absence(self.where, error)) from None
        session = Session(self._messages.append, self._asks_first)
        self.fault = ""
        try:
            made.settimeout(SEND_TIMEOUT_S)
            self._poll = select.poll()
            self._poll.register(made.fileno(), select.POLLIN)
            with self._turn:
                self._socket, self._session = made, session
            if self._asks_first:
                self._greet(session, limit)
            with self._turn:
                streams = [stream for stream in self._streams if not stream.closed]
            for stream in streams:
                self._begin_again(session, stream, limit)
        except BaseException:
            self._lose("it was interrupted")
            raise
        self.connects += 1

    def _greet(self, session: Session, limit: float) -> None:
        asked = time()
        with self._turn:
            question, text = session.hello()
        self._ask_now(session, question, text, limit)
        session.take_hello(question, asked, time())
        asked = time()
        question = session.open_question()
        self._ask_now(session, question, session.dialect.evaluate(question.channel, "System.time"), limit)
        told = question.stamp / 1000 if session.dialect.has_short_numbers else question.result()
        session.set_offset(told, asked, time())

    def _begin_again(self, session: Session, stream: Stream, limit: float) -> None:
        """Begin a stream on a new connection; one that cannot begin tells it to its reader."""
        stream.begin_again()
        session.add_stream(stream)
        question = session.open_question()
        try:
            self._ask_now(session, question, stream.start_text(session.dialect, question.channel), limit)
        except (ConnectionLost, TimedOut):
            raise
        except ClientError as error:
            stream.failed = error

    def _ask_now(self, session: Session, question: Question, text: str, limit: float) -> None:
        """Ask while no other thread can.  Raises what ``ask`` raises."""
        self._send(text, limit)
        while not question.done:
            left = limit - monotonic()
            if left <= 0:
                raise TimedOut(f"{self.where} said nothing in time: is it busy, is it an urbiscript server?")
            data = self._receive(left)
            if data is not None:
                with self._turn:
                    self._feed(data)
        with self._turn:
            session.close_question(question)
        question.result()

    def close_reason(self) -> str | Denied:
        """Why the connection has ended: in words, or Denied if to try again would not help."""
        if self.fault:
            return self.fault
        lines = self._session.lines
        reason = explain_close(self.where, lines.last, lines.stamped, self._credentials.words)
        return reason if isinstance(reason, Denied) else str(reason or "it closed the connection")

    def _lose(self, reason: str) -> None:
        with self._turn:
            self._drop(reason)
            self._turn.notify_all()

    def _drop(self, reason: str | Denied) -> None:
        """The connection has ended; under the lock."""
        made, self._socket = self._socket, None
        if made is None:
            return
        try:
            made.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        if self._reading is not made:
            made.close()

        def error() -> ClientError:
            if isinstance(reason, Denied):
                return AccessDenied(str(reason))
            return ConnectionLost(f"{self.where}: {reason}")

        self._session.lose(error)
