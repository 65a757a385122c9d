"""The loop that serves one device to one peer; the kinds of transport are in `urbihw_fakes.endpoint`.

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
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from types import TracebackType
from typing import Self, TypeVar

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.errors import FakeError, UnknownRequest

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
        self._serving = threading.Event()
        self._wake_out, self._wake_in = os.pipe()
        os.set_blocking(self._wake_in, False)

    # --- what a kind of endpoint defines --------------------------------------------------------------------------

    @property
    @abstractmethod
    def url(self) -> str:
        """The url under which the daemon reaches the device."""

    @property
    @abstractmethod
    def plugged(self) -> bool:
        """True while the adapter is plugged in."""

    @abstractmethod
    def _plug(self) -> None: ...

    @abstractmethod
    def _unplug(self) -> None: ...

    @abstractmethod
    def _readers(self) -> list[int]:
        """File descriptors to watch."""

    @abstractmethod
    def _receive(self, ready: int) -> bytes:
        """Return the bytes of the peer from a ready descriptor; b"" for another event, such as a new connection."""

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Send bytes to the peer; they are lost when it does not read, as on a wire."""

    # --- for everybody --------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Serve in a thread of its own until `close`; it is serving when this returns."""
        self._thread = threading.Thread(target=self.serve, name="fake", daemon=True)
        self._thread.start()
        self._serving.wait(CALL_TIMEOUT)

    def stop(self) -> None:
        """Make `serve` return soon; may be called from any thread or signal handler."""
        self._stopping = True
        self._wake()

    def close(self) -> None:
        """Stop, and close all descriptors; calling it twice is allowed."""
        if self._closed:
            return
        self._closed = True
        self.stop()
        if self._thread is not None:
            self._thread.join(CALL_TIMEOUT)
        self._unplug()
        os.close(self._wake_in)
        os.close(self._wake_out)
        self._wake_in = -1  # a late `stop` must not write into somebody else's descriptor

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def unplug(self) -> None:
        """Unplug the adapter: the peer sees a hang-up; answers in transit are lost."""
        self.call(self._unplug_now)

    def plug(self) -> None:
        """Plug the adapter in again under the same url; the device kept running meanwhile."""
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
        """Stop watching a descriptor for events."""
        self._watched.pop(descriptor, None)

    # --- the loop -------------------------------------------------------------------------------------------------

    def serve(self) -> None:
        """Serve the device until `stop`."""
        self._server = threading.get_ident()
        self._serving.set()
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
        ready, _, _ = select.select(readers, [], [], self._select_timeout(now))
        for descriptor in ready:
            if descriptor == self._wake_out:
                os.read(self._wake_out, CHUNK)
                while self._calls:
                    self._calls.popleft()()
                # A call may have closed and opened descriptors: what `select` said is no longer true.
                return
            if descriptor in self._watched:
                self._watched[descriptor]()
                return
            data = self._receive(descriptor)
            if data:
                self._feed_device(data, self.clock())

    def _select_timeout(self, now: float) -> float | None:
        """Return the seconds until the next answer or tick is due; None for never."""
        due = self.device.due()
        if self._waiting and (due is None or self._waiting[0][0] < due):
            due = self._waiting[0][0]
        if self._linger and now - self._last_traffic < self._linger:
            return 0.0
        if due is None:
            return None
        return max(0.0, due - now - (NEAR if self._paced else 0.0))

    def _feed_device(self, data: bytes, now: float) -> None:
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

    def _unplug_now(self) -> None:
        self._waiting.clear()
        self._unplug()

    def _wake(self) -> None:
        try:
            os.write(self._wake_in, b"x")
        except OSError:
            # Full: it is about to wake up anyway. Closed: the other thread has ended.
            pass


def _sharpen_timers() -> None:
    """Set the timer slack of this thread to the minimum (the Linux default is 50 us); no effect on other systems."""
    try:
        with open(f"/proc/{threading.get_native_id()}/timerslack_ns", "w", encoding="ascii") as file:
            file.write("1")
    except OSError:
        pass
