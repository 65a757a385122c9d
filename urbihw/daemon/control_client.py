"""The control socket of the bus worker, for asyncio: stop, emergency stop, release, health and values of devices.

It needs no interpreter (docs/safety.md).  The commands of a shell use ``urbihw.control_line`` without asyncio.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.client.latch import write_latch
from urbihw.control_line import ANSWER_TIMEOUT_S, CONNECT_PAUSE_S, MAX_LINE_BYTES, dial_control, question

REPLACED_S: Final = 0.3
"""Seconds in which a worker that has ended is replaced."""
_FIRST_PAUSE_S: Final = 0.25
_MAX_PAUSE_S: Final = 2.0


class NoWorker(Exception):
    """The bus worker did not answer; the message is one line that tells why, and what to do."""


class ControlledWorker:
    """The worker behind a control socket; ``path`` None for a robot of another machine."""

    def __init__(self, path: Path | None) -> None:
        self.path = path

    async def ask(self, verb: str, who: str = "", others: Sequence[str] = ()) -> dict[str, Any]:
        """The answer to a verb, by a connection of its own: nothing else delays it.  Raises NoWorker.

        ``who`` is the user whose emergency stop it is; ``others`` are those whose stops are released, too.
        """
        if self.path is None:
            raise NoWorker("the bus worker is on another machine: it is not reached from here")
        line = question(verb, who, who, others)
        try:
            try:
                told = await self._ask(line)
            except (ConnectionResetError, BrokenPipeError, json.JSONDecodeError):
                # It ended with the question unanswered: the one that replaces it is asked, which reads the latch first.
                if verb == "estop":
                    write_latch(self.path, who, who)
                await asyncio.sleep(REPLACED_S)
                told = await self._ask(line)
        except (TimeoutError, OSError, ValueError, RecursionError) as error:
            raise NoWorker(self._explain(verb, who, error)) from error
        if not isinstance(told, dict) or not told.get("ok"):
            raise NoWorker(f"the bus worker did not understand {verb}")
        return told

    async def _ask(self, line: bytes) -> Any:
        async with asyncio.timeout(ANSWER_TIMEOUT_S):
            async with self._lines(line) as reader:
                return json.loads(await reader.readline())

    @contextlib.asynccontextmanager
    async def _lines(self, line: bytes) -> AsyncIterator[asyncio.StreamReader]:
        """Connect, and send a line; yields what the worker answers.  Raises OSError."""
        assert self.path is not None
        while True:
            try:
                made = dial_control(self.path, 0)
                break
            except BlockingIOError:
                await asyncio.sleep(CONNECT_PAUSE_S)
        reader, writer = await asyncio.open_unix_connection(sock=made, limit=MAX_LINE_BYTES)
        try:
            writer.write(line)
            yield reader
        finally:
            writer.transport.abort()

    def _explain(self, verb: str, who: str, error: Exception) -> str:
        if isinstance(error, FileNotFoundError | ConnectionRefusedError):
            return "there is no bus worker; if the robot moves, cut its power"
        if isinstance(error, PermissionError):
            return f"no permission for the control socket {self.path}"
        if not isinstance(error, TimeoutError):
            return "the bus worker ended before it answered; try again"
        text = f"the bus worker has not answered for {ANSWER_TIMEOUT_S:g} s; cut the power, or try again"
        if verb == "estop" and self.path is not None and write_latch(self.path, who, who):
            text += "; whatever serves the robot next will hold it until the release"
        return text

    async def values(self, hz: float, heard: Callable[[dict[str, Any]], None]) -> None:
        """Pass on the values of the devices, so many times in a second, until it is cancelled; a worker that has ended
        is waited for."""
        pauses = BackOff(_FIRST_PAUSE_S, _MAX_PAUSE_S)
        while self.path is not None:
            with contextlib.suppress(OSError, ValueError):
                async with self._lines(json.dumps({"do": "values", "hz": hz}).encode() + b"\n") as reader:
                    while line := await reader.readline():
                        told = json.loads(line)
                        if isinstance(told, dict) and told.get("event") == "Values":
                            pauses.reset()
                            heard(told)
            await asyncio.sleep(pauses.next_pause())
