"""Ros, Ros.Topic and Ros.Service of urbiscript: a real kernel, the real process, a master and nodes that are not ours.

All scenes share one process, since its start takes half a second.
"""

from __future__ import annotations

import pickle
import re
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.orders import WINDOW, Order, TopicMessage
from urbihw.ros.script import ROS_LIBRARY
from urbihw.ros.script.link import ros_link
from urbihw.ros.script.ros import offers_of
from urbihw.ros.script.topic import MAX_TOPICS
from urbihw_fakes.rosgraph import RosMasterFake, RosNodeFake

MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
SET_BOOL_MD5 = "09fb03525b03e7ea1fd3992bafd87e16"
PATIENCE_S = 10.0


class Stage:
    """A kernel in real time, run by the thread of the test."""

    def __init__(self, master: RosMasterFake) -> None:
        self.master = master
        self._news = threading.Event()
        self._unread: dict[Lobby, str] = {}
        self.kernel = Kernel(wake_host=self._news.set, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))
        self.kernel.programs.quiet = True
        self.lobby = self.open()

    def open(self) -> Lobby:
        return self.kernel.open_lobby("127.0.0.1")

    def until(self, done: Callable[[], bool]) -> None:
        """Run the kernel until something has happened."""
        limit = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < limit, "it does not happen"
            self._news.clear()
            if self.kernel.run() is None or not done():
                self._news.wait(0.005)

    def say(self, text: str, lobby: Lobby | None = None) -> list[str]:
        """Type statements; the answers, without stamps, up to the end of the last statement."""
        asked = lobby or self.lobby
        asked.feed(text.encode("latin-1") + b"; echo(\"over\");")
        lines = self._take(asked, "*** over\n").splitlines()[:-1]
        return [re.sub(r"^\[\d+(:\w+)?\] (!!! \S+: )?", lambda m: "!!! " if m[2] else "", line) for line in lines]

    def heard(self, wanted: str) -> str:
        """Wait for a line; all that was said until then."""
        return self._take(self.lobby, wanted)

    def _take(self, lobby: Lobby, wanted: str) -> str:
        """Wait for a text; the output to the end of its line.  The rest is for the next one."""

        def done() -> bool:
            self._unread[lobby] = self._unread.get(lobby, "") + lobby.output.take_bytes().decode("latin-1")
            return wanted in self._unread[lobby]

        self.until(done)
        found = self._unread[lobby]
        end = found.index("\n", found.index(wanted) + len(wanted) - 1) + 1
        self._unread[lobby] = found[end:]
        return found[:end]


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    master = RosMasterFake()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_MASTER_URI", master.uri)
        for name in ("ROS_IP", "ROS_HOSTNAME"):
            patch.delenv(name, raising=False)
        made = Stage(master)
        yield made
        channel = ros_link(made.kernel.world)._channel
        if channel is not None:
            channel.abort()
            made.until(lambda: channel.over)
        made.kernel.close()
    master.close()


@pytest.fixture
def other(stage: Stage) -> Iterator[RosNodeFake]:
    made = RosNodeFake(stage.master, "/other")
    yield made
    made.close()


def in_thread(stage: Stage, work: Callable[..., Any], *arguments: Any) -> Any:
    """Let the other side do something that blocks, while the kernel runs."""
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(work(*arguments)))
    thread.start()
    stage.until(lambda: not thread.is_alive())
    return found[0]


def test_graph(stage: Stage, other: RosNodeFake) -> None:
    other.publish("/chatter", "std_msgs/String", MD5)
    assert stage.say('Global.hasLocalSlot("Ros"); Ros.checkMaster; Ros.version') == ["true", "true", "1"]
    assert stage.say('Ros.nodes["/other"]["publish"]; Ros.topics["/chatter"]') == [
        '["/chatter"]', '["publishers" => ["/other"], "subscribers" => [], "type" => "std_msgs/String"]',
    ]  # fmt: skip
    assert stage.say("Ros.nodes.keys.has(Ros.name); Ros.nodes[Ros.name][\"publish\"]") == ["true", '["/rosout"]']
    (name,) = stage.say("Ros.name")
    assert re.fullmatch(r'"/urbi_\d{19}"', name)


