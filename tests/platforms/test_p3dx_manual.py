"""The manual's Pioneer chapter (26): every slot that it names, typed in, does what the chapter says of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from p3dx_lab import Lab

from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

RING = {
    "[left][front]": 0, "[front][left][left]": 1, "[front][left][front]": 2, "[front][front][left]": 3,
    "[front][front][right]": 4, "[front][right][front]": 5, "[front][right][right]": 6, "[right][front]": 7,
    "[right][back]": 8, "[back][right][right]": 9, "[back][right][back]": 10, "[back][front][right]": 11,
    "[back][front][left]": 12, "[back][left][back]": 13, "[back][left][left]": 14, "[left][back]": 15,
}  # fmt: skip
"""The manual's places, and the numbers of the sonars there (ARIA's p3dx.p)."""


@pytest.fixture
def lab() -> Iterator[Lab]:
    yield Lab.ready()


def driving(world: World | None = None) -> Lab:
    """A robot with its motors on and nothing lost to slip."""
    lab = Lab.ready(Kit(world if world is not None else World(), slip=0.0))
    assert lab.say("P3dx.body.load = 1;", 0.5) == "1"
    return lab


def test_identity(lab: Lab) -> None:
    assert lab.say("P3dx.robotType; P3dx.name; P3dx.model; P3dx.serial;") == '"Pioneer"\n"fake"\n"p3dx-sh"\n"SIM1"'
    assert "can only be read" in lab.say('P3dx.name = "me";')
    assert lab.look("robot.body === P3dx.body") == "true"


def test_go_and_turn_cover_what_they_say_and_wait() -> None:
    lab = driving()
    assert lab.say("var t = time| P3dx.go(0.8)| echo(time - t > 2);", 6) == "*** true"
    assert lab.where()[0] == pytest.approx(0.8, abs=0.01)
    assert lab.say('P3dx.turn(-90deg); echo("there");', 6) == "*** there"
    assert math.degrees(lab.where()[2]) == pytest.approx(90, abs=1)
    lab.say("P3dx.go(-0.5);", 6)
    assert lab.where()[1] == pytest.approx(-0.5, abs=0.02)


def test_stop_ends_whatever_moves() -> None:
    lab = driving()
    lab.say("P3dx.go(5),", 2)
    lab.say("P3dx.stop;", 1.5)
    where = lab.where()
    lab.run(2)
    assert lab.where() == where
    lab.say("P3dx.speedDelta = 0.3;", 2)
    assert lab.where()[0] > where[0] + 0.2
    lab.say("P3dx.stop;", 2)
    assert not lab.kit.body.moving


def test_stopping_the_job_that_called_go_stops_the_robot() -> None:
    lab = driving()
    lab.say("trip: P3dx.go(5),", 2)
    lab.say("trip.stop;", 1.5)
    assert not lab.kit.body.moving and lab.kit.body.motors


def test_an_order_under_an_emergency_stop_is_told_of_the_stop_and_not_of_the_motors(lab: Lab) -> None:
    lab.look("P3dx.estop = true")
    lab.run(1)
    for order in ("P3dx.go(1);", "P3dx.turn(1);", "P3dx.body.x.speed = 0.1;"):
        heard = lab.say(order, 0.5)
        assert "emergency stop" in heard and "motors" not in heard, (order, heard)


def test_body_load_switches_the_motors(lab: Lab) -> None:
    assert lab.look("P3dx.body.load") == "0"
    assert "the motors are off" in lab.say("P3dx.body.x.speed = 0.1;")
    lab.say("P3dx.body.load = 1;", 0.5)
    assert lab.kit.body.motors and lab.look("P3dx.body.load") == "1" == lab.look("P3dx.motorsLoad")
    lab.say("P3dx.body.x.speed = 0.2;", 1)
    lab.say("P3dx.body.load = 0;", 1)
    assert not lab.kit.body.motors and lab.look("P3dx.body.load") == "0"
    lab.say("P3dx.body.load = 1;", 1)
    assert not lab.kit.body.moving


def test_wheel_speeds() -> None:
    lab = driving()
    lab.say("P3dx.body.yaw.speed = 0.5;", 2)
    assert lab.number("P3dx.body.wheel[right].speed") == pytest.approx(0.089, abs=0.01)
    assert lab.number("P3dx.body.wheel[left].speed") == pytest.approx(-0.089, abs=0.01)
    assert "can only be read" in lab.say("P3dx.body.wheel[left].speed = 1;")


def test_speeds_are_read_and_written_and_limited() -> None:
    lab = driving()
    lab.say("P3dx.body.x.speed = 0.2; P3dx.body.yaw.speed = -0.3;", 2)
    assert lab.number("P3dx.body.x.speed") == pytest.approx(0.2, abs=0.01)
    assert lab.number("P3dx.body.yaw.speed") == pytest.approx(-0.3, abs=0.02)
    assert lab.number("P3dx.speedAlpha") == lab.number("P3dx.body.yaw.speed")
    lab.say("P3dx.body.x.speed = 100;", 4)
    assert lab.number("P3dx.body.x.speed") == pytest.approx(0.75)
    assert lab.number("P3dx.body.x.speed->rangemax") == 0.75
    assert "takes a number" in lab.say('P3dx.body.x.speed = "fast";')
    assert "finite" in lab.say("P3dx.body.x.speed = nan;")


def test_safety_distances_slow_down_and_stop() -> None:
    lab = driving(World.room())
    lab.say("P3dx.body.safetyDistanceMin = 0.5; P3dx.body.safetyDistanceMax = 1.5;")
    lab.say("P3dx.body.x.speed = 0.4;", 6)
    assert 0.05 < lab.number("P3dx.body.x.speed") < 0.35
    lab.run(20)
    assert lab.number("P3dx.body.sonar[front][front][left].val") == pytest.approx(0.5, abs=0.05)
    assert not lab.kit.body.moving
    lab.say("P3dx.body.x.speed = -0.2;", 2)
    assert lab.number("P3dx.body.x.speed") == pytest.approx(-0.2, abs=0.01)
    assert [lab.number(f"P3dx.dist{which}") for which in ("Min", "Max")] == [0.5, 1.5]


def test_odometry() -> None:
    lab = driving()
    assert lab.look("P3dx.body.odometry.position") == "[0, 0, 0, 0]"
    lab.say("P3dx.turn(-90deg); P3dx.go(1); P3dx.go(-0.5);", 24)
    assert lab.number("P3dx.body.odometry.x") == pytest.approx(0, abs=0.05)
    assert lab.number("P3dx.body.odometry.y") == pytest.approx(0.5, abs=0.08)
    assert lab.number("P3dx.body.odometry.z") == 0
    assert lab.number("P3dx.body.odometry.yaw") == pytest.approx(math.pi / 2, abs=0.05)
    assert lab.number("P3dx.body.odometry.coveredDistance") == pytest.approx(1.5, abs=0.1)
    assert lab.number("P3dx.body.odometry.coveredAngle") == pytest.approx(math.pi / 2, abs=0.1)
    yaw = lab.number("P3dx.body.odometry.yaw")
    lab.say("P3dx.body.odometry.position = [10, 20, 0, 0];")
    assert lab.look("P3dx.body.odometry.position") == "[10, 20, 0, 0]"
    assert lab.number("P3dx.body.odometry.yaw") == yaw
    lab.say("P3dx.go(1);", 9)
    assert lab.number("P3dx.body.odometry.position[0]") == pytest.approx(11, abs=0.05)
    assert "expected [x, y, z, yaw]" in lab.say("P3dx.body.odometry.position = [1, 2];")


@pytest.mark.parametrize("place", RING)
def test_each_sonar_is_where_the_manual_says(lab: Lab, place: str) -> None:
    lab.run(1)
    expected = lab.kit.robot.sonars.distance(RING[place])
    assert lab.number(f"P3dx.body.sonar{place}.val") == pytest.approx(expected, abs=0.002)


def test_sonar_load(lab: Lab) -> None:
    assert lab.look("P3dx.body.sonar.load") == "1"
    lab.say("P3dx.body.sonar.load = 0;", 1)
    assert lab.look("P3dx.body.sonar.load") == "0" and not lab.kit.robot.sonars.on
    assert lab.look("P3dx.body.sonar[left][front].val") == "nan"
    lab.say("P3dx.body.sonar.load = 1;", 1)
    assert lab.number("P3dx.body.sonar[left][front].val") == pytest.approx(2.864, abs=0.002)


def test_a_robot_that_drives_to_a_wall_stops_by_at_sonar() -> None:
    lab = driving(World.room())
    lab.say("at (P3dx.body.sonar[front][front][left].val < 0.8) P3dx.stop;")
    lab.say("P3dx.body.x.speed = 0.4;", 15)
    assert not lab.kit.body.moving
    assert 2.0 < lab.where()[0] < 2.6
    assert not lab.kit.body.front


def test_laser(lab: Lab) -> None:
    assert lab.look("P3dx.body.laser.load") == "0"
    lab.say("P3dx.body.laser.load = 1;", 3)
    assert lab.look("P3dx.body.laser.load") == "1" == lab.look("P3dx.laserLoad")
    assert lab.look("P3dx.body.laser.val.size") == "181"
    assert lab.number("P3dx.body.laser.angleMax") == pytest.approx(math.pi / 2, abs=1e-4)
    assert lab.number("P3dx.body.laser.angleMin") == pytest.approx(-math.pi / 2, abs=1e-4)
    assert lab.number("P3dx.body.laser.resolution") == pytest.approx(math.radians(1), abs=1e-4)
    assert lab.number("P3dx.body.laser.laserDistanceMax") == pytest.approx(8.182)
    assert 0 < lab.number("P3dx.body.laser.laserDistanceMin") < 0.1
    assert lab.number("time - P3dx.body.laser.lastCaptureTimestamp") < 0.5
    # The first value is the one at angleMax, to the left: the door's side of the wall is farther than the crate's.
    lab.kit.body.set_pose(0.0, 2.0, 0.0)
    lab.run(1)
    assert lab.number("P3dx.body.laser.val[0]") == pytest.approx(1.0, abs=0.01)
    assert lab.number("P3dx.body.laser.val[180]") == pytest.approx(5.0, abs=0.01)
    lab.say("P3dx.body.laser.load = 0;", 1)
    assert lab.look("P3dx.body.laser.load") == "0"


def test_camera(lab: Lab) -> None:
    assert "load to 1 first" in lab.say("P3dx.body.camera.yaw = 0.1;")
    lab.say("P3dx.body.camera.load = 1; P3dx.body.camera.yaw = 45deg; P3dx.body.camera.pitch = -15deg;", 0.5)
    lab.say("P3dx.body.camera.zoom = 2;", 0.5)
    camera = lab.kit.robot.extras.camera
    assert (camera.pan, camera.tilt, camera.zoom) == (-440, -150, 1023)
    assert lab.number("P3dx.body.camera.yaw") == pytest.approx(math.pi / 4)
    assert lab.look("P3dx.body.camera.zoom") == "1"


def test_battery(lab: Lab) -> None:
    assert lab.number("P3dx.body.battery.voltage") == 12.5
    lab.say('at (P3dx.body.battery.low?(var v)) echo("low %s" % v);')
    lab.kit.body.volts = 11.2
    lab.run(0.5)
    assert lab.heard() == "*** low 11.2"
    assert 0 < lab.number("P3dx.body.battery.remain") < 0.2


def test_manual_commands_cancel_go() -> None:
    lab = driving()
    lab.say('at (robot.aborted?) echo("aborted"); P3dx.go(5),', 1)
    assert "aborted" in lab.say("P3dx.body.x.speed = -0.1;", 4)
    assert lab.number("P3dx.body.x.speed") == pytest.approx(-0.1, abs=0.01)
    lab.say("P3dx.go(0.5);", 6)
    assert not lab.kit.body.moving


def test_the_other_movements_of_the_standard() -> None:
    lab = driving()
    lab.say("robot.goTo([0.5, 0.5, 0]);", 20)
    x, y, heading = lab.where()
    assert [x, y] == pytest.approx([0.5, 0.5], abs=0.05)
    assert heading == pytest.approx(0, abs=0.06)
    lab.say("robot.xSpeed = 0.2;", 1)
    assert lab.number("robot.xSpeed") == 0.2 and lab.kit.body.moving
    lab.say("robot.stop;", 1.5)
    assert not lab.kit.body.moving
