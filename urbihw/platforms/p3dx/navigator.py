"""The object ``P3dx.planner``: a map, where the robot is on it, and driving to goals.

Reading a map and planning take long, so they run in threads; what they find comes back into the kernel's thread and is
dropped if it is no longer wanted.  The robot is where its odometry says, from the map's home on; with the option
``localization = "scan"`` each scan of the laser corrects that.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.uobject import UObject, UVar, event, owned, reading, variable
from urbihw.platforms.p3dx.drive import FINISHED, Motion
from urbihw.platforms.p3dx.follow import Follow
from urbihw.platforms.p3dx.frames import Pose
from urbihw.platforms.p3dx.grid import Grid
from urbihw.platforms.p3dx.localize import CELL, GOOD, match
from urbihw.platforms.p3dx.maps import BadMap, Map, read
from urbihw.platforms.p3dx.options import SCAN
from urbihw.platforms.p3dx.planner import NoPath, Point, plan
from urbihw.platforms.p3dx.values import number, numbers

if TYPE_CHECKING:
    from urbihw.platforms.p3dx.robot import P3dx


FAILED, SUCCEEDED, CANCELED = 0.0, 1.0, 2.0
"""What ``pathPlanningEvent`` tells."""
DETOURS: Final = 3
"""How often another way is looked for when something stands in the way."""
LOST_AFTER: Final = 5
"""Scans in a row that do not fit the map after which the robot is lost."""
FIRST_SCANS: Final = 20
"""Scans in which the robot must find itself on a new map."""
SIDE: Final = 0.03
"""m beside the robot's radius that must be free ahead."""


@dataclass(frozen=True, slots=True)
class Goal:
    """Where to go: a place and a heading of the map; ``detours`` may still be made."""

    place: Point
    heading: float
    detours: int = DETOURS


