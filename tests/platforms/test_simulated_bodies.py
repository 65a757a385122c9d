"""Robots with a body in MuJoCo, driven by urbiscript over the simulated bus in simulated time."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import bioloid_lab
import nxt_lab
import p3dx_lab
import pytest
import segway_lab
import spykee_lab

from urbihw_fakes.bodies.balance import BalancingBody
from urbihw_fakes.bodies.humanoid import Humanoid
from urbihw_fakes.bodies.pioneer import SimulatedBody
from urbihw_fakes.bodies.tracked import TrackedBody
from urbihw_fakes.bodies.tribot import SimulatedTriBot
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.spykee.device import Spykee

pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

MOTIONS = Path(__file__).parents[2] / "docs" / "examples" / "humanoid.mtn"
FALLEN, UPRIGHT = math.radians(60), math.radians(15)


@pytest.fixture
def humanoid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bioloid_lab.Lab:
    """A Bioloid on its feet, with the motions of the example."""
    shutil.copy(MOTIONS, tmp_path)
    monkeypatch.setattr(bioloid_lab.Lab, "motions", str(tmp_path))
    return bioloid_lab.Lab.ready(Humanoid("room", baud=bioloid_lab.BAUD))


def body(lab: bioloid_lab.Lab) -> Humanoid:
    """Where the Bioloid's body is."""
    assert isinstance(lab.kit, Humanoid)
    return lab.kit


def test_it_sits_down_and_rises_by_a_motion_file(humanoid: bioloid_lab.Lab) -> None:
    high = body(humanoid).height
    humanoid.say('robot.play("humanoid.mtn:Sit");', 4)
    assert body(humanoid).height < high - 0.03 and body(humanoid).tilt < UPRIGHT
    humanoid.say('robot.play("humanoid.mtn:Ready");', 3)
    assert body(humanoid).height == pytest.approx(high, abs=0.01) and body(humanoid).tilt < UPRIGHT


def test_it_waves_by_a_motion_file(humanoid: bioloid_lab.Lab) -> None:
    kit = body(humanoid)
    hand = kit.simulation.body("right_hand")
    low = float(kit.simulation.data.xpos[hand][2])
    humanoid.say('robot.play("humanoid.mtn:Wave"),', 1)
    elbows = []
    for _ in range(25):
        humanoid.run(0.1)
        if float(kit.simulation.data.xpos[hand][2]) > low + 0.05:
            elbows.append(kit.servo(5).position)
    assert max(elbows) - min(elbows) > 80
    humanoid.run(2.5)
    assert float(kit.simulation.data.xpos[hand][2]) == pytest.approx(low, abs=0.02) and kit.tilt < UPRIGHT


def test_it_falls_when_its_motors_are_switched_off(humanoid: bioloid_lab.Lab) -> None:
    humanoid.run(1)
    assert body(humanoid).tilt < UPRIGHT
    humanoid.say("motors.load = 0;", 2)
    assert body(humanoid).tilt > FALLEN


def test_it_falls_when_the_bus_loses_its_power(humanoid: bioloid_lab.Lab) -> None:
    humanoid.console().line("power off")
    humanoid.run(2)
    assert body(humanoid).tilt > FALLEN


def test_a_program_reads_the_weight_and_what_is_ahead(humanoid: bioloid_lab.Lab) -> None:
    humanoid.run(1)
    assert abs(humanoid.number("motor13.torque")) > 0.15 > abs(humanoid.number("motor17.torque"))
    before = humanoid.number("sensor100.IRCenter")
    x, y, _ = body(humanoid).place
    # As high as its head.
    body(humanoid).simulation.add_crate(x + 0.35, y, 0.4)
    humanoid.run(0.5)
    assert humanoid.number("sensor100.IRCenter") > before + 50


def pioneer(**options: object) -> p3dx_lab.Lab:
    """A Pioneer in the room, motors on."""
    lab = p3dx_lab.Lab.ready(P3dx(body=SimulatedBody("room")), **options)
    lab.say("P3dx.body.load = 1;", 0.5)
    return lab


def test_a_pioneer_drives_by_its_encoders_and_slips_a_little() -> None:
    lab = pioneer()
    lab.say("P3dx.go(1),", 6)
    assert lab.number("P3dx.body.odometry.x") == pytest.approx(1.0, abs=0.02)
    assert 0.0 < lab.number("P3dx.body.odometry.x") - lab.where()[0] + 0.0005 < 0.02


