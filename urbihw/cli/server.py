"""The process behind ``urbi``: one kernel, its console, and a port if wanted.

Order of a start: modules, the console's start-up files, the port, the port file, what ``-e`` and ``-f`` gave, standard
input.  ``global.u`` and ``local.u`` are looked for in ``System.searchPath`` (manual, section Special Files); the order
of the four names and who loads which is what the original does (server protocol, section 8).
"""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Final

from urbihw.cli.options import EX_CONFIG, EX_UNAVAILABLE, Refused, why
from urbihw.cli.terminal import Terminal
from urbihw.client.where import is_loopback
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.bounds import HOLD_LIMIT, NONE, bounds
from urbihw.kernel.server.ending import LastResort
from urbihw.kernel.server.interrupt import Interrupter
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.server.tcp import Server
from urbihw.kernel.uobject import BadConfig

CONSOLE_FILES: Final = ("URBI.INI", "global.u", "CLIENT.INI", "local.u")
"""What the console loads when the server starts; the names in capitals are those of old."""
CONNECTION_FILES: Final = ("CLIENT.INI", "local.u")
"""What every connection loads when it opens."""

START_PATIENCE: Final = 5.0
"""Seconds that the start-up files may take before the port is opened all the same."""

log = logging.getLogger("urbihw.urbi")


@dataclass(frozen=True)
class Settings:
    """What ``urbi`` was asked for.

    Attributes:
        program: the path under which it was called.
        texts: to run in the console, in order.
        interactive: whether to read standard input.
        host, port: where to listen; port -1 is nowhere, 0 any free one.
        port_file: written when clients may come.
        quiet: no banner.
        fast: simulated time.
        hold_limit: seconds that a job may keep all others waiting; 0: as long as it wants.  This and the other bounds
            on programs are for a server with a port: else nobody is kept waiting.
        modules: of UObjects, to load first.
        arguments: ``System.arguments``.
    """

    program: str = "urbi"
    texts: tuple[bytes, ...] = ()
    interactive: bool = False
    host: str = "127.0.0.1"
    port: int = -1
    port_file: Path | None = None
    quiet: bool = False
    fast: bool = False
    hold_limit: float = HOLD_LIMIT
    modules: tuple[str, ...] = ()
    arguments: tuple[str, ...] = ()


async def serve(settings: Settings, ended: Callable[[int], None] = lambda code: None) -> int | None:
    """Serve until ``shutdown``, the end of an interactive session or a signal; the exit code.  Raises Refused.

    None after ``reboot``: who called is to start the program anew.  Else ``ended`` is told the exit code, while all
    objects of the programs are still there.
    """
    process = Process(settings)
    try:
        code = await process.run()
    finally:
        await process.close()
    if process.again:
        return None
    ended(code)
    return code


class Process:
    """Everything that ``urbi`` holds."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.kernel = Kernel(fast=settings.fast)
        self.driver = Driver(self.kernel.scheduler, bounds(settings.hold_limit) if settings.port >= 0 else NONE)
        self._former = signal.getsignal(signal.SIGTERM)
        self._stopped: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        programs = self.kernel.programs
        programs.shutdown = self.stop
        programs.reboot = self.reboot
        self.again = False
        self._last_resort = LastResort((signal.SIGTERM,))
        programs.name = settings.program
        programs.arguments = list(settings.arguments)
        programs.quiet = settings.quiet
        self._server = Server(self.driver, self._open_lobby)
        self._terminal = Terminal(self.kernel, self.driver, self.stop)
        interactive = self._terminal.lobby if settings.interactive else None
        self._interrupter = Interrupter(self.kernel.scheduler, self.stop, interactive)

    def stop(self) -> None:
        """End the process, in order."""
        if not self._stopped.done():
            self._stopped.set_result(None)

    def reboot(self) -> None:
        """End the process, in order, to be started anew."""
        self.again = True
        self.stop()

    async def run(self) -> int:
        """Serve."""
        settings = self._settings
        self._interrupter.install()
        self._former = signal.signal(signal.SIGTERM, self._terminate)
        self._last_resort.install()
        try:
            for module in settings.modules:
                self.kernel.host.load_module(module)
        except BadConfig as error:
            raise Refused(str(error), EX_CONFIG) from error
        self._terminal.feed(start_up(self.kernel, CONSOLE_FILES))
        await self._wait(self._terminal.idle())
        self.kernel.complete()
        if not self._stopped.done():
            await self._listen()
            self._terminal.on_quit = self._no_more_input
            self._terminal.start(settings.texts, settings.interactive)
            self.driver.drive()
        await self._stopped
        status = self.kernel.programs.exit_status
        return self._terminal.code if status is None else status

    def _terminate(self, number: int, frame: FrameType | None) -> None:
        """SIGTERM: shut down, even if a job never gives way."""
        self._interrupter.lobby = None
        self._interrupter(number, frame)

    async def _wait(self, loaded: asyncio.Future[None]) -> None:
        """Wait until the start-up files are loaded, or for the end; one that never ends does not keep clients out."""
        self.driver.drive()
        await asyncio.wait((loaded, self._stopped), timeout=START_PATIENCE, return_when=asyncio.FIRST_COMPLETED)
        if not loaded.done() and not self._stopped.done():
            log.warning("a start-up file still runs after %g s: end what should go on with a comma", START_PATIENCE)

    def _open_lobby(self, remote: str | None, wanted: Callable[[Lobby], None], limit: int) -> Lobby:
        lobby = self.kernel.open_lobby(remote, wanted, limit)
        lobby.feed(start_up(self.kernel, CONNECTION_FILES))
        return lobby

    async def _listen(self) -> None:
        host, port = self._settings.host, self._settings.port
        if port >= 0:
            try:
                port = await self._server.listen(host, port)
            except (OSError, UnicodeError) as error:
                raise Refused(f"cannot listen to port {host}:{port}: {why(error)}", EX_UNAVAILABLE) from error
            if not is_loopback(host):
                log.warning("whoever reaches %s runs programs as the user of this process, and everybody on the way "
                            "can read along; urbihw serve asks for TLS and a token there", host)
        self.kernel.programs.listen_port = port
        if self._settings.port_file is not None:
            try:
                self._settings.port_file.write_text(f"{port}\n", "ascii")
            except OSError as error:
                raise Refused(f"cannot write {self._settings.port_file}: {error.strerror}", EX_CONFIG) from error

    def _no_more_input(self) -> None:
        self._interrupter.lobby = None

    async def close(self) -> None:
        """Say what is left to say and let go of everything; twice is fine."""
        self._terminal.close()
        self.driver.close()
        await self._server.close()
        self._interrupter.uninstall()
        signal.signal(signal.SIGTERM, self._former)
        self._last_resort.uninstall()


def start_up(kernel: Kernel, names: Iterable[str]) -> bytes:
    """The urbiscript by which a lobby loads those of the files that there are; an error in one ends the row."""
    world = kernel.world
    path = world.send(world.global_.slots["System"], "searchPath")
    folders = [Path(world.text(folder)) for folder in path.l]
    found = [name for name in names if any((folder / name).is_file() for folder in folders)]
    if not found:
        return b""
    loads = " | ".join(f'System.maybeLoad("{name}", clog)' for name in found)
    return f'//#push 1 "initialize"\n{loads}|;\n//#pop\n'.encode()
