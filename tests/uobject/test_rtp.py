"""Values by RTP: packets, their loss, and which values travel this way."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from typing import Any

import pytest
from places import Remote

from urbihw.kernel.uobject import UImage, UObject, reading, variable
from urbihw.kernel.uobject.frames import Update
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.rtp import HEAD_SIZE, MOST_STREAMS, SHARED, SMALL, Receiver, Sender, stream_of
from urbihw.kernel.uobject.udp import Packet, UdpPort

SECRET = b"12345678"
PICTURE = Update("cam.val", UImage(bytes(range(256)) * 40, "rgb 64 53"), 1234567)


def test_a_packet_is_rtp() -> None:
    first, *_, last = Sender(SECRET).packets(PICTURE, 2.0)
    assert first[:4].hex(" ") == "80 60 00 01"  # version 2, payload type 96, the first of its kind
    assert first[4:8] == (180000).to_bytes(4, "big")
    assert last[1] == 0x80 | 96  # the mark of the last piece
    assert len(first) == HEAD_SIZE + SMALL <= 1472


def test_pieces_in_any_order_and_twice() -> None:
    packets = Sender(SECRET).packets(PICTURE, 0.0) * 2
    random.Random(3).shuffle(packets)
    receiver = Receiver(SECRET)
    assert [update for packet in packets for update in receiver.feed(packet)] == [PICTURE]


def test_what_is_lost_is_dropped_and_the_next_one_is_whole() -> None:
    sender, receiver = Sender(SECRET), Receiver(SECRET)
    first, second, third = (sender.packets(PICTURE, 0.0) for _ in range(3))
    arrived = first[:-1] + second + first[-1:] + third
    assert [update for packet in arrived for update in receiver.feed(packet)] == [PICTURE, PICTURE]
    assert receiver.lost == 1


def test_streams_do_not_disturb_each_other() -> None:
    sender, receiver = Sender(SECRET), Receiver(SECRET)
    other = Update("mic.val", UImage(b"x" * 5000, "rgb 1 1"), 1)
    a, b = sender.packets(PICTURE, 0.0), sender.packets(other, 0.0)
    mixed = [packet for pair in zip(a, b, strict=False) for packet in pair] + a[len(b):]
    assert {update.name for packet in mixed for update in receiver.feed(packet)} == {"cam.val", "mic.val"}
    assert stream_of(Update("x.y", 1.0, 0)) == stream_of(Update("z.y", "a", 0)) == SHARED != stream_of(PICTURE)


def test_strangers_and_noise_are_left_out() -> None:
    dice = random.Random(2)
    receiver = Receiver(SECRET)
    foreign = Sender(b"87654321").packets(PICTURE, 0.0)
    packets = Sender(SECRET).packets(PICTURE, 0.0)
    for _ in range(3000):
        noise = bytearray(dice.choice(packets))
        for _ in range(3):
            noise[dice.choice((0, 1, 8, 9, 20, 24, 28, 29, 30, 31))] = dice.randrange(256)
        assert list(receiver.feed(bytes(noise))) in ([], [PICTURE])
        list(receiver.feed(dice.randbytes(60)))
    assert [update for packet in foreign for update in receiver.feed(packet)] == []
    assert len(receiver._streams) <= MOST_STREAMS


def test_a_port_never_waits_and_can_be_closed() -> None:
    heard: list[Packet] = []
    here, there = UdpPort("127.0.0.1", heard.extend), UdpPort("127.0.0.1", heard.extend)
    assert here.send([b"abc", b"def"], ("127.0.0.1", there.port))
    for _ in range(200):
        if len(heard) == 2:
            break
        time.sleep(0.01)
    assert heard == [(b"abc", "127.0.0.1"), (b"def", "127.0.0.1")]
    began = time.monotonic()
    for _ in range(50):
        here.send([bytes(60000)] * 20, ("127.0.0.1", there.port))
    assert time.monotonic() - began < 5
    for port in (here, there):
        port.close()
        port.close()
        port._thread.join(5)
        assert not port._thread.is_alive()


# ---------------------------------------------------------------- between a server and a remote


class Network:
    """Carries packets at once, but for those that ``drop`` wants to get lost."""

    def __init__(self) -> None:
        self.ports: dict[int, Callable[[list[Packet]], None]] = {}
        self.drop: Callable[[int], bool] = lambda count: False
        self.count = 0

    def open(self, host: str, heard: Callable[[list[Packet]], None]) -> Any:
        """A port on it."""
        network, number = self, 5000 + len(self.ports)
        self.ports[number] = heard

        class Port:
            port = number

            def send(self, packets: list[bytes], address: tuple[str, int]) -> bool:
                for packet in packets:
                    network.count += 1
                    if not network.drop(network.count) and address[1] in network.ports:
                        network.ports[address[1]]([(packet, host)])
                return True

            def close(self) -> None:
                network.ports.pop(number, None)

        return Port()


class Eye(UObject):
    val = reading()
    number = variable(0.0)
    seen: list[Any]

    def init(self) -> None:
        self.seen = []
        self.notify_change(self.number, lambda: None)
        self.notify_change("Global.picture", self.look)

    def look(self, image: UImage) -> None:
        self.seen.append(len(image))

    def show(self, shade: int) -> None:
        self.val.sense(UImage.of(bytes([shade]) * 30000, 100, 100))


class Setting(Remote):
    def __init__(self, rtp: bool = True) -> None:
        super().__init__()
        self.network = Network()
        registry_of(self.server.world).open_port = self.network.open
        self.bridge.open_port = self.network.open
        if rtp:
            self.host.load_module("urbi/rtp")
        self.register(Eye)
        self.say("var Global.picture = 0|; var Global.eye = Eye.new|;")

    @property
    def eye(self) -> Eye:
        found = self.host.registry.object("object_1").python
        assert isinstance(found, Eye)
        return found

    def carried(self, action: Callable[[], None]) -> int:
        """How many packets an action takes."""
        before = self.network.count
        action()
        self.settle()
        return self.network.count - before


def test_binary_values_travel_by_rtp_and_others_do_not() -> None:
    setting = Setting()
    assert setting.carried(lambda: setting.eye.show(7)) == 1
    assert setting.say("eye.val.keywords; eye.val.data[0];") == ['"rgb 100 100"', '"\\x07"']
    assert setting.carried(lambda: setting.eye.number.sense(5.0)) == 0
    assert setting.say("eye.number;") == ["5"]


def test_per_variable_it_may_be_otherwise() -> None:
    setting = Setting()
    setting.eye.val.use_rtp(False)
    setting.eye.number.use_rtp(True)
    setting.settle()
    assert setting.carried(lambda: setting.eye.show(9)) == 0
    assert setting.carried(lambda: setting.eye.number.sense(6.0)) == 1
    assert setting.say('eye.number; eye.val.data[0]; eye.getSlot("number").rtp;') == ["6", '"\\t"', "true"]


def test_what_is_lost_is_not_missed() -> None:
    setting = Setting()
    setting.network.drop = lambda count: count % 2 == 1
    for shade in range(65, 75):
        setting.eye.show(shade)
        setting.settle()
    assert setting.say("eye.val.data[0]; eye.number;") == ['"J"', "0"]


def test_the_server_s_values_travel_by_rtp_too() -> None:
    setting = Setting()
    before = setting.network.count
    setting.say('picture = Binary.new("rgb 1 1", "abc")|;')
    assert setting.network.count == before + 1
    assert setting.eye.seen == [3]


def test_without_the_module_nothing_changes() -> None:
    setting = Setting(rtp=False)
    assert setting.carried(lambda: setting.eye.show(65)) == 0
    assert setting.say("eye.val.data[0];") == ['"A"']


def test_ports_are_let_go_and_made_again() -> None:
    setting = Setting()
    assert len(setting.network.ports) == 2
    setting.leave()
    assert setting.network.ports == {}
    setting.join()
    assert setting.carried(lambda: setting.eye.show(5)) == 1


@pytest.mark.parametrize(("call", "answer"), [
    ('UObject.rtpOpen("12", 5);', "expected 8 bytes in hexadecimal digits and a port"),
    ('UObject.rtpOpen("0102030405060708", 0);', "expected 8 bytes in hexadecimal digits and a port"),
    ('UObject.rtpOpen("0102030405060708", 5);', "this connection has no address"),
])
def test_wrong_requests_are_refused(call: str, answer: str) -> None:
    assert Setting().say(call)[0].endswith(answer)