class Navigator(UObject):
    """Maps, paths, and where the robot is."""

    uname = "P3dxPlanner"

    mapFileName = owned("")  # noqa: N815 - names of slots
    pathPlanningEvent = event()  # noqa: N815
    locFailureEvent = event()  # noqa: N815
    ready = reading(False)
    active = reading(False)
    path = reading([])
    score = reading(math.nan)
    speed = variable(0.3)
    turnSpeed = variable(0.7)  # noqa: N815

    def init(self, robot: P3dx) -> None:
        """``robot`` is who drives."""
        self._robot = robot
        self._grid: Grid | None = None
        self._walls: Grid | None = None
        self._goal: Goal | None = None
        self._follow: Follow | None = None
        self._task = 0
        self._misfits = 0
        self._found_itself = False
        robot.laser.scanned = self._scanned
        self.notify_change(self.mapFileName, self._map_written)
        self.notify_change(self.speed, lambda: self._set_cruise(self.speed, "cruise"))
        self.notify_change(self.turnSpeed, lambda: self._set_cruise(self.turnSpeed, "cruise_turn"))

    def _set_cruise(self, var: UVar, attribute: str) -> None:
        value = number(var)
        if value <= 0:
            raise ValueError("this slot takes a speed above 0")
        setattr(self._robot.drive.limits, attribute, value)

    # ---------------------------------------------------------------- the map

    def _map_written(self) -> None:
        name = self.mapFileName.value
        if not isinstance(name, str):
            raise ValueError("mapFileName takes the path of a map, or \"\"")
        options, laser = self._robot.options, self._robot.laser
        if name and options.localization == SCAN and not laser.load.sensed:
            raise ValueError("localization by scans needs the laser; switch it on first: P3dx.body.laser.load = 1")
        self._forget_map()
        self.mapFileName.sense(name)
        if name:
            cell = options.cell
            scans = options.localization == SCAN
            self._in_thread(lambda: _load(name, cell, scans=scans), self._map_loaded, self._map_failed)

    def _forget_map(self) -> None:
        self.cancel()
        self._task += 1
        self._grid = self._walls = None
        self.ready.sense(False)
        self.score.sense(math.nan)
        self.mapFileName.sense("")

    def _map_loaded(self, loaded: tuple[Map, Grid, Grid]) -> None:
        map_, self._grid, self._walls = loaded
        self._misfits, self._found_itself = 0, False
        if map_.home is not None:
            self._robot.odometry.correct(map_.home)
        if self._robot.options.localization == SCAN:
            return
        if self._is_outside():
            self.lost("the robot's home is outside the map")
        else:
            self._begin()

    def _map_failed(self, error: Exception) -> None:
        self.lost(str(error))

    def _begin(self) -> None:
        """The robot knows where it is: a goal that waited for that can be planned."""
        self._found_itself = True
        self.ready.sense(True)
        if self._goal is not None:
            self._plan(self._goal)

    def lost(self, why: str) -> None:
        """The robot does not know where it is."""
        self._robot.log.warning("localization failed: %s", why)
        self._forget_map()
        self.locFailureEvent.emit(why)

    # ---------------------------------------------------------------- where it is

    def _is_outside(self) -> bool:
        grid = self._grid
        return grid is not None and not grid.holds(*grid.column_row(*self._robot.odometry.absolute[:2]))

    def moved(self) -> None:
        """The odometry went on."""
        if self._found_itself and self._is_outside():
            self.lost("the robot is outside the map")

    def _scanned(self) -> None:
        """A scan came: correct the pose by it, if that is wanted."""
        walls, robot = self._walls, self._robot
        if walls is None or robot.options.localization != SCAN:
            return
        found = match(walls, robot.odometry.absolute, robot.laser.points(), robot.laser.place)
        self.score.sense(found.score)
        if found.score >= GOOD:
            self._misfits = 0
            robot.odometry.correct(found.pose)
            if not self._found_itself:
                self._begin()
            return
        self._misfits += 1
        if self._misfits >= (LOST_AFTER if self._found_itself else FIRST_SCANS):
            self.lost(f"the laser does not see what the map shows (score {found.score:.2f})")

    # ---------------------------------------------------------------- goals

    def move_to(self, goal: Any) -> None:
        """Plan a path to [x, y, heading] and go.  Raises ValueError without a map, motors or a goal with sense."""
        x, y, heading = numbers(goal, 3, 3, "[x, y, heading]")
        if not self.mapFileName.sensed:
            raise ValueError("there is no map; set P3dx.planner.mapFileName first")
        self._robot.check_motors()
        self._robot.take_motion()
        self._robot.drive.halt("a path is being planned")
        self.cancel()
        self._goal = Goal((x, y), heading)
        self.active.sense(True)
        if self._found_itself:
            self._plan(self._goal)

    def _plan(self, goal: Goal) -> None:
        grid, options = self._grid, self._robot.options
        assert grid is not None, "the robot knows where it is, so there is a map"
        start = self._robot.odometry.absolute[:2]
        clearance = self._robot.factors.radius + options.clearance
        self._in_thread(
            lambda: plan(grid, start, goal.place, clearance), lambda path: self._go(goal, path), self._plan_failed
        )

    def _go(self, goal: Goal, path: list[Point]) -> None:
        self.path.sense([list(point) for point in path])
        robot = self._robot
        follow = Follow(path, goal.heading, robot.drive.limits, self._pose, self._room)
        self._follow = follow
        robot.begin(follow)

    def _plan_failed(self, error: Exception) -> None:
        self._robot.log.warning("no path: %s", error)
        self._end(FAILED)

    def motion_ended(self, motion: Motion, how: str) -> None:
        """A motion of the robot is over; it may have been ours."""
        if motion is not self._follow or self._follow is None:
            return
        follow, self._follow = self._follow, None
        goal = self._goal
        if how != FINISHED:
            self._end(FAILED if how == "stalled" else CANCELED)
        elif not follow.blocked or goal is None:
            self._end(SUCCEEDED)
        elif not goal.detours:
            self._robot.log.warning("no path: something stands in the way")
            self._end(FAILED)
        else:
            self._detour(goal)

    def _detour(self, goal: Goal) -> None:
        """Plan again, with what stands in the way on the map of this goal."""
        assert self._grid is not None, "a path was followed on a map"
        self._grid = self._grid.copy()
        for x, y in self._seen():
            self._grid.block(x, y)
        self._goal = Goal(goal.place, goal.heading, goal.detours - 1)
        self._plan(self._goal)

    def cancel(self) -> None:
        """Forget the goal: it was overtaken by another one, by a motion of another kind, or by a change of map."""
        if self._goal is not None:
            self._end(CANCELED)

    def _end(self, how: float) -> None:
        follow, self._follow, self._goal = self._follow, None, None
        self._task += 1
        self.active.sense(False)
        self.path.sense([])
        if follow is not None and self._robot.drive.motion is follow:
            self._robot.drive.halt("the path was given up")
        self.pathPlanningEvent.emit(how)

    # ---------------------------------------------------------------- what the follower asks

    def _pose(self) -> Pose:
        return self._robot.odometry.absolute

    def _room(self) -> float:
        """m that are free ahead of the robot's hull, in a lane as wide as itself."""
        half = self._robot.factors.radius + SIDE
        return min((x for x, y in self._echoes() if x > 0 and abs(y) <= half), default=math.inf) - (half - SIDE)

    def _echoes(self) -> list[tuple[float, float]]:
        """What laser and front sonars see now, in m ahead of and to the left of the robot's middle."""
        laser = self._robot.laser
        seen = [(laser.place + r * math.cos(a), r * math.sin(a)) for r, a in laser.fresh_points()]
        return seen + self._robot.sonar_echoes()

    def _seen(self) -> list[Point]:
        x, y, heading = self._robot.odometry.absolute
        c, s = math.cos(heading), math.sin(heading)
        return [(x + c * px - s * py, y + s * px + c * py) for px, py in self._echoes()]

    # ---------------------------------------------------------------- threads

    def _in_thread(
        self, work: Callable[[], Any], done: Callable[[Any], None], failed: Callable[[Exception], None]
    ) -> None:
        """Do some work beside the kernel; what comes of it counts only if nothing else was begun meanwhile."""
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
    """Read a map; its grid for paths, and that for scans (the same if there will be none).  Raises BadMap."""
    map_ = read(name)
    grid = Grid.of(map_, cell)
    walls = Grid.of(map_, CELL) if scans else grid
    for measured in (grid, walls):
        measured.distances()
    return map_, grid, walls
