"""``urbihw config``: check, show, schema."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from urbihw.cli.main import main
from urbihw.daemon.config import Config, configure

Capture = pytest.CaptureFixture[str]

MISTAKEN = """
prot = 1
platform = "bioloid"
rate = "fast"
url = "/dev/ttyUSB0?boud=1"
[options]
offset = 3
[limits]
turn = 1
[limits.moter6]
speed = 1
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the tests write a configuration; named without its folder in messages."""
    monkeypatch.chdir(tmp_path)
    return Path("robot.toml")


def test_check_of_a_good_file(capsys: Capture, file: Path) -> None:
    file.write_text('platform = "bioloid"\nurl = "/dev/nowhere"\n[limits.motor6]\nspeed = 1\n')
    assert main(("config", "check", "robot.toml")) == 0
    assert capsys.readouterr().out == "robot.toml: nothing wrong\n"


def test_check_tells_all_mistakes_one_line_each(capsys: Capture, file: Path) -> None:
    file.write_text(MISTAKEN)
    assert main(("config", "check", "robot.toml")) == 78
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "urbihw: robot.toml: prot: no such setting; did you mean port?",
        'urbihw: robot.toml: rate: wants a number from 1 to 1000 Hz, not "fast"',
        "urbihw: robot.toml: options.offset: no such option of bioloid; there are: protocol, ids, controller, "
        "fast_read, overspeed, blocked_limit, blocked_action, push",
        "urbihw: robot.toml: limits.turn: no device of this platform has such limit; there are: position, speed, "
        "acceleration, torque, temperature, voltage",
        "urbihw: robot.toml: limits.moter6: no such device; did you mean motor6?",
        "urbihw: robot.toml: url: bus url '/dev/ttyUSB0?boud=1': boud: no such parameter; did you mean baud?",
    ]


def test_check_for_programs(capsys: Capture, file: Path) -> None:
    file.write_text("prot = 1\nrate = 'fast'\n")
    assert main(("config", "check", "robot.toml", "--json")) == 78
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert (err, told["file"], [row["setting"] for row in told["mistakes"]]) == ("", "robot.toml", ["prot", "rate"])
    assert told["mistakes"][0]["text"].endswith("no such setting; did you mean port?")
    file.write_text('platform = "bioloid"\n')
    assert main(("config", "check", "robot.toml", "--json")) == 0
    assert json.loads(capsys.readouterr().out) == {"file": "robot.toml", "mistakes": []}


def test_check_and_show_take_the_file_either_way(capsys: Capture, file: Path) -> None:
    file.write_text('platform = "bioloid"\nport = 4711\n')
    for words in (["robot.toml"], ["--config", "robot.toml"]):
        assert main(("config", "check", *words)) == 0
        assert main(("config", "show", *words)) == 0
        out, _ = capsys.readouterr()
        assert out.startswith("robot.toml: nothing wrong\n") and "port = 4711" in out
    for words in ([], ["robot.toml", "--config", "other.toml"]):
        assert main(("config", "check", *words)) == 78
        (line,) = capsys.readouterr().err.splitlines()[-1:]
        assert "FILE" in line


@pytest.mark.parametrize(
    ("text", "words"), [(None, "cannot be read: "), ("a = ", "is not TOML: "), ("a = 1\na = 2", "is not TOML: ")]
)
def test_check_of_what_is_no_settings_file(capsys: Capture, file: Path, text: str | None, words: str) -> None:
    if text is not None:
        file.write_text(text)
    assert main(("config", "check", "robot.toml")) == 78
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"urbihw: robot.toml: {words}")


def test_show_tells_every_setting_and_where_it_comes_from(capsys: Capture, file: Path) -> None:
    file.write_text('platform = "bioloid"\nrate = 50\n[options]\nprotocol = 1\n[limits.motor6]\nposition = [-1, 1]\n')
    assert main(("config", "show", "--json", "--config", "robot.toml", "--port", "7")) == 0
    rows = json.loads(capsys.readouterr().out)
    assert rows["rate"] == {"value": 50.0, "from": "robot.toml: rate"}
    assert rows["port"] == {"value": 7, "from": "--port"}
    assert rows["url"] == {"value": "/dev/ttyUSB0", "from": "default of bioloid"}
    assert rows["dead_man"] == {"value": 1.5, "from": "default"}
    assert rows["options.protocol"] == {"value": 1, "from": "robot.toml: options.protocol"}
    assert rows["options.fast_read"] == {"value": True, "from": "default"}
    assert rows["limits.motor6.position"] == {"value": [-1, 1], "from": "robot.toml: limits.motor6.position"}
    assert Config.rules().keys() - rows.keys() == {"options", "limits", "devices"}


def test_an_option_that_the_url_gives(capsys: Capture) -> None:
    assert main(("config", "show", "--json", "--platform", "p3dx", "--url", "/dev/ttyUSB0?laser=sim")) == 0
    assert json.loads(capsys.readouterr().out)["options.laser"] == {"value": "sim", "from": "--url"}


def test_what_is_shown_can_be_used_as_a_file(capsys: Capture, file: Path) -> None:
    file.write_text(
        'platform = "p3dx"\nurl = "/dev/ttyUSB0"\nload = ["a \\"b\\".u"]\n[options]\ncell = 0.2\n'
        "[limits]\nspeed = 1\n[limits.robot]\nturn = 2.0\n"
    )
    assert main(("config", "show", "--config", "robot.toml", "--quiet")) == 0
    Path("shown.toml").write_text(capsys.readouterr().out)
    shown, wanted = configure(Path("shown.toml")), configure(file, {"quiet": True})
    assert shown.options.items() > wanted.options.items()
    assert {name: getattr(shown, name) for name in Config.rules() if name != "options"} == {
        name: getattr(wanted, name) for name in Config.rules() if name != "options"
    }


def test_show_without_anything_shows_the_defaults(capsys: Capture) -> None:
    assert main(("config", "show")) == 0
    out = capsys.readouterr().out
    assert all("  # default" in line for line in out.splitlines())
    default = Config()
    assert {key: tuple(value) if isinstance(value, list) else value for key, value in tomllib.loads(out).items()} == {
        name: getattr(default, name) for name in Config.rules() if name not in ("options", "limits", "devices")
    }


def test_show_says_that_a_held_daemon_stops_the_robot(capsys: Capture, file: Path) -> None:
    def line() -> str:
        assert main(("config", "show", "--config", "robot.toml")) == 0
        return next(row for row in capsys.readouterr().out.splitlines() if row.startswith("hold_limit"))

    file.write_text("hold_limit = 0\ndead_man = 3")
    assert line().endswith("# robot.toml: hold_limit; a job that holds for longer than dead_man (3 s) stops the robot")
    for text in ("", "hold_limit = 0.75", "dead_man = 0", "hold_limit = 1\ndead_man = 2"):
        file.write_text(text)
        assert "stops the robot" not in line()


def test_show_of_mistakes_tells_those(capsys: Capture, file: Path) -> None:
    file.write_text(MISTAKEN)
    assert main(("config", "show", "--config", "robot.toml")) == 78
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 6


def test_the_schema_is_printed(capsys: Capture) -> None:
    assert main(("config", "schema")) == 0
    assert json.loads(capsys.readouterr().out)["properties"].keys() == Config.rules().keys()


def test_the_command_as_it_is_typed(file: Path) -> None:
    file.write_text(MISTAKEN)
    command = [sys.executable, "-m", "urbihw.cli.main", "config"]
    checked = subprocess.run([*command, "check", "robot.toml"], capture_output=True, text=True)
    assert (checked.returncode, checked.stdout, len(checked.stderr.splitlines())) == (78, "", 6)
    shown = subprocess.run([*command, "show", "--platform", "nxt", "--fake"], capture_output=True, text=True)
    assert shown.returncode == 0 and "options.battery_full = 8.0" in shown.stdout
    cut = subprocess.run(f"{' '.join(command)} schema | head -1", shell=True, capture_output=True, text=True)
    assert (cut.stdout, cut.stderr) == ("{\n", "")


def test_a_password_is_not_shown(capsys: Capture, file: Path) -> None:
    file.write_text('platform = "spykee"\n[options]\nuser = "bob"\npassword = "hunter2"\n')
    assert main(["config", "show", str(file)]) == 0
    shown = capsys.readouterr().out
    assert "hunter2" not in shown and "bob" in shown
    assert "# options.password" in shown and "options.password; secret, not shown" in shown
    assert "password" not in tomllib.loads(shown)["options"]
    assert main(["config", "show", str(file), "--json"]) == 0
    shown = capsys.readouterr().out
    assert "hunter2" not in shown and json.loads(shown)["options.password"]["value"] is None


@pytest.mark.parametrize(("platform", "row"), [("chain", "calibration"), ("so101", "leader_calibration")])
def test_a_calibration_that_is_missing_or_wrong_is_a_mistake(
    capsys: Capture, file: Path, platform: str, row: str
) -> None:
    named = file.absolute().with_name("nope.json")
    file.write_text(f'platform = "{platform}"\n[options]\n{row} = "nope.json"\n')
    assert main(["config", "check", str(file)]) == 78
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"urbihw: {file}: options.{row}: {named}")
    named.write_text('{"hip": {"id": 3}}')
    assert main(["config", "check", str(file)]) == 78
    (line,) = capsys.readouterr().err.splitlines()
    assert "joint 'hip' lacks drive_mode" in line
    named.write_text("{}")
    assert main(["config", "check", str(file)]) == 0
