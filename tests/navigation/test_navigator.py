"""The navigator drives any base: here a cart that knows neither ARCOS nor a wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cart import Garage

from urbihw.extras import install_command
from urbihw.navigation.base import Echo
from urbihw.navigation.frames import ORIGIN, compose, frame_of
from urbihw.navigation.options import SCAN, NavigationOptions

MAP = """2D-Map
Cairn: RobotHome 1000 1000 0 "" ICON "Home"
LINES
0 0 6000 0
6000 0 6000 4000
6000 4000 0 4000
0 4000 0 0
3000 0 3000 2500
"""


@pytest.fixture
def garage() -> Garage:
    return Garage()


def name_map(garage: Garage, folder: Path, text: str = MAP) -> list[str]:
    """Let the cart drive on a map; what is said."""
    (folder / "garage.map").write_text(text, "ascii")
    return garage.say(f'cart.planner.mapFileName = "{folder}/garage.map"|;') + garage.think()


def drive(garage: Garage, goal: str, seconds: float = 60.0) -> list[str]:
    """What is said until the cart is there."""
    said = garage.say(f"cart.moveTo({goal});") + garage.think()
    for _ in range(8):
        said += garage.say("", seconds / 8) + garage.think()
    return said


def test_a_cart_reaches_a_goal_behind_a_wall(garage: Garage, tmp_path: Path) -> None:
    assert name_map(garage, tmp_path) == []
    assert garage.say("cart.odometry.position; cart.planner.ready;") == ["[1, 1, 0, 0]", "true"]
    assert drive(garage, "[5, 1, 90deg]") == ["*** path 1"]
    # The map's home is (1, 1), and there the cart's own frame begins.
    assert math.dist(garage.cart.pose[:2], (4, 0)) < 0.1
    assert math.sin(garage.cart.pose[2]) > 0.99
    assert (garage.cart.v, garage.cart.w) == (0.0, 0.0)


def test_messages_name_the_slots_of_the_base(garage: Garage, tmp_path: Path) -> None:
    assert garage.say("cart.moveTo([1, 1, 0]);")[0].endswith("there is no map; set cart.planner.mapFileName first")
    name_map(garage, tmp_path)
    garage.cart.motors = False
    assert garage.say("cart.moveTo([1, 1, 0]);")[0].endswith("the motors are off")


def test_what_bumpers_see_is_driven_around(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2.5, 1, 0]);")
    garage.think()
    garage.say("", 1.0)
    garage.cart.near = [(0.3, 0.0)]
    garage.say("", 3.5)
    garage.cart.near = []
    assert garage.think() == []
    assert garage.say("cart.planner.active;") == ["true"]
    assert drive(garage, "[2.5, 1, 0]")[-1] == "*** path 1"


def test_a_panel_can_read_the_walls_while_there_is_a_map(garage: Garage, tmp_path: Path) -> None:
    assert garage.say("cart.planner.walls;") == ["[]"]
    name_map(garage, tmp_path)
    garage.think()
    (line,) = garage.say("cart.planner.walls.size > 2 && cart.planner.walls[0].size == 4;")
    assert line == "true"
    garage.say('cart.planner.mapFileName = "";')
    assert garage.say("cart.planner.walls;") == ["[]"]


def test_a_goal_named_while_another_map_is_read_waits_for_it(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    said = garage.say(f'cart.planner.mapFileName = "{tmp_path}/garage.map"|; cart.moveTo([2, 1, 0]);')
    for _ in range(10):
        said += garage.think() + garage.say("", 3.0)
    assert said == ["*** path 1"]


def test_localization_by_scans_needs_a_scanner(garage: Garage, tmp_path: Path) -> None:
    garage.cart.navigation = NavigationOptions(localization=SCAN)
    (line,) = name_map(garage, tmp_path)
    assert line.endswith("localization by scans needs a laser, and this robot has none")


class BlindScanner:
    """A scanner that is on and sees nothing."""

    place = stamp = 0.0
    wanted = True

    def __init__(self) -> None:
        self.scanned: Callable[[], None] = lambda: None

    def check_on(self) -> None:
        """It is."""

    def echoes(self) -> Sequence[Echo]:
        """None."""
        return ()

    fresh_echoes = echoes

    def is_fresh(self) -> bool:
        """It is."""
        return True


def test_scans_that_do_not_fit_the_map_are_told(garage: Garage, tmp_path: Path) -> None:
    cart, scanner = garage.cart, BlindScanner()
    cart.scanner = scanner
    cart.navigation = NavigationOptions(localization=SCAN)
    cart.planner.init(cart)
    name_map(garage, tmp_path)
    for _ in range(20):
        scanner.scanned()
    why = "the laser does not see what the map shows (score 0.00); searching the map: turn or drive the robot"
    assert garage.say("") == [f"*** lost: {why}"]
    assert garage.say("cart.planner.ready;") == ["false"]


def test_scans_that_do_not_fit_the_map_end_it_without_the_extra(
    garage: Garage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urbihw.navigation.locator.load_montecarlo", lambda: None)
    cart, scanner = garage.cart, BlindScanner()
    cart.scanner = scanner
    cart.navigation = NavigationOptions(localization=SCAN)
    cart.planner.init(cart)
    name_map(garage, tmp_path)
    for _ in range(20):
        scanner.scanned()
    (line,) = garage.say("")
    assert line.endswith("searching the map needs numpy and scipy: " + install_command("navigation"))
    assert garage.say("cart.planner.mapFileName;") == ['""']


@pytest.mark.parametrize(
    "goal, why",
    [("[3, 1, 0]", "the goal (3, 1) is in a wall; choose a free place"),
     ("[5.9, 1, 0]", "the goal (5.9, 1) is 0.10 m from a wall, and the robot needs 0.25 m; choose another, or a "
      "smaller clearance in the settings"),
     ("[7, 1, 0]", "the goal (7, 1) is outside the map, which goes from (0, 0) to (6, 4) m")],
)  # fmt: skip
def test_goals_where_it_cannot_stand_are_refused_at_once(garage: Garage, tmp_path: Path, goal: str, why: str) -> None:
    name_map(garage, tmp_path)
    (line,) = garage.say(f"cart.moveTo({goal});")
    assert line.endswith(why)
    assert garage.say("cart.planner.active;") == ["false"]


def test_a_refused_goal_leaves_the_one_before(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2, 1, 0]);")
    garage.think()
    garage.say("cart.moveTo([3, 1, 0]);")
    assert garage.say("cart.planner.active;") == ["true"]
    assert garage.say("", 20.0) == ["*** path 1"]


def test_the_map_with_the_path_and_the_robot_is_drawn(garage: Garage, tmp_path: Path) -> None:
    (line,) = garage.say('cart.planner.drawMap("x.svg");')
    assert line.endswith("there is no map; set cart.planner.mapFileName first")
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2, 1, 0]);")
    garage.think()
    assert garage.say(f'cart.planner.drawMap("{tmp_path}/x.svg");') == []
    root = ElementTree.parse(tmp_path / "x.svg").getroot()
    kinds = [part.get("class") for part in root]
    assert kinds.count("wall") == 5 and kinds.count("path") == 1 and "robot" in kinds
    (line,) = garage.say('cart.planner.drawMap("/no/such/folder/x.svg");')
    assert line.endswith("/no/such/folder/x.svg: cannot be written: No such file or directory")


@pytest.mark.parametrize(("metres", "degrees"), [(0.1, 5.0), (0.03, 2.0)])
def test_success_is_within_the_tolerance(garage: Garage, tmp_path: Path, metres: float, degrees: float) -> None:
    garage.cart.navigation = NavigationOptions(tolerance=metres, heading_tolerance=degrees)
    name_map(garage, tmp_path)
    assert drive(garage, "[5, 1, 90deg]") == ["*** path 1"]
    assert math.dist(garage.cart.pose[:2], (4, 0)) <= metres
    assert abs(math.degrees(garage.cart.pose[2]) - 90) <= degrees


def test_who_stands_beside_the_goal_approaches_it_again(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2, 1, 180deg]);")
    garage.think()
    garage.say("", 4.0)
    # The final turn has begun; the robot is pushed aside.
    assert garage.cart.v == 0 and garage.cart.w != 0
    x, y, heading = garage.cart.pose
    garage.cart.pose = (x, y + 0.4, heading)
    said = garage.say("", 8.0)
    for _ in range(3):
        said += garage.think() + garage.say("", 10.0)
    assert said == ["*** path 1"]
    assert math.dist(garage.cart.pose[:2], (1, 0)) <= 0.1


def test_an_obstacle_on_the_goal_is_waited_for_and_then_told(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2, 1, 0]);")
    garage.think()
    garage.say("", 1.5)
    said: list[str] = []
    for _ in range(20):
        # A box on the goal, of which the bumpers see the near side while the robot is before it.
        garage.cart.near = [(1.8 - 1 - garage.cart.pose[0], 0.0)]
        said += garage.say("", 3.0) + garage.think()
        if said:
            break
    assert said == ["*** path 0"]
    assert garage.cart.pose[0] < 0.6
    (failure,) = garage.say("cart.planner.failure;")
    assert failure in ('"obstacles that the sensors see close the way"', '"something stands in the way"')


def test_a_stop_during_the_wait_for_an_obstacle_holds(garage: Garage, tmp_path: Path) -> None:
    name_map(garage, tmp_path)
    garage.say("cart.moveTo([2, 1, 0]);")
    garage.think()
    garage.say("", 1.5)
    garage.cart.near = [(0.4, 0.0)]
    garage.say("", 4.0)
    garage.cart.planner.cancel()
    garage.cart.near = []
    stood = garage.cart.pose
    assert garage.think() + garage.say("", 20.0) == ["*** path 2"]
    assert garage.cart.pose == stood


DOORS = """2D-Map
Cairn: RobotHome 1000 1000 0 "" ICON "Home"
LINES
0 0 8000 0
8000 0 8000 12000
8000 12000 0 12000
0 12000 0 0
4000 0 4000 400
4000 1600 4000 10800
"""
"""A wall with a door in front of the robot, and another one at its far end."""


@pytest.mark.parametrize(("stays", "comes_by"), [(8.0, "the door"), (60.0, "the other door")])
def test_a_door_that_is_closed_for_a_while_is_waited_for(
    garage: Garage, tmp_path: Path, stays: float, comes_by: str
) -> None:
    name_map(garage, tmp_path, DOORS)
    garage.say("cart.moveTo([6, 1, 0]);")
    garage.think()
    farthest, past = 0.0, 0.0
    said: list[str] = []
    while not said and past < 200:
        x, y, _ = garage.cart.pose
        # A box in the door, which begins at (3, 0) of the cart's own frame; its bumpers see only what is ahead.
        shut = past < stays and x < 3 and y < 1
        seen = [frame_of(ORIGIN, garage.cart.pose)] * shut
        box = [compose(frame, (3.0, across, 0.0))[:2] for frame in seen for across in (-0.4, -0.2, 0.0, 0.2, 0.4)]
        garage.cart.near = [point for point in box if point[0] > 0]
        said = garage.say("", 0.5) + garage.think()
        past += 0.5
        farthest = max(farthest, garage.cart.pose[1])
    assert said == ["*** path 1"]
    assert (farthest < 1) is (comes_by == "the door")


def test_a_scan_between_two_readings_of_the_wheels_was_taken_on_the_way_between(garage: Garage) -> None:
    odometry = garage.cart.odometry
    for number in range(4):
        odometry.show_pose(0.1 * number, 0.0, 0.2 * number, 0.1, 0.2, 100.0 + number)
    assert odometry.absolute_at(102.5) == pytest.approx((0.25, 0.0, 0.5))
    # After the last one the speeds last for a while, and before the first one nothing is known.
    assert odometry.absolute_at(103.2) == pytest.approx((0.32, 0.0, 0.64))
    assert odometry.absolute_at(110.0)[0] < 0.35
    odometry.correct((5.0, 1.0, 0.5), 102.5)
    assert odometry.absolute_at(102.5) == pytest.approx((5.0, 1.0, 0.5))
    assert odometry.absolute == pytest.approx((5.05, 1.0, 0.6))
