"""A stand-in for the package ``controller`` of Webots: a small robot that moves without physics.

Names, signatures and rules are those of the published Python API (Webots reference manual, R2023 and later): a sensor
is nan until it is enabled and its period is over; nothing moves without ``step``, whose argument is a multiple of the
basic step and whose result is -1 when the controller must end; a second Robot object is refused; a device or a node
that is not there is None.  It is never installed: tests put its folder under WEBOTS_HOME.
"""

from __future__ import annotations

import math
import os
import sys

BASIC_STEP = 20


class Device:
    def __init__(self, name: str) -> None:
        self._name = name

    def getName(self) -> str:
        return self._name

    def advance(self, seconds: float) -> None:
        """Time passes."""


class Sensor(Device):
    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._period = 0
        self._age = 0

    def enable(self, samplingPeriod: int) -> None:
        assert samplingPeriod % BASIC_STEP == 0, "the period is a multiple of the basic step"
        self._period, self._age = samplingPeriod, 0

    def disable(self) -> None:
        self._period = 0

    def getSamplingPeriod(self) -> int:
        return self._period

    def advance(self, seconds: float) -> None:
        self._age += round(seconds * 1000)

    def valid(self) -> bool:
        return 0 < self._period <= self._age


class PositionSensor(Sensor):
    position = 0.0

    def getValue(self) -> float:
        return self.position if self.valid() else math.nan


class Motor(Device):
    ROTATIONAL, LINEAR = 0, 1

    def __init__(self, name: str, sensor: PositionSensor, limits: tuple[float, float] = (0.0, 0.0)) -> None:
        super().__init__(name)
        self._sensor = sensor
        self._limits = limits
        self._target, self._velocity = 0.0, 10.0

    def getType(self) -> int:
        return self.ROTATIONAL

    def getMinPosition(self) -> float:
        return self._limits[0]

    def getMaxPosition(self) -> float:
        return self._limits[1]

    def getMaxVelocity(self) -> float:
        return 10.0

    def getMaxTorque(self) -> float:
        return 5.0

    def getPositionSensor(self) -> PositionSensor:
        return self._sensor

    def enableTorqueFeedback(self, samplingPeriod: int) -> None:
        pass

    def getTorqueFeedback(self) -> float:
        return 0.5

    def setPosition(self, position: float) -> None:
        self._target = position

    def setVelocity(self, velocity: float) -> None:
        self._velocity = velocity

    def setTorque(self, torque: float) -> None:
        self._torque = torque

    def advance(self, seconds: float) -> None:
        reach = self._velocity * seconds
        if math.isinf(self._target):
            self._sensor.position += reach
        else:
            way = self._target - self._sensor.position
            self._sensor.position += min(max(way, -abs(reach)), abs(reach))


class Accelerometer(Sensor):
    def getValues(self) -> list[float]:
        return [0.0, 0.0, 9.81] if self.valid() else [math.nan] * 3


class Gyro(Sensor):
    def getValues(self) -> list[float]:
        return [0.0, 0.0, 0.0] if self.valid() else [math.nan] * 3


class GPS(Sensor):
    def getValues(self) -> list[float]:
        return [*_THE.nodes["box"].getPosition()] if self.valid() else [math.nan] * 3


class InertialUnit(Sensor):
    def getRollPitchYaw(self) -> list[float]:
        return [0.0, 0.0, 0.0] if self.valid() else [math.nan] * 3


class DistanceSensor(Sensor):
    def getValue(self) -> float:
        return 1.9 if self.valid() else math.nan

    def getMinValue(self) -> float:
        return 0.0

    def getMaxValue(self) -> float:
        return 5.0


class LightSensor(Sensor):
    def getValue(self) -> float:
        return 0.7 if self.valid() else math.nan


class TouchSensor(Sensor):
    def getType(self) -> int:
        return 1

    def getValue(self) -> float:
        return 0.0 if self.valid() else math.nan


class Camera(Sensor):
    def getWidth(self) -> int:
        return 8

    def getHeight(self) -> int:
        return 6

    def getFov(self) -> float:
        return 1.0

    def getNear(self) -> float:
        return 0.01

    def getImage(self) -> bytes:
        return bytes((1, 2, 3, 255)) * 48


class Lidar(Sensor):
    def getHorizontalResolution(self) -> int:
        return 5

    def getNumberOfLayers(self) -> int:
        return 1

    def getFov(self) -> float:
        return math.pi / 2

    def getMinRange(self) -> float:
        return 0.0

    def getMaxRange(self) -> float:
        return 8.0

    def getRangeImage(self) -> list[float]:
        return [math.inf, 2.0, 1.9, 2.0, math.inf]


