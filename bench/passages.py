"""Moved furniture and narrow corridors, for the bench of navigation: the same robot as there, in simulated time."""

from __future__ import annotations

import math
import random
import statistics
import tempfile
from pathlib import Path

from bench.corridor import OFFSETS, TURNS, WIDTHS, Corridor
from bench.hall import Hall, Home
from bench.trial import FREE, Run, Trial, row, shortest_way
from urbihw.navigation.frames import Pose
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import NoPath

MOVED_CRATES = 3
"""Crates of ten that are moved before each goal."""
TRIES = 100
"""Random goals that are tried before crates are moved again."""
NEEDED = 0.7
"""m that the way to a goal is wide at its narrowest place."""
TOO_NARROW = (0.48, 0.5)
"""m: corridors through which the robot cannot go."""


def run_furniture(hall: Hall, seed: int, goals: int) -> tuple[list[Run], int]:
    """Send a robot to goals in a place, of which some crates are moved before each goal: what came of each, and how
    often it was lost and had to be turned by hand."""
    draw = random.Random(seed + 1)
    shown = Grid(0, 0, *hall.size, 0.1)
    for wall in hall.shown:
        shown.block_line(*wall)
    runs: list[Run] = []
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(hall, Path(folder))
        while len(runs) < goals:
            goal = None
            while goal is None:
                hall.move_crates(MOVED_CRATES, trial.lab.where()[:2])
                goal = _goal(hall, shown, draw, trial.lab.where())
            if trial.lab.look("P3dx.planner.ready") != "true":
                trial.helped += 1
                _, seconds = trial.turn_until_found(noticed=True)
                print(f"    lost: turned by hand, found after {seconds:.1f} s", flush=True)
            runs.append(trial.drive(goal))
            print(f"seed {seed}", row(len(runs), runs[-1]), runs[-1].failure, flush=True)
    return runs, trial.helped


def _goal(hall: Hall, shown: Grid, draw: random.Random, at: Pose) -> Pose | None:
    """A random place that is free on the map and in the hall, and to which a way leads; None if none is found."""
    start = at[0], at[1]
    for _ in range(TRIES):
        goal = draw.uniform(0.5, hall.size[0] - 0.5), draw.uniform(0.5, hall.size[1] - 0.5)
        if min(hall.grid.distance(*goal), shown.distance(*goal)) < FREE or math.dist(goal, start) < hall.way:
            continue
        try:
            shortest_way(hall.grid, start, goal, (NEEDED / 2,))
        except NoPath:
            continue
        return (*goal, draw.uniform(-math.pi, math.pi))
    return None


def run_corridor(corridor: Corridor) -> list[Run]:
    """Send a robot through a corridor and back."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(corridor, Path(folder))
        return [trial.drive(goal) for goal in corridor.goals()]


def furniture_rows(seeds: int, goals: int) -> list[tuple[str, str]]:
    """Rows for the table: moved crates in a hall and in a home."""
    rows = []
    for kind, what in ((Hall, "hall, 3 of 10 crates moved"), (Home, "home, 3 of 10 pieces of furniture moved")):
        runs, helped = [], 0
        for seed in range(1, seeds + 1):
            some, times = run_furniture(kind(seed, boxes=0), seed, goals)
            runs += some
            helped += times
        errors = [metres * 100 for each in runs for metres in each.errors]
        rows += [
            (f"{what} before each goal: reached", f"{sum(each.reached for each in runs)} of {len(runs)}"),
            ("lost on the way, contacts", f"{helped}, {sum(each.contacts for each in runs)}"),
            ("pose from the true one, median and largest", f"{statistics.median(errors):.1f}, {max(errors):.1f} cm"),
            ("seconds for a goal, longest", f"{max(each.seconds for each in runs):.0f}"),
        ]
    return rows


def corridor_rows() -> list[tuple[str, str]]:
    """Rows for the table: corridors, each there and back, the narrowest one also slanting to the grid."""
    rows = []
    for width in (*TOO_NARROW, *WIDTHS):
        runs = []
        for degrees in TURNS if width == min(WIDTHS) else TURNS[:1]:
            for offset in OFFSETS:
                some = run_corridor(Corridor(width, offset, degrees))
                runs += some[:1] if width in TOO_NARROW else some
                for number, run in enumerate(some):
                    place = f"{width:.2f} m, {offset:.3f} m off, {degrees:2.0f} deg:"
                    print(place, row(number, run), run.failure, flush=True)
        rows.append((
            f"corridor of {width:.2f} m: ways through it, contacts, longest",
            f"{sum(each.reached for each in runs)} of {len(runs)}, {sum(each.contacts for each in runs)}, "
            f"{max(each.seconds for each in runs):.0f} s",
        ))  # fmt: skip
    return rows
