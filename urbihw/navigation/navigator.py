"""The navigator of a base: a map, the pose of the base on it, and driving to goals; an object of urbiscript.

To read a map and to plan take long, so they run in threads; the results return to the kernel's thread and are dropped
if they are obsolete.  The pose is that of the odometry, which begins at the map's home; with the option ``localization
= "scan"`` each scan of the laser corrects it.  ``navigation.base`` is the interface of the base.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from urbihw.kernel.uobject import UObject, UVar, event, finite_number, finite_numbers, owned, reading, variable
from urbihw.navigation.base import Base
from urbihw.navigation.drive import FINISHED, STALLED, Motion
from urbihw.navigation.follow import PathFollower
from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import CELL, GOOD_SCORE, match_scan
from urbihw.navigation.maps import BadMap, Map, read
from urbihw.navigation.options import SCAN
from urbihw.navigation.planner import NoPath, plan

FAILED, SUCCEEDED, CANCELED = 0.0, 1.0, 2.0
"""The payload of ``pathPlanningEvent``."""
MAX_DETOURS: Final = 3
"""Maximum number of new plans for one goal because of obstacles."""
MAX_MISFITS: Final = 5
"""Consecutive scans that do not match the map after which the robot is lost."""
MAX_FIRST_SCANS: Final = 20
"""Maximum number of scans to find the pose on a new map."""
SIDE_CLEARANCE: Final = 0.03
"""Clearance in m beside the robot's radius that must be free ahead."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal: a point and a heading on the map; ``detours`` is the remaining number of new plans."""

    place: Point
    heading: float
    detours: int = MAX_DETOURS


