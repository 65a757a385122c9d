"""Bodies in MuJoCo behind the simulated buses: what they do, and what their registers read."""

from __future__ import annotations

import io
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.bodies import humanoid, simulation
from urbihw_fakes.bodies.balance import BalancingBody
from urbihw_fakes.bodies.eye import Eye, choose_drawing
from urbihw_fakes.bodies.humanoid import READY, Humanoid
from urbihw_fakes.bodies.pioneer import SimulatedBody
from urbihw_fakes.bodies.tracked import TrackedBody
from urbihw_fakes.bodies.tribot import SimulatedTriBot
from urbihw_fakes.dynamixel.packet1 import status
from urbihw_fakes.endpoint import MemoryEndpoint, SteppedClock
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.console import commands
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.world import World
from urbihw_nao_fakes.legged import LeggedBody

# How it draws is chosen before it is imported.
DRAWS = choose_drawing()
pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

FAKES = Path(simulation.__file__).parents[2]


# --- a Bioloid --------------------------------------------------------------------------------------------------------


def after(kit: Humanoid, seconds: float) -> Humanoid:
    """The kit some time later, in steps like those of a bus at 100 Hz."""
    now = kit.simulation.time
    kit.advance(now)
    for count in range(round(seconds * 100)):
        kit.advance(now + (count + 1) / 100)
    return kit


def put(kit: Bioloid, name: str, value: int, servos: range = range(1, 19)) -> None:
    """Write a register of several servos."""
    for number in servos:
        kit[number].registers.put(name, value)


def test_a_humanoid_stands_as_its_controller_left_it() -> None:
    kit = after(Humanoid("flat"), 3)
    assert kit.height > 0.17 and kit.tilt < math.radians(12)
    assert all(kit[number].registers.get("torque_enable") for number in range(1, 19))
    kit.tick(kit.simulation.time)
    kit[11].sense()
    assert kit[11].registers.get("present_position") == pytest.approx(READY[10], abs=3)


def test_it_falls_when_its_torque_goes_and_stands_when_picked_up_with_torque() -> None:
    kit = after(Humanoid("flat"), 0.5)
    put(kit, "torque_enable", 0)
    assert after(kit, 2).tilt > math.radians(60)
    kit.stand()
    assert after(kit, 2).tilt > math.radians(60)
    for number, goal in enumerate(READY, 1):
        kit[number].registers.put("goal_position", goal)
    put(kit, "torque_enable", 1)
    assert after(kit, 2).tilt > math.radians(60)
    kit.stand()
    assert after(kit, 2).tilt < math.radians(12)


def test_it_falls_when_its_power_goes() -> None:
    kit = after(Humanoid("flat"), 0.5)
    kit.power_off(kit.simulation.time)
    assert after(kit, 2).tilt > math.radians(60)


def test_it_falls_when_pushed_hard_and_not_when_pushed_a_little() -> None:
    kit = after(Humanoid("flat"), 0.5)
    kit.push(1.0, 0.0)
    assert after(kit, 2).tilt < math.radians(15)
    kit.push(25.0, 0.0)
    assert after(kit, 2).tilt > math.radians(60)


def test_knees_carry_the_body_and_the_registers_show_it() -> None:
    kit = after(Humanoid("flat"), 1)
    knee, neck = kit.servo(13), kit.servo(1)
    # It sags to where the compliance holds the weight: 3 % of the torque at the punch, full torque 32 steps on.
    assert 3 < READY[12] - knee.position < 15
    assert 0.1 < knee.drive < 0.4 and abs(neck.drive) < 0.05
    knee.sense()
    assert knee.registers.get("present_load") == round(knee.drive * 1023)


def test_an_arm_without_torque_hangs_and_one_with_it_goes_at_the_moving_speed() -> None:
    kit = after(Humanoid("flat"), 0.5)
    put(kit, "moving_speed", 100, range(1, 2))
    put(kit, "goal_position", 512, range(1, 2))
    before = kit.servo(1).position
    after(kit, 1.0)
    # 100 steps of 0.111 rpm are 66.6 degrees/s, 227 position steps.
    assert kit.servo(1).position - before == pytest.approx(227, abs=12)
    after(kit, 1)
    assert kit.servo(1).position == pytest.approx(512, abs=8)
    put(kit, "torque_enable", 0, range(1, 2))
    assert after(kit, 1.5).servo(1).position < 350


