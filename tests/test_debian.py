"""The Debian package: that it agrees with the project, and, when asked for, that it can be built.

URBIHW_BUILD_DEB=1 builds it (half a minute; needs the build dependencies of debian/control).
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from urbihw.cli.entry import MODULES
from urbihw.cli.main import COMMANDS
from urbihw.extras import _DEBIAN, DEBIAN_FOLDER, install_command

ROOT = Path(__file__).resolve().parents[1]
DEBIAN = ROOT / "debian"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
WHEELS = [tomllib.loads(path.read_text()) for path in sorted(ROOT.glob("packages/*/pyproject.toml"))]
CONTROL = (DEBIAN / "control").read_text()

NAMES = {"pyserial": "python3-serial", "lark": "python3-lark", "greenlet": "python3-greenlet", "pyusb": "python3-usb"}
"""Distribution of Python -> package of Debian."""


@pytest.fixture(scope="module")
def make_pages() -> ModuleType:
    pytest.importorskip("shtab")
    spec = importlib.util.spec_from_file_location("make_pages", DEBIAN / "make_pages.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def share(make_pages: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What make_pages.py writes."""
    folder = tmp_path_factory.mktemp("share")
    make_pages.main(folder)
    return folder


def field(name: str) -> str:
    """A field of the binary package, on one line."""
    found = re.search(rf"^{name}: (.*(?:\n .*)*)", CONTROL.partition("\nPackage: ")[2], re.MULTILINE)
    assert found is not None, name
    return " ".join(found[1].split())


def test_the_version_is_that_of_a_copy_without_git() -> None:
    version = re.match(r"urbihw \(([^)]+)\)", (DEBIAN / "changelog").read_text())
    assert version is not None
    for project in (PROJECT, *WHEELS):
        assert version[1] == project["tool"]["setuptools_scm"]["fallback_version"]


def test_the_wheels_beside_urbihw_are_in_the_package_and_need_nothing_else() -> None:
    rules = (DEBIAN / "rules").read_text()
    robots = [project for project in WHEELS if "urbihw.platforms" in project["project"].get("entry-points", {})]
    assert [project["project"]["name"] for project in robots] == ["urbihw-nao"]
    # The other one works in an environment with LeRobot, of which Debian has no package.
    assert {project["project"]["name"] for project in WHEELS} == {"urbihw-nao", "lerobot_robot_urbihw"}
    for step in ("build", "install", "clean"):
        assert f"dh_auto_{step} $(NAO_SOURCES)" in rules
    assert all(project["project"]["dependencies"] == ["urbihw"] for project in robots)


def test_the_dependencies_are_those_of_the_project_and_those_of_usb() -> None:
    wanted = [*PROJECT["project"]["dependencies"], *PROJECT["project"]["optional-dependencies"]["usb"]]
    rows = [re.match(r"([\w-]+)>=([\d.]+)", row) for row in wanted]
    expected = {f"{NAMES[row[1]]} (>= {row[2]})" for row in rows if row is not None}
    assert {each for each in field("Depends").split(", ") if each.startswith("python3-")} == expected


def test_what_the_advice_for_debian_names_is_recommended_or_suggested() -> None:
    named = {package for packages in _DEBIAN.values() for package in packages.split()}
    near = " ".join(map(field, ("Depends", "Recommends", "Suggests")))
    assert {package for package in named if package not in near} == set()
    assert _DEBIAN.keys() <= PROJECT["project"]["optional-dependencies"].keys()


def test_every_command_has_a_manual_page(share: Path) -> None:
    pages = {path.name for path in (share / "man").iterdir()}
    programs = set(PROJECT["project"]["scripts"])
    assert pages == {f"{name}.1" for name in programs} | {f"urbihw-{command}.1" for command in COMMANDS}
    assert len(programs) == len(MODULES)


