"""How much is shown of a value at the top level, and what becomes of a connection whose end fails in part."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.lobby.printing import MAX_SHOWN_LENGTH


def said(kernel: Kernel, lobby: Lobby, text: str) -> list[str]:
    """The lines that answer, without time stamps."""
    lobby.output.take_bytes()
    return [line[:1] + line[9:] if line.startswith("[") else line for line in kernel.run_text(lobby, text).splitlines()]


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(fast=True)


def test_of_a_value_that_is_too_long_the_beginning_is_shown(kernel: Kernel) -> None:
    shown, told = said(kernel, kernel.open_lobby(), '"x" * 3000000;')
    assert shown == '[] "' + "x" * (MAX_SHOWN_LENGTH - 1)
    assert told == f"[:error] !!! of a value of 3000002 characters only {MAX_SHOWN_LENGTH} are shown"


def test_a_binary_is_shown_whole(kernel: Kernel) -> None:
    shown = said(kernel, kernel.open_lobby(), 'Binary.new("", "x" * 3000000);')
    assert [len(line) for line in shown] == [len("[] BIN 3000000"), 3_000_000]


def test_what_fails_at_the_end_of_a_connection_keeps_the_rest_from_nothing(kernel: Kernel) -> None:
    lobby, other = kernel.open_lobby(), kernel.open_lobby()
    kernel.run()
    heard = []

    def fail(gone: Lobby) -> None:
        heard.append(gone)
        raise ValueError("the lease is broken")

    kernel.world.client_gone.append(fail)
    said(kernel, other, "at (Lobby.onDisconnect?(var l) if l.nothing) {};")
    lobby.feed(b"every (1s) { 1 },")
    kernel.run()
    with pytest.raises(ValueError, match="broken"):
        lobby.close()
    kernel.scheduler.run_simulated(5)
    assert heard == [lobby]
    assert kernel.scheduler.shares.of(lobby) == 0
    assert said(kernel, other, "6 * 7;") == ["[] 42"]


def test_a_shell_that_fails_to_end_does_not_keep_the_jobs_of_its_connection(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    lobby = kernel.open_lobby()
    lobby.feed(b"every (1s) { 1 },")
    kernel.run()

    def fail() -> None:
        raise ValueError("a bug")

    monkeypatch.setattr(lobby.shell, "close", fail)
    lobby.close()
    kernel.scheduler.run_simulated(5)
    assert kernel.scheduler.shares.of(lobby) <= 1  # its main job, which has not ended
