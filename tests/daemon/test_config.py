"""The settings: defaults, file, flags, and one line for each mistake."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urbihw.daemon.config import MIB, Config, configure, load, read_toml
from urbihw.kernel.uobject import BadConfig

SAMPLE = Path(__file__).resolve().parents[2] / "urbihw" / "share" / "urbihw.toml"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the tests write a configuration; named without its folder in messages."""
    monkeypatch.chdir(tmp_path)
    return Path("robot.toml")


HOLDS = (
    "hold_limit: {} s is too long: the robot is stopped after {} s without a sign of life of the daemon (dead_man), so "
    "one program could stop it; give at most {} s"
)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("", 0.5), ("dead_man = 0.9", 0.3), ("dead_man = 60", 0.5), ("dead_man = 0", 0.5), ("hold_limit = 0", 0.0),
     ("platform = 'segway'\ndead_man = 0", 0.4 / 3), ("platform = 'segway'\ndead_man = 0.3", 0.1)],
)  # fmt: skip
def test_a_held_interpreter_is_free_before_the_dead_man_stops_the_robot(file: Path, text: str, seconds: float) -> None:
    file.write_text(text)
    assert configure(file).hold_limit == pytest.approx(seconds)


def test_the_defaults() -> None:
    made = configure()
    assert (made.platform, made.url, made.fake) == ("", "", False)
    assert (made.host, made.port, made.port_file, made.quiet) == ("127.0.0.1", 54000, "", False)
    assert made.unread_limit == 8 * MIB
    assert (made.rate, made.dead_man, made.torque_off_on_stop) == (100.0, 1.5, False)
    assert (made.log_level, made.load, made.options) == ("info", (), {})


def test_a_file_fills_every_setting(file: Path) -> None:
    # What each setting is in a file that leaves none at its default; a new setting comes here by its rule.
    tables = {"platform": "bioloid", "url": "/dev/ttyUSB7", "limits": {"speed": 1.5}, "options": {"protocol": 1}}
    tables |= {"devices": {"hip": 3}, "metrics": "127.0.0.1:9100", "fleet_endpoint": "tcp/[::1]:7448"}
    given = {name: tables.get(name, another(name)) for name in Config.rules() if name not in ("fake", "world")}
    file.write_text("\n".join(f"{name} = {toml(value)}" for name, value in given.items()))
    made, default = configure(file), Config()
    unset = {name for name in Config.rules() if getattr(made, name) == getattr(default, name)}
    assert unset == {"fake", "world"}
    assert {name: getattr(made, name) for name in given} == {
        name: tuple(value) if isinstance(value, list) else value for name, value in given.items()
    }
    file.write_text("rate = 50")
    assert type(configure(file).rate) is float


def another(name: str) -> Any:
    """A value that a setting may have, and that is not its default."""
    rule, default = Config.rules()[name], getattr(Config(), name)
    if rule.words:
        return next(word for word in rule.words if word != default)
    if isinstance(default, bool):
        return not default
    if isinstance(default, int | float):
        return next(value for value in (rule.least, rule.most) if value not in (None, default))
    return ["x"] if isinstance(default, tuple) else "x"


def toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(row)}" for key, row in value.items()) + "}"
    return json.dumps(value)


def test_flags_override_the_file(file: Path) -> None:
    file.write_text('host = "0.0.0.0"\nport = 1234\n')
    assert configure(file, {"port": 0, "host": None, "quiet": True}) == Config(host="0.0.0.0", port=0, quiet=True)


