"""Devices in a process of their own: what goes wrong, and how it is again as it was."""

from __future__ import annotations

import logging
import random
from typing import Any

import pytest
from places import Plugged, Remote

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UBinary, UObject, UVar, event, function, owned, reading, variable
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uremote.bridge import Bridge


class Lamp(UObject):
    val = owned(0.0)
    colour = variable("white")
    warmth = reading(20.0)
    broken = event()

    def init(self, number: int = 0) -> None:
        self.number = number
        self.said: list[str] = []
        self.seen: list[Any] = []
        self.notify_change(self.val, self.dim)
        self.notify_change(self.colour, self.paint)

    def dim(self, level: float) -> None:
        self.seen.append(level)
        self.val.sense(level / 2)

    def paint(self, colour: str) -> None:
        if colour == "black":
            raise ValueError("there is no black light")

    @function
    def twin(self) -> Lamp:
        return self

    @function
    def back(self, value: Any) -> Any:
        return value

    @function
    def burn(self) -> None:
        self.broken.emit("out", [1, 2])

    @function
    def watch(self, what: UVar) -> None:
        self.notify_change(what, lambda v: self.seen.append(v.get()))
        self.other = what

    @function
    def listen(self) -> None:
        self.at_event("Global.alarm", lambda *what: self.seen.append(what))

    @function
    def more(self) -> None:
        self.bind_var("late", 3.0)
        self.bind_function(lambda: 7, "seven")
        self.put_slot("label", "a lamp")
        self.val.set_property("rangemax", 0.5)

    def on_connected(self) -> None:
        self.said.append("connected")

    def on_disconnected(self) -> None:
        self.said.append("disconnected")


def lamp_of(place: Plugged, name: str = "object_1") -> Lamp:
    found = place.host.registry.object(name).python
    assert isinstance(found, Lamp)
    return found


@pytest.fixture(params=["binary", "text", "old"])
def place(request: pytest.FixtureRequest) -> Remote:
    made = Remote(binary=request.param != "text", old=request.param == "old")
    made.register(Lamp)
    made.say("var Global.lamp = Lamp.new;")
    return made


VALUES = [
    "1", "-2.5", "0.1", "1e+30", "inf", '"text"', r'"q\"\\\n\t\x01\xe9"', "[1, [2, \"x\"], []]",
    '["a" => 1, "b" => [2]]',
    "[ => ]", "nil", '[nil, 1]', 'Binary.new("rgb 1 1", "\\xff;\\n")', '[Binary.new("", "a"), Binary.new("k", "")]',
]


@pytest.mark.parametrize("value", VALUES)
def test_values_go_there_and_back(place: Remote, value: str) -> None:
    place.say(f"var Global.sent = {value}|;")
    wanted = place.say("sent;")
    assert place.say("lamp.back(sent);") == wanted
    if value != "nil" and value != "[nil, 1]":
        place.say("lamp.colour = sent|; var Global.got = lamp.back(lamp.colour)|;")
        assert place.say("got == sent;") == ["true"]


def test_numbers_have_all_digits(place: Remote) -> None:
    assert place.say("lamp.back(1/3) == 1/3;") == ["true"]


def test_a_refusal_and_a_limit_reach_the_server(place: Remote, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.CRITICAL):
        place.say('lamp.colour = "black";')
    assert lamp_of(place).colour.value == "white"
    place.say("lamp.more;")
    assert place.say("lamp.late; lamp.seven; lamp.label; lamp.val->rangemax;") == ["3", "7", '"a lamp"', "0.5"]
    place.say("lamp.val = 3;")
    assert lamp_of(place).seen == [0.5]
    assert place.say("lamp.val;") == ["0.25"]


def test_objects_travel_by_name(place: Remote) -> None:
    assert place.say("lamp.twin === lamp;") == ["true"]
    place.say("var Global.stranger = UObject.new|;")
    assert place.say("lamp.back([stranger]).size;") == ["1"]
    if not place.old:  # who takes names for strings gets strings back
        assert place.say("lamp.back(lamp) === lamp; lamp.back([lamp])[0] === lamp;") == ["true", "true"]


def test_events_both_ways(place: Remote) -> None:
    place.say('at (lamp.broken?(var why, var list)) echo(why + list);')
    assert place.say("lamp.burn;") == ["*** out[1, 2]"]
    place.say("var Global.alarm = Event.new|; lamp.listen;")
    place.say("alarm!; alarm!(1, \"x\");")
    assert lamp_of(place).seen == [(), (1.0, "x")]


