"""The DCM back end of the Nao (manual, "Motor back-end method"): dated points, and what the body does with them."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from nao_lab import Lab, stand
from nao_rig import TICK, Rig

from urbihw.buses.messages import Refused, Reply, Request, Targets
from urbihw.kernel.uobject import RobotSettings
from urbihw_nao import motor_trace
from urbihw_nao.dcm_clock import WRAP, DcmClock
from urbihw_nao.dcm_course import JointCourse
from urbihw_nao_fakes.body import Joint
from urbihw_nao_fakes.dcm import Dcm
from urbihw_nao_fakes.device import Nao

SHIFT = 0.05
PERIOD = 0.01
"""Period of a trajectory (System.period)."""


class DcmRig(Rig):
    """A rig that writes by the DCM from the start, with its head stiff, and sees the body each 10 ms."""

    def __init__(self, robot: Nao | None = None, **options: Any) -> None:
        super().__init__(robot, **{"dcm_write": True, **options})
        self.seen: list[tuple[float, float]] = []
        self.body.on_step.append(lambda at: self.seen.append((at, self.yaw.angle)))

    @property
    def dcm(self) -> Dcm:
        """The DCM of the robot."""
        (found,) = [each for each in self.robot.services.values() if isinstance(each, Dcm)]
        return found

    @property
    def yaw(self) -> Joint:
        """A joint that nothing pulls."""
        return self.body.joints["HeadYaw"]

    def stiffen(self, *names: str) -> DcmRig:
        """Log in, and make joints stiff."""
        self.attach()
        self.order("stiffness", **dict.fromkeys(names or ("HeadYaw",), 1.0))
        self.run(0.2)
        self.seen.clear()
        self.dcm.points.clear()
        return self

    def follow(self, course: Callable[[float], float], seconds: float, *names: str) -> None:
        """Write a trajectory of 10 ms to joints; ``course`` takes the seconds since its beginning."""
        begun = written = self.clock.now()
        while self.clock.now() < begun + seconds - 1e-9:
            while written <= self.clock.now() + 1e-9:
                values = {(name, "angle"): course(written - begun) for name in names or ("HeadYaw",)}
                # The writer's clock is another one than the worker's.
                self.driver.targets(Targets(values, time=written - 90.0))
                written += PERIOD
            self.run(TICK)

    def speeds(self) -> list[float]:
        """rad/s of the head, over two cycles of the DCM each."""
        ticks = {round(at / 0.02): (at, angle) for at, angle in self.seen}
        return [abs(b - a) / (after - before) for (before, a), (after, b) in pairwise(ticks.values())]


def swing(seconds: float) -> float:
    """A sine of 0.5 rad and 2 s: at most 1.57 rad/s."""
    return 0.5 * math.sin(math.pi * seconds)


# ---------------------------------------------------------------- plans


def test_a_course_is_sent_up_to_the_horizon_only() -> None:
    course = JointCourse(0.0, 8.0, 10.0)
    for index in range(10):
        course.add_goal(10.0 + 0.01 * index, 0.01 * index, 10.0)
    assert course.pop_points(10.05)[-1] == pytest.approx((10.05, 0.05))
    assert course.pop_points(10.05) == []
    assert [time for time, _ in course.pop_points(10.2)] == pytest.approx([10.06, 10.07, 10.08, 10.09])


def test_a_far_goal_takes_its_time() -> None:
    course = JointCourse(0.0, 2.0, 0.0)
    course.add_goal(0.05, 1.0, 0.0)
    places = [course.pop_points(0.1 * index)[-1] for index in range(1, 6)]
    assert places == [pytest.approx((0.1 * index, 0.2 * index)) for index in range(1, 6)]
    assert not course.moves_until(0.6)


def test_a_late_course_catches_up_at_twice_its_speed() -> None:
    course = JointCourse(0.0, 8.0, 0.0)
    for index in range(1, 31):
        course.add_goal(0.01 * index, 0.01 * index, 0.3)  # 1 rad/s, 0.3 s late
    course.begin_anew(0.0, 0.3)
    points = course.pop_points(1.0)
    assert points[-1] == pytest.approx((0.45, 0.3), abs=0.011)


def test_goals_beyond_the_motor_do_not_pile_up() -> None:
    course = JointCourse(0.0, 1.0, 0.0)
    for index in range(1000):
        now = 0.02 * index
        course.add_goal(now, 2.0 if index // 5 % 2 else -2.0, now)
        course.pop_points(now + SHIFT)
    course.add_goal(20.0, 0.0, 20.0)
    for index in range(200):
        course.pop_points(20.05 + 0.02 * index)
    assert course.place == 0.0


def test_the_clock_of_the_dcm_survives_its_wrap() -> None:
    clock = DcmClock()
    truth = WRAP // 2 - 1000.0
    for index in range(40):
        sent = 50.0 + 0.1 * index
        late = 0.2 if index % 3 else 300.0  # a network that is held up now and then
        answer = (round(truth + 100 * index + late) + WRAP // 2) % WRAP - WRAP // 2
        clock.add_sample(sent, answer)
        wanted = (round(truth + 100 * index) + WRAP // 2) % WRAP - WRAP // 2
        if index:
            assert abs(clock.date(sent) - wanted) <= 1


# ---------------------------------------------------------------- on the body


def test_a_trajectory_of_10_ms_is_one_message_a_cycle_with_two_points_for_each_joint() -> None:
    names = ("HeadYaw", "LElbowYaw", "RElbowYaw", "LWristYaw")
    rig = DcmRig().stiffen(*names)
    rig.follow(lambda t: 0.3 * math.sin(3 * t), 0.2, *names)
    rig.dcm.points.clear()
    angles, writes, begun = rig.robot.motion.calls["setAngles"], rig.dcm.writes, rig.clock.now()
    rig.follow(lambda t: 0.3 * math.sin(3 * (t + 0.2)), 1.0, *names)
    cycles = round((rig.clock.now() - begun) / TICK)
    assert rig.dcm.writes - writes == cycles == 50
    assert rig.robot.motion.calls["setAngles"] == angles
    assert len(rig.dcm.points) == pytest.approx(2 * cycles * len(names), abs=len(names) * 2)
    assert min(rig.dcm.points) > 0 and max(rig.dcm.points) <= SHIFT * 1000 + 1


def test_the_body_follows_the_course_after_the_shift() -> None:
    rig = DcmRig().stiffen()
    begun = rig.clock.now()
    rig.follow(swing, 2.0)
    errors = [angle - swing(at - begun - SHIFT) for at, angle in rig.seen if at - begun > 0.3]
    assert max(map(abs, errors)) < 0.035 and max(rig.speeds()) < 1.8


def test_a_single_goal_is_reached_as_fast_as_the_motor_can() -> None:
    rig = DcmRig().stiffen()
    rig.order(HeadYaw=1.0)
    rig.run(0.1)
    assert 0.1 < rig.yaw.angle < 0.9
    rig.run(0.2)
    assert rig.yaw.angle == pytest.approx(1.0, abs=0.001) and max(rig.speeds()) < 8.4


def test_a_course_begins_where_the_joint_is_however_long_ago_it_was_written() -> None:
    rig = DcmRig(fraction=0.1, dcm_shift=0.4).stiffen()
    for goal in (1.0, 0.0):
        rig.order(HeadYaw=goal)
        rig.run(5.0)
        assert rig.yaw.angle == pytest.approx(goal, abs=0.001)
    assert max(rig.speeds()) < 0.95


def test_a_stop_holds_at_once_and_clears_what_is_dated_ahead() -> None:
    rig = DcmRig(dcm_shift=0.4).stiffen()
    rig.follow(swing, 0.6)
    place = rig.yaw.angle
    rig.driver.safe_stop()
    rig.run(1.0)
    assert rig.yaw.angle == pytest.approx(place, abs=0.01) and 0.1 < place < 0.4


def test_after_a_stop_a_trajectory_goes_on_from_where_the_joint_is() -> None:
    rig = DcmRig().stiffen()
    rig.follow(swing, 0.4)
    rig.driver.safe_stop()
    rig.run(3.0)
    place = rig.yaw.angle
    rig.seen.clear()
    rig.follow(lambda t: place + 0.5 * t, 0.5)
    rig.run(0.1)
    assert rig.yaw.angle == pytest.approx(place + 0.24, abs=0.02) and max(rig.speeds()) < 1.1


def test_a_late_worker_does_not_leap() -> None:
    rig = DcmRig().stiffen()
    rig.follow(swing, 0.3)
    rig.clock.sleep_until(rig.clock.now() + 0.3)
    rig.dcm.points.clear()
    begun = rig.clock.now() - 0.6
    for index in range(30):
        written = rig.clock.now() - 0.3 + PERIOD * index
        rig.driver.targets(Targets({("HeadYaw", "angle"): swing(written - begun)}, time=written - 90.0))
    rig.run(TICK)
    assert min(rig.dcm.points) >= -2, "no point but the place where it is lies in the past"
    rig.run(0.5)
    assert max(rig.speeds()) < 2 * 1.57 + 0.2
    assert rig.yaw.angle == pytest.approx(swing(0.6 - PERIOD), abs=0.01)


@pytest.mark.parametrize("shift", [SHIFT, 0.2])
def test_a_worker_that_dies_leaves_no_more_motion_than_the_shift(shift: float) -> None:
    rig = DcmRig(dcm_shift=shift).stiffen()
    rig.follow(lambda t: 1.0 * t, 0.6)
    place = rig.yaw.angle
    rig.clock.sleep_until(rig.clock.now() + 2.0)
    assert rig.yaw.angle - place <= shift * 1.0 + 0.01
    assert rig.yaw.angle - place > 0.01


def test_a_far_goal_of_a_worker_that_dies_is_not_reached() -> None:
    rig = DcmRig(fraction=0.1).stiffen()
    rig.order(HeadYaw=2.0)
    rig.run(0.4)
    place = rig.yaw.angle
    rig.clock.sleep_until(rig.clock.now() + 2.0)
    assert place > 0.2 and rig.yaw.angle - place <= 0.827 * SHIFT + 0.01


def test_a_joint_that_gets_stiff_stays_where_it_is() -> None:
    rig = DcmRig()
    rig.attach()
    rig.yaw.angle = 0.4  # turned by hand
    rig.run(0.2)
    rig.order("stiffness", HeadYaw=1.0)
    rig.run(0.5)
    assert rig.yaw.angle == pytest.approx(0.4, abs=0.001)


def test_the_clock_of_the_robot_wraps_during_a_swing() -> None:
    robot = Nao()
    rig = DcmRig(robot)
    rig.dcm.started = WRAP // 2 - round((rig.clock.now() + 1.0) * 1000)
    rig.stiffen()
    begun = rig.clock.now()
    rig.follow(swing, 2.0)
    assert rig.dcm.get_time(0) < 0, "it has wrapped"
    assert max(rig.speeds()) < 1.8
    assert rig.yaw.angle == pytest.approx(swing(rig.clock.now() - begun - SHIFT), abs=0.05)


def test_joints_that_nobody_writes_stay_with_almotion() -> None:
    rig = DcmRig().stiffen("HeadYaw", "LShoulderPitch")
    rig.robot.motion.set_angles("LShoulderPitch", 0.5, 0.05)
    rig.follow(swing, 1.0)
    assert rig.body.joints["LShoulderPitch"].angle < 1.2
    rig.run(3.0)
    assert rig.body.joints["LShoulderPitch"].angle == pytest.approx(0.5, abs=0.01)


def test_joints_that_the_dcm_does_not_know_are_refused_and_the_others_move() -> None:
    rig = DcmRig()
    known = rig.dcm._knows
    rig.dcm._knows = lambda key: "WristYaw" not in key and known(key)  # type: ignore[method-assign]
    rig.stiffen()
    assert rig.order(LWristYaw=0.5, RHipYawPitch=0.1, HeadYaw=0.5) == [
        Refused("LWristYaw", "angle", "the DCM of this robot knows no joint LWristYaw"),
        Refused("RHipYawPitch", "angle", "the DCM of this robot knows no joint RHipYawPitch"),
    ]
    rig.run(0.5)
    assert rig.yaw.angle == pytest.approx(0.5, abs=0.001)


def without_dcm() -> Nao:
    """An older robot."""
    robot = Nao()
    for number, service in list(robot.services.items()):
        if service.name == "DCM":
            del robot.services[number]
    return robot


def test_a_robot_without_a_dcm_says_so_and_is_written_by_set_angles() -> None:
    rig = Rig(without_dcm(), dcm_write=True).attach()
    refused = [each for each in rig.news if isinstance(each, Refused)]
    assert refused == [Refused("motors", "dcm", "this robot has no DCM: joints are written by setAngles")]
    rig.order("stiffness", HeadYaw=1.0)
    rig.run(0.2)
    rig.order(HeadYaw=0.5)
    rig.run(0.5)
    assert rig.body.joints["HeadYaw"].angle == pytest.approx(0.5, abs=0.001)


def test_a_lost_link_begins_anew() -> None:
    rig = DcmRig().stiffen()
    rig.follow(swing, 0.4)
    rig.driver.detach()
    rig.link.close()
    rig.clock.sleep_until(rig.clock.now() + 1.0)
    place = rig.yaw.angle
    rig.link.open()
    rig.driver.attach(rig.link)
    rig.driver.stop_on_reconnect()
    rig.run(1.0)
    assert rig.yaw.angle == pytest.approx(place, abs=0.01)
    rig.seen.clear()
    rig.follow(lambda t: place - 0.5 * t, 0.5)
    assert max(rig.speeds()) < 1.1 and rig.yaw.angle < place - 0.1


# ---------------------------------------------------------------- urbiscript


def swinging(**options: Any) -> Lab:
    """A lab whose head is stiff."""
    lab = Lab.ready(**options)
    lab.say("head.load = 1|;", 0.3)
    return lab


def dcm_of(lab: Lab) -> Dcm:
    """The DCM of a lab's robot."""
    (found,) = [each for each in lab.device.services.values() if isinstance(each, Dcm)]
    return found


