"""Shows the ranges of joints while they are moved by hand: bars on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final, TextIO

from urbihw.buses.servos.hand_calibration import CalibratedJoint
from urbihw.cli.rows import RowsInPlace

_WIDTH: Final = 40
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
            self._rows.show(self._stream, [bar(joint) for joint in joints])
        elif now >= self._next_line:
            self._next_line = now + _LINE_PERIOD_S
            self._print_changes(joints)

    def finish(self, joints: Sequence[CalibratedJoint], now: float) -> None:
        """Show the final state."""
        self._next_line = now
        self.show(joints, now)
        self._rows.leave()
        self._shown = []

    def _print_changes(self, joints: Sequence[CalibratedJoint]) -> None:
        lines = [f"{joint.name} {joint.low}..{joint.high}" for joint in joints if joint.is_measured]
        for line in lines:
            if line not in self._shown:
                print(line, file=self._stream, flush=True)
        self._shown = lines


def bar(joint: CalibratedJoint) -> str:
    """One joint as a line: its range so far, and where it is in it."""
    span = max(joint.high - joint.low, 1)
    place = round((joint.present - joint.low) / span * (_WIDTH - 1))
    cells = "".join("|" if column == place else "=" for column in range(_WIDTH))
    mark = "" if joint.is_measured else "  not moved yet"
    return f"{joint.name[:20]:20} {joint.low:6} [{cells}] {joint.high:6}  at {joint.present}{mark}"
