"""Signatures, values and headers of QiMessaging: bytes as the fact sheet describes them, and hostile ones."""

from __future__ import annotations

import random
from typing import Any

import pytest

from urbihw.buses.errors import BadFrame, BadValue
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.metatype import META_OBJECT
from urbihw_nao.qimessaging.signatures import parse
from urbihw_nao.qimessaging.values import decode, encode, signature_of

VECTORS: list[tuple[str, Any, str]] = [
    ("b", True, "01"),
    ("c", -2, "fe"), ("C", 254, "fe"),
    ("w", -2, "feff"), ("W", 0x1234, "3412"),
    ("i", -2, "feffffff"), ("I", 1, "01000000"),
    ("l", -1, "ff" * 8), ("L", 1, "01" + "00" * 7),
    ("f", 0.5, "0000003f"), ("d", 0.5, "000000000000e03f"),
    ("s", "Nao", "03000000" + "4e616f"),
    ("r", b"\xff\x00", "02000000" + "ff00"),
    ("v", None, ""),
    ("[i]", [1, 2], "02000000" + "01000000" + "02000000"),
    ("{sb}", {"a": True}, "01000000" + "0100000061" + "01"),
    ("(if)<Point,x,y>", (1, 0.5), "01000000" + "0000003f"),
    ("m", 7, "0100000069" + "07000000"),
    ("m", "x", "0100000073" + "0100000078"),
    ("m", [1.0], "030000005b645d" + "01000000" + "000000000000f03f"),
    ("m", [1, "a"], "030000005b6d5d" + "02000000" + "0100000069" + "01000000" + "0100000073" + "0100000061"),
]  # fmt: skip


@pytest.mark.parametrize(("signature", "value", "data"), VECTORS)
def test_values_have_these_bytes(signature: str, value: Any, data: str) -> None:
    assert encode(signature, value).hex() == data
    assert decode(signature, bytes.fromhex(data)) == value


def test_the_header_of_authenticate() -> None:
    # Service 0, object 0, action 8, an empty capability map.
    call = f.QiMessage(f.CALL, 1, 0, 0, 8, encode("{sm}", {}))
    assert bytes(call).hex() == "42dead4201000000040000000000010000000000000000000800000000000000"
    assert f.QiFramer().feed(bytes(call)) == [call]


def test_messages_come_in_any_pieces() -> None:
    messages = [f.QiMessage(f.REPLY, number, 2, 1, 100, bytes(number)) for number in range(5)]
    stream = b"".join(map(bytes, messages))
    for size in (1, 7, 28, 1000):
        framer = f.QiFramer()
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        assert [each for piece in pieces for each in framer.feed(piece)] == messages


@pytest.mark.parametrize("head", [b"HTTP/1.1 400 Bad Request\r\n\r\n....", b"\x42\xde\xad\x42" + b"\xff" * 24])
def test_a_header_that_is_none_is_said(head: bytes) -> None:
    with pytest.raises(BadFrame, match=r"no message of QiMessaging"):
        f.QiFramer().feed(head)


def test_a_message_of_two_gigabytes_is_not_waited_for() -> None:
    head = f.HEADER.pack(f.MAGIC, 1, 1 << 31, 0, f.REPLY, 0, 1, 1, 100)
    with pytest.raises(BadFrame, match="at most 16777216 are accepted"):
        f.QiFramer().feed(head)


@pytest.mark.parametrize(
    "signature",
    ["", "q", "[", "[]", "[ii]", "{i}", "(i", "ii", "i]", "(i)<Point", "[" * 1000 + "i" + "]" * 1000, "(" * 5000],
)
def test_signatures_that_are_none(signature: str) -> None:
    with pytest.raises(BadFrame):
        parse(signature)


def test_the_signature_of_a_meta_object_is_read() -> None:
    assert str(parse(META_OBJECT)) == "({I(Issss[(ss)]s)}{I(Iss)}{I(Iss)}s)"


@pytest.mark.parametrize(
    ("signature", "data"),
    [
        ("s", "ffffffff41"),
        ("[i]", "ffffffff"),
        ("[v]", "ffffffff"),
        ("[[v]]", "020000000400000009000000"),
        ("{ii}", "00000010"),
        ("i", "0000"),
        ("m", "05000000" + b"[[[[i".hex()),
        ("X", "00"),
    ],
)
def test_lengths_are_not_believed(signature: str, data: str) -> None:
    with pytest.raises(BadFrame):
        decode(signature, bytes.fromhex(data))


def test_dynamic_values_in_each_other_end() -> None:
    with pytest.raises(BadFrame, match="too deep"):
        decode("m", b"\x01\x00\x00\x00m" * 5000)


def test_random_bytes_are_values_or_bad_frames() -> None:
    rng = random.Random(1)
    for _ in range(3000):
        data = rng.randbytes(rng.randrange(60))
        for signature in ("m", "[m]", "{sm}", META_OBJECT):
            try:
                decode(signature, data)
            except BadFrame:
                pass


@pytest.mark.parametrize(
    ("signature", "value"),
    [
        ("i", 1 << 31),
        ("I", -1),
        ("i", True),
        ("i", 0.5),
        ("i", float("nan")),
        ("b", 2),
        ("f", "x"),
        ("s", 1),
        ("[i]", [1, "a"]),
        ("(i)", (1, 2)),
    ],
)
def test_values_of_another_type_are_refused(signature: str, value: Any) -> None:
    with pytest.raises(BadValue, match="is no value of type"):
        encode(signature, value)


def test_numbers_of_programs_are_accepted_where_nothing_is_lost() -> None:
    assert encode("(iLb)", (5.0, 3.0, 1.0)).hex() == "05000000" + "0300000000000000" + "01"


def test_what_cannot_travel_is_refused() -> None:
    assert signature_of([1 << 40]) == "[m]"
    with pytest.raises(BadValue, match="a object cannot be sent"):
        encode("m", object())
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(BadValue, match="too deep"):
        encode("m", loop)


@pytest.mark.parametrize(
    "text", ["[(" + "v" * 1000 + ")]", "[" + "(" * 3 + "vvv" + ")" * 3 + "]", "[v]"], ids=["wide", "deep", "void"]
)
def test_elements_without_bytes_are_bounded(text: str) -> None:
    data = encode("s", text) + encode("I", 2000) + bytes(100)
    with pytest.raises(BadFrame, match="elements in a message of"):
        decode("m", data)


def test_a_reader_may_allow_fewer_elements() -> None:
    data = encode("m", [1.0] * 10)
    assert decode("m", data, 15) == [1.0] * 10
    with pytest.raises(BadFrame, match="more than 5 elements"):
        decode("m", data, 5)