@pytest.mark.parametrize("name", ["motor", "ALMotor", "headYaw", "motors"])
def test_the_back_end_is_chosen_for_all_joints(name: str) -> None:
    lab = swinging()
    assert lab.say(f"{name}.setDCMWrite(true);", 0.3) == ""
    assert lab.look("ALMotor.dcmWrite") == "true"
    before = dcm_of(lab).writes
    lab.say("headYaw.val = 0 sin:2s ampli:0.5,", 2.5)
    assert dcm_of(lab).writes - before > 100
    assert lab.device.body.joints["HeadYaw"].angle == pytest.approx(0.5, abs=0.06)
    lab.say("motor.setDCMWrite(false);", 0.5)
    before, angles = dcm_of(lab).writes, lab.device.motion.calls["setAngles"]
    lab.run(1.0)
    assert dcm_of(lab).writes == before and lab.device.motion.calls["setAngles"] - angles > 40


def test_a_stop_of_the_robot_ends_a_swing_by_the_dcm() -> None:
    lab = swinging(dcm_write=True)
    lab.say("headYaw.val = 0 sin:2s ampli:0.5,", 2.2)
    lab.say("robot.stop;", 0.02)
    place = lab.device.body.joints["HeadYaw"].angle
    lab.run(1.0)
    assert lab.device.body.joints["HeadYaw"].angle == pytest.approx(place, abs=0.015) and abs(place) > 0.1


