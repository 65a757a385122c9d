"""What the commands that record have in common: the feed of a robot, what is kept of it, and the file."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused
from urbihw.cli.tracing import platform_of
from urbihw.control_line import ANSWER_TIMEOUT_S, ControlLine
from urbihw.daemon.record_feed import SUFFIX as DAEMON_FEED
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.platforms import folders
from urbihw.recording.door import DoorTaken, RecorderDoor
from urbihw.recording.feed import MOST_LINE_BYTES, DaemonFeed, LineQueue, SocketFeed, WorkerFeed
from urbihw.recording.reading import NO_SENSE
from urbihw.recording.recording_file import RecordingFile, RecordingRefused
from urbihw.release import installed_version

FILE_DOOR: Final = ".recording"
"""End of the name of the socket of who records into a file."""
FLIGHT_DOOR: Final = ".flight"
"""The same of the flight recorder."""


def begin_file(path: Path, platform: str) -> RecordingFile:
    """Begin a file, and its folder if there is none.  Raises RecordingRefused."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingRefused(f"{path.parent}: {error.strerror}") from error
    return RecordingFile(path, time.time_ns() - time.monotonic_ns(), about(platform))


def about(platform: str) -> Mapping[str, str]:
    """What a file tells of itself; never a secret."""
    return {
        "platform": platform,
        "version": installed_version(),
        "python": sys.version.split()[0],
        "monotonic0": f"{time.monotonic():.6f}",
        "realtime0": f"{time.time():.6f}",
    }


def platform_for(control: Path, given: str) -> str:
    """The platform of the robot behind a control socket.  Raises CliRefused if that is not known."""
    platform = given or platform_of(control) or _told_platform(control)
    if not platform:
        raise CliRefused(f"which robot is behind {control}? Give --platform", EX_CONFIG)
    return platform


def _told_platform(control: Path) -> str:
    """The platform by the settings of the daemon of a control socket; "" if it tells none."""
    with contextlib.suppress(OSError, *NO_SENSE):
        with contextlib.closing(ControlLine(control.with_suffix(DAEMON_FEED), MOST_LINE_BYTES)) as line:
            platform = json.loads(line.next_line(time.monotonic() + ANSWER_TIMEOUT_S))["settings"]["platform"]
        return platform if isinstance(platform, str) and any(each.name == platform for each in folders()) else ""
    return ""


class RobotFeeds:
    """What worker and daemon tell of a robot, in one queue."""

    def __init__(self, control: Path, clients: bool = True) -> None:
        """``clients``: also what the daemon tells, if there is one.  Raises CliRefused."""
        self.queue = LineQueue()
        self._feeds: list[SocketFeed] = []
        try:
            self._feeds.append(WorkerFeed(control, self.queue))
        except (OSError, ValueError) as error:
            raise CliRefused(f"{control}: {error}", EX_UNAVAILABLE) from error
        with contextlib.suppress(OSError, ValueError):
            if clients:
                self._feeds.append(DaemonFeed(control.with_suffix(DAEMON_FEED), self.queue))

    def close(self) -> None:
        """End the connections to worker and daemon."""
        for feed in self._feeds:
            feed.close()


def open_door(control: Path, door: str, answer: Callable[[str], str]) -> RecorderDoor:
    """The socket at which a recorder of a robot is asked.  Raises CliRefused if there is one already."""
    try:
        return RecorderDoor(control.with_suffix(door), answer)
    except DoorTaken as error:
        raise CliRefused(f"{control.stem}: it is recorded already; urbihw record stop ends that") from error
    except OSError as error:
        raise CliRefused(f"{control.parent}: {error.strerror}", EX_CONFIG) from error
