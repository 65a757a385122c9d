"""Lines that clients write into the log of the server."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock


def test_a_note_is_in_the_log_behind_the_name_of_its_connection(caplog: pytest.LogCaptureFixture) -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby("10.0.0.9")
    with caplog.at_level("INFO", "urbihw.server"):
        lobby.feed(b'lobby.introduce("anna"); lobby.note("moves the arm"); Lobby.note("nobody");')
        lobby.feed(b'lobby.note("two\\nlines"); lobby.note("x" * 201);')
        kernel.run()
    assert [record.message for record in caplog.records] == ["anna (10.0.0.9): moves the arm"]
    assert lobby.output.take_bytes().count(b"!!! ") == 3


def test_a_client_cannot_flood_the_log(caplog: pytest.LogCaptureFixture) -> None:
    clock = SimClock()
    kernel = Kernel(clock)
    lobby = kernel.open_lobby()
    with caplog.at_level("INFO", "urbihw.server"):
        for _ in range(3):
            lobby.feed(b'for (var i : 40) lobby.note("again");' + b'lobby.note("again");' * 40)
            kernel.run()
        assert len(caplog.records) == 10
        clock.idle(clock.now() + 1)
        lobby.feed(b'lobby.note("later");' * 40)
        kernel.run()
    assert [record.message[-5:] for record in caplog.records[10:]] == ["later"] * 5
