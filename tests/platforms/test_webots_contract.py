"""Both simulators keep one contract: MuJoCo, and Webots by a stand-in for its package (``webots_home``).

With a real Webots: start a world whose robot has the devices of the stand-in and the controller ``<extern>``, and set
WEBOTS_HOME; the third half then runs with it.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from webots_lab import need_mujoco

from urbihw.buses import port_for
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import Context
from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots.controller import NoWebots, WebotsRobot, import_controller, rgb_of
from urbihw.platforms.webots.mujoco_world import MujocoWorld

HOME = Path(__file__).with_name("webots_home")
STAND_IN = HOME / "lib" / "controller" / "python"


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The stand-in, as in a new process."""
    monkeypatch.syspath_prepend(STAND_IN)
    monkeypatch.delitem(sys.modules, "controller", raising=False)
    yield importlib.import_module("controller")
    sys.modules.pop("controller", None)


@pytest.fixture(params=["mujoco", "stand-in", "webots"])
def back_end(request: pytest.FixtureRequest) -> s.BackEnd:
    """The same robot in each simulator."""
    if request.param == "mujoco":
        need_mujoco()
        return MujocoWorld(HOME / "contract.xml")
    if request.param == "stand-in":
        return WebotsRobot(request.getfixturevalue("package"))
    if "WEBOTS_HOME" not in os.environ:
        pytest.skip("there is no Webots: WEBOTS_HOME is not set")
    return WebotsRobot(import_controller(""))


def enable(*names: str, period: int = 20) -> list[s.StepOrder]:
    return [s.StepOrder("enable", name, "", period) for name in names]


def write(name: str, item: str, value: Any) -> s.StepOrder:
    return s.StepOrder("write", name, item, value)


def run(back_end: s.BackEnd, steps: int, orders: list[s.StepOrder] | None = None) -> s.Outcome:
    """Some steps of 20 ms; the last outcome."""
    outcome = back_end.run(20, orders or [])
    for _ in range(steps - 1):
        outcome = back_end.run(20, [])
    return outcome


def test_devices_are_known_by_name_and_kind(back_end: s.BackEnd) -> None:
    kinds = {each.name: each.kind for each in back_end.world.devices}
    assert kinds == {
        "arm": s.MOTOR, "left wheel": s.MOTOR, "right wheel": s.MOTOR, "arm sensor": s.POSITION_SENSOR,
        "acc": s.ACCELEROMETER, "gyro": s.GYRO, "gps": s.GPS, "imu": s.INERTIAL_UNIT, "ahead": s.DISTANCE_SENSOR,
        "bumper": s.TOUCH_SENSOR, "eye": s.CAMERA, "led0": s.LED, "laser": s.LIDAR, "radio": s.EMITTER,
        "ears": s.RECEIVER, "ls0": s.LIGHT_SENSOR,
    }  # fmt: skip
    arm = back_end.world.device("arm", s.MOTOR).facts
    assert (arm["min"], arm["max"]) == pytest.approx((-math.pi / 2, math.pi / 2))
    assert arm["max velocity"] == 10.0
    assert back_end.world.device("left wheel", s.MOTOR).facts["max"] == math.inf
    assert back_end.world.step_ms == 20
    assert back_end.world.supervisor


def test_a_sensor_gives_nothing_before_it_is_enabled_and_its_period_is_over(back_end: s.BackEnd) -> None:
    assert run(back_end, 2).samples == {}
    first = back_end.run(20, enable("acc", period=40))
    assert first.samples == {}
    second = back_end.run(20, [])
    assert second.samples["acc"] == pytest.approx((0.0, 0.0, 9.81), abs=0.3)
    assert back_end.run(20, []).samples == {}
    assert list(back_end.run(20, []).samples) == ["acc"]
    assert run(back_end, 3, enable("acc", period=0)).samples == {}


def test_a_period_is_rounded_up_to_whole_steps(back_end: s.BackEnd) -> None:
    back_end.run(20, enable("gyro", period=30))
    assert "gyro" in back_end.run(20, []).samples
    assert "gyro" not in back_end.run(20, []).samples


def test_every_sensor_measures(back_end: s.BackEnd) -> None:
    outcome = run(back_end, 20, enable("arm sensor", "gps", "imu", "ahead", "bumper", "laser", "arm", "ls0"))
    values = outcome.samples
    assert outcome.time == pytest.approx(0.4)
    assert values["arm sensor"] == pytest.approx(0.0, abs=0.01)
    assert values["gps"] == pytest.approx((0.0, 0.0, 0.1), abs=0.01)
    assert values["imu"] == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    assert values["ahead"] == pytest.approx(1.9, abs=0.01)
    assert values["bumper"] >= 0.0
    assert len(values["laser"]) == 5
    assert values["laser"][2] == pytest.approx(1.85, abs=0.1)
    assert len(values["arm"]) == 3
    assert values["ls0"] == pytest.approx(0.7, abs=0.02)


def test_a_motor_goes_to_a_position_no_faster_than_its_greatest_speed(back_end: s.BackEnd) -> None:
    run(back_end, 2, enable("arm"))
    middle = run(back_end, 20, [write("arm", "position", 1.0), write("arm", "max velocity", 1.0)])
    assert middle.samples["arm"][0] == pytest.approx(0.4, abs=0.15)
    assert run(back_end, 60).samples["arm"][0] == pytest.approx(1.0, abs=0.02)


