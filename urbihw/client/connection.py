"""A blocking connection of the client library, for any number of threads: it does the steps of ``core`` with a socket.

It has no thread of its own, unless it keeps a lease: a thread that waits for an answer reads the socket, also for the
others; the others wait until their answer has come or the reader leaves.  So a command costs no more than the way to
the server and back, and nothing is left behind when a program ends or is interrupted: Ctrl-C ends the waiting of the
main thread only (``interrupts``).
"""

from __future__ import annotations

import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from time import monotonic, sleep
from typing import Concatenate, Final, ParamSpec
from weakref import ref

from urbihw.client.connect import ClientSocket, connect, has_unread
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
    Step,
    Steps,
    Wait,
)
from urbihw.client.credentials import Credentials
from urbihw.client.errors import ClientError, ConnectionLost, TimedOut
from urbihw.client.interrupts import DEFERRAL
from urbihw.client.lines import Line
from urbihw.client.session import OnLine
from urbihw.client.streams import Stream
from urbihw.client.where import Where

P = ParamSpec("P")
CHUNK: Final = 64 * 1024
"""Bytes read at once.  Above 128 KiB each reading maps and unmaps memory, which costs 0.05 ms."""
MAX_CHUNKS: Final = 64
"""Maximum number of pieces that are read before an item is handed out: a server may send faster than they are read."""
SEND_TIMEOUT_S: Final = 10.0
"""Maximum seconds for the server to accept data."""
MAX_FEED_PAUSE_S: Final = 1.0
"""Maximum seconds between two signs of life, so that the thread of a long lease ends soon after it."""
SHORTEST_SEND_S: Final = 0.01
"""Seconds that a statement has to be sent, also when less is left of its timeout."""


