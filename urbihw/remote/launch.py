"""Runs modules of devices as a remote of a server; the exit code tells how that ended."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import socket
from collections.abc import Sequence

from urbihw.backoff import BackOff
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.where import Where, where_is
from urbihw.exitcodes import EX_NOINPUT, EX_OK, NO_SERVER
from urbihw.kernel.process import KernelProcess
from urbihw.kernel.uobject import BadConfig
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.remote.connection import FIRST_PAUSE_S, MAX_PAUSE_S, RemoteSession, ServerConnection
from urbihw.robot import ROBOT_LIBRARY

log = logging.getLogger("urbihw.remote")


def run(
    modules: Sequence[str],
    host: str = "127.0.0.1",
    port: int = 54000,
    *,
    tls: bool | None = None,
    credentials: Credentials | None = None,
    arguments: Sequence[str] = (),
    stay_alive: bool = True,
    retry_first: bool = False,
) -> int:
    """Load modules, join the server at ``host`` and ``port``, and serve until the process is told to stop.

    ``host`` may be the path of a UNIX socket.  ``tls``: None for TLS to other machines and none to this one.
    ``credentials``: by default those that need no question to the user.  ``arguments`` are ``System.arguments`` of the
    modules. With ``stay_alive`` a lost connection is opened again, with growing pauses; with ``retry_first`` so is the
    first one. Returns 0 after an intended end (a signal, the server's end, all objects destroyed), 1 if there is no
    server, it refuses the client or another client provides all classes, 66 if a module cannot be loaded; the log tells
    the reason in one line.
    """
    where, who = where_is(host, port, tls), Credentials() if credentials is None else credentials
    return asyncio.run(_run(modules, where, who, list(arguments), stay_alive, retry_first))


def token() -> str:
    """An identifier that is unique to this process."""
    return re.sub(r"\W", "_", f"{socket.gethostname()}_{os.getpid()}")


async def _run(
    modules: Sequence[str], where: Where, who: Credentials, arguments: list[str], stay_alive: bool, retry_first: bool
) -> int:
    process = KernelProcess()
    process.install_signals()
    try:
        kernel = process.boot(arguments=arguments, libraries=(ROBOT_LIBRARY,))
        process.load_modules(modules)
        bridge = Bridge(kernel.host, token(), lambda parts: session.write(parts))
        session = RemoteSession(bridge, process.drive, where, who)
        code = await process.run_until_stopped(_serve(session, bridge, str(where), stay_alive, retry_first))
        return EX_OK if code is None else code
    except BadConfig as error:
        log.error("%s", error)
        return EX_NOINPUT
    except Denied as error:
        log.error("%s", error)
        return NO_SERVER
    finally:
        await process.close()
        process.restore_signals()


async def _serve(session: RemoteSession, bridge: Bridge, where: str, stay_alive: bool, retry_first: bool) -> int:
    pauses, joined_before = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S), False

    def joined() -> bool:
        """Whether the server has accepted any class of this process."""
        for name in bridge.taken:
            log.error("class %s is served at %s by somebody else already", name, where)
        return not bridge.all_taken

    try:
        link: ServerConnection = await session.connect()
    except OSError as error:
        if not retry_first:
            log.error("cannot reach %s: %s", where, error.strerror or error)
            return NO_SERVER
        log.warning("no server at %s yet", where)
        link = await session.reconnect(pauses)
    while True:
        if await session.serve(link, joined):
            joined_before = True
            pauses.reset()
        elif bridge.all_taken and not joined_before:
            return NO_SERVER
        if bridge.empty:
            return EX_OK
        if not stay_alive:
            log.info("connection to %s lost", where)
            return EX_OK
        log.warning("connection to %s lost, coming back", where)
        link = await session.reconnect(pauses)
        log.info("connected to %s again", where)