@pytest.mark.parametrize(
    ("text", "flags", "url", "fake"),
    [
        ('url = "pipe://a"', {"fake": True}, "", True),
        ("fake = true", {"url": "pipe://a"}, "pipe://a", False),
        ("fake = true\nworld = 'room'", {"url": "pipe://a"}, "pipe://a", False),
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
        ("hold_limit = 2", f"robot.toml: {HOLDS.format('2', '1.5', '0.75')}"),
        ("hold_limit = 0.2\ndead_man = 0.3", f"robot.toml: {HOLDS.format('0.2', '0.3', '0.15')}"),
        ("platform = 'segway'\nhold_limit = 0.3", f"robot.toml: {HOLDS.format('0.3', '0.4', '0.2')}"),
        ("rate = 0", "robot.toml: rate: wants a number from 1 to 1000 Hz, not 0"),
        ("quiet = 1", "robot.toml: quiet: wants true or false, not 1"),
        ("host = 1", "robot.toml: host: wants a text, not 1"),
        ("load = 'a.u'", 'robot.toml: load: wants a list of texts, not "a.u"'),
        ("load = [1]", "robot.toml: load: wants a list of texts, not [1]"),
        ("options = 1", "robot.toml: options: wants a table, not 1"),
        ("[platform]\nname = 'a'", "robot.toml: platform: wants a text, not a table"),
        ("log_level = 'loud'", 'robot.toml: log_level: wants one of debug, info, warning, error, not "loud"'),
        ("url = 'a'\nfake = true", "robot.toml: fake: a fake robot has no url; give one or the other"),
        (
            'host = "127.0.0.1\\nUser=root"',
            "robot.toml: host: wants an address or a name, such as 127.0.0.1 or ::1, not '127.0.0.1\\nUser=root'",
        ),
        ("port =", "robot.toml: is not TOML: Invalid value (at end of document)"),
        ("port = = 1", "robot.toml: is not TOML: Invalid value (at line 1, column 8)"),
        # What only the platform, and the kind of its bus, know.
        ("platform = 'biolid'", "robot.toml: platform: no platform 'biolid'; did you mean bioloid?"),
        (
            "platform = 'bioloid'\n[options]\noffset = 3",
            "robot.toml: options.offset: no such option of bioloid; there are: protocol, ids, controller, "
            "fast_read, overspeed, blocked_limit, blocked_action, push",
        ),
        (
            "platform = 'bioloid'\n[options]\nprotocoll = 1",
            "robot.toml: options.protocoll: no such option of bioloid; did you mean protocol?",
        ),
        (
            "platform = 'bioloid'\n[options]\nprotocol = '1'",
            'robot.toml: options.protocol: wants 1, 2 or "auto", not "1"',
        ),
        (
            "platform = 'bioloid'\n[options]\nids = [1, 253]",
            "robot.toml: options.ids: wants a list of whole numbers from 0 to 252, such as [1, 2, 100], not [1, 253]",
        ),
        ("platform = 'segway'\n[options]\nmodel = 300",
         "robot.toml: options.model: wants one of 50, 100, 200, 400, not 300"),
        ("platform = 'nxt'\n[options]\nbattery_empty = 9.5",
         "robot.toml: options.battery_empty: 9.5 must be fewer volts than battery_full, 8"),
        ("platform = 'bioloid'\nurl = '/dev/ttyUSB0?boud=1'",
         "robot.toml: url: bus url '/dev/ttyUSB0?boud=1': boud: no such parameter; did you mean baud?"),
        ("platform = 'bioloid'\nurl = '/dev/ttyUSB0?baud=fast'",
         "robot.toml: url: bus url '/dev/ttyUSB0?baud=fast': baud: wants a number such as 57600 or 1000000, "
         'not "fast"'),
        ("platform = 'bioloid'\nurl = '/dev/ttyUSB0?laser=sim'",
         "robot.toml: url: bus url '/dev/ttyUSB0?laser=sim': laser: no such parameter; there is: baud"),
        ("platform = 'p3dx'\nurl = '/dev/ttyUSB0?laser=/dev/ttyUSB1?boud=1'",
         "robot.toml: url: laser: bus url '/dev/ttyUSB1?boud=1': boud: no such parameter; did you mean baud?"),
        ("url = 'socket://host'",
         "robot.toml: url: bus url 'socket://host': write socket://host:port, for instance socket://localhost:6000"),
        ("[limits]\nsped = 1", "robot.toml: limits.sped: no such limit; did you mean speed?"),
        ("[limits.motor6]\nspeed = 0", "robot.toml: limits.motor6.speed: wants a number above 0, not 0"),
        (
            "platform = 'bioloid'\n[limits]\nturn = 1",
            "robot.toml: limits.turn: no device of this platform has such limit; "
            "there are: position, speed, acceleration, torque, temperature, voltage",
        ),
        (
            "platform = 'nxt'\n[limits.A]\ntorque = 1",
            "robot.toml: limits.A.torque: A has no such limit; there are: position, speed, acceleration",
        ),
        ("platform = 'bioloid'\n[limits.moter6]\nspeed = 1",
         "robot.toml: limits.moter6: no such device; did you mean motor6?"),
        ("platform = 'bioloid'\n[limits.arm]\nspeed = 1", "robot.toml: limits.arm: no such device; there is: motorN"),
        (
            "platform = 'chain'\n[devices]\nhip = 3\n[limits.hop]\nspeed = 1",
            "robot.toml: limits.hop: no such device; did you mean hip?",
        ),
        (
            "platform = 'chain'\n[devices]\nhip = 3\n[limits.hip]\nspeed = 1\n[limits.motor3]\ntorque = 1",
            "robot.toml: limits.hip: is motor3, which has limits of its own: write them in one table",
        ),
        ("platform = 'nxt'\n[limits.D]\nspeed = 1", "robot.toml: limits.D: no such device; there are: A, B, C"),
        ("platform = 'nxt'\n[devices]\nhip = 1",
         "robot.toml: devices: platform nxt finds its parts by itself; only chains of servos have it"),
        ("platform = 'bioloid'\n[devices]\na = 1\nb = 1", "robot.toml: devices.b: id 1 already belongs to a"),
        ("platform = 'bioloid'\n[devices.a]\nid = 1\nmodel = 'AX-S2'",
         'robot.toml: devices.a.model: no model "AX-S2" is known; did you mean AX-S1?'),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(file: Path, text: str, message: str) -> None:
    file.write_text(text)
    with pytest.raises(BadConfig) as caught:
        configure(file)
    assert str(caught.value) == message


def test_what_a_platform_has_is_taken(file: Path) -> None:
    file.write_text(
        "platform = 'p3dx'\nurl = '/dev/ttyUSB0?baud=9600&laser=/dev/ttyUSB1?baud=500000'\n"
        "[options]\ncell = 0.2\nsubclass = 'p3dx-sh'\n[limits]\nspeed = 1\n[limits.robot]\nvoltage = [11, 14]"
    )
    made = configure(file)
    assert (made.options["cell"], made.limits["robot"]) == (0.2, {"voltage": [11, 14]})


def test_all_mistakes_are_told_not_only_the_first(file: Path) -> None:
    file.write_text("prot = 1\nrate = 'fast'\nplatform = 'bioloid'\n[options]\noffset = 3\n[limits]\nturn = 1")
    told = load(file, {"port": 70000}).mistakes
    assert [each.setting for each in told] == ["prot", "rate", "port", "options", "limits"]
    assert all(each.line.startswith(("robot.toml: ", "--port: ")) for each in told)
    assert len({each.line for each in told}) == len(told)


def test_a_mistake_of_a_flag_is_told_by_its_flag(file: Path) -> None:
    file.write_text("platform = 'bioloid'\nurl = '/dev/ttyUSB0?boud=1'")
    lines = [each.line for each in load(file, {"url": "/dev/ttyUSB0?boud=2"}).mistakes]
    assert lines == ["--url: bus url '/dev/ttyUSB0?boud=2': boud: no such parameter; did you mean baud?"]


def test_options_of_another_platform_are_not_taken_when_a_flag_chooses_it(file: Path) -> None:
    file.write_text("platform = 'bioloid'\n[options]\nprotocol = 1")
    (mistake,) = load(file, {"platform": "cia402"}).mistakes
    assert mistake.line == "robot.toml: options.protocol: no such option of cia402; there is: nodes"


def test_a_name_like_nothing_lists_what_there_is(file: Path) -> None:
    file.write_text("xyzzy = 1")
    with pytest.raises(BadConfig, match=r"^robot\.toml: xyzzy: no such setting; there are: platform, .*, options\b"):
        configure(file)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"port": 70000}, "--port: wants a whole number from 0 to 65535, not 70000"),
        ({"log_level": "loud"}, '--log-level: wants one of debug, info, warning, error, not "loud"'),
        ({"url": "a", "world": "room"}, "--world: only a simulated robot has a world; give fake, too"),
        ({"url": "a", "fake": True}, "--fake: a fake robot has no url; give one or the other"),
    ],
)
def test_a_mistake_in_a_flag_names_the_flag(flags: dict[str, Any], message: str) -> None:
    with pytest.raises(BadConfig) as caught:
        configure(None, flags)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda file: None, "robot.toml: cannot be read: No such file or directory"),
        (lambda file: file.write_bytes(b"# \xff"), "robot.toml: is not UTF-8 text (byte 2)"),
        (lambda file: file.mkdir(), "robot.toml: is not a regular file: name one that is"),
        (lambda file: os.mkfifo(file), "robot.toml: is not a regular file: name one that is"),
        (lambda file: file.symlink_to("/dev/zero"), "robot.toml: is not a regular file: name one that is"),
        (lambda file: file.symlink_to(file), "robot.toml: cannot be read: Too many levels of symbolic links"),
        (lambda file: file.write_bytes(b"#" * 65537), "robot.toml: is longer than 65536 bytes: this is the wrong file"),
    ],
    ids=["none", "no text", "folder", "FIFO", "device", "link to itself", "long"],
)
def test_what_is_no_file_of_settings(file: Path, make: Callable[[Path], object], message: str) -> None:
    make(file)
    with pytest.raises(BadConfig) as caught:
        configure(file)
    assert str(caught.value) == message


