"""Shows the ranges of joints while they are moved by hand: bars on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from typing import Final, TextIO

from urbihw.buses.servos.hand_calibration import CalibratedJoint
from urbihw.cli.rows import RowsInPlace

_WIDTH: Final = 40
"""Characters of a bar where there is room."""
_LEAST_WIDTH: Final = 5
_LONGEST_NAME: Final = 20
_NOT_MOVED: Final = "not moved yet"
_SILENT: Final = "no answer"
_LINE_PERIOD_S: Final = 1.0


class RangeDisplay:
    """The display of the ranges."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stdout if stream is None else stream
        self._rows = RowsInPlace()
        self._next_line = 0.0
        self._shown: list[str] = []

    def show(self, joints: Sequence[CalibratedJoint], now: float) -> None:
        """Show the joints; `now` in seconds bounds the number of lines that a pipe gets."""
        if self._stream.isatty():
            self._rows.show(self._stream, bars(joints, shutil.get_terminal_size().columns))
        elif now >= self._next_line:
            self._next_line = now + _LINE_PERIOD_S
            self._print_changes(joints)

    def finish(self, joints: Sequence[CalibratedJoint], now: float) -> None:
        """Show the final state, after Enter."""
        self._next_line = now
        self._rows.skip_line()
        self.show(joints, now)
        self._rows.leave()
        self._shown = []

    def _print_changes(self, joints: Sequence[CalibratedJoint]) -> None:
        lines = [f"{joint.name} {joint.low}..{joint.high}" for joint in joints if joint.is_measured]
        for line in lines:
            if line not in self._shown:
                print(line, file=self._stream, flush=True)
        self._shown = lines


def bars(joints: Sequence[CalibratedJoint], columns: int) -> list[str]:
    """The joints as lines of a terminal: the range of each so far, and where it is in it.

    The bars shrink before any number is cut.
    """
    longest = max((len(joint.name) for joint in joints), default=0)
    name = min(longest, _LONGEST_NAME)
    frame = name + len(" -12345 [] -12345 at -12345 ") + len(_NOT_MOVED) + 1  # the last column stays free
    width = max(_LEAST_WIDTH, min(_WIDTH, columns - frame))
    return [_bar(joint, name, width) for joint in joints]


def _bar(joint: CalibratedJoint, name: int, width: int) -> str:
    span = max(joint.high - joint.low, 1)
    place = round((joint.present - joint.low) / span * (width - 1))
    cells = "".join("|" if column == place else "=" for column in range(width))
    mark = _SILENT if joint.is_silent else "" if joint.is_measured else _NOT_MOVED
    return f"{joint.name[:name]:{name}} {joint.low:6} [{cells}] {joint.high:6} at {joint.present:6} {mark}".rstrip()
