"""The object ``bioloid``: the bus as urbiscript sees it, with its devices as they are found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.buses.servos.device import DeviceInfo
from urbihw.kernel.uobject import BadConfig, NotReady, Opened, RobotSettings, UObject, event, function, reading
from urbihw.platforms.base import LimitedDevice, WiredRobot
from urbihw.platforms.bioloid.ax12 import AX12
from urbihw.platforms.bioloid.devices import Device
from urbihw.platforms.bioloid.motors import Servo
from urbihw.platforms.bioloid.sensors import AXS1
from urbihw.platforms.bioloid.xservo import XServo
from urbihw.platforms.devicelog import BACK, LOST, DeviceEvent

MISSING: Final = DeviceEvent(
    "no answer from {who}, which the settings expect: it joins when it answers",
    "no answer from {count} devices, which the settings expect: they join when they answer: {who}",
)
CLASSES: Final[dict[str, type[Device]]] = {
    "AX-12": AX12,
    "AX-S1": AXS1,
    "XL330": XServo,
    "XL430": XServo,
    "XM430": XServo,
}
"""Control table (``DeviceInfo.family``) -> class."""


class Devices(UObject):
    """The devices of one kind by number.

    Its functions belong to the instance, so that the library can make them slots of the Groups ``motors`` and
    ``sensors``.
    """

    uname = "BioloidDevices"

    def init(self, what: str = "device") -> None:
        """``what`` is the word for one of them in messages."""
        self._what = what
        self.members: dict[int, Device] = {}
        self.bind_function(self.get, "[]")
        self.bind_function(self.has)
        self.bind_function(self.keys)
        self.bind_function(self.as_list, "asList")
        self.bind_function(self.size)
        self.bind_function(self.empty)

    def get(self, id: int) -> Device:
        """The device with this number."""
        if id not in self.members:
            known = ", ".join(map(str, sorted(self.members))) or "none"
            raise ValueError(f"no {self._what} {id}; there are: {known}")
        return self.members[id]

    def has(self, id: int) -> bool:
        """Whether there is a device with this number."""
        return id in self.members

    def keys(self) -> list[float]:
        """The numbers, in order."""
        return [float(number) for number in sorted(self.members)]

    def as_list(self) -> list[Device]:
        """The devices, in order of their numbers."""
        return [self.members[number] for number in sorted(self.members)]

    def size(self) -> int:
        """How many there are."""
        return len(self.members)

    def empty(self) -> bool:
        """Whether there is none."""
        return not self.members


class Bioloid(WiredRobot):
    """A Bioloid on one bus."""

    classes = (AX12, XServo, AXS1, Devices)

    robot_name = "bioloid"
    model_name = "ROBOTIS Bioloid"
    family = "servos"

    lost = event()
    back = event()
    found = event()
    refused = event()
    missing = reading([])

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.devices: dict[int, Device] = {}
        self._missing: dict[int, None] = {}
        self._new: list[Device] = []
        self._is_built = False

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Make the tables of ``motors`` and ``sensors``, set the period of movements, then start the worker."""
        self.motors, self.sensors = self.host.create(Devices, None, "motor"), self.host.create(Devices, None, "sensor")
        self.put_slot("motorTable", self.motors)
        self.put_slot("sensorTable", self.sensors)
        self._set_period(settings.rate)
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings, also the period of the movements.  Raises BadConfig."""
        super().configure(settings)
        self._set_period(settings.rate)

    def _set_period(self, rate: float) -> None:
        """With the default of 20 ms a movement would give a bus of 100 Hz a new goal in every second tick only."""
        self.host.run(f"System.period = {1 / rate!r};", "bioloid.period")

    def status(self) -> str:
        """Return the numbers of servos and sensors, the rate, and which are lost."""
        if not self.link.sensed:
            return "link down"
        motors = sum(isinstance(device, Servo) for device in self.devices.values())
        sensors = len(self.devices) - motors
        lost = [str(number) for number, device in self.devices.items() if device.state.sensed == "lost"]
        parts = [_count(motors, "servo"), _count(sensors, "sensor")]
        if self.rate.sensed:
            parts.append(f"{self.rate.sensed:.0f} Hz")
        missing = f", missing: {' '.join(map(str, self._missing))}" if self._missing else ""
        return ", ".join(parts) + (f", lost: {' '.join(lost)}" if lost else "") + missing

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def scan(self) -> None:
        """Look for devices on all ids; takes half a second, in which the cycle rests: not while the robot moves."""

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self.log.warning("scan failed: %s", reply.error)

        self.channel.send_request("scan", 0, done)

    # ---------------------------------------------------------------- the worker

    def on_samples(self, message: m.Samples) -> None:
        """Pass the values of each device to it."""
        offset, times, devices = self.offset, message.times, self.devices
        for number, values in message.values.items():
            device = devices.get(number)
            if device is not None:
                device.update_values(values, times[number] + offset)

    def is_complete(self) -> bool:
        """Return whether the tree is built and every device found has been read once."""
        return self._is_built and bool(self.devices) and all(device.is_complete for device in self.devices.values())

    def on_link_down(self, reason: str) -> None:
        """Mark all devices as stale."""
        for device in self.devices.values():
            device.link_changed(False)

    def signed_target(self, device: Any, item: str, raw: Any) -> float:
        """See ``WiredRobot``: the speed of an AX wheel has its sign in a bit."""
        scale = self._wheel_scale(device, item)
        return float(raw) if scale is None else scale[0].speed_of(int(raw)) * scale[1]

    def raw_target(self, device: Any, item: str, signed: float) -> Any:
        """See ``WiredRobot``."""
        scale = self._wheel_scale(device, item)
        return signed if scale is None else scale[0].speed_target(signed / scale[1], True)[1]

    def _wheel_scale(self, device: Any, item: str) -> tuple[Servo, float] | None:
        """The servo, and its counts for 1 rad/s, of a target that is the speed of a wheel; None for others."""
        servo = self.devices.get(device)
        if not isinstance(servo, Servo) or not servo.wheel.sensed:
            return None
        speed, scale = servo.wheel_scale()
        return (servo, scale) if item == speed else None

    # ---------------------------------------------------------------- devices

    def on_found(self, message: m.Found) -> None:
        """Report ID conflicts; make new devices, and restore those that are back."""
        if message.conflicts:
            self._report_conflicts(message.conflicts)
        for info in message.devices:
            device = self.devices.get(info.id)
            if device is None:
                self._add_device(info)
            else:
                device.link_changed(True)
        self.host.run("bioloid.grow;", "bioloid.grow", self._on_tree_built)
        if not self.opening:
            return
        if not self.devices:
            self.answer_open(
                NotReady(
                    f"no servo found on {self.url.sensed}: is the robot switched on, are the cables plugged in, "
                    "is this its speed (?baud=1000000)?"
                )
            )
        elif not message.conflicts:
            self.wait_for_readings()

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the servos as ``motor1`` to ``motorN``."""
        return {f"motor{number}": each for number, each in self.devices.items() if isinstance(each, Servo)}

    def on_threshold_crossed(self, message: m.ThresholdCrossed) -> None:
        """Also show the torque of a servo that a threshold has released as off."""
        super().on_threshold_crossed(message)
        device = self.devices.get(message.device)
        if message.holds and message.passed and isinstance(device, Servo):
            device.mark_released()

    def _on_tree_built(self, problem: str) -> None:
        self._is_built = True
        if problem:
            self.log.error("the tree of the robot is not complete: %s", problem)
        new, self._new = self._new, []
        for device in new:
            self.found.emit(device)

    def _report_conflicts(self, ids: tuple[int, ...]) -> None:
        numbers = " and ".join(map(str, ids))
        text = (
            f"several devices answer to id {numbers} on {self.url.sensed}: take all but one off the bus and give the "
            "others ids of their own"
        )
        if self.opening:
            self.answer_open(BadConfig(text))
        else:
            self.log.error("%s", text)

    def _add_device(self, info: DeviceInfo) -> None:
        kind = CLASSES.get(info.family)
        if kind is None:
            self.log.warning("device %d (%s) is of no kind known here; it is left alone", info.id, info.name)
            return
        table, name = (self.motors, "motor") if issubclass(kind, Servo) else (self.sensors, "sensor")
        about = (self.channel, info, self._report_refused, *((self.motion,) if issubclass(kind, Servo) else ()))
        device = self.host.create(kind, f"{name}{info.id}", *about)
        device.log = self.log
        if isinstance(device, Servo):
            device.mode_changed = self.send_limits
        if self._missing.pop(info.id, 0) is None:
            self.missing.sense([float(number) for number in self._missing])
        self.devices[info.id] = table.members[info.id] = device
        self._new.append(device)

    def on_device_state(self, message: m.DeviceState) -> None:
        """Show the loss and the return of a device; one that was lost before it was found is logged as missing."""
        device = self.devices.get(message.device)
        if device is None:
            if message.new == "lost":
                self._missing[message.device] = None
                self.missing.sense([float(number) for number in self._missing])
                self.log.log_event(MISSING, str(message.device))
            return
        device.changed_state(message.new, message.reason)
        if message.new == "lost":
            self.log.log_event(LOST, f"{device.kind_of_device} {message.device}", message.reason)
            self.lost.emit(device)
        elif message.new == "back":
            self.log.log_event(BACK, f"{device.kind_of_device} {message.device}")
            self.back.emit(device)

    def _report_refused(self, device: Device, slot: str, reason: str) -> None:
        self.log.warning("%s %d: %s not written: %s", device.kind_of_device, device.number, slot, reason)
        self.refused.emit(device, slot, reason)


def _count(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"
