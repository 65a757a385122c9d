"""The schema of the settings file against an independent reader of schemas, and against the loader."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from urbihw import platforms
from urbihw.daemon.config import Config, load
from urbihw.daemon.schema import meanings, of_table, schema
from urbihw.settings import SettingsTable

SAMPLE = Path(__file__).resolve().parents[2] / "urbihw" / "share" / "urbihw.toml"
MANIFESTS = {folder.name: platforms.read(folder) for folder in platforms.folders()}
TABLES: dict[str, type[SettingsTable]] = {
    "daemon": Config,
    **{name: platforms.load_options(manifest) for name, manifest in MANIFESTS.items()},
}


def valid(text: str) -> bool:
    """Whether a settings file is right by the schema."""
    return jsonschema.Draft202012Validator(schema()).is_valid(tomllib.loads(text))


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())


def test_the_sample_is_right() -> None:
    jsonschema.validate(tomllib.loads(SAMPLE.read_text()), schema())


def test_the_sample_with_every_setting_is_right() -> None:
    lines = SAMPLE.read_text().splitlines()
    settings = [line[1:] for line in lines if line.startswith("#") and " = " in line and line[1] != " "]
    assert valid("\n".join(settings))


@pytest.mark.parametrize("name", TABLES)
def test_every_rule_is_in_it_with_default_and_meaning(name: str) -> None:
    rows = of_table(TABLES[name])["properties"]
    assert rows.keys() == TABLES[name].rules().keys()
    for row, rule in TABLES[name].rules().items():
        assert rows[row] | rule.schema() == rows[row]
        assert rows[row]["description"] == meanings(TABLES[name])[row]
        assert "default" in rows[row]


@pytest.mark.parametrize("name", MANIFESTS)
def test_every_platform_is_in_it(name: str) -> None:
    made = schema()
    (then,) = [part["then"] for part in made["allOf"] if part["if"]["properties"]["platform"]["const"] == name]
    assert then["properties"]["options"] == of_table(TABLES[name])
    assert name in made["properties"]["platform"]["enum"]


BIOLOID = 'platform = "bioloid"\n'


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("", True),
        (BIOLOID + "[options]\nprotocol = 1\nids = [1, 2]\n[limits]\nspeed = 1\n[limits.motor6]\ntorque = 1", True),
        ("prot = 1", False),
        ("port = 65536", False),
        ("port = '1'", False),
        ("rate = 0.5", False),
        ("load = [1]", False),
        ("log_level = 'loud'", False),
        ("quiet = 1", False),
        ("fake = true\nurl = 'x'", False),
        ("fake = true\nworld = 'room'", True),
        ("world = 'room'", False),
        (BIOLOID + "metrics = '127.0.0.1:9100'", True),
        (BIOLOID + "metrics = '[::1]:65535'", True),
        (BIOLOID + "metrics = ''", True),
        (BIOLOID + "metrics = '0.0.0.0:9100'", False),
        (BIOLOID + "metrics = '192.168.1.5:9100'", False),
        (BIOLOID + "metrics = 'localhost:9100'", False),
        (BIOLOID + "metrics = '127.0.0.1:0'", False),
        (BIOLOID + "metrics = '127.0.0.1:65536'", False),
        (BIOLOID + "metrics = '127.0.0.256:9100'", False),
        (BIOLOID + "metrics = '127.0.0.1'", False),
        ("platform = 'biolid'", False),
        (BIOLOID + "[options]\noffset = 3", False),
        (BIOLOID + "[options]\nprotocol = 3", False),
        (BIOLOID + "[options]\nids = [253]", False),
        (BIOLOID + "[limits]\nturn = 1", False),
        (BIOLOID + "[limits]\nspeed = 0", False),
        (BIOLOID + "[limits]\nposition = [1.0]", False),
        (BIOLOID + "[limits.motor6]\nturn = 1", False),
        (BIOLOID + "[limits.arm]\nspeed = 1", False),
        ("[limits]\nsped = 1", False),
        ("[limits.x]\nsped = 1", False),
        (BIOLOID + "[devices]\nhip = 3\n[devices.knee]\nid = 4\nmodel = 'AX-12A'\ndirection = -1", True),
        (BIOLOID + "[devices.knee]\nmodel = 'AX-12A'", False),
        (BIOLOID + "[devices]\nhip = 300", False),
        ("platform = 'nxt'\n[devices]\nhip = 3", False),
        ("platform = 'segway'\n[options]\nmodel = 400", True),
        ("platform = 'segway'\n[options]\nmodel = 300", False),
    ],
)
def test_it_says_what_the_loader_says(tmp_path: Path, text: str, right: bool) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    assert valid(text) == right
    assert (not load(file).mistakes) == right


def test_what_is_documented_over_several_lines_or_for_several_names() -> None:
    class Toy(SettingsTable):
        """A toy.

        Attributes:
            colour, sound: what it looks and sounds like,
                and more of that.
            size: in m.
        """

    assert meanings(Toy) == {
        "colour": "what it looks and sounds like, and more of that.",
        "sound": "what it looks and sounds like, and more of that.",
        "size": "in m.",
    }


def test_it_has_no_value_that_is_no_json() -> None:
    def walk(value: Any) -> None:
        if isinstance(value, dict):
            for part in value.values():
                walk(part)
        elif isinstance(value, list):
            for part in value:
                walk(part)
        else:
            assert value is None or isinstance(value, bool | str | int) or abs(value) < 1e300

    walk(schema())
