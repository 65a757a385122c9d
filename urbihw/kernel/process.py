"""The process in which a kernel runs: signals, limits, files and ports, and the orderly shutdown.

There are three such processes: ``urbihw serve`` (a robot), ``urbi`` (a console and a port), and ``urbi-launch
--remote`` (devices that join another server).  Each uses the same sequence::

    process = KernelProcess()
    process.install_signals()
    try:
        kernel = process.boot(bounds())
        ...                                   # devices, start-up files
        process.bind("127.0.0.1", 54000)
        process.listen()
        process.write_port_file(Path("port"))
        await process.stopped                 # by a signal, or by stop()
    finally:
        await process.close()
        process.restore_signals()

Signal handlers are installed first: to create a kernel takes a good part of a second, and SIGTERM must work during it.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import stat
import threading
from collections.abc import Callable, Collection, Coroutine, Iterable, Sequence
from pathlib import Path
from ssl import SSLContext
from typing import Any, Final, TypeVar

from urbihw.kernel.facade import HostProcess, Kernel, Library
from urbihw.kernel.server.acceptor import bind, bind_unix, release_socket
from urbihw.kernel.server.bounds import NONE, Bounds
from urbihw.kernel.server.exit_watchdog import END_TIMEOUT_S, ExitWatchdog
from urbihw.kernel.server.handshake import HandshakeFactory, PlainHandshake
from urbihw.kernel.server.interrupt import Interrupter
from urbihw.kernel.server.log_tap import LogTap
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import MAX_CLIENTS, OpenLobby, Server

T = TypeVar("T")

END_SIGNALS: Final = (signal.SIGTERM, signal.SIGINT)
"""The signals that end the process.  With an interactive lobby, the first SIGINT only ends a program."""
UNREAD_LIMIT: Final = 8 * 1024 * 1024
"""Default maximum of unread output of a client, in bytes."""


def resolver(future: asyncio.Future[T]) -> Callable[[T], None]:
    """A function that gives a future its result; it does nothing when the future is done or cancelled."""

    def resolve(result: T) -> None:
        if not future.done():
            future.set_result(result)

    return resolve


class KernelProcess:
    """One kernel for the lifetime of its process.  Create it in the asyncio loop.

    Attributes:
        stopped: a future that is done when the process must end.
        port: the TCP port for clients; -1 for none.
        kernel, driver, interrupter: set by ``boot``.
        server: set by ``listen``.
    """

    kernel: Kernel
    interrupter: Interrupter

    def __init__(
        self,
        abandon: Callable[[], object] = lambda: None,
        *,
        fatal: Collection[int] = END_SIGNALS,
        second_is_fatal: bool = False,
    ) -> None:
        """``abandon`` is called in another thread when a program prevents an orderly shutdown.

        ``fatal`` are the signals after which this is checked.  ``second_is_fatal``: after a shutdown has begun, the
        next Ctrl-C ends the process at once.
        """
        self._loop = asyncio.get_running_loop()
        self._abandon = abandon
        self._fatal = fatal
        self._second_is_fatal = second_is_fatal
        self._former: dict[int, Any] = {}
        self._exit_watchdog: ExitWatchdog | None = None
        self._bound: list[socket.socket] = []
        self._bound_unix: list[socket.socket] = []
        self._port_file: Path | None = None
        self._log_tap: LogTap | None = None
        self.stopped: asyncio.Future[None] = self._loop.create_future()
        self.driver: LoopDriver | None = None
        self.server: Server | None = None
        self.port = -1

    def stop(self) -> None:
        """Begin an orderly shutdown; call this in the thread of the loop.  A second call does nothing."""
        if not self.stopped.done():
            self.stopped.set_result(None)

    async def run_until_stopped(self, work: Coroutine[Any, Any, T]) -> T | None:
        """Run a coroutine and return its result.  If the process must end meanwhile, cancel it and return None."""
        task = asyncio.ensure_future(work)
        await asyncio.wait((task, self.stopped), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            return task.result()
        task.cancel()
        await asyncio.wait((task,))
        if not task.cancelled():
            task.exception()  # no caller waits for its result any more
        return None

    # ---------------------------------------------------------------- signals

    def install_signals(self) -> None:
        """Make SIGTERM and SIGINT begin an orderly shutdown.  Outside the main thread this does nothing."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in END_SIGNALS:
            # Not with the loop's handler: a signal that arrives while the kernel is created would be lost if that
            # handler is replaced before the loop runs again.
            self._former[number] = signal.signal(number, self._stop_from_signal)

    def _stop_from_signal(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self.stop)

    def _interrupt_programs(self) -> None:
        """Make a signal end the process even while a job never yields, which the loop would not notice."""
        for number in self._former:
            signal.signal(number, self.interrupter)
        if self._former:
            self._exit_watchdog = ExitWatchdog(self._fatal, self._abandon_all)
            self._exit_watchdog.install()

    def _abandon_all(self) -> None:
        """Called in another thread when a program prevents an orderly shutdown."""
        self._abandon()
        self._remove_port_file()

    def extend_deadline(self, seconds: float = END_TIMEOUT_S) -> None:
        """The shutdown is making progress: let it take so many seconds from now."""
        if self._exit_watchdog is not None:
            self._exit_watchdog.extend_deadline(seconds)

    def restore_signals(self) -> None:
        """Restore the former signal handlers after the shutdown.  A second call does nothing."""
        for number, handler in self._former.items():
            signal.signal(number, handler)
        self._former.clear()
        if self._exit_watchdog is not None:
            self._exit_watchdog.uninstall()
            self._exit_watchdog = None

    # ---------------------------------------------------------------- kernel and programs

    def boot(
        self,
        limits: Bounds = NONE,
        *,
        fast: bool = False,
        led: bool = False,
        name: str = "urbi",
        arguments: Sequence[str] = (),
        reboot: Callable[[], None] | None = None,
        libraries: Sequence[Library] = (),
    ) -> Kernel:
        """Create the kernel and its driver; with ``fast`` it runs in simulated time, with ``led`` in that of the robot,
        which is a simulation (``LedClock``).

        ``name`` and ``arguments`` are those of the process for its programs; ``reboot`` begins a shutdown after which
        the process restarts, None if it cannot.  ``libraries`` are loaded after the standard library.
        """
        host_process = HostProcess(name, arguments, self.stop, reboot)
        self.kernel = Kernel(fast=fast, led=led, process=host_process, libraries=libraries)
        self.driver = LoopDriver(self.kernel.scheduler, limits)
        self.interrupter = Interrupter(self.kernel.scheduler, self.stop, second_is_fatal=self._second_is_fatal)
        self._log_tap = LogTap(self.kernel.post, self.kernel.programs.log.add)
        self._log_tap.attach()
        self._interrupt_programs()
        return self.kernel

    def drive(self) -> None:
        """Run all ready jobs."""
        assert self.driver is not None
        self.driver.drive()

    def set_hold_limit(self, seconds: float) -> None:
        """Bound the processor time for which a job may hold the interpreter from now on; 0: no limit."""
        assert self.driver is not None
        self.driver.set_hold_limit(seconds)

    def load_modules(self, names: Iterable[str]) -> None:
        """Load modules of UObjects.  Raises BadConfig."""
        for name in names:
            self.kernel.host.load_module(name)

    async def run_text(self, text: str, name: str) -> str:
        """Run urbiscript in Global until it has ended.  Returns the first error as one line with ``name``, or ""."""
        done: asyncio.Future[str] = self._loop.create_future()
        self.kernel.host.run(text, name, resolver(done))
        self.drive()
        return await done

    @property
    def exit_status(self) -> int | None:
        """The exit code that a program has requested; None if none has."""
        return None if self.driver is None else self.kernel.programs.exit_status

    # ---------------------------------------------------------------- ports

    def bind(self, host: str, port: int) -> list[str]:
        """Bind a port (0: any free one) on all addresses of a host.  Returns these addresses.

        No client can connect before ``listen``.  Raises OSError, and UnicodeError for an impossible host name.
        """
        self._bound = bind(host, port)
        return [str(one.getsockname()[0]) for one in self._bound]

    def adopt(self, sockets: Sequence[socket.socket]) -> list[str]:
        """Take sockets of the service manager, on one port, instead of binding.  Returns their addresses."""
        self._bound = list(sockets)
        return [str(one.getsockname()[0]) for one in self._bound]

    def bind_unix(self, path: Path) -> None:
        """Bind the path of a UNIX socket for clients.  Raises OSError."""
        self._bound_unix.append(bind_unix(path))

    @property
    def bound_port(self) -> int:
        """The port of the sockets of ``bind`` or ``adopt``."""
        return int(self._bound[0].getsockname()[1])

    def listen(
        self,
        handshake: HandshakeFactory = PlainHandshake,
        ssl: SSLContext | None = None,
        *,
        open_lobby: OpenLobby | None = None,
        unread_limit: int = UNREAD_LIMIT,
        max_clients: int = MAX_CLIENTS,
    ) -> None:
        """Listen on the sockets of ``bind`` (or ``adopt``) and ``bind_unix``; ``handshake`` and ``ssl`` are for TCP.

        ``open_lobby`` opens the lobbies of the clients (``Kernel.open_lobby``).  Raises OSError.
        """
        assert self.driver is not None
        port, bound, bound_unix = self.bound_port, self._bound, self._bound_unix
        self._bound = []
        self.server = Server(self.driver, open_lobby or self.kernel.open_lobby, unread_limit, max_clients)
        self.server.listen_on(bound, handshake, ssl)
        self._bound_unix = []
        self.server.listen_on(bound_unix)
        self.port = self.kernel.programs.listen_port = port

    def write_port_file(self, path: Path) -> None:
        """Write the port to a file, which is removed when the process ends.  Raises OSError.

        A file that was not there comes with its content: who waits for it never reads an empty one.
        """
        written = path if path.exists() else path.with_name(f".{path.name}.new")
        written.write_text(f"{self.port}\n", "ascii")
        if written != path:
            written.replace(path)
        self._port_file = path

    def _remove_port_file(self) -> None:
        """Remove the port file, unless it is a device or another server has written its port there meanwhile."""
        path, self._port_file = self._port_file, None
        with contextlib.suppress(OSError):
            if path is not None and stat.S_ISREG(path.lstat().st_mode) and path.read_text("ascii") == f"{self.port}\n":
                path.unlink()

    # ---------------------------------------------------------------- the end

    async def close(self) -> None:
        """Send the remaining output, disconnect the clients, and free everything.  A second call does nothing."""
        self.extend_deadline()
        if self._log_tap is not None:
            self._log_tap.detach()
        if self.server is not None:
            await self.server.close()
        for one in (*self._bound, *self._bound_unix):
            release_socket(one)
        if self.driver is not None:
            self.driver.close()
        self._remove_port_file()
