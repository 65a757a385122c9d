"""A robot that is absent at the start, for every platform: it comes later, its slots are there, nothing moves."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from lab import RobotLab
from motions import Motion

from urbihw.buses.driver import driver_of
from urbihw.kernel.uobject import NotReady
from urbihw.platforms import find, folders, load
from urbihw.platforms.base import WiredRobot

PLATFORMS = [folder.name for folder in folders()]
REMEMBERED = {"nxt"} | {
    name
    for name in PLATFORMS
    for kind in [load(find(name))]
    if issubclass(kind, WiredRobot) and driver_of(kind.family).device_info is not None
}
"""Platforms whose slots are there before the robot comes; those of an NXT are in its layout."""


class Absent:
    """A lab whose robot is unplugged at the start; ``memory`` is the file of the last run."""

    def __init__(self, platform: str, memory: Path) -> None:
        module = importlib.import_module(f"{platform}_lab")
        self.motion: Motion = module.MOTION
        self.memory = memory
        self.lab: RobotLab = self.begin(module.Lab)
        self.motion.unplug(self.lab)

    def begin(self, kind: type[RobotLab]) -> RobotLab:
        RobotLab.memory = str(self.memory)
        try:
            return kind()
        finally:
            RobotLab.memory = ""

    def slots(self) -> set[str]:
        """The slots of Global that begin with a name of the robot."""
        return set(self.lab.kernel.world.global_.slots)


@pytest.mark.parametrize("platform", PLATFORMS)
def test_it_comes_later_and_nothing_moves(platform: str, tmp_path: Path) -> None:
    absent = Absent(platform, tmp_path / "memory")
    lab, motion = absent.lab, absent.motion
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert lab.robot.waits_for() == str(error)
    assert lab.look(f"{motion.slot}.link") == "false"
    lab.say(f'at ({motion.slot}.linkBack?) echo("here");')
    lab.run(3)
    assert lab.heard() == ""
    motion.plug(lab)
    before = motion.look(lab)[1]
    lab.until(lambda: len(lab.opened) == 2, 20)
    lab.run(0.5)
    assert lab.opened[1] is None and lab.robot.waits_for() == ""
    assert lab.look(f"{motion.slot}.link") == "true"
    assert "here" in lab.heard()
    assert motion.look(lab)[1] == pytest.approx(before, abs=motion.standstill)
    assert lab.robot.status() not in ("", "link down")
    assert lab.look('robot.hasSlot("body")') == "true"


@pytest.mark.parametrize("platform", PLATFORMS)
def test_the_object_robot_is_there_before_the_robot_was_ever_seen(platform: str, tmp_path: Path) -> None:
    absent = Absent(platform, tmp_path / "memory")
    lab, motion = absent.lab, absent.motion
    lab.until(lambda: bool(lab.opened))
    assert isinstance(lab.opened[0], NotReady)
    assert [lab.look(f"robot.{slot}") for slot in ("link", "estop", "problems")] == ["false", "false", "[]"]
    lab.say('at (robot.link) echo("up"); at (robot.estop) echo("held");')
    assert lab.say("robot.stop;") == ""
    assert "held" in lab.say("robot.estop = true;")
    assert lab.look(f"{motion.slot}.estop") == "true"
    lab.say("robot.estop = false;")
    motion.plug(lab)
    lab.until(lambda: len(lab.opened) == 2, 20)
    lab.run(0.5)
    assert ("up" in lab.heard(), lab.look("robot.link")) == (True, "true")
    assert lab.look(f"robot.name == {motion.slot}.name") == "true"


@pytest.mark.parametrize("platform", PLATFORMS)
def test_its_slots_of_the_last_run_are_there_and_are_not_made_twice(
    platform: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = Absent(platform, tmp_path / "memory")
    first.motion.plug(first.lab)
    first.lab.until(lambda: first.lab.opened[-1:] == [None], 20)
    first.lab.run(0.5)
    caplog.clear()
    again = Absent(platform, tmp_path / "memory")
    lab, motion = again.lab, again.motion
    lab.until(lambda: bool(lab.opened))
    assert isinstance(lab.opened[0], NotReady)
    if platform in REMEMBERED:
        assert first.slots() <= again.slots()
    lab.run(2.5)
    assert len(lab.opened) == 1 and lab.look(f"{motion.slot}.link") == "false"
    body = lab.kernel.world.global_.slots.get("robot")
    motion.plug(lab)
    lab.until(lambda: len(lab.opened) == 2, 20)
    assert lab.opened[1] is None
    lab.run(0.5)
    assert platform not in REMEMBERED or lab.kernel.world.global_.slots["robot"] is body
    assert first.slots() == again.slots()
    assert [record.getMessage() for record in caplog.records if record.levelname != "INFO"] == []
