"""``urbihw teach`` and ``urbihw play`` at a terminal, against a served robot."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from faults_lab import Case, case_of
from moving_robots import RIGS
from programs_lab import TIMEOUT_S, Terminal

pytestmark = pytest.mark.e2e

RIG = next(rig for rig in RIGS if rig.name == "Bioloid, a joint that swings")


def play_until_it_moves(case: Case, port: str, folder: Path) -> Terminal:
    """Play the steps until the client has said that the joint moves.

    They are played again where the machine has held the simulated robot up: a joint that is lost ends a motion.
    """
    end = time.monotonic() + TIMEOUT_S
    while True:
        player = Terminal("main", "play", "steps", "-P", port, cwd=folder)
        while "moves" not in case.client.heard and player.process.poll() is None:
            player.listen(0.05)
        if "moves" in case.client.heard:
            return player
        assert " is lost: " in player.listen(0.5) and time.monotonic() < end, player.heard
        player.close()


def test_a_lesson_at_a_terminal_and_a_motion_that_ends_with_its_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with case_of(RIG) as case:
        port = str(case.daemon.port)
        lesson = Terminal("main", "teach", "steps", "--joints", "joint[6]", "--key-poses", "-P", port, cwd=tmp_path)
        lesson.wait("joint.6. +[+-]0.0")
        lesson.type("\n")
        lesson.wait("1 poses")
        lesson.type("\n")
        lesson.wait("2 poses")
        lesson.type("q")
        lesson.wait(" play steps")
        assert lesson.process.wait(TIMEOUT_S) == 0
        assert lesson.settings() == lesson.at_first
        (file,) = tmp_path.rglob("steps.jsonl")
        head, first, second = file.read_text().splitlines()
        file.write_text(f"{head}\n[0, 0.0]\n[20, 2.0]\n")
        case.client.say('waituntil(joint[6].val > 0.2); echo("moves");')
        player = play_until_it_moves(case, port, tmp_path)
        player.process.kill()
        player.process.wait(TIMEOUT_S)
        case.client.say('waituntil(robot.playing.empty); sleep(1s); echo("over");')
        case.client.wait("over")
        before = case.watcher.last_moved(RIG.rest)
        case.client.say('sleep(1s); echo("still");')
        case.client.wait("still")
        assert case.watcher.last_moved(RIG.rest) == before
