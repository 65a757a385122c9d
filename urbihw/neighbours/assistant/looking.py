"""What an assistant sees, and how it stops the robot: by one connection for all requests, made again when lost."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any, Final

from urbihw.client.aio import AsyncRobot
from urbihw.client.literals import checked_path, string_literal
from urbihw.client.media import Picture
from urbihw.extras import install_command
from urbihw.neighbours.orders import CONNECT_TIMEOUT_S, OrderGiver, OrderRefused, short, values

MAX_SLOTS: Final = 64
MAX_LOG_LINES: Final = 20
PICTURE_TIMEOUT_S: Final = 5.0


class Watcher:
    """Looks at a robot for assistants."""

    def __init__(self, actor: OrderGiver) -> None:
        self._actor = actor
        self._robot: AsyncRobot | None = None
        self._opening = asyncio.Lock()

    async def _link(self, name: str) -> AsyncRobot:
        """The connection, made if needed.  Raises ClientError."""
        async with self._opening:
            if self._robot is None or not self._robot.connected:
                self._robot = await self._actor.dial(name, deque(maxlen=1))
            return self._robot

    async def close(self) -> None:
        """End the connection to the daemon."""
        if self._robot is not None:
            await self._robot.close()

    async def overview(self, name: str) -> dict[str, Any]:
        """What moves and what measures, with the motions and poses that the robot has.  Raises ClientError."""
        robot = await self._link(name)
        told = await robot.overview()
        kept = await robot.run('if (robot.hasSlot("motions")) [robot.motions, robot.poses] else [[], []]',
                               timeout=CONNECT_TIMEOUT_S)  # fmt: skip
        return {**told, "motions": kept[0], "poses": kept[1]}

    async def look(self, name: str, slots: list[str]) -> dict[str, Any]:
        """The values of slots, and why some of them have none.  Raises ClientError, OrderRefused."""
        if not 0 < len(slots) <= MAX_SLOTS:
            raise OrderRefused(f"name 1 to {MAX_SLOTS} slots, such as those of the overview")
        found, errors = await values(await self._link(name), slots)
        return {"values": found, "errors": {slot: short(text) for slot, text in errors.items()}}

    async def picture(self, name: str, slot: str) -> bytes:
        """The newest picture of a camera, as jpeg.  Raises ClientError, OrderRefused."""
        robot = await self._link(name)
        async with robot.pictures(slot, timeout=PICTURE_TIMEOUT_S) as shots:
            while True:
                _, shot = await anext(shots)
                if shot.data:  # a camera has none at first
                    break
        if not isinstance(shot, Picture):
            raise OrderRefused(f"{slot} has no picture")
        return jpeg_of(shot)

    async def health(self, name: str) -> dict[str, Any]:
        """The problems of the robot, and the last lines of the daemon's log.  Raises ClientError."""
        robot = await self._link(name)
        problems = await robot.run("robot.problems", timeout=CONNECT_TIMEOUT_S)
        rows = json.loads(await robot.run("System.logText(0)", timeout=CONNECT_TIMEOUT_S))[-MAX_LOG_LINES:]
        return {"problems": [short(each) for each in problems],
                "log": [f"{row['level']}: {short(row['text'])}" for row in rows]}  # fmt: skip

    async def explain(self, name: str, slot: str) -> str:
        """What a slot is, in the words of the library; no function is called.  Raises ClientError, OrderRefused."""
        *holders, last = checked_path(slot).split(".")
        if "[" in slot:
            raise OrderRefused(f"name {slot} without an index")
        # A path that names a function would call it.
        holder = "".join(f".getSlot({string_literal(each)})" for each in holders)
        text = f"System.documentation(lobby{holder}, {string_literal(last)})"
        return str(await (await self._link(name)).run(text, timeout=CONNECT_TIMEOUT_S))

    async def stop(self, name: str) -> None:
        """Stop the movements of all clients.  Raises ClientError."""
        self._actor.end_orders()  # also where the connection has to be made first
        await self._actor.stop(await self._link(name))

    async def estop(self, name: str) -> None:
        """Stop the robot and hold it until a person releases it.  Raises ClientError."""
        self._actor.end_orders()
        await self._actor.estop(await self._link(name))


def jpeg_of(shot: Picture) -> bytes:
    """A picture as jpeg.  Raises OrderRefused."""
    try:
        return shot.encoded("jpeg")
    except ImportError:
        raise OrderRefused(f"pictures of the format {shot.format} need Pillow: {install_command('images')}") from None
    except (OSError, ValueError) as error:
        raise OrderRefused(str(error)) from None
