"""How lines reach a recorder: bounded queues, a worker that ends and comes back, requests, the end of a recording."""

from __future__ import annotations

import json
import os
import socket
import stat
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from urbihw.cli.main import main
from urbihw.cli.record import RecordingEnd
from urbihw.recording import topics
from urbihw.recording.door import DoorTaken, RecorderDoor, ask
from urbihw.recording.feed import LineQueue, WorkerFeed
from urbihw.recording.recorder import RobotRecorder
from urbihw.recording.recording_file import RecordingRefused
from urbihw.recording.records import RecordMaker, TopicRecord

ANSWER = {"ok": True, "do": "record", "time": 5.0, "link": True, "estop": "", "epoch": 1, "url": "/dev/ttyUSB0",
          "devices": [], "baud": 57600, "settings": {"rate": 100.0}}  # fmt: skip


class Kept:
    """A sink that keeps all."""

    def __init__(self) -> None:
        self.records: list[TopicRecord] = []

    def add(self, record: TopicRecord) -> None:
        self.records.append(record)

    def keep(self, now: float) -> None:
        pass


def test_a_queue_drops_the_oldest_and_the_file_says_how_many() -> None:
    queue, kept = LineQueue(most=10_000), Kept()
    recorder = RobotRecorder(queue, RecordMaker(), [kept])
    for number in range(1000):
        queue.put(b'{"event":"Traffic","chunks":[[%d.0,"<","%04x"]],"lost":0}' % (number, number))
    assert recorder.step(lambda: 7.0, 0.0) < 250
    *wire, lost = kept.records
    assert [record.time for record in wire] == [float(number) for number in range(1000 - len(wire), 1000)]
    assert (lost.topic, lost.time) == (topics.LOST, 7.0)
    assert json.loads(lost.data) == {"count": 1000 - len(wire), "where": "recorder"}


def test_a_worker_that_ended_is_waited_for_and_both_is_recorded(tmp_path: Path) -> None:
    path = tmp_path / "bioloid-1.sock"

    def serve(then: Callable[[socket.socket], None]) -> threading.Thread:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        listener.bind(str(path))
        listener.listen()

        def once() -> None:
            with listener:
                client, _ = listener.accept()
            path.unlink()
            with client, client.makefile("rb") as lines:
                assert json.loads(lines.readline())["do"] == "record"
                client.sendall(json.dumps(ANSWER).encode() + b"\n")
                assert json.loads(lines.readline())["do"] == "values"
                then(client)

        thread = threading.Thread(target=once)
        thread.start()
        return thread

    stopped = b'{"event":"Stopped","reason":"%s","epoch":1,"devices":null,"at":6}\n'
    first = serve(lambda client: client.sendall(stopped % b"one"))
    queue, kept = LineQueue(), Kept()
    feed = WorkerFeed(path, queue)
    first.join()
    second = serve(lambda client: client.sendall(stopped % b"two"))
    recorder = RobotRecorder(queue, RecordMaker(), [kept])
    words: list[str] = []
    recorder.heard = words.append
    end = time.monotonic() + 20
    while words.count("stop") < 2 and time.monotonic() < end:
        recorder.step(time.monotonic, 0.05)
    feed.close()
    second.join()
    told = [json.loads(record.data) for record in kept.records if record.topic == topics.EVENTS]
    assert [each.get("what") or each["reason"] for each in told][:4] == [
        "one", "the worker is gone", "the worker is back", "two"
    ] and words[:2] == ["stop", "gone"]


def test_what_is_no_worker_of_this_version_is_told(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(tmp_path / "a.sock"))
        listener.listen()

        def refuse() -> None:
            with listener.accept()[0] as client:
                assert client.recv(4096)
                client.sendall(b'{"ok":false,"error":"what?"}\n')

        answer = threading.Thread(target=refuse)
        answer.start()
        with pytest.raises(ValueError, match="is it of the same version"):
            WorkerFeed(tmp_path / "a.sock", LineQueue())
        answer.join()