def test_limits_hold_for_the_dcm() -> None:
    lab = swinging(dcm_write=True, limits={"HeadYaw": {"position": [-0.3, 0.3], "speed": 0.5}})
    lab.say("headYaw.val = 2;", 0.4)
    assert lab.device.body.joints["HeadYaw"].angle < 0.25
    lab.run(1.0)
    assert lab.device.body.joints["HeadYaw"].angle == pytest.approx(0.3, abs=0.002)


def test_the_shift_is_in_milliseconds() -> None:
    lab = swinging(dcm_write=True)
    assert lab.say("ALMotor.setDCMShift(200);", 0.3) == "" and lab.number("ALMotor.dcmShift") == 0.2
    dcm_of(lab).points.clear()
    lab.say("headYaw.val = 0 sin:2s ampli:0.5,", 1.0)
    assert 150 < max(dcm_of(lab).points) <= 201
    assert "the shift of the DCM is 20 to 500 ms" in lab.say("ALMotor.setDCMShift(5000);", 0.3)


def test_a_robot_without_a_dcm_answers_in_one_line() -> None:
    lab = Lab.ready(without_dcm())
    assert "setDCMWrite: this robot has no DCM: joints are written by setAngles" in lab.say(
        "motor.setDCMWrite(true);", 0.3
    )
    assert lab.look("ALMotor.dcmWrite") == "false"


