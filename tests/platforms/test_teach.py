"""Teach and play on whole robots: the body of the fake is turned by hand, and follows what is played."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bioloid_lab
import chain_lab
import cia402_lab
import nao_lab
import pytest
import so101_lab
from lab import RobotLab
from motions import Scene

from urbihw.platforms.teach.recording import MotionRecording, PoseRow, parse
from urbihw_fakes.bioloid import Bioloid as Kit
from urbihw_fakes.dynamixel.ax12 import DEGREES, Ax12

BOW = Path(__file__).parents[2] / "docs" / "examples" / "bow.mtn"
STEP = math.radians(DEGREES)


class Bioloid(bioloid_lab.Lab):
    """A kit of three AX-12."""

    def __init__(self, kit: Kit | None = None, **options: Any) -> None:
        super().__init__(Kit(servos=(1, 2, 3), sensors=(), baud=bioloid_lab.BAUD) if kit is None else kit, **options)

    def servo(self, number: int) -> Ax12:
        """A servo of the fake."""
        self.kit.tick(self.bus_clock.now())
        found = self.kit[number]
        assert isinstance(found, Ax12)
        return found

    def place(self, number: int) -> float:
        """Where its horn is, in rad from the middle."""
        return (self.servo(number).position - 511.5) * STEP

    def turn(self, number: int, angle: float) -> None:
        """Turn the horn by hand; only without torque."""
        assert self.servo(number).registers.get("torque_enable") == 0
        self.servo(number).position = 511.5 + angle / STEP


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bioloid:
    """Three servos, switched on, in the middle; the library is kept in a folder of the test."""
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    lab = Bioloid.ready()
    assert lab.say("bioloid.on;", 0.3) == ""
    return lab


def write(lab: RobotLab, name: str, joints: tuple[str, ...], *rows: tuple[float, ...]) -> None:
    """Write a motion as by hand."""
    folder = Path(lab.motions)
    folder.mkdir(exist_ok=True)
    made = MotionRecording("r", 25.0, joints, tuple(PoseRow(time, tuple(angles)) for time, *angles in rows))
    (folder / f"{name}.jsonl").write_text(made.text())


def track(lab: Any, seconds: float, look: Callable[[], float]) -> list[float]:
    """Where something is at each tick of some seconds."""
    found = []
    for _ in range(round(seconds / lab.tick)):
        lab.step()
        found.append(look())
    return found


def swing(seconds: float) -> float:
    """What the hand does: rad after some seconds."""
    return 0.6 * math.sin(seconds * 2)


# ---------------------------------------------------------------- teach


def test_what_the_hand_does_is_recorded_and_the_body_repeats_it(robot: Bioloid) -> None:
    assert robot.say('robot.teach("wave", [joint[2]]),', 0.3) == ""
    assert robot.look("[joint[1].load, joint[2].load]") == "[1, 0]"
    for step in range(300):
        robot.turn(2, swing(step * robot.tick))
        robot.step()
    assert robot.say("robot.endTeaching; robot.motions;", 0.3) == '["wave"]'
    motion = parse((Path(robot.motions) / "wave.jsonl").read_text(), "wave")
    assert motion.joints == ("joint[2]",) and motion.seconds == pytest.approx(3.3, abs=0.1)
    # The hand has left the horn elsewhere.
    robot.say("joint[2].val = -1;", 1.0)
    robot.say('var begun = -1| at (robot.motionBegun?(var n)) begun = System.time|; robot.play("wave"),', 0.0)
    body = track(robot, 8.0, lambda: robot.place(2))
    # Also the beginning, in which the hand had not begun.
    expected = [*(row.angles[0] for row in motion.rows)]
    best = min(
        max(abs(body[shift + 4 * index] - angle) for index, angle in enumerate(expected[1:], 1))
        for shift in range(len(body) - 4 * len(expected))
    )
    assert best < 0.08
    assert robot.look("robot.playing") == "[]"


def test_teaching_moves_nothing_by_itself_and_the_torque_returns_without_a_jump(robot: Bioloid) -> None:
    robot.say('joint[1].val = 0.8; joint[2].val = 0.8; sleep(2s); robot.teach("wave"),', 2.5)
    still = track(robot, 0.5, lambda: robot.place(1))
    assert max(still) - min(still) < 0.01
    robot.turn(1, -1.0)
    robot.run(0.5)
    assert robot.place(1) == pytest.approx(-1.0, abs=0.01)
    robot.say("robot.endTeaching;")
    after = track(robot, 1.0, lambda: robot.place(1))
    assert all(angle == pytest.approx(-1.0, abs=0.02) for angle in after)
    assert robot.servo(1).registers.get("torque_enable") == 1
    assert robot.look("joint[1].load") == "1"


def test_a_joint_that_was_off_stays_off(robot: Bioloid) -> None:
    robot.say('joint[1].load = 0; sleep(200ms); robot.teach("wave"),', 1.0)
    robot.say("robot.endTeaching;", 0.5)
    assert robot.look("[joint[1].load, joint[2].load]") == "[0, 1]"


def test_a_robot_that_was_never_on_can_be_taught_and_then_play(robot: Bioloid) -> None:
    lab = Bioloid.ready()
    assert lab.say('robot.teach("wave", joint[1]),', 0.3) == ""
    lab.turn(1, 0.7)
    lab.run(0.5)
    assert lab.say('robot.endTeaching; robot.savePose("up");', 0.3) == ""
    lab.turn(1, 0.0)
    assert lab.say('robot.play("wave");', 4.0) == ""
    assert lab.place(1) == pytest.approx(0.7, abs=0.03)


def test_a_recording_ends_the_motions_of_its_joints(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (6.0, 2.0))
    write(robot, "other", ("joint[2]",), (0.0, 0.0), (6.0, 2.0))
    robot.say('robot.play("up"), robot.play("other"),', 1.5)
    robot.say('robot.teach("wave", joint[1]),', 0.5)
    assert robot.look("robot.playing") == '["other"]'
    still = track(robot, 0.5, lambda: robot.place(1))
    assert max(still) - min(still) < 0.01


def test_a_recording_that_is_stopped_is_kept_and_the_joints_hold(robot: Bioloid) -> None:
    robot.say('var t = Tag.new; t: robot.teach("wave", joint[1]),', 1.0)
    robot.say("t.stop;", 0.5)
    assert robot.look("[robot.motions, joint[1].load]") == '[["wave"], 1]'


def test_a_recording_of_few_poses_has_as_many_as_it_should(robot: Bioloid) -> None:
    robot.say('robot.teach("wave", joint[1], 2),', 3.2)
    robot.say("robot.endTeaching;", 0.3)
    motion = parse((Path(robot.motions) / "wave.jsonl").read_text(), "wave")
    assert [row.time for row in motion.rows] == pytest.approx([0, 0.5, 1, 1.5, 2, 2.5, 3], abs=0.05)


def leave(robot: Bioloid) -> None:
    """The client that teaches leaves; it is the second one."""
    other = robot.kernel.open_lobby()
    robot.say("robot.endTeaching;", 0.3)
    robot.kernel.feed(other, b'robot.teach("wave", joint[1]),')
    robot.run(1.0)
    assert robot.look("joint[1].load") == "0"
    other.close()


def replug(robot: Bioloid) -> None:
    """The cable of the robot is pulled, and put back."""
    robot.end.unplug()
    robot.run(1.0)
    robot.end.replug()


class Taught(Scene):
    """A robot that is being taught."""

    def __post_init__(self) -> None:
        self.lab, self.remote = self.motion.make(), None


def kill_worker(robot: Bioloid) -> None:
    """The bus worker is killed, and another one has its place."""
    motion = replace(bioloid_lab.MOTION, make=lambda: robot)
    Taught(motion, motion.kinds["joint"], Path(robot.motions), []).worker_killed(0.3)


@pytest.mark.parametrize("rate", [25, 0, 0.5])
@pytest.mark.parametrize(
    "happen",
    [
        lambda robot: robot.say("robot.stop;"),
        lambda robot: robot.say("robot.stop | robot.endTeaching;"),
        lambda robot: robot.say("bioloid.estop = true;"),
        leave,
        replug,
        kill_worker,
    ],
    ids=["stop", "stop and end", "emergency stop", "client", "link", "worker"],
)
def test_after_a_stop_or_a_loss_the_torque_stays_off(
    robot: Bioloid, happen: Callable[[Bioloid], object], rate: float
) -> None:
    """A hand may hold the joint, and goes on turning it."""
    robot.say(f'robot.teach("wave", joint[1], {rate}),', 1.0)
    happen(robot)
    robot.run(0.5)
    for step in range(300):
        robot.turn(1, swing(step * robot.tick))
        robot.step()
    assert robot.look("robot.teaching.isNil") == "true"
    robot.say("bioloid.estop = false; joint[1].load = 1;", 0.5)
    assert robot.servo(1).registers.get("torque_enable") == 1


@pytest.mark.parametrize(
    ("event", "reason"),
    [("robot.stop", "bioloid was stopped"), ("bioloid.estop = true", "emergency stop")],
)
def test_a_stop_ends_a_recording_and_tells_that_the_joints_are_off(robot: Bioloid, event: str, reason: str) -> None:
    robot.say('robot.teach("wave", joint[1]),', 1.0)
    robot.turn(1, 0.5)
    robot.run(0.2)
    heard = robot.say(f"{event};", 0.5)
    assert "not switched on again: " in heard and reason in heard
    assert robot.look("[robot.motions, robot.teaching.isNil, joint[1].load]") == '[["wave"], true, 0]'
    still = track(robot, 0.5, lambda: robot.place(1))
    assert all(angle == pytest.approx(0.5, abs=0.02) for angle in still)


def test_key_poses_taken_one_by_one(robot: Bioloid) -> None:
    robot.say('robot.teach("steps", [joint[1], joint[2]], 0),', 0.3)
    for angle in (0.5, -0.5, 0.2):
        robot.turn(1, angle)
        robot.run(0.3)
        robot.say("robot.keyPose;", 0.1)
    robot.say("robot.endTeaching;", 0.2)
    motion = parse((Path(robot.motions) / "steps.jsonl").read_text(), "steps")
    assert [row.time for row in motion.rows] == pytest.approx([0.0, 1.0, 1.7], abs=0.02)
    assert [row.angles[0] for row in motion.rows] == pytest.approx([0.5, -0.5, 0.2], abs=0.01)


def test_a_lost_link_ends_a_recording_because_its_angles_are_old(robot: Bioloid) -> None:
    robot.say('robot.teach("wave", joint[1]),', 1.0)
    robot.end.unplug()
    robot.run(1.0)
    assert "teach: the link to the robot is down: the recording has ended" in robot.heard()
    assert robot.look("[robot.motions, robot.teaching.isNil]") == '[["wave"], true]'


def test_one_recording_at_a_time(robot: Bioloid) -> None:
    robot.say('robot.teach("wave"),', 0.3)
    assert "teach: wave is being recorded: robot.endTeaching ends that" in robot.say('robot.teach("other");', 0.1)
    robot.say("robot.endTeaching;", 0.2)
    assert "endTeaching: nothing is being recorded" in robot.say("robot.endTeaching;")


# ---------------------------------------------------------------- poses


def test_a_pose_is_saved_and_reached_slowly(robot: Bioloid) -> None:
    robot.say('joint[1].val = 0.9; sleep(1s); robot.savePose("home"); joint[1].val = -0.9; sleep(1s);', 2.5)
    assert robot.say("robot.poses;", 0.2) == '["home"]'
    robot.say('robot.pose("home"),', 0.0)
    body = track(robot, 5.0, lambda: robot.place(1))
    speeds = [(new - old) / robot.tick / 10 for old, new in zip(body, body[10:], strict=False)]
    assert body[-1] == pytest.approx(0.9, abs=0.05)
    assert max(speeds) < 1.15, "blendSpeed is 1 rad/s"


# ---------------------------------------------------------------- play


def test_the_speed_the_passes_and_joined_motions(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (1.0, 0.8))
    write(robot, "down", ("joint[1]", "joint[2]"), (0.0, 0.8, 0.0), (1.0, 0.0, 0.4))
    robot.say('at (robot.motionEnded?(var n, var how)) echo("%s: %s" % [n, how]);')
    robot.say('robot.play(["up", "down"], 2, 2),', 0.0)
    body = track(robot, 6.0, lambda: robot.place(1))
    around = [(index, body[index - 20 : index + 20]) for index in range(20, len(body) - 20)]
    tops = [index for index, near in around if body[index] > 0.7 and body[index] == max(near)]
    assert tops and 0.9 < (tops[-1] - tops[0]) * robot.tick < 2.2, "two passes at twice the speed"
    assert robot.heard() == "*** up down: finished"
    assert robot.place(2) == pytest.approx(0.4, abs=0.03)


def test_a_motion_of_joints_that_are_switched_off_is_an_error_and_of_some_it_goes_on(robot: Bioloid) -> None:
    write(robot, "both", ("joint[1]", "joint[2]"), (0.0, 0.0, 0.0), (2.0, 0.5, 0.5))
    robot.say("joint[1].load = 0;", 0.3)
    assert "moves nothing" not in robot.say('robot.play("both"),', 4.0)
    assert robot.place(2) == pytest.approx(0.5, abs=0.05)
    robot.say("joint[2].load = 0;", 0.3)
    before = robot.place(2)
    heard = robot.say('robot.play("both", 0.2);', 2.0)
    assert "play: both moves nothing: its joints are switched off (load is 0)" in heard
    assert robot.place(2) == pytest.approx(before, abs=0.1)


def test_a_stop_in_the_middle_holds_the_body_and_ends_the_statement(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (4.0, 2.0))
    robot.say('at (robot.motionEnded?(var n, var how)) echo("%s: %s" % [n, how]); robot.play("up"),', 2.0)
    second = robot.kernel.open_lobby()
    robot.kernel.feed(second, b"robot.stop;")
    robot.run(0.3)
    heard = robot.heard()
    assert "bioloid was stopped after this statement had begun" in heard and "*** up: aborted" in heard
    still = track(robot, 1.0, lambda: robot.place(1))
    assert max(still) - min(still) < 0.02 and 0.6 < still[-1] < 1.4


def test_an_emergency_stop_ends_it_too(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (4.0, 2.0))
    robot.say('robot.play("up"),', 2.0)
    robot.say("bioloid.estop = true;", 0.3)
    still = track(robot, 1.0, lambda: robot.place(1))
    assert max(still) - min(still) < 0.02
    assert "emergency stop" in robot.say('robot.play("up");', 1.0)


def test_a_frozen_motion_holds_and_goes_on_where_it_was(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (4.0, 2.0))
    robot.say('var t = Tag.new; t: robot.play("up"),', 2.0)
    robot.say("t.freeze;", 0.3)
    before = robot.place(1)
    robot.run(3.0)
    assert robot.place(1) == pytest.approx(before, abs=0.02)
    robot.say("t.unfreeze;", 0.3)
    assert robot.place(1) == pytest.approx(before + 0.15, abs=0.08)


def test_the_limits_of_the_settings_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    lab = Bioloid.ready(limits={"motor1": {"position": [-0.5, 0.5]}})
    write(lab, "far", ("joint[1]",), (0.0, 0.0), (2.0, 2.0))
    lab.say('robot.play("far"),')
    assert max(track(lab, 3.0, lambda: lab.place(1))) < 0.55
    assert lab.look("joint[1].limitedBy") == '"limits.motor1.position"'


def test_one_motion_at_a_time_for_a_joint(robot: Bioloid) -> None:
    for number in (1, 2):
        write(robot, f"m{number}", (f"joint[{number}]",), (0.0, 0.0), (3.0, 1.0))
    robot.say('at (robot.motionEnded?(var n, var how)) echo("%s: %s" % [n, how]);')
    robot.say('robot.play("m1"),', 0.5)
    robot.say('robot.play("m2"),', 0.5)
    assert robot.look("robot.playing") == '["m1", "m2"]'
    assert robot.say('robot.play("m1"),', 0.5) == "*** m1: aborted"
    assert robot.look("robot.playing") == '["m2", "m1"]'
    # So does a client that writes to a joint.
    robot.say("joint[2].val = -0.5;", 0.5)
    assert robot.look("robot.playing") == '["m1"]'
    assert robot.place(2) == pytest.approx(-0.5, abs=0.05)


def test_a_client_that_leaves_ends_what_it_plays(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (4.0, 2.0))
    other = robot.kernel.open_lobby()
    robot.kernel.feed(other, b'robot.play("up"),')
    robot.run(2.0)
    other.close()
    robot.run(0.3)
    still = track(robot, 1.0, lambda: robot.place(1))
    assert max(still) - min(still) < 0.02 and robot.look("robot.playing") == "[]"


def test_a_lost_link_ends_it_and_its_return_moves_nothing(robot: Bioloid) -> None:
    write(robot, "up", ("joint[1]",), (0.0, 0.0), (4.0, 2.0))
    robot.say('robot.play("up"),', 2.0)
    robot.end.unplug()
    robot.run(1.0)
    assert "play: the link to the robot is down: the motion has ended" in robot.heard()
    robot.end.replug()
    robot.run(2.0)
    still = track(robot, 1.0, lambda: robot.place(1))
    assert max(still) - min(still) < 0.02


def test_a_lost_joint_ends_only_the_motions_with_it(robot: Bioloid) -> None:
    for number in (1, 2):
        write(robot, f"m{number}", (f"joint[{number}]",), (0.0, 0.0), (6.0, 1.0))
    robot.say('robot.play("m1"), robot.play("m2"),', 1.0)
    robot.kit.power_off(robot.bus_clock.now(), 2)
    robot.run(1.0)
    assert "play: device 2 is lost" in robot.heard()
    assert robot.look("robot.playing") == '["m1"]'


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        ('robot.play("wafe");', "play: there is no motion 'wafe'; did you mean wave?"),
        ('robot.play("../x");', "1 to 64 letters"),
        ('robot.play("lost");', "play: lost: this robot has no joint[7] joint[8]"),
        ('robot.play("wave", 0);', "play: the speed is a factor above 0 up to 10, not 0"),
        ('robot.play("wave", 1, 1.5);', "play: the number of repetitions is 1, 2 ... or inf, not 1.5"),
        ("robot.play([]);", "play: give 1 to 100 motions"),
        ("robot.play(nil);", "play: the name of a motion is a String, not nil"),
        ('robot.play(["wave", 3]);', "play: the name of a motion is a String, not 3"),
        ('robot.play("wave", nil);', "play: the speed is a Float, not nil"),
        ('robot.play("wave", 1, "2");', 'play: the number of repetitions is a Float, not "2"'),
        ("robot.pose(nil);", "pose: the name of a pose is a String, not nil"),
        ("robot.savePose(nil);", "savePose: the name of a pose is a String, not nil"),
        ("robot.pages(nil);", "pages: the name of a file is a String, not nil"),
        ("robot.teach(nil);", "teach: the name of a motion is a String, not nil"),
        ('robot.teach("a", [], nil);', "teach: the rate is a Float, not nil"),
        ('robot.play("long");', "play: long.jsonl:2: a number has too many digits"),
        ('robot.pose("home");', "pose: there is no pose 'home'; there are: none"),
        ('robot.teach("a b");', "teach: 'a b': the name of a motion has 1 to 64 letters, digits, _ or -"),
        ('robot.teach("a", "nose");', 'teach: "nose" is no joint; there are: joint[1] joint[2] joint[3]'),
        ('robot.teach("a", [], -1);', "teach: the rate is 0 (key poses) to 100 Hz, not -1"),
        ('robot.play("bow.mtn:Nod");', "play: bow.mtn has no page 'Nod': robot.pages(\"bow.mtn\") lists them"),
        ('robot.play("bad");', "play: bad.jsonl:1: the first line has the keys"),
    ],
)
def test_mistakes_are_told_in_words(robot: Bioloid, statement: str, problem: str) -> None:
    write(robot, "wave", ("joint[1]",), (0.0, 0.0))
    write(robot, "lost", ("joint[1]", "joint[7]", "joint[8]"), (0.0, 0.0, 0.0, 0.0))
    (Path(robot.motions) / "bad.jsonl").write_text("[1, 2]\n")
    head = (Path(robot.motions) / "wave.jsonl").read_text().partition("\n")[0]
    (Path(robot.motions) / "long.jsonl").write_text(f"{head}\n[0, {'1' * 5000}]\n")
    (Path(robot.motions) / "bow.mtn").write_bytes(BOW.read_bytes())
    assert problem in robot.say(statement, 0.3)
    assert robot.look("[joint[1].load, robot.playing, robot.teaching.isNil]") == "[1, [], true]"


def test_a_joint_with_two_names_is_recorded_once_and_played_by_either(robot: Bioloid) -> None:
    robot.say('robot.body.addComponent("head"); robot.body.head.addDevice("yaw", motor2);', 0.1)
    robot.say('robot.body.head.addDevice("pitch", motor3);', 0.1)
    robot.say('robot.teach("wave"),', 0.5)
    robot.say("robot.endTeaching;", 0.3)
    recorded = parse((Path(robot.motions) / "wave.jsonl").read_text(), "wave")
    assert len(recorded.joints) == 3
    write(robot, "look", ("headYaw",), (0.0, 0.0), (1.0, 0.4))
    assert robot.say('robot.play("look"),', 3.0) == ""
    assert robot.place(2) == pytest.approx(0.4, abs=0.03)


# ---------------------------------------------------------------- RoboPlus


def test_a_page_of_roboplus_brings_the_body_to_its_numbers(robot: Bioloid) -> None:
    Path(robot.motions).mkdir()
    (Path(robot.motions) / "bow.mtn").write_bytes(BOW.read_bytes())
    assert robot.say('robot.pages("bow.mtn");') == '["Ready", "Bow", "March", "March on", "Halt"]'
    robot.say('at (robot.motionEnded?(var n, var how)) echo("%s: %s" % [n, how]); robot.play("bow.mtn:Bow"),', 0.0)
    seen: list[tuple[int, ...]] = []

    def look() -> float:
        goals = tuple(robot.servo(number).registers.get("goal_position") for number in (1, 2, 3))
        if not seen or goals != seen[-1]:
            seen.append(goals)
        return robot.servo(1).position

    body = track(robot, 6.5, look)
    # The goals of both steps, of each of two passes, and of the next page, exactly as in the file.
    for goals in ((612, 412, 512), (512, 512, 562), (512, 512, 512)):
        assert goals in seen
    assert max(body) == pytest.approx(612, abs=8)
    assert robot.heard() == "*** bow.mtn:Bow: finished"
    assert seen[-1] == (512, 512, 512)


def test_pages_in_a_circle_go_on_until_they_are_asked_to_end_by_their_exit_page(robot: Bioloid) -> None:
    Path(robot.motions).mkdir()
    (Path(robot.motions) / "bow.mtn").write_bytes(BOW.read_bytes())
    robot.say('robot.play("bow.mtn:March"),', 8.0)
    assert robot.look("robot.playing") == '["bow.mtn:March"]'
    robot.say("robot.endPlaying;", 3.0)
    assert robot.look("robot.playing") == "[]"
    assert robot.servo(3).registers.get("goal_position") == 462


# ---------------------------------------------------------------- the other robots


def test_a_chain_by_the_names_of_its_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Offset and direction of a joint are in its file: a motion belongs to the joint, whatever servo it has."""
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    devices = {"hip": {"id": 1, "direction": -1, "offset": 0.2}, "knee": 3}
    lab = chain_lab.Lab.ready("AX-12:1,XL330-M288:3", devices=devices)
    write(lab, "step", ("hip", "knee"), (0.0, 0.2, 0.0), (2.0, 0.7, -0.5), (3.0, 0.7, -0.5))
    assert lab.say('robot.play("step"),', 6.0) == ""
    assert lab.place(1) == pytest.approx(-0.5, abs=0.05)
    assert lab.place(3) == pytest.approx(-0.5, abs=0.05)
    before = lab.place(3)
    lab.say('robot.teach("hold"),', 0.5)
    assert lab.look("[hip.load, knee.load]") == "[0, 0]"
    lab.say("robot.endTeaching;", 0.5)
    assert lab.look("[hip.load, knee.load]") == "[1, 1]"
    assert lab.place(3) == pytest.approx(before, abs=0.03)


