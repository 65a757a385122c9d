"""How well a base finds its goals: `python -m bench.navigation [--goals 20] [--survey] [--write]`.

A simulated Pioneer (its controller and its laser, each on a wire with its own worker) drives to random goals on a map
of 20 by 20 m with walls, doors and crates, in which boxes move that the map does not show.  A box stops before a robot,
as a person would; it never leaves a robot more room.  All of it runs in simulated time, and everything but the time to
plan is exact and the same each time.  Measured at the body of the robot, not by its odometry: its distance from the
goal, the length of its way, where it believes to be, and each contact with a wall or a box.

With `--body` the robot has a body in MuJoCo (`hall_body`): its wheels slip as the friction of the floor lets them, and
each contact of the body is counted.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import tempfile
import time
from ast import literal_eval
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from p3dx_lab import Lab

from bench import ROOT
from bench.hall import BOX, BOX_STEP_S, SIZE, START, Hall
from bench.hall_body import HallBody
from urbihw.navigation import extra, maps, navigator
from urbihw.navigation.drawing import Drawing
from urbihw.navigation.frames import Point, Pose, path_length, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import NoPath, plan
from urbihw_fakes.p3dx.body import RADIUS
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

SLIP = 0.02
MIN_WAY = 5.0
"""m; goals are at least that far from where the robot is."""
FREE = 0.6
"""m between a goal and the walls."""
TIMEOUT_S, FIND_TIMEOUT_S = 600.0, 60.0
ERROR_PERIOD_S = 1.0


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
    errors: list[float] = field(default_factory=list)
    """m between where the robot believes to be and where it is, every ERROR_PERIOD_S."""
    plans: list[float] = field(default_factory=list)
    trail: list[Point] = field(default_factory=list)
    path: list[Point] = field(default_factory=list)
    said: str = ""


class Trial:
    """A robot in the hall, on its map; with ``with_body`` in MuJoCo."""

    def __init__(self, hall: Hall, folder: Path, *, with_body: bool = False) -> None:
        self.hall = hall
        self._body = HallBody(hall, folder) if with_body else None
        self._touches = False
        self.helped = 0
        """How often it had lost its place before a goal, and was turned by hand until it knew it again."""
        self.plans: list[float] = []
        self._time_plans()
        kit = Kit(hall.world, slip=SLIP) if self._body is None else Kit(body=self._body)
        self.lab = Lab.ready(kit, localization="scan")
        self.lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1;", 2)
        self.lab.say('at (P3dx.planner.pathPlanningEvent?(var how)) echo("path %s" % how);')
        self.lab.say('at (P3dx.planner.locFailureEvent?(var why)) echo("lost");')
        shown = folder / "hall.map"
        shown.write_text(World(list(hall.shown), START).as_map(), "ascii")
        self.lab.say(f'P3dx.planner.mapFileName = "{shown}";')
        while self.lab.look("P3dx.planner.ready") != "true":
            self.lab.thought()
            self.lab.run(0.2)

    def _time_plans(self) -> None:
        module: Any = navigator
        planned = module.plan_around

        def timed(*arguments: Any) -> list[Point]:
            start = time.perf_counter()
            try:
                path: list[Point] = planned(*arguments)
                return path
            finally:
                self.plans.append(time.perf_counter() - start)

        module.plan_around = timed

    def _run(self) -> None:
        """Let BOX_STEP_S pass.  A plan is there with the next tick, however long its thread takes, or no two runs would
        be the same."""
        for _ in range(round(BOX_STEP_S / self.lab.tick)):
            self.lab.run(self.lab.tick)
            self.lab.thought()

    def carry(self, to: Pose) -> tuple[float, float, float]:
        """Carry the robot to another place, and turn it by hand until it knows where it is: seconds until it notices
        that it is lost, seconds until it knows, and m between the two; nan for what does not happen."""
        lab = self.lab
        lab.kit.body.set_pose(*to)
        noticed, found = self.turn_until_found(noticed=lab.look("P3dx.planner.ready") != "true")
        return noticed, found, self.error()

    def turn_until_found(self, *, noticed: bool) -> tuple[float, float]:
        """Turn the robot by hand until it knows where it is: seconds until it notices that it is lost, 0 if it has
        ``noticed``, and until it knows; nan for what does not happen."""
        lab = self.lab
        begun, lost_after = lab.clock.now(), 0.0 if noticed else math.nan
        lab.heard()
        lab.say("P3dx.body.yaw.speed = 0.4;")
        while lab.clock.now() - begun < FIND_TIMEOUT_S:
            self.hall.move_boxes(lab.where()[:2])
            self._run()
            if lost_after != lost_after and "lost" in lab.heard():
                lost_after = lab.clock.now() - begun
            if lost_after == lost_after and lab.look("P3dx.planner.ready") == "true":
                break
        found = lab.clock.now() - begun
        lab.say("P3dx.body.yaw.speed = 0;", 1.5)
        return lost_after, found if found < FIND_TIMEOUT_S else math.nan

    def error(self) -> float:
        """How far the robot is from where it believes to be: m."""
        x, y, _, _ = literal_eval(self.lab.look("P3dx.body.odometry.position"))
        return math.dist((x, y), self.lab.where()[:2])

    def count_contacts(self) -> int:
        """Contacts that have begun since the last call."""
        if self._body is not None:
            count, self._body.contacts = self._body.contacts, 0
            return count
        touches = self.hall.world.nearest(*self.lab.where()[:2])[0] < RADIUS + 1e-3
        begun, self._touches = touches and not self._touches, touches
        return int(begun)

    def drive(self, goal: Pose) -> Run:
        """Send the robot to a goal."""
        lab, hall = self.lab, self.hall
        x, y, heading = lab.where()
        run = Run(goal, (x, y, heading), trail=[(x, y)])
        run.shortest = shortest_way(hall.grid, (x, y), goal[:2])
        self.plans.clear()
        lab.kernel.feed(lab.lobby, f"P3dx.moveTo([{goal[0]}, {goal[1]}, {goal[2]}]);".encode())
        begun = measured = lab.clock.now()
        self.count_contacts()
        while "path" not in run.said and lab.clock.now() - begun < TIMEOUT_S:
            hall.move_boxes(lab.where()[:2])
            self._run()
            run.said += lab.heard()
            if not run.path and lab.look("P3dx.planner.path") != "[]":
                run.path = [(a, b) for a, b in literal_eval(lab.look("P3dx.planner.path"))]
            at = lab.where()[:2]
            run.way += math.dist(run.trail[-1], at)
            run.trail.append(at)
            run.contacts += self.count_contacts()
            if lab.clock.now() - measured >= ERROR_PERIOD_S - 1e-9:
                measured = lab.clock.now()
                run.errors.append(self.error())
        run.seconds, run.plans = lab.clock.now() - begun, list(self.plans)
        lab.run(1.0)
        x, y, heading = lab.where()
        run.reached = run.said.endswith("path 1")
        run.metres, run.degrees = math.dist((x, y), goal[:2]), math.degrees(abs(wrapped(heading - goal[2])))
        return run


def shortest_way(grid: Grid, start: Point, goal: Point) -> float:
    """Length in m of the shortest way of a point-like path that keeps the body of the robot from what the map shows."""
    return min(path_length(plan(grid, start, goal, free)) for free in (RADIUS, RADIUS + 0.05, RADIUS + 0.1))


def run_trial(goals: int, seed: int, *, with_body: bool = False) -> tuple[Hall, list[Run], Trial]:
    """Send a robot to random goals."""
    hall = Hall(seed)
    draw = random.Random(seed + 1)
    runs: list[Run] = []
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(hall, Path(folder), with_body=with_body)
        while len(runs) < goals:
            at = draw.uniform(0.7, SIZE - 0.7), draw.uniform(0.7, SIZE - 0.7)
            if hall.grid.distance(*at) < FREE or math.dist(at, trial.lab.where()[:2]) < MIN_WAY:
                continue
            if trial.lab.look("P3dx.planner.ready") != "true":
                trial.helped += 1
                _, seconds = trial.turn_until_found(noticed=True)
                print(f"    lost: turned by hand, found after {seconds:.1f} s", flush=True)
            try:
                run = trial.drive((*at, draw.uniform(-math.pi, math.pi)))
            except NoPath:
                continue
            runs.append(run)
            print(row(len(runs), run), flush=True)
    return hall, runs, trial


def carry_robot(trial: Trial, times: int, seed: int) -> str:
    """Carry the robot to random places; a line for the table."""
    draw, found, misses, wrong = random.Random(seed + 2), [], [], 0
    for _ in range(times):
        at = trial.hall.place(FREE)
        noticed, seconds, metres = trial.carry((*at, draw.uniform(-math.pi, math.pi)))
        print(
            f"carried to ({at[0]:5.2f}, {at[1]:5.2f}): lost after {noticed:.1f} s, found after {seconds:.1f} s, "
            f"{metres * 100:.1f} cm off", flush=True,
        )  # fmt: skip
        if seconds == seconds and metres < 0.5:
            found.append(seconds)
            misses.append(metres * 100)
        wrong += seconds == seconds and metres >= 0.5
    if not found:
        return "| carried away: found itself | never |"
    return (
        f"| carried away, turned by hand: found itself | {len(found)} of {times}, median "
        f"{statistics.median(found):.0f} s, {statistics.median(misses):.1f} cm off |\n"
        f"| believed to be in a wrong place | {wrong} of {times} |"
    )


def survey_hall(hall: Hall, folder: Path, places: int = 8) -> list[tuple[str, str]]:
    """Drive a robot without a map from place to place by hand and build one; rows for the table."""
    hall.world.walls[:] = hall.shown
    lab = Lab.ready(Kit(hall.world, slip=SLIP))
    lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1;", 2)
    x, y, heading = lab.where()
    lab.say(f"P3dx.body.odometry.position = [{x}, {y}, 0, {heading}]; P3dx.planner.startMapping;")
    way, worst = 0.0, 0.0
    for _ in range(places):
        for corner in plan(hall.grid, lab.where()[:2], hall.place(FREE), RADIUS + 0.2)[1:]:
            while math.dist(lab.where()[:2], corner) > 0.2:
                x, y, heading = lab.where()
                off = wrapped(math.atan2(corner[1] - y, corner[0] - x) - heading)
                speed, turn = 0.3 if abs(off) < 0.4 else 0.0, max(-0.6, min(0.6, off))
                lab.say(f"P3dx.body.x.speed = {speed}; P3dx.body.yaw.speed = {turn:.3f};", 0.2)
                lab.thought()
                way += math.dist(lab.where()[:2], (x, y))
                mapped = literal_eval(lab.look("P3dx.body.odometry.position"))
                worst = max(worst, math.dist(mapped[:2], lab.where()[:2]))
    off_by_wheels = math.dist(literal_eval(lab.look("[P3dx.body.odometry.x, P3dx.body.odometry.y]")), (
        lab.where()[0] - hall.world.home[0], lab.where()[1] - hall.world.home[1]))  # fmt: skip
    said = lab.say(f'P3dx.body.x.speed = 0|; P3dx.planner.saveMap("{folder}/built");', 1.0)
    assert not said, said
    built = read_walls(folder / "built")
    walls = Grid(0, 0, SIZE, SIZE, 0.05)
    for point in built:
        walls.block(*point)
    there = [walls.distance(*point) <= 0.1 for point in wall_points(hall)]
    right = [hall.grid.distance(*point) <= 0.1 for point in built]
    return [
        ("map built on a tour driven by hand", f"{way:.0f} m"),
        ("pose on it from the true one, largest", f"{worst * 100:.0f} cm (by the wheels alone: {off_by_wheels:.1f} m)"),
        ("walls on it that are within 10 cm of one of the hall", f"{sum(right) / len(right):.0%}"),
        ("walls of the hall that are on it within 10 cm", f"{sum(there) / len(there):.0%}"),
    ]


def read_walls(name: Path) -> list[Point]:
    """The middles of the black pixels of a map."""
    left, bottom, _, _ = maps.read(f"{name}.yaml").bounds
    _, size, _, pixels = name.with_suffix(".pgm").read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    black = [divmod(index, width) for index, pixel in enumerate(pixels) if not pixel]
    return [(left + (column + 0.5) * 0.05, bottom + (height - row - 0.5) * 0.05) for row, column in black]


def wall_points(hall: Hall) -> list[Point]:
    """Points every 10 cm on all walls that the map shows."""
    points = []
    for x1, y1, x2, y2 in hall.shown:
        count = max(1, round(math.dist((x1, y1), (x2, y2)) * 10))
        points += [(x1 + (x2 - x1) * i / count, y1 + (y2 - y1) * i / count) for i in range(count)]
    return points


def row(number: int, run: Run) -> str:
    """A line of the protocol."""
    return (
        f"{number:3d} ({run.goal[0]:5.2f}, {run.goal[1]:5.2f}) {'reached' if run.reached else run.said!r:8s} "
        f"{run.metres * 100:5.1f} cm {run.degrees:4.1f} deg {run.way:5.1f} m of {run.shortest:5.1f} m "
        f"{run.seconds:4.0f} s {run.contacts} contacts, astray by {max(run.errors, default=0) * 100:.0f} cm at most, "
        f"{len(run.plans)} plans, "
        f"longest {max(run.plans, default=0) * 1000:.0f} ms"
    )


def table(runs: Sequence[Run], helped: int) -> str:
    """The table of docs/navigation.md; ``helped`` as in Trial."""
    metres, degrees = [each.metres * 100 for each in runs], [each.degrees for each in runs]
    longer = [(each.way / each.shortest - 1) * 100 for each in runs]
    plans = [seconds * 1000 for each in runs for seconds in each.plans]
    errors = [metres * 100 for each in runs for metres in each.errors]
    rows = [
        ("goals reached", f"{sum(each.reached for each in runs)} of {len(runs)}"),
        ("lost on the way, and turned by hand until it had found itself", f"{helped}"),
        ("contacts with walls or boxes", f"{sum(each.contacts for each in runs)}"),
        ("distance from the goal, median and largest", f"{statistics.median(metres):.1f} cm, {max(metres):.1f} cm"),
        ("heading from the goal's, median and largest", f"{statistics.median(degrees):.1f}, {max(degrees):.1f} deg"),
        ("way against the shortest, median and largest", f"{statistics.median(longer):+.0f} %, {max(longer):+.0f} %"),
        ("way in all", f"{sum(each.way for each in runs):.0f} m in {sum(each.seconds for each in runs):.0f} s"),
        ("pose from the true one, median and largest", f"{statistics.median(errors):.1f} cm, {max(errors):.1f} cm"),
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
    parser.add_argument("--carried", type=int, default=10, help="how often the robot is carried away after that")
    parser.add_argument("--body", action="store_true", help="in MuJoCo, where wheels slip (the extra mujoco)")
    parser.add_argument("--survey", action="store_true", help="build a map at the end")
    parser.add_argument("--without-extra", action="store_true", help="as if numpy and scipy were not installed")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--write", action="store_true", help="put the table and the picture into docs/")
    options = parser.parse_args()
    if options.without_extra:
        extra._load = lambda name: None  # type: ignore[assignment]
    print(f"extra navigation (numpy, scipy): {'yes' if extra.load_arrays() else 'no'}")
    if options.body and (options.survey or options.write):
        parser.error("--body goes without --survey and --write: it has no rows in the table of docs/navigation.md")
    hall, runs, trial = run_trial(options.goals, options.seed, with_body=options.body)
    text = table(runs, trial.helped)
    drawn = picture(hall, runs[-1])
    if options.carried:
        text += "\n" + carry_robot(trial, options.carried, options.seed)
    if options.survey:
        with tempfile.TemporaryDirectory() as folder:
            text += "".join(f"\n| {what} | {value} |" for what, value in survey_hall(hall, Path(folder)))
    print(text)
    target = ROOT / "docs" / "pictures" / "navigation.svg" if options.write else options.picture
    if target is not None:
        target.write_text(drawn, "ascii")
    if options.write:
        page = ROOT / "docs" / "navigation.md"
        before, _, rest = page.read_text("utf-8").partition("<!-- bench -->\n")
        _, _, after = rest.partition("<!-- end -->")
        page.write_text(f"{before}<!-- bench -->\n{text}\n<!-- end -->{after}", "utf-8")


if __name__ == "__main__":
    main()
