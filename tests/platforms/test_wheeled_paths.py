"""Planned paths of the bases that drive by their own odometry, measured on the fake's body, in simulated time.

What stops a path (a stop, the end of a client, a lost link ...) is in ``test_motion_contract``, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import nxt_lab
import pytest
import segway_lab
from paths import Course

from urbihw.navigation.options import SCAN, NavigationOptions
from urbihw_fakes.nxt.tribot import TriBot
from urbihw_fakes.segway.frames import TRACTOR
from urbihw_fakes.segway.rmp import SegwayRmp

NEAR, NEAR_DEGREES = 0.08, 4.0
"""m and degrees from the goal at which a base without slip stands."""
SLIP = 0.02
WAY = 7.0
"""m of the way around the wall, at most."""
BEHIND_THE_WALL = "[5, 1, 90deg]"
FAR = 100.0
"""m from the wall of the TriBot's own world, which the map does not know."""


def segway(folder: Path, slip: float = 0.0, **options: object) -> Course:
    """A Segway at home on the map."""
    lab = segway_lab.Lab.ready(SegwayRmp(), **options)
    body = lab.base.body
    body.slip = slip
    return Course(lab, "segway", lambda: (body.x, body.y, body.heading), folder)


def nxt(folder: Path, slip: float = 0.0, **options: object) -> Course:
    """A TriBot at home on the map."""
    tribot = TriBot(FAR)
    tribot.slip = slip
    lab = nxt_lab.Lab.ready(tribot, **options)
    return Course(lab, "nxt", lambda: (tribot.x + FAR, tribot.y, tribot.heading), folder)


Maker = Callable[..., Course]
BASES = pytest.mark.parametrize("make", [segway, nxt])


@BASES
def test_a_goal_behind_the_wall_is_reached(make: Maker, tmp_path: Path, record_property: Callable[..., None]) -> None:
    course = make(tmp_path)
    assert course.drive(BEHIND_THE_WALL) == "*** path 1"
    metres, degrees = course.miss((5.0, 1.0, math.pi / 2))
    record_property("miss", (round(metres, 3), round(degrees, 1)))
    assert metres < NEAR and degrees < NEAR_DEGREES
    assert math.dist(course.body()[:2], course.odometry()[:2]) < 0.02
    stood = course.body()
    course.lab.run(3)
    assert course.body() == pytest.approx(stood, abs=1e-3)


@BASES
def test_wheels_that_slip_take_it_as_far_as_they_slip(
    make: Maker, tmp_path: Path, record_property: Callable[..., None]
) -> None:
    course = make(tmp_path, slip=SLIP)
    assert course.drive(BEHIND_THE_WALL) == "*** path 1"
    metres, degrees = course.miss((5.0, 1.0, math.pi / 2))
    record_property("miss", (round(metres, 3), round(degrees, 1)))
    # The way is short by its share, and the turns (some 250 degrees in all) lead aside by theirs.
    assert metres < NEAR + SLIP * WAY * 2
    assert degrees < NEAR_DEGREES + SLIP * 250
    # The odometry believes that it is there.
    assert math.dist(course.odometry()[:2], (5.0, 1.0)) < NEAR


