"""``urbihw servo``: the verbs, in a dialogue, on a fake in simulated time."""

from __future__ import annotations

import io
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from buses.line_rig import LineRig, ax, xl
from typist import Typist

from urbihw.buses.servos.registers import ServoError
from urbihw.cli import servo
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.main import main, parser
from urbihw.cli.servo_verbs import VerbJob
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo


def do(rig: LineRig, command: str, *steps: tuple[Callable[[], object] | None, str]) -> list[str]:
    """Carry out ``urbihw servo``; return the lines that it printed."""
    options = parser("servo").parse_args(["servo", *command.replace("URL", "pipe://robot").split()])
    out = io.StringIO()
    servo._VERBS[options.verb][1](VerbJob(rig.line, options, Dialogue(Typist(*steps), out)))
    return out.getvalue().splitlines()


def test_a_box_of_servos_with_one_id_gets_ids_one_after_the_other() -> None:
    units = [ax(1) for _ in range(3)]
    rig = LineRig(units)
    words = rig.console()

    def only(number: str) -> tuple[Callable[[], object], str]:
        return lambda: words["connect"].run([number]), ""

    lines = do(rig, "set-id URL 11 12 13", only("1"), only("2"), only("3"))
    assert [unit.id for unit in units] == [11, 12, 13]
    assert lines[1] == "AX-12A: id 1 -> 11, checked; its torque is off"
    words["connect"].run(["all"])
    assert sorted(unit.id for unit in rig.kit) == [11, 12, 13]


def test_two_with_one_id_are_told_apart_by_unplugging_one() -> None:
    units = [ax(5), ax(5)]
    rig = LineRig(units)
    words = rig.console()
    lines = do(rig, "set-id URL 6 --id 5", (None, ""), (lambda: words["connect"].run(["2"]), ""))
    assert [unit.id for unit in units] == [5, 6]
    assert lines.count("More than one servo answers to id 5.") == 2
    rig = LineRig([ax(5), ax(5)])
    with pytest.raises(ServoError, match="nothing further is changed"):
        do(rig, "set-id URL 6 --id 5", (None, "q"))
    assert [unit.id for unit in rig.kit] == [5, 5]


def test_registers_are_read_with_their_units() -> None:
    rig = LineRig([ax(1)])
    assert do(rig, "read URL --id 1 return_delay_time present_voltage 36:2") == [
        "   5 return_delay_time        250  (0.0005 s)",
        "  42 present_voltage          120  (12 V)",
        "  36 00 02",
    ]
    assert len(do(rig, "read URL --id 1 all")) > 30
    with pytest.raises(ValueError, match="has no item 'speed'"):
        do(rig, "read URL speed")


def test_writes_are_told_and_checked_before_the_first() -> None:
    unit = ax(1, torque_enable=1)
    rig = LineRig([unit])
    with pytest.raises(ValueError, match=r"takes 0\.\.254"):
        do(rig, "write URL cw_angle_limit=5 return_delay_time=999")
    with pytest.raises(ValueError, match="write NAME=VALUE"):
        do(rig, "write URL cw_angle_limit")
    assert unit.registers.get("cw_limit") == 0 and unit.registers.get("torque_enable") == 1
    assert do(rig, "write URL return_delay_time=0") == [
        "servo 1: return_delay_time 250 -> 0 (0 s)", "servo 1: its torque is off now",
    ]  # fmt: skip
    assert unit.registers.get("return_delay") == 0
    assert do(rig, "write URL --id 1 5=10") == ["servo 1: return_delay_time 0 -> 10 (2e-05 s)"]
    with pytest.raises(ValueError, match="no register begins at address 7"):
        do(rig, "write URL 7=1")
    with pytest.raises(ServoError, match="goal_position is not written"):
        do(rig, "write URL 30=1")


