"""What a server says, cut into lines."""

from __future__ import annotations

import math

import pytest

from urbihw.client.lines import BadLine, Binary, Line, Lines
from urbihw.client.values import NotAValue, value_of

TALK = (
    b"[00000001] 1\n"
    b"[00000002:error] !!! 1.1-3: lookup failed: foo\n"
    b"[00000003] function () {\n  1;\n}\n"
    b"[00000004] BIN 4 jpeg 1 2\n[1]\n\n"
    b'[00000005:img] ["a" => BIN 3\nabc, BIN 1 x y\n\n, 2]\n'
    b"[00000006] *** BIN 5 ways\n"
    b'[00000007] ["[BIN 3 x", 4]\n'
    b"[00000008] ***\n"
)


def told(data: bytes, size: int) -> list[Line]:
    """The lines when the bytes come in packets of a size."""
    reader = Lines()
    found = []
    for at in range(0, len(data), size):
        found += reader.feed(data[at : at + size])
    assert reader.rest == b""
    return found


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_lines_however_the_bytes_are_cut(size: int) -> None:
    found = told(TALK, size)
    assert [(line.stamp, line.channel) for line in found] == [
        (1, ""), (2, "error"), (3, ""), (None, ""), (None, ""), (4, ""), (5, "img"), (6, ""), (7, ""), (8, ""),
    ]
    assert [line.text for line in found[2:5]] == [b"function () {", b"  1;", b"}"]
    assert [line.is_error for line in found[:2]] == [False, True]
    assert found[5].binaries == (Binary("jpeg 1 2", b"[1]\n"),)
    assert found[6].binaries == (Binary("", b"abc"), Binary("x y", b"\n"))
    assert [line.binaries for line in found[7:]] == [(), (), ()]
    assert b"\n".join(line.raw for line in found) + b"\n" == TALK


def test_what_has_no_line_feed_yet_waits() -> None:
    reader = Lines()
    assert reader.feed(b"[00000001] BIN 10\n12345\n") == []
    assert reader.rest.endswith(b"12345\n")
    (line,) = reader.feed(b"6789\n")
    assert line.binaries == (Binary("", b"12345\n6789"),)


def test_text_of_people_may_be_anything() -> None:
    (line,) = Lines().feed(b"[00000001:a b] *** caf\xe9\n")
    assert (line.channel, line.shown) == ("a b", "*** caf�")


def test_sizes_are_bounded() -> None:
    with pytest.raises(BadLine, match="announced 101 bytes"):
        Lines(100).feed(b"[00000001] BIN 101\n")
    with pytest.raises(BadLine, match="a line of more than"):
        Lines(100).feed(b"x" * 101)
    with pytest.raises(BadLine, match="announced 60 bytes"):
        Lines(100).feed(b"[00000001] [BIN 40\n" + b"x" * 40 + b", BIN 60\n")


@pytest.mark.parametrize("text", [b'["a, BIN 5 b", 1]', b'"\\", BIN 5"', b"*** BIN 5", b'["[BIN 5'])
def test_what_looks_like_a_binary_within_a_string_is_none(text: bytes) -> None:
    lines = Lines().feed(b"[00000001] " + text + b"\n[00000002] 2\n")
    assert [(line.stamp, line.binaries) for line in lines] == [(1, ()), (2, ())]


def test_keywords_of_a_binary_may_have_quotes() -> None:
    (line,) = Lines().feed(b'[00000001] ["x", BIN 2 say "hi"\n\n\n]\n')
    assert line.binaries == (Binary('say "hi"', b"\n\n"),)


def test_a_binary_is_looked_for_only_where_there_are_values() -> None:
    lines = Lines(has_values=lambda channel: channel == "v").feed(b"[00000001:t] BIN 5\n[00000002:v] BIN 1\n\n\n")
    assert [(line.channel, line.text) for line in lines] == [("t", b"BIN 5"), ("v", b"BIN 1\n\n")]


def test_the_reader_knows_what_was_said_last_and_whether_it_was_urbiscript() -> None:
    lines = Lines()
    lines.feed(b"SSH-2.0\n")
    assert (lines.last, lines.stamped) == (b"SSH-2.0", False)
    lines.feed(b"[00000001] 1\n")
    assert (lines.last, lines.stamped) == (b"1", True)


# ---------------------------------------------------------------- values

VALUES = [
    (b'[1, "a\\n\xe9", 0x10, -1e-3, inf]', [1.0, "a\n\xe9", 16.0, -0.001, math.inf]),
    (b'["k" => [true, nil], "l" => [=>]]', {"k": [True, None], "l": {}}),
    (b"[BIN 2 rgb\n]\n, 7]", [Binary("rgb", b"]\n"), 7.0]),
    (b"[object_3, infra.red, nano]", ["object_3", "infra.red", "nano"]),
]


@pytest.mark.parametrize(("text", "value"), VALUES)
def test_values(text: bytes, value: object) -> None:
    (line,) = Lines().feed(b"[00000001:v] " + text + b"\n")
    assert value_of(line) == value


@pytest.mark.parametrize("text", [b"", b"?", b"[1", b'["a', b"[=> 1]", b"-", b"[BIN x, 1]", b"[" * 100])
def test_what_is_no_value(text: bytes) -> None:
    (line,) = Lines().feed(b"[00000001:v] " + text + b"\n")
    with pytest.raises(NotAValue):
        value_of(line)
