"""No body moves without a statement, or faster than told: random programs, random faults, all platforms.

Two clients say random programs (``random_programs``); every few seconds something befalls the robot (``random_fate``).
What is checked at each tick of simulated time: ``random_trial``.  `make test` lets each robot live for a minute, `make
long` for an hour, `python -m bench.random_faults` prints a table of the hour.

    URBIHW_SEED     the seed, 1 if not said, so that each run is the same; printed, and told by a failure
    URBIHW_SECONDS  simulated seconds for each platform in `make test`
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from random_fate import live
from random_trial import SEED

from urbihw.buses import setpoints
from urbihw.platforms import folders

SECONDS = float(os.environ.get("URBIHW_SECONDS", "60"))
HOUR = 3600.0
PLATFORMS = [folder.name for folder in folders()]


def _live(platform: str, seconds: float, folder: Path) -> None:
    print(f"URBIHW_SEED={SEED}, {seconds:g} s")
    trial = live(platform, seconds, SEED, folder)
    quiet = trial.quiet_share(seconds)
    print(f"{platform}: stood after {trial.slowest_rest:.2f} s at most, {quiet:.0%} of the time nobody asked")
    assert seconds < 30 or (trial.way > 1.0 and quiet > 0.05), "this has shown nothing"


@pytest.mark.parametrize("platform", PLATFORMS)
def test_nothing_moves_that_no_live_statement_asked_for(platform: str, tmp_path: Path) -> None:
    _live(platform, SECONDS, tmp_path)


def _leap(given: float, asked: float, far: float, bounds: object) -> float:
    return asked


@pytest.mark.parametrize("guard", ["the way of a tick", "the goals that are led"])
def test_a_robot_without_one_of_its_guards_is_found_out(
    guard: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if guard == "the way of a tick":
        monkeypatch.setattr(setpoints, "_step", _leap)
    else:
        monkeypatch.setattr(setpoints.SetPoints, "led_goals", lambda *_, **__: {})
    with pytest.raises(pytest.fail.Exception, match="part . "):
        live("chain", 300.0, 1, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("platform", PLATFORMS)
def test_the_same_for_an_hour(platform: str, tmp_path: Path) -> None:
    _live(platform, HOUR, tmp_path)