def _blocking(command: Callable[Concatenate[ClientCore, P], Steps[R]]) -> Callable[Concatenate[Connection, P], R]:
    """The method that does the steps of a command."""
    def method(self: Connection, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return self.run(command(self.core, *args, **kwargs))

    return method


class Connection(CoreOwner):
    """Connected when made.  Raises CannotConnect, AccessDenied or TimedOut."""

    def __init__(
        self,
        where: Where,
        credentials: Credentials,
        timeout: float,
        reconnect: bool,
        on_line: OnLine,
        asks_first: bool = True,
        lease: float = 0.0,
    ) -> None:
        """The arguments are those of ``ClientCore``."""
        self._on_line = on_line
        self._lines: deque[tuple[Line, float]] = deque()
        """Lines of the data that was read last: they are handed out at once."""
        self._turn = threading.Condition(threading.Lock())
        """Held while the core runs."""
        self._sending = threading.Lock()
        self._led = False
        """Whether a thread reads the socket."""
        self._socket: ClientSocket | None = None
        self._reading: ClientSocket | None = None
        """The socket from which a thread reads, who then closes it."""
        self._poll = select.poll()
        def keep(line: Line, at: float) -> None:
            self._lines.append((line, at))

        self.core = ClientCore(where, credentials, timeout, reconnect, keep, self._hang_up, asks_first, lease=lease)
        self.run(self.core.connect(monotonic() + timeout))
        for term in self.core.leases:
            self.feed_lease(term)

    # Commands, also from several threads at once: what is asked for, returned and raised stands in ``ClientCore``.
    ask = _blocking(ClientCore.ask)
    wait = _blocking(ClientCore.wait)
    open_stream = _blocking(ClientCore.open_stream)
    close_stream = _blocking(ClientCore.close_stream)
    next_item = _blocking(ClientCore.next_item)
    begin_lease = _blocking(ClientCore.begin_lease)
    end_lease = _blocking(ClientCore.end_lease)

    def feed_lease(self, term: LeaseTerm) -> None:
        """Give the signs of life of a lease, in a thread of their own, until it ends; none if the program does."""
        if term.fed:
            threading.Thread(target=_feed_lease, args=(ref(self), term), name="urbihw-lease", daemon=True).start()

    def sign_of_life(self) -> None:
        """Send what keeps a lease.  Raises ConnectionLost if the server does not read."""
        self.send(KEEP_ALIVE)

    def forget_stream(self, stream: Stream) -> None:
        """End a stream that nothing reads any more; the collector may call it anywhere."""
        self.core.forget_stream(stream)

    def send(self, text: str) -> None:
        """Send a text, a character for each byte.  Does nothing without a connection; raises ConnectionLost if the
        server does not read."""
        with DEFERRAL:
            self._send(text, None)

    def close(self) -> None:
        """Close the connection, also from another thread; what waits ends with ConnectionLost."""
        with DEFERRAL, self._turn:
            self.core.close()
            self._turn.notify_all()

    # ---------------------------------------------------------------- steps

    def run(self, steps: Steps[R]) -> R:
        """Do the steps of a command, and return its result; an interrupt ends it only where it waits."""
        with DEFERRAL, self._turn:
            try:
                step = next(steps)
                while True:
                    try:
                        self._do(step)
                    except BaseException as error:
                        step = steps.throw(error)
                    else:
                        step = next(steps)
            except StopIteration as end:
                result: R = end.value
                return result
            finally:
                self._turn.notify_all()

    def _do(self, step: Step) -> None:
        """Do a step; under the lock, which is free meanwhile."""
        if isinstance(step, Wait):
            self._wait(step.ready, step.limit)
        elif isinstance(step, Send):
            self._turn.release()
            try:
                self._send(step.text, step.limit)
            finally:
                self._turn.acquire()
        elif isinstance(step, Drain):
            self._drain()
        elif isinstance(step, Dial):
            self._dial(step.timeout)
        else:
            self._unlocked(lambda: _rest(step))

    def _unlocked(self, action: Callable[[], R]) -> R:
        self._turn.release()
        try:
            return action()
        finally:
            self._turn.acquire()

    def _wait(self, ready: Callable[[], bool], limit: float | None) -> None:
        """Return when ``ready()``, or at the limit."""
        if ready():
            return
        self._turn.notify_all()  # what others wait for may have changed since the last step
        while not ready():
            left = None if limit is None else limit - monotonic()
            if left is not None and left <= 0:
                return
            if self._led or self._socket is None:
                with DEFERRAL.waiting:
                    self._turn.wait(left)
            else:
                self._read(left)

    def _drain(self) -> None:
        """Read without waiting, unless another thread reads."""
        for _ in range(MAX_CHUNKS):
            if self._led or self._socket is None or not self._read(0):
                return

    def _read(self, timeout: float | None) -> bool:
        """Read once, also for other threads; whether something has come within so many seconds."""
        session, made = self.core.session, self._socket
        assert made is not None
        self._led, self._reading = True, made
        self._turn.release()
        try:
            data = self._receive(made, timeout)
        finally:
            self._turn.acquire()
            self._led, self._reading = False, None
            if self._socket is not made:  # it was lost meanwhile, and left to this thread to be closed
                made.close()
            self._turn.notify_all()
        if data is None:
            return False
        self.core.feed(session, data)
        while self._lines:
            line, stamp = self._lines.popleft()
            self._turn.release()
            try:
                with DEFERRAL.waiting:
                    self._on_line(line, stamp)
            finally:
                self._turn.acquire()
        return True

    def _receive(self, made: ClientSocket, timeout: float | None) -> bytes | None:
        """What has come within so many seconds; None for nothing, b"" for the end."""
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

    def _send(self, text: str, limit: float | None) -> None:
        """Send a text until the limit.  A part of one cannot be taken back, so the connection ends then."""
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
            with self._turn:
                self.core.lose("it does not read what it is sent")
                self._turn.notify_all()
            raise ConnectionLost(f"{self.where}: {self.core.fault}") from None
        except OSError:
            pass  # the reader learns the reason
        finally:
            self._sending.release()

    def _dial(self, timeout: float) -> None:
        def dial() -> ClientSocket:
            with DEFERRAL.waiting:
                return connect(self.core.where, self.core.credentials, timeout)

        made = self._unlocked(dial)
        made.settimeout(SEND_TIMEOUT_S)
        self._poll = select.poll()
        self._poll.register(made.fileno(), select.POLLIN)
        self._socket = made
        self.core.connected = True

    def _hang_up(self) -> None:
        """Close the socket; under the lock."""
        made, self._socket = self._socket, None
        if made is None:
            return
        try:
            made.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        if self._reading is not made:
            made.close()


def _feed_lease(reference: ref[Connection], term: LeaseTerm) -> None:
    """Send an empty line now and then, until the lease ends, or the program closes or forgets the connection."""
    while True:
        sleep(min(term.pause, MAX_FEED_PAUSE_S))
        connection = reference()
        if connection is None or connection.core.closed or term not in connection.core.leases:
            return
        if connection.core.is_fed(term):
            with suppress(ClientError):  # the next command tells it
                connection.sign_of_life()
        del connection


def _rest(pause: Pause) -> None:
    with DEFERRAL.waiting:
        threading.Event().wait(pause.seconds)