def test_settings_that_are_read_again_count() -> None:
    lab = swinging()
    lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=0, options={"dcm_write": True, "dcm_shift": 0.1}))
    lab.run(0.2)
    assert lab.look("[ALMotor.dcmWrite, ALMotor.dcmShift]") == "[true, 0.1]"
    before = dcm_of(lab).writes
    lab.say("headYaw.val = 0.5;", 0.5)
    assert dcm_of(lab).writes > before and lab.device.body.joints["HeadYaw"].angle == pytest.approx(0.5, abs=0.001)


def test_what_a_program_has_chosen_survives_a_lost_link() -> None:
    lab = swinging()
    lab.say("motor.setDCMWrite(true); ALMotor.setDCMShift(100);", 0.3)
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    before = dcm_of(lab).writes
    lab.say("head.load = 1; sleep(200ms); headYaw.val = 0.5;", 1.0)
    assert dcm_of(lab).writes > before


@pytest.mark.parametrize("by_dcm", ["false", "true"])
def test_the_trace_has_motor_time_and_position(by_dcm: str, tmp_path: Path) -> None:
    lab = swinging(trace_file=str(tmp_path / "traj.log"))
    path = lab.say(f"motor.setDCMWrite({by_dcm}); ALMotor.setTrace(1);", 0.3).strip('"')
    assert path == str(tmp_path / "traj.log")
    lab.say("headYaw.val = 0.5 time:1s;", 1.5)
    assert lab.say("ALMotor.setTrace(0);", 0.3) == ""
    rows = [line.split() for line in Path(path).read_text().splitlines()]
    assert {row[0] for row in rows} == {"0"} and len(rows) >= 45
    times, places = ([float(row[column]) for row in rows] for column in (1, 2))
    assert times == sorted(times) and times[-1] == pytest.approx(1.0, abs=0.15)
    assert places == sorted(places) and places[-1] == pytest.approx(0.5, abs=0.001)
    size = Path(path).stat().st_size
    lab.say("headYaw.val = 0;", 0.5)
    assert Path(path).stat().st_size == size


