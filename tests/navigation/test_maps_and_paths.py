"""Maps from files, their grids, paths on them, following those, and finding oneself: without a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pytest

from urbihw.navigation import maps
from urbihw.navigation.drive import DriveLimits, State
from urbihw.navigation.follow import BLOCKED_TIMEOUT_S, PathFollower, Tolerance
from urbihw.navigation.frames import Point, Pose, compose, frame_of
from urbihw.navigation.grid import MAX_CELLS, Grid
from urbihw.navigation.loading import MAX_BOXES, wall_boxes
from urbihw.navigation.localize import CELL, judge_scan, match_scan
from urbihw.navigation.maps import Map
from urbihw.navigation.planner import NoPath, Room, plan
from urbihw_fakes.p3dx.world import World

ARIA = """2D-Map
LineMinPos: 0 0
LineMaxPos: 4000 3000
NumLines: 4
Cairn: RobotHome 1000 2000 90 "" ICON "Home"
Cairn: GoalWithHeading 3000 500 -90.000000 "" ICON "Kitchen"
Cairn: ForbiddenLine 0 0 0.000000 "" ICON "" 2000 0 2000 1000
Cairn: ForbiddenArea 0 0 90.000000 "" ICON "" 0 -3000 500 -2000
LINES
0 0 4000 0
4000 0 4000 3000
4000 3000 0 3000
0 3000 0 0
DATA
1500 1500
"""


def saved(folder: Path, text: str, name: str = "a.map") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def room() -> Grid:
    """The room of the fake as cells of 0.1 m."""
    made = Grid(-2, -3, 6, 3, 0.1)
    for wall in World.room().walls:
        made.block_line(*wall)
    return made


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_map_of_aria(tmp_path: Path) -> None:
    found = maps.read(saved(tmp_path, ARIA))
    assert list(found.bounds) == pytest.approx([0.0, 0.0, 4.0, 3.0])
    assert found.home is not None and list(found.home) == pytest.approx([1.0, 2.0, math.pi / 2])
    assert list(found.goals["Kitchen"]) == pytest.approx([3.0, 0.5, -math.pi / 2])
    assert (2.0, 0.0, 2.0, 1.0) in found.lines
    # A laser sees through what is forbidden: it tells no place, and scans do not free it.
    assert (2.0, 0.0, 2.0, 1.0) in found.forbidden and len(found.forbidden) == 5
    grid, seen = Grid.of(found, 0.1), Grid.seen(found, 0.05)
    assert grid.distance(2.0, 0.5) == 0 and seen.distance(2.0, 0.5) > 0.4
    column, row = grid.column_row(2.0, 0.5)
    assert grid.fixed[row * grid.width + column] and sum(grid.fixed) < sum(grid.blocked) / 2
    grid = Grid.of(found, 0.1)
    assert grid.distance(1.5, 1.5) == 0
    # The area's corners are given in a frame that is turned by 90 degrees.
    assert grid.distance(2.5, 0.0) == grid.distance(3.0, 0.5) == grid.distance(2.0, 0.5) == 0
    assert grid.distance(1.0, 2.0) > 0.4


@pytest.mark.parametrize(
    "text, why",
    [("", "begins with 2D-Map"), ("3D-Map\n", "begins with 2D-Map"), ("2D-Map\nLINES\nDATA\n", "neither lines nor"),
     ("2D-Map\nLINES\n1 2 3\n", "line 3"), ("2D-Map\nDATA\n1 x\n", "line 3"),
     ("2D-Map\nCairn: RobotHome 1\n", "line 2"),
     ("2D-Map\nLINES\n0 0 inf 1\n", "line 3"), ("2D-Map\nLINES\n0 0 nan 1\n", "line 3"),
     ("2D-Map\nLINES\n0 0 1e300 1\n", "line 3 .* 10000 m"),
     ("2D-Map\nCairn: RobotHome nan nan nan\n", "line 2"),
     ('2D-Map\nCairn: ForbiddenArea 0 0 0 "" ICON "a" 0 0 1e308 1\n', "line 2")],
)  # fmt: skip
def test_maps_of_aria_without_sense(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(maps.BadMap, match=why):
        maps.read(saved(tmp_path, text))


def test_files_that_are_no_maps(tmp_path: Path) -> None:
    with pytest.raises(maps.BadMap, match=r"maps end in .*\.map"):
        maps.read("house.dxf")
    with pytest.raises(maps.BadMap, match="there is no such file"):
        maps.read(str(tmp_path / "none.map"))
    with pytest.raises(maps.BadMap, match="not a regular file"):
        (tmp_path / "folder.map").mkdir()
        maps.read(str(tmp_path / "folder.map"))
    with pytest.raises(maps.BadMap, match="is no name of a file"):
        maps.read("a\0.map")
    (tmp_path / "zero.map").symlink_to("/dev/zero")
    with pytest.raises(maps.BadMap, match="not a regular file"):
        maps.read(str(tmp_path / "zero.map"))


PGM = b"P5\n4 3\n255\n" + bytes([0, 254, 254, 254, 254, 254, 205, 254, 254, 254, 254, 0])
YAML = "image: a.pgm  # the picture\nresolution: 0.5\norigin: [-1.0, -0.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"


def test_a_map_of_map_server(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(PGM)
    found = maps.read(saved(tmp_path, YAML + "free_thresh: 0.196\nhome: [0.25, 0.25, 1.0]\n", "a.yaml"))
    assert found.bounds == (-1.0, -0.5, 1.0, 1.0)
    assert found.home == (0.25, 0.25, 1.0)
    assert found.fine == 0.5
    # The first row of a picture is the top; grey is unknown, and no path leads there.
    assert found.unknown == ((0.0, 0.0, 0.5, 0.5),)
    assert set(found.boxes) == {(-1.0, 0.5, -0.5, 1.0), (0.0, 0.0, 0.5, 0.5), (0.5, -0.5, 1.0, 0.0)}


def test_a_negative_picture(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(PGM)
    found = maps.read(saved(tmp_path, YAML.replace("negate: 0", "negate: 1"), "a.yml"))
    assert sum(round((box[2] - box[0]) / 0.5) for box in found.boxes) == 10


@pytest.mark.parametrize(
    "text, why",
    [("resolution: 1\n", "names its image"), (YAML.replace("0.5\n", "x\n", 1), "resolution must be"),
     (YAML.replace("resolution: 0.5", "resolution: 0"), "resolution 0 is"), (YAML.replace("0.0]", "1.0]"), "turned"),
     (YAML.replace("[-1.0, -0.5, 0.0]", "somewhere"), r"origin must be \[x, y"),
     (YAML.replace("[-1.0, -0.5, 0.0]", "[nan, 0, 0]"), r"origin must be \[x, y"),
     (YAML + "home: [nan, nan, nan]\n", r"home must be \[x, y"),
     (YAML.replace("a.pgm", "b.pgm"), "cannot be read as a picture: No such file"),
     (YAML.replace("a.pgm", "/dev/zero"), "not a regular file"),
     (YAML.replace("a.pgm", "a.yaml"), "cannot be read as a picture")],
)  # fmt: skip
def test_maps_of_map_server_without_sense(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "a.pgm").write_bytes(PGM)
    with pytest.raises(maps.BadMap, match=why):
        maps.read(saved(tmp_path, text, "a.yaml"))


def test_a_picture_that_claims_to_be_huge(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(b"P5\n60000 1000\n255\n")
    with pytest.raises(maps.BadMap, match="pixels"):
        maps.read(saved(tmp_path, YAML, "a.yaml"))


# --- cells ------------------------------------------------------------------------------------------------------------


def test_distances_from_walls() -> None:
    grid = Grid(0, 0, 10, 10, 0.1)
    grid.block_line(0, 5, 10, 5)
    assert grid.distance(5, 5) == 0
    assert grid.distance(5, 6.5) == pytest.approx(1.5, abs=0.11)
    corner = Grid(0, 0, 10, 10, 0.1)
    corner.block(5, 5)
    assert corner.distance(8, 9) == pytest.approx(5, rel=0.09)
    assert corner.distance(50, 50) == math.inf
    assert corner.freed(()).distance(8, 9) == corner.distance(8, 9)


def test_a_huge_map_gets_larger_cells() -> None:
    grid = Grid(0, 0, 400, 100, 0.1)
    assert grid.width * grid.height < MAX_CELLS * 1.02
    assert grid.cell > 0.4
    grid.block_box(-500, -500, 500, -400)
    grid.block_box(-500, 40, 500, 50)
    assert grid.distance(200, 45) == 0 and not any(grid.blocked[: grid.width])


# --- paths ------------------------------------------------------------------------------------------------------------


def lowest_distance(grid: Grid, path: list[tuple[float, float]]) -> float:
    """How near a path comes to a wall."""
    found = math.inf
    for a, b in zip(path, path[1:], strict=False):
        for step in range(101):
            share = step / 100
            found = min(found, grid.distance(a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share))
    return found


def covered(boxes: Sequence[Sequence[float]], x: float, y: float) -> bool:
    """Whether a point lies in one of the boxes."""
    return any(left <= x <= right and bottom <= y <= top for left, bottom, right, top in boxes)


def test_the_walls_of_a_map_as_boxes() -> None:
    grid = Grid.of(Map((0.0, 0.0, 4.0, 3.0), lines=((0.0, 0.0, 4.0, 0.0), (2.0, 0.0, 2.0, 3.0)),
                       boxes=((3.0, 1.0, 3.5, 2.0),)), 0.1)  # fmt: skip
    boxes = wall_boxes(grid)
    assert len(boxes) <= 8
    for row in range(grid.height):
        for column in range(grid.width):
            x, y = grid.left + (column + 0.5) * grid.cell, grid.bottom + (row + 0.5) * grid.cell
            assert covered(boxes, x, y) == bool(grid.blocked[row * grid.width + column]), (x, y)


def test_a_map_of_many_specks_gets_fewer_and_larger_boxes() -> None:
    specks = tuple((0.2 * x, 0.2 * y, 0.2 * x + 0.05, 0.2 * y + 0.05) for x in range(100) for y in range(100))
    grid = Grid.of(Map((0.0, 0.0, 20.0, 20.0), boxes=specks), 0.1)
    boxes = wall_boxes(grid)
    assert 0 < len(boxes) <= MAX_BOXES
    assert all(covered(boxes, *speck[:2]) for speck in specks)


def test_a_path_leads_through_the_door_with_room_to_spare() -> None:
    grid = room()
    path = plan(grid, (0, 0), (5, 0), Room(0.3, 0.3))
    assert path[0] == (0, 0) and path[-1] == (5, 0)
    assert len(path) <= 6
    (door,) = [a[1] + (b[1] - a[1]) * (3 - a[0]) / (b[0] - a[0])
               for a, b in zip(path, path[1:], strict=False) if a[0] <= 3 < b[0]]  # fmt: skip
    assert 1.1 <= door <= 1.9
    assert lowest_distance(grid, path) >= 0.29
    length = sum(math.dist(a, b) for a, b in zip(path, path[1:], strict=False))
    assert length < 6.5


@pytest.mark.parametrize(
    "start, goal, clearance, why",
    [((0, 0), (50, 0), 0.3, r"goal \(50, 0\) is outside the map"), ((-50, 0), (0, 0), 0.3, "robot is outside"),
     ((0, 0), (5, 0), 0.9, "no way leads there")],
)  # fmt: skip
def test_where_no_path_leads(start: tuple[float, float], goal: tuple[float, float], clearance: float, why: str) -> None:
    with pytest.raises(NoPath, match=why):
        plan(room(), start, goal, Room(clearance, clearance))


def test_a_goal_within_a_wall_is_no_goal() -> None:
    grid = room()
    grid.block_box(1.2, -2.8, 2.8, -1.2)
    with pytest.raises(NoPath, match=r"goal \(2, -2\) is in a wall"):
        plan(grid, (0, 0), (2, -2), Room(0.3, 0.3))


def test_a_robot_too_near_a_wall_first_leaves_it() -> None:
    grid = room()
    path = plan(grid, (-1.85, 0), (0, 0), Room(0.3, 0.3))
    assert path[0] == (-1.85, 0) and path[-1] == (0, 0)


def test_one_that_is_there_needs_no_way() -> None:
    assert plan(room(), (0, 0), (0, 0), Room(0.3, 0.3)) == [(0, 0), (0, 0)]


# --- following --------------------------------------------------------------------------------------------------------


class Car:
    """A robot without inertia, to follow paths."""

    def __init__(self, path: list[tuple[float, float]], heading: float) -> None:
        self.at: Pose = (*path[0], 0.0)
        self.room = self.most = math.inf
        self.follow = PathFollower(path, heading, DriveLimits(), self, Tolerance())
        self.time = 0.0
        self.v = self.w = 0.0

    def pose(self) -> Pose:
        """Where it is."""
        return self.at

    def fastest(self) -> float:
        """What it is allowed."""
        return self.most

    def free_way(self, curvature: float, narrow: bool) -> float:
        """What it has before it."""
        return self.room

    def is_narrow(self, a: Point, b: Point, margin: float) -> bool:
        """No way is."""
        return False

    def run(self, seconds: float) -> bool:
        """Whether it arrived (or gave up) within some time."""
        end = self.time + seconds
        while self.time < end:
            speeds = self.follow.speeds(State(self.time, self.v, self.w))
            if speeds is None:
                return True
            self.v, self.w = speeds
            x, y, heading = self.at
            way = self.v * 0.1
            self.at = (x + way * math.cos(heading), y + way * math.sin(heading), heading + self.w * 0.1)
            self.time += 0.1
        return False


def test_a_path_is_followed_to_its_end_and_heading() -> None:
    car = Car([(0, 0), (2, 0), (2, 2), (0, 2)], math.pi / 2)
    assert car.run(60)
    assert math.dist(car.at[:2], (0, 2)) < 0.1
    assert math.sin(car.at[2]) > 0.99
    assert not car.follow.blocked


def test_something_ahead_is_waited_for_and_then_given_up() -> None:
    car = Car([(0, 0), (3, 0)], 0.0)
    assert not car.run(2)
    car.room = 0.2
    where = car.at
    assert not car.run(BLOCKED_TIMEOUT_S - 0.5)
    assert car.at[0] == pytest.approx(where[0], abs=0.01)
    car.room = math.inf
    assert not car.run(1)
    assert car.at[0] > where[0] + 0.1
    car.room = 0.2
    assert car.run(BLOCKED_TIMEOUT_S + 0.3)
    assert car.follow.blocked


def test_a_robot_that_is_not_sure_where_it_is_drives_slowly() -> None:
    car = Car([(0, 0), (3, 0)], 0.0)
    car.most = 0.1
    car.run(3)
    assert 0.2 < car.at[0] < 0.31


def test_a_path_behind_the_robot_is_turned_to_first() -> None:
    car = Car([(0, 0), (-2, 0)], 0.0)
    car.run(0.5)
    assert math.dist(car.at[:2], (0, 0)) < 0.01 and car.at[2] != 0
    assert car.run(40)


# --- where am I -------------------------------------------------------------------------------------------------------


def scan(pose: tuple[float, float, float], place: float = 0.021) -> list[tuple[float, float]]:
    """What a laser sees in the room."""
    world, (x, y, heading) = World.room(), pose
    lx, ly = x + place * math.cos(heading), y + place * math.sin(heading)
    angles = [math.radians(degrees) for degrees in range(-90, 91)]
    return [(world.ray(lx, ly, heading + angle, 30), angle) for angle in angles]


def room_walls() -> Grid:
    """The walls of the room."""
    walls = Grid(-2, -3, 6, 3, CELL)
    for wall in World.room().walls:
        walls.block_line(*wall)
    return walls


@pytest.mark.parametrize("off", [(0.15, 0.1, 0.1), (-0.2, 0.0, -0.15), (0.0, -0.15, 0.08)])
def test_a_scan_says_where_the_robot_is(off: tuple[float, float, float]) -> None:
    truth = (0.5, 0.5, 0.4)
    guess = (truth[0] + off[0], truth[1] + off[1], truth[2] + off[2])
    found = match_scan(room_walls(), guess, scan(truth), 0.021)
    assert math.dist(found.pose[:2], truth[:2]) < 0.04
    assert found.pose[2] == pytest.approx(truth[2], abs=0.02)
    assert found.score > 0.8


def test_things_before_the_walls_are_told_from_another_place() -> None:
    truth = (0.5, 0.5, 0.4)
    seen = scan(truth)
    crowded = [(r if index % 10 < 3 else 0.5 * r, angle) for index, (r, angle) in enumerate(seen)]
    assert match_scan(room_walls(), truth, crowded, 0.021).score < 0.5
    assert judge_scan(room_walls(), truth, crowded, 0.021).is_there
    assert judge_scan(room_walls(), truth, seen, 0.021).is_there
    nothing_tells = judge_scan(room_walls(), truth, [(0.5 * r, angle) for r, angle in seen], 0.021)
    assert not nothing_tells.is_there and not nothing_tells.contradicts
    assert not judge_scan(room_walls(), truth, [], 0.021).is_there


@pytest.mark.parametrize("truth", [(4.5, 1.0, 2.0), (4.5, -1.0, -2.0), (-1.0, 2.0, 1.0)])
def test_a_scan_of_another_place_is_not_hidden(truth: tuple[float, float, float]) -> None:
    found = match_scan(room_walls(), (0.0, 0.0, 0.0), scan(truth), 0.021)
    assert found.score < 0.5
    assert not judge_scan(room_walls(), found.pose, scan(truth), 0.021).is_there


def test_a_scan_of_another_place_does_not_fit() -> None:
    assert match_scan(room_walls(), (0.0, 0.0, 0.0), scan((4.5, 1.0, 2.0)), 0.021).score < 0.5
    assert match_scan(room_walls(), (0.0, 0.0, 0.0), [], 0.021).score == 0


def test_frames() -> None:
    outside, inside = (3.0, -1.0, 2.5), (0.5, 0.25, -1.5)
    frame = frame_of(outside, inside)
    assert list(compose(frame, inside)) == pytest.approx(list(outside))
