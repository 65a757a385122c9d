"""The client library for asyncio: ``robot = await urbihw.client.aio.connect("robot.local")``.

As ``urbihw.connect``, but what asks the server is awaited: ``await robot.motor6.val``,
``await robot.motor6.val.set(0.5)``, ``async for t, v in robot.watch("motor6.val")``.  A robot belongs to one event
loop.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Callable, Generator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Never, Self, TypeVar

from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.core import LeaseTerm
from urbihw.client.errors import ClientError, SlotMissing
from urbihw.client.literals import (
    assignment_text,
    call_text,
    checked_name,
    checked_path,
    checked_slot,
    checked_text,
    checked_writes,
    literal,
    meaning_text,
    members_text,
    property_text,
    written_path,
)
from urbihw.client.robot import DEFAULT_PORT, MAX_KEPT_MESSAGES, credentials_of, split_address
from urbihw.client.session import Message, NoPlainValue, message_of
from urbihw.client.shown import first_line
from urbihw.client.streams import EventStream, SampleStream, ShotStream, Stream
from urbihw.client.values import Written, written_of
from urbihw.client.where import where_is


class AsyncSlot:
    """A slot by its path: ``await slot`` reads it, ``await slot.set(0.5)`` writes it, ``await slot(1)`` calls the
    function in it; its attributes are the slots of the object in it.  Nothing is asked before.
    """

    _connection: AsyncConnection
    _path: str

    def __init__(self, connection: AsyncConnection, path: str) -> None:
        object.__setattr__(self, "_connection", connection)
        object.__setattr__(self, "_path", path and checked_path(path))

    def slot(self, name: str) -> AsyncSlot:
        """A slot by its name or path from here, also one named like a method: ``robot.slot("run")``."""
        return AsyncSlot(self._connection, f"{self._path}.{name}" if self._path else name)

    def __getattr__(self, name: str) -> AsyncSlot:
        """A slot by its name."""
        if name.startswith("_"):
            raise AttributeError(name)
        return self.slot(name)

    def __setattr__(self, name: str, value: Never) -> None:
        """Raises AttributeError: an assignment cannot wait for the server."""
        path = f"{self._path}.{name}" if self._path else name
        raise AttributeError(f"an assignment cannot be awaited: await robot.{path}.set(value) writes the slot")

    def __dir__(self) -> list[str]:
        """Its methods; the server is not asked."""
        return sorted(name for name in dir(type(self)) if not name.startswith("_"))

    def __getitem__(self, key: str | int) -> AsyncSlot:
        """A slot by its name, or a member."""
        return self.slot(key) if isinstance(key, str) else AsyncSlot(self._connection, f"{self._path}[{int(key)}]")

    def __await__(self) -> Generator[Any, None, Any]:
        return self._get().__await__()

    async def _get(self) -> Any:
        path, limit = self._path, self._connection.timeout
        return self._wrapped(await self._connection.ask(lambda dialect, channel: dialect.read(channel, path), limit))

    async def set(self, value: Any, timeout: float | None = None, keep: bool = False, **modifiers: Any) -> None:
        """Write it, as ``Slot.set``."""
        path, text = checked_slot(self._path), literal(value)
        if not modifiers:
            limit = self._connection.timeout if timeout is None else timeout
            await self._connection.ask(lambda dialect, channel: dialect.write(channel, path, text), limit, keep=keep)
            return
        body = assignment_text(path, text, modifiers)
        await self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)

    async def __call__(self, *args: Any, timeout: float | None = None, keep: bool = False) -> Any:
        """Call the function in it, as ``Slot``."""
        body = call_text(self._path, args)
        ask = self._connection.ask
        answer = await ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)
        return self._wrapped(answer)

    async def get_property(self, name: str) -> Any:
        """A property of the slot, such as ``unit`` or ``rangemin``; None if it has none of this name."""
        return await self._evaluated(property_text(self._path, name))

    async def get_meaning(self) -> str:
        """What the value or function is, in the words of the server; "" if it says nothing."""
        return first_line(await self._evaluated(meaning_text(self._path)))

    async def __aiter__(self) -> AsyncIterator[Any]:
        """The members of a group: ``async for motor in robot.motors``.  Raises TypeError for what has none."""
        try:
            members = await self._evaluated(members_text(self.urbiscript_path()))
        except SlotMissing:
            raise TypeError(f"{self!r} cannot be iterated: it has no members") from None
        for member in members:
            yield member

    async def _evaluated(self, body: str) -> Any:
        ask, limit = self._connection.ask, self._connection.timeout
        return self._wrapped(await ask(lambda dialect, channel: dialect.evaluate(channel, body), limit))

    def urbiscript_path(self) -> str:
        """How it is written in urbiscript."""
        return written_path(self._path) or "lobby"

    def _wrapped(self, answer: Any) -> Any:
        if isinstance(answer, NoPlainValue):
            made = AsyncSlot(self._connection, "")
            # What is printed may be no path: then an error says so when a slot of it is used.
            object.__setattr__(made, "_path", self._path if answer.kind == "function" else answer.printed)
            return made
        if isinstance(answer, list):
            return [self._wrapped(member) for member in answer]
        if isinstance(answer, dict):
            return {key: self._wrapped(member) for key, member in answer.items()}
        return answer

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._path}>"


S = TypeVar("S", bound=Stream)


class AsyncItems(Generic[S]):
    """What a server sends; ``async for``, and ``async with`` to end it."""

    def __init__(self, connection: AsyncConnection, stream: S, timeout: float | None) -> None:
        self._connection = connection
        self._stream = stream
        self._timeout = timeout
        self._begun = False

    @property
    def lost(self) -> int:
        """The number of items left out so far."""
        return self._stream.lost

    async def begin(self) -> None:
        """Subscribe; otherwise done at the first item."""
        if not self._begun:
            self._begun = True
            await self._connection.open_stream(self._stream)

    async def close(self) -> None:
        """End the subscription; no further items come."""
        await self._connection.close_stream(self._stream)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Any:
        """The next item.  Raises TimedOut, or why there is no connection."""
        await self.begin()
        item = await self._connection.next_item(self._stream, self._timeout)
        if item is None:
            raise StopAsyncIteration
        return item

    async def __aenter__(self) -> Self:
        await self.begin()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()


class AsyncWatch(AsyncItems[SampleStream]):
    """Samples of slots: ``(time, values)``."""

    @property
    def slots(self) -> tuple[str, ...]:
        return self._stream.slots

    @property
    def units(self) -> tuple[str, ...]:
        return self._stream.units

    @property
    def errors(self) -> dict[str, str]:
        return dict(self._stream.errors)


class AsyncLease:
    """A lease for a block, as ``RequestLease``."""

    def __init__(self, connection: AsyncConnection, seconds: float, fed: bool) -> None:
        self._connection = connection
        self._term = LeaseTerm(float(seconds), fed)

    def feed(self) -> None:
        self._connection.sign_of_life()

    async def __aenter__(self) -> Self:
        await self._connection.begin_lease(self._term)
        self._connection.feed_lease(self._term)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            await self._connection.end_lease(self._term)
        except ClientError:
            if kind is None:
                raise


class AsyncRobot(AsyncSlot):
    """A connection to the server of a robot."""

    messages: deque[Message]

    def __init__(self, connection: AsyncConnection, messages: deque[Message]) -> None:
        super().__init__(connection, "")
        object.__setattr__(self, "messages", messages)

    async def run(self, text: str, tag: str = "", timeout: float | None = None, keep: bool = False) -> Any:
        if tag:
            checked_name(tag)
        checked_text(text)
        answer = await self._connection.ask(
            lambda dialect, channel: dialect.run(channel, text, tag), timeout, located=True, keep=keep
        )
        return self._wrapped(answer)

    async def stop(self, tag: str | None = None) -> None:
        if tag is not None:
            checked_name(tag)
        stopped = tag or "robot"
        limit = self._connection.timeout
        await self._connection.ask(lambda dialect, channel: dialect.stop(channel, stopped), limit, keep=True)

    async def estop(self) -> None:
        limit = self._connection.timeout
        await self._connection.ask(lambda dialect, channel: dialect.estop(channel), limit, keep=True)

    async def joints(self) -> list[str]:
        names: list[str] = await self._evaluated("System.jointNames(robot)")
        return names

    async def write(self, values: Mapping[str, Any], timeout: float | None = None) -> dict[str, Written]:
        texts = checked_writes(values)
        limit = self._connection.timeout if timeout is None else timeout
        told = await self._connection.ask(lambda dialect, channel: dialect.write_all(channel, texts), limit)
        return written_of(texts, told)

    async def overview(self) -> dict[str, Any]:
        told: dict[str, Any] = json.loads(await self._evaluated("System.overviewText(robot)"))
        return told

    def lease(self, seconds: float = 0.5, fed: bool = True) -> AsyncLease:
        return AsyncLease(self._connection, seconds, fed)

    def watch(self, *slots: str, hz: float = 10.0, timeout: float | None = None) -> AsyncWatch:
        return AsyncWatch(self._connection, SampleStream(slots, hz), timeout)

    def pictures(self, slot: str, hz: float = 10.0, timeout: float | None = None) -> AsyncItems[ShotStream]:
        return AsyncItems(self._connection, ShotStream(slot, hz), timeout)

    def events(self, event: str, timeout: float | None = None) -> AsyncItems[EventStream]:
        return AsyncItems(self._connection, EventStream(event), timeout)

    @property
    def connected(self) -> bool:
        return self._connection.connected

    def __repr__(self) -> str:
        state = "" if self._connection.connected else ", not connected"
        return f"<AsyncRobot at {self._connection.where}{state}>"

    async def close(self) -> None:
        """End the connection to the server."""
        self._connection.close()
        await asyncio.sleep(0)

    async def __aenter__(self) -> AsyncRobot:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()


async def connect(
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    *,
    token: str = "",
    token_file: str | Path | None = None,
    tls: bool | None = None,
    trust: bool = False,
    timeout: float = 10.0,
    reconnect: bool = True,
    lease: float = 0.0,
    on_message: Callable[[Message], None] | None = None,
) -> AsyncRobot:
    """Connect to a server; the arguments and errors are those of ``urbihw.connect``."""
    messages: deque[Message] = deque(maxlen=MAX_KEPT_MESSAGES)
    where = where_is(*split_address(host, port), tls)
    credentials = credentials_of(token, token_file, trust)
    hear = on_message or messages.append
    connection = AsyncConnection(
        where, credentials, timeout, reconnect, lambda line, at: hear(message_of(line, at)), lease=lease
    )
    await connection.open()
    return AsyncRobot(connection, messages)
