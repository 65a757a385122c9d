"""Each bench runs to its end and prints its last row; no figure is judged."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Final

import pytest

from bench import ROOT

pytestmark = pytest.mark.e2e

ALL: Final = sorted(path.stem for path in (ROOT / "bench").glob("[!_]*.py"))
TIMEOUT_S: Final = 300.0
QUICK: Final = {
    "client": r"60 slots at 50 Hz: .* \d+ lost",
    "nao": r"nao, .*: [\d.]+ pictures/s of .* sent \(asked 30\)|nao, libqi: its package is not there",
    "nxt": r"late ticks: \d+; processor: ",
    "p3dx": r"another thread is late by [\d.]+ ms",
    "recording": r"\d+ records read in ",
    "remote": r"a call of its function, frames +\d+ ",
    "segway": r"every core busy +usb +50 Hz +\d+ ",
    "spykee": r"camera, micro, speaker +[\d.]+%",
    "uobject": r"film by RTP, .*: [\d.]+ pictures a second",
}
"""Bench -> its last row."""
HEAVY: Final = {
    "backends": r"2\.0 1 silent +bare ",
    "dynamixel_cycle": r"(?s)protocol 2\.0\n.* 5 silent: ",
    "kernel_bench": r"pipelined 1; a second, all different +\d+ ",
    "start": r"urbihw serve +[\d.]+ s ",
    "stop": r"estop, beside loop\|\{\} +\S",
    "worlds": r"pioneer-wander, mode fast +[\d.]+ times real time",
}
"""The same of those that take three seconds of processor or more."""


def last_row(bench: str, row: str) -> None:
    done = subprocess.run(
        (sys.executable, "-m", f"bench.{bench}", "--quick"), cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert re.search(row, done.stdout), done.stdout[-2000:] + done.stderr[-2000:]


@pytest.mark.parametrize("bench", QUICK)
def test_a_bench_prints_its_last_row(bench: str) -> None:
    last_row(bench, QUICK[bench])


@pytest.mark.long
@pytest.mark.parametrize("bench", HEAVY)
def test_a_heavy_bench_prints_its_last_row(bench: str) -> None:
    last_row(bench, HEAVY[bench])


def test_every_bench_can_be_begun() -> None:
    """Imports all of them in a fresh process: under pytest they find modules that ``python -m bench.NAME`` does not."""
    program = f"import importlib\nfor name in {ALL}: importlib.import_module('bench.' + name)"
    done = subprocess.run((sys.executable, "-c", program), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_make_bench_runs_no_other() -> None:
    recipe = re.findall(r"-m bench\.(\w+)$", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    assert recipe
    assert {*recipe} <= {*QUICK, *HEAVY}
