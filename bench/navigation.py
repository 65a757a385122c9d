"""How well a base finds its goals: `python -m bench.navigation [--goals 20] [--picture FILE.svg] [--write]`.

A simulated Pioneer (its controller and its laser, each on a wire with its own worker) drives to random goals on a map of
20 by 20 m with walls, doors and crates, in which boxes move that the map does not show.  A box stops before a robot, as
a person would; it never leaves a robot more room.  All of it runs in simulated time, and everything but the time to plan
is exact and the same each time.  Measured at the body of the robot, not by its odometry: its distance from the goal, the
length of its way, and each contact with a wall or a box.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import sys
import tempfile
import time
from ast import literal_eval
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "platforms"))

from p3dx_lab import Lab  # noqa: E402

from urbihw.navigation import navigator  # noqa: E402
from urbihw.navigation.drawing import Drawing  # noqa: E402
from urbihw.navigation.extra import load_arrays  # noqa: E402
from urbihw.navigation.frames import Point, Pose, wrapped  # noqa: E402
from urbihw.navigation.grid import Grid  # noqa: E402
from urbihw.navigation.planner import NoPath, plan  # noqa: E402
from urbihw_fakes.p3dx.body import RADIUS  # noqa: E402
from urbihw_fakes.p3dx.kit import P3dx as Kit  # noqa: E402
from urbihw_fakes.p3dx.world import Wall, World, box  # noqa: E402

SIZE = 20.0
CRATES, BOXES = 10, 8
CRATE, BOX = 0.6, 0.5
BOX_SPEED = 0.3
BOX_STEP_S = 0.1
RESPECT = RADIUS + BOX * 0.71 + 0.25
"""m from the middle of a robot at which a box stops."""
SLIP = 0.02
MIN_WAY = 5.0
"""m; goals are at least that far from where the robot is."""
FREE = 0.6
"""m between a goal and the walls."""
TIMEOUT_S = 600.0

DOORS: tuple[Wall, ...] = (
    (7, 0, 7, 5), (7, 6.5, 7, 14), (7, 15.5, 7, 20), (13, 0, 13, 3), (13, 4.5, 13, 11), (13, 12.5, 13, 20),
    (0, 10, 3, 10), (4.5, 10, 7, 10), (13, 9, 16, 9), (17.5, 9, 20, 9),
)  # fmt: skip
START: Pose = (2.0, 2.0, 0.0)


class Hall:
    """The hall: walls and crates as the map shows them, and boxes that move."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.shown: list[Wall] = [*box(0, 0, SIZE, SIZE), *DOORS]
        self._draw()
        for _ in range(CRATES):
            x, y = self.place(1.3)
            half = CRATE / 2
            self.shown += box(x - half, y - half, x + half, y + half)
            self._draw()
        self.world = World(list(self.shown), START)
        self.boxes = [Box(self, self.place(0.8)) for _ in range(BOXES)]

    def _draw(self) -> None:
        self.grid = Grid(0, 0, SIZE, SIZE, 0.1)
        for wall in self.shown:
            self.grid.block_line(*wall)

    def place(self, free: float) -> Point:
        """A random place at some distance from all that the map shows, and from the start."""
        while True:
            at = self.random.uniform(0.5, SIZE - 0.5), self.random.uniform(0.5, SIZE - 0.5)
            if self.grid.distance(*at) >= free and math.dist(at, START[:2]) > 1.5:
                return at

    def is_clear(self, a: Point, b: Point, free: float) -> bool:
        """Whether a straight line keeps some distance from all that the map shows."""
        shares = [step / 40 for step in range(41)]
        return all(self.grid.distance(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s) >= free for s in shares)

    def move_boxes(self, robot: Point) -> None:
        """One step of all boxes."""
        walls = list(self.shown)
        for each in self.boxes:
            each.step(robot)
            walls += each.walls()
        self.world.walls[:] = walls


