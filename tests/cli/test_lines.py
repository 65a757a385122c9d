"""What a server says, cut into lines."""

from __future__ import annotations

import pytest

from urbihw.cli import lines as module
from urbihw.cli.lines import BadLine, Binary, Line, Lines

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


def test_sizes_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONGEST", 100)
    with pytest.raises(BadLine, match="announced 101 bytes"):
        Lines().feed(b"[00000001] BIN 101\n")
    with pytest.raises(BadLine, match="a line of more than"):
        Lines().feed(b"x" * 101)