def test_a_pioneer_stops_before_a_crate_by_its_sonar() -> None:
    lab = pioneer()
    lab.console().line("box 2 0")
    lab.say("at (P3dx.body.sonar[front][front][left].val < 0.6) P3dx.stop; P3dx.body.x.speed = 0.3;", 8)
    assert 0.9 < lab.where()[0] < 1.3 and not lab.kit.body.moving and not lab.kit.body.front


def test_a_pioneer_that_runs_into_a_wall_tells_of_its_bumper_and_is_stopped(caplog: pytest.LogCaptureFixture) -> None:
    lab = pioneer()
    lab.say("P3dx.body.x.speed = 0.5;", 9)
    assert lab.kit.body.front == {2} and not lab.kit.body.moving
    assert "the wheels have been blocked for 1 s: the base is stopped" in caplog.text
    assert lab.look("P3dx.body.frontBumpers") == "[false, false, true, false, false]"


def test_the_laser_sees_the_door_of_the_room() -> None:
    lab = pioneer()
    lab.say("P3dx.body.laser.load = 1;", 3)
    ahead = lab.number("P3dx.body.laser.val[90]")
    assert ahead == pytest.approx(3.0 - 0.021, abs=0.03)


def test_a_pioneer_goes_through_the_door_by_its_map(tmp_path: Path) -> None:
    lab = pioneer()
    lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(tmp_path)}";')
    lab.until(lambda: lab.thought() and lab.look("P3dx.planner.ready") == "true")
    lab.say("P3dx.moveTo([5, 0, 90deg]),")
    lab.until(lambda: lab.thought() and not lab.kit.body.moving and lab.where()[0] > 4.5, 60)
    x, y, heading = lab.where()
    assert math.hypot(x - 5, y) < 0.1 and heading == pytest.approx(math.pi / 2, abs=0.1)
    # It touched nothing on its way, and slipped a little.
    assert not lab.kit.body.front and lab.kit.body.pose != lab.kit.body.odometry


def test_a_tribot_stops_before_the_wall_by_its_ultrasonic_sensor() -> None:
    robot = SimulatedTriBot("room")
    lab = nxt_lab.Lab.ready(robot)
    lab.say("at (sonar.val < 40) wheels.speed = 0; sleep(0.5s); wheels.speed = 50;", 8)
    assert 0.15 < robot.distance() < 0.45 and not robot.base.moving and not robot.touch.pressed


def test_a_tribot_drives_a_way_and_turns() -> None:
    robot = SimulatedTriBot("room")
    lab = nxt_lab.Lab.ready(robot)
    x, _, _ = robot.base.pose
    lab.say("robot.go(0.5),", 8)
    assert robot.base.pose[0] - x == pytest.approx(0.5, abs=0.03)
    lab.say("robot.turn(1.57),", 8)
    # To the right, as for every base.
    assert robot.base.pose[2] == pytest.approx(-1.57, abs=0.12)


def test_a_segway_drives_leans_and_stops() -> None:
    base = BalancingBody("room")
    lab = segway_lab.Lab.ready(SegwayRmp(body=base))
    lab.say("robot.xSpeed = 0.4;", 1)
    assert base.pitch > 0.02
    lab.run(2)
    assert base.speed == pytest.approx(0.4, abs=0.05)
    lab.say("robot.stop;", 3)
    assert base.speed == pytest.approx(0.0, abs=0.02) and not base.fallen
    assert base.x == pytest.approx(base.forward, abs=0.02)


def test_a_segway_falls_when_its_emergency_stop_is_pressed() -> None:
    base = BalancingBody("flat")
    lab = segway_lab.Lab.ready(SegwayRmp(body=base))
    lab.console().line("push 3")
    lab.console().line("estop on")
    lab.run(4)
    assert base.fallen


def test_a_spykee_drives_to_a_wall_and_its_tracks_go_on() -> None:
    body = TrackedBody("room")
    body.place(2.3, 0.0, 0.0)
    lab = spykee_lab.Lab.ready(Spykee(body=body))
    lab.say("trackL.val = 60 | trackR.val = 60|;", 4)
    assert 2.7 < body.x < 2.95 and body.ways[0] > body.x - 2.3 + 0.05
