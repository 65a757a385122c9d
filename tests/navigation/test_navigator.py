"""The navigator drives any base: here a cart that knows neither ARCOS nor a wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from cart import Garage

from urbihw.navigation.base import Echo
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

    place = 0.0

    def __init__(self) -> None:
        self.scanned: Callable[[], None] = lambda: None

    def check_on(self) -> None:
        """It is."""

    def echoes(self) -> Sequence[Echo]:
        """None."""
        return ()

    fresh_echoes = echoes


def test_scans_that_do_not_fit_the_map_are_told(garage: Garage, tmp_path: Path) -> None:
    cart, scanner = garage.cart, BlindScanner()
    cart.scanner = scanner
    cart.navigation = NavigationOptions(localization=SCAN)
    cart.planner.init(cart)
    name_map(garage, tmp_path)
    for _ in range(20):
        scanner.scanned()
    assert garage.say("") == ["*** lost: the laser does not see what the map shows (score 0.00)"]
