"""The trace of the orders to the joints (manual, "Motor command debugging"): a file of bounded size."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Sequence
from typing import Final, TextIO

from urbihw.buses.errors import BadValue

MOST_BYTES: Final = 20_000_000
"""Then the trace ends: 25 joints at 50 Hz take ten minutes for that."""


class MotorTrace:
    """Lines of motor number, seconds since the trace began, and position (rad).

    The number of a motor is its place in the list of the robot's joints, from 0.

    Attributes:
        full: the path of the file that has reached its size, until somebody asks.
    """

    def __init__(self) -> None:
        self.full = ""
        self._file: TextIO | None = None
        self._path = ""
        self._room = 0
        self._begun: float | None = None
        self._numbers: dict[str, int] = {}

    def number_motors(self, joints: Sequence[str]) -> None:
        """The joints of the robot, in its order."""
        self._numbers = {name: number for number, name in enumerate(joints)}

    def open(self, path: str) -> None:
        """Begin a trace in a file of its own, unless it is the one that is written; an older one is kept as ``.1``.

        Raises BadValue.
        """
        if self._file is not None and path == self._path:
            return
        self.close()
        try:
            with contextlib.suppress(FileNotFoundError):
                os.replace(path, path + ".1")
            # Never through a link that somebody else has put there.
            number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise BadValue(f"the trace {path} cannot be written: {error.strerror}") from error
        self._file = os.fdopen(number, "w", encoding="ascii")
        self._path, self._room, self._begun = path, MOST_BYTES, None

    def close(self) -> None:
        """End the trace and close its file."""
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                file.close()

    def write(self, time: float, commands: Iterable[tuple[str, float]]) -> None:
        """Joints get these positions at a time of the worker's clock."""
        if self._file is None:
            return
        if self._begun is None:
            self._begun = time
        stamp = time - self._begun
        lines = "".join(f"{self._numbers[name]} {stamp:.3f} {place:.5f}\n" for name, place in commands)
        self._room -= len(lines)
        try:
            if self._room < 0:
                raise OSError
            self._file.write(lines)
            self._file.flush()
        except OSError:
            self.full = self._path
            self.close()
