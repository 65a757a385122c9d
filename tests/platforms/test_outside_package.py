"""A robot as a package of its own: found by its entry points, and no burden to the others when it is broken."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from outside_package import install_outside, write_metadata

import urbihw_fakes
from urbihw import platforms
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BadValue
from urbihw.buses.ports import SerialPort
from urbihw.cli import doctor
from urbihw.cli.main import main
from urbihw.cli.scan_ports import adapter_name
from urbihw.kernel.uobject import BadConfig

ROOT = Path(__file__).resolve().parents[2]
OTHERS = [folder.name for folder in platforms.folders()]
"""All platforms without the toy."""
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> Iterator[Path]:
    """The folder of ``sys.path`` with the package of a toy."""
    folder = tmp_path / "site"
    install_outside(folder, "toy")
    capsys.readouterr()
    monkeypatch.syspath_prepend(folder)
    yield folder
    for name in [name for name in sys.modules if name.startswith("urbihw_toy")]:
        del sys.modules[name]


def imported() -> set[str]:
    return {name for name in sys.modules if name.startswith("urbihw_toy")}


@pytest.mark.usefixtures("root")
def test_it_is_found_without_its_code(capsys: Capture) -> None:
    manifest = platforms.find("toy")
    assert (manifest.package, manifest.wheel, manifest.title) == (
        "urbihw_toy", "urbihw-toy", "Toy: a wheel on a serial line",
    )  # fmt: skip
    assert [folder.name for folder in platforms.folders()] == sorted([*OTHERS, "toy"])
    assert main(("platforms",)) == 0
    assert "toy        Toy: a wheel on a serial line (" in capsys.readouterr().out
    assert imported() == set()


@pytest.mark.usefixtures("root")
def test_its_robot_its_options_and_its_limits_are_those_of_the_settings(tmp_path: Path) -> None:
    manifest = platforms.find("toy")
    assert platforms.load(manifest).__name__ == "Toy"
    assert platforms.load_options(manifest).__name__ == "ToyOptions"
    settings = tmp_path / "toy.toml"
    settings.write_text('platform = "toy"\n[limits]\ntoyWheel.speed = 1\n')
    assert main(("config", "check", "--config", str(settings))) == 0


def test_the_service_gets_rules_for_its_adapters(root: Path, tmp_path: Path) -> None:
    manifest = root / "urbihw_toy" / "platform.toml"
    manifest.write_text(
        manifest.read_text().replace(
            "# The simulated", 'usb = [{ vendor = 0x10c4, product = 0xea60, name = "Toy stick" }]\n# The simulated'
        )
    )
    words = ("--root", str(tmp_path), "--program", "/usr/bin/true")
    assert main(("install-service", "robot", "--platform", "toy", *words)) == 0
    rules = tmp_path / "etc/udev/rules.d/99-urbihw@robot.rules"
    assert rules.read_text().splitlines()[2:] == [
        'ACTION!="remove", SUBSYSTEM=="tty", ATTRS{idVendor}=="10c4", ATTRS{idProduct}=="ea60", '
        'SYMLINK+="urbihw-toy", GROUP="dialout", MODE="0660"'
    ]
    assert 'url = "/dev/urbihw-toy"' in (tmp_path / "etc/urbihw/robot.toml").read_text()
    port = SerialPort("/dev/ttyUSB0", 0x10C4, 0xEA60, "a stick")
    assert adapter_name(port) == "Toy stick (toy)"
    assert main(("install-service", "robot", "--uninstall", *words)) == 0
    assert not rules.exists()


def lose_package(root: Path) -> None:
    (root / "urbihw_toy").rename(root / "elsewhere")


def spoil_manifest(root: Path) -> None:
    (root / "urbihw_toy" / "platform.toml").write_text('name = "toy"\n')


def spoil_options(root: Path) -> None:
    (root / "urbihw_toy" / "options.py").write_text("import urbihw_toy.nothing\n")


BROKEN: list[tuple[Callable[[Path], None], str]] = [
    (lose_package, "platform toy of urbihw-toy: there is no package urbihw_toy"),
    (spoil_manifest, "urbihw_toy/platform.toml: 'title' is missing"),
    (spoil_options, "platform toy of urbihw-toy cannot be imported: ModuleNotFoundError: No module named"),
]


@pytest.mark.parametrize(("spoil", "line"), BROKEN, ids=[spoil.__name__ for spoil, _ in BROKEN])
def test_a_broken_one_is_named_and_the_others_are_there(
    root: Path, spoil: Callable[[Path], None], line: str, capsys: Capture
) -> None:
    spoil(root)
    rows = [row.text for row in doctor.robots(platforms.folders()) if row.verdict == "bad"]
    assert len(rows) == 1 and line in rows[0] and "\n" not in rows[0]
    main(("platforms",))
    shown = [row.split()[0] for row in capsys.readouterr().out.splitlines()]
    assert shown == (sorted([*OTHERS, "toy"]) if spoil is spoil_options else OTHERS)
    assert main(("config", "schema")) == 0
    assert json.loads(capsys.readouterr().out)["properties"]["platform"]["enum"] == ["", *OTHERS]
    assert platforms.find("bioloid").wheel == ""


def test_code_that_fails_names_its_platform(root: Path) -> None:
    (root / "urbihw_toy" / "robot.py").write_text("1 / 0\n")
    line = "platform toy of urbihw-toy cannot be imported: ZeroDivisionError: division by zero"
    with pytest.raises(BadConfig, match=line):
        platforms.load(platforms.find("toy"))


def test_a_package_that_it_needs_is_named(root: Path) -> None:
    (root / "urbihw_toy" / "robot.py").write_text("import nosuchpackage\n")
    with pytest.raises(BadConfig, match="platform toy needs the Python package nosuchpackage: pip install nosuch"):
        platforms.load(platforms.find("toy"))
    manifest = root / "urbihw_toy" / "platform.toml"
    manifest.write_text('needs = ["stick"]\n' + manifest.read_text())
    with pytest.raises(BadConfig, match=r"nosuchpackage: .*/bin/pip install 'urbihw-toy\[stick\]'"):
        platforms.load(platforms.find("toy"))


def test_a_name_of_ours_stays_ours(root: Path, capsys: Capture) -> None:
    write_metadata(root, "other-bioloid", {platforms.ENTRY_POINTS: {"bioloid": "urbihw_toy"}})
    assert platforms.find("bioloid").package == "urbihw.platforms.bioloid"
    assert main(("platforms",)) == 78
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "urbihw: platform bioloid of other-bioloid: urbihw has a platform of this name"


def test_a_family_of_drivers_is_found_by_its_entry_point(root: Path) -> None:
    with pytest.raises(BadValue, match="unknown protocol family 'toys'; known: servos"):
        driver_of("toys")
    write_metadata(root, "toys", {"urbihw.families": {"toys": "urbihw_toy.driver:ToyDriver"}})
    assert type(driver_of("toys")).__name__ == "ToyDriver"


def test_a_broken_simulated_robot_is_named_and_the_others_start(root: Path) -> None:
    write_metadata(root, "torn", {"urbihw.fakes": {"broken": "urbihw_toy.nothing"}})
    fakes = Path(urbihw_fakes.__file__).parents[1]
    done = subprocess.run(
        (sys.executable, "-m", "urbihw_fakes", "toy", "--pty", "--until-eof"), input="", capture_output=True, text=True,
        env={"PYTHONPATH": f"{root}:{fakes}"},
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout.startswith("serial:///")
    assert done.stderr == "fakes: broken of torn: ModuleNotFoundError: No module named 'urbihw_toy.nothing'\n"


def test_a_robot_of_these_sources_whose_wheel_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    projects = [tomllib.loads(path.read_text())["project"] for path in ROOT.glob("packages/*/pyproject.toml")]
    robots = [each for each in projects if platforms.ENTRY_POINTS in each.get("entry-points", {})]
    wheels = {name: each["name"] for each in robots for name in each["entry-points"][platforms.ENTRY_POINTS]}
    assert wheels == platforms.wheels() == {"nao": "urbihw-nao"}
    monkeypatch.setattr(platforms, "_outside_folders", lambda own: {})
    with pytest.raises(BadConfig, match=r"platform nao is a package of its own: install urbihw-nao \(docs/"):
        platforms.find("nao")
