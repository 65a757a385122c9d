"""Runs a robot as a node until the process is told to stop, also as a child of the daemon."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from typing import Final

from urbihw.ros.robot.bridge import RosRobot, RosRobotSettings

SIGN_OF_LIFE_S: Final = 1.0


async def serve(settings: RosRobotSettings, *, ends_with_input: bool = False) -> None:
    """Serve until SIGTERM or SIGINT, or the end of standard input, a socket of the daemon that must not be outlived.

    Raises RosError when another node has taken the name.
    """
    loop = asyncio.get_running_loop()
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(number, stopped.set)
    if ends_with_input:
        loop.add_reader(sys.stdin.fileno(), _read_input, stopped)
        loop.call_soon(_send_sign_of_life, stopped)
    serving, stopping = asyncio.create_task(RosRobot(settings).run()), asyncio.create_task(stopped.wait())
    try:
        done, _ = await asyncio.wait((serving, stopping), return_when=asyncio.FIRST_COMPLETED)
        if serving in done:
            serving.result()
    finally:
        for task in (serving, stopping):
            task.cancel()
        await asyncio.gather(serving, stopping, return_exceptions=True)


def _send_sign_of_life(stopped: asyncio.Event) -> None:
    if not stopped.is_set():
        with contextlib.suppress(OSError):
            os.write(sys.stdin.fileno(), b".")
        asyncio.get_running_loop().call_later(SIGN_OF_LIFE_S, _send_sign_of_life, stopped)


def _read_input(stopped: asyncio.Event) -> None:
    if not os.read(sys.stdin.fileno(), 4096):
        asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        stopped.set()