def test_listening_as_in_the_tutorial(stage: Stage, other: RosNodeFake) -> None:
    other.publish("/chatter", "std_msgs/String", MD5)
    assert stage.say('var chatter = Ros.Topic.new("/chatter")|; chatter.structure.isVoid') == ["true"]
    assert stage.say("chatter.subscribe") == []
    peer = in_thread(stage, other.subscriber)
    assert stage.say("chatter.structure; var chatTag = Tag.new|; chatTag: at (chatter.onMessage?(var e)) echo(e)") == [
        '["data" => ""]'
    ]
    peer.send_message(b"\x04\0\0\0\xc3\xa9 4")
    assert '*** ["data" => "\\xc3\\xa9 4"]' in stage.heard("] ***")
    assert stage.say("chatter.subscribe") == ["!!! subscribe: /chatter: already subscribed"]
    assert stage.say("chatTag.freeze; chatTag.unfreeze; chatter.unsubscribe; chatter.unsubscribe") == [
        "!!! unsubscribe: /chatter: not subscribed"
    ]
    assert "/chatter" not in stage.say("Ros.nodes[Ros.name]")[-1]
    assert stage.say('Ros.Topic.new("/nothing").subscribe') == [
        "!!! subscribe: topic /nothing is not known: no node has told its type"
    ]
    assert stage.say('Ros.Topic.new("/a-b")') == ["!!! new: invalid name '/a-b': letters, digits, / and _ only"]


def test_talking_as_in_the_tutorial(stage: Stage, other: RosNodeFake) -> None:
    assert stage.say("""var talker = Ros.Topic.new("/talk")|;
        at (talker.onConnect?(var n)) echo("came " + n);
        at (talker.onDisconnect?(var n)) echo("went " + n);
        talker << ["data" => "early"];
        talker.advertise("std_msgs/String");
        var msg = talker.structure.new; msg["data"] = "Hello ROS world"|; talker.subscriberCount""") == [
        "!!! <<: /talk: not advertised", '["data" => ""]', "0",
    ]  # fmt: skip
    peer, _ = in_thread(stage, other.follow, "/talk", "std_msgs/String", MD5)
    stage.heard("*** came /other")
    assert stage.say("(talker << msg) === talker; talker.subscriberCount") == ["true", "1"]
    assert in_thread(stage, peer.receive, 23) == b"\x13\0\0\0\x0f\0\0\0Hello ROS world"
    assert stage.say('talker.publish([=>]); talker.publish(["data" => 3]); talker.publish(["data" => Object])') == [
        "!!! publish: missing field: data", "!!! publish: data must be a string, not 3.0",
        '!!! publish: message["data"]: a message holds numbers, strings, lists and dictionaries, not Object',
    ]  # fmt: skip
    assert stage.say('var again = Ros.Topic.new("/talk")|; again.advertise("std_msgs/Bool")') == [
        "!!! advertise: topic /talk is published with type std_msgs/String, not std_msgs/Bool"
    ]
    peer.close()
    stage.heard("*** went /other")
    assert stage.say('talker.unadvertise; talker.subscriberCount; Ros.topics["/talk"]["publishers"]') == ["0", "[]"]
    assert stage.say('talker.advertise("no_msgs/No")') == [
        "!!! advertise: message type no_msgs/No is not known here: add its folder to ROS_PACKAGE_PATH"
    ]


def test_picture_is_a_binary(stage: Stage, other: RosNodeFake) -> None:
    stage.say("""var camera = Ros.Topic.new("/camera")|; camera.advertise("sensor_msgs/CompressedImage", true);
        var m = camera.structure|; m["format"] = "jpeg"|; m["data"] = Binary.new("jpeg", "\\xff\\xd8")|; camera << m""")
    peer, _ = in_thread(stage, other.follow, "/camera", "sensor_msgs/CompressedImage", "*")
    assert in_thread(stage, peer.receive_message) == bytes(16) + b"\x04\0\0\0jpeg" + b"\x02\0\0\0\xff\xd8"
    assert stage.say('var eye = Ros.Topic.new("/camera")|; at (eye.onMessage?(var e)) echo(e["data"]); eye.subscribe') \
        == []  # fmt: skip
    assert "BIN 2" in stage.heard("*** BIN")
    stage.say("eye.unsubscribe; camera.unadvertise")


