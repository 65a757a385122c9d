"""Orders for a robot that somebody gives by another program: an assistant, a home.

Each has a connection of its own with a lease: so nothing moves on when the request is given up, when the other program
or this process is killed or held, or when the order has ended; and two orders do not end each other.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import field
from typing import Any, Final

from urbihw.client.aio import AsyncRobot
from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.credentials import Credentials
from urbihw.client.errors import ClientError, TimedOut
from urbihw.client.literals import literal, string_literal, written_path
from urbihw.client.session import message_of
from urbihw.client.where import Where
from urbihw.frozen import frozen

CONNECT_TIMEOUT_S: Final = 10.0
MAX_ORDERS: Final = 4
"""Orders at a time."""
MAX_SAID: Final = 5
"""Lines that the robot says meanwhile, of which the last are passed on."""
MAX_TEXT: Final = 300
"""Characters of a text of the robot that are passed on: it may be written by anybody, for an assistant to read."""
DIGITS: Final = 4
MAX_JOINTS: Final = 64
SETTLE_HZ: Final = 20
"""Samples a second, and the most of them, in which joints may come to rest at the end of a movement."""
SETTLED: Final = 4
"""Samples that are alike."""
STANDING: Final = 0.003
"""How far apart these are at most, in seconds of the way at the greatest speed."""
MAX_NOTE: Final = 190
MAX_NAME: Final = 60


SPEEDS: Final[Mapping[str, float]] = {"rad": 1.0, "deg": 57.3, "turn": 0.16, "m": 0.1}
"""Greatest speed of a joint on its way, by the unit of its goal, each in a second."""


@frozen(slots=False)
class OrderSettings:
    """Whose orders these are.

    Attributes:
        where: the daemon.
        credentials: those for a daemon that wants a token.
        kind: what gives them, in one word, for the log: assistant, home.
        lease: seconds after which what is moved stands when this process is held.
        speeds: greatest speeds of joints by their unit.
    """

    where: Where
    credentials: Credentials
    kind: str
    lease: float = 1.0
    speeds: Mapping[str, float] = field(default_factory=lambda: SPEEDS)


class OrderRefused(Exception):
    """An order that may not be given, or that makes no sense; the text is for who has given it."""


def short(text: object) -> str:
    """A text of the robot in one line, not too long."""
    line = "".join(each if each.isprintable() else " " for each in str(text))
    return line if len(line) <= MAX_TEXT else line[: MAX_TEXT - 4] + " ..."


def plain(text: str, most: int) -> str:
    """A text of another program in so many letters at most that urbiscript and the log can have: ASCII, in one line,
    which tells that it is cut."""
    line = "".join(each if each.isprintable() else " " for each in text)
    whole = line.encode("ascii", "backslashreplace").decode()
    end = f" ... ({len(text)} characters)"
    return whole if len(whole) <= most else whole[: most - len(end)] + end


class OrderGiver:
    """Gives orders to a robot; ``name`` is that of the other program."""

    def __init__(self, settings: OrderSettings) -> None:
        self.settings = settings
        self._running: dict[asyncio.Task[Any], bool] = {}
        """The tasks of the orders -> whether a stop has ended them."""
        self._notes: set[asyncio.Task[None]] = set()

    async def dial(self, name: str, said: deque[str], reconnect: bool = False) -> AsyncRobot:
        """A connection with the name of the other program; ``said`` gets what the robot says.  Raises ClientError."""
        settings = self.settings
        connection = AsyncConnection(
            settings.where, settings.credentials, CONNECT_TIMEOUT_S, reconnect,
            lambda line, at: said.append(short(message_of(line, at).text)),
        )  # fmt: skip
        robot = AsyncRobot(connection, deque())
        try:
            await connection.open()
            await robot.run(f"lobby.introduce({string_literal(self.label(name))})|;", timeout=CONNECT_TIMEOUT_S)
        except BaseException:
            await robot.close()
            raise
        return robot

    def label(self, name: str) -> str:
        """The name of the connections for another program."""
        return f"{plain(name, MAX_NAME).strip() or 'unnamed'} ({self.settings.kind})"

    @asynccontextmanager
    async def order(self, name: str, words: str) -> AsyncIterator[tuple[AsyncRobot, deque[str]]]:
        """A connection for one order, with a lease, and what the robot says meanwhile.  The order is in the log of the
        daemon, in words."""
        if len(self._running) >= MAX_ORDERS:
            raise OrderRefused(f"{MAX_ORDERS} orders are carried out already")
        said: deque[str] = deque(maxlen=MAX_SAID)
        with self._ended_by_stops():
            async with await self.dial(name, said) as robot:
                await note(robot, words)
                async with robot.lease(self.settings.lease):
                    yield robot, said

    @contextmanager
    def _ended_by_stops(self) -> Iterator[None]:
        """A block that a stop ends with OrderRefused; who gives the order up meanwhile still cancels it."""
        task = asyncio.current_task()
        assert task is not None
        cancelled_before = task.cancelling()
        self._running[task] = False
        try:
            yield
        except asyncio.CancelledError:
            if self._running[task] and task.uncancel() <= cancelled_before:
                raise OrderRefused("it was ended: the robot was stopped") from None
            raise
        finally:
            del self._running[task]

    def end_orders(self) -> None:
        """End all orders, also those that still connect."""
        for task, is_ended in self._running.items():
            if not is_ended:
                self._running[task] = True
                task.cancel()

    async def stop(self, robot: AsyncRobot) -> None:
        """End all orders and stop the movements of all clients.  Raises ClientError."""
        self.end_orders()
        await robot.stop()
        self._note_behind(robot, "stops the robot")

    async def estop(self, robot: AsyncRobot) -> None:
        """End all orders, stop the robot and hold it until a person releases it.  Raises ClientError."""
        self.end_orders()
        await robot.estop()
        self._note_behind(robot, "presses the emergency stop")

    def _note_behind(self, robot: AsyncRobot, words: str) -> None:
        """Write a note in a task of its own, so that the next stop does not wait for it."""
        task = asyncio.create_task(note(robot, words))
        self._notes.add(task)
        task.add_done_callback(self._notes.discard)

    async def move(self, name: str, goals: Mapping[str, float], speed: float, seconds: float) -> dict[str, Any]:
        """Move joints to their goals at the same time, no faster than ``speed`` (units of the goal in a second) and
        the limit of the settings; ``seconds`` is the longest that it may take.  Raises OrderRefused, ClientError."""
        if not 0 < len(goals) <= MAX_JOINTS:
            raise OrderRefused(f"name 1 to {MAX_JOINTS} joints with their goals")
        async with self.order(name, f"moves {_words(goals)}") as (robot, said):
            joints = {row["slot"]: row for row in (await robot.overview())["effectors"] if row["role"] == "joint"}
            slots = {_slot(joint, joints): goal for joint, goal in goals.items()}
            moves = []
            for slot, goal in slots.items():
                unit = joints[slot].get("unit", "")
                most = self.settings.speeds.get(unit)
                if most is None:
                    raise OrderRefused(f"{slot} has the unit {unit!r}: its speed would have no limit")
                moves.append(f"{written_path(slot)} = {_number(goal)} speed:{_number(min(most, speed))}")
            await _carried_out(robot, f"{{ {' & '.join(moves)} }}|;", seconds)
            await _settled(robot, list(slots))
            told, _ = await values(robot, [each for slot in slots for each in (slot, _beside(slot, "limitedBy"))])
            return {"now": {slot: told[slot] for slot in slots},
                    "limitedBy": {slot: by for slot in slots if (by := told[_beside(slot, "limitedBy")])},
                    "said": list(said)}  # fmt: skip

    async def go(
        self, name: str, x: float, y: float, heading: float | None, ahead: bool, seconds: float
    ) -> dict[str, Any]:
        """Drive a base to a place, m and rad: of the map, or ``ahead``, seen from where it stands.  Raises ClientError,
        OrderRefused for a robot that does not drive."""
        place = f"[{', '.join(_number(each) for each in (x, y, heading) if each is not None)}]"
        async with self.order(name, f"drives to {x:g}, {y:g} {'ahead' if ahead else 'on the map'}") as (robot, said):
            if not await robot.run('Global.hasLocalSlot("robot") && robot.isA(Interface.Mobile)', timeout=seconds):
                raise OrderRefused("this robot does not drive")
            toward = f'Math.atan2({_number(y)} - robot.position["y"], {_number(x)} - robot.position["x"])'
            pose = f"[{_number(x)}, {_number(y)}, {toward if heading is None else _number(heading)}]"
            path = (f'if (robot.hasSlot("planner") && robot.planner.ready) robot.moveTo({pose}) '
                    f"else robot.goToAbsolute({place})")  # fmt: skip
            await _carried_out(robot, f"{{ {f'robot.goTo({place})' if ahead else path} }}|;", seconds)
            told, _ = await values(robot, ["robot.position"])
            return {**told, "said": list(said)}

    async def play(self, name: str, motion: str, speed: float, pose: bool, seconds: float) -> dict[str, Any]:
        """Play a recorded motion, or go to a kept pose, at a share of its speed, at most 1.  Raises ClientError."""
        verb = "pose" if pose else "play"
        async with self.order(name, f"{verb}s {motion}") as (robot, said):
            text = f"robot.{verb}({string_literal(motion)}, {_number(min(1.0, speed))})|;"
            await _carried_out(robot, text, seconds)
            await _settled(robot, [f"{joint}.val" for joint in await robot.joints()])
            return {"ended": motion, "said": list(said)}

    async def run(self, name: str, text: str, seconds: float) -> dict[str, Any]:
        """Run urbiscript; what it has in the background ends with it.  Raises ClientError."""
        async with self.order(name, f"runs {text}") as (robot, said):
            value = await _carried_out(robot, text, seconds)
            return {"value": short(value), "said": list(said)}


async def note(robot: AsyncRobot, words: str) -> None:
    """Write what is done into the log of the daemon, if it takes it: it takes only some lines a second."""
    with suppress(ClientError):
        await robot.run(f"lobby.note({string_literal(plain(words, MAX_NOTE))})|;", timeout=CONNECT_TIMEOUT_S)


async def values(robot: AsyncRobot, slots: list[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """The values of slots, by a subscription, which calls no function: None for what cannot be read, and the reasons.
    Raises ClientError, ValueError for what is no path."""
    async with robot.watch(*slots, hz=50, timeout=CONNECT_TIMEOUT_S) as samples:
        _, found = await anext(samples)
        return {slot: _shown(value) for slot, value in zip(slots, found, strict=True)}, samples.errors


def _shown(value: Any) -> Any:
    """A value with four digits behind the point, and short texts."""
    if isinstance(value, str):
        return short(value)
    if isinstance(value, list):
        return [_shown(each) for each in value]
    if isinstance(value, dict):
        return {short(key): _shown(each) for key, each in value.items()}
    return round(value, DIGITS) if isinstance(value, float) else value


async def _carried_out(robot: AsyncRobot, text: str, seconds: float) -> Any:
    try:
        return await robot.run(text, timeout=seconds)
    except TimedOut:
        raise OrderRefused(f"it was not done within {seconds:g} s: it was ended, and the robot stopped") from None


async def _settled(robot: AsyncRobot, slots: list[str]) -> None:
    """Wait until joints stand, which follow the course of their goals a little behind it: the end of the order stops
    them where they are."""
    if not slots:
        return
    async with robot.watch(*slots, hz=SETTLE_HZ, timeout=CONNECT_TIMEOUT_S) as samples:
        before: list[tuple[Any, ...]] = []
        async for _, found in samples:
            before = [*before[-SETTLE_HZ:], found]
            rows = list(zip(before[max(0, len(before) - SETTLED)], found, samples.units, strict=True))
            stand = all(_same(then, now, unit) for then, now, unit in rows)
            if stand and len(before) >= SETTLED or len(before) > SETTLE_HZ:
                return


def _same(then: Any, now: Any, unit: str) -> bool:
    """Whether a joint stands; one that cannot be read is not waited for."""
    if not (isinstance(then, int | float) and isinstance(now, int | float)):
        return True
    return abs(now - then) < STANDING * SPEEDS.get(unit, 1.0)


def _slot(joint: str, joints: Mapping[str, Any]) -> str:
    """The slot of a joint that was named with or without it.  Raises OrderRefused."""
    slot = joint if joint in joints else f"{joint}.val"
    if slot not in joints:
        raise OrderRefused(f"there is no joint {short(joint)}; there are: {', '.join(joints)}")
    return slot


def _number(value: float) -> str:
    """A number as urbiscript writes it.  Raises OrderRefused for what no goal can be."""
    if not math.isfinite(value):
        raise OrderRefused(f"{value} is no goal")
    return literal(float(value))


def _beside(slot: str, name: str) -> str:
    return f"{slot.rpartition('.')[0]}.{name}"


def _words(goals: Mapping[str, float]) -> str:
    return ", ".join(f"{joint} to {goal:g}" for joint, goal in goals.items())

