"""Serving a device: on a pseudo terminal, on a TCP port, or in memory.

    with PtyEndpoint(Bioloid()) as end:      # end.url is "serial:///tmp/fake-4242-7"
        end.start()                          # a thread of its own; or end.serve() to stay here until stop()
        end.unplug(); end.plug()             # the adapter goes, and comes back under the same path

    end = MemoryEndpoint(Bioloid(), SteppedClock())
    end.write(request); answer = end.read(6, timeout=0.01)

One loop in one thread owns a served device: it blocks in `select` until bytes come or the next answer is due. Other
threads go through `call`. With `pace` (bits per second) every byte takes its time on the wire, in both directions, and
an answer is handed over when its last byte would have arrived. A sleeping thread wakes up late (by 0.05 to 0.1 ms
where this was measured), so with pacing the last `NEAR` seconds before a delivery are spent looking at the clock; the
request is noticed that late all the same. A bench that must not count this against the driver asks for `spin`: then the
loop does not sleep at all until `LINGER` seconds after the last traffic, and takes a whole core while there is some.
"""

from __future__ import annotations

import os
import select
import socket
import termios
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from types import TracebackType
from typing import Protocol, Self, TypeVar

from fakes.device import Answer, Device
from fakes.errors import AdapterGone, FakeError, UnknownRequest

T = TypeVar("T")

CHUNK = 65536
CALL_TIMEOUT = 5.0  # s to wait for the serving thread
NEAR = 1e-4  # s before a delivery in which a paced loop does not sleep
LINGER = 2e-3  # s after the last traffic in which a spinning loop does not sleep


