"""Files of strangers: sizes that lie, bombs, cuts at every place; each costs little and gives one clear line."""

from __future__ import annotations

import csv
import json
import os
import random
import resource
import shlex
import struct
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from recording_lab import write

from urbihw.cli.main import main
from urbihw.cli.replay import serve_command
from urbihw.recording.reading import (
    MOST_CHUNK_BYTES,
    MOST_SORTED,
    RecordedMessage,
    Recording,
    UnreadableRecording,
    in_order,
)

MAGIC = b"\x89MCAP0\r\n"
HEADER = b"\x01" + struct.pack("<Q", 8) + bytes(8)
TRAFFIC = b'{"event":"Traffic","chunks":[[%d.5,">","ffff0102"]],"lost":0}'


def record(opcode: int, body: bytes, size: int | None = None) -> bytes:
    return bytes([opcode]) + struct.pack("<Q", len(body) if size is None else size) + body


def chunk(kind: bytes, data: bytes, size: int) -> bytes:
    """A chunk that says it has so many bytes unpacked."""
    head = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(kind)) + kind + struct.pack("<Q", len(data))
    return record(0x06, head + data)


BOMB = bytes(1 << 28)
HOSTILE: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "another file": lambda: b"PK\x03\x04" + bytes(100),
    "only the beginning": lambda: MAGIC,
    "a record of 2^63 bytes": lambda: MAGIC + HEADER + record(0x05, b"x", (1 << 63) - 1),
    "a record longer than the file": lambda: MAGIC + HEADER + record(0x05, b"x", 1000),
    "a chunk that claims 2^60 bytes": lambda: MAGIC + HEADER + chunk(b"", b"x", 1 << 60),
    "a zstd bomb": lambda: MAGIC + HEADER + chunk(b"zstd", zstandard.compress(BOMB), 100),
    "a zstd bomb that says so": lambda: MAGIC + HEADER + chunk(b"zstd", zstandard.compress(BOMB), len(BOMB)),
    "an lz4 bomb": lambda: MAGIC + HEADER + chunk(b"lz4", lz4.frame.compress(BOMB), 100),
    "an unknown compression": lambda: MAGIC + HEADER + chunk(b"rar", b"x", 1),
    "a compression that is none": lambda: MAGIC + HEADER + chunk(b"zstd", b"rubbish", 7),
    "a text of 2^32 letters": lambda: MAGIC + HEADER + record(0x04, struct.pack("<HHI", 1, 0, (1 << 32) - 1)),
    "a text that is none": lambda: MAGIC + HEADER + record(0x04, struct.pack("<HHI", 1, 0, 2) + b"\xff" * 20),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_one_line_and_little_memory(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(HOSTILE[name]())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    code = main(["show", str(path)])
    told = capsys.readouterr()
    (line,) = told.err.splitlines()
    assert line.startswith(f"urbihw show: {path}: ") and told.out == "" and code in (0, 66)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2 * MOST_CHUNK_BYTES >> 10


def test_a_file_cut_or_damaged_anywhere_never_raises(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mcap", [TRAFFIC % number for number in range(50)]).path.read_bytes()
    chance = random.Random(5)
    path = tmp_path / "b.mcap"
    for _ in range(150):
        data = bytearray(whole[: chance.randrange(8, len(whole))])
        for _ in range(chance.randrange(3)):
            data[chance.randrange(8, len(data))] ^= 1 << chance.randrange(8)
        path.write_bytes(data)
        try:
            recording = Recording(path)
        except UnreadableRecording as error:
            assert str(error).startswith(str(path))
            continue
        assert len(list(in_order(recording.messages()))) <= 50
        assert len(list(recording.messages(since=10.0, until=20.0))) <= 11


def test_what_stands_before_the_damage_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE, use_chunking=False)
    writer.start()
    channel = writer.register_channel("/wire/rx", "raw", 0)
    for number in range(20):
        writer.add_message(channel, number, b"abc", number)
    path.write_bytes(stream.getvalue() + record(0x06, b"rubbish"))
    recording = Recording(path)
    assert len(list(recording.messages())) == 20 and "damaged after" in recording.damage


def test_what_stands_before_the_damage_of_a_chunk_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    channel = record(0x04, struct.pack("<HHI3sI3sI", 1, 0, 3, b"/ab", 3, b"raw", 0))
    message = record(0x05, struct.pack("<HIQQ", 1, 0, 7, 7) + b"abc")
    data = channel + message + record(0x05, b"\1")
    path.write_bytes(MAGIC + HEADER + chunk(b"", data, len(data)))
    recording = Recording(path)
    assert [each.data for each in recording.messages()] == [b"abc"] and "damaged after" in recording.damage


def test_only_some_bytes_are_sorted_at_a_time() -> None:
    most, taken, given = 0, 0, 0
    data = bytes(1 << 20)

    def many() -> Iterator[RecordedMessage]:
        nonlocal taken
        for number in range(100):
            taken += len(data)
            yield RecordedMessage("/wire/rx", -number / 1000, data)

    for message in in_order(many()):
        most = max(most, taken - given)
        given += len(message.data)
    assert most <= MOST_SORTED + len(data) and given == 100 << 20


EVIL = "=cmd|x\x1b]0;evil\x07\n"
DEEP = b"[" * 3000 + b"]" * 3000
HOSTILE_WORDS = [
    ("/statistics", b'{"rate":1' + b"0" * 400 + b',"late":0,"load":1,"errors":{}}'),
    ("/statistics", b'{"rate":1' + b"0" * 5000 + b',"late":0,"load":1,"errors":{}}'),
    ("/targets", b'{"values":[["3","a",%s]]}' % DEEP),
    ("/targets", b'{"values":[[%s,"a",1]]}' % DEEP),
    ("/samples", b'{"values":{"3":{"a":%s}}}' % DEEP),
    ("/samples", json.dumps({"values": {EVIL: {EVIL: EVIL}}}).encode()),
    ("/samples", json.dumps({"values": {"3": {"b" * 1000: 1}}}).encode()),
    ("/samples", json.dumps({"values": {"3": {"position": 512}}}).encode()),
    ("/events", b'{"event":"Limited","device":"3","item":"a","limit":%s}' % DEEP),
    ("/events", b'{"event":"Refused","device":%s,"item":"a","reason":""}' % DEEP),
    ("/writers", b'{"names":{"3":%s}}' % DEEP),
    ("/wire/state", b'{"event":"Found","devices":[{"a":"\\ud800"}]}'),
    ("/\x1b[2J", b"\xff"),
]


@pytest.fixture(autouse=True)
def own_recursion_limit() -> Iterator[None]:
    """The limit of a command: a kernel of another test has raised that of this process."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(1000)
    yield
    sys.setrecursionlimit(before)


@pytest.fixture
def words_of_a_stranger(tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {topic: writer.register_channel(topic, "json", 0) for topic, _ in HOSTILE_WORDS}
        for number, (topic, data) in enumerate(HOSTILE_WORDS):
            writer.add_message(channels[topic], number, data, number)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize(
    "words", [["--kind", "all"], ["--kind", "all", "--device", "3"], ["--why", "3"], ["--csv", "--raw"]]
)
def test_hostile_words_are_shown_in_printable_lines(
    words: list[str], words_of_a_stranger: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", str(words_of_a_stranger), *words]) == 0
    told = capsys.readouterr()
    lines = told.out.split("\n")
    assert len(lines) > 1 and all(line.isprintable() and len(line) <= 400 for line in lines) and not told.err


def test_names_of_columns_are_no_formulas(words_of_a_stranger: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(words_of_a_stranger), "--csv", "--raw"]) == 0
    head, *rows = list(csv.reader(capsys.readouterr().out.splitlines()))
    cell = r"'=cmd|x\x1b]0;evil\x07\n"
    assert head == ["time", rf"{cell}.{cell[1:]}", "3.position"]
    assert [row[1:] for row in rows] == [[cell, ""], ["", "512"]]


def test_the_command_for_a_replay_is_safe_to_copy() -> None:
    assert serve_command("bioloid", "pipe:a") == "urbihw serve --platform bioloid --url pipe:a"
    command = serve_command("x; rm -r ~ \x1b[2J", "pipe:a")
    assert command.isprintable() and shlex.split(command)[3] == r"x; rm -r ~ \x1b[2J"


@pytest.mark.parametrize("kind", ["folder", "fifo", "missing"])
def test_what_is_no_file_is_one_line(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    if kind == "folder":
        path.mkdir()
    if kind == "fifo":
        os.mkfifo(path)
    with pytest.raises(UnreadableRecording, match="cannot be read|not a regular file"):
        Recording(path)


