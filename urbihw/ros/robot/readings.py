"""Values of a robot as messages of ROS: functions without state, but for the speed of a base.

Lengths are in m, angles in rad, positive to the left; frames are ``odom``, ``base_link``, and one for each sensor, with
the name of its device.  A value that is not known is nan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.ros.robot.parts import RangePart

Message = dict[str, Any]
ODOM: Final = "odom"
BASE: Final = "base_link"
ULTRASOUND, INFRARED = 0, 1
SONAR_FIELD_OF_VIEW: Final = 0.26
"""Width of the beam of a sonar, rad: that of the Pioneer's (15 degrees)."""
OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostics."""
_UNKNOWN_COVARIANCE: Final = [-1.0] + 8 * [0.0]


def stamp(t: float) -> Message:
    """A time in seconds since 1970."""
    whole, rest = divmod(round(t * 1e9), 10**9)
    return {"secs": max(0, whole), "nsecs": rest}


def header(t: float, frame: str) -> Message:
    """The header of a message."""
    return {"seq": 0, "stamp": stamp(t), "frame_id": frame}


def number(value: Any) -> float:
    """A number, nan for anything else."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan


def joint_state(t: float, names: Sequence[str], values: Sequence[Any]) -> Message:
    """sensor_msgs/JointState: the joints whose places are known."""
    known = [(name, number(value)) for name, value in zip(names, values, strict=True) if value is not None]
    return {"header": header(t, ""), "name": [name for name, _ in known], "position": [at for _, at in known],
            "velocity": [], "effort": []}


class RosOdometer:
    """The place of a base, and its speed from one place to the next."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float, float] | None = None

    def read(self, t: float, position: Mapping[str, Any]) -> tuple[Message, Message]:
        """nav_msgs/Odometry and tf2_msgs/TFMessage of a place ``x``, ``y``, ``theta``."""
        x, y, theta = (number(position.get(key)) for key in ("x", "y", "theta"))
        forward = turn = 0.0
        if self._last is not None and t > self._last[0]:
            past = t - self._last[0]
            dx, dy = x - self._last[1], y - self._last[2]
            forward = (dx * math.cos(theta) + dy * math.sin(theta)) / past
            turn = math.remainder(theta - self._last[3], math.tau) / past
        self._last = t, x, y, theta
        rotation = {"x": 0, "y": 0, "z": math.sin(theta / 2), "w": math.cos(theta / 2)}
        place = {"x": x, "y": y, "z": 0}
        odometry = {
            "header": header(t, ODOM), "child_frame_id": BASE,
            "pose": {"pose": {"position": place, "orientation": rotation}, "covariance": 36 * [0.0]},
            "twist": {"twist": {"linear": {"x": forward, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": turn}},
                      "covariance": 36 * [0.0]},
        }  # fmt: skip
        transform = {"header": header(t, ODOM), "child_frame_id": BASE,
                     "transform": {"translation": place, "rotation": rotation}}
        return odometry, {"transforms": [transform]}


SCAN_SLOTS: Final = ("val", "angleMin", "angleMax", "distanceMin", "distanceMax", "rate")


def laser_scan(t: float, laser: str, values: Sequence[Any]) -> Message | None:
    """sensor_msgs/LaserScan of the values of ``SCAN_SLOTS``; None while there is no scan."""
    ranges, *others = values
    if not isinstance(ranges, list) or len(ranges) < 2:
        return None
    low, high, least, most, rate = map(number, others)
    period = 1 / rate if rate > 0 else 0.0
    step = (high - low) / (len(ranges) - 1)
    return {"header": header(t, laser), "angle_min": low, "angle_max": high, "angle_increment": step,
            "time_increment": 0, "scan_time": period, "range_min": least, "range_max": most,
            "ranges": [number(each) for each in ranges], "intensities": []}


def distance(t: float, part: RangePart, value: Any) -> Message:
    """sensor_msgs/Range of a sensor of distance."""
    kind = INFRARED if "infrared" in part.name.lower() else ULTRASOUND
    return {"header": header(t, part.name), "radiation_type": kind, "field_of_view": SONAR_FIELD_OF_VIEW,
            "min_range": part.least, "max_range": part.most, "range": number(value)}


def imu(t: float, accelerations: Mapping[str, Any], turns: Mapping[str, Any]) -> Message:
    """sensor_msgs/Imu of accelerations in m/s2 and turn rates in rad/s, by axis; the orientation is not known."""
    def axes(values: Mapping[str, Any]) -> Message:
        return {axis: number(values.get(axis, 0.0)) for axis in "xyz"}

    def covariance(values: Mapping[str, Any]) -> list[float]:
        return 9 * [0.0] if values else _UNKNOWN_COVARIANCE

    return {"header": header(t, BASE), "orientation": {"x": 0, "y": 0, "z": 0, "w": 1},
            "orientation_covariance": _UNKNOWN_COVARIANCE,
            "angular_velocity": axes(turns), "angular_velocity_covariance": covariance(turns),
            "linear_acceleration": axes(accelerations), "linear_acceleration_covariance": covariance(accelerations)}


BATTERY_SLOTS: Final = ("voltage", "current", "remain", "capacity")


def battery_state(t: float, template: Message, values: Sequence[Any]) -> Message:
    """sensor_msgs/BatteryState of the values of ``BATTERY_SLOTS``."""
    voltage, current, remain, capacity = map(number, values)
    return {**template, "header": header(t, BASE), "voltage": voltage, "current": current, "percentage": remain,
            "temperature": math.nan, "charge": math.nan, "capacity": capacity, "design_capacity": math.nan,
            "present": True}


def diagnostics(t: float, name: str, level: int, reasons: Sequence[str], told: Mapping[str, Any]) -> Message:
    """diagnostic_msgs/DiagnosticArray: the health of the robot, its reasons as the text."""
    values = [{"key": key, "value": str(value)} for key, value in told.items()]
    status = {"level": level, "name": f"urbihw: {name}", "message": "; ".join(reasons) or "ok", "hardware_id": name,
              "values": values}
    return {"header": header(t, ""), "status": [status]}
