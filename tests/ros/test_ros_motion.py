"""What publishers may do: each has a connection of its own, made with its first order and closed when it has gone."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from urbihw.client.errors import ClientError
from urbihw.ros.robot import motion
from urbihw.ros.robot.motion import MAX_PUBLISHERS, MovingPublishers
from urbihw.ros.subscriptions import RosSubscription

DRIVEN = "false|false|10.0|0.2|0.3|1.0|2.0|0.5"


class FakeServer:
    """Takes the place of a connection: notes what is run."""

    def __init__(self, answer: Callable[[str], Awaitable[Any]]) -> None:
        self.said: list[tuple[str, str]] = []
        self.connected = True
        self._answer = answer

    async def run(self, text: str, tag: str = "", timeout: float | None = None) -> Any:
        if text.endswith("System.time"):
            return 5.0
        self.said.append((text, tag))
        return await self._answer(text)

    async def close(self) -> None:
        self.connected = False


class Yard:
    """The publishers, and the connections that they have got."""

    def __init__(self) -> None:
        self.servers: list[FakeServer] = []
        self.publishers = MovingPublishers(self._connect)
        self.hold = asyncio.Event()
        self.hold.set()
        self.failure: Exception | None = None
        self.answer = DRIVEN

    async def _connect(self) -> Any:
        self.servers.append(FakeServer(self._run))
        return self.servers[-1]

    async def _run(self, text: str) -> Any:
        await self.hold.wait()
        if self.failure is not None:
            raise self.failure
        return self.answer

    async def settle(self) -> None:
        for _ in range(20):
            await asyncio.sleep(0)


def twist(x: float, yaw: float = 0.0) -> dict[str, Any]:
    return {"linear": {"x": x, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": yaw}}


def play(scene: Callable[[Yard], Awaitable[None]]) -> None:
    async def run() -> None:
        yard = Yard()
        await scene(yard)
        await yard.publishers.close()
        assert not any(server.connected for server in yard.servers)

    asyncio.run(run())


def test_order_with_a_dead_man() -> None:
    async def scene(yard: Yard) -> None:
        yard.publishers.drive("/tele/op", twist(0.2, 0.3))
        await yard.settle()
        ((text, tag),) = yard.servers[0].said
        assert text.startswith("drive.order(0.2, 0.3, 0.5, 5.0") and tag == "ros_tele_op"

    play(scene)


def test_newest_order_counts() -> None:
    async def scene(yard: Yard) -> None:
        yard.hold.clear()
        for x in range(1, 1000):
            yard.publishers.drive("/a", twist(float(x)))
            await asyncio.sleep(0)
        yard.hold.set()
        await yard.settle()
        assert len(yard.servers[0].said) == 2
        assert yard.servers[0].said[-1][0].startswith("drive.order(999,")

    play(scene)


def test_publisher_that_has_gone_loses_its_connection() -> None:
    async def scene(yard: Yard) -> None:
        for name in ("/a", "/b"):
            yard.publishers.drive(name, twist(0.1))
        await yard.settle()
        await yard.publishers.gone("/a")
        assert [server.connected for server in yard.servers] == [False, True]

    play(scene)


def test_trajectory_ends_with_its_publisher_and_with_the_next_one() -> None:
    message = {"joint_names": ["a"], "points": [{"positions": [1.0], "time_from_start": {"secs": 9, "nsecs": 0}}]}
    ended: list[str] = []

    async def scene(yard: Yard) -> None:
        async def answer(text: str) -> None:
            try:
                await asyncio.sleep(100)
            finally:
                ended.append(text)

        yard.publishers.follow("/a", message, ("a",))
        await yard.settle()
        yard.servers[0]._answer = answer
        for _ in range(2):
            yard.publishers.follow("/a", message, ("a",))
            await yard.settle()
        assert ended == ["{ a.val = 1 time:9 }"]
        await yard.publishers.gone("/a")
        assert len(ended) == 2

    play(scene)


@pytest.mark.parametrize("speeds", [(math.nan, 0.0), (0.0, math.inf), (1e5, 0.0)])
def test_no_speeds(speeds: tuple[float, float]) -> None:
    async def scene(yard: Yard) -> None:
        yard.publishers.drive("/a", twist(*speeds))
        await yard.settle()
        assert yard.servers == []
        assert yard.publishers.problem.startswith("/a: /cmd_vel: no speeds")

    play(scene)


def test_reason_of_a_refusal_is_kept_until_an_order_is_carried_out() -> None:
    async def scene(yard: Yard) -> None:
        yard.failure = ClientError("the motors are off\nsecond line")
        yard.publishers.drive("/a", twist(0.1))
        await yard.settle()
        assert yard.publishers.problem == "/a: the motors are off"
        yard.failure, yard.answer = None, DRIVEN.replace("false", "true", 1)
        yard.publishers.drive("/a", twist(0.1))
        await yard.settle()
        assert "somebody else has stopped or moved the base" in yard.publishers.problem
        yard.answer = DRIVEN
        yard.publishers.drive("/a", twist(0.1))
        await yard.settle()
        assert yard.publishers.problem == ""

    play(scene)


def test_so_many_publishers_and_no_more() -> None:
    async def scene(yard: Yard) -> None:
        for number in range(MAX_PUBLISHERS + 1):
            yard.publishers.drive(f"/p{number}", twist(0.1))
        await yard.settle()
        assert len(yard.servers) == MAX_PUBLISHERS
        assert "publishers move the robot already" in yard.publishers.problem

    play(scene)


def test_dead_man_is_short() -> None:
    assert motion.DEAD_MAN_S <= 0.5


class OldStream:
    """A publisher that has latched a message, and sends another one."""

    def __init__(self) -> None:
        self.left = [b"old", b"new"]

    async def receive(self) -> bytes:
        if not self.left:
            raise EOFError
        return self.left.pop(0)

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("old", "latching", "wanted"), [
    (True, "1", [b"new"]), (True, "0", [b"old", b"new"]), (False, "1", [b"old", b"new"]),
])  # fmt: skip
def test_old_order_is_not_carried_out(
    monkeypatch: pytest.MonkeyPatch, old: bool, latching: str, wanted: list[bytes]
) -> None:
    """A robot that comes back does not do what was latched before it came."""
    got: list[bytes] = []
    gone: list[str] = []

    async def greeted(*_: Any) -> tuple[Any, dict[str, str]]:
        return OldStream(), {"callerid": "/a", "latching": latching}

    async def run() -> None:
        monkeypatch.setattr("urbihw.ros.subscriptions._greeted", greeted)
        kind: Any = type("Kind", (), {"name": "k/K", "md5": "*"})()
        made = RosSubscription("/t", kind, "/us", lambda data, who: got.append(data), gone.append, True)
        made.follow(["http://x:1"], old)
        async with asyncio.timeout(5):
            while not gone:
                await asyncio.sleep(0.001)
        await made.close()

    asyncio.run(run())
    assert got[: len(wanted)] == wanted
    assert gone[0] == "/a"
