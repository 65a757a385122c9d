"""Write one file for a bug report, without secrets: the last minutes of a robot, its health, the doctor's findings."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import platform
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import IO, Final

from urbihw.cli import control, doctor
from urbihw.cli.options import CliRefused, complain
from urbihw.cli.record import ask_recorder, control_socket
from urbihw.cli.recordings import RobotFeeds, begin_file, platform_for
from urbihw.exitcodes import EX_CONFIG, EX_OK
from urbihw.kernel.uobject import BadConfig
from urbihw.recording import topics
from urbihw.recording.reading import Recording, UnreadableRecording
from urbihw.recording.recorder import RobotRecorder
from urbihw.recording.recording_file import RecordingFile, RecordingRefused
from urbihw.recording.records import RecordMaker, TopicRecord
from urbihw.release import installed_version

RECORDED_S: Final = 5.0
"""Seconds that are recorded where there is no flight recorder."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw report``."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="the file (default: one here, with the time)")
    parser.add_argument("--no-clients", action="store_false", dest="clients",
                        help="leave out what clients send and get, the log and the settings")
    parser.add_argument("--platform", metavar="NAME", help="of the robot, where its socket does not tell")
    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot")


def run(options: argparse.Namespace) -> int:
    """Write the file; returns the exit code."""
    file = options.output or Path(f"urbihw-report-{datetime.now():%Y%m%d-%H%M%S}.zip")
    try:
        socket = control_socket(options.socket)
        robot = platform_for(socket, options.platform or "")
        with tempfile.TemporaryDirectory(prefix="urbihw-report-") as folder, _create(file) as opened:
            recording, note = _recording(socket, robot, Path(folder), options.clients)
            with zipfile.ZipFile(opened, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr("about.txt", about(robot, note))
                archive.writestr("doctor.txt", findings())
                archive.writestr("health.json", health(socket))
                archive.write(recording, "recording.mcap", zipfile.ZIP_STORED)
    except CliRefused as error:
        return complain("urbihw report", error)
    except (RecordingRefused, BadConfig) as error:
        return complain("urbihw report", CliRefused(str(error), EX_CONFIG))
    except OSError as error:
        return complain("urbihw report", CliRefused(f"{file}: {error.strerror or error}", EX_CONFIG))
    print(f"{file}: {note}; look at it before you send it: docs/recording.md tells what is in it")
    return EX_OK


def about(robot: str, note: str) -> str:
    """Versions of urbihw and of the system, as lines."""
    return (
        f"urbihw {installed_version()}, platform {robot}\n"
        f"Python {sys.version.split()[0]}\n"
        f"{platform.system()} {platform.release()} {platform.machine()}\n"
        f"recording.mcap: {note}\n"
    )


def findings() -> str:
    """The findings of ``urbihw doctor`` on this machine."""
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        doctor.run(argparse.Namespace(url="", mend=False, json=False))
    return told.getvalue()


def health(socket: Path) -> str:
    """What the bus worker tells of the robot and its devices."""
    (answer,) = control.ask([socket], "health", "")
    return json.dumps(dict(answer.state) if not answer.problem else {"problem": answer.problem}, indent=2)


def _recording(socket: Path, robot: str, folder: Path, clients: bool) -> tuple[Path, str]:
    """A file with the last minutes, or with some seconds from now on, and which of them.

    Raises CliRefused, BadConfig, RecordingRefused.
    """
    try:
        last = Path(ask_recorder(socket, "last"))
    except (CliRefused, RecordingRefused) as error:
        return _fresh_recording(socket, robot, folder, clients), f"{RECORDED_S:g} s ({error})"
    return last if clients else without_clients(last, folder), "the last minutes, of the flight recorder"


def without_clients(recording: Path, folder: Path) -> Path:
    """A copy without what the daemon told of clients, its log and its settings.  Raises CliRefused, RecordingRefused.
    """
    try:
        source = Recording(recording)
    except UnreadableRecording as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    copy = RecordingFile(folder / "last.mcap", source.head.begun_ns, source.head.about)
    for message in source.messages(topics.TOPICS.keys() - topics.OF_DAEMON):
        copy.add(TopicRecord(*message))
        copy.keep(message.time)
    return copy.close()


def _fresh_recording(socket: Path, robot: str, folder: Path, clients: bool) -> Path:
    """A file with some seconds from now on.  Raises CliRefused, BadConfig, RecordingRefused."""
    maker = RecordMaker()
    with closing(RobotFeeds(socket, clients)) as feeds:
        file = begin_file(folder / "now.mcap", robot)
        recorder = RobotRecorder(feeds.queue, maker, [file])
        end = time.monotonic() + RECORDED_S
        while time.monotonic() < end and not file.problem:
            recorder.step(time.monotonic)
        return file.close()


@contextlib.contextmanager
def _create(file: Path) -> Iterator[IO[bytes]]:
    """Make a file that only its owner can read; it is removed if it cannot be completed.  Raises OSError."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as opened:
            yield opened
    except BaseException:
        file.unlink(missing_ok=True)
        raise
