"""Each object and slot of the manual's chapter on Webots (29), on a model of MuJoCo; the body of the physics tells."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from webots_lab import Lab

from urbihw.platforms.webots.blobs import find_blob

MODEL = Path(__file__).with_name("webots_home") / "contract.xml"
PROGRAM = Path(__file__).with_name("webots_home") / "empty.u"


@pytest.fixture
def lab() -> Lab:
    """The model of the contract, with no objects but those that a test makes."""
    return Lab.ready(MODEL, program=str(PROGRAM))


def test_the_binding_of_a_minimalist_robot(lab: Lab) -> None:
    """29.3, with the names of this model."""
    made = 'var Global.motor = Servo.new("arm")|; var Global.distance = DistanceSensor.new("ahead")|;'
    assert lab.say(made, 0.1) == ""
    lab.say("motor.val = 0.5|;", 1.0)
    assert lab.joint("arm") == pytest.approx(0.5, abs=0.02)
    assert lab.number("distance.val") == pytest.approx(1.9, abs=0.01)
    assert lab.look("motor.interfaces") == "[RotationalMotor, Motor]"
    assert lab.look("distance.interfaces") == "[DistanceSensor, Sensor]"


def test_an_accelerometer_is_one_component(lab: Lab) -> None:
    lab.say("".join(f'var Global.{each} = Accelerometer.new("acc", "{each}")|;' for each in "xyz"), 0.5)
    assert lab.number("z.acceleration") == pytest.approx(9.81, abs=0.05)
    assert lab.number("x.val") == pytest.approx(0.0, abs=0.05)
    assert "the component is \"x\", \"y\" or \"z\", not 'w'" in lab.say('Accelerometer.new("acc", "w");', 0.1)


def test_switching_one_component_off_disables_all_three(lab: Lab) -> None:
    lab.say("".join(f'var Global.{each} = Accelerometer.new("acc", "{each}")|;' for each in "xyz"), 0.5)
    lab.say("x.load = false;", 0.2)
    assert [lab.look(f"{each}.load") for each in "xyz"] == ["0"] * 3
    assert [lab.look(f"{each}.stale") for each in "xyz"] == ["true"] * 3
    lab.say("y.load = true;", 0.2)
    assert [lab.look(f"{each}.load") for each in "xyz"] == ["1"] * 3
    assert lab.look("x.stale") == "false"


def test_a_camera_has_clipping_planes_and_one_object(lab: Lab) -> None:
    lab.say('var Global.camera = Camera.new("eye")|;', 0.5)
    assert lab.look("camera.interfaces") == "[VideoIn]"
    assert 0 < lab.number("camera.near") < lab.number("camera.far")
    assert [lab.number(f"camera.{slot}") for slot in ("width", "height")] == [8, 6]
    assert lab.number("camera.xfov") > lab.number("camera.yfov") > 0.1
    assert "!!!" in lab.say("camera.near = 1;", 0.1)
    assert "camera 'eye' has an object already; there can be only one" in lab.say('Camera.new("eye");', 0.1)


def test_differential_wheels_are_two_motors(lab: Lab) -> None:
    lab.say('var Global.l = DifferentialWheels.new("wheel", true)|;', 0.1)
    lab.say('var Global.r = DifferentialWheels.new("wheel", false)|;', 0.1)
    lab.say("l.speed = 2 | r.speed = -1|;", 1.0)
    assert lab.joint("left wheel") == pytest.approx(2.0, abs=0.2)
    assert lab.joint("right wheel") == pytest.approx(-1.0, abs=0.2)
    assert lab.look("l.interfaces") == "[RotationalMotor, Motor]"
    assert "no left wheel of 'track'" in lab.say('DifferentialWheels.new("track", true);', 0.1)


def test_an_encoder_is_set_and_turns_nothing(lab: Lab) -> None:
    lab.say('var Global.l = DifferentialWheels.new("wheel", true)|; l.encoderResolution = 10|;', 0.1)
    lab.say("l.speed = 2|;", 1.0)
    lab.say("l.speed = 0|;", 1.0)
    place = lab.joint("left wheel")
    assert lab.number("l.encoder") == pytest.approx(place * 10, abs=0.1)
    lab.say("l.encoder = 5|;", 0.5)
    assert lab.joint("left wheel") == pytest.approx(place, abs=0.01)
    assert lab.number("l.encoder") == pytest.approx(5.0, abs=0.1)


def test_a_distance_sensor_has_a_factor(lab: Lab) -> None:
    lab.say('var Global.d = DistanceSensor.new("ahead")|;', 0.1)
    lab.say("d.factor = 100|;", 0.1)
    assert lab.number("d.distance") == pytest.approx(190, abs=1)


def test_a_light_sensor_measures_and_a_shade_darkens_it(lab: Lab) -> None:
    lab.say('var Global.light = LightSensor.new("ls0")|; var Global.lid = ManipulateNode.new("wall")|;', 0.2)
    assert lab.number("light.val") == pytest.approx(0.7, abs=0.02)
    lab.say("lid.tx = 0 | lid.tz = 2|;", 0.2)
    assert lab.number("light.val") == 0


def test_a_led_lights(lab: Lab) -> None:
    lab.say('var Global.led = Led.new("led0")|;', 0.1)
    dark = float(lab.world._model.geom("led0").rgba[0])
    assert lab.say("led.val = 1;", 0.1) == "1"
    assert float(lab.world._model.geom("led0").rgba[0]) > dark
    assert "val of a Led is 0 to 1" in lab.say("led.val = 2;", 0.1)


def test_a_servo_tells_its_force_if_feedback_is_on(lab: Lab) -> None:
    lab.say('var Global.s = Servo.new("arm", true)|; var Global.w = Servo.new("left wheel")|;', 0.1)
    lab.say("s.val = 1 | w.val = 3|;", 0.06)
    assert lab.number("s.force") > 0.05
    assert lab.number("s.force") == lab.number("s.torque")
    assert lab.look("w.force") == "nan"
    lab.run(2.0)
    assert lab.joint("left wheel") == pytest.approx(3.0, abs=0.05)
    assert lab.number("s.turn") == pytest.approx(1 / math.tau, abs=0.01)


def test_a_servo_follows_a_trajectory(lab: Lab) -> None:
    lab.say('var Global.s = Servo.new("arm")|;', 0.1)
    lab.say("s.val = 1 time:2s,", 1.0)
    assert 0.3 < lab.joint("arm") < 0.7
    lab.run(1.2)
    assert lab.joint("arm") == pytest.approx(1.0, abs=0.02)


def test_a_servo_that_is_switched_off_stands(lab: Lab) -> None:
    lab.say('var Global.s = Servo.new("left wheel")|; s.speed = 2|;', 0.5)
    lab.say("s.load = 0|;", 0.5)
    place = lab.joint("left wheel")
    lab.say("s.speed = 2|;", 0.5)
    assert lab.joint("left wheel") == pytest.approx(place, abs=0.01)
    assert lab.look("s.limitedBy") == '"off"'
    lab.say("s.load = 1 | s.speed = 2|;", 0.5)
    assert lab.joint("left wheel") > place + 0.5


def test_a_touch_sensor_feels_a_wall(lab: Lab) -> None:
    lab.say('var Global.t = TouchSensor.new("bumper")|; var Global.n = ManipulateNode.new("wall")|;', 0.1)
    assert lab.number("t.pressure") == 0
    assert lab.say('at (t.val > 0) echo("touched"); n.tx = 0.195|;', 0.2) == "*** touched"


def test_a_label_is_shown_as_it_says(lab: Lab) -> None:
    lab.say('var Global.t = Label.new("goal")|;', 0.1)
    lab.say("t.x = 0.1 | t.y = 0.2 | t.r = 1 | t.g = 0.5 | t.b = 0.25 | t.a = 0.75 | t.size = 0.05|;", 0.1)
    lab.say('t.txt = "no"|;', 0.1)
    (label,) = lab.world.labels.values()
    assert label[1:] == ("no", 0.1, 0.2, 0.05, 1.0, 0.5, 0.25, 0.75)
    assert "r is 0 to 1" in lab.say("t.r = 2;", 0.1)
    lab.say('t.txt = ""|;', 0.1)
    assert lab.world.labels == {}


def test_a_node_is_where_it_is_put(lab: Lab) -> None:
    lab.say('var Global.n = ManipulateNode.new("box")|;', 0.1)
    assert lab.number("n.tz") == pytest.approx(0.1, abs=0.01)
    lab.say("n.tx = 1 | n.ty = -1 | n.tz = 0.5|;", 0.04)
    assert list(lab.body("box").xpos[:2]) == pytest.approx([1, -1], abs=0.01)
    lab.say("n.az = 1|;", 0.04)
    assert lab.number("n.az") == pytest.approx(1.0, abs=0.02)
    assert "no node 'bx'; did you mean 'box'?; there are: " in lab.say('ManipulateNode.new("bx");', 0.1)


def test_the_physics_is_reset(lab: Lab) -> None:
    lab.say('var Global.n = ManipulateNode.new("box")|; var Global.c = SimulationController.new|;', 0.1)
    lab.say("n.tz = 3|;", 0.3)
    assert abs(float(lab.world._data.qvel[2])) > 1.0
    lab.say("c.physicsReset|;", 0.06)
    assert abs(float(lab.world._data.qvel[2])) < 1.0


def test_the_world_is_reloaded(lab: Lab) -> None:
    lab.say('var Global.n = ManipulateNode.new("box")|; var Global.c = SimulationController.new|;', 0.1)
    lab.say("n.tx = 1|;", 0.5)
    lab.plug.world = None  # what reloads is the worker, when it connects again
    lab.say("at (webots.linkBack?) echo(\"back\"); c.revert|;", 1.5)
    assert float(lab.body("box").xpos[0]) == pytest.approx(0.0, abs=0.01)
    assert lab.number("n.tx") == pytest.approx(0.0, abs=0.01)


def test_a_blob_is_found_by_its_colour() -> None:
    red, grey = bytes((200, 10, 10)), bytes((90, 90, 90))
    picture = b"".join(red if 4 <= x < 8 and 2 <= y < 4 else grey for y in range(6) for x in range(10))
    x, y, ratio = find_blob(picture, 10, 6, (1.0, 0.05, 0.05), 0.1)
    assert [x, y, ratio] == pytest.approx([5.5, 2.5, 8 / 60])
    assert find_blob(picture, 10, 6, (0.0, 0.0, 1.0), 0.1)[2] == 0.0


def test_what_todays_robots_have_beside(lab: Lab) -> None:
    lab.say(
        'var Global.g = Gyro.new("gyro", "z")|; var Global.p = GPS.new("gps")|;'
        'var Global.i = InertialUnit.new("imu")|;'
        'var Global.l = Lidar.new("laser")|; var Global.e = PositionSensor.new("arm sensor")|;'
        'var Global.out = Emitter.new("radio")|; var Global.ears = Receiver.new("ears")|;'
        'at (ears.received?(var text)) echo("heard %s" % text);', 0.2,
    )  # fmt: skip
    assert lab.number("g.speed") == pytest.approx(0.0, abs=0.01)
    assert lab.number("p.z") == pytest.approx(0.1, abs=0.01)
    assert lab.look("p.val.size") == "3"
    assert lab.number("i.yaw") == pytest.approx(0.0, abs=0.01)
    assert lab.look("l.val.size") == "5"
    assert lab.number("l.angleMax") == pytest.approx(math.pi / 4)
    assert lab.number("e.val") == pytest.approx(0.0, abs=0.01)
    assert lab.say('out.send("hello");', 0.2) == "*** heard hello"
    assert lab.look("ears.val") == '"hello"'