def test_a_page_has_every_option_and_a_line_for_whatis(make_pages: ModuleType, share: Path) -> None:
    for parser in make_pages.parsers():
        for each in (parser, *(below for below, _ in make_pages.commands(parser).values())):
            text = (share / "man" / f"{each.prog.replace(' ', '-')}.1").read_text()
            assert re.search(rf"^\.SH NAME\n{each.prog.replace(' ', '-')} \\- \S", text, re.MULTILINE)
            words = text.replace("\\-", "-")
            missing = [name for action in each._actions for name in action.option_strings if name not in words]
            assert missing == []


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
def test_man_reads_the_pages_without_a_warning(share: Path) -> None:
    for page in sorted((share / "man").iterdir()):
        done = subprocess.run(("man", "--warnings", "-l", str(page)), capture_output=True, text=True, check=False,
                              env={"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8", "MANWIDTH": "80"})
        assert (done.returncode, done.stderr) == (0, ""), page.name


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_the_completion_is_a_program_of_its_shell(shell: str, share: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    folder = share / ("bash-completion/completions" if shell == "bash" else "zsh/vendor-completions")
    files = sorted(folder.iterdir())
    assert len(files) == len(MODULES)
    for file in files:
        assert subprocess.run((shell, "-n", str(file)), capture_output=True, check=False).returncode == 0, file.name


def test_bash_completes_a_command_and_an_option(share: Path) -> None:
    file = share / "bash-completion" / "completions" / "urbihw"
    script = (
        f"source '{file}'; for words in 'urbihw install-s' 'urbihw serve --plat'; do COMP_WORDS=($words);"
        'COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=(); _shtab_urbihw; echo "${COMPREPLY[@]}"; done'
    )
    done = subprocess.run(("bash", "-c", script), capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["install-service", "--platform"]


@pytest.mark.parametrize(
    ("extras", "folder", "files", "command"),
    [
        (("console",), DEBIAN_FOLDER, (), "sudo apt install python3-prompt-toolkit python3-pygments"),
        (("can",), DEBIAN_FOLDER, (), "Debian has no packages for can: install urbihw in an environment of its own "
                                      "(docs/operations.md)"),
        (("usb",), "/x", ("pipx_metadata.json",), "pipx inject urbihw 'pyusb<2,>=1.2.1'"),
        (("usb", "planner"), "/x", (), "{prefix}/bin/pip install 'pyusb<2,>=1.2.1' 'pathfinding<2,>=1.0.9'"),
    ],
)  # fmt: skip
def test_the_advice_to_install_an_extra_names_packages_that_can_be_found(
    extras: tuple[str, ...], folder: str, files: tuple[str, ...], command: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    rows = ['pyusb (<2,>=1.2.1) ; extra == "usb"', 'pathfinding<2,>=1.0.9 ; extra == "planner"', "lark>=1.1.5,<2"]
    monkeypatch.setattr("importlib.metadata.requires", lambda name: rows)
    for file in files:
        (tmp_path / file).touch()
    told = install_command(*extras, folder=Path(folder, "urbihw"), prefix=tmp_path)
    assert told == command.format(prefix=tmp_path)


@pytest.mark.skipif(not os.environ.get("URBIHW_BUILD_DEB"), reason="takes half a minute: URBIHW_BUILD_DEB=1")
@pytest.mark.skipif(shutil.which("dh_python3") is None or shutil.which("dpkg-buildpackage") is None,
                    reason="dpkg-buildpackage and dh-python are not installed")
def test_the_package_is_built_and_lintian_finds_nothing(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    left_out = shutil.ignore_patterns(".*", "build", "dist", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, tree, ignore=left_out, symlinks=True)
    environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": str(tmp_path), "LC_ALL": "C.UTF-8"}
    done = subprocess.run(("make", "deb"), cwd=tree, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (package,) = (tree / "build" / "deb").glob("urbihw_*.deb")
    listed = subprocess.run(("dpkg-deb", "-c", str(package)), capture_output=True, text=True, check=True).stdout
    for path in ("bin/urbihw", "urbihw/share/urbihw.toml", "system/urbihw@.service", "sysusers.d/urbihw.conf",
                 "man1/urbihw-serve.1.gz", "zsh/vendor-completions/_urbihw", "urbihw_fakes/__main__.py",
                 "urbihw_nao/platform.toml"):
        assert path in listed
    if shutil.which("lintian"):
        found = subprocess.run(("lintian", "--allow-root", str(package)), capture_output=True, text=True, check=False)
        assert re.findall("^[EW]: .*", found.stdout, re.MULTILINE) == []
