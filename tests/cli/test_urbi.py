"""The command ``urbi``, in this process."""

from __future__ import annotations

import pytest

from urbihw.cli import urbi


def test_program_name_is_the_path_under_which_it_was_called(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["/opt/urbihw/bin/urbi"])
    assert urbi.main(["-q", "-e", "echo(System.programName); echo(System.arguments); shutdown;"]) == 0
    said = [line.partition("] ")[2] for line in capfd.readouterr().out.splitlines()]
    assert said == ["*** /opt/urbihw/bin/urbi", "*** []"]
