"""Which sabotages the tests notice: `python -m tests.mutants.run [NAME ...]`, before a release.

The tree is copied to a temporary folder.  There each sabotage of this folder is made in its turn, its tests run until
the first one fails, and the file is restored.  A sabotage that makes a test fail is dead.  First all tests run without
any sabotage: they must pass.  The exit code is 1 if more than one of twenty is alive, or if the tests fail without a
sabotage.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from .table import ROOT, Mutant, load, problems

PARTS: Final = ("urbihw", "fakes", "packages", "tests", "bench", "docs")
FILES: Final = ("pyproject.toml", "README.md", "CONTRIBUTING.md", "Makefile")
MAX_ALIVE: Final = 0.05
"""Share of the sabotages that may stay alive."""
TIMEOUT_S: Final = 180.0
"""Seconds for the tests of one sabotage; one that hangs them is dead."""
EVERYTHING_TIMEOUT_S: Final = 1800.0
PASSED, FAILED, HUNG = 0, 1, -1


def copy_tree(to: Path) -> None:
    """Copy the sources and their tests."""
    for part in PARTS:
        shutil.copytree(ROOT / part, to / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in FILES:
        shutil.copy(ROOT / file, to)


def run_tests(tree: Path, tests: Sequence[str], timeout: float) -> tuple[int, str]:
    """Run tests until the first one fails: the exit code of pytest, or ``HUNG``; and the last lines that it wrote."""
    paths = os.pathsep.join((str(tree), str(tree / "fakes"), str(tree / "packages/nao")))
    environment = {**os.environ, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(tree / "cache")}
    command = (sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests)
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, errors="replace", timeout=timeout
        )
    except subprocess.TimeoutExpired:
        return HUNG, f"not over after {timeout:g} s"
    return done.returncode, "\n".join(done.stdout.splitlines()[-15:])


def play(tree: Path, mutant: Mutant) -> tuple[int, str]:
    """Make a sabotage, run its tests, and restore the file."""
    file = tree / mutant.file
    source = file.read_text("utf-8")
    file.write_text(mutant.sabotaged(source), "utf-8")
    try:
        forget_compiled(file)
        return run_tests(tree, mutant.tests, TIMEOUT_S)
    finally:
        file.write_text(source, "utf-8")
        forget_compiled(file)


def forget_compiled(file: Path) -> None:
    """Remove the compiled form of a module: Python compares only seconds and sizes."""
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
        compiled.unlink()


def main() -> int:
    """Play the sabotages and print a line for each."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants.run", description=(__doc__ or "").partition(":")[0])
    parser.add_argument("name", nargs="*", help="only sabotages with one of these in their names, files or tests")
    wanted = parser.parse_args().name
    mutants = [each for each in load() if not wanted or any(word in str(each) for word in wanted)]
    wrong = [problem for mutant in mutants for problem in problems(mutant)]
    if wrong or not mutants:
        print("\n".join(wrong) or "no such sabotage")
        return 1
    with tempfile.TemporaryDirectory(prefix="urbihw-mutants-") as name:
        tree = Path(name)
        copy_tree(tree)
        tests = sorted({test for mutant in mutants for test in mutant.tests})
        code, last = run_tests(tree, tests, EVERYTHING_TIMEOUT_S)
        if code != PASSED:
            print(f"{last}\nthe tests fail without any sabotage: mend them first")
            return 1
        alive = 0
        for mutant in mutants:
            began = time.monotonic()
            code, last = play(tree, mutant)
            dead = code in (FAILED, HUNG)
            alive += not dead
            print(f"{'dead ' if dead else 'ALIVE'} {time.monotonic() - began:5.1f} s  {mutant.file}: {mutant.name}",
                  flush=True)  # fmt: skip
            if code not in (PASSED, FAILED):
                print(last)
    print(f"{len(mutants) - alive} of {len(mutants)} sabotages are dead")
    return 1 if alive > MAX_ALIVE * len(mutants) else 0


if __name__ == "__main__":
    sys.exit(main())