class Endpoint(ABC):
    """Serves one device to one peer at a time.

    `pace` is the speed of the wire in bits per second, None for no delays at all; `spin` (only with `pace`): see the
    head of this file. `clock` gives seconds.

    Raises:
        UnknownRequest: `spin` without `pace`.
    """

    def __init__(
        self,
        device: Device,
        *,
        pace: int | None = None,
        spin: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if spin and pace is None:
            raise UnknownRequest("spin: only for a paced wire; give pace (bits per second) too")
        self.device = device
        self.clock = clock
        if pace is not None:
            device.pace(pace)
        self._paced = pace is not None
        self._linger = LINGER if spin else 0.0
        self._last_traffic = 0.0
        self._waiting: list[tuple[float, int, bytes]] = []  # answers to deliver, soonest first
        self._order = 0
        self._wire_free = 0.0
        self._calls: deque[Callable[[], None]] = deque()
        self._watched: dict[int, Callable[[], None]] = {}
        self._stopping = False
        self._closed = False
        self._thread: threading.Thread | None = None
        self._server: int | None = None  # the thread that runs `serve`
        self._wake_out, self._wake_in = os.pipe()
        os.set_blocking(self._wake_in, False)

    # --- what a kind of endpoint defines --------------------------------------------------------------------------

    @property
    @abstractmethod
    def url(self) -> str:
        """What to give the gateway to reach the device."""

    @property
    @abstractmethod
    def plugged(self) -> bool:
        """True while the adapter is there."""

    @abstractmethod
    def _plug(self) -> None: ...

    @abstractmethod
    def _unplug(self) -> None: ...

    @abstractmethod
    def _readers(self) -> list[int]:
        """File descriptors to watch."""

    @abstractmethod
    def _receive(self, ready: int) -> bytes:
        """Bytes of the peer from a descriptor that is ready; none when there was something else to do."""

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Hand bytes to the peer, or lose them when nobody takes them, as a wire does."""

    # --- for everybody --------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Serve in a thread of its own until `close`."""
        self._thread = threading.Thread(target=self.serve, name="fake", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Make `serve` return soon; from any thread or signal handler."""
        self._stopping = True
        self._wake()

    def close(self) -> None:
        """Stop, and let go of everything; a second time does nothing."""
        if self._closed:
            return
        self._closed = True
        self.stop()
        if self._thread is not None:
            self._thread.join(CALL_TIMEOUT)
        self._unplug()
        os.close(self._wake_in)
        os.close(self._wake_out)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def unplug(self) -> None:
        """Take the adapter away: the peer sees a hang-up; answers on their way are lost."""
        self.call(self._take_away)

    def plug(self) -> None:
        """Bring the adapter back under the same url; the device went on living."""
        self.call(lambda: None if self.plugged else self._plug())

    def call(self, function: Callable[[], T]) -> T:
        """Run `function` between two requests, in the serving thread if there is one, and return its result.

        Raises:
            FakeError: the serving thread did not get to it within 5 s.
        """
        if self._server in (None, threading.get_ident()):
            return function()
        done = threading.Event()
        results: list[T] = []
        errors: list[Exception] = []

        def run() -> None:
            try:
                results.append(function())
            except Exception as error:
                errors.append(error)
            done.set()

        self._calls.append(run)
        self._wake()
        if not done.wait(CALL_TIMEOUT):
            raise FakeError(f"{self.url}: the serving thread is stuck or has stopped")
        if errors:
            raise errors[0]
        return results[0]

    def watch(self, descriptor: int, ready: Callable[[], None]) -> None:
        """Call `ready` from the serving thread whenever `descriptor` can be read; before `serve` or from within."""
        self._watched[descriptor] = ready

    def unwatch(self, descriptor: int) -> None:
        """Stop watching it."""
        self._watched.pop(descriptor, None)

    # --- the loop -------------------------------------------------------------------------------------------------

    def serve(self) -> None:
        """Answer until `stop`."""
        self._server = threading.get_ident()
        if self._paced:
            _sharpen_timers()
        try:
            while not self._stopping:
                self._round()
        finally:
            self._server = None
            for run in tuple(self._calls):
                run()

    def _round(self) -> None:
        """Deliver what is due, then wait for bytes or for the next answer."""
        now = self.clock()
        self._deliver(now)
        readers = [self._wake_out, *self._watched, *self._readers()]
        ready, _, _ = select.select(readers, [], [], self._patience(now))
        for descriptor in ready:
            if descriptor == self._wake_out:
                os.read(self._wake_out, CHUNK)
                while self._calls:
                    self._calls.popleft()()
            elif descriptor in self._watched:
                self._watched[descriptor]()
            elif descriptor in self._readers():
                data = self._receive(descriptor)
                if data:
                    self._take(data, self.clock())

    def _patience(self, now: float) -> float | None:
        """Seconds until there is something to do unasked; None for never."""
        due = self.device.due()
        if self._waiting and (due is None or self._waiting[0][0] < due):
            due = self._waiting[0][0]
        if self._linger and now - self._last_traffic < self._linger:
            return 0.0
        if due is None:
            return None
        return max(0.0, due - now - (NEAR if self._paced else 0.0))

    def _take(self, data: bytes, now: float) -> None:
        """Feed the device; with pacing, at the time when the last byte would be off the wire."""
        arrived = self._last_traffic = now
        if self._paced:
            arrived = max(now, self._wire_free) + len(data) * self.device.byte_time
            self._wire_free = arrived
        self._queue(self.device.feed(data, arrived))
        if not self._paced:
            self._deliver(now)

    def _queue(self, answers: list[Answer]) -> None:
        for answer in answers:
            self._order += 1
            heappush(self._waiting, (answer.at, self._order, answer.data))
            if answer.at > self._wire_free:
                self._wire_free = answer.at

    def _deliver(self, now: float) -> None:
        due = self.device.due()
        if due is not None and due <= now:
            self._queue(self.device.tick(now))
        data = b""
        while self._waiting and self._waiting[0][0] <= now:
            data += heappop(self._waiting)[2]
        if data and self.plugged:
            self._last_traffic = now
            self._send(data)

    def _take_away(self) -> None:
        self._waiting.clear()
        self._unplug()

    def _wake(self) -> None:
        try:
            os.write(self._wake_in, b"x")
        except (BlockingIOError, OSError):
            # Full: it is about to wake up anyway. Closed: there is nobody to wake.
            pass


class PtyEndpoint(Endpoint):
    """A device behind a pseudo terminal, which any serial library opens like a USB adapter.

    `path` is a symbolic link to it, created here and again at every `plug`, so that the name stays; without one a name
    in the temporary folder is made. Any speed will do, unless `follow_baud`: then the units hear only the speed that
    the peer has set on the terminal (standard speeds only; others count as any).
    """

    def __init__(
        self,
        device: Device,
        path: str | None = None,
        *,
        pace: int | None = None,
        spin: bool = False,
        follow_baud: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(device, pace=pace, spin=spin, clock=clock)
        self._ours = -1
        self._theirs = -1
        self._follow = follow_baud
        self.path = path or ""
        self._plug()

    @property
    def url(self) -> str:
        """`serial://` and the path."""
        return f"serial://{self.path}"

    @property
    def plugged(self) -> bool:
        """True while the terminal is there."""
        return self._ours >= 0

    def _plug(self) -> None:
        self._ours, self._theirs = os.openpty()
        # Raw before anybody opens it: a terminal that echoes would talk to the device by itself. We keep the far end
        # open, so that a peer may come and go without the terminal hanging up.
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        name = os.ttyname(self._theirs)
        if not self.path:
            folder = os.environ.get("TMPDIR", "/tmp")
            self.path = f"{folder}/fake-{os.getpid()}-{os.path.basename(name)}"
        if os.path.lexists(self.path) and not os.path.islink(self.path):
            self._hang_up()
            raise FakeError(f"{self.path}: there is a file already; give a path that is free")
        fresh = f"{self.path}.{os.getpid()}"
        os.symlink(name, fresh)
        os.replace(fresh, self.path)

    def _unplug(self) -> None:
        if self.plugged:
            self._hang_up()
            if os.path.islink(self.path):
                os.unlink(self.path)

    def _hang_up(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)
        self._ours = self._theirs = -1

    def _readers(self) -> list[int]:
        return [self._ours] if self._ours >= 0 else []

    def _receive(self, ready: int) -> bytes:
        if self._follow:
            speed = termios.tcgetattr(self._theirs)[5]
            self.device.baud = _speeds().get(speed)
        try:
            return os.read(ready, CHUNK)
        except BlockingIOError:
            return b""

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._ours, data)
        except BlockingIOError:
            # Nobody reads and the buffer of the terminal is full: lost, as on a wire.
            pass


class TcpEndpoint(Endpoint):
    """A device behind a TCP port of this machine, as a serial server would show it; port 0 takes a free one."""

    def __init__(
        self,
        device: Device,
        port: int = 0,
        *,
        pace: int | None = None,
        spin: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(device, pace=pace, spin=spin, clock=clock)
        self.port = port
        self._listener: socket.socket | None = None
        self._peer: socket.socket | None = None
        self._plug()

    @property
    def url(self) -> str:
        """`socket://127.0.0.1:` and the port."""
        return f"socket://127.0.0.1:{self.port}"

    @property
    def plugged(self) -> bool:
        """True while the port is open."""
        return self._listener is not None

    def _plug(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port), backlog=1)
        self.port = self._listener.getsockname()[1]

    def _unplug(self) -> None:
        self._drop_peer()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def _drop_peer(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None

    def _readers(self) -> list[int]:
        # One peer at a time: the next waits in the backlog, as a serial port has one user.
        if self._peer is not None:
            return [self._peer.fileno()]
        return [self._listener.fileno()] if self._listener is not None else []

    def _receive(self, ready: int) -> bytes:
        if self._peer is None:
            if self._listener is not None:
                self._peer, _ = self._listener.accept()
                self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._peer.recv(CHUNK)
        except OSError:
            data = b""
        if not data:
            self._drop_peer()
        return data

    def _send(self, data: bytes) -> None:
        if self._peer is not None:
            try:
                self._peer.sendall(data, socket.MSG_DONTWAIT)
            except OSError:
                # Gone, or it does not read: lost, as on a wire.
                pass


class Clock(Protocol):
    """What an in-memory endpoint needs of a clock, real or simulated."""

    def now(self) -> float:
        """Seconds."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""


class SteppedClock:
    """A clock that stands still until somebody sleeps on it."""

    def __init__(self, now: float = 0.0) -> None:
        self._now = now

    def now(self) -> float:
        """Seconds."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Let this many seconds pass at once."""
        self._now += max(0.0, seconds)


class MemoryEndpoint:
    """A device without any operating system in between; waiting is `clock.sleep`, so a stepped clock never waits."""

    def __init__(self, device: Device, clock: Clock, *, pace: int | None = None) -> None:
        self.device = device
        self.clock = clock
        self.plugged = True
        if pace is not None:
            device.pace(pace)
        self._waiting: list[tuple[float, int, bytes]] = []
        self._order = 0
        self._wire_free = 0.0
        self._buffer = b""

    def unplug(self) -> None:
        """Take the adapter away: `write` and `read` raise until `plug`; what was under way is lost."""
        self.plugged = False
        self._waiting.clear()
        self._buffer = b""

    def plug(self) -> None:
        """Bring the adapter back."""
        self.plugged = True

    def write(self, data: bytes) -> None:
        """Send bytes to the device.

        Raises:
            AdapterGone: it is unplugged.
        """
        self._check()
        now = max(self.clock.now(), self._wire_free if self.device.byte_time else 0.0)
        arrived = now + len(data) * self.device.byte_time
        self._wire_free = max(arrived, self._wire_free)
        self._queue(self.device.feed(data, arrived))

    def read(self, count: int, timeout: float = 0.0) -> bytes:
        """Up to `count` bytes; fewer when no more come within `timeout` seconds.

        Raises:
            AdapterGone: it is unplugged.
        """
        self._check()
        deadline = self.clock.now() + timeout
        self._collect()
        while len(self._buffer) < count:
            due = self.device.due()
            coming = [due] if due is not None else []
            if self._waiting:
                coming.append(self._waiting[0][0])
            now = self.clock.now()
            if not coming or min(coming) > deadline:
                self.clock.sleep(deadline - now)
                break
            self.clock.sleep(max(0.0, min(coming) - now))
            self._collect()
        data, self._buffer = self._buffer[:count], self._buffer[count:]
        return data

    def _collect(self) -> None:
        now = self.clock.now() + 1e-9
        due = self.device.due()
        if due is not None and due <= now:
            self._queue(self.device.tick(now))
        while self._waiting and self._waiting[0][0] <= now:
            self._buffer += heappop(self._waiting)[2]

    def _queue(self, answers: list[Answer]) -> None:
        for answer in answers:
            self._order += 1
            heappush(self._waiting, (answer.at, self._order, answer.data))
            self._wire_free = max(self._wire_free, answer.at)

    def _check(self) -> None:
        if not self.plugged:
            raise AdapterGone("the adapter is unplugged")


def _speeds() -> dict[int, int]:
    """Terminal speed codes -> bits per second."""
    names = (name for name in dir(termios) if name[0] == "B" and name[1:].isdigit())
    return {getattr(termios, name): int(name[1:]) for name in names}


def _sharpen_timers() -> None:
    """Ask the kernel not to stretch this thread's sleeps by its usual 50 us; only Linux has it, others stay as is."""
    try:
        with open(f"/proc/{threading.get_native_id()}/timerslack_ns", "w", encoding="ascii") as file:
            file.write("1")
    except OSError:
        pass
