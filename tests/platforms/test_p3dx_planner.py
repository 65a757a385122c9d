"""The object ``P3dx.planner``: maps, goals, obstacles and getting lost, in simulated time."""

from __future__ import annotations

import math
import threading
from ast import literal_eval
from pathlib import Path

import pytest
from p3dx_lab import Lab

from urbihw.navigation import maps
from urbihw.navigation.grid import Grid
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

EVENTS = (
    'at (P3dx.planner.pathPlanningEvent?(var how)) echo("path %s" % how);'
    'at (P3dx.planner.locFailureEvent?(var why)) echo("lost");'
)


def think(lab: Lab) -> None:
    """Wait until no thread of the planner works any more, then let the kernel take in what they found."""
    for _ in range(2):
        for thread in threading.enumerate():
            if thread.name == "planner":
                thread.join(20)
        lab.run(0.02)


def ready(folder: Path, slip: float = 0.0, **options: object) -> Lab:
    """A robot in the fake's room, on its map, motors and laser on."""
    lab = Lab.ready(Kit(slip=slip), **options)
    lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1;", 2)
    lab.say(EVENTS)
    lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(folder)}";')
    think(lab)
    lab.run(1)
    assert lab.look("P3dx.planner.ready") == "true"
    assert lab.heard() == ""
    return lab


def send(lab: Lab, goal: str) -> None:
    """Name a goal, and let the path be planned."""
    lab.kernel.feed(lab.lobby, f"P3dx.moveTo({goal});".encode())
    lab.run(0)
    think(lab)


def arrived(lab: Lab, patience: float = 90.0) -> str:
    """What is said until the path ends."""
    said: list[str] = []

    def over() -> bool:
        think(lab) if lab.look("P3dx.planner.path") == "[]" else None
        said.append(lab.heard())
        return any("path" in line for line in said)

    end = lab.clock.now() + patience
    while not over():
        assert lab.clock.now() < end, "it did not arrive"
        lab.run(0.5)
    return "".join(said)


def test_a_goal_behind_the_wall_is_reached(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    send(lab, "[5, 0, 90deg]")
    assert lab.look("P3dx.planner.active") == "true"
    assert arrived(lab) == "*** path 1"
    x, y, heading = lab.where()
    assert math.dist((x, y), (5, 0)) < 0.1
    assert heading == pytest.approx(math.pi / 2, abs=0.08)
    assert lab.look("P3dx.planner.active") == "false"
    lab.run(1)
    assert not lab.kit.body.moving and not lab.kit.body.front


def test_home_is_where_the_robot_is_put(tmp_path: Path) -> None:
    world = World.room()
    world.home = (4.0, -2.0, math.pi / 2)
    lab = Lab.ready(Kit(world))
    lab.say(f'P3dx.mapFileName = "{lab.write_map(tmp_path)}";')
    think(lab)
    assert lab.look("P3dx.body.odometry.position") == "[4, -2, 0, 1.5708]"
    assert lab.look("P3dx.body.odometry.x") == "0"


def test_a_goal_may_be_named_while_the_map_is_read(tmp_path: Path) -> None:
    lab = Lab.ready(Kit(slip=0))
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say(EVENTS)
    lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}"; P3dx.moveTo([1, 1, 0]);')
    think(lab)
    think(lab)
    assert arrived(lab) == "*** path 1"


def test_a_goal_outside_the_map_is_not_reached(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    assert "the goal (50, 0) is outside the map" in lab.say("P3dx.moveTo([50, 0, 0]);")
    assert lab.look("P3dx.planner.active") == "false"
    assert not lab.kit.body.moving


def test_a_goal_in_a_crate_is_not_reached(tmp_path: Path) -> None:
    world = World.room()
    world.walls += [(1.0, -3.0 + 0.1 * row, 2.9, -3.0 + 0.1 * row) for row in range(20)]
    lab = Lab.ready(Kit(world))
    lab.say(EVENTS)
    lab.say(f'P3dx.body.load = 1; P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}";', 0.5)
    think(lab)
    assert "the goal (2, -2.2) is in a wall" in lab.say("P3dx.moveTo([2, -2.2, 0]);")
    assert lab.look("P3dx.planner.active") == "false"


def test_what_moveto_needs(tmp_path: Path) -> None:
    lab = Lab.ready()
    assert "set P3dx.planner.mapFileName first" in lab.say("P3dx.moveTo([1, 1, 0]);")
    lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}";')
    think(lab)
    assert "motors are off" in lab.say("P3dx.moveTo([1, 1, 0]);")
    lab.say("P3dx.body.load = 1;", 0.5)
    assert "expected [x, y, heading]" in lab.say("P3dx.moveTo([1, 1]);")
    assert "finite" in lab.say("P3dx.moveTo([1, nan, 0]);")
    assert "path of a map" in lab.say("P3dx.planner.mapFileName = 3;")


