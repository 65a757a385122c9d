"""The orders of ``urbihw drive`` at the server (``drive.u``), and what the body of a Segway does, in simulated time."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest
from paths import put_on_map
from segway_lab import Lab

PROGRAM = files("urbihw.client").joinpath("drive.u").read_text()


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
        answer = lab.say(f"drive.order({x}, 0, 0.5, System.time);", 0.1)
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


@pytest.mark.parametrize("movement", ["robot.moveTo([2.5, 1, 0])", "robot.go(4)"])
def test_a_movement_of_somebody_else_goes_on_while_the_key_is_held_and_after(
    lab: Lab, movement: str, tmp_path: Path
) -> None:
    put_on_map(lab, "segway", tmp_path)
    _order(lab, -0.3)
    assert lab.base.body.speed < -0.2
    lab.look(f"disown({movement})")
    lab.thought()
    assert _order(lab, -0.3, 2.0) == "true"
    assert lab.base.body.speed > 0.1
    assert _order(lab, 0.0, 2.0) == "false"
    assert lab.base.body.speed > 0.1
    # A key that is pressed anew takes the base, as any write does.
    assert _order(lab, -0.3, 2.0) == "false"
    assert lab.base.body.speed < -0.2


def test_somebody_else_who_writes_one_speed_gets_the_other_one_as_0(lab: Lab) -> None:
    for _ in range(10):
        lab.say("drive.order(0.3, 0.4, 0.5, System.time);", 0.1)
    lab.look("rmp.forwardSpeed = 0.1")
    assert _order(lab, 0.3) == "true"
    assert _speed(lab) == pytest.approx(0.1, abs=0.03)
    assert lab.look("rmp.yawSpeed.abs < 0.02") == "true"


def test_an_order_that_was_held_up_on_its_way_moves_nothing(lab: Lab) -> None:
    for _ in range(10):
        assert lab.say("drive.order(0.3, 0, 0.5, System.time - 0.6);", 0.1).strip('"').startswith("false|true|")
        assert _speed(lab) < 0.01
    _order(lab, 0.3)
    assert _speed(lab) > 0.2
    lab.say("drive.order(0.3, 0, 0.5, System.time - 0.6);", 0.05)
    assert lab.look("robot.xSpeed") == "0"
    lab.run(1)
    assert _speed(lab) < 0.01
    assert _order(lab, 0.3) == "false"
    assert _speed(lab) > 0.2


def test_a_refused_order_is_an_error_each_time(lab: Lab) -> None:
    lab.look("segway.estop = true")
    for _ in range(2):
        assert "emergency stop" in lab.say("drive.order(0.3, 0, 0.5, System.time);")
    lab.look("segway.estop = false")
    assert _order(lab, 0.3) == "false"
    assert _speed(lab) > 0.2