@BASES
def test_the_movements_of_the_standard_reach_what_they_are_told(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    course.lab.say("robot.goTo([1, 0.5]);", 25)
    x, y, _ = course.body()
    assert (x, y) == pytest.approx((2.0, 1.5), abs=0.03)


@BASES
def test_all_bases_have_the_same_words(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    assert course.lab.look(f"robot.planner === {course.robot}.planner") == "true"
    assert course.lab.look(f"robot.body.odometry === {course.robot}.odometry") == "true"
    course.lab.say("robot.moveTo([2, 1, 0]);")
    assert course.end() == "*** path 1"


@BASES
def test_a_stop_on_the_way_holds(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    course.begin(BEHIND_THE_WALL)
    course.lab.run(4)
    course.lab.look("robot.stop")
    course.lab.run(1)
    assert course.lab.heard() == "*** path 2"
    assert course.lab.look(f"{course.robot}.planner.active") == "false"
    stood = course.body()
    course.lab.run(5)
    assert course.body() == pytest.approx(stood, abs=1e-3)
    assert course.drive(BEHIND_THE_WALL) == "*** path 1"
    assert course.miss((5.0, 1.0, math.pi / 2))[0] < NEAR


@BASES
def test_a_stop_while_the_path_is_planned_drops_it(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    begun = course.body()
    course.lab.say(f"{course.robot}.moveTo({BEHIND_THE_WALL});")
    course.lab.look("robot.stop")
    course.lab.thought()
    course.lab.run(3)
    assert course.body() == pytest.approx(begun, abs=1e-3)


@BASES
def test_a_link_that_is_lost_on_the_way_ends_the_path_for_good(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    lab = course.lab
    course.begin(BEHIND_THE_WALL)
    lab.run(4)
    lab.unplug() if isinstance(lab, nxt_lab.Lab) else lab.end.unplug()
    lab.run(1.5)
    assert lab.heard() == "*** path 2"
    lab.end.replug()
    lab.until(lambda: lab.look(f"{course.robot}.link") == "true")
    lab.run(1.0)
    stood = course.body()
    lab.run(3)
    assert course.body() == pytest.approx(stood, abs=1e-3)
    assert lab.look(f"{course.robot}.planner.active") == "false"
    assert course.drive(BEHIND_THE_WALL) == "*** path 1"


@BASES
@pytest.mark.parametrize("deed", ["robot.go(0.1),", "robot.turn(0.1),", "speed", "moveTo"])
def test_what_ends_a_path(make: Maker, tmp_path: Path, deed: str) -> None:
    course = make(tmp_path)
    course.begin(BEHIND_THE_WALL)
    course.lab.run(3)
    by_hand = {"segway": "rmp.forwardSpeed = 0.1;", "nxt": "wheels.speed = 20;"}[course.robot]
    words = {"speed": by_hand, "moveTo": f"{course.robot}.moveTo([1, 1, 0]);"}.get(deed, deed)
    assert "*** path 2" in course.lab.say(words, 0.3).splitlines()
    if deed == "moveTo":
        assert course.end() == "*** path 1"
    assert course.lab.look(f"{course.robot}.planner.active") == "false"


@BASES
def test_a_path_ends_a_movement(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    course.lab.say("robot.go(3),", 2)
    assert course.drive("[2, 2, 0]") == "*** path 1"
    assert course.miss((2.0, 2.0, 0.0))[0] < NEAR


@BASES
def test_what_a_path_needs(make: Maker, tmp_path: Path) -> None:
    course = make(tmp_path)
    robot, lab = course.robot, course.lab
    assert "expected [x, y, heading]" in lab.say(f"{robot}.moveTo([1, 1]);")
    lab.robot.options = NavigationOptions(localization=SCAN)
    assert "needs a laser" in lab.say(f'{robot}.planner.mapFileName = "{tmp_path}/room.map";')
    lab.say(f'{robot}.planner.mapFileName = "";')
    assert f"set {robot}.planner.mapFileName first" in lab.say(f"{robot}.moveTo([1, 1, 0]);")


# --- Segway -----------------------------------------------------------------------------------------------------------


def test_a_speed_by_hand_leaves_nothing_of_the_path(tmp_path: Path) -> None:
    course = segway(tmp_path)
    # It begins with a turn on the spot.
    course.begin("[1, 3, 0]")
    course.lab.run(0.8)
    assert abs(course.lab.base.body.turn) > 0.3
    course.lab.say("rmp.forwardSpeed = 0.2;", 1.0)
    body = course.lab.base.body
    assert (body.speed, body.turn) == pytest.approx((0.2, 0.0), abs=0.01)


def test_a_base_that_does_not_tell_its_way_follows_none(tmp_path: Path) -> None:
    course = segway(tmp_path)
    course.begin(BEHIND_THE_WALL)
    course.lab.run(3)
    course.lab.base.drop_frames(0x404)
    course.lab.run(1.5)
    assert course.lab.heard() == "*** path 2"
    assert abs(course.lab.base.body.speed) < 0.01
    assert "does not tell its way" in course.lab.say(f"segway.moveTo({BEHIND_THE_WALL});")


def test_a_base_that_is_switched_off_is_said_to_be(tmp_path: Path) -> None:
    course = segway(tmp_path)
    course.lab.say('rmp.mode = "disabled";', 1.0)
    assert "the base does not drive (mode disabled)" in course.lab.say(f"segway.moveTo({BEHIND_THE_WALL});")


def test_a_base_that_is_switched_off_on_the_way_stays_where_it_is(tmp_path: Path) -> None:
    course = segway(tmp_path)
    base, lab = course.lab.base, course.lab
    base.start_mode = TRACTOR
    lab.say('rmp.mode = "tractor";', 0.5)
    course.begin(BEHIND_THE_WALL)
    lab.run(3)
    base.power_off(0.0)
    lab.run(2)
    assert lab.heard() == "*** path 2"
    assert "the base is lost" in lab.say(f"segway.moveTo({BEHIND_THE_WALL});")
    base.power_on(0.0)
    lab.until(lambda: lab.look("segway.state") == '"ok"')
    stood = course.body()
    lab.run(3)
    assert course.body() == pytest.approx(stood, abs=1e-3)


def test_limits_of_a_base_count_on_a_path(tmp_path: Path) -> None:
    course = segway(tmp_path, limits={"base": {"speed": 0.15, "turn": 0.3}})
    body, peak = course.lab.base.body, [0.0, 0.0]
    course.begin("[2.5, 2.5, 0]")
    for _ in range(200):
        course.lab.run(0.05)
        peak = [max(peak[0], abs(body.speed)), max(peak[1], abs(body.turn))]
    assert 0.12 < peak[0] <= 0.151 and 0.2 < peak[1] <= 0.301
    assert course.end() == "*** path 1"


def test_another_base_of_the_same_wheels_can_be_steered(tmp_path: Path) -> None:
    course = segway(tmp_path)
    assert course.lab.say("var other = RMP.new(50ms)|; segway.steer(other);", 0.2) == ""
    assert course.drive("[2, 2, 0]") == "*** path 1"
    assert course.miss((2.0, 2.0, 0.0))[0] < NEAR


# --- NXT --------------------------------------------------------------------------------------------------------------


def test_motors_go_no_faster_on_a_path_than_their_limit(tmp_path: Path) -> None:
    course = nxt(tmp_path, limits={"A": {"speed": 30}, "C": {"speed": 30}})
    powers = []
    course.begin("[2.5, 2.5, 0]")
    for _ in range(200):
        course.lab.run(0.05)
        powers.append(max(map(abs, course.lab.powers())))
    assert 20 < max(powers) <= 30
    assert course.end() == "*** path 1"


def test_a_jammed_wheel_fails_the_path(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    course.begin(BEHIND_THE_WALL)
    course.lab.run(3)
    for port in "AC":
        course.lab.brick.motor(port).jammed = True
    assert course.end(5.0) == "*** path 0"
    assert course.lab.powers() == [0, 0, 0]


def test_a_count_that_is_set_anew_is_no_way(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    assert course.drive("[2.5, 1, 0]") == "*** path 1"
    before = course.odometry()
    course.lab.say("wheelL.reset;", 0.5)
    # The same by a telegram of one's own: RESETMOTORPOSITION of port A.
    course.lab.say("Command.send([10, 0, 0]);", 0.5)
    assert abs(course.lab.number("wheelL.val")) < 5 and abs(course.lab.number("wheelR.val")) < 5
    assert course.odometry() == pytest.approx(before, abs=0.005)
    assert course.drive("[2, 2, 0]") == "*** path 1"
    assert course.miss((2.0, 2.0, 0.0))[0] < NEAR


def test_a_brick_that_was_switched_off_has_not_leapt(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    assert course.drive("[2.5, 1, 0]") == "*** path 1"
    before, lab = course.odometry(), course.lab
    lab.brick.switch_off()
    lab.run(3)
    lab.brick.switch_on(lab.bus_clock.now())
    lab.until(lambda: lab.look("nxt.link") == "true")
    lab.run(1)
    assert course.odometry() == pytest.approx(before, abs=0.005)


def test_what_the_ultrasonic_sensor_sees_is_waited_for(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    course.begin("[2.5, 1, 0]")
    course.lab.run(2)
    course.lab.tribot.obstacle = 0.2
    course.lab.run(2)
    stood = course.body()
    course.lab.run(0.5)
    assert course.body() == pytest.approx(stood, abs=1e-3)
    course.lab.tribot.obstacle = None
    assert course.end() == "*** path 1"
    assert course.miss((2.5, 1.0, 0.0))[0] < NEAR


def test_a_telegram_that_moves_a_wheel_ends_the_path(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    course.begin(BEHIND_THE_WALL)
    course.lab.run(2)
    # SETOUTPUTSTATE of port A: power 20, on, no ramp, no limit.
    assert course.lab.say("Command.send([4, 0, 20, 1, 0, 0, 32, 0, 0, 0, 0]);", 0.5) == "*** path 2"
    assert course.lab.powers() == [20, 0, 0]


def test_the_geometry_is_that_of_the_options_or_of_the_layout(tmp_path: Path) -> None:
    course = nxt(tmp_path, wheel_radius=0.041, track=0.15)
    assert course.lab.look("[nxt.wheelRadius, nxt.track]") == "[0.041, 0.15]"
    assert "above 0" in course.lab.say("nxt.track = 0;")
    # The truth is the TriBot's: what is believed about it is off by as much as the wheels.
    course.lab.say("wheels.speed = 30; sleep(2s); wheels.speed = 0;", 3)
    assert course.odometry()[0] - 1 == pytest.approx((course.body()[0] - 1) * 0.041 / 0.028, rel=0.02)


def test_motors_the_other_way_round_have_a_radius_below_zero(tmp_path: Path) -> None:
    course = nxt(tmp_path)
    course.lab.say("nxt.wheelRadius = -0.028;")
    course.begin("[2.5, 1, 0]")
    course.lab.run(1)
    assert course.lab.powers()[0] < -20 and course.lab.powers()[2] < -20


def test_a_layout_without_wheels_has_no_planner(tmp_path: Path) -> None:
    layout = tmp_path / "arm.u"
    layout.write_text('arm = Servo.new("A");\n', "ascii")
    lab = nxt_lab.Lab.ready(TriBot(), layout=str(layout))
    assert "say nxt.steer(wheelL, wheelR) in the layout" in lab.say("nxt.moveTo([1, 1, 0]);")
    assert "two motors" in lab.say("nxt.steer(arm, arm);")