def test_a_recorder_answers_and_there_is_one_at_a_place(tmp_path: Path) -> None:
    path = tmp_path / "bioloid-1.recording"
    asked: list[str] = []

    def answer(verb: str) -> str:
        asked.append(verb)
        return "/a/file"

    door = RecorderDoor(path, answer)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    ended = threading.Event()

    def poll() -> None:
        while not ended.wait(0.005):
            door.poll()

    polling = threading.Thread(target=poll)
    polling.start()
    assert ask(path, "stop") == "/a/file"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as odd:
        odd.connect(str(path))
        odd.sendall(b"[[[\n")
        assert b"false" in odd.recv(100)
    with pytest.raises(DoorTaken):
        RecorderDoor(path, str)
    ended.set()
    polling.join()
    door.close()
    assert asked == ["stop"] and not path.exists()
    path_of_dead = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    path_of_dead.bind(str(path))
    path_of_dead.close()
    RecorderDoor(path, str).close()  # what a killed recorder has left is no recorder


def test_a_recorder_does_not_wait_for_who_asks(tmp_path: Path) -> None:
    door = RecorderDoor(tmp_path / "a.flight", str.upper)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as silent, socket.socket(socket.AF_UNIX) as slow:
        silent.connect(str(door.path))
        slow.connect(str(door.path))
        slow.sendall(b'{"do":')
        begun = time.monotonic()
        door.poll()
        slow.sendall(b'"last"}\n')
        door.poll()
        assert json.loads(slow.recv(100)) == {"ok": True, "told": "LAST"}
        assert time.monotonic() - begun < 0.9
    door.close()


def test_what_a_recorder_cannot_do_is_told_in_its_words_and_is_no_path(tmp_path: Path) -> None:
    def answer(verb: str) -> str:
        raise RecordingRefused("the disk is away")

    door = RecorderDoor(tmp_path / "a.flight", answer)
    ended = threading.Event()

    def poll() -> None:
        while not ended.wait(0.005):
            door.poll()

    polling = threading.Thread(target=poll)
    polling.start()
    try:
        with pytest.raises(RecordingRefused, match="^the disk is away$"):
            ask(door.path, "last")
    finally:
        ended.set()
        polling.join()
        door.close()


def test_a_busy_recorder_is_a_recorder(tmp_path: Path) -> None:
    busy = RecorderDoor(tmp_path / "a.flight", str)  # nothing polls it
    begun = time.monotonic()
    with pytest.raises(DoorTaken):
        RecorderDoor(busy.path, str)
    assert time.monotonic() - begun < 10
    busy.close()


def test_a_recorder_that_ends_leaves_the_socket_of_its_successor(tmp_path: Path) -> None:
    first = RecorderDoor(tmp_path / "a.flight", str)
    first.path.rename(tmp_path / "moved")  # so that it can be bound again while the first one lives
    second = RecorderDoor(first.path, str)
    first.close()
    assert second.path.exists()
    second.close()
    assert not second.path.exists()


def test_when_a_recording_ends() -> None:
    now = time.monotonic()
    assert not RecordingEnd(None).is_due(now + 1e9)
    timed = RecordingEnd(90.0)
    assert not timed.is_due(now + 89) and timed.is_due(now + 91)
    worded = RecordingEnd("estop")
    worded.hear("stop")
    worded.hear("lost")
    assert not worded.is_due(now)
    worded.hear("estop")
    assert worded.is_due(now)
    asked = RecordingEnd(None)
    assert asked.asked("state", Path("/a")) == "/a" and not asked.is_due(now)
    assert asked.asked("stop", Path("/a")) == "/a" and asked.is_due(now)


@pytest.mark.parametrize(("words", "told"), [
    (["record", "--name", "../x"], "is no name"), (["record", "--until", "soon"], "say 90s"),
    (["record", "--until", "90"], "say 90s"), (["show", "a.mcap", "--at", "-1"], "--at"),
])  # fmt: skip
def test_wrong_words_are_one_line(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(words)
    (line,) = capsys.readouterr().err.splitlines()
    assert end.value.code == 78 and told in line


def test_without_the_extra_one_line_names_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "mcap"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mcap", None)
    (tmp_path / "a.mcap").write_bytes(os.urandom(10))
    for command in ("show", "replay"):
        assert main([command, str(tmp_path / "a.mcap")]) == 66
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"urbihw {command}: this needs a package: ") and "mcap" in line
