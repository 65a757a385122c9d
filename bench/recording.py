"""What a recording costs: `python -m bench.recording [--seconds 60]`.

A worker with 20 simulated X servos (60 values at 100 Hz, grouped reads, one target a tick) runs in simulated time: only
processor time is measured, without a recorder and with one on its control socket. The recorder's own work is then
measured on the lines that it got, and so is a plain MCAP file of the same values, as a robot's program would write it.
"""

from __future__ import annotations

import argparse
import math
import socket
import tempfile
import time
from collections.abc import Sequence
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

from bench.quick import add_quick
from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.pipe import PipeEnd
from urbihw.recording import topics
from urbihw.recording.flight import FlightMemory
from urbihw.recording.reading import Recording
from urbihw.recording.recorder import RecordSink
from urbihw.recording.recording_file import RecordingFile
from urbihw.recording.records import RecordMaker, TopicRecord
from urbihw_fakes.bioloid import Bioloid

BAUD = 1_000_000
ITEMS = ("present_position", "present_velocity", "present_load")
RATE = 100.0


class SimulatedWorker:
    """A worker on a simulated wire, stepped as fast as possible."""

    def __init__(self, folder: Path, recorded: bool) -> None:
        kit = Bioloid.x_series(20, baud=BAUD)
        kit.pace(BAUD)
        self.clock = BusSimClock(100.0)
        end = PipeEnd()

        def receive(data: bytes, at: float) -> None:
            for answer in kit.feed(data, at):
                end.send(answer.data, answer.at)

        end.on_receive = receive
        self.pipe, theirs = Pipe()
        path = folder / "robot.sock"
        begin = m.Begin(m.Configure(rate=RATE, dead_man=0), control=str(path))
        context = Context(self.clock, {"robot": end})
        self.engine = Engine(f"pipe://robot?baud={BAUD}", driver_of("servos"), Mailbox(theirs), begin, context)
        self.lines: list[bytes] = []
        self._socket: socket.socket | None = None
        self._rest = b""
        if recorded:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self._socket.connect(str(path))
            self._socket.sendall(b'{"do":"record"}\n{"do":"values","hz":10}\n')
            self._socket.setblocking(False)

    def run(self, seconds: float, moving: bool = False) -> float:
        """Let time pass; returns the processor time of the worker and its wire, in s."""
        spent, end = 0.0, self.clock.now() + seconds
        while self.clock.now() < end:
            if moving:
                goal = 2048 + round(500 * math.sin(self.clock.now()))
                self.pipe.send(m.Targets({(1, "goal_position"): goal}))
            begun = time.process_time()
            self.engine.step()
            spent += time.process_time() - begun
            while self.pipe.poll():
                self.pipe.recv()
            self._read()
        return spent

    def _read(self) -> None:
        if self._socket is None:
            return
        try:
            self._rest += self._socket.recv(1 << 20)
        except BlockingIOError:
            return
        *lines, self._rest = self._rest.split(b"\n")
        self.lines += lines


def measure_worker(seconds: float, recorded: bool) -> tuple[float, list[bytes]]:
    """Share of a core, and the lines that a recorder got."""
    with tempfile.TemporaryDirectory() as folder:
        worker = SimulatedWorker(Path(folder), recorded)
        worker.run(1.0)
        worker.pipe.send(m.Watch(1, ITEMS))
        for number in range(1, 21):
            worker.pipe.send(m.Watch(number, ITEMS))
        worker.run(1.0)
        worker.lines.clear()
        return worker.run(seconds, moving=True) / seconds, worker.lines


def measure_sink(lines: Sequence[bytes], sink: RecordSink) -> tuple[float, int]:
    """Processor time of a recorder for these lines, and the records."""
    maker, count, now = RecordMaker(), 0, 0.0
    begun = time.process_time()
    for line in lines:
        for record in maker.records(line):
            sink.add(record)
            count, now = count + 1, record.time
        sink.keep(now)
    return time.process_time() - begun, count


def plain(lines: Sequence[bytes], file: RecordingFile) -> float:
    """Processor time for a file of the values alone."""
    samples: list[TopicRecord] = [
        record for line in lines for record in RecordMaker().records(line) if record.topic == topics.SAMPLES
    ]
    begun = time.process_time()
    for record in samples:
        file.add(record)
        file.keep(record.time)
    file.close()
    return time.process_time() - begun


def row(what: str, share: float, size: float | None = None) -> None:
    """Print a row: share of a core, bytes in a minute."""
    print(f"{what:44} {100 * share:6.2f} %" + ("" if size is None else f"   {size / 1e6:6.2f} MB/min"))


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    add_quick(parser)
    options: Any = parser.parse_args()
    seconds = 2.0 if options.quick else options.seconds
    without, _ = measure_worker(seconds, False)
    with_one, lines = measure_worker(seconds, True)
    row("worker and simulated wire, not recorded", without)
    row("the same, recorded: this much more", with_one - without)
    with tempfile.TemporaryDirectory() as folder:
        file = RecordingFile(Path(folder) / "a.mcap", 0, {})
        spent, count = measure_sink(lines, file)
        begun = time.process_time()
        file.close()
        row("recorder with a file", (spent + time.process_time() - begun) / seconds, file.size * 60 / seconds)
        values = RecordingFile(Path(folder) / "b.mcap", 0, {})
        spent = plain(lines, values)
        row("a plain MCAP file of the same values", spent / seconds, values.size * 60 / seconds)
        memory = FlightMemory(300.0)
        spent, _ = measure_sink(lines, memory)
        row("flight recorder", spent / seconds, memory.size * 60 / seconds)
        received = sum(map(len, lines)) * 60 / seconds
        print(f"{count / seconds:.0f} records/s, {received / 1e6:.2f} MB/min from the worker")
        begun = time.process_time()
        read = sum(1 for _ in Recording(file.path).messages())
        print(f"{read} records read in {time.process_time() - begun:.2f} s")


if __name__ == "__main__":
    main()
