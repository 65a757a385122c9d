"""Maps built of scans: the poses that scan matching finds, the grid, and its files."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from test_montecarlo import PLACE, scan

from urbihw.navigation import maps
from urbihw.navigation.frames import Pose, moved, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.mapping import MapBuilder
from urbihw_fakes.p3dx.world import World

START: Pose = (0.0, 0.0, 0.0)
TOUR = [(0.1, 0.0)] * 15 + [(0.0, 0.1)] * 16 + [(0.1, 0.0)] * 10 + [(0.05, 0.1)] * 30
SLIP = 0.92


def drive(builder: MapBuilder, world: World) -> tuple[Pose, Pose, Pose]:
    """A tour with wheels that slip by 8 %: where the robot is, where the map and where the wheels say it is."""
    truth = mapped = wheels = START
    builder.add_scan(START, scan(world, START), PLACE)
    for way, turn in TOUR:
        truth = moved(truth, way * SLIP, turn * SLIP)
        wheels = moved(wheels, way, turn)
        mapped = builder.add_scan(moved(mapped, way, turn), scan(world, truth), PLACE)
    return truth, mapped, wheels


def test_scan_matching_takes_the_slip_out() -> None:
    truth, mapped, wheels = drive(MapBuilder(START), World.room())
    assert math.dist(truth[:2], wheels[:2]) > 0.15
    assert math.dist(truth[:2], mapped[:2]) < 0.05
    assert abs(wrapped(truth[2] - mapped[2])) < 0.02


def test_the_map_has_the_walls_and_is_free_between_them(tmp_path: Path) -> None:
    builder = MapBuilder(START)
    drive(builder, World.room())
    builder.save(str(tmp_path / "room.yaml"))
    found = maps.read(str(tmp_path / "room.yaml"))
    assert found.home == pytest.approx(START)
    assert found.bounds == pytest.approx((-2, -3, 6, 3), abs=0.15)
    grid = Grid.of(found, 0.05)
    # The left wall, the one with the door, the crate's upper side; and the door.
    assert grid.distance(-2.0, 1.0) < 0.08 and grid.distance(3.0, -1.0) < 0.08 and grid.distance(0.75, -1.5) < 0.08
    assert grid.distance(3.0, 1.5) > 0.5


def test_what_was_not_seen_is_not_free(tmp_path: Path) -> None:
    builder = MapBuilder(START)
    for _ in range(3):
        builder.add_scan(START, scan(World.room(), START), PLACE)
    builder.save(str(tmp_path / "room"))
    grid = Grid.of(maps.read(str(tmp_path / "room.yaml")), 0.05)
    # Behind the wall, and beside the door.
    assert grid.distance(3.3, -2.0) == 0
    assert grid.distance(0.5, 0.0) > 0.3


def test_a_scan_without_echoes_changes_nothing(tmp_path: Path) -> None:
    builder = MapBuilder(START)
    assert builder.add_scan((1.0, 2.0, 0.5), [], PLACE) == (1.0, 2.0, 0.5)
    builder.save(str(tmp_path / "empty"))
    assert maps.read(str(tmp_path / "empty.yaml")).home == START