def test_a_blocked_servo_overloads_and_lets_go() -> None:
    kit = after(Humanoid("flat"), 0.2)
    servo = kit.servo(2)
    servo.load = -1.2
    put(kit, "goal_position", 1000, range(2, 3))
    after(kit, 4)
    assert servo.overloaded and servo.registers.get("torque_limit") == 0 and servo.drive == 0


def test_the_sensor_in_the_head_sees_a_post_and_a_crate() -> None:
    kit = Humanoid("room")
    sensor = kit.sensor()
    kit.advance(0.0)
    sensor.sense()
    ahead = humanoid.reading(0.30)
    assert sensor.registers.get("ir_center") == pytest.approx(ahead, abs=10)
    assert sensor.registers.get("ir_left") < 15
    x, y, _ = kit.place
    kit.simulation.add_crate(x, y + 0.3, 0.4)
    sensor.sense()
    assert sensor.registers.get("ir_left") > 150
    kit.simulation.remove_crate()
    sensor.sense()
    assert sensor.registers.get("ir_left") < 15


def test_the_bytes_are_those_of_the_bus() -> None:
    clock = SteppedClock()
    end = MemoryEndpoint(Humanoid("flat"), clock)
    end.write(bytes.fromhex("FF FF 0D 04 02 24 02 C6"))  # READ of two bytes at 36, present position of servo 13
    answer = end.read(8, 0.01)
    position = int.from_bytes(answer[5:7], "little")
    assert answer == status(13, 0, position.to_bytes(2, "little"))
    assert 3 < READY[12] - position < 15  # it stands, and bends under its weight
    clock.sleep(1.0)
    end.write(bytes.fromhex("FF FF 0D 04 02 24 02 C6"))
    assert abs(int.from_bytes(end.read(8, 0.01)[5:7], "little") - position) <= 1


def test_the_same_calls_give_the_same_motion_and_their_rhythm_does_not_matter() -> None:
    def end_of(times: list[float]) -> list[float]:
        kit = Humanoid("room")
        kit.advance(0.0)
        put(kit, "torque_enable", 0)
        for now in times:
            kit.advance(now)
        return [float(value) for value in kit.simulation.data.qpos]

    often = [count / 100 for count in range(1, 101)]
    assert end_of(often) == end_of(often)
    assert end_of([0.5, 1.0]) == end_of([0.25, 0.5, 0.75, 1.0])


# --- a Pioneer --------------------------------------------------------------------------------------------------------


def pioneer(world: str = "flat") -> SimulatedBody:
    """A body with its motors on."""
    body = SimulatedBody(world)
    body.advance(0.0)
    body.switch_motors(True)
    return body


def drive(body: SimulatedBody, seconds: float, speed: float | None = None) -> SimulatedBody:
    """Drive for some time."""
    if speed is not None:
        body.forward.set_speed(speed)
    for _ in range(round(seconds * 10)):
        body.advance(body.simulation.time + 0.1)
    return body


def test_a_pioneer_goes_where_it_is_told_and_its_odometry_is_nearly_right() -> None:
    body = pioneer()
    body.forward.set_distance(1.0)
    drive(body, 6)
    assert body.odometry[0] == pytest.approx(1.0, abs=0.01)
    assert body.pose[0] == pytest.approx(body.odometry[0], abs=0.01) and body.pose[0] < body.odometry[0]
    body.turning.set_distance(math.pi / 2)
    drive(body, 5)
    assert body.odometry[2] == pytest.approx(math.pi / 2, abs=0.02)
    assert 1e-4 < abs(body.pose[2] - body.odometry[2]) < 0.05
    assert not body.moving


def test_on_ice_the_wheels_turn_and_the_body_stays_behind() -> None:
    body = pioneer()
    body.base.set_friction(0.01)
    drive(body, 3, 0.5)
    assert body.odometry[0] > 0.9
    assert body.pose[0] < 0.6 * body.odometry[0]


def test_it_runs_into_a_wall_with_its_bumper_and_stalls_and_backs_away() -> None:
    body = pioneer("room")
    drive(body, 9.5, 0.4)
    assert body.front == {2} and body.stalled == (True, True) and not body.rear
    assert 2.7 < body.pose[0] < 2.75
    drive(body, 2, -0.3)
    assert not body.front and body.stalled == (False, False) and body.pose[0] < 2.6


def test_it_pushes_a_light_box_and_not_a_fixed_crate() -> None:
    body = pioneer("room")
    box = int(body.simulation.model.body("cardboard_box").id)
    body.set_pose(0.8, 1.8, 0.0)
    drive(body, 4, 0.4)
    assert body.simulation.pose(box)[0] > 1.9
    body.set_pose(0.75, -0.9, -math.pi / 2)
    drive(body, 4, 0.4)
    assert body.pose[1] > -1.4 and body.front


