"""Orders that end before they are done: by a stop, and while they still connect."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, cast

import pytest

from urbihw.client.aio import AsyncRobot
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.neighbours.orders import OrderGiver, OrderRefused, OrderSettings

SETTINGS = OrderSettings(Where("127.0.0.1", 1, False), Credentials(), "test")


class Dialling(OrderGiver):
    """Its connections are made only when ``let`` is set."""

    def __init__(self) -> None:
        super().__init__(SETTINGS)
        self.let = asyncio.Event()
        self.dialled = 0

    async def dial(self, name: str, said: deque[str], reconnect: bool = False) -> AsyncRobot:
        self.dialled += 1
        await self.let.wait()
        raise AssertionError("an order went on behind a stop")


class Stopped:
    """A robot that takes stops, and never answers a note."""

    def __init__(self) -> None:
        self.did = list[str]()

    async def stop(self) -> None:
        self.did.append("stop")

    async def estop(self) -> None:
        self.did.append("estop")

    async def run(self, text: str, timeout: float) -> None:
        self.did.append("note")
        await asyncio.Event().wait()


@pytest.mark.parametrize("kind", ["stop", "estop"])
def test_a_stop_ends_orders_that_still_connect_and_waits_for_no_note(kind: str) -> None:
    async def use() -> None:
        giver, robot = Dialling(), Stopped()
        orders = [asyncio.create_task(giver.run("somebody", "1", 9)) for _ in range(2)]
        while giver.dialled < 2:
            await asyncio.sleep(0)
        await getattr(giver, kind)(cast(AsyncRobot, robot))
        assert robot.did == [kind]
        giver.let.set()
        for order in orders:
            with pytest.raises(OrderRefused, match="the robot was stopped"):
                await order
        assert robot.did == [kind, "note"]
        giver.let.clear()
        given_up = asyncio.create_task(giver.run("somebody", "1", 9))
        await asyncio.sleep(0)
        given_up.cancel()
        giver.end_orders()
        assert isinstance((await asyncio.gather(given_up, return_exceptions=True))[0], asyncio.CancelledError)

    asyncio.run(use())


def test_a_connection_that_is_not_introduced_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = list[object]()

    async def opened(self: object) -> None:
        pass

    async def held(self: object, *_: object, **__: object) -> Any:
        raise OSError("held")

    async def close(self: object) -> None:
        closed.append(self)

    monkeypatch.setattr("urbihw.neighbours.orders.AsyncConnection.open", opened)
    monkeypatch.setattr(AsyncRobot, "run", held)
    monkeypatch.setattr(AsyncRobot, "close", close)
    with pytest.raises(OSError, match="held"):
        asyncio.run(OrderGiver(SETTINGS).dial("somebody", deque()))
    assert len(closed) == 1
