"""One daemon: a kernel, a robot, a port.  Start, reload, stop.

Order of a start: port free? robot's library, robot found, its slots filled, the user's files, and only then clients.
Everything that is wrong by then ends the start with a ``StartError``: one line, and exit code 78.  Afterwards nothing
about the robot ends the daemon.

Order of a stop: the robot (its effectors stop within the second), the clients (told, then disconnected), the rest.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from urbihw import platforms
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import Url
from urbihw.daemon.config import Config
from urbihw.daemon.fake import Fake
from urbihw.daemon.files import read_regular
from urbihw.daemon.holders import holder_of_file, holder_of_port
from urbihw.daemon.notify import Notifier
from urbihw.daemon.reload import Reloader, waiting
from urbihw.daemon.runtime import client_path, control_path
from urbihw.daemon.wayin import WayIn, way_in
from urbihw.kernel import Kernel
from urbihw.kernel.server.bounds import bounds
from urbihw.kernel.server.doors import bind, bind_unix, let_go
from urbihw.kernel.server.ending import PATIENCE, LastResort
from urbihw.kernel.server.interrupt import Interrupter
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.server.tcp import Server
from urbihw.kernel.uobject import BadConfig, DeviceError, Robot, RobotSettings
from urbihw.kernel.uobject.owed import owe_robot
from urbihw.platforms import Manifest

log = logging.getLogger("urbihw.daemon")

OPEN_PATIENCE = 15.0
"""Seconds that a robot may take to be found; a scan of two protocols with a slow adapter takes a few."""
STATUS_PERIOD = 1.0
LONGEST_PROGRAM = 16 * 1024 * 1024
"""Bytes of a file of ``load``."""
LONGEST_SOCKET = 107
"""Bytes of the path of a UNIX socket (``man 7 unix``)."""
ENDING = (signal.SIGTERM, signal.SIGINT)
"""The signals that end the service."""
STOPPING = 10.0
"""Seconds that the robot may take to stop and be let go of; one whose bus worker hangs is stopped by another one."""


class StartError(Exception):
    """The daemon cannot serve as it is set up; the message is one line that says what to do."""


class Service:
    """``await Service(config).run()`` serves until SIGTERM, SIGINT or ``stop()``; the result is the exit code."""

    def __init__(
        self, config: Config, notifier: Notifier | None = None, reread: Callable[[], Config] | None = None
    ) -> None:
        """``notifier`` tells the service manager; ``reread`` gives the settings anew, for SIGHUP."""
        self._config = config
        self._notifier = notifier if notifier is not None else Notifier()
        self._reread = reread
        self._stop = asyncio.Event()
        self._kernel: Kernel
        self._driver: Driver | None = None
        self._server: Server | None = None
        self._robot: Robot | None = None
        self._robot_url = ""
        self._fake: Fake | None = None
        self._bound: list[socket.socket] = []
        self._bound_unix: list[socket.socket] = []
        self._way_in = WayIn()
        self._port = -1
        self._last_resort: LastResort | None = None
        self._reloader: Reloader

    async def run(self) -> int:
        """Serve.  Raises StartError when it cannot begin."""
        loop = asyncio.get_running_loop()
        former = {number: signal.getsignal(number) for number in ENDING}
        for number in ENDING:
            # Not by the loop: a signal that comes while the kernel is made would be forgotten with the loop's handler,
            # when that is replaced before the loop has had its turn.
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(self.stop))
        self._reloader = Reloader(self._read_again)
        loop.add_signal_handler(signal.SIGHUP, self._reloader.ask)
        try:
            starting = asyncio.ensure_future(self._start())
            stopping = asyncio.ensure_future(self._stop.wait())
            await asyncio.wait((starting, stopping), return_when=asyncio.FIRST_COMPLETED)
            if starting.done():
                starting.result()
                await self._report(stopping)
            else:
                starting.cancel()
        finally:
            self._notifier.stopping()
            await self._close()
            for number, handler in former.items():
                signal.signal(number, handler)
            if self._last_resort is not None:
                self._last_resort.uninstall()
        return 0 if self._driver is None else self._kernel.programs.exit_status or 0

    def _end_whatever_runs(self) -> None:
        """From now on a signal ends the service even while a job never gives way, which the loop would not notice."""
        interrupter = Interrupter(self._kernel.scheduler, self.stop)
        for number in ENDING:
            signal.signal(number, interrupter)
        self._last_resort = LastResort(ENDING, self._abandon)
        self._last_resort.install()

    def _abandon(self) -> None:
        """In another thread: what must be done although a program keeps the service from ending in order."""
        if self._robot is not None:
            self._robot.abandon()
        self._forget_port()

    def stop(self) -> None:
        """End the service, in order."""
        self._stop.set()

    def _read_again(self) -> None:
        """Read settings, tokens and certificate again: what is wrong is logged, what is in force stays."""
        if self._reread is None or self._robot is None:
            return
        try:
            config = self._reread()
            if config.platform != self._config.platform:
                raise BadConfig(f"platform: {self._config.platform} is served; for another one start urbihw anew")
            self._robot.configure(_robot_settings(config, self._robot_url))
        except BadConfig as error:
            log.error("settings stay as they were: %s", error)
        else:
            later = waiting(self._config, config)
            log.info("settings read again%s", f"; with the next start: {', '.join(later)}" if later else "")
        for problem in self._way_in.problems():
            log.error("%s", problem)

    # ---------------------------------------------------------------- start

    async def _start(self) -> None:
        config = self._config
        try:
            manifest = platforms.find(config.platform)
            kind = platforms.load(manifest)
        except BadConfig as error:
            raise StartError(str(error)) from error
        self._bind()
        if config.fake:
            if not manifest.fake:
                raise StartError(f"platform {manifest.name} has no robot in software; give its --url")
            self._fake = Fake(manifest.fake)
        self._kernel = Kernel()
        self._driver = Driver(self._kernel.scheduler, bounds(config.hold_limit, config.memory_limit, config.max_jobs))
        self._end_whatever_runs()
        self._kernel.programs.shutdown = self.stop
        self._kernel.programs.quiet = config.quiet
        for known in (kind, *kind.classes):
            self._kernel.host.register(known)
        _show_to_load(manifest.folder)
        for name in manifest.library:
            await self._load(manifest.folder / name)
        try:
            await self._open(manifest, kind)
        except DeviceError as error:
            raise StartError(self._explained(str(error))) from error
        for name in config.load:
            await self._load(Path(name))
        if self._robot is not None:
            owe_robot(self._robot, manifest.slot)
        self._kernel.complete()
        await self._listen()

    def _bind(self) -> None:
        """Take the port and the path for clients before the robot is touched; nobody can connect yet."""
        config = self._config
        try:
            self._bound = bind(config.host, config.port)
        except (socket.gaierror, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise StartError(f"cannot listen on {config.host!r}: {why}; choose --host") from error
        except OSError as error:
            raise self._no_port(error) from error
        try:
            self._way_in = way_in(config, [one.getsockname()[0] for one in self._bound])
        except BadConfig as error:
            raise StartError(str(error)) from error
        if config.socket == "off":
            return
        try:
            path = Path(config.socket) if config.socket else client_path(self._bound_port())
        except BadConfig as error:
            raise StartError(str(error)) from error
        try:
            self._bound_unix.append(bind_unix(path))
        except OSError as error:
            raise StartError(f"socket: cannot listen at {path}: {error.strerror}; choose another path") from error

    def _bound_port(self) -> int:
        """The port that was taken: a free one, if none was asked for."""
        return int(self._bound[0].getsockname()[1])

    def _no_port(self, error: OSError) -> StartError:
        host, port = self._config.host, self._config.port
        if error.errno == errno.EADDRINUSE:
            holder = holder_of_port(port)
            by = f" by {holder}" if holder else ""
            return StartError(f"port {port} is in use{by}; stop that, or choose another one: --port {port + 1}")
        if error.errno == errno.EACCES:
            return StartError(f"no permission to listen on port {port}; choose one above 1023: --port 54000")
        if error.errno == errno.EADDRNOTAVAIL:
            return StartError(f"this machine has no address {host}; choose --host 127.0.0.1 or --host 0.0.0.0")
        return StartError(f"cannot listen on {host}:{port}: {error.strerror}")

    def _drive(self) -> None:
        assert self._driver is not None
        self._driver.drive()

    async def _load(self, path: Path) -> None:
        """Run an urbiscript file in Global."""
        try:
            text = read_regular(path, LONGEST_PROGRAM).data.decode("latin-1")
        except FileNotFoundError as error:
            raise StartError(f"cannot load {path}: {error.strerror}") from error
        except BadConfig as error:
            raise StartError(f"cannot load {error}") from error
        done: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._kernel.host.run(text, str(path), done.set_result)
        self._drive()
        problem = await done
        if problem:
            raise StartError(f"cannot load a file: {problem}")

    async def _open(self, manifest: Manifest, kind: type[Robot]) -> None:
        url = self._config.url or manifest.default_url
        if self._fake is not None:
            url = await self._fake.url()
        self._robot_url = url
        opened: asyncio.Future[DeviceError | None] = asyncio.get_running_loop().create_future()
        self._robot = self._kernel.host.create(kind, manifest.slot)
        self._robot.open(_robot_settings(self._config, url, self._control()), opened.set_result)
        self._drive()
        try:
            error = await asyncio.wait_for(opened, OPEN_PATIENCE)
        except TimeoutError:
            raise StartError(f"no word from the robot on {url} in {OPEN_PATIENCE:g} s") from None
        if error is not None:
            raise error

    def _control(self) -> str:
        """The path of the control socket; "" for none.  Raises BadConfig when a live daemon listens there."""
        config = self._config
        if config.control == "off":
            return ""
        path = Path(config.control) if config.control else control_path(config.platform, self._bound_port())
        if not path.parent.is_dir():
            raise BadConfig(f"control: there is no folder {path.parent}; make it, or choose another path")
        if path.exists() and not path.is_socket():
            raise BadConfig(f"control: {path} is something else than a socket; choose another path")
        if len(os.fsencode(path)) > LONGEST_SOCKET:
            raise BadConfig(f"control: a path of more than {LONGEST_SOCKET} bytes cannot be a socket: {path}")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe, contextlib.suppress(OSError):
            probe.connect(str(path))
            raise BadConfig(f"another urbihw serves its robot at {path}: stop that, or choose another control")
        return str(path)

    def _explained(self, reason: str) -> str:
        """Add who holds the port, if that is what is wrong."""
        with contextlib.suppress(BadUrl):
            url = Url.parse(self._robot_url)
            if url.scheme == "serial" and "in use" in reason:
                holder = holder_of_file(url.target)
                if holder:
                    return reason.replace("by another program", f"by {holder}")
        return reason

    async def _listen(self) -> None:
        config = self._config
        assert self._driver is not None
        self._server = Server(self._driver, self._kernel.open_lobby, config.unread_limit, config.max_clients)
        port = self._bound_port()
        bound, self._bound = self._bound, []
        try:
            self._server.listen_on(bound, self._way_in.greeting, self._way_in.ssl)
        except OSError as error:
            raise self._no_port(error) from error
        bound, self._bound_unix = self._bound_unix, []
        self._server.listen_on(bound)
        self._port = port
        self._kernel.programs.listen_port = self._port
        if config.port_file:
            try:
                Path(config.port_file).write_text(f"{self._port}\n", "ascii")
            except OSError as error:
                raise StartError(f"cannot write the port to {config.port_file}: {error.strerror}") from error
        log.info("port %d of %s: %s", self._port, config.host, self._status())
        self._notifier.ready(self._status())
        self._reloader.begin()

    # ---------------------------------------------------------------- serve

    def _status(self) -> str:
        return "" if self._robot is None else f"{self._config.platform}: {self._robot.status()}"

    async def _report(self, stopping: asyncio.Future[Literal[True]]) -> None:
        """Keep the service manager informed until it is time to stop; its watchdog is fed while the bus is served.

        Clients whose token was removed are let go of meanwhile.
        """
        said, period = "", min(STATUS_PERIOD, self._notifier.watchdog_period or STATUS_PERIOD)
        while not stopping.done():
            status = self._status()
            if status != said:
                self._notifier.status(status)
                said = status
            if self._robot is None or self._robot.alive():
                self._notifier.watchdog()
            if self._server is not None:
                self._way_in.let_go(self._server.connections)
            await asyncio.wait((stopping,), timeout=period)

    # ---------------------------------------------------------------- stop

    async def _close(self) -> None:
        self._reloader.end()
        if self._robot is not None:
            if self._last_resort is not None:
                self._last_resort.allow(STOPPING)
            self._robot.close()
        if self._last_resort is not None:
            self._last_resort.allow(PATIENCE)
        if self._server is not None:
            for connection in list(self._server.connections):
                if connection.lobby is not None:
                    connection.lobby.output.line("*** urbihw: shutting down, the robot is stopped")
            await self._server.close()
        for one in (*self._bound, *self._bound_unix):
            let_go(one)
        if self._driver is not None:
            self._driver.close()
        if self._fake is not None:
            self._fake.close()
        self._forget_port()
        if self._port >= 0:
            log.info("stopped")

    def _forget_port(self) -> None:
        if self._config.port_file and self._port >= 0:
            with contextlib.suppress(OSError):
                os.unlink(self._config.port_file)


def _show_to_load(folder: Path) -> None:
    """Let ``load`` find the files of the platform, such as its examples, behind those of the user."""
    os.environ["URBI_PATH"] = os.pathsep.join((os.environ.get("URBI_PATH", ""), str(folder)))


def _robot_settings(config: Config, url: str, control: str = "") -> RobotSettings:
    return RobotSettings(
        url,
        config.rate,
        config.dead_man,
        config.torque_off_on_stop,
        config.options,
        keep_motion=config.on_disconnect == "keep",
        resume=config.on_lost == "resume",
        limits=config.limits,
        control=control,
    )