def test_without_motors_it_rolls_to_a_stop_and_the_watchdog_brakes_it() -> None:
    free, held = (drive(pioneer(), 2, 0.4) for _ in range(2))
    free.switch_motors(False)
    held.halted = True
    start = free.pose[0]
    drive(free, 3)
    drive(held, 3)
    assert not free.moving and not held.moving
    assert free.pose[0] > start + 0.1


def test_sonars_and_laser_measure_the_world_and_what_is_put_into_it() -> None:
    kit = P3dx(body=pioneer("room"))
    assert kit.robot.sonars.distance(3) == pytest.approx(3.0 - 0.166, abs=0.1)
    kit.world.add_crate(1.2, 0.0, 0.4)
    assert kit.robot.sonars.distance(3) == pytest.approx(1.0 - 0.166, abs=0.1)
    assert min(kit.world.rays(0.0, 0.0, (0.0,), 8.0)) == pytest.approx(1.0, abs=1e-6)
    kit.world.remove_crate()
    assert min(kit.world.rays(0.0, 0.0, (0.0,), 8.0)) == pytest.approx(3.0, abs=1e-6)


def test_only_so_many_crates_fit() -> None:
    body = pioneer()
    for count in range(simulation.SPARE_CRATES):
        body.world.add_crate(count, 5.0)
    with pytest.raises(UnknownRequest, match="room for 8 crates"):
        body.world.add_crate(0.0, 6.0)


def test_the_room_has_the_walls_of_the_plain_one(tmp_path: Path) -> None:
    file = tmp_path / "room.map"
    file.write_text(pioneer("room").world.as_map(), "ascii")
    written, plain = World.read(str(file)), World.room()
    for x, y in ((0.0, 0.0), (2.0, -2.5), (4.5, 1.5)):
        angles = [math.radians(angle + 0.5) for angle in range(0, 360, 5)]
        for angle, ours, theirs in zip(angles, written.rays(x, y, angles, 9), plain.rays(x, y, angles, 9), strict=True):
            # The room has a post besides, and walls with a thickness, which show in the door.
            assert ours == pytest.approx(theirs, abs=0.02) or ours < theirs, (x, y, math.degrees(angle))


# --- a TriBot ---------------------------------------------------------------------------------------------------------

ON = codes.MOTOR_ON | codes.BRAKE | codes.REGULATED


def tribot(world: str = "room") -> SimulatedTriBot:
    """A TriBot 1.5 m before a wall of the room."""
    robot = SimulatedTriBot(world)
    robot.brick.advance(0.0)
    return robot


def run(robot: SimulatedTriBot, seconds: float, power: int | None = None, limit: int = 0) -> SimulatedTriBot:
    """Let some time pass, perhaps with a new power of both wheels."""
    if power is not None:
        for letter in "AC":
            robot.brick.motor(letter).set_output(power, ON, 1, 0, codes.RUNNING, limit)
    start = robot.brick.now
    for count in range(round(seconds * 50)):
        robot.brick.advance(start + (count + 1) / 50)
    return robot


def test_a_tribot_rolls_as_far_as_its_wheels_turn_but_for_a_little() -> None:
    robot = run(tribot(), 4, 50, limit=360)
    motor = robot.brick.motor("A")
    assert motor.position == pytest.approx(360, abs=15) and motor.run_state == codes.IDLE
    way = robot.base.pose[0] - 1.5
    rolled = math.radians(motor.position) * 0.028
    assert way == pytest.approx(rolled, rel=0.03)


def test_a_tribot_hears_the_wall_and_touches_it_and_its_wheels_slip() -> None:
    robot = tribot()
    far = robot.distance()
    assert far == pytest.approx(1.5 - 0.09, abs=0.01) and not robot.touch.pressed
    run(robot, 8, 50)
    assert robot.touch.pressed and robot.distance() < 0.03
    stood, turned = robot.base.pose[0], robot.brick.motor("A").position
    run(robot, 1)
    assert robot.base.pose[0] == pytest.approx(stood, abs=1e-3)
    assert robot.brick.motor("A").position > turned + 200
    run(robot, 1, -50)
    assert not robot.touch.pressed


def test_a_held_wheel_makes_a_tribot_turn() -> None:
    robot = tribot("flat")
    robot.brick.motor("C").jammed = True
    run(robot, 1, 50)
    assert robot.brick.motor("C").position == pytest.approx(0, abs=10)
    assert robot.base.pose[2] > 0.5


