"""Message and service types that the library of definitions (rosbags) does not have, and where others are looked for.

The type of a service travels as a name and an md5 sum only, so its definition must be known here.  Types of other
packages are found where ROS installs them: ``ROS_PACKAGE_PATH``, ``/opt/ros/*/share`` and ``/usr/share``, as
``PACKAGE/msg/NAME.msg`` and ``PACKAGE/srv/NAME.srv``.

Sources: the packages of ROS Noetic of these names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

MAX_DEFINITION_BYTES: Final = 1 << 18
NAME: Final = re.compile(r"([a-zA-Z]\w*)/([a-zA-Z]\w*)", re.ASCII)
"""A type: its package and its name."""

MESSAGES: Final = {
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "turtlesim/Pose": "float32 x\nfloat32 y\nfloat32 theta\n\nfloat32 linear_velocity\nfloat32 angular_velocity\n",
    "turtlesim/Velocity": "float32 linear\nfloat32 angular\n",
    "turtlesim/Color": "uint8 r\nuint8 g\nuint8 b\n",
}
SERVICES: Final = {
    "roscpp/GetLoggers": "---\nroscpp/Logger[] loggers\n",
    "roscpp/SetLoggerLevel": "string logger\nstring level\n---\n",
    "roscpp/Empty": "---\n",
    "std_srvs/Empty": "---\n",
    "std_srvs/SetBool": "bool data\n---\nbool success\nstring message\n",
    "std_srvs/Trigger": "---\nbool success\nstring message\n",
    "rospy_tutorials/AddTwoInts": "int64 a\nint64 b\n---\nint64 sum\n",
    "beginner_tutorials/AddTwoInts": "int64 a\nint64 b\n---\nint64 sum\n",
    "roscpp_tutorials/TwoInts": "int64 a\nint64 b\n---\nint64 sum\n",
    "nav_msgs/GetMap": "---\nnav_msgs/OccupancyGrid map\n",
    "sensor_msgs/SetCameraInfo": "sensor_msgs/CameraInfo camera_info\n---\nbool success\nstring status_message\n",
    "turtlesim/Kill": "string name\n---\n",
    "turtlesim/SetPen": "uint8 r\nuint8 g\nuint8 b\nuint8 width\nuint8 off\n---\n",
    "turtlesim/Spawn": "float32 x\nfloat32 y\nfloat32 theta\nstring name\n---\nstring name\n",
    "turtlesim/TeleportAbsolute": "float32 x\nfloat32 y\nfloat32 theta\n---\n",
    "turtlesim/TeleportRelative": "float32 linear\nfloat32 angular\n---\n",
}


def find_definition(name: str, kind: str) -> str | None:
    """The text that defines a type, ``kind`` being "msg" or "srv"; None if it is not known here."""
    match = NAME.fullmatch(name)
    if match is None:
        return None
    known = (MESSAGES if kind == "msg" else SERVICES).get(name)
    if known is not None:
        return known
    for folder in _folders():
        file = folder / match[1] / kind / f"{match[2]}.{kind}"
        try:
            if file.is_file() and file.stat().st_size <= MAX_DEFINITION_BYTES:
                return file.read_text("utf-8", "replace")
        except OSError:
            continue
    return None


def _folders() -> Iterator[Path]:
    """Where packages of ROS are installed."""
    yield from (Path(name) for name in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if name)
    yield from sorted(Path("/opt/ros").glob("*/share"))
    yield Path("/usr/share")
