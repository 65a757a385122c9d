"""Manifests: read without code, refused in plain words; the loader."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from urbihw import platforms
from urbihw.kernel.uobject import BadConfig, PlatformRobot
from urbihw.platforms.manifest import BadManifest, PlatformFolder, UsbId, read

GOOD = 'name = "toy"\ntitle = "A toy"\nrobot = "robot:Toy"\nslot = "toy"\n'


def toy(root: Path, text: str = GOOD, code: str = "") -> PlatformFolder:
    folder = root / "toy"
    folder.mkdir()
    (folder / "platform.toml").write_text(text)
    (folder / "robot.py").write_text(code)
    return PlatformFolder("toy", folder, "urbihw.platforms.toy")


def test_all_of_ours_are_sound_and_their_robots_are_robots() -> None:
    for folder in platforms.folders():
        assert issubclass(platforms.load(read(folder)), PlatformRobot)


def test_the_bioloid() -> None:
    manifest = platforms.find("bioloid")
    assert manifest.slot == "bioloid"
    assert manifest.fake[0] == "bioloid"
    assert UsbId(0x0403, 0x6014, "U2D2") in manifest.usb


def test_finding_reads_no_code(tmp_path: Path) -> None:
    toy(tmp_path, code="raise RuntimeError('imported')")
    before = set(sys.modules)
    assert platforms.find("toy", tmp_path).title == "A toy"
    assert not any(".toy" in name for name in set(sys.modules) - before)


def test_an_unknown_name_tells_the_known(tmp_path: Path) -> None:
    toy(tmp_path)
    with pytest.raises(BadConfig, match=r"no platform 'tay'; did you mean toy\?"):
        platforms.find("tay", tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = ", "is no TOML"),
        (GOOD.replace('slot = "toy"\n', ""), "'slot' is missing"),
        (GOOD + "colour = 1\n", "'colour' is no key of a manifest; known: "),
        (GOOD.replace('"toy"', '"boy"', 1), "name is 'boy', but the folder is called 'toy'"),
        (GOOD.replace("robot:Toy", "robot"), "robot must be written module:Class"),
        (GOOD.replace("robot:Toy", "engine:Toy"), "there is no engine.py"),
        (GOOD.replace('slot = "toy"', 'slot = "my toy"'), "slot must be a name"),
        (GOOD.replace('"A toy"', "3"), "title must be a text in quotes, not 3"),
        (GOOD + 'library = "toy.u"\n', "library must be a list of texts"),
        (GOOD + 'library = ["toy.u"]\n', "library names 'toy.u', which is not beside the manifest"),
        (GOOD + 'on_robot = "guard.py"\n', "on_robot names 'guard.py', which is not beside the manifest"),
        (GOOD + "usb = [{ vendor = 1 }]\n", "usb must be a list of"),
        (GOOD + 'options = 3\n', "options must be a text in quotes, not 3"),
        (GOOD + 'devices = 3\n', "devices must be true or false, not 3"),
        (GOOD + 'limits = ["speed"]\n', "limits must be a table such as"),
        (GOOD + 'system = ["char-ttyUSB"]\n', "system must be a table with the keys devices, address_families, groups"),
        (GOOD + '[system]\ndevices = ["ttyUSB"]\n', "system.devices must be a list of texts of the form (?:char"),
        (GOOD + '[system]\ngroups = ["dialout\\nUser=root"]\n', "system.groups must be a list of texts of the form"),
        (GOOD + '[limits]\narm = ["sped"]\n', "limits.arm: no such limit: 'sped'; there are: position, speed"),
        (GOOD + 'usb = [{ vendor = 70000, product = 1, name = "x" }]\n', "vendor must be a number from 0 to 0xffff"),
    ],
)
def test_what_is_wrong_is_said_in_plain_words(tmp_path: Path, text: str, words: str) -> None:
    folder = toy(tmp_path, text)
    with pytest.raises(BadManifest) as caught:
        read(folder)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(folder.path / "platform.toml"))