def test_service(stage: Stage, other: RosNodeFake) -> None:
    other.offer("/switch", "std_srvs/SetBool", SET_BOOL_MD5)
    other.replies = [b"\x01\x07\0\0\0\x01\x02\0\0\0hi", b"\0\x04\0\0\0oops"]
    assert stage.say("""var s = Ros.Service.new("/switch", true)|; waituntil(s.initialized); s.name; s.reqStruct;
        s.resStruct; s.request(["data" => true]); s.request(["data" => false]); s.request([=>])""") == [
        '"/switch"', '["data" => false]', '["message" => "", "success" => false]',
        '["message" => "hi", "success" => true]', "!!! request: service /switch: oops",
        "!!! request: missing field: data",
    ]  # fmt: skip
    assert stage.say('Ros.Service.new("/none", false)') == ["!!! new: no service /none"]


def test_call_suspends_its_job_only(stage: Stage, other: RosNodeFake) -> None:
    """A service that never answers holds one job; its stop ends the call."""
    other.offer("/mute", "std_srvs/SetBool", SET_BOOL_MD5)
    other.replies = [b"", b""]
    assert stage.say("""var mute = Ros.Service.new("/mute", true)|; var t = Tag.new|;
        t: { mute.request(["data" => true]); echo("never") }, sleep(0.1s); echo("alive"); t.stop""") == ["*** alive"]


def test_function_as_a_service(stage: Stage, other: RosNodeFake) -> None:
    stage.say("""Ros.offer("/flip", "std_srvs/SetBool", function (r)
        { if (r["data"]) throw "no" else ["success" => !r["data"], "message" => "done"] })""")
    call = in_thread(stage, lambda: other.call("/flip", md5sum=SET_BOOL_MD5, persistent="1")[0])
    call.send_message(b"\0")
    assert in_thread(stage, call.receive, 14) == b"\x01\x09\0\0\0\x01\x04\0\0\0done"
    call.send_message(b"\x01")
    assert in_thread(stage, call.receive, 61)[5:] == b"the function of the service has failed: urbihw tells why"
    stage.heard("!!! no")
    assert stage.say('Ros.services.has("/flip"); Ros.withdraw("/flip"); sleep(0.05s); Ros.services.has("/flip")') == [
        "true", "false",
    ]  # fmt: skip


