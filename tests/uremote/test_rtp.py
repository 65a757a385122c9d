"""Values by RTP: packets, their loss, and which values travel this way."""

from __future__ import annotations

import queue
import random
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from places import Remote

from urbihw.kernel.uobject import UImage, UObject, reading, variable
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uremote.frames import Update, encode
from urbihw.kernel.uremote.rtp import (
    HEAD_SIZE,
    HEADER,
    MAX_STREAMS,
    PIECE,
    SHARED_STREAM,
    SMALL_PIECE_SIZE,
    RtpReceiver,
    Sender,
    stream_of,
)
from urbihw.kernel.uremote.rtplink import MAX_WAITING_SIZE, RtpLink
from urbihw.kernel.uremote.subscriptions import RemoteSettings
from urbihw.kernel.uremote.udp import UdpPort

pytestmark = pytest.mark.e2e

SECRET, SOURCE = b"12345678", 0xABCDEF01
PICTURE = Update("cam.val", UImage(bytes(range(256)) * 40, "rgb 64 53"), 1234567)


def test_a_packet_is_rtp() -> None:
    first, *_, last = Sender(SECRET, SOURCE).packets(PICTURE, 2.0)
    assert first[:4].hex(" ") == "80 60 00 01"  # version 2, payload type 96, the first of its kind
    assert first[4:8] == (180000).to_bytes(4, "big")
    assert first[8:12].hex() == "abcdef01"
    assert last[1] == 0x80 | 96  # the mark of the last piece
    assert len(first) == HEAD_SIZE + SMALL_PIECE_SIZE <= 1472


def test_pieces_in_any_order_and_twice() -> None:
    packets = Sender(SECRET, SOURCE).packets(PICTURE, 0.0) * 2
    random.Random(3).shuffle(packets)
    receiver = RtpReceiver(SECRET, SOURCE)
    assert [update for packet in packets for update in receiver.feed(packet)] == [PICTURE]


def test_what_is_lost_is_dropped_and_the_next_one_is_whole() -> None:
    sender, receiver = Sender(SECRET, SOURCE), RtpReceiver(SECRET, SOURCE)
    first, second, third = (sender.packets(PICTURE, 0.0) for _ in range(3))
    arrived = first[:-1] + second + first[-1:] + third
    assert [update for packet in arrived for update in receiver.feed(packet)] == [PICTURE, PICTURE]
    assert receiver.lost == 1


def test_streams_do_not_disturb_each_other() -> None:
    sender, receiver = Sender(SECRET, SOURCE), RtpReceiver(SECRET, SOURCE)
    other = Update("mic.val", UImage(b"x" * 5000, "rgb 1 1"), 1)
    a, b = sender.packets(PICTURE, 0.0), sender.packets(other, 0.0)
    mixed = [packet for pair in zip(a, b, strict=False) for packet in pair] + a[len(b):]
    assert {update.name for packet in mixed for update in receiver.feed(packet)} == {"cam.val", "mic.val"}
    assert stream_of(Update("x.y", 1.0, 0)) == stream_of(Update("z.y", "a", 0)) == SHARED_STREAM != stream_of(PICTURE)


def test_strangers_and_noise_are_left_out() -> None:
    dice = random.Random(2)
    receiver = RtpReceiver(SECRET, SOURCE)
    foreign = Sender(b"87654321", SOURCE).packets(PICTURE, 0.0) + Sender(SECRET, SOURCE + 1).packets(PICTURE, 0.0)
    packets = Sender(SECRET, SOURCE).packets(PICTURE, 0.0)
    for _ in range(3000):
        noise = bytearray(dice.choice(packets))
        for _ in range(3):
            noise[dice.choice((0, 1, 8, 9, 20, 24, 28, 29, 30, 31))] = dice.randrange(256)
        assert list(receiver.feed(bytes(noise))) in ([], [PICTURE])
        list(receiver.feed(dice.randbytes(60)))
    before = receiver.refused
    assert [update for packet in foreign for update in receiver.feed(packet)] == []
    assert receiver.refused == before + len(foreign)
    assert len(receiver._streams) <= MAX_STREAMS


