"""The entry points of the commands: Ctrl-C while Python still imports is no traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from urbihw.cli import entry
from urbihw.cli.entry import PIPE_CLOSED

SCRIPTS = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text())["project"]["scripts"]

INTERRUPTED = """
import sys
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from urbihw.cli.entry import {function}
sys.exit({function}())
"""


@pytest.mark.parametrize("script", SCRIPTS)
def test_ctrl_c_during_the_imports_ends_a_command_without_a_word(script: str) -> None:
    where, _, function = SCRIPTS[script].partition(":")
    assert where == "urbihw.cli.entry"
    program = INTERRUPTED.format(module=entry.MODULES[function], function=function)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_the_entry_points_import_nothing_that_takes_long() -> None:
    program = "import sys; import urbihw.cli.entry; print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert not {"argparse", "asyncio", "logging", "socket", "urbihw.cli.main", "urbihw.kernel"} & set(shown.split())


MAILS = {"email.message", "importlib.metadata"}
"""What `importlib.metadata` imports, and nothing else here needs."""
DAEMONS = {"asyncio", "urbihw.kernel", "urbihw.platforms", "logging", *MAILS}
UNIMPORTED = {
    ("--version",): DAEMONS,
    ("estop",): {"argparse", "dataclasses", "inspect", *DAEMONS},
    ("status",): DAEMONS - {"logging"},
    # This machine has no such address, so the start ends when the robot has been imported.
    ("serve", "--platform", "bioloid", "--fake", "--host", "192.0.2.1"): {
        *MAILS, "importlib.resources", "numpy", "lark", "zeroconf", "PIL",
    },
}  # fmt: skip
"""What a command must not import, as its start would take longer (`python -m bench.start --modules 20`)."""


@pytest.mark.parametrize("words", UNIMPORTED, ids=lambda words: words[0])
def test_a_command_imports_only_what_it_needs(words: tuple[str, ...], tmp_path: Path) -> None:
    program = (
        "import atexit, sys; atexit.register(lambda: print('modules:', *sys.modules))\n"
        "from urbihw.cli.entry import urbihw; urbihw()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=False,
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
    )  # fmt: skip
    shown = done.stdout.rpartition("modules:")[2].split()
    assert "urbihw.cli.entry" in shown, done.stderr
    assert "serve" not in words or "urbihw.platforms.bioloid.robot" in shown, done.stderr
    assert not UNIMPORTED[words] & set(shown)


def test_what_is_imported_at_the_start_is_left_out_of_collections() -> None:
    program = (
        "import gc; from urbihw.cli.program import program\n"
        "before = gc.get_freeze_count(); program('urbihw.cli.status')\n"
        "print(before, gc.get_freeze_count() > 10_000, gc.isenabled())"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "0 True True\n"


def test_an_entry_point_is_the_command() -> None:
    program = "import sys; sys.argv = ['urbi-ping', '--version']; from urbihw.cli.entry import urbi_ping; urbi_ping()"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("urbi-ping")


def test_a_pipe_that_is_closed_early_is_no_error(tmp_path: Path) -> None:
    files = [tmp_path / "a.json", tmp_path / "b.json"]
    joints: tuple[dict[str, int], ...] = ({f"joint{number}": number for number in range(250)}, {})
    for file, names in zip(files, joints, strict=True):
        rows = {
            name: {"id": number, "drive_mode": 0, "homing_offset": 0, "range_min": 1, "range_max": 9}
            for name, number in names.items()
        }
        file.write_text(json.dumps(rows))
    words = [sys.executable, "-m", "urbihw.cli.main", "calibrate", "--diff", *map(str, files)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == "" and process.wait(60) == PIPE_CLOSED
    process.stderr.close()