def test_variables_of_others(place: Remote) -> None:
    place.say('var Global.box = UObject.new|; UVar.new(box, "v")|; box.v = 4; lamp.watch(box.getSlot("v"));')
    assert lamp_of(place).other.value == 4.0
    place.say("box.v = 5;")
    lamp_of(place).other.set(6.0)
    place.settle()
    assert place.say("box.v;") == ["6"]
    assert lamp_of(place).seen[-2:] == [5.0, 6.0]


def test_urbiscript_from_beside(place: Remote) -> None:
    lamp_of(place).send("var Global.sent = 1; Global.sent = 2;")
    lamp_of(place).call("Global", "setSlot", "called", 3)
    place.settle()
    assert place.say("sent; called;") == ["2", "3"]


# ---------------------------------------------------------------- lost and found


def test_a_lost_connection_is_told_and_made_again(place: Remote) -> None:
    place.say('lamp.val = 0.8; lamp.colour = "red";')
    place.leave()
    assert lamp_of(place).said == ["disconnected"]
    assert place.say('uobjects.hasSlot("Lamp"); uobjects.hasSlot("object_1"); lamp.lobby.connected;') == ["false"] * 3
    assert place.say("lamp.twin;")[0].endswith("twin: Remote disconnected")
    lamp_of(place).warmth.sense(50.0)
    place.join()
    assert lamp_of(place).said == ["disconnected", "connected"]
    assert place.say("lamp.warmth; lamp.colour; lamp.val; lamp.back(1);") == ["50", '"red"', "0.4", "1"]
    assert place.say("object_1 === lamp; lamp.protos == [Lamp];") == ["true", "true"]
    place.say("lamp.val = 0.6;")
    assert lamp_of(place).seen[-1] == 0.6
    assert place.say("Lamp.new.back(2);") == ["2"]


def test_who_waits_for_an_answer_is_told(place: Remote) -> None:
    place.lobby.feed(b"lamp.back(1); Lamp.new;")
    place.server.run()
    place.leave()
    said = place.say("1;")
    assert said[0].endswith("back: Remote disconnected")
    assert said[-1] == "1" and len(said) == 3
    assert registry_of(place.server.world).connections == {}


def test_a_connection_that_the_server_still_holds_is_replaced() -> None:
    place = Remote()
    place.register(Lamp)
    place.say("var Global.lamp = Lamp.new;")
    forgotten = place.connection
    place.bridge.lost()
    place.join()
    assert not forgotten.connected
    assert place.say("lamp.back(1);") == ["1"]


def test_nothing_is_left_behind() -> None:
    place = Remote()
    place.register(Lamp)
    registry = registry_of(place.server.world)
    for _ in range(5):
        place.say("var l = Lamp.new|; l.destroy; removeSlot(\"l\")|;")
        place.leave()
        place.join()
    assert sorted(name for name in registry.holder.slots if name[0] in "oL") == ["Lamp"]
    assert len(registry.connections) == 1
    (connection,) = registry.connections.values()
    assert list(connection.objects) == ["Lamp"] and not connection._watches and not connection._pending
    assert place.bridge._devices == {}


def test_two_remotes_that_claim_one_name(caplog: pytest.LogCaptureFixture) -> None:
    place = Remote()
    place.register(Lamp)
    other = Kernel(place.clock)
    sent: list[Any] = []
    second = Bridge(other.host, "test_2", sent.extend)
    other.host.register(Lamp)
    lobby = place.server.open_lobby()
    second.connected()
    for _ in range(4):
        lobby.feed(b"".join(sent))
        sent.clear()
        place.settle()
        second.receive(lobby.output.take_bytes())
        other.run()
    assert second.ready and second.all_taken and second.taken == ["Lamp"]
    assert place.say("Lamp.new.back(1);") == ["1"]


# ---------------------------------------------------------------- bad company


HELLO = (
    b"class K{}|external object K|external function (1) K.f from K|"
    b"if (!isdef(K.v)) var K.v|external var K.v from K|;"
)


