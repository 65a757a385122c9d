"""The life of a process that a daemon keeps (``urbihw.daemon.kept_child``), in an event loop of asyncio."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Coroutine
from typing import Any, Final

SIGN_OF_LIFE_S: Final = 1.0


async def run_until_told(work: Coroutine[Any, Any, None], *, ends_with_input: bool) -> None:
    """Do some work until SIGTERM, SIGINT or SIGHUP, its end, or the end of standard input, a socket of the daemon that
    must not be outlived.  Raises what the work raises.
    """
    loop = asyncio.get_running_loop()
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(number, stopped.set)
    if ends_with_input:
        loop.add_reader(sys.stdin.fileno(), _read_input, stopped)
        loop.call_soon(_send_sign_of_life, stopped)
    working, stopping = asyncio.create_task(work), asyncio.create_task(stopped.wait())
    try:
        done, _ = await asyncio.wait((working, stopping), return_when=asyncio.FIRST_COMPLETED)
        if working in done:
            working.result()
    finally:
        for task in (working, stopping):
            task.cancel()
        await asyncio.gather(working, stopping, return_exceptions=True)


def _send_sign_of_life(stopped: asyncio.Event) -> None:
    """Tell the daemon that this process does not hang."""
    if not stopped.is_set():
        with contextlib.suppress(OSError):
            os.write(sys.stdin.fileno(), b".")
        asyncio.get_running_loop().call_later(SIGN_OF_LIFE_S, _send_sign_of_life, stopped)


def _read_input(stopped: asyncio.Event) -> None:
    if not os.read(sys.stdin.fileno(), 4096):
        asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        stopped.set()
