"""What is on a Pioneer beside its wheels: ramps, gyro, gripper, camera, sonars; and wheels that are blocked."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any

import pytest
from p3dx_lab import Lab

from urbihw.platforms import find
from urbihw_fakes.p3dx.camera import CanonCamera
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.sips import Settings
from urbihw_fakes.p3dx.world import World


def robot(slip: float = 0.0, world: World | None = None, settings: Settings | None = None, **options: Any) -> Lab:
    """A robot with its motors on."""
    lab = Lab.ready(Kit(world if world is not None else World(), slip=slip, settings=settings), **options)
    lab.say("P3dx.body.load = 1;", 0.5)
    return lab


def test_loading_the_library_again_changes_nothing() -> None:
    lab = robot()
    path = find("p3dx").folder / "p3dx.u"
    assert lab.say(f'load("{path}"); P3dx.body.load;') == "1"
    lab.say("P3dx.go(0.3);", 5)
    assert lab.where()[0] == pytest.approx(0.3, abs=0.02)


# --- wheels that are blocked ------------------------------------------------------------------------------------------


def test_a_stall_ends_a_speed(caplog: pytest.LogCaptureFixture) -> None:
    lab = robot(world=World.room())
    lab.kit.body.bump_stall = 0
    lab.say("P3dx.body.x.speed = 0.6;", 6)
    lab.until(lambda: lab.look("P3dx.body.stalled") == "true")
    assert lab.kit.body.forward.wanted > 0
    lab.run(1.5)
    # The order itself is 0 now: the motors no longer push.
    assert lab.kit.body.forward.wanted == 0
    lines = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert lines == ["the wheels have been blocked for 1 s: the base is stopped"]


def test_after_a_stall_it_backs_away() -> None:
    lab = robot(world=World.room())
    lab.say("P3dx.body.x.speed = 0.6;", 12)
    x = lab.where()[0]
    lab.say("P3dx.body.x.speed = -0.2;", 3)
    assert lab.where()[0] < x - 0.3


def test_a_written_speed_that_pushes_again_is_ended_again() -> None:
    lab = robot(world=World.room())
    lab.say("P3dx.body.x.speed = 0.6;", 12)
    lab.say("P3dx.body.x.speed = 0.2;", 0.5)
    assert lab.kit.body.forward.wanted > 0
    lab.run(2)
    assert lab.kit.body.forward.wanted == 0


# --- ramps ------------------------------------------------------------------------------------------------------------


def test_ramps_are_read_from_the_controller_and_written_to_it() -> None:
    lab = robot()
    assert lab.number("P3dx.body.x.acceleration") == pytest.approx(0.3)
    assert lab.number("P3dx.body.yaw.deceleration") == pytest.approx(math.radians(100), abs=1e-4)
    lab.say("P3dx.body.x.acceleration = 0.1; P3dx.body.x.deceleration = 1; P3dx.body.yaw.acceleration = 1;", 0.5)
    body = lab.kit.body
    assert (body.forward.faster, body.forward.slower) == pytest.approx((0.1, 1.0))
    assert body.turning.faster == pytest.approx(math.radians(57))
    lab.say("P3dx.body.x.speed = 0.4;", 2)
    assert body.forward.speed == pytest.approx(0.2, abs=0.03)


def test_ramps_have_a_range() -> None:
    lab = robot()
    lab.say("P3dx.body.x.acceleration = 100;", 0.5)
    assert lab.kit.body.forward.faster == pytest.approx(2.0)
    assert lab.number("P3dx.body.x.acceleration->rangemax") == pytest.approx(2.0)


def test_a_new_connection_has_the_ramps_of_the_robot() -> None:
    lab = robot()
    lab.say("P3dx.body.x.acceleration = 0.1; P3dx.body.x.deceleration = 1;", 0.5)
    lab.robot_line.end.unplug()
    lab.run(1)
    lab.robot_line.end.replug()
    lab.until(lambda: lab.look("P3dx.link") == "true")
    lab.run(0.5)
    assert (lab.kit.body.forward.faster, lab.kit.body.forward.slower) == pytest.approx((0.3, 0.3))
    assert lab.say("P3dx.body.x.acceleration; P3dx.body.x.deceleration;") == "0.3\n0.3"


def test_ramps_that_another_program_left_in_the_controller_are_replaced() -> None:
    kit = Kit(World())
    kit.body.forward.slower = kit.body.turning.slower = 0.001
    Lab.ready(kit).run(0.5)
    assert (kit.body.forward.slower, kit.body.turning.slower) == pytest.approx((0.3, math.radians(100)))


WEAK = [
    "P3dx.body.x.deceleration = 0;",
    "P3dx.body.x.deceleration = -1;",
    "P3dx.body.x.deceleration = 0.001;",
    "P3dx.body.x.deceleration->rangemin = 0; P3dx.body.x.deceleration = 0.01;",
    'P3dx.command("SETA", -1);',
    'P3dx.command("TRANSKP", 0);',
]
STOPS: dict[str, Callable[[Lab], object]] = {
    "stop": lambda lab: lab.look("robot.stop"),
    "emergency stop": lambda lab: lab.look("P3dx.estop = true"),
    "client gone": lambda lab: lab.lobby.close(),
    "speed 0": lambda lab: lab.look("P3dx.body.x.speed = 0"),
    "watchdog of the controller": lambda lab: lab.robot_line.end.unplug(),
}


@pytest.mark.parametrize("stop", STOPS)
def test_no_client_can_weaken_the_brakes(stop: str) -> None:
    lab = robot()
    for weak in WEAK:
        assert "!!!" in lab.say(weak, 0.2)
    assert lab.say("P3dx.body.x.deceleration;") == "0.3"
    lab.say("P3dx.body.x.speed = 0.4;", 3)
    assert lab.kit.body.forward.speed == pytest.approx(0.4, abs=0.01)
    STOPS[stop](lab)
    # 0.4 m/s at 0.3 m/s2 takes 1.3 s; the watchdog of the controller begins after 2 s.
    lab.run(2.0 if "watchdog" not in stop else 4.0)
    assert lab.kit.body.forward.speed == 0


def test_a_weaker_ramp_is_refused_with_the_least_one() -> None:
    lab = robot()
    assert "deceleration: at least 0.3, the robot's own, so that every stop brakes as it should" in lab.say(
        "P3dx.body.x.deceleration = 0.1;"
    )
    assert "acceleration: at least 0.001" in lab.say("P3dx.body.x.acceleration = 0;")
    assert "acceleration: at least 0.001" in lab.say("P3dx.body.x.acceleration = -1;")
    assert "SETRA cannot be sent like this; use the slots" in lab.say('P3dx.command("SETRA", -1);')
    lab.say("P3dx.body.yaw.deceleration = 3;", 0.5)
    assert lab.kit.body.turning.slower == pytest.approx(3, abs=0.01)


# --- gyro -------------------------------------------------------------------------------------------------------------


def turned_by(gyro_type: int, **options: Any) -> tuple[float, float]:
    """Turn by 90 degrees with wheels that slip; the true angle, and that of the odometry, in degrees."""
    lab = robot(slip=0.1, settings=Settings(gyro_type=gyro_type), **options)
    lab.say("P3dx.turn(-90deg);", 9)
    return math.degrees(lab.where()[2]), math.degrees(lab.number("P3dx.body.odometry.yaw"))


def test_a_gyro_corrects_wheels_that_slip() -> None:
    true, shown = turned_by(0)
    assert (true, shown) == pytest.approx((81, 90), abs=2)
    true, shown = turned_by(1)
    assert true == pytest.approx(90, abs=2.5)
    assert shown == pytest.approx(true, abs=1.5)


@pytest.mark.parametrize(("gyro_type", "options"), [(2, {}), (1, {"gyro": "shown"})])
def test_a_gyro_that_is_not_fused_is_shown_only(gyro_type: int, options: dict[str, str]) -> None:
    true, shown = turned_by(gyro_type, **options)
    assert (true, shown) == pytest.approx((81, 90), abs=2)


def test_the_gyro_is_shown_in_rad_per_second() -> None:
    lab = robot(settings=Settings(gyro_type=1))
    assert lab.number("robot.body.gyro.speed") == 0
    lab.say("P3dx.body.yaw.speed = 0.5;", 2)
    assert lab.number("robot.body.gyro.speed") == pytest.approx(0.5, abs=0.03)


def test_a_rest_value_that_drifts_turns_nothing() -> None:
    lab = robot(settings=Settings(gyro_type=1))
    lab.kit.robot.extras.gyro_rest = 518.0
    lab.run(20)
    assert lab.number("P3dx.body.odometry.yaw") == 0
    lab.say("P3dx.turn(-90deg);", 9)
    assert math.degrees(lab.where()[2]) == pytest.approx(90, abs=2.5)


def test_without_packets_the_wheels_give_the_heading() -> None:
    lab = robot(settings=Settings(gyro_type=1))
    lab.say('P3dx.unwatch("gyro");', 1)
    lab.say("P3dx.turn(-90deg);", 9)
    assert math.degrees(lab.number("P3dx.body.odometry.yaw")) == pytest.approx(90, abs=2)


# --- gripper ----------------------------------------------------------------------------------------------------------


def test_without_a_gripper_there_is_none() -> None:
    assert robot().look('P3dx.body.hasSlot("gripper")') == "false"


def test_the_gripper_is_a_component() -> None:
    lab = robot(settings=Settings(gripper=1))
    assert lab.look("P3dx.body.gripper.val") == "0" == lab.look("robot.body.claw.lift")
    lab.say("P3dx.body.gripper.val = 1;", 0.6)
    assert lab.look("P3dx.body.gripper.moving") == "true"
    assert lab.look("P3dx.body.gripper.val") == "0.5"
    lab.run(2)
    assert lab.look("P3dx.body.gripper.val") == "1"
    lab.say("P3dx.body.gripper.store;", 4)
    assert (lab.look("P3dx.body.gripper.val"), lab.look("P3dx.body.gripper.lift")) == ("0", "1")
    assert lab.kit.robot.extras.gripper.lift.place == 1


def test_a_stop_halts_the_gripper_and_an_emergency_stop_holds_it() -> None:
    lab = robot(settings=Settings(gripper=1))
    lift = lab.kit.robot.extras.gripper.lift
    lab.say("P3dx.body.gripper.lift = 1;", 1)
    assert 0 < lift.place < 1
    lab.say("P3dx.stop;", 0.3)
    assert lift.way == 0
    place = lift.place
    lab.say("P3dx.estop = true;", 0.3)
    assert "emergency stop" in lab.say("P3dx.body.gripper.lift = 1;", 1)
    assert lift.place == place
    lab.say("P3dx.estop = false;", 0.3)
    lab.say("P3dx.body.gripper.lift = 1;", 4)
    assert lift.place == 1


def test_the_gripper_is_halted_when_its_client_goes_and_the_base_drives_on() -> None:
    lab = robot(settings=Settings(gripper=1))
    other = lab.kernel.open_lobby()
    lab.say("P3dx.body.x.speed = 0.1;", 0.5)
    lab.kernel.feed(other, b"P3dx.body.gripper.lift = 1;")
    lab.run(1)
    other.close()
    lab.run(0.5)
    assert lab.kit.robot.extras.gripper.lift.way == 0
    assert lab.kit.body.forward.wanted == pytest.approx(0.1)


def test_the_gripper_is_not_moved_by_name() -> None:
    assert "slots that drive" in robot(settings=Settings(gripper=1)).say('P3dx.command("GRIPPER", 1);')


# --- camera -----------------------------------------------------------------------------------------------------------


def test_a_canon_camera() -> None:
    kit = Kit(World())
    camera = kit.robot.extras.camera = CanonCamera()
    lab = Lab.ready(kit, camera_model="vc-c4")
    lab.say("P3dx.body.camera.load = 1; P3dx.body.camera.yaw = 45deg; P3dx.body.camera.pitch = 60deg;", 4)
    assert (camera.pan, camera.tilt) == (-400, 533)
    lab.say("P3dx.body.camera.zoom = 1;", 1)
    assert camera.zoom == 1960
    # Many orders within one pause of the camera: it gets the last one.
    for degrees in range(20):
        lab.say(f"P3dx.body.camera.yaw = {degrees}deg;", 0.02)
    lab.run(2)
    assert camera.pan == round(-19 / 0.1125)


def test_the_camera_is_a_tracker() -> None:
    lab = robot()
    assert lab.look("robot.body.camera.isA(Interface.Tracker)") == "true"
    lab.say("robot.body.camera.load = 1; robot.body.camera.yaw = 0.5;", 0.5)
    assert lab.number("robot.body.camera.yaw") == 0.5


# --- sonars, battery --------------------------------------------------------------------------------------------------


def test_a_sonar_without_an_echo_is_infinitely_far(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = robot()
    lab.run(1)
    assert lab.look("P3dx.body.sonar[left][front].val") == "inf"
    monkeypatch.setattr(lab.kit.robot.sonars, "distance", lambda number: 65.535)
    lab.run(1)
    assert lab.look("P3dx.body.sonar[left][front].val") == "inf"
    monkeypatch.setattr(lab.kit.robot.sonars, "distance", lambda number: 4.9)
    lab.run(1)
    assert lab.number("P3dx.body.sonar[left][front].val") == 4.9


def test_what_the_battery_does_not_tell_is_nan() -> None:
    lab = robot()
    assert lab.say("P3dx.body.battery.capacity; P3dx.body.battery.current;") == "nan\nnan"


def test_a_command_with_a_wrong_argument_is_answered_in_the_words_of_the_language() -> None:
    lab = robot()
    assert "VEL (translate, mm/s) takes a number, not the bytes [1]" in lab.say('P3dx.command("VEL", [1]);')
    assert 'VEL (translate, mm/s) takes a number, not "a"' in lab.say('P3dx.command("VEL", "a");')
    assert "VEL (translate, mm/s) takes a number, not nil" in lab.say('P3dx.command("VEL", nil);')
