"""What a browser has not read yet: answers and events in order, and the newest of what comes again and again.

A slow browser delays no other: of samples only the newest few are kept, and those left out are counted; other
messages are bounded, and a browser with too many is disconnected.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Awaitable, Callable, Hashable, Mapping
from typing import Any, Final, Protocol

MAX_MESSAGES: Final = 4000
"""Messages that may wait; a browser with more is disconnected."""
MAX_LENGTH: Final = 16 * 1024 * 1024
"""Characters of messages that may wait, beside the last one."""
FULL: Final = 500
"""Messages that wait, from which on a program's output is not read any more, until half of them are sent."""
KEPT: Final = 8
"""Samples of one subscription that are kept: some come together."""

IN_A_TURN: Final = 16
"""Messages that are sent before others have their turn: to send to a browser that reads does not wait."""


class Socket(Protocol):
    """The side of a WebSocket that sends."""

    async def send_str(self, data: str) -> None:
        """Send a text message to the browser."""

    async def send_bytes(self, data: bytes) -> None:
        """Send a binary message to the browser."""


class WebOutbox:
    """The messages for one browser.  ``run`` sends them."""

    def __init__(self, flow: Callable[[bool], None] = lambda full: None) -> None:
        """``flow(True)`` is called when much waits, ``flow(False)`` when it is sent."""
        self._flow = flow
        self._queue: deque[str] = deque()
        self._length = 0
        self._newest: dict[Hashable, deque[Any]] = {}
        self._lost: dict[Hashable, int] = {}
        self._ready = asyncio.Event()
        self._is_full = False
        self.overflowed = False
        """Whether more waited than is kept: the browser must be disconnected."""

    def put(self, message: Mapping[str, Any]) -> None:
        """Queue a message that must arrive."""
        if len(self._queue) >= MAX_MESSAGES or self._length > MAX_LENGTH:
            self.overflowed = True
        else:
            text = to_text(message)
            self._queue.append(text)
            self._length += len(text)
            if len(self._queue) >= FULL and not self._is_full:
                self._is_full = True
                self._flow(True)
        self._ready.set()

    def put_newest(self, key: Hashable, message: Mapping[str, Any] | bytes, kept: int = 1) -> None:
        """Queue a message of which only the newest ``kept`` matter.  The field ``lost`` of a message, if it has one,
        grows by those that were left out."""
        waiting = self._newest.setdefault(key, deque())
        if len(waiting) >= kept:
            waiting.popleft()
            self._lost[key] = self._lost.get(key, 0) + 1
        waiting.append(message)
        self._ready.set()

    def lost(self, key: Hashable) -> int:
        """How many messages were left out."""
        return self._lost.get(key, 0)

    def forget(self, key: Hashable) -> None:
        """Drop what waits under a key."""
        self._newest.pop(key, None)
        self._lost.pop(key, None)

    async def run(self, socket: Socket) -> None:
        """Send until the browser is gone (ConnectionError), or too much waits (returns)."""
        while not self.overflowed:
            await self._ready.wait()
            self._ready.clear()
            while self._queue or any(self._newest.values()):
                await self._send_queued(socket)
                await self._send_newest(socket)
                if self.overflowed:
                    return

    async def _send_queued(self, socket: Socket) -> None:
        turn = 0
        while self._queue:
            text = self._queue.popleft()
            self._length -= len(text)
            await socket.send_str(text)
            turn += 1
            if turn % IN_A_TURN == 0:
                await asyncio.sleep(0)
            if self._is_full and len(self._queue) < FULL // 2:
                self._is_full = False
                self._flow(False)
            if self.overflowed:
                return

    async def _send_newest(self, socket: Socket) -> None:
        for key, waiting in list(self._newest.items()):
            while waiting:
                message = waiting.popleft()
                if isinstance(message, bytes):
                    sending: Awaitable[None] = socket.send_bytes(message)
                else:
                    if "lost" in message and self._lost.get(key):
                        message = {**message, "lost": message["lost"] + self._lost[key]}
                    sending = socket.send_str(to_text(message))
                await sending
                if self._queue:
                    return


def to_text(message: Mapping[str, Any]) -> str:
    """A message as JSON.  Numbers that JSON does not have are null, characters that UTF-8 does not have are ``?``."""
    try:
        text = json.dumps(message, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    except ValueError:
        plain = json.loads(json.dumps(message), parse_constant=lambda _: None)
        text = json.dumps(plain, ensure_ascii=False, separators=(",", ":"))
    return text if text.isascii() else text.encode("utf-8", "replace").decode()
