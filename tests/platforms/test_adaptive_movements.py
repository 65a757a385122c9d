"""``adaptive: true`` on robots that report their positions late and do not stir for small errors."""

from __future__ import annotations

import bioloid_lab
import nxt_lab
import pytest
from lab import RobotLab


def seconds(lab: RobotLab, place: str, movement: str) -> float:
    """How long a movement takes, to a tenth of a second."""
    lab.say("var Global.movementOver = false|;", 0.02)
    lab.say(f"{{ {place} = {movement} | Global.movementOver = true }},", 0.02)
    tenths = 0
    while lab.say("movementOver;", 0.02) == "false":
        assert tenths < 200, "it does not end"
        lab.say("", 0.08)
        tenths += 1
    return tenths / 10


def test_a_servo_keeps_its_speed() -> None:
    lab = bioloid_lab.lab()
    assert seconds(lab, "motor6.val", "90deg speed: 45deg adaptive: true") == pytest.approx(2.0, abs=0.3)
    lab.say("", 0.5)
    assert lab.number("motor6.val") == pytest.approx(1.571, abs=0.02)


def test_a_motor_of_an_nxt_keeps_its_speed() -> None:
    lab = nxt_lab.Lab.ready()
    assert seconds(lab, "wheelL.val", "180 speed: 90 adaptive: true") == pytest.approx(2.0, abs=0.3)
    lab.say("", 0.5)
    assert lab.number("wheelL.val") == pytest.approx(180, abs=3)


def test_a_movement_too_small_for_the_motor_ends() -> None:
    lab = nxt_lab.Lab.ready()
    assert seconds(lab, "wheelL.val", "1.5 speed: 1 adaptive: true") < 10