def test_the_sample_shows_every_setting_at_its_default(tmp_path: Path) -> None:
    text = SAMPLE.read_text()
    assert configure(SAMPLE).platform == "bioloid"
    assert configure(SAMPLE).options == {}
    settings = [line[1:] for line in text.splitlines() if line.startswith("#") and " = " in line and line[1] != " "]
    uncommented = tmp_path / "all.toml"
    uncommented.write_text("\n".join(settings))
    shown = {line.partition(" =")[0] for line in settings} | {"platform", "url", "options", "limits", "devices"}
    assert configure(uncommented) == Config()
    assert shown == {each.name for each in dataclasses.fields(Config)}


@pytest.mark.parametrize(
    "text",
    [
        "options = " + "[" * 20_000,
        "port = " + "9" * 5000,
        "[limits]\nspeed = " + "9" * 400,
        'url = "\\u0000"',
        'load = ["a\\u0000b"]',
        "a" * 100_000 + " = 1",
    ],
    ids=["deep", "long number", "large number", "NUL", "NUL in a list", "long"],
)
def test_what_no_settings_can_be_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    with pytest.raises(BadConfig, match="robot.toml: ") as caught:
        configure(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "rate = " + "[" * 5000 + "]" * 5000,
        "\n\nrate = " + "{a = " * 33 + "1" + "}" * 33,
        "a." * 30000 + "b = 1",
        "[limits]\n" + '"a" . ' * 9000 + "b = 1",
        "[" + "a." * 40 + "b]",
    ],
    ids=lambda text: text[:12].strip(),
)
def test_what_nests_too_deep_is_refused_at_once(tmp_path: Path, text: str) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    began = time.process_time()
    with pytest.raises(BadConfig, match=r"nests more than 32 deep \(line \d+\)") as caught:
        read_toml(file)
    assert time.process_time() - began < 1.0
    assert "\n" not in str(caught.value)


def test_brackets_and_dots_in_texts_and_comments_do_not_nest(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    deep = "[{" * 50 + "a." * 50
    file.write_text(f'# {deep}\nurl = "{deep}\\""  # {deep}\nport_file = \'{deep}\'\nload = ["""\n{deep}"""]\n')
    assert read_toml(file)["url"] == deep + '"'
    file.write_text("load = [\n" + '  "a.b.c",\n' * 100 + "]\n")
    assert len(read_toml(file)["load"]) == 100


def test_files_of_options_are_beside_the_settings_file(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('platform = "chain"\n[options]\nprotocol = 1\ncalibration = "robot.json"\n')
    assert load(file).config.options == {"protocol": 1, "calibration": str(tmp_path / "robot.json")}
    file.write_text('platform = "chain"\n[options]\ncalibration = "/srv/robot.json"\n')
    assert load(file).config.options == {"calibration": "/srv/robot.json"}
    file.write_text('platform = "chain"\n[options]\ncalibration = ""\n')
    assert load(file).config.options == {"calibration": ""}
