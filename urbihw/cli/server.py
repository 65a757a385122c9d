"""The process behind ``urbi``: one kernel, its console, and a port if wanted.

The common part of all processes with a kernel is ``urbihw.kernel.process``.  Order of a start: modules, the console's
start-up files, the port, the port file, the sources of ``-e`` and ``-f``, standard input.  ``global.u`` and ``local.u``
are searched in ``System.searchPath`` (manual, section Special Files); the console and the connections load the four
files in the order of the original (server protocol, section 8).
"""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused
from urbihw.cli.terminal import Terminal
from urbihw.client.where import is_loopback, why
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.frozen import frozen
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.process import KernelProcess
from urbihw.kernel.server.bounds import HOLD_LIMIT, NONE, bounds
from urbihw.kernel.uobject import BadConfig
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

CONSOLE_FILES: Final = ("URBI.INI", "global.u", "CLIENT.INI", "local.u")
"""The files that the console loads when the server starts; the names in capitals are the older ones."""
CONNECTION_FILES: Final = ("CLIENT.INI", "local.u")
"""The files that every connection loads when it opens."""

START_TIMEOUT_S: Final = 5.0
"""Seconds after which the port is opened even if the start-up files have not ended."""

log = logging.getLogger("urbihw.urbi")


@frozen(slots=False)
class UrbiSettings:
    """The settings of ``urbi``.

    Attributes:
        program: the path by which the program was called.
        texts: the texts to run in the console, in order.
        interactive: whether to read standard input.
        host, port: where to listen; port -1 is nowhere, 0 any free one.
        port_file: file for the port, written when clients can connect.
        quiet: no banner.
        fast: simulated time.
        hold_limit: seconds of processor time for which a job may block all others; 0: no limit.  This and the other
            limits apply only to a server with a port: without one there are no other clients.
        modules: modules of UObjects to load first.
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


async def serve(settings: UrbiSettings, ended: Callable[[int], None] = lambda code: None) -> int | None:
    """Serve until ``shutdown``, the end of an interactive session or a signal.  Returns the exit code.

    Raises CliRefused.
    Returns None after ``reboot``: the caller must restart the program.  Otherwise ``ended`` is called with the exit
    code, before the objects of the programs are freed.
    """
    program = UrbiProgram(settings)
    try:
        code = await program.run()
    finally:
        await program.close()
    if program.again:
        return None
    ended(code)
    return code


class UrbiProgram:
    """The kernel, the console and the server of one ``urbi``."""

    def __init__(self, settings: UrbiSettings) -> None:
        self._settings = settings
        # Ctrl-C may be for a program of the console, so only SIGTERM has a deadline.
        self._process = KernelProcess(fatal=(signal.SIGTERM,), second_is_fatal=True)
        self._terminal: Terminal | None = None
        self._rebooting = False

    @property
    def again(self) -> bool:
        """Whether the program must be restarted: ``reboot`` was called, and no signal has asked for the end since."""
        return self._rebooting and not self._process.interrupter.is_ending

    def _reboot(self) -> None:
        """Begin an orderly shutdown, after which the program is restarted."""
        self._rebooting = True
        self._process.stop()

    async def run(self) -> int:
        """Serve.  Returns the exit code, None after ``reboot``."""
        settings, process = self._settings, self._process
        process.install_signals()
        kernel = process.boot(
            bounds(settings.hold_limit) if settings.port >= 0 else NONE,
            fast=settings.fast, name=settings.program, arguments=settings.arguments, reboot=self._reboot,
            libraries=(ROBOT_LIBRARY, ROS_LIBRARY),
        )
        kernel.programs.quiet = settings.quiet
        terminal = self._terminal = Terminal(process)
        if settings.interactive:
            process.interrupter.lobby = terminal.lobby
        try:
            process.load_modules(settings.modules)
        except BadConfig as error:
            raise CliRefused(str(error), EX_CONFIG) from error
        terminal.feed(start_up(kernel, CONSOLE_FILES))
        await self._wait(terminal.idle())
        kernel.complete()
        if not process.stopped.done():
            self._listen()
            terminal.on_quit = self._no_more_input
            terminal.start(settings.texts, settings.interactive)
            process.drive()
        await process.stopped
        return terminal.code if process.exit_status is None else process.exit_status

    async def _wait(self, loaded: asyncio.Future[None]) -> None:
        """Wait until the start-up files are loaded, the process must end, or START_TIMEOUT_S is over."""
        stopped = self._process.stopped
        self._process.drive()
        await asyncio.wait((loaded, stopped), timeout=START_TIMEOUT_S, return_when=asyncio.FIRST_COMPLETED)
        if not loaded.done() and not stopped.done():
            log.warning("a start-up file still runs after %g s: end what should go on with a comma", START_TIMEOUT_S)

    def _open_lobby(self, remote: str | None, wanted: Callable[[Lobby], None], limit: int) -> Lobby:
        kernel = self._process.kernel
        lobby = kernel.open_lobby(remote, wanted, limit)
        lobby.feed(start_up(kernel, CONNECTION_FILES))
        return lobby

    def _listen(self) -> None:
        host, port, file = self._settings.host, self._settings.port, self._settings.port_file
        if port >= 0:
            try:
                self._process.bind(host, port)
                self._process.listen(open_lobby=self._open_lobby)
            except (OSError, UnicodeError) as error:
                raise CliRefused(f"cannot listen to port {host}:{port}: {why(error)}", EX_UNAVAILABLE) from error
            if not is_loopback(host):
                log.warning("every computer that reaches %s runs programs as the user of this process, and everybody "
                            "on the way can read along; urbihw serve asks for TLS and a token there", host)
        if file is not None:
            try:
                self._process.write_port_file(file)
            except OSError as error:
                raise CliRefused(f"cannot write {file}: {error.strerror}", EX_CONFIG) from error

    def _no_more_input(self) -> None:
        self._process.interrupter.lobby = None

    async def close(self) -> None:
        """Write the remaining output and free everything.  A second call does nothing."""
        if self._terminal is not None:
            self._terminal.close()
        await self._process.close()
        self._process.restore_signals()


def start_up(kernel: Kernel, names: Iterable[str]) -> bytes:
    """The urbiscript with which a lobby loads the files that exist; an error in one ends the sequence."""
    world = kernel.world
    path = world.send(world.global_.slots["System"], "searchPath")
    folders = [Path(world.text(folder)) for folder in path.l]
    found = [name for name in names if any((folder / name).is_file() for folder in folders)]
    if not found:
        return b""
    loads = " | ".join(f'System.maybeLoad("{name}", clog)' for name in found)
    return f'//#push 1 "initialize"\n{loads}|;\n//#pop\n'.encode()
