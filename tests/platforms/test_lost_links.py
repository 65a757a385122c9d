"""What a lost link leaves: no slot of any robot reads as fresh, and no trajectory ends as if it had arrived.

All platforms, each link lost twice in one life of the daemon.  The labs are those of the contract of motion.
"""

from __future__ import annotations

from typing import Any

import pytest
from test_motion_contract import motion_of

from urbihw.buses import messages as m
from urbihw.platforms import folders

FRESH = (
    "Global.localSlotNames.filter(closure (name) { !Global.getSlot(name).acceptVoid.isVoid && "
    "!Global.getSlot(name).isA(Executable) && Global.getSlot(name).isA(UObject) && "
    'Global.getSlot(name).hasLocalSlot("stale") && Global.getSlot(name).stale == false })'
)
"""The devices that read as fresh."""
PLATFORMS = sorted(folder.name for folder in folders())


def lose(motion: Any, lab: Any) -> None:
    """The adapter is pulled; what the worker has measured last comes behind the news."""
    told: list[m.Samples] = []
    shown, lab.robot.on_samples = lab.robot.on_samples, told.append
    lab.run(0.3)
    lab.robot.on_samples = shown
    motion.unplug(lab)
    lab.until(lambda: lab.look(f"{motion.slot}.link") == "false")
    for samples in told[-3:]:
        lab.robot._handle_message(samples)
    lab.run(0.1)


@pytest.mark.parametrize("platform", PLATFORMS)
def test_nothing_reads_as_fresh_while_the_link_is_lost(platform: str) -> None:
    motion = motion_of(platform)
    lab = motion.make()
    lab.look(motion.revive)
    lab.run(1.0)
    for _ in range(2):
        fresh = lab.look(FRESH)
        lose(motion, lab)
        assert lab.look(FRESH) == "[]"
        motion.plug(lab)
        lab.until(lambda: lab.look(f"{motion.slot}.link") == "true")
        lab.run(3.0)
        lab.look(motion.revive)
        lab.run(1.0)
        assert lab.look(FRESH) == fresh


TRAJECTORIES = {
    "bioloid": "motor6.val = 140deg time:2s", "so101": "shoulder_lift.val = 0.6 time:2s",
    "nao": "headYaw.val = 0.8 smooth:2s", "nxt": "wheels.speed = 50 time:2s", "cia402": "drive5.speed = 3 time:2s",
    "webots": "wheelL.speed = 2 time:2s", "chain": "motor1.val = 1 time:2s", "segway": "rmp.forwardSpeed = 0.3 time:2s",
    "spykee": "trackL.val = 40 time:2s", "p3dx": "P3dx.body.yaw.speed = 0.5 time:2s",
}  # fmt: skip


@pytest.mark.parametrize("platform", TRAJECTORIES)
def test_a_trajectory_that_outlives_its_link_ends_with_an_error(platform: str) -> None:
    motion, text = motion_of(platform), TRAJECTORIES[platform]
    lab = motion.make()
    lab.look(motion.revive)
    lab.run(1.0)
    for _ in range(2):
        lab.say(f'{{ {text} | echo("arrived") }},', 1.0)
        lose(motion, lab)
        lab.run(2.0)
        heard = lab.heard()
        assert "!!! " in heard and "the link to the robot is down" in heard
        assert "arrived" not in heard
        motion.plug(lab)
        lab.until(lambda: lab.look(f"{motion.slot}.link") == "true")
        lab.run(1.0)
        lab.look(motion.revive)
        lab.run(1.0)
        lab.heard()
    assert "arrived" in lab.say(f'{{ {text} | echo("arrived") }},', 3.0)