class LED(Device):
    value = 0

    def set(self, value: int) -> None:
        self.value = value

    def get(self) -> int:
        return self.value


class Emitter(Device):
    def getChannel(self) -> int:
        return 1

    def send(self, data: bytes) -> int:
        _THE.on_air.append(data)
        return 1


class Receiver(Sensor):
    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.queue: list[bytes] = []

    def getChannel(self) -> int:
        return 1

    def getQueueLength(self) -> int:
        return len(self.queue)

    def getBytes(self) -> bytes:
        return self.queue[0]

    def nextPacket(self) -> None:
        del self.queue[0]


class Field:
    def __init__(self, node: Node, name: str) -> None:
        self._node, self._name = node, name

    def setSFVec3f(self, values: list[float]) -> None:
        assert self._name == "translation"
        self._node.translation = values

    def setSFRotation(self, values: list[float]) -> None:
        assert self._name == "rotation"
        assert math.isclose(math.hypot(*values[:3]), 1.0), "the axis is a unit vector"
        self._node.rotation = values


class Node:
    def __init__(self, place: list[float]) -> None:
        self.translation = place
        self.rotation = [0.0, 0.0, 1.0, 0.0]

    def getField(self, fieldName: str) -> Field:
        return Field(self, fieldName)

    def getPosition(self) -> list[float]:
        return [*self.translation]

    def getOrientation(self) -> list[float]:
        x, y, z, angle = self.rotation
        c, s, t = math.cos(angle), math.sin(angle), 1 - math.cos(angle)
        return [
            t * x * x + c, t * x * y - s * z, t * x * z + s * y,
            t * x * y + s * z, t * y * y + c, t * y * z - s * x,
            t * x * z - s * y, t * y * z + s * x, t * z * z + c,
        ]  # fmt: skip


class Robot:
    created: Robot | None = None

    def __init__(self) -> None:
        if Robot.created is not None:
            print("Error: Only one Robot instance can be created per controller process.", file=sys.stderr)
            sys.exit(1)
        global _THE
        Robot.created = _THE = self
        self.url = os.environ.get("WEBOTS_CONTROLLER_URL", "")
        self.nodes = {"box": Node([0.0, 0.0, 0.1]), "wall": Node([2.0, 0.0, 0.0])}
        self.on_air: list[bytes] = []
        self.labels: dict[int, tuple[object, ...]] = {}
        self.ends = False
        self.physics_resets = 0
        sensors = {name: PositionSensor(f"{name} sensor") for name in ("arm", "left wheel", "right wheel")}
        devices: list[Device] = [
            Motor("arm", sensors["arm"], (-math.pi / 2, math.pi / 2)), Motor("left wheel", sensors["left wheel"]),
            Motor("right wheel", sensors["right wheel"]), sensors["arm"], Accelerometer("acc"), Gyro("gyro"),
            GPS("gps"), InertialUnit("imu"), DistanceSensor("ahead"), TouchSensor("bumper"), Camera("eye"),
            LED("led0"), Lidar("laser"), Emitter("radio"), Receiver("ears"), LightSensor("ls0"),
        ]  # fmt: skip
        self.devices = {each.getName(): each for each in devices}
        self._hidden = [sensors["left wheel"], sensors["right wheel"]]

    def getName(self) -> str:
        return "contract"

    def getBasicTimeStep(self) -> float:
        return float(BASIC_STEP)

    def getSupervisor(self) -> bool:
        return True

    def getNumberOfDevices(self) -> int:
        return len(self.devices)

    def getDeviceByIndex(self, index: int) -> Device:
        return list(self.devices.values())[index]

    def getDevice(self, name: str) -> Device | None:
        return self.devices.get(name)

    def step(self, time_step: int) -> int:
        assert time_step % BASIC_STEP == 0, "the step is a multiple of the basic step"
        if self.ends:
            return -1
        for device in [*self.devices.values(), *self._hidden]:
            device.advance(time_step / 1000)
        for each in self.devices.values():
            if isinstance(each, Receiver):
                each.queue += self.on_air
        self.on_air.clear()
        return 0


class Supervisor(Robot):
    def getFromDef(self, name: str) -> Node | None:
        return self.nodes.get(name)

    def setLabel(
        self, id: int, label: str, x: float, y: float, size: float, color: int, transparency: float = 0,
        font: str = "Arial",
    ) -> None:
        self.labels[id] = (label, x, y, size, color, transparency, font)

    def simulationResetPhysics(self) -> None:
        self.physics_resets += 1

    def worldReload(self) -> None:
        self.ends = True

    def simulationQuit(self, status: int) -> None:
        self.ends = True


_THE: Robot
