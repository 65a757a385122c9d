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
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from urbihw import platforms
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import Url
from urbihw.daemon.banner import banner
from urbihw.daemon.fake import Fake
from urbihw.daemon.holders import holder_of_file, holder_of_port
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.server.tcp import Server
from urbihw.platforms import DeviceError, Manifest, Robot, RobotSettings

log = logging.getLogger("urbihw.daemon")

OPEN_PATIENCE = 15.0
"""Seconds that a robot may take to be found; a scan of two protocols with a slow adapter takes a few."""
STATUS_PERIOD = 1.0


class StartError(Exception):
    """The daemon cannot serve as it is set up; the message is one line that says what to do."""


@dataclass(frozen=True)
class ServiceSettings:
    """What to serve, and where.

    Attributes:
        platform: name of the folder under ``urbihw/platforms``.
        url: of the robot's bus; "" for the platform's default.
        fake: serve the robot in software instead.
        host, port: where to listen; port 0 takes a free one.
        port_file: where to write the port when clients may come.
        quiet: no banner.
        rate: readings a second; None for the platform's own.
        dead_man: see ``RobotSettings``.
        torque_off_on_stop: see ``RobotSettings``.
        options: what else the platform takes.
        load: urbiscript files to load in Global before clients come.
        unread_limit: bytes that a client may leave unread.
    """

    platform: str
    url: str = ""
    fake: bool = False
    host: str = "127.0.0.1"
    port: int = 54000
    port_file: Path | None = None
    quiet: bool = False
    rate: float | None = None
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    options: dict[str, object] = field(default_factory=dict)
    load: tuple[Path, ...] = ()
    unread_limit: int = 8 * 1024 * 1024


