"""The object ``nxt``: the brick, and the devices that the layout makes on its ports."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
    BadConfig,
    Opened,
    RobotSettings,
    UObject,
    UVar,
    event,
    finite_number,
    function,
    reading,
    variable,
)
from urbihw.navigation.lasers.fitting import BaseLaser, fit_laser
from urbihw.navigation.pilot import Pilot
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.nxt import words
from urbihw.platforms.nxt.motors import NxtServo
from urbihw.platforms.nxt.navigation import NxtOdometry, NxtPlanner, NxtWheels
from urbihw.platforms.nxt.options import TRACK, WHEEL_RADIUS, NxtOptions
from urbihw.platforms.nxt.others import BATTERY_PACE, Beeper, NxtBattery, NxtCommand
from urbihw.platforms.nxt.ports import Brick, PortDevice, Ports
from urbihw.platforms.nxt.reading import BRICK
from urbihw.platforms.nxt.sensors import (
    ColourSensor,
    I2CSensor,
    NxtLightSensor,
    NxtSwitch,
    Sensor,
    SoundSensor,
    UltraSonicSensor,
)
from urbihw.platforms.words import counted
from urbihw.settings import BadSetting

_DEVICES: Final = (
    NxtServo, UltraSonicSensor, SoundSensor, NxtLightSensor, NxtSwitch, ColourSensor, I2CSensor, NxtBattery, Beeper,
)  # fmt: skip
_MANUAL_NAMES: Final = (
    "wheelL", "wheelR", "claw", "decibel", "sonar", "light", "bumper", "battery", "beeper", "wheel", "answer",
)  # fmt: skip
"""The names that the manual's examples assign to without a ``var``."""
_ASSIGNED = re.compile(rf"^[ \t]*(\w+)\s*=\s*(?:{'|'.join(kind.urbi_class() for kind in _DEVICES)})\s*\.\s*new\b", re.M)


