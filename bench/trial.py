"""A simulated Pioneer that is sent to goals, for the bench of navigation; what came of it is judged at its body."""

from __future__ import annotations

import math
import time
from ast import literal_eval
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from p3dx_lab import Lab

from bench.corridor import Corridor
from bench.hall import BOX_STEP_S, Hall
from bench.hall_body import HallBody
from urbihw.navigation import navigator
from urbihw.navigation.frames import Point, Pose, path_length, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import Room, plan
from urbihw_fakes.p3dx.body import RADIUS
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

SLIP = 0.02
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
    failure: str = ""


class Trial:
    """A robot in the hall, on its map; with ``with_body`` in MuJoCo."""

    def __init__(self, hall: Hall | Corridor, folder: Path, *, with_body: bool = False) -> None:
        self.hall = hall
        self._body = HallBody(hall, folder) if with_body and isinstance(hall, Hall) else None
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
        shown.write_text(World(list(hall.shown), hall.world.home).as_map(), "ascii")
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
        run.shortest = shortest_way(hall.grid, (x, y), goal[:2], hall.keeps)
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
        run.reached, run.failure = run.said.endswith("path 1"), lab.look("P3dx.planner.failure").strip('"')
        run.metres, run.degrees = math.dist((x, y), goal[:2]), math.degrees(abs(wrapped(heading - goal[2])))
        return run


def shortest_way(
    grid: Grid, start: Point, goal: Point, keeps: Sequence[float]
) -> float:
    """Length in m of the shortest of the ways of a point-like path that keep so many m from what is there.  Raises
    NoPath."""
    return min(path_length(plan(grid, start, goal, Room(free, free))) for free in keeps)


def row(number: int, run: Run) -> str:
    """A line of the protocol."""
    return (
        f"{number:3d} ({run.goal[0]:5.2f}, {run.goal[1]:5.2f}) {'reached' if run.reached else run.said!r:8s} "
        f"{run.metres * 100:5.1f} cm {run.degrees:4.1f} deg {run.way:5.1f} m of {run.shortest:5.1f} m "
        f"{run.seconds:4.0f} s {run.contacts} contacts, astray by {max(run.errors, default=0) * 100:.0f} cm at most, "
        f"{len(run.plans)} plans, "
        f"longest {max(run.plans, default=0) * 1000:.0f} ms"
    )
