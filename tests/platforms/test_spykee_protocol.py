"""The bytes of a Spykee: the test vectors of the fact sheet against the driver's half; how a stream is cut."""

from __future__ import annotations

import pytest

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.platforms.spykee import protocol as p

UID = "SPYKEE0011223344"


def octets(text: str) -> bytes:
    return bytes.fromhex(text)


SENT = [
    ("50 4b 0a 00 0c 05 61 64 6d 69 6e 05 61 64 6d 69 6e", p.login("admin", "admin")),
    ("50 4b 05 00 02 3c 3c", p.move(60, 60)),
    ("50 4b 05 00 02 c4 c4", p.move(-60, -60)),
    ("50 4b 05 00 02 ce 32", p.move(-50, 50)),
    ("50 4b 05 00 02 00 00", p.move(0, 0)),
    ("50 4b 04 00 02 00 01", p.packet(p.LED, bytes([p.LEDS["headLed"], 1]))),
    ("50 4b 07 00 01 02", p.packet(p.PLAY, b"\x02")),
    ("50 4b 09 00 01 32", p.packet(p.VOLUME, bytes([50]))),
    ("50 4b 0f 00 02 01 01", p.packet(p.STREAM, bytes([p.CAMERA, True]))),
    ("50 4b 0f 00 02 02 00", p.packet(p.STREAM, bytes([p.MICROPHONE, False]))),
    ("50 4b 0f 00 02 03 01", p.packet(p.STREAM, bytes([p.LOUDSPEAKER, True]))),
    ("50 4b 10 00 01 05", p.packet(p.ENGINE, bytes([p.UNDOCK]))),
    ("50 4b 10 00 01 06", p.packet(p.ENGINE, bytes([p.DOCK]))),
    ("50 4b 10 00 01 07", p.packet(p.ENGINE, bytes([p.CANCEL]))),
    ("50 4b 0d 00 00", p.packet(p.CONFIGURATION)),
    ("50 4b 0e 00 00", p.packet(p.NETWORKS)),
    ("50 4b 11 00 00", p.packet(p.LOG)),
    ("50 4b 06 00 04 40 03 ff fb", p.upload(p.FIRST_CHUNK | p.LAST_CHUNK, b"\xff\xfb")),
    ("50 4b 07 00 01 40", p.packet(p.PLAY, bytes([p.MUSIC]))),
    ("50 4b 08 00 00", p.packet(p.STOP)),
    ("44 53 43 56 01", p.QUESTION),
]


@pytest.mark.parametrize(("vector", "made"), SENT, ids=[row[0] for row in SENT])
def test_what_is_sent_is_as_in_the_sheet(vector: str, made: bytes) -> None:
    assert made == octets(vector)


ACCEPTED = octets(
    "50 4b 0b 00 22 01 10 53 50 59 4b 45 45 30 30 31 31 32 32 33 33 34 34 06 53 70 79 6b 65 65 00"
    "06 31 2e 30 2e 33 34 01"
)


def only(data: bytes) -> tuple[int, bytes]:
    (packet,) = p.SpykeeFramer().feed(data)
    return packet


def test_what_comes_is_read_as_in_the_sheet() -> None:
    kind, payload = only(ACCEPTED)
    assert kind == p.LOGIN_REPLY
    assert p.read_login_reply(payload) == p.Identity((UID, "Spykee", ""), "1.0.34", False)
    docked = p.read_login_reply(payload[:-1] + b"\x00")
    assert docked is not None and docked.docked
    assert p.read_login_reply(only(octets("50 4b 0b 00 01 00"))[1]) is None
    assert p.read_power(only(octets("50 4b 03 00 01 57"))[1]) == 87
    assert p.read_power(only(octets("50 4b 03 00 01 b0"))[1]) == -80
    assert only(octets("50 4b 02 00 04 ff d8 ff d9")) == (p.VIDEO, octets("ff d8 ff d9"))
    assert only(octets("50 4b 10 00 01 02")) == (p.ENGINE, bytes([p.IS_DOCKED]))
    assert p.read_configuration(only(octets("50 4b 0d 00 07 61 3d 31 26 62 3d 32"))[1]) == {"a": "1", "b": "2"}
    networks = octets("50 4b 0e 00 18 68 6f 6d 65 3a 57 50 41 3a 37 30 3b 63 61 66 65 3a 4e 4f 4e 45 3a 33 31")
    assert p.read_networks(only(networks)[1]) == [["home", "WPA", "70"], ["cafe", "NONE", "31"]]
    answer = octets("44 53 43 56 02 14 75 69 64 3d 53 50 59 4b 45 45 30 30 31 31 32 32 33 33 34 34")
    assert p.read_discovery(answer) == {"uid": UID}
    assert p.read_discovery(octets("44 53 43 56 01")) is None


def test_a_sound_of_an_eighth_of_a_second_is_one_packet() -> None:
    assert only(octets("50 4b 01 0f a0") + bytes(4000)) == (p.AUDIO, bytes(4000))


@pytest.mark.parametrize("size", [1, 2, 3, 5, 7, 1000])
def test_packets_are_cut_from_the_stream_however_it_comes(size: int) -> None:
    stream = ACCEPTED + octets("50 4b 03 00 01 57") + p.packet(p.VIDEO, b"\xff\xd8PKPK\xff\xd9" * 50)
    framer, found = p.SpykeeFramer(), []
    for at in range(0, len(stream), size):
        found += framer.feed(stream[at : at + size])
    assert [kind for kind, _ in found] == [p.LOGIN_REPLY, p.POWER, p.VIDEO]


@pytest.mark.parametrize("noise", [b"Q", b"PQ", b"PK\x03\x00\x01\x57X"])
def test_what_is_no_packet_is_said_at_once(noise: bytes) -> None:
    with pytest.raises(BadFrame):
        p.SpykeeFramer().feed(noise)


@pytest.mark.parametrize("cut", range(8, 34))
def test_a_reply_that_is_cut_is_a_refusal(cut: int) -> None:
    payload = ACCEPTED[5:]
    assert p.read_login_reply(payload[:cut]) is None or cut == len(payload)


def test_what_cannot_be_sent_is_refused_and_the_password_is_not_told() -> None:
    for user, password in (("u", "x" * 256), ("u", "hush\u20ac")):
        with pytest.raises(BadValue) as caught:
            p.login(user, password)
        assert password not in str(caught.value)
    for key, value in (("", "1"), ("a&b", "1"), ("a", "b=c"), ("a", "b\n"), ("\u20ac", "1")):
        with pytest.raises(BadValue):
            p.pair(key, value)