def test_speed_reset_and_reboot() -> None:
    unit = xl(2, 1_000_000)
    rig = LineRig([unit])
    assert do(rig, "set-baud URL 57600") == ["servo 2: 1000000 -> 57600 bps, checked; its torque is off"]
    unit.registers.put("min_position", 100)
    with pytest.raises(ServoError, match="nothing is changed"):
        do(rig, "reset URL", (None, "n"))
    assert unit.registers.get("min_position") == 100
    assert do(rig, "reset URL --yes") == ["servo 2: factory values, checked; its torque is off"]
    assert (unit.id, unit.baud, unit.registers.get("min_position")) == (2, 57_600, 0)
    assert do(rig, "reboot URL") == ["servo 2: restarted"]


def test_backup_restore_and_adopt(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    old = ax(3, return_delay=0, cw_limit=200)
    rig = LineRig([ax(1), old])
    assert do(rig, f"backup URL {path}") == [f"2 servos in {path}"]
    assert do(rig, f"restore URL {path}") == ["servo 1: as in the backup", "servo 3: as in the backup"]
    old.registers.put("cw_limit", 5)
    assert do(rig, f"restore URL {path}", (None, "n"))[-1] == "servo 3: nothing is changed"
    assert "servo 3: cw_angle_limit 5 -> 200" in do(rig, f"restore URL {path} --id 3 --yes")
    assert old.registers.get("cw_limit") == 200

    rig.kit.remove(old)
    new = ax(1, 57_142)
    rig.kit.add(new)
    lines = do(rig, f"adopt URL --id 3 --from {path}", (None, "y"))
    get = new.registers.get
    assert (new.id, new.baud, get("cw_limit"), get("return_delay")) == (3, 1_000_000, 200, 0)
    assert lines[0] == "no new servo at 1000000 bps: looking at all speeds"
    assert "servo 3: id, speed and registers are those of its predecessor; its torque is off" in lines
    with pytest.raises(ValueError, match="has no servo 9"):
        do(rig, f"adopt URL --id 9 --from {path}")


def test_a_new_servo_with_the_id_of_another_one_is_adopted_after_unplugging(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    first, old = ax(1, cw_limit=7), ax(3, cw_limit=200)
    rig = LineRig([first, old])
    do(rig, f"backup URL {path}")
    rig.kit.remove(old)
    new = ax(1)
    rig.kit.add(new)
    lines = do(rig, f"adopt URL --id 3 --from {path} --yes", (lambda: rig.kit.remove(first), ""))
    assert (first.id, new.id, new.registers.get("cw_limit")) == (1, 3, 200)
    assert "More than one servo answers to id 1." in lines


def test_a_servo_that_is_adopted_with_a_problem_is_not_said_to_be_the_same(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    old = ax(3, cw_limit=200)
    rig = LineRig([old])
    do(rig, f"backup URL {path}")
    path.write_text(path.read_text().replace("status_return_level = 2", "status_return_level = 0"))
    rig.kit.remove(old)
    new = ax(1)
    rig.kit.add(new)
    with pytest.raises(ServoError, match="servo 3: status_return_level 0 is not written"):
        do(rig, f"adopt URL --id 3 --from {path} --yes")
    assert (new.id, new.registers.get("cw_limit")) == (3, 200)
    assert do(rig, "read URL --id 3 status_return_level")[0].split()[:3] == ["16", "status_return_level", "2"]
    with pytest.raises(ServoError, match="it would answer pings only"):
        do(rig, "write URL --id 3 return_delay_time=0 status_return_level=0")
    assert new.registers.get("return_delay") == 250


def test_a_wrong_backup_is_one_line_without_commands_for_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = LineRig([ax(3)])
    monkeypatch.setattr(servo, "open_line", lambda url: rig.line)
    path = tmp_path / "robot.toml"
    path.write_text('[servo."3\\u001b[2J\\n"]\n')
    assert main(["servo", "restore", "pipe://robot", str(path), "--yes"]) == 78
    assert capsys.readouterr().err == f"urbihw: {path}: servo.3\\x1b[2J\\n: the id is a number from 0 to 253\n"


def test_problems_are_one_line_with_an_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))  # it does not listen
        for url in ("/dev/none", f"socket://127.0.0.1:{deaf.getsockname()[1]}"):
            assert main(["servo", "read", url, "all"]) == 78
            (line,) = capsys.readouterr().err.splitlines()
            assert line.startswith("urbihw: ")
    for words in (["servo"], ["servo", "set-id", "/dev/none"], ["servo", "set-id", "/dev/none", "300"]):
        with pytest.raises(SystemExit) as caught:
            main(words)
        assert caught.value.code == 78
        assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("unit", [ax(9), xl(9, 1_000_000)], ids=["protocol 1.0", "protocol 2.0"])
def test_a_servo_that_answers_pings_only_is_brought_back(unit: Unit) -> None:
    level = "status_level"
    unit.registers.put(level, 0)
    unit.registers.put("torque_enable", 1)
    rig = LineRig([unit])
    with pytest.raises(ServoError, match=r"servo 9 answers pings only .*: write status_return_level=2 alone"):
        do(rig, "read URL --id 9 all")
    with pytest.raises(ServoError, match="answers pings only"):
        do(rig, "write URL --id 9 return_delay_time=0")
    assert do(rig, "write URL --id 9 status_return_level=2")[0].startswith("servo 9: status_return_level=2: it answers")
    assert (unit.registers.get(level), unit.registers.get("torque_enable")) == (2, 0)
    assert do(rig, "read URL --id 9 id")


def test_a_speed_that_no_scan_tries_is_refused() -> None:
    unit = ax(9)
    with pytest.raises(ValueError, match="12345 bps: no scan tries this speed; give one of 9600, "):
        do(LineRig([unit]), "set-baud URL 12345 --id 9")
    assert unit.baud == 1_000_000


def test_a_servo_that_was_not_swapped_keeps_the_id_that_it_has_just_got() -> None:
    units = [ax(1), ax(1)]
    rig = LineRig(units)
    words = rig.console()

    def only(number: str) -> tuple[Callable[[], object], str]:
        return lambda: words["connect"].run([number]), ""

    lines = do(rig, "set-id URL 11 12", only("1"), (None, ""), only("2"))
    assert "This is still servo 11, which has just got its id." in lines
    assert [unit.id for unit in units] == [11, 12]


def test_a_reset_that_is_not_known_is_refused_before_the_question() -> None:
    unit = FeetechServo("STS3215", 4)
    with pytest.raises(ServoError, match="is not documented; restore a backup"):
        do(LineRig([], kit=FeetechBus([unit])), "reset URL")


def test_a_restore_tells_all_before_it_ends_at_another_model(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    third = ax(3, cw_limit=200)
    rig = LineRig([ax(1), ax(2), third])
    do(rig, f"backup URL {path}")
    rig = LineRig([xl(1, 1_000_000), ax(2), third, ax(4)])
    third.registers.put("cw_limit", 5)
    with pytest.raises(ServoError, match="servo 1 is of model XL430-W250, but the backup is of model AX-12A"):
        do(rig, f"restore URL {path} --yes")
    assert third.registers.get("cw_limit") == 200


def test_no_limit_is_no_infinity() -> None:
    assert do(LineRig([ax(1)]), "read URL moving_speed") == ["  32 moving_speed             0  (no limit)"]


def test_a_feetech_servo_without_answers_to_writes_is_read_and_set_back() -> None:
    rig = LineRig([], kit=FeetechBus([FeetechServo("STS3215", 4)]))
    assert do(rig, "write URL --id 4 response_level=0") == ["servo 4: response_level 1 -> 0"]
    assert do(rig, "write URL --id 4 response_level=1") == ["servo 4: response_level 0 -> 1"]