def test_answer_that_is_too_large_is_refused(
    stage: Stage, other: RosNodeFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.say("""Ros.offer("/long", "std_srvs/SetBool", function (r)
        { ["success" => true, "message" => "a" * 2000] })""")
    monkeypatch.setattr("urbihw.ros.orders.MAX_PICKLE_BYTES", 1000)
    call = in_thread(stage, lambda: other.call("/long", md5sum=SET_BOOL_MD5, persistent="1")[0])
    call.send_message(b"\0")
    assert b"is too large for urbiscript" in in_thread(stage, call.receive, 60)
    # A listener that has gone: the caller is not left to wait.
    ros_link(stage.kernel.world).forget(offers_of(stage.kernel.world)["/long"].handle)
    call.close()
    call = in_thread(stage, lambda: other.call("/long", md5sum=SET_BOOL_MD5, persistent="1")[0])
    call.send_message(b"\0")
    assert in_thread(stage, call.receive, 26)[5:] == b"the service has ended"
    stage.say('Ros.withdraw("/long")')
    assert in_thread(stage, call.receive, 1) == b""


def test_parameters(stage: Stage) -> None:
    assert stage.say("""Ros.setParam("/p", [1, 2.5, "a", ["k" => true]]); Ros.getParam("/p"); Ros.hasParam("/p");
        Ros.params; Ros.deleteParam("/p"); Ros.getParam("/p")""") == [
        '[1, 2.5, "a", ["k" => true]]', "true", '["/p"]', "!!! getParam: Parameter [/p] is not set",
    ]  # fmt: skip


def test_topic_that_cannot_be_had_takes_no_place(stage: Stage) -> None:
    window = stage.open()
    (whys,) = stage.say(f"""var whys = []|; for (var i: {MAX_TOPICS + 3}) try
        {{ var t = Ros.Topic.new("/nowhere")|; if (i % 2) t.subscribe else t.advertise("no_msgs/No") }}
        catch (var e) {{ if (!whys.has(e.message)) whys << e.message }}; whys""", window)
    assert whys.count('", "') == 1 and "/nowhere is not known" in whys and "type no_msgs/No is not known" in whys
    window.close()


def test_topic_ends_with_its_connection(stage: Stage, other: RosNodeFake) -> None:
    window = stage.open()
    stage.say('var t = Ros.Topic.new("/mine")|; t.advertise("std_msgs/String")', window)
    assert stage.say('Ros.topics.has("/mine")') == ["true"]
    window.close()
    assert stage.say('sleep(0.1s); Ros.topics.has("/mine")') == ["false"]


def test_topic_that_is_too_fast(stage: Stage, other: RosNodeFake) -> None:
    """A handler that is held, and ten thousand messages: few jobs, the newest messages, and other topics go on."""
    other.publish("/fast", "std_msgs/UInt32", "304a39449588c7f8ce2df6e8001c5fce")
    stage.say("""var fast = Ros.Topic.new("/fast")|; var Global.seen = []|; fast.subscribe;
        at (fast.onMessage?(var e)) { Global.seen << e["data"]; sleep(inf) }""")
    peer = in_thread(stage, other.subscriber)
    in_thread(stage, peer.send, b"".join(struct.pack("<II", 4, i) for i in range(10_000)))
    stage.until(lambda: int(stage.say("fast.missed")[0]) > 9000)
    (held,) = stage.say("Global.seen.size")
    assert 1 <= int(held) <= WINDOW + WINDOW // 2
    assert stage.say("fast.unsubscribe; Ros.checkMaster") == ["true"]


def test_connection_that_ends_leaves_the_topic_to_others(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits for a window that is closed counts as taken: the process sends so many messages more to others."""
    window, link, told = stage.open(), ros_link(stage.kernel.world), list[tuple[Any, ...]]()
    stage.say('var t = Ros.Topic.new("/shared")|; t.advertise("std_msgs/String"); t.unadvertise; t.subscribe', window)
    tell = link.tell

    def note(*order: Any) -> None:
        told.append(order)
        tell(*order)

    monkeypatch.setattr(link, "tell", note)
    for _ in range(3):
        link._handle(TopicMessage("/shared", (window.slots["t"]._handle,), {"data": "a"}, 0))
    assert told == []
    window.close()
    stage.until(lambda: told.count(("taken", "/shared")) == 3)


def test_process_that_is_killed_is_started_again(stage: Stage, caplog: pytest.LogCaptureFixture) -> None:
    stage.say('var lost = Ros.Topic.new("/lost")|; lost.advertise("std_msgs/String")')
    link = ros_link(stage.kernel.world)
    assert link._channel is not None
    link._channel.abort()
    stage.until(lambda: "the ROS process has ended" in caplog.text)
    assert stage.say('lost << ["data" => "a"]; Ros.checkMaster') == ["!!! <<: /lost: not advertised", "true"]


def test_process_that_says_nonsense_is_started_again(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The kernel goes on whatever the process says, and a process that hears nothing any more is ended."""
    link = ros_link(stage.kernel.world)
    assert stage.say("Ros.checkMaster") == ["true"]
    with monkeypatch.context() as patch:
        patch.setattr("urbihw.ros.orders.MAX_PICKLE_BYTES", 2)
        link._channel.send(packed_check())  # type: ignore[union-attr]
        stage.until(lambda: "says what cannot be handled" in caplog.text)
    assert stage.say("Ros.checkMaster") == ["true"]
    with monkeypatch.context() as patch:
        patch.setattr("urbihw.ros.script.link.MAX_STUCK_BYTES", -1)
        link.tell("taken", "/none")
    assert "does not keep up" in caplog.text
    assert stage.say("Ros.checkMaster") == ["true"]


def packed_check() -> bytes:
    """An order whose answer nobody waits for."""
    data = pickle.dumps(Order(1, "check", ()))
    return struct.pack("<I", len(data)) + data
