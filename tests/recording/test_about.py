"""What a file tells of the program that wrote it, also where that is not installed."""

from __future__ import annotations

import importlib.metadata

import pytest

from urbihw.cli import recordings, report
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
