"""The object ``nxt``: the brick, and the devices that the layout makes on its ports."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, Opened, RobotSettings, UObject, event, function, reading
from urbihw.platforms.base import Limited
from urbihw.platforms.nxt.motors import Servo
from urbihw.platforms.nxt.options import Options
from urbihw.platforms.nxt.others import Battery, Beeper, Command
from urbihw.platforms.nxt.ports import Brick, Ports
from urbihw.platforms.nxt.reading import BRICK
from urbihw.platforms.nxt.sensors import (
    ColourSensor,
    I2CSensor,
    LightSensor,
    Sensor,
    SoundSensor,
    Switch,
    UltraSonicSensor,
)
from urbihw.settings import BadSetting

_DEVICES: Final = (Servo, UltraSonicSensor, SoundSensor, LightSensor, Switch, ColourSensor, I2CSensor, Battery, Beeper)
_ASSIGNED = re.compile(rf"^[ \t]*(\w+)\s*=\s*(?:{'|'.join(kind.__name__ for kind in _DEVICES)})\s*\.\s*new\b", re.M)


class Nxt(Brick):
    """An NXT on USB or Bluetooth."""

    classes = (*_DEVICES, Command)

    robot_name = "nxt"
    family = "urbihw.platforms.nxt.driver:NxtDriver"

    brick_name = reading("", "name")
    address = reading("")
    firmware = reading("")
    refused = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.ports = Ports()
        self.gauges = []
        self._take_options({})
        self._laid_out = False

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """See ``Robot``."""
        self._take_options(settings.options)
        self.host.create(Command, "Command")
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """See ``Robot``; the layout stays as it is."""
        self._take_options(settings.options)
        super().configure(settings)

    def status(self) -> str:
        """See ``Robot``."""
        if not self.link.sensed:
            return "link down"
        motors = sum(isinstance(device, Servo) for device in self.ports)
        sensors = sum(isinstance(device, Sensor | I2CSensor) for device in self.ports)
        return f'"{self.brick_name.sensed}", {_count(motors, "motor")}, {_count(sensors, "sensor")}'

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def owner(self, port: Any) -> UObject | None:
        """The device on a port: "A" to "C", 1 to 4; nil if there is none."""
        return self.ports.get(int(port) if isinstance(port, float) else str(port))

    # ---------------------------------------------------------------- the worker

    def on_found(self, message: m.Found) -> None:
        """See ``WiredRobot``."""
        (brick,) = message.devices
        self.brick_name.sense(brick.name)
        self.address.sense(brick.address)
        self.firmware.sense(brick.firmware)
        for device in self.ports:
            device.link_changed(True)
        if self.opening:
            self._lay_out()

    def on_samples(self, message: m.Samples) -> None:
        """See ``WiredRobot``."""
        for place, values in message.values.items():
            stamp = message.times[place] + self.offset
            device = self.ports.get(place)
            if device is not None:
                device.read(values, stamp)
            elif place == BRICK:
                for gauge in self.gauges:
                    gauge.read(values, stamp)

    def whole(self) -> bool:
        """See ``WiredRobot``."""
        return self._laid_out and not any(device.items and device.stale.sensed for device in self.ports)

    def on_link_down(self, reason: str) -> None:
        """See ``WiredRobot``."""
        for device in self.ports:
            device.link_changed(False)

    def limited_devices(self) -> Mapping[str, Limited]:
        """See ``WiredRobot``: motors by the letters of their ports."""
        return {str(device.place): device for device in self.ports if isinstance(device, Servo)}

    def on_stopped(self, reason: str) -> None:
        """See ``WiredRobot``."""
        for device in self.ports:
            device.stopped()

    def on_happened(self, message: m.Happened) -> None:
        """See ``WiredRobot``."""
        self.log.warning("port %s: %s", message.device, message.value)
        self.refused.emit(str(message.device), message.value)

    # ---------------------------------------------------------------- the layout

    def _take_options(self, options: Mapping[str, Any]) -> None:
        try:
            self._options = Options.of(options)
        except BadSetting as error:
            raise BadConfig(f"nxt: {error}") from error
        self.volts = self._options.battery_empty, self._options.battery_full

    def _lay_out(self) -> None:
        """Run the layout; the robot is ready when all its devices were read."""
        layout = self._options.layout
        if not layout:
            self._laid_out_as("")
            return
        try:
            text = Path(layout).read_text("latin-1")
        except OSError as error:
            self.answer(BadConfig(f"nxt: cannot load the layout {layout}: {error.strerror}"))
            return
        # As the manual writes it, `wheelL = Servo.new("C");`: the names need not be declared.
        for name in dict.fromkeys(_ASSIGNED.findall(text)):
            if name not in self.host.world.global_.slots:
                self.host.put(name, None)
        self.host.run(text, layout, self._laid_out_as)

    def _laid_out_as(self, problem: str) -> None:
        if problem:
            self.answer(BadConfig(f"nxt: the layout does not work: {problem}"))
            return
        self._laid_out = True
        self.send_limits()
        if self.whole():
            self.answer(None)
        else:
            self.wait_for_readings()


def _count(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"