def test_a_tribot_hears_a_crate_that_is_put_before_it() -> None:
    device = NxtDevice(tribot("flat"))
    words = commands(device, lambda: device.brick.now)
    assert not {"obstacle", "put", "slip"} & words.keys()
    assert device.robot.distance() == math.inf
    assert words["box"].run(["0.6", "0", "0.2"]) == "ok"
    assert device.robot.distance() == pytest.approx(0.5 - 0.09, abs=0.01)
    assert words["unbox"].run([]) == "ok"
    with pytest.raises(UnknownRequest, match="no crate"):
        words["unbox"].run([])
    assert words["place"].run(["1", "2", "90"]) == "ok"
    assert words["where"].run([]) == "1.000 2.000 90.0"


# --- a Segway ---------------------------------------------------------------------------------------------------------


def ride(
    base: BalancingBody, seconds: float, speed: float = 0.0, turn: float = 0.0, tractor: bool = False
) -> list[float]:
    """Drive for some time; the lean in each frame."""
    leans = []
    for _ in range(round(seconds * 100)):
        base.drive(speed, turn, 1.0, balancing=not tractor)
        leans.append(base.pitch)
    return leans


def test_a_segway_balances_and_leans_to_go_and_to_stop() -> None:
    base = BalancingBody("flat")
    assert max(map(abs, ride(base, 2))) < 0.01
    assert max(ride(base, 4, 1.0)) > 0.15
    assert base.speed == pytest.approx(1.0, abs=0.02) and base.pitch == pytest.approx(0.0, abs=0.02)
    assert min(ride(base, 4)) < -0.15
    assert base.speed == pytest.approx(0.0, abs=0.02) and not base.fallen
    assert base.forward == pytest.approx(base.x, abs=0.02) and base.x > 3


def test_a_segway_turns_on_the_spot() -> None:
    base = BalancingBody("flat")
    ride(base, 2, turn=1.0)
    assert base.turn == pytest.approx(1.0, abs=0.05) and base.yaw == pytest.approx(base.heading, abs=0.05)
    assert math.hypot(base.x, base.y) < 0.05


def test_a_segway_catches_itself_when_pushed_and_falls_without_motors() -> None:
    base = BalancingBody("flat")
    base.push(0.3)
    ride(base, 3)
    assert not base.fallen and abs(base.pitch) < 0.05
    base.push(0.1)
    for _ in range(300):
        base.coast(stands=False)
    assert base.fallen and abs(base.pitch) > math.radians(35)
    base.lift()
    ride(base, 2)
    assert not base.fallen and abs(base.pitch) < 0.05


def test_a_segway_on_casters_does_not_lean_and_does_not_fall() -> None:
    base = BalancingBody("flat", tractor=True)
    assert max(map(abs, ride(base, 3, 1.0, tractor=True))) < 0.02
    assert base.speed == pytest.approx(1.0, abs=0.03)
    for _ in range(300):
        base.coast(stands=True)
    assert not base.fallen and abs(base.pitch) < 0.02


# --- a Spykee ---------------------------------------------------------------------------------------------------------


def roll(body: TrackedBody, seconds: float) -> TrackedBody:
    """Let some time pass."""
    start = body.simulation.time
    body.advance(start)
    for count in range(round(seconds * 50)):
        body.advance(start + (count + 1) / 50)
    return body


def test_a_spykee_drives_and_its_tracks_slip_when_it_turns() -> None:
    body = TrackedBody("flat")
    body.drive(50, 50)
    roll(body, 3)
    assert body.speeds == pytest.approx([0.21, 0.21], abs=0.02)
    assert body.x == pytest.approx(body.ways[0], rel=0.03)
    body.drive(0, 0)
    roll(body, 1)
    before = body.ways[1] - body.ways[0]
    body.drive(-40, 40)
    roll(body, 1)
    rolled = (body.ways[1] - body.ways[0] - before) / 0.24
    assert 0.3 * rolled < body.heading < 0.95 * rolled


def test_a_spykee_goes_to_its_dock_and_charges_there() -> None:
    body = TrackedBody("room")
    body.find_dock()
    roll(body, 20)
    assert body.docked and body.news == [2]
    assert math.dist((body.x, body.y), body.dock) < 0.08
    level = body.level
    assert roll(body, 2).level > level
    body.leave_dock(body.simulation.time)
    assert roll(body, 2).x > body.dock[0] + 0.05 or body.y != 0.0


