"""What a Nao tells of itself, and a robot that lacks some of it, such as an emulator: it is served with what it has."""

from __future__ import annotations

import logging

import pytest
from nao_lab import Lab

from urbihw_nao_fakes.device import Nao


@pytest.mark.parametrize("lacks", [("getBodyNames",), ("getBodyNames", "getRobotConfig")])
def test_a_robot_that_does_not_name_its_joints_has_those_that_its_memory_has(lacks: tuple[str, ...]) -> None:
    robot = Nao()
    for uid, method in list(robot.motion.methods.items()):
        if method.name in lacks:
            del robot.motion.methods[uid]
    lab, usual = Lab.ready(device=robot), Lab.ready()
    assert lab.look("nao.allJoints.size") == usual.look("nao.allJoints.size") != "0"
    lab.say("robot.wakeUp;", 5.0)
    lab.say("headYaw.val = 0.5;", 2.0)
    assert robot.body.joints["HeadYaw"].angle == pytest.approx(0.5, abs=0.02)


def test_each_service_tells_its_own_version() -> None:
    lab = Lab.ready()
    assert lab.say("[ALMotion.version, ALMemory.version, ALMotion.ping];", 0.2) == '["2.1.4.13", "2.1.4.13", true]'


def test_a_fall_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say("robot.wakeUp;", 5.0)
    assert lab.console().line("push") == "ok"
    with caplog.at_level(logging.INFO):
        lab.run(2.0)
    assert sum("lies on the ground" in line for line in caplog.messages) == 1
    assert "lies on the ground" in lab.look("robot.problems")


def test_the_console_of_the_fake_survives_a_wrong_name() -> None:
    lab = Lab.ready()
    assert "WRONGNAME" in lab.console().line("light WRONGNAME")
    assert lab.console().line("light FaceLeds") == "000000"