@pytest.mark.parametrize(
    "deed", ["P3dx.moveTo([1, 1, 0]);", "P3dx.body.x.speed = 0.1;", 'P3dx.planner.mapFileName = "";', "P3dx.stop;",
             "P3dx.go(0.1),", "P3dx.turn(0.1),", "P3dx.body.load = 0;"]
)  # fmt: skip
def test_what_cancels_a_path(tmp_path: Path, deed: str) -> None:
    lab = ready(tmp_path)
    send(lab, "[5, 0, 0]")
    lab.run(3)
    assert "*** path 2" in lab.say(deed, 0.1).splitlines()
    think(lab)
    lab.run(1.5)
    if "moveTo" in deed:
        assert arrived(lab) == "*** path 1"
    else:
        assert lab.look("P3dx.planner.active") == "false"


def test_a_map_that_is_none_is_said_and_forgotten(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say(EVENTS)
    (tmp_path / "none.map").write_text("walls")
    said = lab.say(f'P3dx.planner.mapFileName = "{tmp_path}/none.map";')  # the planner's thread may be quicker
    think(lab)
    assert (said + lab.heard()).endswith("*** lost")
    assert lab.look("P3dx.planner.mapFileName") == '""'
    assert "none.map: a map of ARIA begins with 2D-Map" in caplog.text


def test_a_home_outside_its_map_is_no_home(tmp_path: Path) -> None:
    world = World.room()
    world.home = (40.0, 0.0, 0.0)
    lab = Lab.ready(Kit(world))
    lab.say(EVENTS)
    said = lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}";')
    think(lab)
    assert (said + lab.heard()).endswith("*** lost")


