"""A robot of Webots as a simulation: the package ``controller`` of its installation.

The names are those of the Python API of Webots R2023 and later (reference manual, chapters of the nodes).  The package
is imported here only, when a robot is opened; it loads the library of the installation, and connects when the first
Robot object is made.  There is one such object per process, so this runs in one of its own (``controller_process``).
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots.mujoco_sensors import rotation_vector

HOME: Final = "WEBOTS_HOME"
URL: Final = "WEBOTS_CONTROLLER_URL"
_KINDS: Final = {
    "Motor": s.MOTOR, "PositionSensor": s.POSITION_SENSOR, "Accelerometer": s.ACCELEROMETER, "Gyro": s.GYRO,
    "Compass": s.COMPASS, "GPS": s.GPS, "InertialUnit": s.INERTIAL_UNIT, "DistanceSensor": s.DISTANCE_SENSOR,
    "TouchSensor": s.TOUCH_SENSOR, "LightSensor": s.LIGHT_SENSOR, "Camera": s.CAMERA, "RangeFinder": s.RANGE_FINDER,
    "Lidar": s.LIDAR, "LED": s.LED, "Emitter": s.EMITTER, "Receiver": s.RECEIVER, "Speaker": s.SPEAKER,
    "Display": s.DISPLAY,
}  # fmt: skip
"""Class of the package -> kind."""
_VECTORS: Final = (s.ACCELEROMETER, s.GYRO, s.COMPASS, s.GPS)
_NUMBERS: Final = (s.POSITION_SENSOR, s.DISTANCE_SENSOR, s.LIGHT_SENSOR)
FORCE_3D: Final = 2
"""Type of a TouchSensor that measures a force in three directions (TouchSensor node)."""


class NoWebots(Exception):
    """There is no Webots to talk to; the message is one line."""


def import_controller(url: str) -> Any:
    """Import the package of the installation for a url (see ``port``).  Raises NoWebots."""
    home = os.environ.get(HOME, "")
    if not home:
        raise NoWebots(f"no Webots: set {HOME} to the folder of its installation")
    folder = Path(home) / "lib" / "controller" / "python"
    if not (folder / "controller").is_dir():
        raise NoWebots(f"no Webots in {HOME}={home}: there is no {folder / 'controller'} (R2023 or later is needed)")
    if url:
        os.environ[URL] = url
    # A service may have no USER, from which the library makes the path of the socket.
    os.environ.setdefault("USER", "default")
    sys.path.insert(0, str(folder))
    try:
        return importlib.import_module("controller")
    except (ImportError, OSError, KeyError) as error:
        raise NoWebots(f"the controller library of {home} cannot be loaded: {error}") from error


class WebotsRobot(s.BackEnd):
    """The robot of a controller."""

    def __init__(self, package: Any) -> None:
        """Connect, and look at the robot's devices.  Raises NoWebots."""
        super().__init__()
        self._robot = robot = package.Supervisor()
        self._devices: dict[str, Any] = {}
        self._motor_modes: dict[str, bool] = {}
        self._last: dict[str, tuple[float, float]] = {}
        self._nodes: dict[str, Any] = {}
        found = []
        for index in range(robot.getNumberOfDevices()):
            device = robot.getDeviceByIndex(index)
            kind = next((_KINDS[each.__name__] for each in type(device).__mro__ if each.__name__ in _KINDS), "")
            if kind:
                self._devices[device.getName()] = device
                found.append(s.SimDevice(device.getName(), kind, _facts(kind, device)))
        self.world = s.SimulatedWorld(
            robot.getName(), "Webots", int(robot.getBasicTimeStep()), tuple(found), None,
            supervisor=bool(robot.getSupervisor()),
        )  # fmt: skip
        self._kinds = {each.name: each.kind for each in found}

    # ---------------------------------------------------------------- stepping

    def step(self, ms: int) -> bool:
        """See ``BackEnd``; a positive result is a delay of a robot that is not synchronized."""
        return int(self._robot.step(ms)) != -1

    def time(self) -> float:
        """See ``BackEnd``: since this controller began."""
        return self.elapsed_ms / 1000

    def enable(self, name: str, period: int) -> None:
        if name.startswith(s.NODES):
            self._node(name.removeprefix(s.NODES))
            return
        device, kind = self._device(name), self._kinds[name]
        if kind == s.MOTOR:
            sensor = device.getPositionSensor()
            if sensor is not None:
                _enable(sensor, period)
            feedback = device.enableTorqueFeedback if _is_rotational(device) else device.enableForceFeedback
            feedback(period) if period else None
        else:
            _enable(device, period)

    def read(self, name: str) -> Any:
        if name.startswith(s.NODES):
            node = self._node(name.removeprefix(s.NODES))
            return (*node.getPosition(), *rotation_vector(_quaternion(node.getOrientation())))
        device, kind = self._device(name), self._kinds[name]
        if kind == s.MOTOR:
            return self._motor_values(name, device)
        if kind in _VECTORS:
            return tuple(float(each) for each in device.getValues())
        if kind in _NUMBERS:
            return float(device.getValue())
        return self._other(name, kind, device)

    def _other(self, name: str, kind: str, device: Any) -> Any:
        if kind == s.TOUCH_SENSOR:
            three = device.getType() == FORCE_3D
            return tuple(float(each) for each in device.getValues()) if three else float(device.getValue())
        if kind == s.INERTIAL_UNIT:
            return tuple(float(each) for each in device.getRollPitchYaw())
        if kind == s.CAMERA:
            return rgb_of(bytes(device.getImage()))
        if kind in (s.LIDAR, s.RANGE_FINDER):
            return tuple(float(each) for each in device.getRangeImage())
        if kind == s.RECEIVER:
            packets = []
            while device.getQueueLength() > 0:
                packets.append(bytes(device.getBytes()))
                device.nextPacket()
            return tuple(packets)
        raise ValueError(f"a {kind} measures nothing")

    def _motor_values(self, name: str, device: Any) -> tuple[float, float, float]:
        sensor = device.getPositionSensor()
        position = math.nan if sensor is None else float(sensor.getValue())
        torque = device.getTorqueFeedback() if _is_rotational(device) else device.getForceFeedback()
        now = self.time()
        before, at = self._last.get(name, (math.nan, -math.inf))
        self._last[name] = position, now
        return position, (position - before) / (now - at) if now > at else math.nan, float(torque)

    # ---------------------------------------------------------------- writing

    def write(self, name: str, item: str, value: Any) -> None:
        device, kind = self._device(name), self._kinds[name]
        if kind == s.MOTOR:
            self._write_motor(name, device, item, value)
        elif kind == s.LED:
            # A plain LED takes 0 or 1, one with a gradual colour 0xRRGGBB (LED node): white, and thereby its colour.
            level = round(min(max(value, 0.0), 1.0) * 255)
            device.set(level << 16 | level << 8 | level)
        elif kind == s.EMITTER:
            device.send(bytes(value))
        elif kind == s.SPEAKER:
            self._speak(device, item, value)
        elif kind == s.DISPLAY:
            _draw(device, item, value)
        else:
            raise ValueError(f"a {kind} takes nothing")

    def _write_motor(self, name: str, device: Any, item: str, value: float) -> None:
        if item == "position":
            by_speed = math.isinf(value)
            if self._motor_modes.get(name) != by_speed:
                self._motor_modes[name] = by_speed
                # In the mode of positions it is the speed of the way, else that of the wheel.
                device.setVelocity(0.0 if by_speed else device.getMaxVelocity())
            device.setPosition(value)
        elif item == "velocity":
            device.setVelocity(value)
        elif item == "torque":
            device.setTorque(value)
        elif item == "max velocity":
            if not self._motor_modes.get(name, False):
                device.setVelocity(value)
        else:
            raise ValueError(f"a motor has no {item}")

    def _speak(self, device: Any, item: str, value: str) -> None:
        if item == "speech":
            device.speak(value, 1.0)
        else:
            type(device).playSound(device, device, value, 1.0, 1.0, 0.0, False)

    def stop(self, name: str) -> None:
        device = self._device(name)
        if self._kinds[name] != s.MOTOR:
            return
        sensor = device.getPositionSensor()
        position = math.nan if sensor is None else float(sensor.getValue())
        if self._motor_modes.get(name, True) or math.isnan(position):
            device.setPosition(math.inf)
            device.setVelocity(0.0)
            self._motor_modes[name] = True
        else:
            device.setPosition(position)

    # ---------------------------------------------------------------- the supervisor

    def move(self, node: str, item: str, value: Sequence[float]) -> None:
        """See ``BackEnd``: by the fields of a Solid or a Robot."""
        field = self._node(node).getField(item)
        if item == "translation":
            field.setSFVec3f([float(each) for each in value])
            return
        angle = math.hypot(*value)
        axis = [each / angle for each in value] if angle > 1e-12 else [0.0, 0.0, 1.0]
        field.setSFRotation([*axis, angle])

    def label(self, label: s.LabelText) -> None:
        colour = sum(
            round(part * 255) << shift for part, shift in ((label.red, 16), (label.green, 8), (label.blue, 0))
        )
        self._robot.setLabel(
            label.number, label.text, label.x, label.y, label.size, colour, 1.0 - label.opacity, "Arial"
        )

    def reset_physics(self) -> None:
        self._robot.simulationResetPhysics()

    def revert(self) -> None:
        self._robot.worldReload()

    def quit(self) -> None:
        self._robot.simulationQuit(0)

    def close(self) -> None:
        """See ``BackEnd``: the end of the process leaves the simulation."""

    # ---------------------------------------------------------------- finding

    def _device(self, name: str) -> Any:
        if name not in self._devices:
            raise ValueError(s.no_such("device", name, self._devices))
        return self._devices[name]

    def _node(self, name: str) -> Any:
        found = self._nodes.get(name)
        if found is None:
            if not self.world.supervisor:
                raise ValueError("this robot is no supervisor: set the field supervisor of its Robot node to TRUE")
            found = self._nodes[name] = self._robot.getFromDef(name)
        if found is None:
            raise ValueError(f"no node {name!r}: nodes have the name of their DEF")
        return found


