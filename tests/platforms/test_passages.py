"""The bench of navigation, in short: narrow corridors and moved furniture, judged at the simulated body."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2]))

from bench.corridor import OFFSETS, TURNS, Corridor
from bench.hall import Hall, Home
from bench.passages import run_corridor, run_furniture
from bench.trial import Run, Trial


def drive_through(corridor: Corridor, folder: Path) -> Run:
    """Send a robot through a corridor."""
    return Trial(corridor, folder).drive(corridor.goals()[0])


@pytest.mark.parametrize(("width", "degrees"), [(0.55, 17.0), (0.6, 0.0)])
def test_a_robot_of_50_cm_goes_through_without_touching_the_walls(tmp_path: Path, width: float, degrees: float) -> None:
    run = drive_through(Corridor(width, 0.037, degrees), tmp_path)
    assert run.reached and run.contacts == 0
    assert run.seconds < 80


def test_a_corridor_as_narrow_as_the_robot_is_refused_at_once(tmp_path: Path) -> None:
    run = drive_through(Corridor(0.5, 0.037), tmp_path)
    assert not run.reached and run.way == 0
    assert run.seconds <= 0.2
    assert run.failure == "no way leads there that is 0.52 m wide, as this robot needs"


def test_furniture_that_was_moved_keeps_nobody_from_a_goal() -> None:
    (run,), helped = run_furniture(Home(2, boxes=0), 2, 1)
    assert run.reached and run.contacts == 0 and helped == 0
    assert max(run.errors) < 0.05


@pytest.mark.long
@pytest.mark.parametrize("degrees", TURNS)
@pytest.mark.parametrize("offset", OFFSETS)
def test_every_corridor_is_a_way_there_and_back(offset: float, degrees: float) -> None:
    runs = run_corridor(Corridor(0.55, offset, degrees))
    assert [each.reached for each in runs] == [True, True]
    assert sum(each.contacts for each in runs) == 0


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("kind", [Hall, Home])
def test_eight_goals_with_three_crates_moved_before_each(kind: type[Hall], seed: int) -> None:
    runs, helped = run_furniture(kind(seed, boxes=0), seed, 8)
    assert all(each.reached for each in runs) and helped == 0
    assert sum(each.contacts for each in runs) == 0
