"""A worker in simulated time, recorded into a file; and the same worker on the wire of that file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from buses.conftest import BAUD, Rig
from buses.test_control import ControlBench

from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.recording.reading import Recording
from urbihw.recording.recording_file import RecordingFile
from urbihw.recording.records import RecordMaker
from urbihw.recording.wire import capture_lines
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.replay import Replay, read_capture

UTC_NS = 1_700_000_000_000_000_000
Said = dict[str, Any]


class RecordedWorker(ControlBench):
    """An engine with a client that records from its first step.

    Attributes:
        lines: what the client got.
    """

    def __init__(self, rig: Rig | ReplayRig, path: Path) -> None:
        super().__init__(rig, path)  # type: ignore[arg-type]
        self.lines: list[bytes] = []
        caller = self.call()
        caller.say("record")
        self._caller = caller

    def end(self) -> None:
        """End the engine."""
        if not self.asked_to_end:
            self._caller.hear()
        super().end()

    def run(self, seconds: float) -> Any:
        """Let time pass; the recorder reads after each step."""
        # Ticks of a replay are some microseconds beside those recorded: a step more or less must not hang on them.
        end = self.rig.clock.now() + seconds - 0.001
        heard = []
        while self.rig.clock.now() < end:
            self.rig.step()  # type: ignore[attr-defined]
            assert self.engine.step()
            heard += self.heard()
            self.lines += [json.dumps(said).encode() for said in self._caller.hear()]
        return heard

    def said(self, *kinds: str) -> list[Said]:
        """The events of some kinds."""
        return [event for event in map(json.loads, self.lines) if event.get("event") in kinds]


class KitRig(Rig):
    """A simulated kit, whose adapter a test may pull."""

    def step(self) -> None:
        """Nothing happens by itself here."""


class ReplayRig:
    """A recorded wire."""

    def __init__(self, capture: Iterable[str], *, strict: bool = True) -> None:
        self.device = Replay(read_capture(capture), strict=strict)
        self.clock = BusSimClock(100.0)
        self.end = PipeEnd(self._receive)
        self.device.plug = lambda is_plugged: self.end.replug() if is_plugged else self.end.unplug()
        self.context = Context(self.clock, {"robot": self.end})
        self.url = f"pipe://robot?baud={BAUD}"
        self.link = self

    def step(self) -> None:
        """Let the adapter go and come when it did."""
        self.device.tick(self.clock.now())

    def close(self) -> None:
        """There is no link of its own."""

    def _receive(self, data: bytes, at: float) -> None:
        # Recorded delays begin when the host wrote, and contain the time on the wire.
        for answer in self.device.feed(data, self.clock.now()):
            self.end.send(answer.data, answer.at)


def kit_rig() -> KitRig:
    """18 AX-12 and an AX-S1 at 1 Mbps."""
    return KitRig(Bioloid(baud=BAUD))


def write(path: Path, lines: Iterable[bytes], platform: str = "bioloid", **more: Any) -> RecordingFile:
    """Write the lines of a worker into a file, and complete it."""
    maker = RecordMaker()
    file = RecordingFile(path, UTC_NS, {"platform": platform}, **more)
    for line in lines:
        for record in maker.records(line):
            file.add(record)
    file.close()
    return file


def capture_of(path: Path) -> list[str]:
    """The wire of a file as a capture."""
    return list(capture_lines(Recording(path)))
