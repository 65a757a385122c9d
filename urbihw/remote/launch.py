"""Runs modules of devices as a remote of a server, and says by the exit code how it ended."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import signal
import socket
from collections.abc import Coroutine, Sequence
from typing import Any

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.where import Where, where_is
from urbihw.kernel import Kernel
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.uobject import BadConfig
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.remote.link import FIRST_PAUSE, Link, Session

log = logging.getLogger("urbihw.remote")

OK, NO_SERVER, NO_MODULE = 0, 1, 66


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
    """Load modules, join the server at ``host`` and ``port``, and serve until told to stop; the exit code.

    ``host`` may be the path of a UNIX socket.  ``tls``: None for TLS to other machines and none to this one;
    ``credentials``: by default those that need no question.  ``arguments`` are ``System.arguments`` of the modules.
    With ``stay_alive`` a lost connection is made again, with pauses that grow; with ``retry_first`` the server need not
    even be there yet. Gives 0 when ended on purpose (a signal, the server's end, all objects destroyed), 1 if there is
    no server, it does not let us in or it has all classes from somebody else, 66 if a module cannot be loaded; the log
    tells the reason in one line.
    """
    where, who = where_is(host, port, tls), Credentials() if credentials is None else credentials
    return asyncio.run(_run(modules, where, who, list(arguments), stay_alive, retry_first))


def token() -> str:
    """What tells this process apart from others, as an identifier."""
    return re.sub(r"\W", "_", f"{socket.gethostname()}_{os.getpid()}")


async def _run(
    modules: Sequence[str], where: Where, who: Credentials, arguments: list[str], stay_alive: bool, retry_first: bool
) -> int:
    kernel = Kernel()
    kernel.programs.arguments = arguments
    try:
        for module in modules:
            kernel.host.load_module(module)
    except BadConfig as error:
        log.error("%s", error)
        return NO_MODULE
    driver = Driver(kernel.scheduler)
    bridge = Bridge(kernel.host, token(), lambda parts: session.write(parts))
    session = Session(bridge, driver, where, who)
    try:
        return await _until_stopped(_serve(session, bridge, str(where), stay_alive, retry_first))
    except Denied as error:
        log.error("%s", error)
        return NO_SERVER
    finally:
        driver.close()


async def _until_stopped(work: Coroutine[Any, Any, int]) -> int:
    """Do some work until it is over or a signal comes; the exit code."""
    loop = asyncio.get_running_loop()
    task = loop.create_task(work)
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, task.cancel)
        except (ValueError, RuntimeError, NotImplementedError):  # not the main thread, or not a system with signals
            break
    try:
        return await task
    except asyncio.CancelledError:
        return OK


async def _serve(session: Session, bridge: Bridge, where: str, stay_alive: bool, retry_first: bool) -> int:
    pause, joined_before = FIRST_PAUSE, False

    def joined() -> bool:
        """Whether the server took any of our classes."""
        for name in bridge.taken:
            log.error("class %s is served at %s by somebody else already", name, where)
        return not bridge.all_taken

    try:
        link: Link = await session.connect()
    except OSError as error:
        if not retry_first:
            log.error("cannot reach %s: %s", where, error.strerror or error)
            return NO_SERVER
        log.warning("no server at %s yet", where)
        link, pause = await session.come_back(pause)
    while True:
        if await session.serve(link, joined):
            joined_before, pause = True, FIRST_PAUSE
        elif bridge.all_taken and not joined_before:
            return NO_SERVER
        if bridge.empty:
            return OK
        if not stay_alive:
            log.info("connection to %s lost", where)
            return OK
        log.warning("connection to %s lost, coming back", where)
        link, pause = await session.come_back(pause)
        log.info("connected to %s again", where)
