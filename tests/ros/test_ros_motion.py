"""What publishers may do: each has a connection of its own, made with its first order and closed when it has gone."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from urbihw.client.errors import ClientError
from urbihw.ros.errors import PeerError
from urbihw.ros.messages import MessageTypes
from urbihw.ros.robot import motion
from urbihw.ros.robot.bridge import RosRobot, RosRobotSettings, RosStop
from urbihw.ros.robot.motion import MAX_PUBLISHERS, MovingPublishers
from urbihw.ros.robot.parts import RosParts
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


class Follower:
    """A subscription whose publisher is ``streams``, one connection after the other; None for one that fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, latching: str, streams: list[OldStream | None]) -> None:
        self.got: list[bytes] = []
        self.old: list[bytes] = []
        self.gone: list[str] = []
        self._latching, self._streams = latching, streams
        monkeypatch.setattr("urbihw.ros.subscriptions._greeted", self._greeted)
        monkeypatch.setattr("urbihw.ros.subscriptions.FIRST_PAUSE_S", 0.001)

    async def _greeted(self, *_: Any) -> tuple[Any, dict[str, str]]:
        if not self._streams:
            await asyncio.sleep(100)
        stream = self._streams.pop(0)
        if stream is None:
            raise PeerError("not yet")
        return stream, {"callerid": "/a", "latching": self._latching}

    def run(self, old: bool, ends: int = 1) -> None:
        """Follow until so many connections have ended."""

        async def scene() -> None:
            kind: Any = type("Kind", (), {"name": "k/K", "md5": "*"})()
            made = RosSubscription("/t", kind, "/us", lambda data, who: self.got.append(data), self.gone.append,
                                   lambda data, who: self.old.append(data))
            made.follow(["http://x:1"], old)
            async with asyncio.timeout(5):
                while len(self.gone) < ends:
                    await asyncio.sleep(0.001)
            await made.close()

        asyncio.run(scene())
        assert self.gone[0] == "/a"


@pytest.mark.parametrize(("old", "latching", "wanted"), [
    (True, "1", [b"new"]), (True, "0", [b"old", b"new"]), (False, "1", [b"old", b"new"]),
])  # fmt: skip
def test_old_order_is_not_carried_out(
    monkeypatch: pytest.MonkeyPatch, old: bool, latching: str, wanted: list[bytes]
) -> None:
    """A robot that comes back does not do what was latched before it came."""
    follower = Follower(monkeypatch, latching, [OldStream()])
    follower.run(old)
    assert follower.got == wanted
    assert follower.old == [b"old"][: 2 - len(wanted)]


def test_first_order_after_a_failed_attempt_is_new(monkeypatch: pytest.MonkeyPatch) -> None:
    follower = Follower(monkeypatch, "1", [None, OldStream(), OldStream()])
    follower.run(old=False, ends=2)
    assert follower.got == [b"old", b"new", b"new"] and follower.old == [b"old"]


def test_first_order_of_a_publisher_that_had_latched_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.ros.subscriptions.OLD_S", 0.0)
    follower = Follower(monkeypatch, "1", [OldStream()])
    follower.run(old=True)
    assert follower.got == [b"old", b"new"] and follower.old == []


class HeldWorker:
    """A control socket that answers when it is let."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.free = asyncio.Event()

    async def ask(self, verb: str, who: str) -> None:
        self.asked.append(verb)
        await self.free.wait()


@pytest.mark.parametrize(("said", "wanted"), [
    ([True], ["estop"]), ([False], ["release"]),
    ([True, False] * 500, ["estop", "estop", "release"]),
    ([False, True] * 500, ["release", "estop"]),
])  # fmt: skip
def test_stops_of_a_flood_are_one_order_at_a_time(said: list[bool], wanted: list[str]) -> None:
    async def scene() -> None:
        worker: Any = HeldWorker()
        stop = RosStop(worker)
        for number, held in enumerate(said):
            stop.hold("/button", held)
            if number == 0:
                await asyncio.sleep(0)
        assert worker.asked == wanted[:1]
        worker.free.set()
        for _ in range(10):
            await asyncio.sleep(0)
        assert worker.asked == wanted
        stop.hold("/button", True)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert worker.asked == [*wanted, "estop"]

    asyncio.run(scene())


@pytest.mark.parametrize(("latched", "wanted"), [(b"\1", [True]), (b"\0", [])])
def test_latched_stop_is_never_too_old(latched: bytes, wanted: list[bool]) -> None:
    """Of what a button had latched before the node came, a stop is taken, and a release is not."""
    taken: list[bool] = []

    class Node:
        async def subscribe(self, topic: str, kind: str, receive: Any, gone: Any, receive_old: Any) -> Any:
            self.receive_old = receive_old
            return type("Found", (), {"kind": MessageTypes().find(kind)})()

    async def scene() -> None:
        robot, node = RosRobot(RosRobotSettings("127.0.0.1", 1, None)), Node()
        robot._stop = type("Stop", (), {"hold": lambda self, who, held: taken.append(held)})()
        await robot._listen(node, RosParts("r", (), False, (), (), (), "", "", ""))  # type: ignore[arg-type]
        node.receive_old(latched, "/button")

    asyncio.run(scene())
    assert taken == wanted
