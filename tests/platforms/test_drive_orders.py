"""The orders of ``urbihw drive`` at the server (``drive.u``), and what the body of a Segway does, in simulated time."""

from __future__ import annotations

from importlib.resources import files

import pytest
from segway_lab import Lab

PROGRAM = files("urbihw.cli").joinpath("drive.u").read_text()


@pytest.fixture
def lab() -> Lab:
    made = Lab.ready()
    assert made.say(PROGRAM) == ""
    return made


def _speed(lab: Lab) -> float:
    return abs(lab.base.body.speed)


def _order(lab: Lab, x: float, seconds: float = 1.0) -> str:
    """Order a speed ten times in a second; the last answer."""
    answer = ""
    for _ in range(round(seconds * 10)):
        answer = lab.say(f"drive.order({x}, 0, 0.5);", 0.1)
    return answer.strip('"').partition("|")[0]


def test_without_orders_the_base_stands_after_half_a_second(lab: Lab) -> None:
    assert _order(lab, 0.3) == "false"
    assert _speed(lab) > 0.2
    lab.run(0.3)
    assert lab.look("robot.xSpeed") == "0.3"
    lab.run(0.3)
    assert lab.look("robot.xSpeed") == "0"
    lab.run(1)
    assert _speed(lab) < 0.01


@pytest.mark.parametrize("keep", [False, True])
def test_the_base_stands_when_the_connection_is_gone(lab: Lab, keep: bool) -> None:
    lab.robot.motion.keep = keep
    _order(lab, 0.3)
    lab.lobby.close()
    lab.run(2)
    assert _speed(lab) < 0.01


@pytest.mark.parametrize("other", ["robot.stop", "robot.xSpeed = 0.1"])
def test_somebody_else_has_the_base_until_the_keys_are_released(lab: Lab, other: str) -> None:
    _order(lab, 0.3)
    lab.look(other)
    assert _order(lab, 0.3) == "true"
    assert lab.look("robot.xSpeed") == ("0.1" if "0.1" in other else "0")
    # The release leaves the other alone.
    assert _order(lab, 0.0) == "false"
    assert lab.look("robot.xSpeed") == ("0.1" if "0.1" in other else "0")
    assert _order(lab, 0.3) == "false"
    assert _speed(lab) > 0.2


def test_a_refused_order_is_an_error_each_time(lab: Lab) -> None:
    lab.look("segway.estop = true")
    for _ in range(2):
        assert "emergency stop" in lab.say("drive.order(0.3, 0, 0.5);")
    lab.look("segway.estop = false")
    assert _order(lab, 0.3) == "false"
    assert _speed(lab) > 0.2
