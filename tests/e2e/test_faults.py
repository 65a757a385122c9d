"""What becomes of a robot that moves when something goes wrong, with real processes; all of it: ``bench.safety``."""

from __future__ import annotations

import pytest
from faults_lab import EVENTS, run
from moving_robots import RIGS, Rig

pytestmark = pytest.mark.e2e

DEAD_MAN, HUNG, RESTART = 1.5, 2.0, 3.0
"""Seconds of silence until a robot is stopped, a worker is killed, and another one is there on a busy machine."""
BUSY = 4.0
"""Seconds that a body may need to stand, and a busy machine to come to it; how soon it stands is held in simulated
time."""
HURRY = 2.2
"""A leap has 3 to 8 times the speed of the swing. A busy machine lets movements halt and hurry, with no event at all;
1.1 is held in simulated time."""
WATCHDOG = 1.0
"""Seconds without a feed until the program on a Nao stops it."""
MOTION_ENDS = "this statement had begun"


@pytest.mark.parametrize(
    ("rig", "event", "within", "reads"),
    [
        ("Bioloid, a joint that swings", "worker killed", RESTART, MOTION_ENDS),
        ("Bioloid, a wheel", "worker held for 5 s", HUNG + RESTART, ""),
        ("Bioloid, a wheel", "worker and its spare held", RESTART, ""),
        ("Bioloid, a wheel", "client killed", 0.0, ""),
        ("NXT", "daemon held for 3 s", DEAD_MAN, ""),
        ("NXT", "SIGTERM beside `loop\\|{},`", 0.0, "closed"),
        ("Segway RMP", "daemon and worker killed", 0.4, "closed"),
        ("Segway RMP", "adapter pulled for 3 s", 0.4, ""),
        ("Pioneer 3-DX", "daemon killed", 0.0, "closed"),
        ("CiA 402 drive", "worker killed", 0.5, ""),
        ("CiA 402 drive", "emergency stop by the control socket", 0.0, ""),
        ("Spykee", "worker killed", RESTART, ""),
        ("Spykee", "client killed", 0.0, ""),
        ("Nao, a walk", "two deaths of the worker within 10 s", RESTART, ""),
        ("Nao, a walk", "motion begun by another master, emergency stop", 0.0, ""),
        ("Nao, a walk, with the watchdog on the robot", "daemon and worker killed", WATCHDOG, "closed"),
        ("Nao, a walk, with the watchdog on the robot", "adapter pulled for 3 s", WATCHDOG, ""),
        ("Nao, a joint that swings", "client killed", 0.0, ""),
    ],
)
def test_the_body_stands_and_stays_so(rig: str, event: str, within: float, reads: str) -> None:
    (robot,) = [one for one in RIGS if one.name == rig]
    (happens,) = [one for one in EVENTS if one.name == event]
    outcome = run(robot, happens)
    assert outcome.standstill < within + BUSY
    assert outcome.stays
    assert reads in outcome.reads


@pytest.mark.parametrize("robot", [one for one in RIGS if one.live], ids=lambda one: one.platform)
def test_a_swing_goes_on_when_the_adapter_is_back_no_faster_than_before(robot: Rig) -> None:
    (happens,) = [one for one in EVENTS if "pulled" in one.name]
    before, after = run(robot, happens).peaks
    assert before / 2 < after < HURRY * before
