"""Our node beside a master and nodes that are not ours (``urbihw_fakes.rosgraph``): real sockets, loopback only."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Awaitable, Callable, Iterator
from typing import Any, TypeVar

import pytest

from urbihw.ros.errors import NoMaster, PeerError, RosError
from urbihw.ros.messages import MessageTypes
from urbihw.ros.node import RosNode
from urbihw.ros.orders import WINDOW, packed
from urbihw.ros.publications import MAX_UNREAD_BYTES
from urbihw.ros.worker import FollowedTopic
from urbihw_fakes.rosgraph import RosMasterFake, RosNodeFake

STRING = "std_msgs/String"
MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
SET_BOOL_MD5 = "09fb03525b03e7ea1fd3992bafd87e16"
HI = b"\x02\0\0\0hi"
T = TypeVar("T")


@pytest.fixture(scope="module")
def types() -> MessageTypes:
    return MessageTypes()


@pytest.fixture
def master() -> Iterator[RosMasterFake]:
    made = RosMasterFake()
    yield made
    made.close()


@pytest.fixture
def other(master: RosMasterFake) -> Iterator[RosNodeFake]:
    made = RosNodeFake(master, "/other")
    yield made
    made.close()


class Trial:
    """A node, and what it has received."""

    def __init__(self, node: RosNode) -> None:
        self.node = node
        self.got: asyncio.Queue[tuple[bytes, str]] = asyncio.Queue()
        self.peers: asyncio.Queue[tuple[str, bool]] = asyncio.Queue()

    def receive(self, data: bytes, who: str) -> None:
        self.got.put_nowait((data, who))

    def note_peer(self, node: str, here: bool) -> None:
        self.peers.put_nowait((node, here))

    async def thread(self, work: Callable[..., T], *arguments: Any) -> T:
        """Let the other side do something that blocks."""
        return await asyncio.to_thread(work, *arguments)


def play(types: MessageTypes, master: RosMasterFake, scene: Callable[[Trial], Awaitable[None]]) -> None:
    """Run a scene with a node, for ten seconds at most."""

    async def run() -> None:
        node = RosNode("ours", master.uri, "127.0.0.1", types)
        await node.start()
        try:
            async with asyncio.timeout(10):
                await scene(Trial(node))
        finally:
            await node.close()

    asyncio.run(run())


def test_subscription(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    other.publish("/chatter", STRING, MD5)

    async def scene(trial: Trial) -> None:
        with pytest.raises(RosError, match="/nothing is not known"):
            await trial.node.subscribe("/nothing", "", trial.receive)
        found = await trial.node.subscribe("chatter", "", trial.receive)
        peer = await trial.thread(other.subscriber)
        peer.send_message(HI)
        assert await trial.got.get() == (HI, "/other")
        assert other.greetings[0] == {
            "callerid": "/ours", "topic": "/chatter", "type": STRING, "md5sum": MD5, "tcp_nodelay": "1",
        }  # fmt: skip
        assert [*found.publishers.values()] == ["/other"]
        # A publisher that dies without a word is tried again.
        peer.close()
        (await trial.thread(other.subscriber, 1)).send_message(HI)
        await trial.got.get()
        await trial.node.unsubscribe("/chatter")
        state = await trial.node.state()
        assert state.publishers == {"/chatter": ["/other"], "/rosout": ["/ours"]} and state.subscribers == {}

    play(types, master, scene)


def test_wrong_sum_of_a_publisher(
    types: MessageTypes, master: RosMasterFake, other: RosNodeFake, caplog: pytest.LogCaptureFixture
) -> None:
    other.publish("/chatter", STRING, "0" * 32)

    async def scene(trial: Trial) -> None:
        await trial.node.subscribe("/chatter", STRING, trial.receive)
        (await trial.thread(other.subscriber)).send(b"\xff" * 100)
        while "md5 sum 00000000000000000000000000000000, not 992ce8a1" not in caplog.text:
            await asyncio.sleep(0.01)
        assert trial.got.empty()

    play(types, master, scene)


def test_huge_message_is_refused(
    types: MessageTypes, master: RosMasterFake, other: RosNodeFake, caplog: pytest.LogCaptureFixture
) -> None:
    other.publish("/chatter", STRING, MD5)

    async def scene(trial: Trial) -> None:
        await trial.node.subscribe("/chatter", STRING, trial.receive)
        (await trial.thread(other.subscriber)).send(b"\xff" * 100)
        while "announces 4294967295 bytes" not in caplog.text:
            await asyncio.sleep(0.01)

    play(types, master, scene)


def test_unknown_type_is_learnt_from_its_publisher(
    types: MessageTypes, master: RosMasterFake, other: RosNodeFake
) -> None:
    other.publish("/odd", "odd_msgs/Odd", "*", "float64 much\nstring[] names\n")

    async def scene(trial: Trial) -> None:
        found = await trial.node.subscribe("/odd", "", trial.receive)
        assert found.kind.template() == {"much": 0.0, "names": []}

    play(types, master, scene)


def test_publication(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    async def scene(trial: Trial) -> None:
        made = await trial.node.publish("/talk", STRING, True, trial.note_peer)
        made.publish(HI)
        peer, answer = await trial.thread(other.follow, "/talk", STRING, MD5)
        assert answer == {"callerid": "/ours", "type": STRING, "md5sum": MD5, "topic": "/talk", "latching": "1",
                          "message_definition": "string data\n"}
        assert await trial.peers.get() == ("/other", True)
        assert await trial.thread(peer.receive, 10) == b"\x06\0\0\0" + HI
        peer.close()
        assert await trial.peers.get() == ("/other", False)
        _, refused = await trial.thread(other.follow, "/talk", "std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a")
        assert refused["error"].startswith(f"topic /talk has type {STRING}, md5sum {MD5}, not std_msgs/Bool")
        made.publish(HI)

    play(types, master, scene)


def test_subscriber_that_never_reads(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    async def scene(trial: Trial) -> None:
        made = await trial.node.publish("/talk", STRING, on_peer=trial.note_peer)
        lazy, _ = await trial.thread(other.follow, "/talk", STRING, MD5)
        await trial.peers.get()
        large = struct.pack("<I", 1 << 20) + bytes(1 << 20)
        for _ in range(40):
            made.publish(large)
            await asyncio.sleep(0)
        assert made.dropped > 20
        assert all(
            peer.writer.transport.get_write_buffer_size() < MAX_UNREAD_BYTES + (2 << 20) for peer in made._peers
        )
        lazy.close()

    play(types, master, scene)


def test_service_of_another_node(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    other.offer("/switch", "std_srvs/SetBool", SET_BOOL_MD5)
    answer = b"\x01" + HI
    other.replies = [b"\x01" + struct.pack("<I", len(answer)) + answer, b"\0\x04\0\0\0oops"]

    async def scene(trial: Trial) -> None:
        with pytest.raises(RosError, match="no service /none"):
            await trial.node.caller("/none")
        caller = await trial.node.caller("/switch", keep_open=True)
        assert await caller.call({"data": True}) == {"success": True, "message": "hi"}
        with pytest.raises(PeerError, match="service /switch: oops"):
            await caller.call({"data": False})
        assert other.requests == [b"\x01", b"\x00"]
        assert [greeting.get("probe") for greeting in other.greetings] == ["1", None]
        with pytest.raises(RosError, match="no such field: date"):
            await caller.call({"data": False, "date": 1})

    play(types, master, scene)


def test_service_of_ours(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    async def answer(request: dict[str, Any]) -> dict[str, Any]:
        if not request["data"]:
            raise RosError("not today")
        return {"success": True, "message": "hi"}

    async def scene(trial: Trial) -> None:
        await trial.node.offer("/switch", "std_srvs/SetBool", answer)
        link, told = await trial.thread(lambda: other.call("/switch", md5sum=SET_BOOL_MD5, persistent="1"))
        assert told["type"] == "std_srvs/SetBool" and told["request_type"] == "std_srvs/SetBoolRequest"
        link.send_message(b"\x01")
        assert await trial.thread(link.receive, 12) == b"\x01\x07\0\0\0\x01" + HI
        link.send_message(b"\x00")
        assert await trial.thread(link.receive, 14) == b"\0\x09\0\0\0not today"
        link.close()
        _, refused = await trial.thread(lambda: other.call("/switch", md5sum=MD5))
        assert "service /switch has type std_srvs/SetBool" in refused["error"]

    play(types, master, scene)


@pytest.mark.parametrize("told", [3, "no", [], [1, 2, 3], [[["/a"]], [], []]])
def test_odd_answer_of_a_master(
    types: MessageTypes, master: RosMasterFake, monkeypatch: pytest.MonkeyPatch, told: Any
) -> None:
    """It is an error of ROS, whose text the program gets."""
    monkeypatch.setattr(master, "api_getSystemState", lambda node: [1, "", told])
    monkeypatch.setattr(master, "api_getTopicTypes", lambda node: [1, "", [told]])

    async def scene(trial: Trial) -> None:
        with pytest.raises(PeerError, match="an answer of another form"):
            await trial.node.state()
        if told != [1, 2, 3]:
            with pytest.raises((PeerError, RosError)):
                await trial.node.subscribe("/a", "", trial.receive)

    play(types, master, scene)


def test_service_that_is_withdrawn_sends_its_callers_away(
    types: MessageTypes, master: RosMasterFake, other: RosNodeFake
) -> None:
    asked = asyncio.Event()

    async def answer(request: dict[str, Any]) -> dict[str, Any]:
        asked.set()
        await asyncio.sleep(100)
        return {}

    async def scene(trial: Trial) -> None:
        await trial.node.offer("/mute", "std_srvs/SetBool", answer)
        link, _ = await trial.thread(lambda: other.call("/mute", md5sum=SET_BOOL_MD5, persistent="1"))
        link.send_message(b"\x01")
        await asked.wait()
        await trial.node.withdraw("/mute")
        assert await trial.thread(link.receive, 1) == b""

    play(types, master, scene)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70000), ("a" * 70 + ".b", 1), ("..", 1)])
def test_address_of_a_publisher_that_is_none(
    types: MessageTypes, master: RosMasterFake, other: RosNodeFake, monkeypatch: pytest.MonkeyPatch, host: str,
    port: int,
) -> None:  # fmt: skip
    """It is tried again, and followed when it tells another address."""
    monkeypatch.setattr("urbihw.ros.subscriptions.FIRST_PAUSE_S", 0.01)
    other.place = host, port
    other.publish("/chatter", STRING, MD5)

    async def scene(trial: Trial) -> None:
        await trial.node.subscribe("/chatter", STRING, trial.receive)
        while other.asked < 2:
            await asyncio.sleep(0.01)
        other.place = None
        (await trial.thread(other.subscriber)).send_message(HI)
        assert await trial.got.get() == (HI, "/other")

    play(types, master, scene)


def test_message_that_is_too_large_for_urbiscript_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.ros.orders.MAX_PICKLE_BYTES", 1000)
    said: list[Any] = []

    def say(what: Any) -> None:
        packed(what)
        said.append(what)

    async def scene() -> None:
        topic = FollowedTopic(say, "/map")
        topic.subscription = type("Found", (), {"kind": type("Kind", (), {"decode": lambda self, data: data})()})()
        for _ in range(3 * WINDOW):
            topic.receive(bytes(2000), "/a")
        assert said == []
        topic.receive(b"small", "/a")
        assert [(each.message, each.missed) for each in said] == [(b"small", 3 * WINDOW)]

    asyncio.run(scene())


def test_master_that_is_started_anew(
    types: MessageTypes, master: RosMasterFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urbihw.ros.node.WATCH_PERIOD_S", 0.02)

    async def scene(trial: Trial) -> None:
        await trial.node.publish("/talk", STRING)
        while "getPid" not in master.calls:
            await asyncio.sleep(0.01)
        await trial.thread(master.close)
        with pytest.raises(NoMaster, match="no ROS master"):
            await trial.node.state()
        again = RosMasterFake(master.port)
        try:
            while again.calls.count("registerPublisher") < 2:
                await asyncio.sleep(0.01)
            assert (await trial.node.state()).publishers == {"/talk": ["/ours"], "/rosout": ["/ours"]}
        finally:
            await trial.thread(again.close)

    play(types, master, scene)


def test_nobody_else_gets_anything(types: MessageTypes, master: RosMasterFake, other: RosNodeFake) -> None:
    """Wrong requests to the two servers of a node: each is answered or dropped, and the node goes on."""

    async def scene(trial: Trial) -> None:
        made = await trial.node.publish("/talk", STRING)
        for data in (b"GET / HTTP/1.1\r\n\r\n", b"x" * 40000, b"POST / HTTP/1.1\r\nContent-Length: 99999999\r\n\r\n",
                     b"POST / HTTP/1.1\r\nContent-Length: 3\r\n\r\n<a>"):
            assert await trial.thread(_spoken, trial.node._rpc.uri, data) == b""
        for data in (b"\xff\xff\xff\xff", b"\x05\0\0\0\x01\0\0\0a"):
            assert await trial.thread(_spoken, f"http://127.0.0.1:{trial.node._port}/", data) == b""
        _, refused = await trial.thread(lambda: other.greet("127.0.0.1", trial.node._port, topic="/no", md5sum="*"))
        assert refused["error"] == "this node has no topic '/no'"
        peer, _ = await trial.thread(other.follow, "/talk", "*", "*")
        made.publish(HI)
        assert await trial.thread(peer.receive, 10) == b"\x06\0\0\0" + HI
        peer.close()

    play(types, master, scene)


BODY = (
    b"<methodCall><methodName>publisherUpdate</methodName><params><param><value>/m</value></param><param><value>/talk"
    b"</value></param><param><value><array><data/></array></value></param></params></methodCall>"
)


@pytest.mark.parametrize(("fields", "taken"), [
    (b"Content-Type: text/xml\r\n", True), (b"Content-Type: text/plain\r\n", False), (b"", False),
    (b"Content-Type: text/xml\r\nOrigin: http://evil.example\r\n", False),
])  # fmt: skip
def test_web_page_reaches_nothing(types: MessageTypes, master: RosMasterFake, fields: bytes, taken: bool) -> None:
    async def scene(trial: Trial) -> None:
        request = b"POST / HTTP/1.1\r\n%sContent-Length: %d\r\n\r\n" % (fields, len(BODY))
        answer = await trial.thread(_spoken, trial.node._rpc.uri, request + BODY)
        assert answer.startswith(b"HTTP/1.1 200 OK") is taken

    play(types, master, scene)


def _spoken(uri: str, data: bytes) -> bytes:
    """What is answered to some bytes until the end."""
    host, port = uri.removeprefix("http://").strip("/").split(":")
    with socket.create_connection((host, int(port)), 5) as made:
        made.sendall(data)
        try:
            return made.recv(1 << 16)
        except ConnectionResetError:
            return b""


def test_listens_on_this_machine_only(
    types: MessageTypes, master: RosMasterFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_IP", raising=False)
    monkeypatch.delenv("ROS_HOSTNAME", raising=False)

    async def run() -> None:
        node = RosNode("ours", master.uri, types=types)
        await node.start()
        servers = [node._server, node._rpc._server]
        assert {each.sockets[0].getsockname()[0] for each in servers if each is not None} == {"127.0.0.1"}
        await node.close()

    asyncio.run(run())
