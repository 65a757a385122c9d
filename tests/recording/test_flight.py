"""The last minutes: what is kept, how much memory that takes, and when they are written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from recording_lab import RecordedWorker, kit_rig

from urbihw.buses import messages as m
from urbihw.recording import topics
from urbihw.recording.feed import LineQueue
from urbihw.recording.flight import FlightMemory
from urbihw.recording.flight_recorder import AFTERMATH_S, MOST_FILES, QUIET_S, FlightRecorder
from urbihw.recording.reading import Recording
from urbihw.recording.recorder import RobotRecorder
from urbihw.recording.recording_file import RecordingFile, RecordingRefused
from urbihw.recording.records import RecordMaker, TopicRecord


def fill(memory: FlightMemory, begin: float, end: float, size: int = 40, hz: int = 10) -> None:
    for number in range(round(begin * hz), round(end * hz)):
        time = number / hz
        memory.add(TopicRecord(topics.WIRE_IN, time, os.urandom(size)))
        memory.keep(time)


def test_the_last_seconds_are_kept_in_order_and_older_ones_are_not() -> None:
    memory = FlightMemory(30.0)
    fill(memory, 0, 100)
    times = [record.time for second in memory.seconds() for record in second]
    assert times == sorted(times) and times[-1] == 99.9 and times[0] == pytest.approx(70, abs=1.2)


def test_memory_has_an_end() -> None:
    memory = FlightMemory(3600.0, most=100_000)
    fill(memory, 0, 100, size=1000)
    assert memory.size < 120_000
    assert next(memory.seconds())[0].time > 85
    memory = FlightMemory(3600.0, most=100_000)
    for _ in range(20):
        memory.add(TopicRecord(topics.WIRE_IN, 1.0, bytes(1 << 20)))  # within one second
    assert memory.size < 6 << 20


class Lab:
    """A flight recorder on the lines of a worker in simulated time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.queue = LineQueue()
        self.maker = RecordMaker()
        self.memory = FlightMemory(300.0)
        self.bounds: dict[str, int] = {}
        self.files: list[RecordingFile] = []
        self.counts: list[int] = []
        """Records of the last file at each sign of life."""
        self.flight = FlightRecorder(self.memory, self.maker, folder, self.begin, self.alive)
        self.recorder = RobotRecorder(self.queue, self.maker, [self.memory])
        self.now = 0.0
        self.recorder.heard = lambda word: self.flight.hear(word, self.now)
        self.refused = ""
        self.count = 0

    def alive(self) -> None:
        self.counts.append(self.files[-1].count)

    def begin(self, reason: str) -> RecordingFile:
        if self.refused:
            raise RecordingRefused(self.refused)
        self.count += 1
        path = self.folder / f"flight-{self.count:04}-{reason}.mcap"
        self.files.append(RecordingFile(path, 0, {"reason": reason}, **self.bounds))
        return self.files[-1]

    def step(self, now: float, *lines: bytes) -> Path | None:
        self.now = now
        for line in lines:
            self.queue.put(line)
        self.recorder.step(lambda: now, 0.0)
        return self.flight.write_due(now)


LINK = b'{"event":"LinkState","up":false,"reason":"unplugged","mistake":false,"at":%d}'
LATCHED = b'{"event":"Latched","reason":"the cook","who":"the cook","holders":[],"freed":[],"at":%d}'
RELEASED = b'{"event":"Latched","reason":"Ann","who":"Bob","holders":[["ann","Ann"]],"freed":["Bob"],"at":%d}'
REFUSED = b'{"event":"Latched","reason":"Ann","who":"","holders":[["ann","Ann"]],"freed":[],"order":2,"at":%d}'
STOPPED = b'{"event":"Stopped","reason":"a stop","epoch":1,"devices":null,"at":%d}'


@pytest.mark.parametrize(("line", "reason"), [
    (LINK, "lost"), (LATCHED, "estop"), (STOPPED, ""), (RELEASED, ""), (REFUSED, ""),
])  # fmt: skip
def test_what_goes_wrong_is_written_with_what_came_of_it(line: bytes, reason: str, tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    assert lab.step(100.0, line % 100) is None
    assert lab.step(100.0 + AFTERMATH_S / 2) is None
    path = lab.step(100.0 + AFTERMATH_S, STOPPED % 102)
    assert (path is not None) == bool(reason)
    if path is not None:
        assert path.name == f"flight-0001-{reason}.mcap" and path.stat().st_mode & 0o777 == 0o600
        assert len(list(Recording(path).messages())) == 2


def test_a_link_that_fails_all_the_time_is_not_written_all_the_time(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    assert lab.flight.write("asked") is not None  # who asks for a file does not hide the next fault
    written = [lab.step(float(second), LINK % second) for second in range(100, 100 + round(2.5 * QUIET_S))]
    assert sum(path is not None for path in written) == 3


def test_only_so_many_files_are_kept_and_none_of_others(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    (tmp_path / "lesson1.mcap").touch()
    for _ in range(MOST_FILES + 5):
        lab.flight.write("asked")
    names = sorted(os.listdir(tmp_path))
    assert names[0] == "flight-0006-asked.mcap" and names[-1] == "lesson1.mcap" and len(names) == MOST_FILES + 1


def test_a_file_that_cannot_be_written_is_a_problem_in_words(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.refused = "the disk is away"
    assert lab.flight.write("asked") is None and lab.flight.problem == "the disk is away"


def test_who_waits_for_signs_of_life_gets_one_for_each_second_that_is_written(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    fill(lab.memory, 0, 60)
    assert lab.flight.write("asked") is not None
    steps = [after - before for before, after in zip([0, *lab.counts], lab.counts, strict=False)]
    assert sum(steps) == 600 and max(steps) <= 11


@pytest.mark.parametrize(
    ("bounds", "told"), [({"spare": 1 << 60}, "the disk is almost full"), ({"most": 100_000}, "which is the most")]
)
def test_the_bounds_of_a_recording_hold_for_the_last_minutes(bounds: dict[str, int], told: str, tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.bounds = bounds
    fill(lab.memory, 0, 60, size=5000)
    path = lab.flight.write("asked")
    assert told in lab.flight.problem and path is not None and path.stat().st_size < 200_000
    assert len(lab.counts) < 5  # the rest is not even unpacked
    assert not Recording(path).damage


def test_a_file_of_the_last_minutes_has_what_the_driver_found_at_the_start(tmp_path: Path) -> None:
    worker = RecordedWorker(kit_rig(), tmp_path / "a.sock")
    worker.run(1.0)
    worker.tell(m.Watch(6, ("present_position",)))
    worker.run(10.0)
    lab = Lab(tmp_path / "files")
    lab.folder.mkdir()
    lab.memory._seconds = 3.0
    for line in worker.lines:
        lab.step(lab.now + 11.0 / len(worker.lines), line)
    path = lab.flight.write("asked")
    assert path is not None
    sent = [message.data for message in Recording(path).messages((topics.WIRE_OUT,))]
    assert sent[1:3] == [bytes.fromhex("FFFF000201FC"), bytes.fromhex("FFFF010201FB")]
    samples = list(Recording(path).messages((topics.SAMPLES,)))
    assert 200 < len(samples) < 450
    worker.end()