def test_a_motor_turns_by_speed_and_stops(back_end: s.BackEnd) -> None:
    run(back_end, 2, enable("left wheel", "right wheel"))
    orders = [write("left wheel", "position", math.inf), write("left wheel", "velocity", 2.0)]
    turning = run(back_end, 51, orders).samples
    assert turning["left wheel"][1] == pytest.approx(2.0, abs=0.1)
    assert turning["left wheel"][0] == pytest.approx(2.0, abs=0.2)
    assert turning["right wheel"][0] == pytest.approx(0.0, abs=0.01)
    before = run(back_end, 20, [s.StepOrder("stop", "left wheel")]).samples["left wheel"][0]
    assert run(back_end, 20).samples["left wheel"][0] == pytest.approx(before, abs=0.01)


def test_a_motor_that_is_stopped_on_its_way_holds_its_place(back_end: s.BackEnd) -> None:
    run(back_end, 2, enable("arm"))
    run(back_end, 20, [write("arm", "position", 1.5), write("arm", "max velocity", 1.0)])
    stopped = run(back_end, 10, [s.StepOrder("stop", "arm")]).samples["arm"][0]
    assert stopped < 0.9
    assert run(back_end, 40).samples["arm"][0] == pytest.approx(stopped, abs=0.02)


def test_a_picture_is_red_green_blue(back_end: s.BackEnd) -> None:
    problems = back_end.run(0, enable("eye")).problems
    if problems:
        pytest.skip(problems[0])
    assert len(run(back_end, 2).samples["eye"]) == 8 * 6 * 3
    assert rgb_of(bytes((1, 2, 3, 255))) == bytes((3, 2, 1))


def test_a_packet_arrives_with_the_next_step(back_end: s.BackEnd) -> None:
    run(back_end, 2, enable("ears"))
    packets = [*back_end.run(20, [write("radio", "packet", b"hello")]).samples["ears"]]
    packets += back_end.run(20, []).samples["ears"]
    assert packets == [b"hello"]
    assert back_end.run(20, []).samples["ears"] == ()


def test_a_node_is_moved_and_turned(back_end: s.BackEnd) -> None:
    run(back_end, 2, enable(s.NODES + "wall"))
    turn = (0.0, 0.0, 0.5)
    orders = [
        s.StepOrder("move", "wall", "translation", (3.0, 1.0, 0.0)),
        s.StepOrder("move", "wall", "rotation", turn),
    ]
    assert run(back_end, 2, orders).samples[s.NODES + "wall"] == pytest.approx((3.0, 1.0, 0.0, *turn), abs=1e-6)


def test_labels_leds_and_a_reset_of_the_physics_are_taken(back_end: s.BackEnd) -> None:
    label = s.LabelText(1, "goal", 0.1, 0.2, 0.05, 1.0, 0.0, 0.0, 1.0)
    orders = [s.StepOrder("label", "", "", label), write("led0", "value", 1.0), s.StepOrder("reset physics")]
    outcome = run(back_end, 1, orders)
    assert outcome.problems == ()


def test_what_is_not_there_is_one_line(back_end: s.BackEnd) -> None:
    outcome = run(back_end, 1, [write("atm", "position", 1.0), *enable(s.NODES + "bx")])
    assert len(outcome.problems) == 2
    assert all("\n" not in line for line in outcome.problems)
    assert "no " in outcome.problems[0] and "'atm'" in outcome.problems[0]
    with pytest.raises(ValueError, match=r"no motor 'atm'; did you mean 'arm'\?; there are: arm, left wheel, "):
        back_end.world.device("atm", s.MOTOR)
    with pytest.raises(ValueError, match="'acc' is no motor: it is of the kind 'accelerometer'"):
        back_end.world.device("acc", s.MOTOR)


@pytest.mark.parametrize(("verb", "reason"), [("revert", s.REVERTED), ("quit", s.QUIT)])
def test_a_reload_and_an_end_end_the_controller(back_end: s.BackEnd, verb: str, reason: str) -> None:
    outcome = back_end.run(20, [s.StepOrder(verb)])
    assert (outcome.ended, outcome.samples) == (reason, {})


# ---------------------------------------------------------------- Webots alone


def test_a_world_that_somebody_reloads_ends_the_controller(package: Any) -> None:
    back_end = WebotsRobot(package)
    package.Robot.created.ends = True
    assert back_end.run(20, []).ended == s.REVERTED


def test_a_label_and_a_colour_reach_webots(package: Any) -> None:
    back_end = WebotsRobot(package)
    robot = package.Robot.created
    label = s.LabelText(1, "goal", 0.1, 0.2, 0.05, 1.0, 0.5, 0.0, 0.75)
    back_end.run(20, [s.StepOrder("label", "", "", label), write("led0", "value", 1.0), s.StepOrder("reset physics")])
    assert robot.labels == {1: ("goal", 0.1, 0.2, 0.05, 0xFF8000, 0.25, "Arial")}
    assert robot.devices["led0"].get() == 0xFFFFFF
    assert robot.physics_resets == 1


def test_a_second_robot_object_is_refused(package: Any) -> None:
    WebotsRobot(package)
    with pytest.raises(SystemExit):
        package.Supervisor()


def test_urls_of_webots() -> None:
    assert port_for("webots://", Context()).url.target == ""
    assert port_for("ipc://1234/my%20robot", Context()).url.target == "1234/my%20robot"
    with pytest.raises(BadUrl, match="write tcp://address:port or tcp://address:port/robot"):
        port_for("tcp://robot.local", Context())


def test_no_installation_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("WEBOTS_HOME", raising=False)
    with pytest.raises(NoWebots, match="^no Webots: set WEBOTS_HOME to the folder of its installation$"):
        import_controller("")
    monkeypatch.setenv("WEBOTS_HOME", str(tmp_path))
    with pytest.raises(NoWebots, match=f"^no Webots in WEBOTS_HOME={tmp_path}: there is no "):
        import_controller("")
