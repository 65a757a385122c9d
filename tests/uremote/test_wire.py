"""The bytes between a server and a remote: frames and lines, cut anywhere, and what is neither."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from urbihw.kernel.uobject.binary import UBinary, UImage
from urbihw.kernel.uremote.frames import (
    MAX_VALUES,
    VALUES_PER_STEP,
    BadBinaryFrame,
    BinaryDecoder,
    EmitRequest,
    Frame,
    ProgramText,
    Result,
    SlotName,
    StringTooLong,
    Update,
    encode,
)
from urbihw.kernel.uremote.remote import ProtocolError, ServerLine, ServerReader, literal

# The examples of the reference, section 7.
EXAMPLES = [
    (
        "01 000b 6f626a6563745f31382e61 02 0000000000001440 757aba5a 00000005",
        Update("object_18.a", 5.0, 0x5757ABA5A),
    ),
    ("0a 0003 5f3230 05 0002 6162", Result("_20", "ab")),
    ("0b 0002 3b0a", ProgramText(";\n")),
    ("02 000c 6f626a6563745f31382e6576 00000000", EmitRequest("object_18.ev", [])),
]


@pytest.mark.parametrize(("spaced", "frame"), EXAMPLES)
def test_the_examples_of_the_reference(spaced: str, frame: Any) -> None:
    data = bytes.fromhex(spaced)
    assert b"".join(encode(frame)) == data
    assert list(BinaryDecoder().feed(b"\x02\x04\x08\x08" + data)) == [frame]


FRAMES: list[Frame] = [
    Update("a.b", [1.0, "x", None, {"k": 2.5, "l": []}], 1 << 40),
    Update("a.c", UImage(bytes(range(12)), "rgb 2 2"), 0),
    EmitRequest("a.e", [UBinary(b"", ""), SlotName("a"), -0.5]),
    Result("_1", None), ProgramText("x|;"),
]


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_frames_cut_anywhere(size: int) -> None:
    data = b"\n;\x02\x04\x08\x08" + b"".join(b"".join(encode(frame)) for frame in FRAMES)
    decoder = BinaryDecoder()
    found: list[Frame] = []
    for at in range(0, len(data), size):
        found += decoder.feed(data[at : at + size])
    assert found == FRAMES


def test_an_unknown_code_is_skipped() -> None:
    decoder = BinaryDecoder()
    assert list(decoder.feed(b"\x02\x04\x08\x08\x63\x05\x0b\x00\x01;")) == [ProgramText(";")]
    assert decoder.skipped == [0x63, 5]


def test_what_is_too_much_is_refused() -> None:
    with pytest.raises(BadBinaryFrame, match="sizes 02 04 04 08"):
        list(BinaryDecoder().feed(b"\x02\x04\x04\x08"))
    with pytest.raises(BadBinaryFrame, match="more than 1000 bytes"):
        list(BinaryDecoder(1000).feed(b"\x02\x04\x08\x08\x0b\xff\xff"))
    with pytest.raises(StringTooLong, match="70000 bytes"):
        encode(Result("_1", "x" * 70000))
    with pytest.raises(TypeError, match="a set cannot be sent"):
        encode(Result("_1", set()))


class Counting(BinaryDecoder):
    """Counts the values that it begins to read."""

    begun = 0

    def _value(self, deep: int) -> Any:
        self.begun += 1
        return super()._value(deep)


def test_nothing_is_read_twice_however_slowly_it_comes() -> None:
    frame = Update("a.b", [["x"] * 10 for _ in range(100)], 1)
    decoder = Counting()
    data = b"\x02\x04\x08\x08" + b"".join(encode(frame))
    assert [found for at in range(len(data)) for found in decoder.feed(data[at : at + 1])] == [frame]
    assert decoder.begun == 1 + 100 + 1000


def test_a_large_frame_is_read_a_part_at_a_time() -> None:
    decoder = BinaryDecoder()
    frame = Update("a.b", [1.0] * 5000, 1)
    decoder.add(b"\x02\x04\x08\x08" + b"".join(encode(frame)))
    pauses = 0
    while (found := decoder.next()) is None:
        assert decoder.paused
        pauses += 1
    assert found == frame and pauses == 5000 // VALUES_PER_STEP
    assert decoder.next() is None and not decoder.paused and decoder.waiting == 0


@pytest.mark.parametrize("value", [
    b"\x03\xff\xff\xff\xff", b"\x01\xff\xff\xff\xff", b"\x00\x00\x00\xff\xff\xff\xff",
    b"\x03" + (MAX_VALUES + 1).to_bytes(4, "big"),
    b"\x03\x00\x00\x00\x02" + 2 * (b"\x03" + (MAX_VALUES // 2).to_bytes(4, "big") + b"\x07" * (MAX_VALUES // 2)),
    b"\x03\x00\x00\x00\x01" * 70, b"\x01\x00\x00\x00\x01\x00\x01k" * 70, b"\x09",
])
def test_lengths_are_judged_before_anything_is_kept(value: bytes) -> None:
    with pytest.raises(BadBinaryFrame):
        list(BinaryDecoder().feed(b"\x02\x04\x08\x08\x01\x00\x03a.b" + value))


def test_noise_never_does_more_than_be_refused() -> None:
    dice = random.Random(1)
    for _ in range(3000):
        decoder = BinaryDecoder(1 << 16)
        try:
            for _ in range(4):
                list(decoder.feed(b"\x02\x04\x08\x08" + dice.randbytes(30)))
        except BadBinaryFrame:
            pass
    for _ in range(3000):
        reader = ServerReader(1 << 12)
        try:
            for _ in range(4):
                noise = bytes(dice.choice(b'[]",=>\\x 0139.BIN\n:_aE-') for _ in range(40))
                list(reader.feed(b"[00000001:__ExternalMessage__] " + noise))
        except ProtocolError:
            pass


# ---------------------------------------------------------------- lines

LINES = [
    (b'[0, "object_15.init__1", "_18", 0.01]', [0.0, "object_15.init__1", "_18", 0.01]),
    (b'[1, "a.b", "str\\"q\\\\ \\n\\t\\x01\\xe9", 4.5]', [1.0, "a.b", 'str"q\\ \n\t\x01\xe9', 4.5]),
    (b'[1, "a.b", BIN 3 rgb 1 1\nx\ny, 6.26635]', [1.0, "a.b", UImage(b"x\ny", "rgb 1 1"), 6.26635]),
    (b"[1, [BIN 1 x\n1, 2, BIN 0\n]]", [1.0, [UBinary(b"1", "x"), 2.0, UBinary(b"", "")]]),
    (b'[1, ["k" => 1.5, "l" => [nil, true, false, void]], [ => ], [=>], []]',
     [1.0, {"k": 1.5, "l": [None, True, False, None]}, {}, {}, []]),
    (b"[2, object_3, Object_0x12, inf, -inf, 1e+30, -1e-3, 0x10]",
     [2.0, SlotName("object_3"), SlotName("Object_0x12"), math.inf, -math.inf, 1e30, -0.001, 16.0]),
    (b'[4, "a" , "b"]', [4.0, "a", "b"]),
]


@pytest.mark.parametrize("size", [1, 5, 1000])
@pytest.mark.parametrize(("text", "value"), LINES)
def test_lines_cut_anywhere(size: int, text: bytes, value: Any) -> None:
    data = b"[00001234] hello\n[00001235:__ExternalMessage__] " + text + b"\nnoise\n[00001236:error] !!! no\n"
    reader = ServerReader()
    found: list[ServerLine] = []
    for at in range(0, len(data), size):
        found += reader.feed(data[at : at + size])
    heads = [(line.stamp, line.channel) for line in found]
    assert heads == [(1234, ""), (1235, "__ExternalMessage__"), (1236, "error")]
    assert found[1].value == value and found[1].valid


@pytest.mark.parametrize("text", [b"[1, ]]", b"?", b"[1, BIN x\n]", b"[=> 1]", b'["a', b"[" * 100])
def test_what_is_no_value_is_left_out_and_the_next_line_is_read(text: bytes) -> None:
    lines = list(
        ServerReader().feed(b"[00000001:__ExternalMessage__] " + text + b"\n[00000002:__ExternalMessage__] [8]\n")
    )
    assert lines[-1].value == [8.0]


def test_a_line_without_end_is_garbage() -> None:
    reader = ServerReader(1000)
    with pytest.raises(ProtocolError, match="more than 1000 bytes"):
        for _ in range(100):
            list(reader.feed(b'[00000001:x] "' + b"a" * 100))


@pytest.mark.parametrize(("value", "text"), [
    (5.1, b"5.1"), (3.0, b"3"), (1 / 3, b"0.3333333333333333"), (math.inf, b"inf"), (True, b"1"), (None, b"nil"),
    ('a"\\\n\t\x01\xe9', b'"a\\"\\\\\\n\\t\\x01\\xe9"'), ([1, ["x"]], b'[1, ["x"]]'), ({}, b"[=>]"),
    ({"a": 1}, b'["a"=>1]'), (UBinary(b")\n", "k"), b'Global.Binary.new("k", "\\B(2)()\n)")'),
    (SlotName("a.b"), b"a.b"),
])
def test_literals(value: Any, text: bytes) -> None:
    assert literal(value) == text
