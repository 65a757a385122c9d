"""A file that is being written: what is in it, who can read it, and what is left when its writer dies or the disk is
full."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from recording_lab import UTC_NS, write

from urbihw.recording import reading, topics
from urbihw.recording.reading import Recording
from urbihw.recording.recording_file import PART, RecordingFile, RecordingRefused, part_of
from urbihw.recording.records import TopicRecord

SAMPLE = b'{"event":"Samples","time":81.25,"at":81.26,"times":{"6":81.25},"values":{"6":{"present_position":512}}}'
TRAFFIC = b'{"event":"Traffic","chunks":[[81.24,">","ffff0102"],[81.25,"<","fffe"]],"lost":0}'


def test_it_is_an_mcap_file_with_schemas_that_any_reader_shows(tmp_path: Path) -> None:
    file = write(tmp_path / "a.mcap", [SAMPLE, TRAFFIC])
    assert file.path == tmp_path / "a.mcap" and os.listdir(tmp_path) == ["a.mcap"]
    with file.path.open("rb") as opened:
        reader = make_reader(opened)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 3
        schemas = {schema.name: schema.encoding for schema in summary.schemas.values()}
        assert schemas == {"urbihw.Samples": "jsonschema"}
        rows = [(channel.topic, message.log_time - UTC_NS) for _, channel, message in reader.iter_messages()]
    assert rows == [("/wire/tx", 81_240_000_000), ("/samples", 81_250_000_000), ("/wire/rx", 81_250_000_000)]


def test_only_its_owner_reads_it_and_nothing_is_overwritten(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        file = write(tmp_path / "a.mcap", [SAMPLE])
    finally:
        os.umask(before)
    assert file.path.stat().st_mode & 0o777 == 0o600
    (tmp_path / f"b.mcap{PART}").symlink_to("/nowhere/else")
    for name in ("a.mcap", "b.mcap"):
        with pytest.raises(RecordingRefused):
            RecordingFile(tmp_path / name, 0, {})
    assert not Path("/nowhere").exists()


def test_a_file_of_the_same_name_that_was_made_meanwhile_stays(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", 0, {})
    (tmp_path / "a.mcap").write_text("mine")
    assert file.close() == part_of(tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_text() == "mine" and Recording(file.path).head.begun_ns == 0


WRITER = """
import sys, time
from pathlib import Path
from urbihw.recording.recording_file import RecordingFile
from urbihw.recording.records import TopicRecord
file = RecordingFile(Path(sys.argv[1]), 0, {})
now = 0.0
for number in range(10**9):
    file.add(TopicRecord("/wire/rx", number / 100, number.to_bytes(4, "big") * 8))
    file.keep(number / 100)
    if number == 350:
        print("now", flush=True)
        time.sleep(60)
"""


def test_what_is_killed_can_be_read_up_to_the_last_second(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline() == b"now\n"
        process.send_signal(signal.SIGKILL)
    assert not path.exists()
    recording = Recording(part_of(path))
    numbers = [int.from_bytes(message.data[:4], "big") for message in recording.messages()]
    # 3.5 s were written; the chunk of the last second was not yet full.
    assert numbers == list(range(len(numbers))) and 250 < len(numbers) <= 351
    assert "ends in the middle" in recording.damage


def test_a_full_disk_ends_the_recording_with_one_line_and_what_was_recorded_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = 60_000
    write_all = os.write

    def write_some(descriptor: int, data: memoryview) -> int:
        """What a disk does whose room ends in the middle of a write."""
        nonlocal room
        if not room:
            raise OSError(28, "No space left on device")
        sent = write_all(descriptor, data[:room])
        room -= sent
        return sent

    file = RecordingFile(tmp_path / "a.mcap", 0, {})
    monkeypatch.setattr(os, "write", write_some)
    for number in range(3000):
        file.add(TopicRecord(topics.WIRE_IN, number / 100, os.urandom(100)))
        file.keep(number / 100)
    assert file.problem == f"{tmp_path / 'a.mcap'}: No space left on device; what was recorded until then is kept"
    assert file.close() == part_of(tmp_path / "a.mcap")
    recording = Recording(file.path)
    times = [message.time for message in recording.messages()]
    assert 3.0 < times[-1] < 6.0 and file.path.stat().st_size < 60_000


def test_a_disk_is_left_to_others_before_it_is_full_and_a_file_has_an_end(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", 0, {}, spare=1 << 60)
    file.add(TopicRecord(topics.WIRE_IN, 1.0, b"x"))
    file.keep(time.monotonic())
    assert "almost full" in file.problem and [message.data for message in Recording(file.close()).messages()] == [b"x"]
    file = RecordingFile(tmp_path / "b.mcap", 0, {}, most=1000)
    for number in range(100):
        file.add(TopicRecord(topics.WIRE_IN, float(number), os.urandom(100)))
        file.keep(float(number))
    assert "which is the most" in file.problem and (tmp_path / "b.mcap").stat().st_size < 10_000


@pytest.mark.parametrize("complete", [True, False])
def test_a_part_is_the_same_with_an_index_and_without(complete: bool, tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", UTC_NS, {})
    for number in range(3000):
        topic = topics.WIRE_IN if number % 2 else topics.WIRE_OUT
        file.add(TopicRecord(topic, number / 100, number.to_bytes(2, "big")))
        file.keep(number / 100)
    path = file.close() if complete else part_of(tmp_path / "a.mcap")
    recording = Recording(path)
    part = [int.from_bytes(message.data, "big") for message in recording.messages((topics.WIRE_IN,), 10.0, 12.0)]
    assert part == list(range(1001, 1200, 2))
    unpacked: list[Chunk] = []
    whole = reading._unpacked

    def unpack(chunk: Chunk) -> bytes:
        unpacked.append(chunk)
        return whole(chunk)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reading, "_unpacked", unpack)
        assert len(list(recording.messages(since=10.0, until=12.0))) == 201
    assert len(unpacked) <= 6 if complete else len(unpacked) > 25
    if not complete:
        file.close()
