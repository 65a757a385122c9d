"""Writes the last minutes into a file: on request, and by itself when something has gone wrong.

It waits some seconds, so that the file also has what came of it; then it writes nothing for a while by itself, since
what has failed often fails again. The oldest of its files are removed. A file is written second by second, so that
neither memory nor the time between two signs of life grows with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from urbihw.recording.flight import FlightMemory
from urbihw.recording.recording_file import FLUSH_S, PART, SUFFIX, RecordingFile, RecordingRefused
from urbihw.recording.records import RecordMaker, TopicRecord

PREFIX: Final = "flight-"
"""What the names of the files begin with."""
AFTERMATH_S: Final = 3.0
"""Seconds from an event to the writing."""
QUIET_S: Final = 60.0
"""Seconds after a file of a fault until another fault may have one."""
MOST_FILES: Final = 20
"""Files of a flight recorder in its folder."""


class FlightRecorder:
    """The last minutes of one robot; ``begin`` makes a file, whose reason it gets.

    ``alive`` is called after each second that is written, to give a sign of life.

    Attributes:
        memory: what is kept.
        problem: why the last file could not be written; "" if it could.
    """

    def __init__(
        self,
        memory: FlightMemory,
        maker: RecordMaker,
        folder: Path,
        begin: Callable[[str], RecordingFile],
        alive: Callable[[], object],
    ) -> None:
        self.memory = memory
        self.problem = ""
        self._maker = maker
        self._folder = folder
        self._begin = begin
        self._alive = alive
        self._reason = ""
        self._due = float("inf")
        self._quiet_until = 0.0

    def hear(self, word: str, now: float) -> None:
        """Hear what happened: `words_of` of a record. A stop is nothing to be kept; what goes wrong is."""
        if word != "stop" and not self._reason and now >= self._quiet_until:
            self._reason, self._due = word, now + AFTERMATH_S

    def write_due(self, now: float) -> Path | None:
        """Write the file that is due; return its name, None for none."""
        if now < self._due:
            return None
        self._quiet_until = now + QUIET_S
        return self.write(self._reason)

    @property
    def pending(self) -> str:
        """The reason for which a file is going to be written, "" for none."""
        return self._reason

    def write(self, reason: str) -> Path | None:
        """Write the last minutes into a file; return its name, None if that fails (see ``problem``)."""
        self._reason, self._due = "", float("inf")
        try:
            file = self._begin(reason)
        except RecordingRefused as error:
            self.problem = str(error)
            return None
        for number, records in enumerate(self._steps(), 1):
            for record in records:
                file.add(record)
            # Each step counts as a second of the file, however fast it is written: so its bounds are looked at.
            file.keep(number * FLUSH_S)
            self._alive()
            if file.problem:
                break
        self.problem, path = file.problem, file.close()
        self._remove_oldest()
        return path

    def _steps(self) -> Iterator[list[TopicRecord]]:
        """Yield the records of the beginning that are no longer kept, then each second that is."""
        first = next((records[0].time for records in self.memory.seconds() if records), float("inf"))
        yield [each for each in self._maker.beginning if each.time < first]
        yield from self.memory.seconds()

    def _remove_oldest(self) -> None:
        files = [path for end in (SUFFIX, SUFFIX + PART) for path in self._folder.glob(f"{PREFIX}*{end}")]
        for path in sorted(files, key=lambda path: path.name)[:-MOST_FILES]:
            path.unlink(missing_ok=True)
