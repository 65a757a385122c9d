"""How well a base finds its goals: `python -m bench.navigation [--goals 20] [--survey] [--write]`.

A simulated Pioneer (its controller and its laser, each on a wire with its own worker) drives to random goals on a map
of 20 by 20 m with walls, doors and crates, in which boxes move that the map does not show.  A box stops before a robot,
as a person would; it never leaves a robot more room.  All of it runs in simulated time, and everything but the time to
plan is exact and the same each time.  Measured at the body of the robot, not by its odometry: its distance from the
goal, the length of its way, where it believes to be, and each contact with a wall or a box.

With `--body` the robot has a body in MuJoCo (`hall_body`): its wheels slip as the friction of the floor lets them, and
each contact of the body is counted.  With `--furniture 5 --corridors` it drives between crates that were moved, and
through narrow corridors (`passages`).
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import tempfile
from ast import literal_eval
from collections.abc import Sequence
from pathlib import Path

from p3dx_lab import Lab

from bench import ROOT
from bench.hall import BOX, SIZE, Hall
from bench.passages import corridor_rows, furniture_rows
from bench.trial import FREE, SLIP, Run, Trial, row
from urbihw.navigation import extra, maps
from urbihw.navigation.drawing import Drawing
from urbihw.navigation.frames import Point, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import NoPath, Room, plan
from urbihw_fakes.p3dx.body import RADIUS
from urbihw_fakes.p3dx.kit import P3dx as Kit

PAGE = ROOT / "docs" / "navigation.md"


def run_trial(goals: int, seed: int, *, with_body: bool = False) -> tuple[Hall, list[Run], Trial]:
    """Send a robot to random goals."""
    hall = Hall(seed)
    draw = random.Random(seed + 1)
    runs: list[Run] = []
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(hall, Path(folder), with_body=with_body)
        while len(runs) < goals:
            at = draw.uniform(0.7, SIZE - 0.7), draw.uniform(0.7, SIZE - 0.7)
            if hall.grid.distance(*at) < FREE or math.dist(at, trial.lab.where()[:2]) < hall.way:
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


def carry_robot(trial: Trial, hall: Hall, times: int, seed: int) -> str:
    """Carry the robot to random places; a line for the table."""
    draw, found, misses, wrong = random.Random(seed + 2), [], [], 0
    for _ in range(times):
        at = hall.place(FREE)
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
        for corner in plan(hall.grid, lab.where()[:2], hall.place(FREE), Room(RADIUS + 0.2, RADIUS + 0.2))[1:]:
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
    return "| what | measured |\n|---|---|\n" + lines(rows)


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


def lines(rows: Sequence[tuple[str, str]]) -> str:
    """Rows of a table."""
    return "\n".join(f"| {what} | {value} |" for what, value in rows)


def put(text: str, mark: str) -> None:
    """Put a table into the page, between its mark and the end."""
    before, _, rest = PAGE.read_text("utf-8").partition(f"<!-- {mark} -->\n")
    _, _, after = rest.partition("<!-- end -->")
    PAGE.write_text(f"{before}<!-- {mark} -->\n{text}\n<!-- end -->{after}", "utf-8")


def measure_passages(seeds: int, *, corridors: bool, write: bool) -> None:
    """Print the table of moved furniture and of corridors."""
    rows = furniture_rows(seeds, 8) if seeds else []
    rows += corridor_rows() if corridors else []
    text = "| what | measured |\n|---|---|\n" + lines(rows)
    print(text)
    if write:
        put(text, "passages")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--carried", type=int, default=10, help="how often it is carried away after that")
    parser.add_argument("--furniture", type=int, default=0, metavar="SEEDS", help="moved crates instead (5)")
    parser.add_argument("--corridors", action="store_true", help="narrow corridors instead")
    parser.add_argument("--body", action="store_true", help="in MuJoCo, where wheels slip (the extra mujoco)")
    parser.add_argument("--survey", action="store_true", help="build a map at the end")
    parser.add_argument("--without-extra", action="store_true", help="as if numpy and scipy were not installed")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--write", action="store_true", help="put the table and the picture into docs/")
    options = parser.parse_args()
    if options.without_extra:
        extra._load = lambda name: None  # type: ignore[assignment]
    print(f"extra navigation (numpy, scipy): {'yes' if extra.load_arrays() else 'no'}")
    if options.furniture or options.corridors:
        measure_passages(options.furniture, corridors=options.corridors, write=options.write)
        return
    if options.body and (options.survey or options.write):
        parser.error("--body goes without --survey and --write: it has no rows in the table of docs/navigation.md")
    hall, runs, trial = run_trial(options.goals, options.seed, with_body=options.body)
    text = table(runs, trial.helped)
    drawn = picture(hall, runs[-1])
    if options.carried:
        text += "\n" + carry_robot(trial, hall, options.carried, options.seed)
    if options.survey:
        with tempfile.TemporaryDirectory() as folder:
            text += "\n" + lines(survey_hall(hall, Path(folder)))
    print(text)
    target = ROOT / "docs" / "pictures" / "navigation.svg" if options.write else options.picture
    if target is not None:
        target.write_text(drawn, "ascii")
    if options.write:
        put(text, "bench")


if __name__ == "__main__":
    main()
