"""Random programs against a kernel: no failure of ours, no hang, no neighbour without an answer, nothing left behind.

Goes on for 10 seconds; ``URBIHW_FUZZ_SECONDS=3600 URBIHW_SEED=7 make fuzz`` for an hour, from another beginning.  What
fails is made as small as it can be and shown; the seed that is shown finds it again.
"""

from __future__ import annotations

import itertools
import os
import re
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from fuzz_programs import programs
from fuzz_trial import Trial
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.configuration import set_hypothesis_home_dir

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.code import Primitive
from urbihw.robot import ROBOT_LIBRARY

SECONDS = float(os.environ.get("URBIHW_FUZZ_SECONDS", "10"))
SEED = int(os.environ.get("URBIHW_SEED", "1"))
BATCH = 200
"""Programs from one seed."""


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    set_hypothesis_home_dir(tmp_path_factory.mktemp("hypothesis"))
    return Trial(tmp_path_factory.mktemp("fuzz"))


# The watchdog's signal handler deepens the stack for a moment, and Hypothesis may see that limit, or the one before.
@pytest.mark.filterwarnings("ignore:The recursion limit will not be reset")
def test_no_random_program_finds_a_fault(trial: Trial, capsys: pytest.CaptureFixture[str]) -> None:
    end = time.monotonic() + SECONDS
    played = 0
    failed = False

    def holds(program: str) -> None:
        nonlocal played, failed
        # Whatever failed once is played again, to make it small.
        if time.monotonic() > end and not failed:
            return
        played += 1
        found = trial.problems(program)
        failed = failed or bool(found)
        assert found == [], f"seed {number}:\n{program}"

    for number in itertools.count(SEED):
        if time.monotonic() > end:
            break
        batch = settings(
            max_examples=BATCH, deadline=None, database=None, report_multiple_bugs=False,
            suppress_health_check=list(HealthCheck), phases=(Phase.generate, Phase.shrink),
        )  # fmt: skip
        seed(number)(batch(given(programs())(holds)))()
    with capsys.disabled():
        print(f"\nfuzzer: {played} programs, seeds {SEED} to {number}")
    assert played > 0


HARMLESS = (
    "1 + 1; loop| {}, loop {}, at (true) {}; every (1s) 1, try { loop| {} } finally { loop| {} };",
    'var s = "x"|; loop| { s = s + s };',
    "function f() { f() & f() }; f();",
    "1 + ; )",
)


@pytest.mark.parametrize("program", HARMLESS)
def test_what_only_hurts_itself_is_no_fault(trial: Trial, program: str) -> None:
    assert trial.problems(program) == []


def _fail() -> None:
    raise AttributeError("'NoneType' object has no attribute 'x'")


def _complain() -> str:
    os.write(2, b"Traceback (most recent call last):")
    return "said"


FAULTY: dict[str, tuple[Callable[..., object], str]] = {
    "a failure of ours": (lambda this: _fail(), "answered: .*internal error"),
    "a hang": (lambda this: time.sleep(60), "hangs"),
    "a crash": (lambda this: os.kill(os.getpid(), signal.SIGSEGV), "the process ends: SIGSEGV"),
    "an end": (lambda this: os._exit(3), "the process ends: 3"),
    "a word on standard error": (lambda this: _complain(), "on standard error"),
}


@pytest.mark.parametrize("kind", FAULTY)
def test_a_fault_is_found(tmp_path: Path, kind: str) -> None:
    does, wanted = FAULTY[kind]
    kernel = Kernel(fast=True, libraries=(ROBOT_LIBRARY,))
    world = kernel.world
    world.global_.slots["fault"] = Primitive(world, "fault", does, 0, 0)
    world.flush()
    problems = Trial(tmp_path, kernel, patience=2.0).problems("1; fault();")
    assert re.search(wanted, "\n".join(problems), re.DOTALL)
