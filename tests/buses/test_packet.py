"""Bytes to values and back, without any wire."""

from __future__ import annotations

import itertools
import random

import pytest

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import packet
from urbihw.buses.servos.crc import crc16
from urbihw.buses.servos.status import Status, refusal_words, state_words

from .vectors import EXCHANGES, FAST, Exchange

QUESTIONS = [e for e in EXCHANGES if e.built is not None]
ANSWERS = [(e.name, e.protocol, text, status) for e in EXCHANGES for text, status in e.answers]


@pytest.mark.parametrize("exchange", QUESTIONS, ids=lambda e: e.name)
def test_question_is_encoded_as_in_the_manual(exchange: Exchange) -> None:
    assert exchange.built is not None
    assert exchange.built.hex(" ").upper() == exchange.question


@pytest.mark.parametrize(("name", "protocol", "text", "status"), ANSWERS)
def test_answer_is_decoded(name: str, protocol: int, text: str, status: Status) -> None:
    decoder = packet.decoder(protocol)
    assert decoder.feed(bytes.fromhex(text)) == [status]
    assert decoder.noise == 0


@pytest.mark.parametrize(("name", "protocol", "text", "status"), ANSWERS)
def test_answer_may_come_byte_by_byte_behind_noise(name: str, protocol: int, text: str, status: Status) -> None:
    decoder = packet.decoder(protocol)
    found = []
    for byte in bytes.fromhex("00 FF FF 7E FF FF FD FF" + text):
        found += decoder.feed(bytes((byte,)))
    assert found == [status]
    assert decoder.noise == 8


@pytest.mark.parametrize(("name", "protocol", "text", "status"), ANSWERS)
def test_any_damaged_byte_is_noticed(name: str, protocol: int, text: str, status: Status) -> None:
    good = bytes.fromhex(text)
    for position in range(len(good)):
        bad = bytearray(good)
        bad[position] ^= 0x10
        decoder = packet.decoder(protocol)
        assert status not in decoder.feed(bytes(bad)) + decoder.flush()


@pytest.mark.parametrize("protocol", [1, 2])
def test_a_good_packet_behind_a_damaged_one_is_found(protocol: int) -> None:
    _, _, text, status = next(answer for answer in ANSWERS if answer[1] == protocol and len(answer[3].params) > 0)
    good = bytes.fromhex(text)
    damaged = good[:-1] + bytes((good[-1] ^ 1,))
    decoder = packet.decoder(protocol)
    assert decoder.feed(damaged + good) + decoder.flush() == [status]


@pytest.mark.parametrize("protocol", [1, 2])
def test_a_false_header_that_claims_much_hides_nothing_when_the_size_is_known(protocol: int) -> None:
    false = "FF FF 01 F0 00" if protocol == 1 else "FF FF FD 00 01 F0 00 55"
    _, _, text, status = next(answer for answer in ANSWERS if answer[1] == protocol)
    decoder = packet.decoder(protocol)
    decoder.max_params = 8
    assert decoder.feed(bytes.fromhex(false + text)) == [status]


@pytest.mark.parametrize("protocol", [1, 2])
def test_flush_finds_what_a_false_header_hid(protocol: int) -> None:
    false = "FF FF 01 F0 00" if protocol == 1 else "FF FF FD 00 01 F0 00 55"
    _, _, text, status = next(answer for answer in ANSWERS if answer[1] == protocol)
    decoder = packet.decoder(protocol)
    assert decoder.feed(bytes.fromhex(false + text)) == []
    assert decoder.flush() == [status]


def test_noise_never_raises_and_is_bounded() -> None:
    dice = random.Random(8005)
    for protocol in (1, 2):
        decoder = packet.decoder(protocol)
        fed = 0
        for _ in range(3000):
            chunk = bytes(dice.choices((0xFF, 0xFD, 0x00, 0x01, 0x55, 0x04, 0xA7), k=dice.randrange(20)))
            fed += len(chunk)
            decoder.feed(chunk)
        decoder.flush()
        assert 0 < decoder.noise <= fed