class Nxt(Brick):
    """An NXT on USB or Bluetooth."""

    slot_words = words.BRICK

    classes = (*_DEVICES, NxtCommand, NxtOdometry, NxtPlanner, BaseLaser)

    robot_name = "nxt"
    model_name = "LEGO MINDSTORMS NXT"
    family = "urbihw.platforms.nxt.driver:NxtDriver"

    address = reading("")
    firmware = reading("")
    wheelRadius = variable(WHEEL_RADIUS)
    track = variable(TRACK)
    fullSpeed = variable(math.radians(900))
    refused = event()

    def init(self) -> None:
        """Called by ``new``; the worker is started by ``open``."""
        super().init()
        self.ports = Ports()
        self.gauges = []
        self.options = NxtOptions()
        self._set_options({})
        self._layout_is_done = False
        self._wheels: NxtWheels | None = None
        self._laser: BaseLaser | None = None
        for var in (self.wheelRadius, self.track, self.fullSpeed):
            self.notify_change(var, partial(self._check_geometry, var))

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Read the options, make ``Command``, then start the worker."""
        self._set_options(settings.options)
        self.host.create(NxtCommand, "Command")
        super().open(settings, opened)
        # A battery that a program makes later has a value at once.
        self.channel.watch(BRICK, ("millivolts",), BATTERY_PACE)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new options and settings; the layout is not run again."""
        self._set_options(settings.options)
        super().configure(settings)

    def close(self) -> None:
        """Close the laser, then the brick."""
        if self._laser is not None:
            self._laser.close()
        super().close()

    def summary(self) -> str:
        """Return the brick's name and the numbers of motors and sensors."""
        motors = sum(isinstance(device, NxtServo) for device in self.ports)
        sensors = sum(isinstance(device, Sensor | I2CSensor) for device in self.ports)
        return f'"{self.identity.name_.sensed}", {counted(motors, "motor")}, {counted(sensors, "sensor")}'

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def owner(self, port: Any) -> UObject | None:
        """Return the device on a port, "A" to "C" or 1 to 4; nil if there is none."""
        return self.ports.get(int(port) if isinstance(port, float) else str(port))

    @function
    def steer(self, left: NxtServo, right: NxtServo) -> None:
        """Make these two motors the driving motors of planner and odometry; called by a layout."""
        if left is right:
            raise ValueError("a robot that drives has two motors for that")
        wheels = NxtWheels(self, left, right)
        if self._wheels is None:
            odometry = self.host.create(NxtOdometry)
            pilot = Pilot(wheels, odometry, self.motion, self.log)
            self._laser = pilot.scanner = fit_laser(self, self.options)
            pilot.planner = self.host.create(NxtPlanner, None, pilot)
            self.put_slot("odometry", odometry)
            self.put_slot("planner", pilot.planner)
        else:
            pilot = self._wheels.pilot
            pilot.change_wheels(wheels)
        wheels.pilot = pilot
        self._wheels = wheels

    @function("lookAhead")
    def look_ahead(self, sensor: UltraSonicSensor, place: float) -> None:
        """Use this sensor, ``place`` m in front of the axle: on a path the robot waits in front of obstacles."""
        self._driven().look_ahead(sensor, finite_number(place))

    @function("moveTo")
    def move_to(self, goal: Any) -> None:
        """Drive to [x, y, heading] on the map along a planned path; the planner's events report the end."""
        self._driven().pilot.planner.move_to(goal)

    def _driven(self) -> NxtWheels:
        if self._wheels is None:
            raise ValueError("it is not known which motors drive: say nxt.steer(wheelL, wheelR) in the layout")
        return self._wheels

    def _check_geometry(self, var: UVar) -> None:
        value = finite_number(var.value)
        if not value or (value < 0 and var is not self.wheelRadius):
            raise ValueError(f"{var.name} is a number above 0; only wheelRadius may be below")

    # ---------------------------------------------------------------- what motors and planner ask

    def motor_limits(self, place: str) -> DeviceLimits:
        """Return the limits of the settings for the motor on a port."""
        return self.limits.settings.device(place)

    def end_path(self, device: PortDevice) -> None:
        """End the planner's path if it drives this motor."""
        if self._wheels is not None and isinstance(device, NxtServo) and self._wheels.uses_motor(device):
            self._wheels.pilot.yield_to_hand()

    # ---------------------------------------------------------------- the worker

    def on_found(self, message: m.Found) -> None:
        """Show the brick's identification, and run the layout at the first connection."""
        (brick,) = message.devices
        self.identity.show(name=brick.name, serial=brick.address)
        self.address.sense(brick.address)
        self.firmware.sense(brick.firmware)
        for device in self.ports:
            device.link_changed(True)
        if not self.arrival.tree_begun:
            self._run_layout()

    def build_absent(self) -> bool:
        """Run the layout: it names all devices."""
        self._run_layout()
        return True

    def on_samples(self, message: m.Samples) -> None:
        """Show the values of each device; the readings of the driving motors go to the odometry too."""
        for place, values in message.values.items():
            stamp = message.times[place] + self.offset
            device = self.ports.get(place)
            if device is not None:
                device.read(values, stamp)
                if self._wheels is not None and "rotation" in values:
                    self._wheels.add_reading(place, values["rotation"], stamp)
            elif place == BRICK:
                self.measured = values, stamp
                for gauge in self.gauges:
                    gauge.read(values, stamp)

    def is_complete(self) -> bool:
        """Return whether the layout was run and all its devices have been read."""
        return self._layout_is_done and not any(device.items and device.stale.sensed for device in self.ports)

    def on_link_down(self, reason: str) -> None:
        """Mark all devices as stale and end a path."""
        for device in self.ports:
            device.link_changed(False)
        self._drop_path("the link was lost")

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """End a path if one of its motors was stopped."""
        if self._wheels is not None and (devices is None or set(devices) & set(self._wheels.devices)):
            self._drop_path(reason)

    def _drop_path(self, reason: str) -> None:
        """End a path whose wheels the worker has stopped."""
        if self._wheels is not None:
            self._wheels.pilot.drop_orders(reason)

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the motors by the letters of their ports."""
        return {str(device.place): device for device in self.ports if isinstance(device, NxtServo)}

    def on_stopped(self, reason: str) -> None:
        """Show the speed 0 on all motors."""
        for device in self.ports:
            device.stopped()

    def on_happened(self, message: m.DeviceReport) -> None:
        """Log and emit the refusal of a command by the brick."""
        self.log.warning("port %s: %s", message.device, message.value)
        self.refused.emit(str(message.device), message.value)

    # ---------------------------------------------------------------- the layout

    def _set_options(self, options: Mapping[str, Any]) -> None:
        try:
            old, self.options = self.options, NxtOptions.of(options)
        except BadSetting as error:
            raise BadConfig(f"nxt: {error}") from error
        self.volts = self.options.battery_empty, self.options.battery_full
        # Values set by a layout or a program stay, unless the settings have changed.
        if self.options.wheel_radius != old.wheel_radius:
            self.wheelRadius.sense(self.options.wheel_radius)
        if self.options.track != old.track:
            self.track.sense(self.options.track)

    def _run_layout(self) -> None:
        """Run the layout; the robot is ready when all its devices have been read."""
        layout = self.options.layout
        if not layout:
            self._laid_out_as("")
            return
        try:
            text = Path(layout).read_text("latin-1")
        except OSError as error:
            self.arrival.answer(BadConfig(f"nxt: cannot load the layout {layout}: {error.strerror}"))
            return
        # The manual writes `wheelL = NxtServo.new("C");`, so names need no declaration.
        self._declare_names(_ASSIGNED.findall(text))
        self.host.run(text, layout, self._laid_out_as)

    def _declare_names(self, names: Iterable[str]) -> None:
        for name in names:
            if not self.host.has_slot(name):
                self.host.put(name, None)

    def _laid_out_as(self, problem: str) -> None:
        if problem:
            self.arrival.answer(BadConfig(f"nxt: the layout does not work: {problem}"))
            return
        self._layout_is_done = True
        # Only now: a layout may declare them itself.
        self._declare_names(_MANUAL_NAMES)
        self.limits.send()
        if self.is_complete():
            self.arrival.answer(None)
        else:
            self.arrival.wait_for_readings()
