"""Collects ``*.chk``: a test for each unit, named by its line and title."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .transcript import Outcome, Player, Unit, read


class UnitFailed(Exception):
    """A unit did not answer what its transcript says."""


class TranscriptFile(pytest.File):
    """A transcript.  It is played once, as a whole, when its first unit is asked for."""

    _outcomes: dict[Unit, Outcome] | None = None
    _skipped = ""

    def collect(self) -> Iterator[pytest.Item]:
        """A test for each unit that does something."""
        for unit in read(self.path).units:
            if unit.typed.strip() and not all(row.startswith("//") or not row for row in unit.typed.split("\n")):
                yield UnitItem.from_parent(self, name=f"{unit.line}: {unit.title}", unit=unit)

    def outcome(self, unit: Unit) -> Outcome:
        """What a unit answered; skips where the file is not to be run."""
        if self._outcomes is None:
            transcript, player = read(self.path), Player()
            self._skipped = player.reason_to_skip(transcript)
            outcomes = [] if self._skipped else player.play(transcript)
            self._outcomes = {outcome.unit: outcome for outcome in outcomes}
        if self._skipped:
            pytest.skip(self._skipped)
        return self._outcomes[unit]


class UnitItem(pytest.Item):
    """One unit of a transcript."""

    def __init__(self, *, name: str, parent: TranscriptFile, unit: Unit) -> None:
        super().__init__(name, parent)
        self.unit = unit
        self.file = parent

    def runtest(self) -> None:
        """Compare what was answered with what is written."""
        outcome = self.file.outcome(self.unit)
        if outcome.problem:
            raise UnitFailed(outcome.problem)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        """The unit as it stands in the file and the difference."""
        if isinstance(excinfo.value, UnitFailed):
            return f"{self.unit.text.rstrip()}\n\n{excinfo.value}"
        return str(super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where the unit stands."""
        return self.path, self.unit.line - 1, self.name


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> TranscriptFile | None:
    """Take every transcript but those that must fail (test_lang.py plays them)."""
    if file_path.suffix == ".chk" and file_path.parent.name != "meta":
        return TranscriptFile.from_parent(parent, path=file_path)
    return None
