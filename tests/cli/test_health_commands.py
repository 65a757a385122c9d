"""``urbihw status`` and ``urbihw health``, with bus workers that answer what a test says."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from health_sample import HEALTHY
from test_control_commands import Robot, leave

from urbihw.cli import control
from urbihw.cli.main import main
from urbihw.daemon import runtime

pytestmark = pytest.mark.e2e

Capture = pytest.CaptureFixture[str]
Add = Callable[..., Robot]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the control sockets of this user are."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    for module in (runtime, control):
        monkeypatch.setattr(module, "SERVICE_FOLDER", tmp_path / "service")
    return runtime.runtime_folder()


@pytest.fixture
def add(folder: Path) -> Iterator[Add]:
    made: list[Robot] = []

    def start(name: str = "bioloid-54000", answer: dict[str, Any] | None = HEALTHY) -> Robot:
        made.append(Robot(folder / f"{name}.sock", answer))
        return made[-1]

    yield start
    for robot in made:
        robot.close()


def hot() -> dict[str, Any]:
    made = copy.deepcopy(HEALTHY)
    made["devices"][0]["values"]["temperature"] = 68.0
    made["devices"][0]["model"] = "AX\x1b[2J"
    return made


def test_status_has_a_line_for_the_robot_and_one_for_each_device(add: Add, capsys: Capture) -> None:
    told = copy.deepcopy(HEALTHY)
    told["devices"][0] |= {"name": "hip", "who": "Lobby_2 (127.0.0.1)", "alarm": "overload"}
    robot = add(answer=told)
    assert main(("status",)) == 0
    assert capsys.readouterr().out == (
        "bioloid-54000: bad: link up, 100 of 100 Hz, wire 40%, 3 late, 900 timeouts\n"
        "  hip (6) AX-12A: ok, 0.50 rad, 11.1 V, 41 degC, alarm: overload, moved by Lobby_2 (127.0.0.1)\n"
    )
    assert robot.heard == [{"do": "health"}]


def test_status_for_programs(add: Add, capsys: Capture) -> None:
    answer = hot()
    answer["devices"][0]["values"]["voltage"] = float("nan")
    add(answer=answer)
    add("nxt-54001", None)
    assert main(("status", "--json")) == 69
    told = json.loads(capsys.readouterr().out)
    assert told["bioloid-54000"]["verdict"] == "warning"
    assert told["bioloid-54000"]["devices"][0]["values"]["voltage"] is None
    assert (told["nxt-54001"]["verdict"], told["nxt-54001"]["devices"]) == ("bad", [])


def test_the_verdict_of_a_robot_that_is_well(add: Add, capsys: Capture) -> None:
    add()
    assert main(("health",)) == 0
    assert capsys.readouterr() == ("bioloid-54000: ok\n", "")


def test_the_exit_code_is_that_of_the_worst(add: Add, capsys: Capture) -> None:
    add("a-1", HEALTHY)
    add("b-2", hot())
    assert main(("health",)) == 1
    assert capsys.readouterr().out == "a-1: ok\nb-2: warning\n  warning: 6: 68 degC, near its limit of 70\n"
    add("c-3", HEALTHY | {"link": False, "link_reason": "no such port"})
    assert main(("health",)) == 2


def test_a_worker_that_hangs_is_bad(add: Add, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "ANSWER_TIMEOUT_S", 0.05)
    add(answer=None)
    assert main(("health",)) == 2
    assert "its bus worker hangs" in capsys.readouterr().out
    assert main(("status",)) == 69


def test_json_has_verdict_reasons_and_all_that_was_told(add: Add, capsys: Capture) -> None:
    add(answer=hot())
    assert main(("health", "--json")) == 1
    told = json.loads(capsys.readouterr().out)["bioloid-54000"]
    assert told["verdict"] == "warning"
    assert [(row["kind"], row["device"]) for row in told["reasons"]] == [("temperature", "6")]
    assert told["told"]["devices"][0]["values"]["voltage"] == 11.1


def test_json_has_null_for_what_is_no_number(add: Add, capsys: Capture) -> None:
    answer = hot()
    answer["devices"][0]["values"] |= {"voltage": float("nan"), "load": float("inf")}
    add(answer=answer)
    main(("health", "--json"))
    out = capsys.readouterr().out
    assert "NaN" not in out and "Infinity" not in out
    assert json.loads(out)["bioloid-54000"]["told"]["devices"][0]["values"]["voltage"] is None


def test_what_a_device_says_commands_no_terminal(add: Add, capsys: Capture) -> None:
    add(answer=hot())
    main(("status",))
    assert "AX\\x1b[2J" in capsys.readouterr().out


def test_nobody_is_there(folder: Path, capsys: Capture) -> None:
    leave(folder, "bioloid-54000")
    for command in ("status", "health"):
        assert main((command,)) == 69
        assert capsys.readouterr() == ("", "urbihw: no daemon answers: start it (urbihw serve)\n")