def packet(stream: int, message: int, at: int, size: int, piece: bytes) -> bytes:
    """One by hand."""
    return HEADER.pack(0x80, 96, 0, 0, SOURCE) + PIECE.pack(SECRET, stream, message, at, size) + piece


def test_what_is_announced_takes_no_memory_and_what_waits_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.kernel.uremote.rtp.MAX_FRAME_SIZE", 100_000)
    receiver = RtpReceiver(SECRET, SOURCE)
    for number in range(1000):
        assert not list(receiver.feed(packet(number % 200, number, 0, 90_000, bytes(SMALL_PIECE_SIZE))))
        assert sum(len(piece) for one in receiver._streams.values() for piece in one.pieces.values()) <= 100_000
    assert receiver.lost > 900
    assert not list(receiver.feed(packet(1, 5000, 0, 100_001, bytes(SMALL_PIECE_SIZE)))) and receiver.refused == 1
    for at in range(3000):  # a message in crumbs
        assert not list(receiver.feed(packet(2, 5000, at, 90_000, b"x")))
    assert receiver.refused == 3001
    sender = Sender(SECRET, SOURCE)
    sender._messages = 6000
    assert [update for one in sender.packets(PICTURE, 0.0) for update in receiver.feed(one)] == [PICTURE]


def test_pieces_that_overlap_are_no_message() -> None:
    receiver = RtpReceiver(SECRET, SOURCE)
    content = b"".join(encode(Update("a.b", "x" * 4000, 1)))
    size = len(content)
    cuts = [(0, 2000), (1500, 3500), (size - 500, size)]
    assert sum(end - at for at, end in cuts) > size
    for at, end in cuts:
        assert not list(receiver.feed(packet(1, 1, at, size, content[at:end])))
    whole = Sender(SECRET, SOURCE)
    whole._messages = 5
    assert [update for one in whole.packets(PICTURE, 0.0) for update in receiver.feed(one)] == [PICTURE]


def until(condition: Callable[[], bool]) -> None:
    """Wait for what threads do."""
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("not within 10 s")


def test_only_the_other_end_is_heard() -> None:
    posted: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
    heard: list[Update] = []
    server = RtpLink("127.0.0.1", SECRET, posted.put, heard.append)
    remote = RtpLink("127.0.0.1", SECRET, posted.put, heard.append)
    server.to(remote.port, remote.source)
    remote.to(server.port, server.source)
    assert server.address == "127.0.0.1"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief:
        for packet in Sender(SECRET, remote.source).packets(PICTURE, 0.0):  # one that has listened on the wire
            thief.sendto(packet, (server.address, server.port))
        until(lambda: server.refused > 0)
        strangers = server.refused
        remote._port.send([b"noise", *Sender(b"87654321", remote.source).packets(PICTURE, 0.0)])
        remote._port.send(Sender(SECRET, remote.source + 1).packets(PICTURE, 0.0))
        assert remote.send(PICTURE, 0.0)
        while not heard:
            posted.get(timeout=10)()
    assert heard == [PICTURE]
    assert server.refused >= strangers + 3
    server.close()
    remote.close()


def test_packets_that_the_kernel_has_no_time_for_do_not_pile_up() -> None:
    posted: list[Callable[[], None]] = []
    link = RtpLink("127.0.0.1", SECRET, posted.append, lambda update: None, Network().open)
    link.to(1, SOURCE)
    for _ in range(1000):
        link._queue_packets([bytes(30_000)] * 64)
    assert len(posted) == 1
    assert sum(map(len, link._waiting)) <= MAX_WAITING_SIZE and link.dropped > 60_000
    posted.pop()()
    assert link._waiting == [] and 0 < link.refused < 300
    link._queue_packets([b"x"])
    assert len(posted) == 1