class Box:
    """A box that goes from place to place, and rests at each."""

    def __init__(self, hall: Hall, at: Point) -> None:
        self.at = at
        self._hall = hall
        self._goal = at
        self._rests = 0.0

    def walls(self) -> list[Wall]:
        """Its four sides."""
        (x, y), half = self.at, BOX / 2
        return box(x - half, y - half, x + half, y + half)

    def step(self, robot: Point) -> None:
        """Move on, unless a robot is near."""
        if self._rests > 0:
            self._rests -= BOX_STEP_S
            return
        left = math.dist(self.at, self._goal)
        way = BOX_SPEED * BOX_STEP_S
        if left <= way:
            draw = self._hall.random
            goal = (self.at[0] + draw.uniform(-4, 4), self.at[1] + draw.uniform(-4, 4))
            if self._hall.is_clear(self.at, goal, 0.45):
                self._goal, self._rests = goal, draw.uniform(1, 10)
            return
        share = way / left
        to = (self.at[0] + (self._goal[0] - self.at[0]) * share, self.at[1] + (self._goal[1] - self.at[1]) * share)
        if math.dist(to, robot) > max(RESPECT, min(math.dist(self.at, robot), RESPECT)):
            self.at = to


@dataclass
class Run:
    """One goal: what came of it."""

    goal: Pose
    start: Pose
    reached: bool = False
    metres: float = math.nan
    degrees: float = math.nan
    seconds: float = 0.0
    way: float = 0.0
    shortest: float = 0.0
    contacts: int = 0
    plans: list[float] = field(default_factory=list)
    trail: list[Point] = field(default_factory=list)
    path: list[Point] = field(default_factory=list)
    said: str = ""


class Trial:
    """A robot in the hall, on its map."""

    def __init__(self, hall: Hall, folder: Path) -> None:
        self.hall = hall
        self.plans: list[float] = []
        self._time_plans()
        self.lab = Lab.ready(Kit(hall.world, slip=SLIP), localization="scan")
        self.lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1;", 2)
        self.lab.say('at (P3dx.planner.pathPlanningEvent?(var how)) echo("path %s" % how);')
        self.lab.say('at (P3dx.planner.locFailureEvent?(var why)) echo("lost");')
        self.lab.say(f'P3dx.planner.mapFileName = "{self.lab.write_map(folder)}";')
        while self.lab.look("P3dx.planner.ready") != "true":
            self.lab.thought()
            self.lab.run(0.2)

    def _time_plans(self) -> None:
        planned = navigator.plan_around

        def timed(*arguments: Any) -> list[Point]:
            start = time.perf_counter()
            try:
                return planned(*arguments)
            finally:
                self.plans.append(time.perf_counter() - start)

        navigator.plan_around = timed

    def drive(self, goal: Pose) -> Run:
        """Send the robot to a goal."""
        lab, hall = self.lab, self.hall
        x, y, heading = lab.where()
        run = Run(goal, (x, y, heading), trail=[(x, y)])
        run.shortest = shortest_way(hall.grid, (x, y), goal[:2])
        self.plans.clear()
        lab.kernel.feed(lab.lobby, f"P3dx.moveTo([{goal[0]}, {goal[1]}, {goal[2]}]);".encode())
        begun, touches = lab.clock.now(), False
        while "path" not in run.said and lab.clock.now() - begun < TIMEOUT_S:
            hall.move_boxes(lab.where()[:2])
            lab.run(BOX_STEP_S)
            lab.thought()
            run.said += lab.heard()
            if not run.path and lab.look("P3dx.planner.path") != "[]":
                run.path = [(a, b) for a, b in literal_eval(lab.look("P3dx.planner.path"))]
            at = lab.where()[:2]
            run.way += math.dist(run.trail[-1], at)
            run.trail.append(at)
            contact = hall.world.nearest(*at)[0] < RADIUS + 1e-3
            run.contacts += contact and not touches
            touches = contact
        run.seconds, run.plans = lab.clock.now() - begun, list(self.plans)
        lab.run(1.0)
        x, y, heading = lab.where()
        run.reached = run.said.endswith("path 1")
        run.metres, run.degrees = math.dist((x, y), goal[:2]), math.degrees(abs(wrapped(heading - goal[2])))
        return run


def shortest_way(grid: Grid, start: Point, goal: Point) -> float:
    """Length in m of the shortest way of a point-like path that keeps the body of the robot from what the map shows."""
    return min(path_length(plan(grid, start, goal, free)) for free in (RADIUS, RADIUS + 0.05, RADIUS + 0.1))


