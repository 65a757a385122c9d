"""A server for the network in a thread of its own: TLS, and the first line has to hold a token.  Real sockets."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

from urbihw.client.where import Where
from urbihw.daemon import tls
from urbihw.daemon.access import Authenticator, Tokens
from urbihw.daemon.access_policy import AccessPolicy
from urbihw.kernel import Kernel
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import Server
from urbihw.robot import ROBOT_LIBRARY

T = TypeVar("T")
MAX_LOOKS = 1500


def wait_for(holds: Callable[[], object], what: str) -> None:
    """Look again and again until something holds: so many looks, as a busy machine has a clock of its own.  Raises
    TimeoutError."""
    for _ in range(MAX_LOOKS):
        if holds():
            return
        time.sleep(0.02)
    raise TimeoutError(f"waited for {what}")


class Lan:
    """``host`` and ``port`` are for TLS, ``plain_port`` and ``path`` for this machine; all of the same kernel."""

    def __init__(self, folder: Path, files: tls.Files | None = None) -> None:
        self.tokens = Tokens(folder)
        if files is None:
            tls.make(folder)
            files = tls.files("", "", folder)
        self.fingerprint = tls.fingerprint(files)
        self.path = folder / "socket"
        self._files = files
        self._ready = threading.Event()
        self._stop: asyncio.Event
        self._loop: asyncio.AbstractEventLoop
        self.kernel: Kernel
        self.server: Server
        self.access_policy: AccessPolicy
        self.port = self.plain_port = 0
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._thread.start()
        assert self._ready.wait(120)

    @property
    def where(self) -> Where:
        """By TLS."""
        return Where("127.0.0.1", self.port, True)

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        kernel = self.kernel = Kernel(libraries=(ROBOT_LIBRARY,))
        driver = LoopDriver(kernel.scheduler)
        self.server = Server(driver, kernel.open_lobby)
        authenticator = Authenticator(self.tokens)
        self.access_policy = AccessPolicy(authenticator.handshake, tls.context(self._files), authenticator)
        self.port = await self.server.listen("127.0.0.1", 0, self.access_policy.handshake, self.access_policy.ssl)
        self.plain_port = await self.server.listen("127.0.0.1", 0)
        await self.server.listen_unix(self.path)
        self._ready.set()
        await self._stop.wait()
        await self.server.close()
        driver.close()
        kernel.close()

    def call(self, action: Callable[[], T]) -> T:
        """Do something in the thread of the server."""
        done: Future[T] = Future()

        def run() -> None:
            try:
                done.set_result(action())
            except BaseException as error:
                done.set_exception(error)

        self._loop.call_soon_threadsafe(run)
        return done.result(120)

    def count(self) -> tuple[int, int]:
        """How many connections there are, and how many lobbies."""
        connections = list(self.call(lambda: list(self.server.connections)))
        return len(connections), sum(each.lobby is not None for each in connections)

    def close(self, *_: Any) -> None:
        """End."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(20)