def test_stuffing_survives_a_round_trip_for_every_payload() -> None:
    for length in range(8):
        for payload in itertools.product((0xFF, 0xFD, 0x00, 0x01), repeat=length):
            data = bytes(payload)
            stuffed = packet.stuff(data)
            assert packet.unstuff(stuffed) == data
            assert stuffed.count(b"\xff\xff\xfd") == stuffed.count(b"\xff\xff\xfd\xfd")


def test_stuffed_status_packets_survive_too() -> None:
    for payload in itertools.product((0xFF, 0xFD, 0x00), repeat=5):
        body = b"\x55" + packet.stuff(b"\x00" + bytes(payload))
        head = packet.HEADER_2 + b"\x01" + (len(body) + 2).to_bytes(2, "little") + body
        decoder = packet.Decoder2()
        assert decoder.feed(head + crc16(head).to_bytes(2, "little")) == [Status(1, 0, bytes(payload), 2)]


def test_crc_check_value_of_the_catalogue() -> None:
    assert crc16(b"123456789") == 0xFEE8


@pytest.mark.parametrize(("built", "question", "answer", "sizes", "statuses"), FAST)
def test_joint_answer(
    built: bytes | None, question: str, answer: str, sizes: tuple[int, ...], statuses: tuple[Status, ...]
) -> None:
    data = bytes.fromhex(answer)
    assert built is None or built.hex(" ").upper() == question
    assert tuple(packet.split_fast(data, sizes)) == statuses
    assert tuple(packet.split_fast(b"\x00\xff" + data, sizes)) == statuses
    # Cut anywhere, it gives the blocks before the cut and nothing else.
    ends = [8 + sum(size + 4 for size in sizes[: count + 1]) for count in range(len(sizes))]
    for length in range(len(data)):
        whole = sum(end <= length for end in ends)
        assert tuple(packet.split_fast(data[:length], sizes)) == statuses[:whole]


def test_a_damaged_block_ends_a_joint_answer() -> None:
    _, _, answer, sizes, statuses = FAST[0]
    data = bytearray.fromhex(answer)
    data[20] ^= 1
    assert tuple(packet.split_fast(bytes(data), sizes)) == statuses[:1]


def test_an_announced_echo_is_dropped_even_where_it_looks_like_an_answer() -> None:
    ping = packet.ping_packet(1, 1)
    decoder = packet.Decoder1()
    # Byte for byte, the echo of a ping is the answer "input voltage error".
    assert decoder.feed(ping) == [Status(1, 1, b"", 1)]
    decoder.expect_echo(ping)
    assert decoder.feed(ping[:3]) == []
    assert decoder.feed(ping[3:] + bytes.fromhex("FF FF 01 02 00 FC")) == [Status(1, 0, b"", 1)]


def test_an_echo_that_stays_out_hides_no_answer() -> None:
    decoder = packet.Decoder1()
    decoder.expect_echo(packet.read_packet(1, 1, 43, 1))
    assert decoder.feed(bytes.fromhex("FF FF 01 03 00 20 DB")) == [Status(1, 0, b"\x20", 1)]


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: packet.ping_packet(1, 255),
        lambda: packet.ping_packet(2, 253),
        lambda: packet.write_packet(1, 1, 256, b"\0"),
        lambda: packet.write_packet(1, 1, 0, bytes(200)),
        lambda: packet.sync_write_packet(1, 30, {1: b"\0", 2: b"\0\0"}),
        lambda: packet.sync_write_packet(1, 30, {}),
    ],
)
def test_impossible_packets_are_refused(wrong: object) -> None:
    assert callable(wrong)
    with pytest.raises(BadValue):
        wrong()


def test_state_and_refusal_are_told_apart() -> None:
    hot = Status(1, 0x24 | 0x08, b"", 1)
    assert state_words(hot.state, 1) == "overheating, overload"
    assert refusal_words(hot.refusal, 1) == "range"
    alert = Status(1, 0x87, b"", 2)
    assert alert.state == 0x80
    assert refusal_words(alert.refusal, 2) == "access"
    assert refusal_words(0, 1) == refusal_words(0, 2) == state_words(0, 1) == state_words(0, 2) == ""
