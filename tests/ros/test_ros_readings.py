"""Values of a robot as messages, and trajectories as urbiscript: nothing but data."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw.ros.messages import MessageTypes
from urbihw.ros.robot import readings
from urbihw.ros.robot.motion import WrongOrder, trajectory_text
from urbihw.ros.robot.parts import RangePart, parts_of

OVERVIEW = {
    "robot": "P 3", "effectors": [{"slot": "robot.xSpeed", "role": "base"}, {"slot": "arm.val", "role": "joint"}],
    "sensors": [
        {"slot": "sonarL.val", "role": "distance", "unit": "m", "max": 5.0},
        {"slot": "infrared.val", "role": "distance", "unit": "1"},
        {"slot": "accelX.val", "role": "acceleration"}, {"slot": "gyroZ.val", "role": "gyro"},
        {"slot": "laser.val", "role": "laser"}, {"slot": "battery.voltage", "role": "battery"},
        {"slot": "camera.val", "role": "camera"},
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def types() -> MessageTypes:
    return MessageTypes()


def test_parts() -> None:
    parts = parts_of(OVERVIEW, ["arm"])
    assert parts == ("P 3", ("arm",), True, (RangePart("sonarL.val", 0.0, 5.0),), (("x", "accelX.val"),),
                     (("z", "gyroZ.val"),), "laser", "battery", "camera")
    assert parts_of({"robot": "r"}, []) == parts_of({"robot": "r"}, [])


def test_each_message_is_one_of_its_type(types: MessageTypes) -> None:
    odometry, transform = readings.RosOdometer().read(2.5, {"x": 1.0, "y": 2.0, "theta": math.pi})
    battery = types.find("sensor_msgs/BatteryState").template()
    made: dict[str, Any] = {
        "sensor_msgs/JointState": readings.joint_state(1.5, ["a", "b"], [0.5, None]),
        "nav_msgs/Odometry": odometry,
        "tf2_msgs/TFMessage": transform,
        "sensor_msgs/LaserScan": readings.laser_scan(1.0, "laser", [[1.0, None, 3.0], -1.0, 1.0, 0.02, 8.0, 10.0]),
        "sensor_msgs/Range": readings.distance(1.0, RangePart("sonarL.val", 0.0, 5.0), 2.0),
        "sensor_msgs/Imu": readings.imu(1.0, {"x": 9.8}, {}),
        "sensor_msgs/BatteryState": readings.battery_state(1.0, battery, [12.5, None, 0.9, math.nan]),
        "diagnostic_msgs/DiagnosticArray": readings.diagnostics(1.0, "r", 1, ["slow"], {"link": True}),
    }
    for name, message in made.items():
        kind = types.find(name)
        kind.decode(kind.encode(message))
    assert made["sensor_msgs/JointState"]["name"] == ["a"]
    assert made["sensor_msgs/JointState"]["header"]["stamp"] == {"secs": 1, "nsecs": 500_000_000}
    assert made["sensor_msgs/LaserScan"]["angle_increment"] == 1.0
    assert made["sensor_msgs/LaserScan"]["scan_time"] == 0.1
    assert made["sensor_msgs/Imu"]["angular_velocity_covariance"][0] == -1
    assert readings.laser_scan(1.0, "laser", [[], 0, 0, 0, 0, 0]) is None


def test_speed_of_a_base() -> None:
    odometer = readings.RosOdometer()
    odometer.read(1.0, {"x": 0.0, "y": 0.0, "theta": math.pi / 2 - 0.1})
    odometry, _ = odometer.read(1.5, {"x": 0.0, "y": 0.2, "theta": math.pi / 2})
    twist = odometry["twist"]["twist"]
    assert twist["linear"]["x"] == pytest.approx(0.4)
    assert twist["angular"]["z"] == pytest.approx(0.2)
    assert odometry["pose"]["pose"]["orientation"]["z"] == pytest.approx(math.sin(math.pi / 4))


def points(*rows: tuple[list[float], float]) -> list[dict[str, Any]]:
    return [
        {"positions": places, "time_from_start": {"secs": int(at), "nsecs": round(at % 1 * 1e9)}} for places, at in rows
    ]


def test_trajectory() -> None:
    message = {"joint_names": ["b", "a"], "points": points(([1, 2], 0), ([3, -4.5], 1.5))}
    text = trajectory_text(message, ("a", "b"))
    assert text == "{ b.val = 1 | b.val = 3 time:1.5 } & { a.val = 2 | a.val = -4.5 time:1.5 }"


@pytest.mark.parametrize(
    ("names", "rows", "why"),
    [
        (["c"], [([1.0], 1.0)], "no joint 'c'; there are: a, b"),
        (["a;x"], [([1.0], 1.0)], "no joint 'a;x'"),
        (["a", "a"], [([1.0, 1.0], 1.0)], "not different"),
        ([], [([], 1.0)], "empty"),
        (["a"], [], "0 points"),
        (["a"], [([1.0], 1.0)] * 1001, "1001 points"),
        (["a"], [([1.0], 1.0), ([1.0], 1.0)], "point 1 is at 1 s: times must grow"),
        (["a"], [([1.0], 601.0)], "up to 600 s"),
        (["a"], [([1.0, 2.0], 1.0)], "a position for each of the 1 joints"),
        (["a"], [([math.nan], 1.0)], "a position for each"),
    ],
)
def test_wrong_trajectory(names: list[str], rows: list[tuple[list[float], float]], why: str) -> None:
    with pytest.raises(WrongOrder, match=why):
        trajectory_text({"joint_names": names, "points": points(*rows)}, ("a", "b"))
