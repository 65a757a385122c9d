"""Orders of a broker: which of its messages is one, and how the newest of each joint is carried out.

A retained message is no order: it may be a year old, and comes at each connection.  A flood moves a joint to the
newest goal only, and begins a movement a few times a second at most.  A stop is taken before all that waits, and ends
it.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Final

import aiomqtt

from urbihw.neighbours.home.things import HomeThing, HomeTopics

MAX_PAYLOAD: Final = 32
PAUSE_S: Final = 0.2
"""Seconds between the beginnings of two movements of a joint."""


class HomeOrder(Exception):
    """A message that is no order; the text is for the broker."""


def goal_of(topics: HomeTopics, things: Mapping[str, HomeThing], topic: str, payload: bytes) -> tuple[HomeThing, float]:
    """The joint and the goal of a message.  Raises HomeOrder."""
    name = topic.removeprefix(topics.goal(""))
    thing = things.get(name)
    if thing is None or thing.ends is None or topic != topics.goal(name):
        raise HomeOrder(f"{topic[:200]}: not a joint that may be moved")
    try:
        goal = float(payload.decode("ascii")) if len(payload) <= MAX_PAYLOAD else math.nan
    except ValueError:
        goal = math.nan
    least, most = thing.ends
    if not least <= goal <= most:
        raise HomeOrder(f"{name}: give a number from {least:g} to {most:g}")
    return thing, goal


def inbox_for(topics: HomeTopics) -> type[asyncio.Queue[aiomqtt.Message]]:
    """The class of a queue of messages from which a stop removes all that came before it."""

    class HomeInbox(asyncio.Queue[aiomqtt.Message]):
        def put_nowait(self, item: aiomqtt.Message) -> None:
            if str(item.topic) == topics.stop and not item.retain:
                while not self.empty():
                    self.get_nowait()
            super().put_nowait(item)

    return HomeInbox


class JointQueue:
    """Moves one joint to the newest of its goals; a new goal ends the movement before it."""

    def __init__(self, move: Callable[[float], Awaitable[None]]) -> None:
        self._move = move
        self._goal = math.nan
        self._changed = asyncio.Event()
        self._running: asyncio.Task[None] | None = None

    def put(self, goal: float) -> None:
        """Take a new goal."""
        self._goal = goal
        self._changed.set()

    def clear(self) -> None:
        """Forget the goal that waits, and end the movement."""
        self._changed.clear()
        if self._running is not None:
            self._running.cancel()

    async def run(self) -> None:
        """Carry out goals until cancelled."""
        try:
            while True:
                await self._changed.wait()
                await self._end()
                if self._changed.is_set():  # no stop came meanwhile
                    self._changed.clear()
                    self._running = asyncio.create_task(_awaited(self._move, self._goal))
                    await asyncio.sleep(PAUSE_S)
        finally:
            await self._end()

    async def _end(self) -> None:
        """End the movement, and wait until it has ended."""
        if self._running is not None:
            self._running.cancel()
            await asyncio.gather(self._running, return_exceptions=True)


async def _awaited(move: Callable[[float], Awaitable[None]], goal: float) -> None:
    await move(goal)