def test_a_port_is_bound_to_the_address_of_the_connection_only() -> None:
    port = UdpPort("127.0.0.1", lambda packets: None, "127.0.0.2")
    assert port.address == "127.0.0.2"
    with pytest.raises(OSError):
        UdpPort("no address", lambda packets: None)
    with pytest.raises(OSError):
        UdpPort("127.0.0.1", lambda packets: None, "203.0.113.7")
    port.close()


def test_a_port_never_waits_and_can_be_closed() -> None:
    heard: list[bytes] = []
    here, there = UdpPort("127.0.0.1", heard.extend), UdpPort("127.0.0.1", heard.extend)
    here.to(there.port)
    there.to(here.port)
    assert here.send([b"abc", b"def"])
    until(lambda: len(heard) == 2)
    assert heard == [b"abc", b"def"]
    began = time.monotonic()
    for _ in range(50):
        here.send([bytes(60000)] * 20)
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
        self.ports: dict[int, Callable[[list[bytes]], None]] = {}
        self.drop: Callable[[int], bool] = lambda count: False
        self.count = 0

    def open(self, peer: str, heard: Callable[[list[bytes]], None], local: str) -> Any:
        """A port on it."""
        network, number = self, 5000 + len(self.ports)
        self.ports[number] = heard

        class Port:
            address, port, strangers, other = peer, number, 0, 0

            def to(self, port: int) -> None:
                self.other = port

            def send(self, packets: list[bytes]) -> bool:
                for packet in packets:
                    network.count += 1
                    if not network.drop(network.count) and self.other in network.ports:
                        network.ports[self.other]([packet])
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
        self.server.world.part(RemoteSettings).open_port = self.network.open
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


def test_over_real_sockets_a_stranger_changes_nothing() -> None:
    place = Remote()
    place.host.load_module("urbi/rtp")
    place.register(Eye)
    place.say("var Global.picture = 0|; var Global.eye = Eye.new|;")
    eye = place.host.registry.object("object_1").python
    (connection,) = registry_of(place.server.world).connections.values()
    link, other = connection._rtp, place.bridge._rtp_link
    assert link is not None and other is not None and link.address == "127.0.0.1"

    def shown(shade: str) -> bool:
        place.settle()
        return place.say("eye.val.data[0];") == [shade]

    eye.show(65)
    until(lambda: shown('"A"'))
    forged = Update("object_1.val", UImage.of(b"Z" * 30000, 100, 100), 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief:
        packets = Sender(link._secret, other.source).packets(forged, 0.0)
        for packet in packets:
            thief.sendto(packet, ("127.0.0.1", link.port))
        until(lambda: link.refused == len(packets))
    assert shown('"A"')
    eye.show(66)
    until(lambda: shown('"B"'))
    place.leave()
    until(lambda: not any(thread.name == "urbihw-rtp" for thread in threading.enumerate()))


def test_ports_are_let_go_and_made_again() -> None:
    setting = Setting()
    assert len(setting.network.ports) == 2
    setting.leave()
    assert setting.network.ports == {}
    setting.join()
    assert setting.carried(lambda: setting.eye.show(5)) == 1


@pytest.mark.parametrize(("call", "answer"), [
    ('UObject.rtpOpen("12", 5, 1);', "expected 8 bytes in hexadecimal digits, a port and a number of 32 bits"),
    ('UObject.rtpOpen("0102030405060708", 0, 1);', "a port and a number of 32 bits"),
    ('UObject.rtpOpen("0102030405060708", 1.5, 1);', "expected integer, got 1.5"),
    ('UObject.rtpOpen("0102030405060708", 5, 5000000000);', "a port and a number of 32 bits"),
    ('UObject.rtpOpen("0102030405060708", 5, 1);', "this connection has no address"),
    ('var lobby.remoteIP = "127.0.0.1"| UObject.rtpOpen("0102030405060708", 5, 1);', "this connection has no address"),
])
def test_wrong_requests_are_refused(call: str, answer: str) -> None:
    assert Setting().say(call)[0].endswith(answer)