class Server:
    """A server, a remote written by hand, and a user."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.remote, self.user = self.kernel.open_lobby("127.0.0.1"), self.kernel.open_lobby()
        self.tell(HELLO + b'binaryMode(1, "tag");')
        assert b":tag] true" in self.heard()

    def tell(self, data: bytes) -> None:
        self.remote.feed(data)
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.01)

    def heard(self) -> bytes:
        return self.remote.output.take_bytes()

    def say(self, text: str) -> list[str]:
        said = self.kernel.run_text(self.user, text, self.kernel.clock.now() + 0.01)
        return [line.partition("] ")[2] for line in said.splitlines()]


def test_garbage_after_binary_mode_closes_the_connection(caplog: pytest.LogCaptureFixture) -> None:
    server = Server()
    server.tell(b"GET / HTTP/1.1\r\n")
    assert not server.remote.connected
    assert "remote Lobby_1 (127.0.0.1) closed: not understood: a sender with sizes 47 45 54 20" in caplog.text
    assert server.say('uobjects.hasSlot("K"); 1;') == ["false", "1"]


@pytest.mark.parametrize("frame", [
    b"\x01\x00\x03K.v\x09", b"\x01\x00\x03K.v\x00\x00\x00\xff\xff\xff\xff", b"\x01\x00\x03K.v\x03\xff\xff\xff\xff",
    b"\x01\x00\x03K.v" + b"\x03\x00\x00\x00\x01" * 100,
])
def test_frames_that_cannot_be_close_the_connection(frame: bytes, caplog: pytest.LogCaptureFixture) -> None:
    server = Server()
    server.tell(b"\x02\x04\x08\x08" + frame)
    assert not server.remote.connected
    assert "not understood" in caplog.text
    assert server.say("1;") == ["1"]


def test_random_frames_never_harm_the_server(caplog: pytest.LogCaptureFixture) -> None:
    dice = random.Random(4)
    with caplog.at_level(logging.CRITICAL):
        for _ in range(60):
            server = Server()
            noise = bytes(dice.choice((0, 1, 2, 3, 5, 10, 11, 75, 46, 118, 59)) for _ in range(200))
            server.tell(b"\x02\x04\x08\x08" + noise)
            assert server.say("1;") == ["1"]


def test_a_remote_that_dies_in_the_middle_of_a_message() -> None:
    server = Server()
    server.tell(b"\x02\x04\x08\x08\x01\x00\x03K.v\x00\x00\x03rgb\x00\x00\x10\x00abc")
    server.remote.close()
    server.kernel.scheduler.run_simulated(1)
    assert server.say('uobjects.hasSlot("K"); 1;') == ["false", "1"]


def test_a_remote_that_floods_while_it_keeps_itself_waiting(caplog: pytest.LogCaptureFixture) -> None:
    server = Server()
    server.tell(b"\x02\x04\x08\x08\x0b\x00\x0bsleep(10h);")
    piece = b"\x01\x00\x03K.v\x00\x00\x01k\x00\x10\x00\x00" + bytes(1 << 20) + bytes(8)
    for _ in range(200):
        server.tell(piece)
        if not server.remote.connected:
            break
    assert "bytes wait for a statement of it to end" in caplog.text
    assert server.say("1;") == ["1"]


def test_answers_that_nobody_asked_for_and_names_that_are_not_there() -> None:
    server = Server()
    server.tell(b"\x02\x04\x08\x08\x0a\x00\x03bad\x07\x01\x00\x03Q.v\x02" + bytes(16) + b"\x02\x00\x03K.q" + bytes(4))
    lines = server.heard().decode().splitlines()
    said = [line.partition(": ")[2] for line in lines]
    assert said == ["binaryMode: missing key: bad", "lookup failed: Q", "lookup failed: q"]
    assert server.say("1;") == ["1"]


def test_a_remote_that_never_answers_only_keeps_its_callers() -> None:
    server = Server()
    assert server.say("timeout (1s) K.f(1); 1;") == []
    server.kernel.scheduler.run_simulated(server.kernel.clock.now() + 1.1)
    assert b"1\n" in server.user.output.take_bytes()
    (connection,) = registry_of(server.kernel.world).connections.values()
    assert connection._pending == {}


def test_a_server_that_talks_nonsense_is_left() -> None:
    place = Remote()
    place.register(Lamp)
    place.bridge.receive(b"\x00\xff\n[00000001:__ExternalMessage__] [99, 1]\n[00000001:__ExternalMessage__] [[[[\n")
    place.bridge.receive(b'[00000001:__ExternalMessage__] [0, "nobody.f__0", "_1"]\n[00000001:__ExternalMessage__] 3\n')
    place.bridge.receive(b'[00000001:__ExternalMessage__] [4, "object_9", "Nobody"]\n[00000001:error] !!! no\n')
    place.settle()
    assert place.say("Lamp.new.back(1);") == ["1"]


def test_what_cannot_travel_is_an_error_of_the_call() -> None:
    place = Remote()
    place.register(Lamp)
    place.say("var Global.lamp = Lamp.new;")
    lamp_of(place).bind_function(lambda: "x" * 70000, "lengthy")
    lamp_of(place).bind_function(lambda: UBinary(bytes(70000)), "big")
    place.settle()
    assert place.say("lamp.lengthy;")[0].endswith("a text of 70000 bytes; binary mode carries at most 65535")
    assert place.say("lamp.big.data.size;") == ["70000"]
