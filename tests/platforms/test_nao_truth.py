"""What a Nao says of itself when somebody else moves it, when it has fallen, and when it cannot be reached."""

from __future__ import annotations

from nao_lab import Lab, stand

STANDS = "[0, 0, 0, 0, 0, 0]"
SEEN = "[nao.othersMoving, robot.moving, robot.speed]"


def standing() -> Lab:
    lab = Lab.ready()
    stand(lab.device.body)
    lab.run(0.3)
    return lab


def test_a_walk_of_somebody_else_is_told_twice() -> None:
    lab = standing()
    lab.say('at (robot.moving) echo("moves") onleave echo("stands");')
    for _ in range(2):
        assert lab.look(SEEN) == f"[false, false, {STANDS}]"
        lab.device.body.drive((0.08, 0.0, 0.0))
        assert "*** moves" in lab.say("", 0.5)
        assert lab.look(SEEN) == "[true, true, [0.08, 0, 0, 0, 0, 0]]"
        lab.device.body.drive((0.0, 0.0, 0.0))
        assert "*** stands" in lab.say("", 0.5)
    lab.say("robot.xSpeed = 0.05|;", 1.0)
    assert lab.look(SEEN) == "[false, true, [0.05, 0, 0, 0, 0, 0]]"
    lab.look("robot.stop")
    lab.run(0.5)
    assert lab.look(SEEN) == f"[false, false, {STANDS}]"


def test_a_walk_goes_on_without_a_link_and_nobody_claims_that_it_stands() -> None:
    lab = standing()
    for _ in range(2):
        lab.say("robot.xSpeed = 0.1|;", 1.0)
        lab.unplug()
        lab.run(1.0)
        assert lab.device.body.walk[0] > 0.05
        assert lab.look("[robot.moving, naoWalk.stale, naoWalk.xSpeed, robot.speed, nao.fallen]") == (
            "[true, true, nan, [nan, nan, 0, nan, 0, 0], nil]"
        )
        lab.end.replug()
        lab.run(3.0)
        assert lab.device.body.walk[0] == 0
        assert lab.look("[robot.moving, naoWalk.stale, naoWalk.xSpeed, robot.speed]") == f"[false, false, 0, {STANDS}]"


def test_a_robot_that_lies_says_so_with_what_helps_twice() -> None:
    lab = standing()
    body = lab.device.body
    for _ in range(2):
        assert lab.look("[nao.fallen, nao.problems]") == "[false, []]"
        body._fall()
        lab.run(0.5)
        assert lab.look("nao.fallen") == "true"
        assert "robot: the robot lies on the ground: ALRobotPosture.goToPosture" in lab.look("nao.problems")
        assert "the robot lies on the ground" in lab.say("naoWalk.xSpeed = 0.1|;", 0.5)
        assert "the robot lies on the ground" in lab.look("naoWalk.why")
        assert any("the robot lies on the ground" in each for each in lab.findings())
        stand(body)
        lab.run(0.5)
        assert "!!!" not in lab.say("naoWalk.xSpeed = 0.1|; sleep(1s); naoWalk.xSpeed = 0|;", 2.0)
