"""The settings: defaults, file, flags, and one line for each mistake."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from urbihw.daemon.config import MIB, Config, configure
from urbihw.kernel.uobject import BadConfig

SAMPLE = Path(__file__).resolve().parents[2] / "share" / "urbihw.toml"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the tests write a configuration; named without its folder in messages."""
    monkeypatch.chdir(tmp_path)
    return Path("robot.toml")


def test_the_defaults() -> None:
    made = configure()
    assert (made.platform, made.url, made.fake) == ("", "", False)
    assert (made.host, made.port, made.port_file, made.quiet) == ("127.0.0.1", 54000, "", False)
    assert made.unread_limit == 8 * MIB
    assert (made.rate, made.dead_man, made.torque_off_on_stop) == (100.0, 1.5, False)
    assert (made.log_level, made.load, made.options) == ("info", (), {})


def test_a_file_fills_every_setting(file: Path) -> None:
    file.write_text("""
        platform = "bioloid"
        url = "serial:///dev/ttyUSB0?baud=1000000"
        fake = false
        host = "0.0.0.0"
        port = 54001
        port_file = "/run/urbihw.port"
        quiet = true
        load = ["a.u", "b.u"]
        unread_limit = 65536
        rate = 50
        dead_man = 0.25
        torque_off_on_stop = true
        on_disconnect = "keep"
        on_lost = "end"
        control = "/run/x.sock"
        log_level = "debug"
        [limits]
        speed = 1.5
        [options]
        protocol = 1
    """)
    made = configure(file)
    assert made == Config(
        "bioloid", "serial:///dev/ttyUSB0?baud=1000000", False, "0.0.0.0", 54001, "/run/urbihw.port", True,
        ("a.u", "b.u"), 65536, 50.0, 0.25, True, "keep", "end", {"speed": 1.5}, "/run/x.sock", "debug",
        {"protocol": 1},
    )  # fmt: skip
    assert type(made.rate) is float
    default, names = Config(), [each.name for each in dataclasses.fields(Config)]
    unset = {name for name in names if getattr(made, name) == getattr(default, name)}
    assert unset == {"fake"}


def test_flags_override_the_file(file: Path) -> None:
    file.write_text('host = "0.0.0.0"\nport = 1234\n')
    assert configure(file, {"port": 0, "host": None, "quiet": True}) == Config(host="0.0.0.0", port=0, quiet=True)


@pytest.mark.parametrize(
    ("text", "flags", "url", "fake"),
    [
        ('url = "pipe://a"', {"fake": True}, "", True),
        ("fake = true", {"url": "pipe://a"}, "pipe://a", False),
        ('url = "pipe://a"', {"url": "pipe://b"}, "pipe://b", False),
    ],
)
def test_a_robot_named_by_a_flag_replaces_that_of_the_file(
    file: Path, text: str, flags: dict[str, Any], url: str, fake: bool
) -> None:
    file.write_text(text)
    made = configure(file, flags)
    assert (made.url, made.fake) == (url, fake)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("prot = 1", "robot.toml: prot: no such setting; did you mean port?"),
        ("port = '1'", 'robot.toml: port: wants a whole number from 0 to 65535, not "1"'),
        ("port = true", "robot.toml: port: wants a whole number from 0 to 65535, not true"),
        ("port = 1.5", "robot.toml: port: wants a whole number from 0 to 65535, not 1.5"),
        ("port = 65536", "robot.toml: port: wants a whole number from 0 to 65535, not 65536"),
        ("port = -1", "robot.toml: port: wants a whole number from 0 to 65535, not -1"),
        ("dead_man = -0.1", "robot.toml: dead_man: wants a number from 0 to 60 s, not -0.1"),
        ("dead_man = nan", "robot.toml: dead_man: wants a number from 0 to 60 s, not nan"),
        ("rate = 0", "robot.toml: rate: wants a number from 1 to 1000 Hz, not 0"),
        ("quiet = 1", "robot.toml: quiet: wants true or false, not 1"),
        ("host = 1", "robot.toml: host: wants a text, not 1"),
        ("load = 'a.u'", 'robot.toml: load: wants a list of texts, not "a.u"'),
        ("load = [1]", "robot.toml: load: wants a list of texts, not [1]"),
        ("options = 1", "robot.toml: options: wants a table, not 1"),
        ("[platform]\nname = 'a'", "robot.toml: platform: wants a text, not a table"),
        ("log_level = 'loud'", 'robot.toml: log_level: wants one of debug, info, warning, error, not "loud"'),
        ("url = 'a'\nfake = true", "robot.toml: fake: a fake robot has no url; give one or the other"),
        ("port =", "robot.toml: is not TOML: Invalid value (at end of document)"),
        ("port = = 1", "robot.toml: is not TOML: Invalid value (at line 1, column 8)"),
    ],
)
def test_a_mistake_in_the_file_is_one_line(file: Path, text: str, message: str) -> None:
    file.write_text(text)
    with pytest.raises(BadConfig) as caught:
        configure(file)
    assert str(caught.value) == message


def test_a_name_like_nothing_lists_what_there_is(file: Path) -> None:
    file.write_text("xyzzy = 1")
    with pytest.raises(BadConfig, match=r"^robot\.toml: xyzzy: no such setting; there are: platform, .*, options$"):
        configure(file)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"port": 70000}, "--port: wants a whole number from 0 to 65535, not 70000"),
        ({"log_level": "loud"}, '--log-level: wants one of debug, info, warning, error, not "loud"'),
        ({"url": "a", "fake": True}, "--fake: a fake robot has no url; give one or the other"),
    ],
)
def test_a_mistake_in_a_flag_names_the_flag(flags: dict[str, Any], message: str) -> None:
    with pytest.raises(BadConfig) as caught:
        configure(None, flags)
    assert str(caught.value) == message


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(BadConfig) as caught:
        configure(Path("/nowhere/robot.toml"))
    assert str(caught.value) == "/nowhere/robot.toml: cannot be read: No such file or directory"


def test_a_file_that_is_no_text(file: Path) -> None:
    file.write_bytes(b"# \xff")
    with pytest.raises(BadConfig) as caught:
        configure(file)
    assert str(caught.value) == "robot.toml: is not UTF-8 text (byte 2)"


def test_the_sample_shows_every_setting_at_its_default(tmp_path: Path) -> None:
    text = SAMPLE.read_text()
    assert configure(SAMPLE).platform == "bioloid"
    assert configure(SAMPLE).options == {}
    settings = [line[1:] for line in text.splitlines() if line.startswith("#") and " = " in line and line[1] != " "]
    uncommented = tmp_path / "all.toml"
    uncommented.write_text("\n".join(settings))
    shown = {line.partition(" =")[0] for line in settings} | {"platform", "url", "options", "limits"}
    assert configure(uncommented) == Config()
    assert shown == {each.name for each in dataclasses.fields(Config)}
