"""Servos of every family on the platform ``chain``: the horn of the fake goes where the object says, and stops."""

from __future__ import annotations

import pytest
from chain_lab import Lab

SERVOS = (
    "RX-28:1,EX-106+:2,MX-28:3,MX-64:4,XL-320:5,XM540-W270:6,MX-106(2.0):7,PH54-200-S500-R:8,H54-200-S500-R:9,YM070:10"
)
ALL = range(1, 11)


@pytest.fixture(scope="module")
def shared() -> Lab:
    return Lab.ready(SERVOS)


def test_they_are_all_motors(shared: Lab) -> None:
    assert [shared.number(f"motor{unit}.val") for unit in ALL] == pytest.approx([0.0] * 10, abs=0.01)
    volts = [14.8, 14.8, 12, 12, 7.4, 12, 12, 24, 24, 24]
    assert [shared.number(f"motor{unit}.voltage") for unit in ALL] == pytest.approx(volts, abs=0.05)


@pytest.mark.parametrize("unit", ALL)
def test_a_joint_goes_by_its_angle_and_holds(shared: Lab, unit: int) -> None:
    shared.say(f"motor{unit}.val = 0.3;", 3.0)
    assert shared.place(unit) == pytest.approx(0.3, abs=0.02)
    assert shared.number(f"motor{unit}.val") == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize("unit", ALL)
def test_a_wheel_turns_both_ways_and_a_stop_ends_it(shared: Lab, unit: int) -> None:
    shared.say(f"motor{unit}.mode = \"velocity\";", 0.5)
    for speed in (1, -1):
        shared.say(f"motor{unit}.speed = {speed};", 1.0)
        assert shared.pace(unit) * speed == pytest.approx(1, abs=0.3)
        shared.say("chain.stop;", 0.5)
        assert shared.pace(unit) == 0
    shared.say(f"motor{unit}.mode = \"position\";", 0.5)
    here = shared.place(unit)
    shared.run(1.0)
    assert shared.place(unit) == pytest.approx(here, abs=0.02)