def rgb_of(bgra: bytes) -> bytes:
    """Return a picture of Webots (blue, green, red, alpha) as red, green, blue."""
    pixels = bytearray(len(bgra) // 4 * 3)
    pixels[0::3], pixels[1::3], pixels[2::3] = bgra[2::4], bgra[1::4], bgra[0::4]
    return bytes(pixels)


def _quaternion(m: Sequence[float]) -> tuple[float, float, float, float]:
    """Return a rotation matrix of nine numbers, row by row, as w, x, y, z."""
    w = math.sqrt(max(0.0, 1 + m[0] + m[4] + m[8])) / 2
    x = math.copysign(math.sqrt(max(0.0, 1 + m[0] - m[4] - m[8])) / 2, m[7] - m[5])
    y = math.copysign(math.sqrt(max(0.0, 1 - m[0] + m[4] - m[8])) / 2, m[2] - m[6])
    z = math.copysign(math.sqrt(max(0.0, 1 - m[0] - m[4] + m[8])) / 2, m[3] - m[1])
    return w, x, y, z


def _is_rotational(motor: Any) -> bool:
    """Whether a motor turns (``Motor.ROTATIONAL`` is 0)."""
    return int(motor.getType()) == 0


def _enable(device: Any, period: int) -> None:
    if period:
        device.enable(period)
    else:
        device.disable()


def _draw(device: Any, item: str, values: Sequence[Any]) -> None:
    *rest, colour = values
    device.setColor(int(colour))
    (device.drawText if item == "text" else device.fillRectangle)(*rest)


def _facts(kind: str, device: Any) -> dict[str, float]:
    """Return what does not change of a device."""
    read: dict[str, Callable[[], Any]] = {}
    if kind == s.MOTOR:
        low, high = float(device.getMinPosition()), float(device.getMaxPosition())
        limited = low != high  # both 0: no limits (Motor node)
        force = device.getMaxTorque if _is_rotational(device) else device.getMaxForce
        return {
            "min": low if limited else -math.inf, "max": high if limited else math.inf,
            "max velocity": float(device.getMaxVelocity()), "max torque": float(force()),
            "linear": float(not _is_rotational(device)),
        }  # fmt: skip
    if kind == s.DISTANCE_SENSOR:
        read = {"min": device.getMinValue, "max": device.getMaxValue}
    elif kind == s.CAMERA:
        read = {"width": device.getWidth, "height": device.getHeight, "xfov": device.getFov, "near": device.getNear}
    elif kind == s.RANGE_FINDER:
        read = {"width": device.getWidth, "height": device.getHeight, "fov": device.getFov,
                "min": device.getMinRange, "max": device.getMaxRange}  # fmt: skip
    elif kind == s.LIDAR:
        read = {"width": device.getHorizontalResolution, "height": device.getNumberOfLayers, "fov": device.getFov,
                "min": device.getMinRange, "max": device.getMaxRange}  # fmt: skip
    elif kind in (s.EMITTER, s.RECEIVER):
        read = {"channel": device.getChannel}
    elif kind == s.DISPLAY:
        read = {"width": device.getWidth, "height": device.getHeight}
    return {name: float(get()) for name, get in read.items()}
