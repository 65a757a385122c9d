"""The commands of ``urbihw``."""

from __future__ import annotations

import json
import re
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from urbihw.buses.ports import SerialPort
from urbihw.cli import doctor
from urbihw.cli.machine import ReportLine
from urbihw.cli.main import COMMANDS, main
from urbihw.cli.platforms import maturity

Capture = pytest.CaptureFixture[str]


def leaves(*arguments: str) -> int:
    """The exit code of what argparse ends."""
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert isinstance(caught.value.code, int)
    return caught.value.code


def test_version(capsys: Capture) -> None:
    assert leaves("--version") == 0
    assert re.fullmatch(r"urbihw \d+\.\d+\.\d+\S*\n", capsys.readouterr().out)


def test_help_names_all_commands(capsys: Capture) -> None:
    assert leaves("--help") == 0
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)


@pytest.mark.parametrize("arguments", [(), ("fly",), ("serve", "--port", "x"), ("serve", "--url", "a", "--fake")])
def test_a_bad_option_is_one_line_and_78(capsys: Capture, arguments: tuple[str, ...]) -> None:
    assert leaves(*arguments) == 78
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_serve_wants_a_platform(capsys: Capture) -> None:
    assert main(("serve",)) == 78
    assert "--platform" in capsys.readouterr().err


def test_platforms_lists_the_bioloid(capsys: Capture) -> None:
    assert main(("platforms",)) == 0
    assert re.search(r"^bioloid .*Robotis Bioloid.*\d+ of \d+ rules, --fake\)$", capsys.readouterr().out, re.MULTILINE)


def test_platforms_for_programs(capsys: Capture) -> None:
    assert main(("platforms", "--json")) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert "Robotis Bioloid" in rows["bioloid"]["title"]
    assert (rows["bioloid"]["wheel"], rows["bioloid"]["fake"]) == ("urbihw", True)
    assert re.fullmatch(r"\d+ of \d+ rules", rows["bioloid"]["checklist"])


def test_platforms_prints_the_program_for_a_robot(capsys: Capture) -> None:
    assert main(("platforms", "--on-robot", "nao")) == 0
    assert capsys.readouterr().out.startswith("#!/usr/bin/env python\n")
    for name, words in (("nxt", "platform nxt has no program for the robot itself"), ("nix", "no platform 'nix'")):
        assert main(("platforms", "--on-robot", name)) == 78
        assert words in capsys.readouterr().err


def test_maturity_does_not_count_what_does_not_apply(tmp_path: Path) -> None:
    assert maturity(tmp_path) == "no checklist"
    rules = "".join(f'[rules.r{index}]\nstate = "{state}"\n' for index, state in enumerate(("done", "todo", "exempt")))
    (tmp_path / "checklist.toml").write_text(rules)
    assert maturity(tmp_path) == "1 of 2 rules"


@pytest.mark.parametrize(
    ("stage", "words"),
    [("--tokens", ["NAME", "'x'", "TIME", "2.0"]), ("--ast", ["Assign", "'x'"]), ("--python", ["def ", "move_slot"])],
)
def test_dump_shows_each_stage(capsys: Capture, stage: str, words: list[str]) -> None:
    assert main(("dump", stage, "-e", "a.x = 1 time: 2s;")) == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in words)


def test_dump_of_a_file_with_an_error_names_the_place(capsys: Capture, tmp_path: Path) -> None:
    file = tmp_path / "bad.u"
    file.write_text("1;\nx +;\n")
    assert main(("dump", str(file))) == 65
    assert re.search(r"bad\.u:2\.4: syntax error", capsys.readouterr().err)
    assert main(("dump", str(tmp_path / "none.u"))) == 78


def test_doctor_on_this_machine_says_something_about_everything(capsys: Capture) -> None:
    assert main(("doctor",)) in (0, 78)
    text = capsys.readouterr().out
    assert "Python 3." in text
    assert "lark" in text
    assert "serial port" in text


def test_doctor_wants_a_recent_python() -> None:
    assert [finding.verdict for finding in doctor.python((3, 10))] == ["bad"]
    assert [finding.verdict for finding in doctor.python((3, 12))] == ["ok"]


def test_doctor_tells_missing_packages() -> None:
    def none(name: str) -> str:
        raise PackageNotFoundError(name)

    found = list(doctor.packages(none, "urbihw"))
    assert ReportLine("bad", "lark is missing: pip install lark") in found
    assert not any("pytest" in finding.text for finding in found)


def test_doctor_knows_adapters_and_their_latency(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    (tmp_path / "sys" / "ttyUSB0").mkdir(parents=True)
    (tmp_path / "sys" / "ttyUSB0" / "latency_timer").write_text("16\n")
    monkeypatch.setattr(doctor, "LATENCY", tmp_path / "sys")
    found = list(doctor.adapters([SerialPort(str(device), 0x0403, 0x6014, "FT232H")]))
    assert found[0] == ReportLine("ok", f"{device}: U2D2 (bioloid, chain)")
    assert "keeps answers for 16 ms" in found[1].text
    assert list(doctor.adapters([]))[0].verdict == "note"