def test_a_crate_in_the_way_is_driven_around(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.kit.world.add_crate(0.0, 1.6)
    send(lab, "[0, 2.5, 90deg]")
    assert arrived(lab) == "*** path 1"
    assert math.dist(lab.where()[:2], (0, 2.5)) < 0.12


def test_a_crate_that_closes_the_door_ends_it(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.kit.world.add_crate(3.0, 1.5, 1.4)
    send(lab, "[5, 0, 0]")
    assert arrived(lab, 120) == "*** path 0"
    assert lab.where()[0] < 2.6


def test_safety_distances_have_no_impact_on_paths(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.say("P3dx.distMin = 3; P3dx.distMax = 4;")
    send(lab, "[1, 1, 0]")
    assert arrived(lab) == "*** path 1"


def test_the_speed_of_paths_can_be_set(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    assert "above 0" in lab.say("P3dx.planner.speed = 0;")
    lab.say("P3dx.planner.speed = 0.1;")
    send(lab, "[1, 0, 0]")
    lab.run(4)
    assert lab.number("P3dx.body.x.speed") == pytest.approx(0.1, abs=0.02)


def test_other_jobs_go_on_while_a_path_is_planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = threading.Event()
    lab = ready(tmp_path)
    monkeypatch.setattr(
        "urbihw.navigation.navigator.plan_around", lambda *arguments: gate.wait(20) and [(0.0, 0.0), (0.5, 0.0)]
    )
    lab.say("P3dx.moveTo([0.5, 0, 0]);")
    assert lab.say("for (3) { sleep(0.1); echo(1) };", 1) == "*** 1\n*** 1\n*** 1"
    assert lab.look("P3dx.planner.path") == "[]"
    gate.set()
    think(lab)
    assert arrived(lab) == "*** path 1"


def test_a_bug_while_planning_is_a_path_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    lab = ready(tmp_path)
    monkeypatch.setattr("urbihw.navigation.navigator.plan_around", lambda *arguments: 1 / 0)
    send(lab, "[0.5, 0, 0]")
    assert lab.heard() == "*** path 0"
    assert "our bug: ZeroDivisionError" in caplog.text


# --- localization by scans --------------------------------------------------------------------------------------------


def test_scans_correct_what_slips(tmp_path: Path) -> None:
    lab = ready(tmp_path, slip=0.05, localization="scan")
    send(lab, "[5, 0, 0]")
    assert arrived(lab) == "*** path 1"
    assert math.dist(lab.where()[:2], (5, 0)) < 0.12
    odometry = lab.number("P3dx.body.odometry.x"), lab.number("P3dx.body.odometry.y")
    assert math.dist(odometry, lab.where()[:2]) > 0.15


def test_scans_need_the_laser(tmp_path: Path) -> None:
    lab = Lab.ready(localization="scan")
    answer = lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}";')
    assert "P3dx.body.laser.load = 1" in answer
    assert lab.look("P3dx.planner.mapFileName") == '""'


def test_a_robot_that_is_not_at_home_finds_itself(tmp_path: Path) -> None:
    lab = Lab.ready(localization="scan")
    path = lab.write_map(tmp_path)
    lab.kit.body.set_pose(4.5, 1.0, 2.0)
    lab.say("P3dx.body.laser.load = 1;", 2)
    lab.say(EVENTS)
    lab.say(f'P3dx.planner.mapFileName = "{path}";')
    think(lab)
    lab.run(12)
    assert lab.heard() == "*** lost"
    find_itself(lab)
    x, y, _ = lab.where()
    assert math.dist((x, y), position(lab)[:2]) < 0.05


def position(lab: Lab) -> list[float]:
    """Where the robot believes to be: x, y, heading."""
    x, y, _, heading = literal_eval(lab.look("P3dx.body.odometry.position"))
    return [x, y, heading]


def find_itself(lab: Lab) -> None:
    """Turn by hand until the robot knows where it is."""
    lab.say("P3dx.body.load = 1; P3dx.body.yaw.speed = 0.5;")
    end = lab.clock.now() + 40
    while lab.look("P3dx.planner.ready") != "true":
        assert lab.clock.now() < end, "it does not find itself"
        lab.run(0.2)
        think(lab)
    lab.say("P3dx.body.yaw.speed = 0;", 1.5)


def test_a_robot_that_is_carried_away_finds_itself_and_reaches_its_goal(tmp_path: Path) -> None:
    lab = ready(tmp_path, localization="scan")
    send(lab, "[5, 0, 0]")
    lab.run(2)
    lab.kit.body.set_pose(4.5, -1.5, 2.0)
    lab.run(6)
    lab.heard()
    find_itself(lab)
    x, y, heading = lab.where()
    assert position(lab) == pytest.approx([x, y, heading], abs=0.05)
    send(lab, "[0, 1, 0]")
    assert arrived(lab) == "*** path 1"
    assert math.dist(lab.where()[:2], (0, 1)) < 0.1


def test_a_position_that_is_written_ends_the_search(tmp_path: Path) -> None:
    lab = ready(tmp_path, localization="scan")
    lab.kit.body.set_pose(4.5, -1.5, 2.0)
    lab.run(6)
    assert lab.heard() == "*** lost"
    lab.say("P3dx.body.odometry.position = [4.45, -1.5, 0, 2];", 3)
    assert lab.look("P3dx.planner.ready") == "true"
    assert math.dist(position(lab)[:2], (4.5, -1.5)) < 0.05


def test_a_box_that_is_taken_away_is_forgotten(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    walls = list(lab.kit.world.walls)
    lab.kit.world.add_crate(2.0, 0.0, 0.5)
    send(lab, "[2, 0, 0]")
    assert arrived(lab, 120) == "*** path 0"
    assert lab.look("P3dx.planner.failure") == '"obstacles that the sensors see close the way"'
    lab.kit.world.walls[:] = walls
    for _ in range(2):
        send(lab, "[2, 0, 0]")
        assert arrived(lab, 120) == "*** path 1"
        assert math.dist(lab.where()[:2], (2, 0)) < 0.1
        send(lab, "[0, 0, 0]")
        assert arrived(lab) == "*** path 1"


@pytest.mark.parametrize("how", ["stop", "client gone", "link lost"])
def test_what_ends_the_wait_for_an_obstacle_ends_it_for_good(tmp_path: Path, how: str) -> None:
    lab = ready(tmp_path)
    walls = list(lab.kit.world.walls)
    lab.kit.world.add_crate(2.0, 0.0, 0.5)
    send(lab, "[2, 0, 0]")
    for _ in range(50):
        lab.run(0.2)
        think(lab)
    assert lab.look("P3dx.planner.active") == "true" and not lab.kit.body.moving
    if how == "stop":
        lab.look("robot.stop")
    elif how == "client gone":
        lab.lobby.close()
    else:
        lab.robot_line.end.unplug()
        lab.run(2)
        lab.robot_line.end.replug()
    lab.run(2)
    lab.kit.world.walls[:] = walls
    stood = lab.where()
    for _ in range(20):
        lab.run(1)
        think(lab)
    assert lab.look("P3dx.planner.active") == "false"
    assert lab.where() == pytest.approx(stood, abs=1e-3)


def test_a_box_that_moves_into_the_path_is_driven_around_without_touching_it(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    send(lab, "[0, 2.5, 90deg]")
    lab.run(2.5)
    lab.kit.world.add_crate(0.0, 1.9)
    assert arrived(lab) == "*** path 1"
    assert not lab.kit.body.front


def test_a_map_is_built_by_driving_and_used(tmp_path: Path) -> None:
    lab = Lab.ready(Kit(slip=0.05))
    lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1;", 2)
    lab.say(EVENTS + "P3dx.planner.startMapping;")
    for v, w, seconds in ((0.3, 0.0, 6.0), (0.0, 0.6, 6.0), (0.3, 0.0, 6.0), (0.0, -0.6, 8.0)):
        lab.say(f"P3dx.body.x.speed = {v}; P3dx.body.yaw.speed = {w};")
        for _ in range(round(seconds / 0.2)):
            lab.run(0.2)
            think(lab)
    lab.say("P3dx.body.x.speed = 0; P3dx.body.yaw.speed = 0;", 2)
    assert math.dist(lab.where()[:2], position(lab)[:2]) < 0.06
    assert lab.say(f'P3dx.planner.saveMap("{tmp_path}/built");') == ""
    assert lab.say("P3dx.planner.stopMapping;") == ""
    built = Grid.of(maps.read(f"{tmp_path}/built.yaml"), 0.05)
    for wall in World.room().walls:
        x, y = (wall[0] + wall[2]) / 2, (wall[1] + wall[3]) / 2
        assert built.distance(x, y) < 0.11, wall
    left, bottom, right, top = built.bounds
    assert (left, bottom, right, top) == pytest.approx((-2, -3, 6, 3), abs=0.2)


def test_what_building_a_map_needs(tmp_path: Path) -> None:
    lab = Lab.ready()
    assert "switch it on first: P3dx.body.laser.load = 1" in lab.say("P3dx.planner.startMapping;")
    assert "begin with startMapping" in lab.say('P3dx.planner.saveMap("x");')
    lab.say("P3dx.body.laser.load = 1;", 2)
    lab.say("P3dx.planner.startMapping;", 2)
    assert "cannot be written: No such file" in lab.say('P3dx.planner.saveMap("/no/such/folder/map");')


def test_a_robot_that_is_carried_away_is_lost_and_stands(tmp_path: Path) -> None:
    lab = ready(tmp_path, localization="scan")
    send(lab, "[5, 0, 0]")
    lab.run(2)
    lab.kit.body.set_pose(4.5, -1.5, 2.0)
    lab.run(6)
    assert sorted(lab.heard().splitlines()) == ["*** lost", "*** path 2"]
    assert not lab.kit.body.moving
