"""The navigator of a base: a map, the pose of the base on it, and driving to goals; an object of urbiscript.

To read a map and to plan take long, so they run in threads; the results return to the kernel's thread and are dropped
if they are obsolete.  The pose is that of the odometry, which begins at the map's home; with the option ``localization
= "scan"`` each scan of the laser corrects it (``locator``).  ``navigation.base`` is the interface of the base.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Final

from urbihw.files import write_regular
from urbihw.kernel.uobject import (
    UObject,
    UVar,
    event,
    finite_number,
    finite_numbers,
    function,
    owned,
    reading,
    variable,
)
from urbihw.navigation.background import Background
from urbihw.navigation.base import DrivenBase
from urbihw.navigation.drawing import draw_map
from urbihw.navigation.drive import FINISHED, STALLED, DriveMotion
from urbihw.navigation.follow import STUCK_MARGIN, PathFollower, Tolerance
from urbihw.navigation.frames import Point, compose, path_length, wrapped
from urbihw.navigation.goal import Goal
from urbihw.navigation.grid import Grid
from urbihw.navigation.loading import check_map, load_map
from urbihw.navigation.locator import Locator
from urbihw.navigation.maps import BadMap, Bounds, Map
from urbihw.navigation.obstacles import ObstacleLayer, close_by, closes_path
from urbihw.navigation.planner import NoPath, Obstructed, check_goal, plan_around
from urbihw.navigation.survey import MapSurvey
from urbihw.navigation.view import NavigatorView

FAILED, SUCCEEDED, CANCELED = 0.0, 1.0, 2.0
"""The payload of ``pathPlanningEvent``."""
RETRY_S: Final = 3.0
"""Seconds of a pause while obstacles close all ways."""
NEW_WAY_PAUSE_S: Final = 1.0
"""Seconds between two of them."""
LOOK_AHEAD: Final = 2.5
"""Distance in m along the path that must be free of obstacles."""
BLOCKING_RANGE: Final = 1.5
"""Distance in m up to which echoes are marked as obstacles where the robot had to stop."""
BLIND_TIMEOUT_S: Final = 5.0
"""Seconds without a scan after which a goal, and the pose that scans keep, are given up."""


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
    walls = reading([])
    score = reading(math.nan)
    failure = reading("")
    mapping = reading(False)
    speed = variable(0.3)
    turnSpeed = variable(0.7)

    slot_words = {
        "mapFileName": ("file of the map; \"\" for none", ""),
        "pathPlanningEvent": ("event: a goal has ended: 0 failed, 1 reached, 2 canceled", ""),
        "locFailureEvent": ("event: the robot does not know where it is; the payload tells why", ""),
        "ready": ("the robot knows where it is on the map", ""),
        "active": ("a goal is pursued", ""),
        "path": ("corners of the path", "m"),
        "walls": ("boxes of the map that are occupied: left, bottom, right, top", "m"),
        "score": ("how well the last scan matches the map, 0 to 1", "1"),
        "failure": ("why the last goal failed; \"\" if it did not", ""),
        "mapping": ("a map is being built", ""),
        "speed": ("speed on paths", "m/s"),
        "turnSpeed": ("yaw rate on paths", "rad/s"),
    }

    def init(self, base: DrivenBase) -> None:
        """``base`` is the base to drive."""
        self._base = base
        self._map: Map | None = None
        self._dropped: frozenset[int] = frozenset()
        self._seen: ObstacleLayer | None = None
        self._goal: Goal | None = None
        self._follower: PathFollower | None = None
        self._retry_at = math.inf
        self._planned_at = -math.inf
        self._blind_since = math.inf
        self._work = Background(self.host.post, (BadMap, NoPath))
        self._changes = Background(self.host.post, ())
        searching, matching = Background(self.host.post, ()), Background(self.host.post, ())
        self._locator = Locator(base.odometry, searching, self._localized, self._lost_pose)
        self._view = NavigatorView(base, self._locator)
        self._survey = MapSurvey(base.odometry, matching, base.log)
        base.odometry.placed = self._locator.trust_pose
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
        scans, cell = self._view.uses_scans, self._base.navigation.cell
        if name and scans:
            self._check_scanner("localization by scans")
        if name:
            check_map(name)
        self._drop_map()
        self.failure.sense("")
        self.mapFileName.sense(name)
        if name:
            self._end_mapping()
            self._work.start(lambda: load_map(name, cell, scans=scans), self._map_loaded, self._map_failed)

    def _check_scanner(self, what: str) -> None:
        """Raise ValueError without a laser that is on."""
        if self._base.scanner is None:
            raise ValueError(f"{what} needs a laser, and this robot has none")
        self._base.scanner.check_on()

    def _drop_map(self) -> None:
        self.cancel()
        self._work.drop()
        self._map = self._view.grid = self._seen = None
        self._dropped = frozenset()
        self.walls.sense([])
        self._locator.use_map(None)
        self.ready.sense(False)
        self.score.sense(math.nan)
        self.mapFileName.sense("")

    def _map_loaded(self, loaded: tuple[Map, Grid, Grid, list[Bounds]]) -> None:
        self._map, self._view.grid, walls, boxes = loaded
        self.walls.sense([list(box) for box in boxes])
        map_ = self._map
        self._seen = ObstacleLayer(self._view.grid)
        if map_.home is not None:
            self._base.odometry.correct(map_.home)
        if self._view.uses_scans:
            self._locator.use_map(walls)
        elif self._view.is_outside():
            self._lose("the robot's home is outside the map")
        else:
            self._localized()

    def _map_failed(self, error: Exception) -> None:
        self._lose(str(error))

    def _localized(self) -> None:
        """The pose is known: plan a goal that has waited for it."""
        self.ready.sense(True)
        if self._goal is not None:
            self._plan(self._goal)

    def _lose(self, why: str) -> None:
        """The pose is not known any more, and there is no way to find it: report it, drop the map and the goal."""
        self._base.log.warning("localization failed: %s", why)
        self._drop_map()
        self.failure.sense(why)
        self.locFailureEvent.emit(why)

    def _lost_pose(self, why: str, searching: bool) -> None:
        """The scans do not match the map any more; while the locator searches, the map stays."""
        if searching:
            self._doubt_pose(why)
        else:
            self._lose(why)

    def _doubt_pose(self, why: str) -> None:
        """The pose is not known until the locator finds it; the map stays."""
        self._base.log.warning("localization failed: %s", why)
        self.ready.sense(False)
        self.cancel()
        if self._view.grid is not None:
            self._view.grid = self._view.grid.base or self._view.grid
            self._seen, self._dropped = ObstacleLayer(self._view.grid), frozenset()
        self.locFailureEvent.emit(why)

    # ---------------------------------------------------------------- where it is

    def pose_changed(self) -> None:
        """The base calls this after each measurement of its pose."""
        if self.ready.sensed and self._view.is_outside():
            self._lose("the robot is outside the map")
        self._watch_scanner()
        if self.host.now() >= self._retry_at and self._goal is not None:
            self._retry_at = math.inf
            self._plan(self._goal)

    def _watch_scanner(self) -> None:
        """Stand while the scans do not come that the goal or the pose relies on; give both up after a while."""
        scanner, goal, now = self._base.scanner, self._goal, self.host.now()
        relied_on = self._view.grid is not None and self._view.uses_scans or goal is not None and goal.scanned
        if scanner is None or not relied_on or scanner.is_fresh():
            if self._blind_since < math.inf and self.ready.sensed:
                self._retry_at = now
            self._blind_since = math.inf
            return
        if self._blind_since == math.inf:
            self._blind_since = now
        if goal is not None and self.ready.sensed:
            self._work.drop()
            self._retry_at = math.inf
            self._stand("the laser sends no scan")
        if now - self._blind_since >= BLIND_TIMEOUT_S:
            self._give_up_scans(f"the laser has sent no scan for {BLIND_TIMEOUT_S:g} s")

    def _give_up_scans(self, why: str) -> None:
        if self._goal is not None:
            self._fail(why)
        if self.ready.sensed and self._view.uses_scans:
            self._locator.doubt_pose()
            self._doubt_pose(why)

    def _scan_came(self) -> None:
        """Process a new scan: correct the pose if the options require that, and mark and clear obstacles."""
        scanner = self._base.scanner
        if scanner is None:
            return
        echoes = scanner.echoes()
        if self.mapping.sensed:
            self._survey.take_scan(echoes, scanner.place)
        if self._view.grid is None or self._seen is None:
            return
        if self._view.uses_scans:
            self._locator.take_scan(echoes, scanner.place, scanner.stamp)
            self.score.sense(self._locator.score)
        if self.ready.sensed and self._seen is not None:
            at = compose(self._base.odometry.absolute_at(scanner.stamp), (scanner.place, 0.0, 0.0))
            self._seen.add_scan(at, echoes, self.host.now())
            if self._locator.is_precise:
                self._seen.pass_walls(at, echoes)
                self._drop_what_is_gone(self._seen)
            self._keep_way_free()

    def _drop_what_is_gone(self, seen: ObstacleLayer) -> None:
        """Plan from now on without the walls that are gone."""
        gone, map_ = seen.gone, seen.grid.base or seen.grid

        def changed(grid: Grid) -> None:
            if seen is self._seen:
                self._view.grid = seen.grid = grid
                self._dropped = gone

        if gone != self._dropped and not self._changes.busy:
            self._changes.start(lambda: map_.freed(gone), changed, self._map_failed)

    def _keep_way_free(self) -> None:
        """Plan again while an obstacle stands on the rest of the path."""
        follower, goal, now = self._follower, self._goal, self.host.now()
        if follower is None or goal is None or self._seen is None or self._work.busy:
            return
        if not goal.new_ways or now - self._planned_at < NEW_WAY_PAUSE_S:
            return
        if closes_path(self._seen.points(now), follower.rest(), self._base.radius, LOOK_AHEAD):
            self._goal = replace(goal, new_ways=goal.new_ways - 1)
            self._plan(self._goal)

    # ---------------------------------------------------------------- a new map

    @function("asString")
    def name_slot(self) -> str:
        """Return its slot, as the text of the object."""
        return self.slot_name

    @function("startMapping")
    def start_mapping(self) -> None:
        """Begin to build a map from the scans of the laser, here and now; the old map is dropped.  Drive the robot by
        hand.  Raises ValueError without a laser that is on, or without the extra ``navigation``."""
        self._check_scanner("building a map")
        self._survey.start()
        self._drop_map()
        self.mapping.sense(True)

    @function("stopMapping")
    def stop_mapping(self) -> None:
        """End it, and forget the map that was built."""
        self._end_mapping()

    @function("saveMap")
    def save_map(self, name: str) -> None:
        """Write the map that is being built, for ``mapFileName``: NAME.yaml and NAME.pgm, as map_server's.  Raises
        ValueError if none is being built or the files cannot be written."""
        self._survey.save(name)

    @function("drawMap")
    def draw_map(self, name: str) -> None:
        """Draw the map, the obstacles seen, the path and the robot into an SVG file.  Raises ValueError without a map,
        or if the file cannot be written."""
        if self._map is None or self._view.grid is None or self._seen is None:
            raise ValueError(f"there is no map; set {self.slot_name}.mapFileName first")
        seen, path = self._seen.points(self.host.now()), [(x, y) for x, y in self.path.sensed]
        text = draw_map(self._map, seen, self._view.grid.cell, path, self._view.pose(), self._base.radius)
        write_regular(Path(name), text.encode())

    def _end_mapping(self) -> None:
        self._survey.stop()
        self.mapping.sense(False)

    # ---------------------------------------------------------------- goals

    def move_to(self, goal: Any) -> None:
        """Plan a path to [x, y, heading] and drive.  Raises ValueError without a map or motors, and for an invalid
        goal."""
        x, y, heading = finite_numbers(goal, 3, 3, "[x, y, heading]")
        if not self.mapFileName.sensed:
            raise ValueError(f"there is no map; set {self.slot_name}.mapFileName first")
        self._base.check_motors()
        self._check_pose()
        if self._view.grid is not None:
            try:
                check_goal(self._view.grid, (x, y), self._view.clearance)
            except NoPath as error:
                raise ValueError(str(error)) from error
        self._base.claim_motion()
        self._base.drive.halt("a path is being planned")
        self.cancel()
        self.failure.sense("")
        scanner = self._base.scanner
        self._goal = Goal((x, y), heading, scanned=scanner is not None and scanner.wanted)
        self.active.sense(True)
        if self.ready.sensed:
            self._plan(self._goal)

    def _check_pose(self) -> None:
        """Raise ValueError while the robot is lost on the map, or cannot see although its laser is switched on."""
        scanner = self._base.scanner
        if self._view.uses_scans:
            self._check_scanner("localization by scans")
        if scanner is not None and scanner.wanted and not scanner.is_fresh():
            raise ValueError("the laser is switched on and sends no scan; wait until it does, or write 0 to its load")
        if self._locator.is_searching:
            raise ValueError(
                "the robot is lost on the map: turn or drive it until it has found itself, or write odometry.position"
            )

    def _tolerance(self) -> Tolerance:
        options = self._base.navigation
        return Tolerance(options.tolerance, math.radians(options.heading_tolerance))

    def _plan(self, goal: Goal) -> None:
        grid = self._view.grid
        assert grid is not None and self._seen is not None, "the robot knows where it is, so there is a map"
        start, room = self._base.odometry.absolute[:2], self._view.room()
        self._planned_at = self.host.now()
        seen, recent = self._seen.points(self._planned_at), self._seen.recent_points(self._planned_at)

        def work() -> tuple[list[Point], list[Point]]:
            known = seen
            try:
                path = plan_around(grid, known, start, goal.place, room)
            except Obstructed:
                # What stood there a while ago may be gone.
                if len(recent) == len(seen):
                    raise
                known = recent
                path = plan_around(grid, known, start, goal.place, room)
            return path, close_by(known, path, room.clear + STUCK_MARGIN)

        self._work.start(
            work,
            lambda planned: self._follow_path(goal, *planned),
            lambda error: self._plan_failed(goal, error),
        )

    def _follow_path(self, goal: Goal, path: list[Point], beside: list[Point]) -> None:
        left = path_length(self._follower.rest()) if self._follower is not None else goal.direct
        if goal.is_detour(path, left):
            self._goal = replace(goal, patience=goal.patience - 1, direct=left)
            self._stand("a detour would be longer than a pause")
            self._retry_at = self.host.now() + RETRY_S
            return
        self.path.sense([list(point) for point in path])
        self._view.beside = beside
        if self._follower is not None:
            self._follower.change_path(path)
            return
        base = self._base
        follower = PathFollower(path, goal.heading, base.drive.limits, self._view, self._tolerance())
        self._follower = follower
        base.begin_motion(follower)

    def _plan_failed(self, goal: Goal, error: Exception) -> None:
        if not isinstance(error, Obstructed) or not goal.waits:
            self._fail(str(error))
            return
        self._stand("obstacles close all ways")
        self._goal = replace(goal, waits=goal.waits - 1)
        self._retry_at = self.host.now() + RETRY_S

    def _stand(self, why: str) -> None:
        """End the motion along the path; the goal stays."""
        follower, self._follower = self._follower, None
        if follower is not None and self._base.drive.motion is follower:
            self._base.drive.halt(why)

    def _fail(self, why: str) -> None:
        """End the goal, and say why."""
        self._base.log.warning("no path: %s", why)
        self.failure.sense(why)
        self._end_goal(FAILED)

    def motion_ended(self, motion: DriveMotion, how: str) -> None:
        """The base calls this at the end of each motion, which may be one of the navigator."""
        if motion is not self._follower or self._follower is None:
            return
        follower, self._follower = self._follower, None
        goal = self._goal
        if goal is None or how not in (FINISHED, STALLED):
            self._end_goal(CANCELED)
        elif how == STALLED:
            self._fail("the wheels were told to turn and stood still")
        elif follower.blocked:
            self._leave_obstacle(replace(goal, direct=path_length(follower.rest())))
        elif self._tolerance().allows(self._view.pose(), goal.place, goal.heading):
            self._end_goal(SUCCEEDED)
        elif goal.approaches:
            self._goal = replace(goal, approaches=goal.approaches - 1)
            self._plan(self._goal)
        else:
            x, y, heading = self._view.pose()
            off = math.degrees(abs(wrapped(goal.heading - heading)))
            self._fail(f"the robot stands {math.dist((x, y), goal.place):.2f} m and {off:.0f} degrees beside the goal")

    def _leave_obstacle(self, goal: Goal) -> None:
        """Plan again, around the obstacle in front of which the robot had to stop."""
        if not goal.waits or self._seen is None:
            self._fail("something stands in the way")
            return
        pose = self._view.pose()
        near = [(x, y) for x, y in self._view.echoes() if math.hypot(x, y) < BLOCKING_RANGE]
        self._seen.add_points([compose(pose, (x, y, 0.0))[:2] for x, y in near], self.host.now())
        self._goal = replace(goal, waits=goal.waits - 1)
        self._plan(self._goal)

    def cancel(self) -> None:
        """Cancel the goal: another goal, a motion of another kind, or a change of the map has replaced it."""
        if self._goal is not None:
            self._end_goal(CANCELED)

    def _end_goal(self, how: float) -> None:
        self._goal = None
        self._retry_at = math.inf
        if self._view.grid is not None:
            # Without a map the work is that of reading one, for which another goal waits.
            self._work.drop()
        self.active.sense(False)
        self.path.sense([])
        self._stand("the path was given up")
        self.pathPlanningEvent.emit(how)