def test_the_trace_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motor_trace, "MOST_BYTES", 1000)
    rig = DcmRig().stiffen()
    path = tmp_path / "traj.log"
    assert write_setting(rig, "trace", str(path)).ok
    rig.follow(swing, 2.0)
    assert 900 < path.stat().st_size <= 1000
    assert [each for each in rig.news if isinstance(each, Refused)] == [
        Refused("motors", "trace", f"{path} is full, so the trace has ended")
    ]


def test_a_trace_is_never_written_through_a_link(tmp_path: Path) -> None:
    rig = DcmRig().stiffen()
    other = tmp_path / "other"
    other.write_text("mine")
    (tmp_path / "traj.log").symlink_to(other)
    assert write_setting(rig, "trace", str(tmp_path / "traj.log")).ok
    rig.follow(swing, 0.2)
    assert other.read_text() == "mine" and not (tmp_path / "traj.log").is_symlink()
    reply = write_setting(rig, "trace", str(tmp_path / "none" / "traj.log"))
    assert not reply.ok and "No such file or directory" in reply.error


def write_setting(rig: Rig, item: str, value: Any) -> Reply:
    """Write a setting of the motors; the answer."""
    (reply,) = rig.driver.request(Request(1, "write", "motors", item, value))
    assert isinstance(reply, Reply)
    return reply


def test_walking_goes_on_while_the_head_is_written_by_the_dcm() -> None:
    lab = Lab.ready(dcm_write=True)
    stand(lab.device.body)
    lab.run(0.2)
    lab.say("headYaw.val = 0 sin:1s ampli:0.5, robot.go(0.2);", 5)
    assert lab.device.body.x == pytest.approx(0.2, abs=0.03) and not lab.device.body.fallen
