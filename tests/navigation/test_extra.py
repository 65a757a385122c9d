"""With numpy and scipy and without them: the same distances and ways, and what is said of the rest."""

from __future__ import annotations

import math
import random
import re
from pathlib import Path

import pytest
from cart import Garage
from test_navigator import drive, name_map

from urbihw.extras import install_command
from urbihw.navigation import extra, grid, planner
from urbihw.navigation.frames import Point
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import Room, plan

ROOM = Room(0.2, 0.2)


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> None:
    """An installation without the extra."""

    def absent(name: str) -> None:
        return None

    monkeypatch.setattr(extra, "_load", absent)


def maze(seed: int) -> Grid:
    """A hall of 10 by 10 m with boxes."""
    draw = random.Random(seed)
    made = Grid(0, 0, 10, 10, 0.1)
    for _ in range(14):
        x, y = draw.uniform(1, 8), draw.uniform(1, 8)
        made.block_box(x, y, x + draw.uniform(0.2, 2), y + draw.uniform(0.2, 2))
    return made


def test_distances_are_exact() -> None:
    made = maze(1)
    blocked = [divmod(index, made.width) for index, cell in enumerate(made.blocked) if cell]
    for index in range(0, len(made.blocked), 997):
        row, column = divmod(index, made.width)
        nearest = min(math.hypot(row - r, column - c) for r, c in blocked) * made.cell
        assert made.distances()[index] == pytest.approx(nearest, abs=1e-6)


def test_a_grid_without_walls_has_them_nowhere() -> None:
    assert Grid(0, 0, 1, 1, 0.1).distance(0.5, 0.5) > 1e6


@pytest.mark.parametrize("seed", range(4))
def test_both_planners_find_ways_of_the_same_length(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = maze(seed)
    quick = length(plan(made, (0.3, 0.3), (9.7, 9.7), ROOM))
    monkeypatch.setattr(planner, "load_arrays", lambda: None)
    assert length(plan(made, (0.3, 0.3), (9.7, 9.7), ROOM)) == pytest.approx(quick, rel=0.08)


def length(path: list[Point]) -> float:
    """Length of a path."""
    return sum(math.dist(a, b) for a, b in zip(path, path[1:], strict=False))


@pytest.mark.usefixtures("without")
def test_the_small_planner_reaches_goals(tmp_path: Path) -> None:
    garage = Garage()
    assert name_map(garage, tmp_path) == []
    assert drive(garage, "[5, 1, 90deg]") == ["*** path 1"]


@pytest.mark.usefixtures("without")
def test_building_a_map_says_what_is_missing(tmp_path: Path) -> None:
    garage = Garage()
    garage.cart.scanner = Eyes()
    (line,) = garage.say("cart.planner.startMapping;")
    assert line.endswith("building a map needs numpy and scipy: " + install_command("navigation"))


def test_without_any_planner_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "load_arrays", lambda: None)
    monkeypatch.setattr(grid, "load_arrays", lambda: None)
    monkeypatch.setitem(__import__("sys").modules, "pathfinding.core.grid", None)
    with pytest.raises(planner.NoPath, match="needs numpy and scipy: " + re.escape(install_command("navigation"))):
        plan(maze(1), (0.3, 0.3), (9.7, 9.7), ROOM)


class Eyes:
    """A scanner that is on."""

    place = stamp = 0.0
    wanted = True

    def __init__(self) -> None:
        self.scanned = lambda: None

    def check_on(self) -> None:
        """It is."""

    def echoes(self) -> list[tuple[float, float]]:
        """None."""
        return []

    fresh_echoes = echoes

    def is_fresh(self) -> bool:
        """It is."""
        return True