def test_the_numbers_of_roboplus_are_those_of_the_motor_whatever_the_frame_of_the_joint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path))
    lab = chain_lab.Lab.ready("AX-12:1", devices={"hip": {"id": 1, "direction": -1, "offset": 0.2}})
    one = BOW.read_text().replace("enable=0 1 1 1", "enable=0 1 0 0").replace("play_param=1 0 2", "play_param=0 0 1")
    (tmp_path / "one.mtn").write_text(one.replace("step=512 512 512 562", "step=512 612 512 512"))
    assert lab.say('robot.play("one.mtn:Bow"),', 5.0) == ""
    assert lab.register(1, "goal_position") == 612
    assert lab.number("hip.val") == pytest.approx(0.2 - (612 - 511.5) * STEP, abs=0.03)


def test_an_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    lab = so101_lab.Lab.ready()
    joint = lab.look("robot.motionPlayer.names(robot.motionPlayer.joints)[0]").strip('"')
    write(lab, "reach", (joint,), (0.0, 0.0), (2.0, 0.3), (3.0, 0.3))
    assert lab.say('robot.play("reach"),', 6.0) == ""
    assert lab.number("robot.motionPlayer.joints[0][1].val") == pytest.approx(0.3, abs=0.03)


def test_a_nao(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    lab = nao_lab.Lab.ready()
    body = lab.device.body.joints
    lab.say("head.load = 0.6;", 0.5)
    lab.say('robot.teach("nod", [headYaw, headPitch]),', 1.0)
    for step in range(100):
        body["HeadYaw"].angle = swing(step * lab.tick)
        lab.step()
    lab.say("robot.endTeaching;", 0.0)
    there = body["HeadYaw"].angle
    after = track(lab, 1.0, lambda: body["HeadYaw"].angle)
    assert max(abs(angle - there) for angle in after) < 0.05, "no jump when the stiffness returns"
    assert lab.number("headYaw.load") == pytest.approx(0.6)
    assert lab.look("robot.motions") == '["nod"]'
    motion = parse((tmp_path / "motions" / "nod.jsonl").read_text(), "nod")
    assert motion.joints == ("headYaw", "headPitch")
    lab.say('robot.play("nod"),', 0.0)
    seen = track(lab, 6.0, lambda: body["HeadYaw"].angle)
    yaw = [row.angles[0] for row in motion.rows]
    assert max(seen) == pytest.approx(max(yaw), abs=0.05) and min(seen) == pytest.approx(min(yaw), abs=0.05)
    assert seen[-1] == pytest.approx(yaw[-1], abs=0.05)


def test_a_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path / "motions"))
    lab = cia402_lab.Lab.ready()
    lab.say("cia402.on;", 1.0)
    joint = lab.look("robot.motionPlayer.names(robot.motionPlayer.joints)[0]").strip('"')
    write(lab, "turn", (joint,), (0.0, 0.0), (2.0, 1.0), (3.0, 1.0))
    assert lab.say('robot.play("turn"),', 6.0) == ""
    assert lab.number("robot.motionPlayer.joints[0][1].val") == pytest.approx(1.0, abs=0.05)
