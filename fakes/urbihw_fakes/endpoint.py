"""The ways to reach a device: a pseudo terminal, a TCP port, or memory.

    with PtyEndpoint(Bioloid()) as end:      # end.url is "serial:///tmp/fake-4242-7"
        end.start()                          # a thread of its own; or end.serve() to stay here until stop()
        end.unplug(); end.plug()             # the adapter goes, and comes back under the same path

    end = MemoryEndpoint(Bioloid(), SteppedClock())
    end.write(request); answer = end.read(6, timeout=0.01)

How the first two are served, and what `pace` and `spin` mean: `urbihw_fakes.serving`.
"""

from __future__ import annotations

import fcntl
import os
import socket
import struct
import time
import tty
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Protocol

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.errors import AdapterGone, FakeError
from urbihw_fakes.serving import CHUNK, Endpoint

_TCGETS2 = 0x802C542A  # asm-generic/ioctls.h: the same on x86 and ARM
_TERMIOS2 = struct.Struct("4I20s2I")  # four flags, line discipline and control characters, input and output speed


class PtyEndpoint(Endpoint):
    """A device behind a pseudo terminal, which any serial library opens like a USB adapter.

    `path` is a symbolic link to it, created here and again at every `plug`, so that the name stays; without one a name
    in the temporary folder is made. Any speed will do, unless `follow_baud`: then the units hear only the speed that
    the peer has set on the terminal.
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
        """True while the terminal is open."""
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
            self.device.baud = _speed_of(self._theirs)
        try:
            return os.read(ready, CHUNK)
        except BlockingIOError:
            return b""

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._ours, data)
        except BlockingIOError:
            # There is no reader, and the buffer of the terminal is full: lost, as on a wire.
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
    """The clock interface of an in-memory endpoint, real or simulated."""

    def now(self) -> float:
        """The time in seconds on a steady scale."""

    def sleep(self, seconds: float) -> None:
        """Advance by a number of seconds."""


class SteppedClock:
    """A clock that advances only by `sleep`."""

    def __init__(self, now: float = 0.0) -> None:
        self._now = now

    def now(self) -> float:
        """The time in seconds, which moves by steps only."""
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
        """Unplug the adapter: `write` and `read` raise until `plug`; bytes in transit are lost."""
        self.plugged = False
        self._waiting.clear()
        self._buffer = b""

    def plug(self) -> None:
        """Plug the adapter in again."""
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


def _speed_of(terminal: int) -> int | None:
    """Return the output speed of a terminal in bits per second; None if the system does not tell it.

    `tcgetattr` knows standard speeds only; `struct termios2` of Linux has any speed as a number.
    """
    try:
        settings = fcntl.ioctl(terminal, _TCGETS2, bytes(_TERMIOS2.size))
    except OSError:
        return None
    return int(_TERMIOS2.unpack(settings)[-1])
