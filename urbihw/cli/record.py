"""Record a robot that is served: one MCAP file with its wire, values, targets and events.

The recorder is a process of its own that reads the bus worker, which waits for nothing.  ``stop`` ends a recording that
runs elsewhere, ``last`` has the flight recorder of the daemon write the last minutes.
"""

from __future__ import annotations

import argparse
import math
import re
import signal
import sys
import time
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused, complain, number
from urbihw.cli.recordings import FILE_DOOR, FLIGHT_DOOR, RobotFeeds, begin_file, open_door, platform_for
from urbihw.cli.tracing import open_traffic, traffic_of
from urbihw.daemon.state import recordings_folder
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.kernel.uobject import BadConfig
from urbihw.recording.door import ask
from urbihw.recording.recorder import RobotRecorder
from urbihw.recording.recording_file import SUFFIX, RecordingRefused
from urbihw.recording.records import RecordMaker

WORDS: Final = ("stop", "estop", "lost")
"""What a recording may be ended by, besides a time."""
SIGNAL: Final = "signal"
"""What a recording hears when the process is to end."""
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_TIME: Final = re.compile(r"(\d{1,6}(?:\.\d{1,3})?)(s|min|h)")
_SECONDS: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}
_DOORS: Final = {"stop": FILE_DOOR, "last": FLIGHT_DOOR}
"""What a recorder is asked -> the end of the name of its socket."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw record``."""
    parser.add_argument("what", nargs="?", choices=("stop", "last"),
                        help="end the recording that runs; write the last minutes of the flight recorder")
    parser.add_argument("--name", type=_name, help="name of the recording (default: platform and time)")
    parser.add_argument("--until", type=_until, metavar="WHEN",
                        help="end after a time (90s, 10min, 1h), or at a stop, an estop, or when the link is lost")
    parser.add_argument("--folder", type=Path, metavar="PATH", help="where to (default: one in the state folder)")
    parser.add_argument("--no-clients", action="store_false", dest="clients",
                        help="leave out what clients send and get, the log and the settings")
    parser.add_argument("--platform", metavar="NAME", help="of the robot, where its socket does not tell")
    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot")
    parser.add_argument("--flight", type=number(1, 3600, "time in seconds"), metavar="S",
                        help="keep the last S seconds in memory, for a daemon at the other end of standard input")


def run(options: argparse.Namespace) -> int:
    """Record until Ctrl-C, ``stop`` or ``--until``; returns the exit code."""
    try:
        control = control_socket(options.socket)
        if options.flight:
            from urbihw.cli.flight import serve_flight  # only this needs the memory of the last minutes

            return serve_flight(control, options.platform, options.folder, options.flight)
        if options.what:
            print(ask_recorder(control, options.what))
            return EX_OK
        return _record(control, options)
    except CliRefused as error:
        return complain("urbihw record", error)
    except (RecordingRefused, BadConfig) as error:
        return complain("urbihw record", CliRefused(str(error), EX_CONFIG))


def control_socket(given: Path | None) -> Path:
    """The control socket of the robot that is meant.  Raises CliRefused."""
    traffic = open_traffic(given) if given is not None else traffic_of("")
    if traffic is None:
        raise CliRefused("no daemon answers; start one (urbihw serve)", EX_UNAVAILABLE)
    with traffic:
        return traffic.path


def ask_recorder(control: Path, what: str) -> str:
    """Ask the recorder of a robot; returns what it tells.  Raises CliRefused, RecordingRefused."""
    try:
        return ask(control.with_suffix(_DOORS[what]), what)
    except (OSError, ValueError) as error:
        none = "no recording runs" if what == "stop" else "there is no flight recorder; the setting flight makes one"
        raise CliRefused(f"{control.stem}: {none}", EX_UNAVAILABLE) from error


def _record(control: Path, options: argparse.Namespace) -> int:
    platform = platform_for(control, options.platform or "")
    maker = RecordMaker()
    folder = options.folder if options.folder is not None else recordings_folder() / platform
    name = options.name or f"{platform}-{datetime.now():%Y%m%d-%H%M%S}"
    with closing(RobotFeeds(control, options.clients)) as feeds:
        ending = RecordingEnd(options.until)
        with closing(open_door(control, FILE_DOOR, lambda verb: ending.asked(verb, file.path))) as door:
            file = begin_file(folder / f"{name}{SUFFIX}", platform)
            print(f"urbihw record: {file.path}; Ctrl-C ends it", file=sys.stderr)
            recorder = RobotRecorder(feeds.queue, maker, [file])
            recorder.heard = ending.hear
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda *_: ending.hear(SIGNAL))
            while not file.problem and not ending.is_due(time.monotonic()):
                recorder.step(time.monotonic)
                door.poll()
            recorder.step(time.monotonic, 0.0)
            problem, path = file.problem, file.close()
    if problem:
        print(f"urbihw record: {problem}", file=sys.stderr)
    print(f"{path}: {file.count} records, {file.size / 1e6:.1f} MB")
    return EX_OK if not problem else EX_UNAVAILABLE


class RecordingEnd:
    """When a recording ends: on request, after some seconds, or when a word of WORDS is heard."""

    def __init__(self, until: float | str | None) -> None:
        self._word = until if isinstance(until, str) else ""
        self._at = time.monotonic() + until if isinstance(until, float) else math.inf
        self._heard = False

    def is_due(self, now: float) -> bool:
        """Whether the recording ends now."""
        return self._heard or now >= self._at

    def hear(self, word: str) -> None:
        """Take note of a word of WORDS, or of SIGNAL."""
        self._heard = self._heard or word in (self._word, SIGNAL)

    def asked(self, verb: str, path: Path) -> str:
        """Answer ``urbihw record stop`` with the place of the file."""
        if verb == "stop":
            self._heard = True
        return str(path)


def _name(text: str) -> str:
    if not _NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} is no name: letters, digits, - _ and . (64 at most)")
    return text


def _until(text: str) -> float | str:
    """A time in seconds, or a word."""
    if text in WORDS:
        return text
    found = _TIME.fullmatch(text)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r}: say 90s, 10min, 1h, {' or '.join(WORDS)}")
    return float(found[1]) * _SECONDS[found[2]]
