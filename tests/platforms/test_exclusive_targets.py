"""A motor that is told something else does not go on with what it was led to, slowly: at the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cia402_lab
import nxt_lab
import pytest
import webots_lab

from urbihw_fakes.nxt.tribot import TriBot

CASES: dict[str, tuple[Callable[[], Any], str, str]] = {
    "cia402": (lambda: cia402_lab.LivingLab.ready(limits={"speed": 2.0}), "drive5.load = 1;", "drive5.val = 60;"),
    "nxt": (lambda: nxt_lab.Lab.ready(TriBot(10.0), limits={"speed": 30}), "", "claw.val = 10000;"),
    "webots": (lambda: webots_lab.Lab.ready(limits={"speed": 2.0}), "", "wheelL.angle = 60;"),
}
MOTIONS = {"cia402": cia402_lab.MOTION, "nxt": nxt_lab.MOTION, "webots": webots_lab.MOTION}


@pytest.mark.parametrize("name", CASES)
def test_a_speed_of_zero_ends_a_way_to_a_place(name: str) -> None:
    make, prepare, go = CASES[name]
    lab: Any = make()
    lab.run(1.0)
    lab.say(prepare, 1.0)
    look = MOTIONS[name].look

    def fastest() -> float:
        look(lab)
        lab.run(0.1)
        return float(max(map(abs, look(lab)[0])))

    lab.say(go, 1.0)
    assert fastest() > 1.0
    lab.say(f"{go.split('.')[0]}.speed = 0;", 1.5)
    assert fastest() < 0.1
    lab.run(1.0)
    assert fastest() < 0.1


@pytest.mark.parametrize("end", ["claw.coast;", "Command.send([4, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]);"])
def test_a_motor_that_is_let_go_gets_no_faster(end: str) -> None:
    lab = nxt_lab.Lab.ready(TriBot(10.0), limits={"acceleration": 20.0})
    lab.run(0.5)
    lab.say("claw.speed = 80;", 0.3)
    assert lab.powers()[1] > 5
    lab.say(end, 0.1)
    assert lab.powers()[1] == 0
    lab.run(0.5)
    assert lab.powers()[1] == 0