def test_a_spykee_stops_at_a_wall_and_coasts_without_power() -> None:
    body = TrackedBody("room")
    body.place(2.4, 0.0, 0.0)
    body.drive(100, 100)
    assert roll(body, 4).x < 3.0 - 0.1
    body.place(0.0, 0.0, 0.0)
    roll(body, 2)
    body.cut_power()
    x = body.x
    assert roll(body, 3).x > x + 0.02 and max(map(abs, body.speeds)) < 0.01


@pytest.mark.skipif(not DRAWS, reason="pictures need Pillow, and EGL or OSMesa")
def test_the_camera_of_a_spykee_sees_the_walls_of_the_room() -> None:
    from PIL import Image

    body = TrackedBody("room")
    eye = Eye(body.simulation, "eye", 320, 240)
    try:
        seen = []
        for heading in (0.0, math.pi / 2, math.pi, -math.pi / 2):
            # Behind the door, where the wall ahead is the red one, and in the middle.
            body.place(*((4.5, 2.2) if heading == 0.0 else (0.0, 0.0)), heading)
            picture = Image.open(io.BytesIO(eye.picture(False))).convert("RGB")
            assert picture.size == (320, 240)
            colour = picture.resize((1, 1), box=(140, 90, 180, 110)).tobytes()
            seen.append([part > 0.7 * max(colour) for part in colour])
        assert seen == [[True, False, False], [False, True, False], [False, False, True], [True, True, False]]
        dark = Image.open(io.BytesIO(eye.picture(True))).convert("RGB").resize((1, 1)).tobytes()
        assert max(dark) < 64
    finally:
        eye.close()


# --- worlds -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("world", simulation.world_names())
@pytest.mark.parametrize("make", [Humanoid, SimulatedBody, SimulatedTriBot, BalancingBody, TrackedBody, LeggedBody])
def test_every_robot_stands_still_in_every_world(make: Callable[[str], Any], world: str) -> None:
    robot = make(world)
    start = robot.simulation.data.qpos.copy()
    if isinstance(robot, BalancingBody):
        ride(robot, 1.98)
    else:
        mover = robot.brick if isinstance(robot, SimulatedTriBot) else robot
        for count in range(100):
            mover.advance(count / 50)
    assert robot.simulation.time == pytest.approx(1.98, abs=0.02)
    assert abs(robot.simulation.data.qpos - start).max() < 0.2


def test_a_world_of_the_users_own(tmp_path: Path) -> None:
    file = tmp_path / "corner.xml"
    file.write_text(
        "<mujoco><worldbody><geom type='plane' size='5 5 1'/><geom type='box' pos='2 0 .5' size='.1 1 .5'/>"
        "<site name='start_p3dx' pos='1 0 0' euler='0 0 180'/></worldbody></mujoco>"
    )
    body = SimulatedBody(str(file))
    assert body.pose == pytest.approx((1.0, 0.0, math.pi), abs=1e-6) or body.pose[2] == pytest.approx(-math.pi)
    assert body.world.ray(1.0, 0.0, 0.0, 5.0) == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ("attic", "--world attic: the worlds are flat and room, or a file of MJCF (.xml)"),
        ("none.xml", "--world none.xml: there is no such file"),
        ("bad.xml", "--world bad.xml: XML Error: Schema violation: unrecognized element Element 'worldbdy', line 1"),
    ],
)
def test_a_world_that_is_none_is_told_in_a_line(
    world: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.xml").write_text("<mujoco><worldbdy/></mujoco>")
    with pytest.raises(UnknownRequest) as caught:
        Humanoid(world)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bioloid", "--world", "room"], "the package mujoco is not installed: "),
        (["p3dx", "--world", "room"], "the package mujoco is not installed: "),
        (["bioloid", "--world", "room", "--x-series"], "the humanoid is the kit of 18 AX-12 and an AX-S1"),
        (["nao", "--world", "room"], "the package mujoco is not installed: "),
        (["nxt", "--world", "room"], "the package mujoco is not installed: "),
        (["chain", "--world", "room"], "chain has no body for a simulated world"),
        (["p3dx", "--world", "attic"], "the worlds are flat and room, or a file: MJCF"),
    ],
)
def test_what_cannot_be_started_is_told_in_a_line(arguments: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "mujoco.py").write_text("raise ImportError\n")
    path = os.pathsep.join((str(tmp_path), str(FAKES)))
    ended = subprocess.run(
        [sys.executable, "-m", "urbihw_fakes", *arguments, "--tcp", "0"],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, timeout=30,
    )  # fmt: skip
    assert ended.returncode == 78 and ended.stdout == ""
    assert said in ended.stderr and ended.stderr.count("\n") == 1
