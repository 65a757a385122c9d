"""`urbihw new-platform`: a skeleton that holds all contracts as it is, and refusals in one line."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from outside_package import install_outside

from urbihw.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("urbihw/platforms", "fakes/urbihw_fakes", "tests/platforms")
RECIPE = "### A platform (a robot)"
NAMES = ("toy", "ab", "zyxwvutsrqponmlk")

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree with the folders of a clone, and nothing in them but what makes them packages."""
    for part in PARTS:
        (tmp_path / part).mkdir(parents=True)
    for package in ("urbihw", "urbihw/platforms", "fakes/urbihw_fakes"):
        (tmp_path / package / "__init__.py").touch()
    return tmp_path


def files(tree: Path) -> list[Path]:
    return [path for path in tree.rglob("*") if path.is_file()]


def refused(tree: Path, name: str, capsys: Capture) -> str:
    """What is said of a name that cannot be had; nothing is written."""
    before = {path: path.read_bytes() for path in files(tree)}
    assert main(("new-platform", name, "--folder", str(tree))) == 78
    assert {path: path.read_bytes() for path in files(tree)} == before
    (line,) = capsys.readouterr().err.splitlines()
    return line.removeprefix("urbihw new-platform: ")


@pytest.mark.parametrize("name", ["Toy", "2x", "my-toy", "../x", "a", "", "x" * 17, "gerät"])
def test_what_is_no_name(tree: Path, name: str, capsys: Capture) -> None:
    assert "cannot be a name" in refused(tree, name, capsys)


@pytest.mark.parametrize("name", ["class", "at", "every", "list", "echo", "robot", "wheel", "clone"])
def test_names_that_mean_something_else(tree: Path, name: str, capsys: Capture) -> None:
    assert refused(tree, name, capsys).endswith("already: take another name")


@pytest.mark.parametrize("taken", ["urbihw/platforms/toy/x", "fakes/urbihw_fakes/toy.py", "tests/platforms/toy_lab.py"])
def test_nothing_is_overwritten(tree: Path, taken: str, capsys: Capture) -> None:
    (tree / taken).parent.mkdir(exist_ok=True)
    (tree / taken).write_text("mine")
    assert "is there already" in refused(tree, "toy", capsys)


def test_a_package_overwrites_nothing(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "pyproject.toml").write_text("mine")
    assert main(("new-platform", "toy", "--package", str(tmp_path))) == 78
    assert "pyproject.toml is there already" in capsys.readouterr().err
    assert files(tmp_path) == [tmp_path / "pyproject.toml"]


@pytest.mark.parametrize(("name", "owner"), [("bioloid", "urbihw"), ("nao", "urbihw-nao")])
def test_the_name_of_another_platform(tmp_path: Path, name: str, owner: str, capsys: Capture) -> None:
    assert main(("new-platform", name, "--package", str(tmp_path / "mine"))) == 78
    assert capsys.readouterr().err == (
        f"urbihw new-platform: {owner} has a platform '{name}' already: take another name\n"
    )
    assert files(tmp_path) == []


def test_a_folder_that_is_no_clone(tmp_path: Path, capsys: Capture) -> None:
    assert "has no folder urbihw/platforms" in refused(tmp_path, "toy", capsys)


def test_a_tree_that_cannot_be_written(tree: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "write_text", fail)
    assert "cannot be written: Permission denied" in refused(tree, "toy", capsys)


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources, with platforms whose names are sorted and broken differently among the imports.

    What Python has compiled is copied, too, since compiling all takes 6 s; another process may be writing some of it.
    """
    folder = tmp_path_factory.mktemp("clone")
    for part in ("urbihw", "fakes", "packages", "tests", "docs", "bench"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("*.pyc.*"))
    for file in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / file, folder)
    for name in NAMES:
        assert main(("new-platform", name, "--folder", str(folder))) == 0
    return folder


def test_what_is_written_is_linted(clone: Path) -> None:
    done = subprocess.run(
        (sys.executable, "-m", "ruff", "check", "--no-cache", "."), cwd=clone, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout


def recipe() -> list[list[str]]:
    """The commands of CONTRIBUTING.md, with this Python, and without the comments."""
    _, _, chapter = (ROOT / "CONTRIBUTING.md").read_text("utf-8").partition(RECIPE)
    block = chapter.split("\n\n")[1]
    python = {".venv/bin/python": (sys.executable,), ".venv/bin/urbihw": (sys.executable, "-m", "urbihw.cli.main")}
    commands = [shlex.split(line) for line in block.splitlines()]
    return [[*python[command[0]], *command[1:]] for command in commands]


def test_the_recipe_is_what_is_tested_here() -> None:
    new, serve, test = recipe()
    assert new[-2:] == ["new-platform", NAMES[0]]
    assert serve[-4:] == ["serve", "--platform", NAMES[0], "--fake"]
    assert test[-6:] == ["pytest", "tests/platforms", "-k", NAMES[0], "-m", "not long"]


def in_clone(clone: Path) -> dict[str, str]:
    """The environment in which commands use the clone."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(clone), str(clone / "fakes"))), "URBIHW_SECONDS": "30"}


def test_the_skeleton_holds_every_contract_as_it_is(clone: Path) -> None:
    done = subprocess.run(
        (*recipe()[2], "-q", "-x", "-p", "no:cacheprovider"), cwd=clone, capture_output=True, text=True,
        env=in_clone(clone),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:]
    assert " passed" in done.stdout


def serve_a_wheel(command: Sequence[str], where: Path, environment: dict[str, str], folder: Path) -> None:
    """Serve the skeleton until its robot is there."""
    settings = folder / "urbihw.toml"
    settings.write_text(f'port = 0\nsocket = "{folder}/client.sock"\ncontrol = "{folder}/control.sock"\n')
    words = (*command, "--config", str(settings))
    with subprocess.Popen(words, cwd=where, env=environment, stderr=subprocess.PIPE) as daemon:
        try:
            assert daemon.stderr is not None
            line = next((line for line in daemon.stderr if b"1 wheel" in line), b"")
            assert line.startswith(b"urbihw: port ")
        finally:
            daemon.terminate()
            daemon.communicate(timeout=60)
    assert daemon.returncode == 0


@pytest.mark.e2e
def test_the_skeleton_is_served(clone: Path, tmp_path: Path) -> None:
    serve_a_wheel(recipe()[1], clone, in_clone(clone), tmp_path)


@pytest.mark.e2e
def test_the_skeleton_is_served_as_a_package_of_its_own(tmp_path: Path) -> None:
    install_outside(tmp_path / "site", "toy")
    serve_a_wheel(recipe()[1], tmp_path, {**os.environ, "PYTHONPATH": str(tmp_path / "site")}, tmp_path)
