"""The sensors of a MuJoCo model, and the devices that MuJoCo has not: LEDs, radios, lidars, displays.

A sensor of MuJoCo is a device by its type.  The others are declared by a text of the model, whose name is that of the
device::

    <custom>
      <text name="led0" data="led"/>                        the geom or site led0; its colour times the value
      <text name="laser" data="lidar 181 180 8"/>           rays from the site laser: number, degrees, range in m
      <text name="depth" data="range-finder 16 12 60 5"/>   width, height, degrees, range in m
      <text name="ls0" data="light-sensor"/>                at the site ls0, along its x axis: see ``mujoco_light``
      <text name="radio" data="emitter 1"/>                 channel
      <text name="ears" data="receiver 1"/>
      <text name="speaker" data="speaker"/>
      <text name="screen" data="display 64 48"/>            width, height
    </custom>
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from urbihw.platforms.webots import simulator as s

MAX_PACKETS: Final = 100
"""Packets that a receiver keeps while they are not read."""
MAX_RAYS: Final = 100_000
"""Largest number of rays of a lidar or range finder."""

Read = Callable[[], Any]


def sensor_kinds(mujoco: Any) -> Mapping[int, str]:
    """Return type of a sensor of MuJoCo -> kind of device."""
    t = mujoco.mjtSensor
    return {
        int(t.mjSENS_ACCELEROMETER): s.ACCELEROMETER,
        int(t.mjSENS_GYRO): s.GYRO,
        int(t.mjSENS_MAGNETOMETER): s.COMPASS,
        int(t.mjSENS_RANGEFINDER): s.DISTANCE_SENSOR,
        int(t.mjSENS_TOUCH): s.TOUCH_SENSOR,
        int(t.mjSENS_JOINTPOS): s.POSITION_SENSOR,
        int(t.mjSENS_FRAMEPOS): s.GPS,
        int(t.mjSENS_FRAMEQUAT): s.INERTIAL_UNIT,
    }


def sensor(mujoco: Any, model: Any, data: Any, index: int) -> tuple[s.SimDevice, Read] | None:
    """Return a sensor of the model as a device, and what reads it; None for another type."""
    row = model.sensor(index)
    kind = sensor_kinds(mujoco).get(int(row.type[0]))
    if kind is None:
        return None
    start = int(row.adr[0])
    numbers = data.sensordata[start : start + int(row.dim[0])]
    cutoff = float(row.cutoff[0]) or math.inf
    if kind == s.DISTANCE_SENSOR:
        return s.SimDevice(row.name, kind, {"min": 0.0, "max": cutoff}), lambda: _distance(float(numbers[0]), cutoff)
    if kind == s.INERTIAL_UNIT:
        return s.SimDevice(row.name, kind), lambda: roll_pitch_yaw(numbers)
    if kind == s.COMPASS:
        return s.SimDevice(row.name, kind), lambda: unit_vector(numbers)
    if kind in (s.TOUCH_SENSOR, s.POSITION_SENSOR):
        return s.SimDevice(row.name, kind), lambda: float(numbers[0])
    return s.SimDevice(row.name, kind), lambda: tuple(float(each) for each in numbers)


def _distance(value: float, cutoff: float) -> float:
    """A ray that meets nothing is -1 for MuJoCo, and the greatest distance for Webots."""
    return cutoff if value < 0 else min(value, cutoff)


def unit_vector(numbers: Sequence[float]) -> tuple[float, ...]:
    """Return the direction of a vector."""
    length = math.hypot(*numbers)
    return tuple(float(each) / length if length else 0.0 for each in numbers)


def roll_pitch_yaw(quaternion: Sequence[float]) -> tuple[float, float, float]:
    """Return the angles of a rotation (w, x, y, z), in rad, about x, then y, then z of the world (ENU, as Webots)."""
    w, x, y, z = (float(each) for each in quaternion)
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        pitch,
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def rotation_vector(quaternion: Sequence[float]) -> tuple[float, float, float]:
    """Return a rotation (w, x, y, z) as a vector: its direction is the axis, its length the angle in rad, 0 to pi."""
    w, x, y, z = (float(each) for each in quaternion)
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.hypot(x, y, z)
    if sine < 1e-12:
        return 0.0, 0.0, 0.0
    angle = 2 * math.atan2(sine, w)
    return x / sine * angle, y / sine * angle, z / sine * angle


def quaternion_of(vector: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the rotation (w, x, y, z) of a rotation vector."""
    x, y, z = (float(each) for each in vector)
    angle = math.hypot(x, y, z)
    if angle < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    part = math.sin(angle / 2) / angle
    return math.cos(angle / 2), x * part, y * part, z * part


class Rays:
    """A lidar or range finder: rays from a site, whose x axis is ahead and z axis up."""

    def __init__(self, mujoco: Any, model: Any, data: Any, name: str, parameters: Sequence[str]) -> None:
        import numpy  # mujoco cannot be there without it

        self._mujoco, self._model, self._data = mujoco, model, data
        site = model.site(name)
        self._site, self._body = int(site.id), int(site.bodyid[0])
        self._np = numpy
        numbers = [float(each) for each in parameters]
        if len(numbers) == 3:
            count, fov, self._range = int(numbers[0]), math.radians(numbers[1]), numbers[2]
            width, height = count, 1
        else:
            width, height, fov, self._range = int(numbers[0]), int(numbers[1]), math.radians(numbers[2]), numbers[3]
        if not (0 < width * height <= MAX_RAYS and all(map(math.isfinite, numbers))):
            raise ValueError(f"1 to {MAX_RAYS} rays")
        kind = s.LIDAR if len(numbers) == 3 else s.RANGE_FINDER
        step = fov / max(width - 1, 1)
        # From left to right and from top to bottom, as Webots has it.
        self._vectors = numpy.array([
            (math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch))
            for row in range(height) for column in range(width)
            for yaw in [fov / 2 - column * step] for pitch in [(height - 1) / 2 * step - row * step]
        ])  # fmt: skip
        self._hits = numpy.zeros(width * height)
        self._geoms = numpy.zeros(width * height, dtype=numpy.int32)
        facts = {"width": width, "height": height, "fov": fov, "min": 0.0, "max": self._range}
        self.device = s.SimDevice(name, kind, {key: float(value) for key, value in facts.items()})

    def read(self) -> tuple[float, ...]:
        """Return the distances in m; inf beyond the range."""
        frame = self._data.site_xmat[self._site].reshape(3, 3)
        vectors = (self._vectors @ frame.T).ravel()
        self._mujoco.mj_multiRay(
            self._model, self._data, self._data.site_xpos[self._site], vectors, None, True, self._body, self._geoms,
            self._hits, None, len(self._hits), self._range,
        )
        return tuple(float(hit) if 0 <= hit <= self._range else math.inf for hit in self._hits)


class Radio:
    """The packets between emitters and receivers of one world."""

    def __init__(self) -> None:
        self._queues: dict[str, tuple[int, list[bytes]]] = {}

    def add_receiver(self, name: str, channel: int) -> None:
        """Add a receiver; channel -1 hears all."""
        self._queues[name] = channel, []

    def send(self, channel: int, data: bytes) -> None:
        """Send to the receivers of a channel, -1 for all (Webots, "Emitter"); what a full one gets is lost."""
        for wanted, queue in self._queues.values():
            if channel in (-1, wanted) or wanted == -1:
                del queue[MAX_PACKETS - 1 :]
                queue.append(data)

    def receive(self, name: str) -> tuple[bytes, ...]:
        """Return and remove the packets of a receiver."""
        queue = self._queues[name][1]
        packets = tuple(queue)
        queue.clear()
        return packets
