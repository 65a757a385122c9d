"""The process of a flight recorder, which a daemon starts: ``urbihw record --flight SECONDS``."""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Final

from urbihw.cli.recordings import FLIGHT_DOOR, RobotFeeds, begin_file, open_door
from urbihw.daemon.flight import FAREWELL
from urbihw.exitcodes import EX_OK
from urbihw.recording.flight import FlightMemory
from urbihw.recording.flight_recorder import PREFIX, FlightRecorder
from urbihw.recording.recorder import RobotRecorder
from urbihw.recording.recording_file import SUFFIX, RecordingFile, RecordingRefused
from urbihw.recording.records import RecordMaker

BEAT_S: Final = 1.0
"""Seconds between two signs of life."""
CRASH: Final = "crash"
"""The reason of a file that is written because the daemon has died."""


class DaemonLine:
    """The socket to the daemon: signs of life out, its farewell or its end in."""

    def __init__(self, descriptor: int) -> None:
        self._socket = socket.socket(fileno=os.dup(descriptor))
        self._socket.setblocking(False)
        self._beat_at = 0.0
        self._heard = b""

    def has_ended(self, now: float) -> bool:
        """Give a sign of life if it is time; return whether the daemon has ended."""
        try:
            if now >= self._beat_at:
                self._beat_at = now + BEAT_S
                self._socket.send(b".")
            data = self._socket.recv(64)
        except BlockingIOError:
            return False
        except OSError:
            return True
        self._heard += data
        return not data

    @property
    def in_order(self) -> bool:
        """Whether the daemon has said farewell."""
        return FAREWELL in self._heard


def serve_flight(control: Path, platform: str, folder: Path, seconds: float) -> int:
    """Keep the last minutes until the daemon ends; returns the exit code.

    Raises CliRefused, BadConfig, RecordingRefused.
    """
    line = DaemonLine(sys.stdin.fileno())
    # Ctrl-C is for the daemon, which ends its children.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    maker = RecordMaker()

    def begin(reason: str) -> RecordingFile:
        name = f"{PREFIX}{datetime.now():%Y%m%d-%H%M%S-%f}-{reason}{SUFFIX}"
        return begin_file(folder / name, platform)

    memory = FlightMemory(seconds)
    flight = FlightRecorder(memory, maker, folder, begin, lambda: line.has_ended(time.monotonic()))
    with closing(RobotFeeds(control)) as feeds:
        recorder = RobotRecorder(feeds.queue, maker, [memory])
        recorder.heard = lambda word: flight.hear(word, time.monotonic())
        with closing(open_door(control, FLIGHT_DOOR, lambda verb: _answered(flight, verb))) as door:
            while not line.has_ended(time.monotonic()):
                recorder.step(time.monotonic)
                door.poll()
                _tell(flight, flight.write_due(time.monotonic()))
        recorder.step(time.monotonic, 0.0)
        if not line.in_order:
            _tell(flight, flight.write(CRASH))
        elif flight.pending not in ("", "gone"):
            _tell(flight, flight.write(flight.pending))
    return EX_OK


def _answered(flight: FlightRecorder, verb: str) -> str:
    if verb != "last":
        return ""
    path = flight.write("asked")
    if path is None:
        raise RecordingRefused(flight.problem)
    return str(path)


def _tell(flight: FlightRecorder, path: Path | None) -> None:
    """Tell the log of the daemon, whose standard error this is."""
    if path is not None:
        print(f"urbihw: the last minutes are in {path}", file=sys.stderr, flush=True)
    if flight.problem:
        print(f"urbihw: flight recorder: {flight.problem}", file=sys.stderr, flush=True)
        flight.problem = ""