def path_length(path: Sequence[Point]) -> float:
    """Its length in m."""
    return sum(math.dist(a, b) for a, b in zip(path, path[1:], strict=False))


def run_trial(goals: int, seed: int) -> tuple[Hall, list[Run], Trial]:
    """Send a robot to random goals."""
    hall = Hall(seed)
    draw = random.Random(seed + 1)
    runs: list[Run] = []
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(hall, Path(folder))
        while len(runs) < goals:
            at = draw.uniform(0.7, SIZE - 0.7), draw.uniform(0.7, SIZE - 0.7)
            if hall.grid.distance(*at) < FREE or math.dist(at, trial.lab.where()[:2]) < MIN_WAY:
                continue
            try:
                run = trial.drive((*at, draw.uniform(-math.pi, math.pi)))
            except NoPath:
                continue
            runs.append(run)
            print(row(len(runs), run), flush=True)
    return hall, runs, trial


def row(number: int, run: Run) -> str:
    """A line of the protocol."""
    return (
        f"{number:3d} ({run.goal[0]:5.2f}, {run.goal[1]:5.2f}) {'reached' if run.reached else run.said!r:8s} "
        f"{run.metres * 100:5.1f} cm {run.degrees:4.1f} deg {run.way:5.1f} m of {run.shortest:5.1f} m {run.seconds:4.0f} s "
        f"{run.contacts} contacts {len(run.plans)} plans, longest {max(run.plans, default=0) * 1000:.0f} ms"
    )


def table(runs: Sequence[Run]) -> str:
    """The table of docs/navigation.md."""
    metres, degrees = [each.metres * 100 for each in runs], [each.degrees for each in runs]
    longer = [(each.way / each.shortest - 1) * 100 for each in runs]
    plans = [seconds * 1000 for each in runs for seconds in each.plans]
    rows = [
        ("goals reached", f"{sum(each.reached for each in runs)} of {len(runs)}"),
        ("contacts with walls or boxes", f"{sum(each.contacts for each in runs)}"),
        ("distance from the goal, median and largest", f"{statistics.median(metres):.1f} cm, {max(metres):.1f} cm"),
        ("heading beside the goal's, median and largest", f"{statistics.median(degrees):.1f}, {max(degrees):.1f} degrees"),
        ("way against the shortest, median and largest", f"{statistics.median(longer):+.0f} %, {max(longer):+.0f} %"),
        ("way in all", f"{sum(each.way for each in runs):.0f} m in {sum(each.seconds for each in runs):.0f} s"),
        ("plans in all", f"{len(plans)}"),
        ("time to plan, median and longest", f"{statistics.median(plans):.0f} ms, {max(plans):.0f} ms"),
    ]
    return "\n".join(["| what | measured |", "|---|---|", *(f"| {what} | {value} |" for what, value in rows)])


def picture(hall: Hall, run: Run) -> str:
    """The map, the boxes, the path first planned, the way driven and the pose at its end."""
    drawing = Drawing((0, 0, SIZE, SIZE))
    for wall in hall.shown:
        drawing.add_line([wall[:2], wall[2:]], "wall")
    for each in hall.boxes:
        (x, y), half = each.at, BOX / 2
        drawing.add_box((x - half, y - half, x + half, y + half), "seen")
    drawing.add_line(run.path, "path")
    drawing.add_line(run.trail, "trail")
    drawing.add_pose(run.goal, RADIUS, "goal")
    return drawing.text()


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--write", action="store_true", help="put the table and the picture into docs/")
    options = parser.parse_args()
    print(f"extra navigation (numpy, scipy): {'yes' if load_arrays() else 'no'}")
    hall, runs, _ = run_trial(options.goals, options.seed)
    text = table(runs)
    print(text)
    target = ROOT / "docs" / "pictures" / "navigation.svg" if options.write else options.picture
    if target is not None:
        target.write_text(picture(hall, runs[-1]), "ascii")
    if options.write:
        page = ROOT / "docs" / "navigation.md"
        before, _, rest = page.read_text("utf-8").partition("<!-- bench -->\n")
        _, _, after = rest.partition("<!-- end -->")
        page.write_text(f"{before}<!-- bench -->\n{text}\n<!-- end -->{after}", "utf-8")


if __name__ == "__main__":
    main()