class Service:
    """``await Service(settings).run()`` serves until SIGTERM, SIGINT or ``stop()``; the result is the exit code."""

    def __init__(
        self,
        settings: ServiceSettings,
        reread: Callable[[], ServiceSettings] | None = None,
        notify: Callable[[str], object] = lambda state: None,
    ) -> None:
        """``reread`` gives the settings anew (SIGHUP); ``notify`` takes what the service manager is to know."""
        self._settings = settings
        self._reread = reread
        self._notify = notify
        self._stop = asyncio.Event()
        self._kernel: Kernel
        self._driver: Driver
        self._server: Server | None = None
        self._robot: Robot | None = None
        self._fake: Fake | None = None
        self._port = -1

    async def run(self) -> int:
        """Serve.  Raises StartError when it cannot begin."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self.stop)
        loop.add_signal_handler(signal.SIGHUP, self.reload)
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
            self._notify("STOPPING=1")
            await self._close()
        return 0

    def stop(self) -> None:
        """End the service, in order."""
        self._stop.set()

    def reload(self) -> None:
        """Read the settings again; what can change without starting anew does: rate, dead man, torque on stop."""
        if self._reread is None or self._robot is None:
            return
        self._notify("RELOADING=1")
        try:
            self._settings = self._reread()
            self._robot.configure(self._robot_settings(self._robot_url))
            log.info("settings read again")
        except (StartError, DeviceError, ValueError) as error:
            log.error("settings stay as they were: %s", error)
        self._notify("READY=1")

    # ---------------------------------------------------------------- start

    async def _start(self) -> None:
        settings = self._settings
        try:
            manifest = platforms.find(settings.platform)
            kind = platforms.load(manifest)
        except (platforms.BadConfig, platforms.BadManifest) as error:
            raise StartError(str(error)) from error
        self._probe_port()
        if settings.fake:
            if not manifest.fake:
                raise StartError(f"platform {manifest.name} has no robot in software; give its --url")
            self._fake = Fake(manifest.fake)
        self._kernel = Kernel()
        self._driver = Driver(self._kernel.scheduler)
        self._kernel.programs.shutdown = self.stop
        self._kernel.programs.quiet = settings.quiet
        for known in (kind, *kind.classes):
            self._kernel.host.register(known)
        for name in manifest.library:
            await self._load(manifest.folder / name)
        try:
            await self._open(manifest, kind)
        except DeviceError as error:
            raise StartError(self._explained(str(error))) from error
        for path in settings.load:
            await self._load(path)
        await self._listen()

    def _probe_port(self) -> None:
        """Find out whether the port is free before the robot is touched."""
        settings = self._settings
        try:
            family, kind, proto, _, address = socket.getaddrinfo(
                settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
        except OSError as error:
            raise StartError(f"cannot listen on {settings.host!r}: {error.strerror or error}; choose --host") from error
        with socket.socket(family, kind, proto) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(address)
                probe.listen()
            except OSError as error:
                raise self._no_port(error) from error

    def _no_port(self, error: OSError) -> StartError:
        host, port = self._settings.host, self._settings.port
        if error.errno == errno.EADDRINUSE:
            holder = holder_of_port(port)
            by = f" by {holder}" if holder else ""
            return StartError(f"port {port} is in use{by}; stop that, or choose another one: --port {port + 1}")
        if error.errno == errno.EACCES:
            return StartError(f"no permission to listen on port {port}; choose one above 1023: --port 54000")
        if error.errno == errno.EADDRNOTAVAIL:
            return StartError(f"this machine has no address {host}; choose --host 127.0.0.1 or --host 0.0.0.0")
        return StartError(f"cannot listen on {host}:{port}: {error.strerror}")

    async def _load(self, path: Path) -> None:
        """Run an urbiscript file in Global."""
        try:
            text = path.read_text("latin-1")
        except OSError as error:
            raise StartError(f"cannot load {path}: {error.strerror}") from error
        done: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._kernel.host.run(text, str(path), done.set_result)
        self._driver.drive()
        problem = await done
        if problem:
            raise StartError(f"cannot load a file: {problem}")

    async def _open(self, manifest: Manifest, kind: type[Robot]) -> None:
        url = self._settings.url or manifest.default_url
        if self._fake is not None:
            url = await self._fake.url()
        self._robot_url, self._rate = url, manifest.rate
        self._name = manifest.name
        opened: asyncio.Future[DeviceError | None] = asyncio.get_running_loop().create_future()
        self._robot = self._kernel.host.create(kind, manifest.slot)
        self._robot.open(self._robot_settings(url), opened.set_result)
        self._driver.drive()
        try:
            error = await asyncio.wait_for(opened, OPEN_PATIENCE)
        except TimeoutError:
            raise StartError(f"no word from the robot on {url} in {OPEN_PATIENCE:g} s") from None
        if error is not None:
            raise error

    def _robot_settings(self, url: str) -> RobotSettings:
        settings = self._settings
        return RobotSettings(
            url, settings.rate or self._rate, settings.dead_man, settings.torque_off_on_stop, settings.options
        )

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
        settings = self._settings
        self._server = Server(self._driver, self._open_lobby, settings.unread_limit)
        try:
            self._port = await self._server.listen(settings.host, settings.port)
        except OSError as error:
            raise self._no_port(error) from error
        self._kernel.programs.listen_port = self._port
        if settings.port_file is not None:
            try:
                settings.port_file.write_text(f"{self._port}\n", "ascii")
            except OSError as error:
                raise StartError(f"cannot write the port to {settings.port_file}: {error.strerror}") from error
        log.info("serving %s on %s:%d: %s", self._name, settings.host, self._port, self._status())
        self._notify("READY=1")

    def _open_lobby(self, remote: str, wanted: Callable[[Lobby], None], limit: int) -> Lobby:
        lobby = self._kernel.open_lobby(remote, wanted, limit)
        if not self._settings.quiet:
            for line in banner(version("urbihw")):
                lobby.output.line(line)
        return lobby

    # ---------------------------------------------------------------- serve

    def _status(self) -> str:
        return "" if self._robot is None else self._robot.status()

    async def _report(self, stopping: asyncio.Future[Literal[True]]) -> None:
        """Keep the service manager informed until it is time to stop."""
        said = ""
        while not stopping.done():
            status = f"{self._name}: {self._status()}"
            if status != said:
                self._notify(f"STATUS={status}")
                said = status
            await asyncio.wait((stopping,), timeout=STATUS_PERIOD)

    # ---------------------------------------------------------------- stop

    async def _close(self) -> None:
        if self._robot is not None:
            self._robot.close()
        if self._server is not None:
            for connection in list(self._server.connections):
                if connection.lobby is not None:
                    connection.lobby.output.line("*** urbihw: shutting down, the robot is stopped")
            await self._server.close()
        if hasattr(self, "_driver"):
            self._driver.close()
        if self._fake is not None:
            self._fake.close()
        port_file = self._settings.port_file
        if port_file is not None and self._port >= 0:
            with contextlib.suppress(OSError):
                os.unlink(port_file)
        log.info("stopped")
