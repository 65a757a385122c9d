"""``urbihw teach`` and ``urbihw play`` at a terminal, against a served robot."""

from __future__ import annotations

from pathlib import Path

import pytest
from faults_lab import case_of
from moving_robots import RIGS
from programs_lab import Terminal

pytestmark = pytest.mark.e2e

RIG = next(rig for rig in RIGS if rig.name == "Bioloid, a joint that swings")


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
        lesson.wait("steps is kept: urbihw play steps")
        assert lesson.process.wait(20) == 0
        assert lesson.settings() == lesson.at_first
        (file,) = tmp_path.rglob("steps.jsonl")
        head, first, second = file.read_text().splitlines()
        file.write_text(f"{head}\n[0, 0.0]\n[20, 2.0]\n")
        player = Terminal("main", "play", "steps", "-P", port, cwd=tmp_path)
        case.client.say('waituntil(joint[6].val > 0.2); echo("moves");')
        case.client.wait("moves")
        player.process.kill()
        player.process.wait(20)
        case.client.say('waituntil(robot.playing.empty); sleep(1s); echo("over");')
        case.client.wait("over")
        before = case.watcher.last_moved(RIG.rest)
        case.client.say('sleep(1s); echo("still");')
        case.client.wait("still")
        assert case.watcher.last_moved(RIG.rest) == before
