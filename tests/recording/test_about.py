"""What a report tells of the program, also where that is not installed, and what it leaves out."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest
from recording_lab import write

from urbihw.cli import recordings, report
from urbihw.recording import topics
from urbihw.recording.reading import Recording
from urbihw.release import installed_version


@pytest.fixture(autouse=True)
def not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """No package is installed; ``urbihw`` is found on the path."""

    def missing(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata.Distribution, "from_name", missing)


def test_files_tell_the_version_of_urbihw() -> None:
    assert recordings.about("bioloid")["version"] == installed_version()
    assert report.about("bioloid", "a note").splitlines()[0] == f"urbihw {installed_version()}, platform bioloid"


def test_a_report_without_clients_has_nothing_that_they_typed(tmp_path: Path) -> None:
    last = write(tmp_path / "flight.mcap", [
        b'{"event":"Settings","settings":{"host":"hush"},"at":1}',
        b'{"event":"Log","date":1.5,"level":"info","text":"hush","fields":{},"at":2}',
        b'{"event":"Typed","client":"alice","text":"hush","size":4,"at":3}',
        b'{"event":"Answered","client":"alice","text":"hush","size":4,"at":4}',
        b'{"event":"Traffic","chunks":[[5.0,">","ffff0102"]],"lost":0}',
        b'{"event":"Stopped","reason":"a stop","epoch":1,"devices":null,"at":6}',
    ]).path  # fmt: skip
    (tmp_path / "report").mkdir()
    before = {message.topic: message for message in Recording(last).messages()}
    after = Recording(report.without_clients(last, tmp_path / "report"))
    told = list(after.messages())
    assert [message.topic for message in told] == [topics.WIRE_OUT, topics.EVENTS]
    assert [message.data for message in told] == [before[message.topic].data for message in told]
    assert told[1].time - told[0].time == pytest.approx(1.0)
    assert after.head.about == {"platform": "bioloid"} and last.exists()
