"""Messages name commands as the user of this program can type them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from urbihw.started import as_typed


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with urbihw and urbi, which is not on the PATH."""
    for name in ("urbihw", "urbi"):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setitem(sys.modules, "__main__", ModuleType("__main__"))
    return tmp_path


@pytest.mark.parametrize("name", ["urbihw", "urbi"])
def test_a_file_of_an_environment_is_named_as_it_was_typed(
    programs: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(programs.parent)
    monkeypatch.setattr(sys, "argv", [f"{programs.name}/{name}", "serve"])
    assert as_typed("urbihw serve") == f"{programs.name}/urbihw serve"
    monkeypatch.setattr(sys, "argv", [f"{programs}/{name}"])
    assert as_typed("urbihw stop --direct") == f"{programs}/urbihw stop --direct"


def test_what_is_on_the_path_has_its_bare_name(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The shell puts the whole path into argv.
    monkeypatch.setattr(sys, "argv", [str(programs / "urbihw")])
    monkeypatch.setenv("PATH", os.pathsep.join(("/nowhere", str(programs))))
    assert as_typed("urbihw serve") == "urbihw serve"
    other = programs / "other"
    other.mkdir()
    (other / "urbihw").write_text("#!/bin/sh\n")
    (other / "urbihw").chmod(0o755)
    monkeypatch.setenv("PATH", os.pathsep.join((str(other), str(programs))))
    assert as_typed("urbihw serve") == f"{programs}/urbihw serve", "another one comes first"


def test_a_module_is_named_with_its_python(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    main = ModuleType("__main__")
    main.__spec__ = SimpleNamespace(name="urbihw.cli.main")  # type: ignore[assignment]
    monkeypatch.setitem(sys.modules, "__main__", main)
    monkeypatch.setattr(sys, "orig_argv", [".venv/bin/python", "-m", "urbihw.cli.main", "status"])
    monkeypatch.setattr(sys, "argv", ["/x/urbihw/cli/main.py", "status"])
    assert as_typed("urbihw serve") == ".venv/bin/python -m urbihw.cli.main serve"


def test_other_programs_say_urbihw(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["robot.py"])
    assert as_typed("urbihw serve") == "urbihw serve"
    monkeypatch.setattr(sys, "argv", [f"{programs}/a b/urbihw"])
    assert as_typed("urbihw serve") == f"'{programs}/a b/urbihw' serve"
