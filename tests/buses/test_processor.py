"""How a bus worker is scheduled: in real time where that is allowed and bounded, else as far as it may."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.buses import processor
from urbihw.buses.processor import NICENESS, ORDINARY, REAL_TIME, OwnProcessor


class System:
    """What a worker asks of the system, in order; nothing of it is done."""

    def __init__(self, patch: pytest.MonkeyPatch, *refused: str, present: tuple[int, int] = (-1, -1)) -> None:
        self.asked: list[Any] = []

        def call(name: str) -> Callable[..., None]:
            def ask(*arguments: Any) -> None:
                if name in refused:
                    raise PermissionError(1, name)
                self.asked.append((name, *arguments))

            return ask

        patch.setattr(os, "sched_setscheduler", call("scheduler"))
        patch.setattr(os, "setpriority", call("priority"))
        patch.setattr(resource, "setrlimit", call("limit"))
        patch.setattr(resource, "getrlimit", lambda which: present)
        patch.setattr(signal, "signal", call("signal"))
        patch.setattr(processor, "_lock_memory", lambda: "lock" not in refused)

    @property
    def names(self) -> list[str]:
        return [row[0] for row in self.asked]


def claimed() -> str:
    own = OwnProcessor()
    own.claim()
    return own.scheduling


def test_a_run_is_bounded_before_real_time_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    system = System(monkeypatch)
    assert claimed() == f"{REAL_TIME}, memory locked"
    assert system.names == ["limit", "signal", "scheduler"]
    assert system.asked[0] == ("limit", resource.RLIMIT_RTTIME, (500_000, 2_000_000))


def test_a_lower_bound_of_the_system_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    system = System(monkeypatch, "lock", present=(300_000, 400_000))
    assert claimed() == REAL_TIME
    assert system.asked[0] == ("limit", resource.RLIMIT_RTTIME, (300_000, 400_000))


@pytest.mark.parametrize("refused", ["limit", "scheduler"])
def test_without_a_bound_or_the_right_there_is_no_real_time(monkeypatch: pytest.MonkeyPatch, refused: str) -> None:
    system = System(monkeypatch, refused)
    assert claimed() == f"with niceness {NICENESS}"
    assert "scheduler" not in system.names
    System(monkeypatch, refused, "priority")
    assert claimed() == ORDINARY


def test_the_signal_of_the_bound_gives_real_time_back(monkeypatch: pytest.MonkeyPatch) -> None:
    system = System(monkeypatch)
    own = OwnProcessor()
    own.claim()
    _, number, handler = system.asked[1]
    assert number == signal.SIGXCPU
    handler(number, None)
    assert system.asked[-1][:3] == ("scheduler", 0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK)
    assert own.scheduling.startswith(ORDINARY)


SPIN = """
import os, time
from urbihw.buses.processor import OwnProcessor
own = OwnProcessor()
own.claim()
own.held_up()
if os.getuid() == 0:
    os.setuid(65534)  # as in the unit, whose user may claim real time by a limit and has no right beyond that
print(own.scheduling)
begun = time.process_time()
while os.sched_getscheduler(0) & os.SCHED_RR and time.process_time() - begun < 1.5:
    pass
print(own.scheduling)
print(time.process_time() - begun < 1.2, own.held_up() >= 0)
"""


@pytest.mark.e2e
def test_one_that_computes_without_a_pause_loses_real_time_and_lives_on() -> None:
    done = subprocess.run((sys.executable, "-c", SPIN), capture_output=True, text=True, timeout=60, check=True)
    begun, ended, verdict = done.stdout.splitlines()
    if not begun.startswith(REAL_TIME):
        pytest.skip(f"no real time for this user here: {begun}")
    assert ended == f"{ORDINARY}: in real time it computed for 0.5 s without a pause"
    assert verdict == "True True"
