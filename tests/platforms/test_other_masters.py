"""What another master has set moving stands after our stop, too: a stop stops the robot, not our memory of it.

All platforms; the daemon has moved nothing.  ``MOTION.others`` of a ``<name>_lab.py`` tells who else can move it.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from motions import Kind, Motion, OtherMaster, Scene
from test_motion_contract import motion_of

from urbihw.platforms import folders

NOTICED = 1.2
"""Seconds in which a motion that begins during an emergency stop is noticed."""
MOTIONS = {folder.name: motion_of(folder.name) for folder in folders()}
CASES = [(name, other) for name, motion in MOTIONS.items() for other in motion.others]


def push(scene: Scene, other: OtherMaster) -> None:
    """Let the other master set the robot going."""
    begin = scene.now()
    other.go(scene.lab)
    scene.run(other.lead)
    assert scene.peak(begin) > other.goes, "the other master does not move it"


def stands(scene: Scene, patience: float) -> None:
    """See that the body stands within some time, and stays so."""
    since = scene.now()
    scene.run(3.0)
    assert scene.moved_last() <= since + scene.motion.standstill + patience, "it goes on"


@pytest.mark.parametrize(("platform", "name"), CASES)
def test_a_motion_of_another_master_is_stopped(platform: str, name: str, tmp_path: Path) -> None:
    motion = MOTIONS[platform]
    other = motion.others[name]
    kind = Kind("", 0.0, prepare=other.prepare, make=other.make, ready=other.ready)
    scene = Scene(motion, kind, tmp_path, [])
    for stop in (scene.stop, scene.estop):
        push(scene, other)
        stop()
        stands(scene, 0.2)
    other.go(scene.lab)
    stands(scene, NOTICED)


@pytest.mark.parametrize("platform", MOTIONS)
def test_each_platform_tells_who_else_can_move_its_robot(platform: str) -> None:
    motion: Motion = MOTIONS[platform]
    assert bool(motion.others) != bool(motion.alone)


ZEROS = {
    ("bioloid", "wheel"): "motor7.speed = 0;",
    ("chain", "X wheel"): "motor3.speed = 0;",
    ("nxt", "motors"): "wheelL.speed = 0 | wheelR.speed = 0 | claw.speed = 0;",
    ("cia402", "drive that is on"): "drive5.speed = 0;",
    ("spykee", "tracks"): "trackL.val = 0 | trackR.val = 0;",
    ("nao", "walk"): "naoWalk.xSpeed = 0;",
}
"""What a client says that lets stand what another master has set moving, though it stands already by our own orders."""


@pytest.mark.parametrize(("platform", "name"), ZEROS)
def test_a_client_that_writes_zero_stops_it_too(platform: str, name: str, tmp_path: Path) -> None:
    motion = MOTIONS[platform]
    other = motion.others[name]
    scene = Scene(motion, Kind("", 0.0, prepare=other.prepare, make=other.make, ready=other.ready), tmp_path, [])
    for _ in range(2):
        scene.lab.say(ZEROS[platform, name], 0.5)
        push(scene, other)
        scene.lab.say(ZEROS[platform, name])
        stands(scene, 0.3)