class Navigator(UObject):
    """Maps, paths, and the pose of the base.

    A platform derives its own class, whose name is that in urbiscript, and sets ``slot_name`` to its slot.
    """

    slot_name: ClassVar[str] = "planner"
    """Its slot in urbiscript, for messages."""

    mapFileName = owned("")
    pathPlanningEvent = event()
    locFailureEvent = event()
    ready = reading(False)
    active = reading(False)
    path = reading([])
    score = reading(math.nan)
    speed = variable(0.3)
    turnSpeed = variable(0.7)

    def init(self, base: Base) -> None:
        """``base`` is the base to drive."""
        self._base = base
        self._grid: Grid | None = None
        self._walls: Grid | None = None
        self._goal: Goal | None = None
        self._follower: PathFollower | None = None
        self._task = 0
        self._misfits = 0
        self._found_itself = False
        if base.scanner is not None:
            base.scanner.scanned = self._scan_came
        self.notify_change(self.mapFileName, self._map_written)
        self.notify_change(self.speed, lambda: self._set_cruise(self.speed, "cruise"))
        self.notify_change(self.turnSpeed, lambda: self._set_cruise(self.turnSpeed, "cruise_turn"))

    def _set_cruise(self, var: UVar, attribute: str) -> None:
        value = finite_number(var.value)
        if value <= 0:
            raise ValueError("this slot takes a speed above 0")
        setattr(self._base.drive.limits, attribute, value)

    # ---------------------------------------------------------------- the map

    def _map_written(self) -> None:
        name = self.mapFileName.value
        if not isinstance(name, str):
            raise ValueError("mapFileName takes the path of a map, or \"\"")
        scans, cell = self._uses_scans(), self._base.navigation.cell
        if name and scans:
            if self._base.scanner is None:
                raise ValueError("localization by scans needs a laser, and this robot has none")
            self._base.scanner.check_on()
        self._drop_map()
        self.mapFileName.sense(name)
        if name:
            self._in_thread(lambda: _load(name, cell, scans=scans), self._map_loaded, self._map_failed)

    def _uses_scans(self) -> bool:
        return self._base.navigation.localization == SCAN

    def _drop_map(self) -> None:
        self.cancel()
        self._task += 1
        self._grid = self._walls = None
        self._found_itself = False
        self.ready.sense(False)
        self.score.sense(math.nan)
        self.mapFileName.sense("")

    def _map_loaded(self, loaded: tuple[Map, Grid, Grid]) -> None:
        map_, self._grid, self._walls = loaded
        self._misfits, self._found_itself = 0, False
        if map_.home is not None:
            self._base.odometry.correct(map_.home)
        if self._uses_scans():
            return
        if self._is_outside():
            self._lose("the robot's home is outside the map")
        else:
            self._localized()

    def _map_failed(self, error: Exception) -> None:
        self._lose(str(error))

    def _localized(self) -> None:
        """The pose is known: plan a goal that has waited for it."""
        self._found_itself = True
        self.ready.sense(True)
        if self._goal is not None:
            self._plan(self._goal)

    def _lose(self, why: str) -> None:
        """The pose is not known any more: report it and cancel the goal."""
        self._base.log.warning("localization failed: %s", why)
        self._drop_map()
        self.locFailureEvent.emit(why)

    # ---------------------------------------------------------------- where it is

    def _is_outside(self) -> bool:
        grid = self._grid
        return grid is not None and not grid.holds(*grid.column_row(*self._base.odometry.absolute[:2]))

    def pose_changed(self) -> None:
        """The base calls this after each measurement of its pose."""
        if self._found_itself and self._is_outside():
            self._lose("the robot is outside the map")

    def _scan_came(self) -> None:
        """Correct the pose by a new scan, if the options require that."""
        walls, scanner = self._walls, self._base.scanner
        if walls is None or scanner is None or not self._uses_scans():
            return
        odometry = self._base.odometry
        found = match_scan(walls, odometry.absolute, scanner.echoes(), scanner.place)
        self.score.sense(found.score)
        if found.score >= GOOD_SCORE:
            self._misfits = 0
            odometry.correct(found.pose)
            if not self._found_itself:
                self._localized()
            return
        self._misfits += 1
        if self._misfits >= (MAX_MISFITS if self._found_itself else MAX_FIRST_SCANS):
            self._lose(f"the laser does not see what the map shows (score {found.score:.2f})")

    # ---------------------------------------------------------------- goals

    def move_to(self, goal: Any) -> None:
        """Plan a path to [x, y, heading] and drive.  Raises ValueError without a map or motors, and for an invalid
        goal."""
        x, y, heading = finite_numbers(goal, 3, 3, "[x, y, heading]")
        if not self.mapFileName.sensed:
            raise ValueError(f"there is no map; set {self.slot_name}.mapFileName first")
        self._base.check_motors()
        self._base.claim_motion()
        self._base.drive.halt("a path is being planned")
        self.cancel()
        self._goal = Goal((x, y), heading)
        self.active.sense(True)
        if self._found_itself:
            self._plan(self._goal)

    def _plan(self, goal: Goal) -> None:
        grid, base = self._grid, self._base
        assert grid is not None, "the robot knows where it is, so there is a map"
        start = self._base.odometry.absolute[:2]
        clearance = base.radius + base.navigation.clearance
        self._in_thread(
            lambda: plan(grid, start, goal.place, clearance),
            lambda path: self._follow_path(goal, path),
            self._plan_failed,
        )

    def _follow_path(self, goal: Goal, path: list[Point]) -> None:
        self.path.sense([list(point) for point in path])
        follower = PathFollower(path, goal.heading, self._base.drive.limits, self._pose, self._room)
        self._follower = follower
        self._base.begin_motion(follower)

    def _plan_failed(self, error: Exception) -> None:
        self._base.log.warning("no path: %s", error)
        self._end_goal(FAILED)

    def motion_ended(self, motion: Motion, how: str) -> None:
        """The base calls this at the end of each motion, which may be one of the navigator."""
        if motion is not self._follower or self._follower is None:
            return
        follower, self._follower = self._follower, None
        goal = self._goal
        if how != FINISHED:
            self._end_goal(FAILED if how == STALLED else CANCELED)
        elif not follower.blocked or goal is None:
            self._end_goal(SUCCEEDED)
        elif not goal.detours:
            self._base.log.warning("no path: something stands in the way")
            self._end_goal(FAILED)
        else:
            self._detour(goal)

    def _detour(self, goal: Goal) -> None:
        """Plan again, with the detected obstacles added to the map of this goal."""
        assert self._grid is not None, "a path was followed on a map"
        self._grid = self._grid.copy()
        for x, y in self._echoes_on_map():
            self._grid.block(x, y)
        self._goal = Goal(goal.place, goal.heading, goal.detours - 1)
        self._plan(self._goal)

    def cancel(self) -> None:
        """Cancel the goal: another goal, a motion of another kind, or a change of the map has replaced it."""
        if self._goal is not None:
            self._end_goal(CANCELED)

    def _end_goal(self, how: float) -> None:
        follower, self._follower, self._goal = self._follower, None, None
        self._task += 1
        self.active.sense(False)
        self.path.sense([])
        if follower is not None and self._base.drive.motion is follower:
            self._base.drive.halt("the path was given up")
        self.pathPlanningEvent.emit(how)

    # ---------------------------------------------------------------- what the path follower asks

    def _pose(self) -> Pose:
        return self._base.odometry.absolute

    def _room(self) -> float:
        """Free distance in m ahead of the robot's hull, in a lane of its own width."""
        radius = self._base.radius
        ahead = (x for x, y in self._echoes() if x > 0 and abs(y) <= radius + SIDE_CLEARANCE)
        return min(ahead, default=math.inf) - radius

    def _echoes(self) -> list[Point]:
        """Points that the scanner and other sensors detect now, in m ahead of and to the left of the middle of the
        base."""
        scanner = self._base.scanner
        if scanner is None:
            return self._base.obstacles()
        seen = [(scanner.place + r * math.cos(a), r * math.sin(a)) for r, a in scanner.fresh_echoes()]
        return seen + self._base.obstacles()

    def _echoes_on_map(self) -> list[Point]:
        x, y, heading = self._base.odometry.absolute
        c, s = math.cos(heading), math.sin(heading)
        return [(x + c * px - s * py, y + s * px + c * py) for px, py in self._echoes()]

    # ---------------------------------------------------------------- threads

    def _in_thread(
        self, work: Callable[[], Any], done: Callable[[Any], None], failed: Callable[[Exception], None]
    ) -> None:
        """Run some work in a thread; its result is used only if no other work was begun meanwhile."""
        self._task += 1
        task = self._task

        def deliver(act: Callable[[Any], None], value: Any) -> None:
            self.host.post(lambda: act(value) if task == self._task else None)

        def run() -> None:
            try:
                value = work()
            except (BadMap, NoPath) as error:
                deliver(failed, error)
            except Exception as error:
                deliver(failed, RuntimeError(f"our bug: {type(error).__name__}: {error}"))
            else:
                deliver(done, value)

        threading.Thread(target=run, name="planner", daemon=True).start()


def _load(name: str, cell: float, *, scans: bool) -> tuple[Map, Grid, Grid]:
    """Read a map, and make its grids for paths and for scans (the same one without scans).  Raises BadMap."""
    map_ = read(name)
    grid = Grid.of(map_, cell)
    walls = Grid.of(map_, CELL) if scans else grid
    for measured in (grid, walls):
        measured.distances()
    return map_, grid, walls
