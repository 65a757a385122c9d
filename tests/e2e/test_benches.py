"""Every bench can be begun: its modules are found without pytest, too."""

from __future__ import annotations

import subprocess
import sys

import pytest

from bench import ROOT

pytestmark = pytest.mark.e2e
BENCHES = sorted(path.stem for path in (ROOT / "bench").glob("[!_]*.py"))


def test_every_bench_can_be_begun() -> None:
    """Imports all of them in a fresh process, as ``python -m bench.NAME`` would."""
    program = f"import importlib\nfor name in {BENCHES}: importlib.import_module('bench.' + name)"
    done = subprocess.run((sys.executable, "-c", program), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
