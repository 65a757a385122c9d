"""The message of a tool for a port that another process has open."""

from __future__ import annotations

import os
import pty
from collections.abc import Iterator

import pytest

from urbihw import buses
from urbihw.buses.errors import Unavailable
from urbihw.cli import ports_in_use


@pytest.fixture
def terminal() -> Iterator[str]:
    ours, theirs = pty.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("prefix", ["", "serial://", "spy://", "spy://serial://"])
def test_the_daemon_that_has_the_port_is_named(terminal: str, prefix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports_in_use, "daemon_of_file", lambda path: 42 if path == terminal else 0)
    with buses.open(terminal), pytest.raises(Unavailable) as refused:
        ports_in_use.open_line(f"{prefix}{terminal}?baud=57600", 57600)
    assert str(refused.value) == f"{terminal} is in use by an urbihw daemon (process 42): stop that first"
