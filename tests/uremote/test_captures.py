"""What original remote programs said, byte for byte, gets from our server the answers that it got from the original."""

from __future__ import annotations

import difflib

import pytest
from replay import Replay, Step, neutral, relayed, typed

NOT_OURS = {
    "remote-second-of-same-class.txt": (
        # the original is silent about the name, and only refuses what is declared of it
        "[T:error] !!! object: UMachine belongs to Lobby_3 (127.0.0.1), nothing is declared",
    ),
    "remote-all-text.txt": (
        "[T:error] !!! lookup failed: sharedRTP",  # the original's own trouble without its RTP module
        "[T:error] !!! P: syntax error: unexpected ;",  # a Binary in an event in the old form: we read it
        "[T:error] !!! P: syntax error: unexpected )",
    ),
    "remote-all-binary.txt": ("[T:error] !!! lookup failed: sharedRTP",),
    "handmade-remote-binary.txt": (
        '[T] [1, "r"]',  # the recording does not show what the user was answered there
        # the same in other words
        "[T:warning] !!! P: invalid exception caught: There is no turning back from serialized mode",
        "[T:warning] !!!    called from: P: binaryMode",
        "[T:warning] !!! there is no way back from binary mode",
    ),
}


def difference(name: str, wanted: list[str], got: list[str]) -> str:
    other = NOT_OURS.get(name, ())
    mine, theirs = ([line for line in lines if line not in other] for lines in (got, wanted))
    return "\n".join(difflib.unified_diff(theirs, mine, "recorded", "answered", lineterm="", n=1))


@pytest.mark.parametrize("name", ["remote-machine-text.txt", "remote-machine-binary.txt", "remote-timer-text.txt"])
def test_whole_programs(name: str) -> None:
    wanted, got = Replay().play(relayed(name))
    assert difference(name, wanted, got) == ""
    assert len(wanted) > 5


def test_a_program_that_is_killed_during_a_call() -> None:
    name = "remote-killed-during-call.txt"
    replay = Replay()
    steps = relayed(name)
    steps.insert(len(steps) - 1, Step("U", 'm.assemble(["slow"]);'))  # what the recording does not show
    wanted, got = replay.play(steps)
    assert difference(name, wanted, got) == ""
    replay.remote.close()
    replay.kernel.scheduler.run_simulated(replay.kernel.clock.now() + 1)
    assert b"assemble: Remote disconnected" in replay.user.output.take_bytes()


def test_a_second_program_with_the_same_class() -> None:
    name = "remote-second-of-same-class.txt"
    replay = Replay()
    first = replay.kernel.open_lobby("127.0.0.1")
    for step in relayed("remote-machine-text.txt")[:8]:
        if step.kind == "R":
            first.feed(step.text.encode("latin-1"))
    replay.kernel.scheduler.run_simulated(0.1)
    wanted, got = replay.play(relayed(name))
    assert difference(name, wanted, got) == ""
    assert "slot redefinition: update" in got[-1]


@pytest.mark.parametrize("name", ["remote-all-text.txt", "remote-all-binary.txt"])
def test_all_kinds_of_values(name: str) -> None:
    wanted, got = Replay().play(relayed(name))
    assert difference(name, wanted, got) == ""


@pytest.mark.parametrize("name", [
    "client-urbi-send.txt", "client-gets.txt", "client-callbacks.txt", "client-pictures.txt",
])
def test_clients(name: str) -> None:
    """Blocking gets, callbacks by the channel of a line, binaries; one is a recording, the others are composed."""
    wanted, got = Replay().play(relayed(name))
    assert difference(name, wanted, got) == ""
    assert len(wanted) >= 5


@pytest.mark.parametrize("name", ["handmade-remote-text.txt", "handmade-remote-binary.txt"])
def test_remotes_written_by_hand(name: str) -> None:
    replay, steps = Replay(), typed(name)
    wanted, got = replay.play(steps)
    assert difference(name, wanted, got) == ""
    answers = "".join(step.text for step in steps if step.kind == "A")
    assert difference(name, neutral(answers)[1:], neutral(replay.said)[1:]) == ""
