"""A robot that was carried somewhere finds itself by a particle filter."""

from __future__ import annotations

import math

import pytest

from urbihw.navigation.frames import Pose, moved, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import CELL
from urbihw.navigation.montecarlo import ParticleFilter
from urbihw_fakes.p3dx.world import World, box

PLACE = 0.02


def walls_of(world: World) -> Grid:
    """Its walls as the grid to which scans are matched."""
    grid = Grid(-2, -3, 6, 3, CELL)
    for wall in world.walls:
        grid.block_line(*wall)
    return grid


def scan(world: World, pose: Pose) -> list[tuple[float, float]]:
    """What a laser sees there."""
    x, y, heading = pose
    lx, ly = x + PLACE * math.cos(heading), y + PLACE * math.sin(heading)
    angles = [math.radians(degrees) for degrees in range(-90, 91, 2)]
    return [(world.ray(lx, ly, heading + angle, 30), angle) for angle in angles]


def search(world: World, truth: Pose, steps: int, way: float = 0.0, turn: float = 0.2) -> tuple[Pose | None, Pose]:
    """Where the filter believes a robot to be that moves by some steps, and where it is then; wheels slip by 3 %."""
    particles = ParticleFilter(walls_of(world))
    odometric = (0.0, 0.0, 0.0)
    for _ in range(steps):
        if found := particles.add_scan(odometric, scan(world, truth), PLACE):
            return found, truth
        truth, odometric = moved(truth, way, turn), moved(odometric, way * 1.03, turn * 1.03)
    return None, truth


@pytest.mark.parametrize("truth", [(4.5, -1.5, 2.0), (-1.0, 2.0, -0.5), (0.0, -2.4, 1.0), (5.0, 2.0, -2.5)])
def test_a_carried_robot_that_turns_finds_itself(truth: Pose) -> None:
    found, there = search(World.room(), truth, 40)
    assert found is not None
    assert math.dist(found[:2], there[:2]) < 0.06
    assert abs(wrapped(found[2] - there[2])) < 0.02


def test_a_box_that_the_map_does_not_show_does_not_hinder() -> None:
    shown, real = World.room(), World.room()
    real.walls += box(3.9, -1.3, 4.3, -0.9)
    particles = ParticleFilter(walls_of(shown))
    truth, odometric = (4.8, -1.5, 2.6), (0.0, 0.0, 0.0)
    found = None
    for _ in range(40):
        found = particles.add_scan(odometric, scan(real, truth), PLACE)
        if found:
            break
        truth, odometric = moved(truth, 0.0, 0.2), moved(odometric, 0.0, 0.2)
    assert found is not None and math.dist(found[:2], truth[:2]) < 0.08


def test_two_equal_places_are_not_told_apart_by_standing_still() -> None:
    # An empty room looks the same after half a turn.
    room = World([*box(-2, -3, 6, 3)])
    found, _ = search(room, (0.0, 0.5, 0.3), 30, turn=0.0)
    assert found is None


def test_a_scan_without_echoes_says_nothing() -> None:
    assert ParticleFilter(walls_of(World.room())).add_scan((0.0, 0.0, 0.0), [], PLACE) is None


ALIKE = [*box(-2, -3, 6, 3), (2.0, -3.0, 2.0, -0.6), (2.0, 0.6, 2.0, 3.0)]
"""Two rooms of the same size with a door between them; a place in one is a place in the other after half a turn."""


@pytest.mark.parametrize("heading", [0.3, 1.2, 2.0, -1.0, -2.5])
def test_of_two_rooms_that_look_alike_none_is_chosen(heading: float) -> None:
    particles = ParticleFilter(walls_of(World(ALIKE)))
    truth, odometric = (-0.5, -1.5, heading), (0.0, 0.0, 0.0)
    for _ in range(60):
        assert particles.add_scan(odometric, scan(World(ALIKE), truth), PLACE) is None
        truth, odometric = moved(truth, 0.0, 0.2), moved(odometric, 0.0, 0.2)
    assert particles.is_ambiguous


def test_a_crate_in_one_of_them_tells_them_apart_once_it_is_seen() -> None:
    world = World([*ALIKE, *box(4.4, 1.5, 5.2, 2.3)])
    found, there = search(world, (4.5, -1.5, 0.0), 60)
    assert found is not None and math.dist(found[:2], there[:2]) < 0.08
