"""The parts of a Pioneer in urbiscript: body, wheels, sonars, speeds, camera, battery.

Slots are in SI units.  ``robot`` updates each part with measured values; writes go to the robot, which sends commands.
"""

from __future__ import annotations

import math
from typing import Any, Final, Protocol

from urbihw.kernel.uobject import EffectorDevice, Motion, UObject, event, function, number, owned, reading, set_range
from urbihw.navigation.drive import Safety
from urbihw.platforms.p3dx import camera

ROBOT: Final = "robot"


class RobotCommands(Protocol):
    """The interface of the robot for its parts."""

    motion: Motion
    """Decides who may move it."""

    def explain_off(self) -> str:
        """Return why the robot does not drive while the motors are off, else ""."""
        ...

    def switch_motors(self, on: bool) -> None:
        """Motors on or off."""
        ...

    def switch_sonars(self, on: bool) -> None:
        """Sonars on or off."""
        ...

    def set_speed(self, v: float | None = None, w: float | None = None) -> None:
        """Drive at a speed, m/s and rad/s; raises ValueError while the motors are off."""
        ...

    def command(self, name: str, value: int | bytes | None) -> None:
        """Send a command of ARCOS; raises ValueError for one that cannot be sent."""
        ...


class Switch(UObject):
    """A part with the slot ``load``: 1 on, 0 off; reads the state that the robot reports, not the last write."""

    load = owned(0.0)

    def init(self) -> None:
        """Numbers from 0 to 1."""
        set_range(self.load, 0.0, 1.0)


class Body(Switch):
    """The body: motors, bumpers, and the room to keep."""

    uname = "P3dxBody"

    safetyDistanceMin = owned(0.0)
    safetyDistanceMax = owned(0.0)
    stalled = reading(False)
    stopButton = reading(False)
    frontBumpers = reading([])
    rearBumpers = reading([])
    bumped = event()
    digitalIn = reading(0.0)
    digitalOut = owned(0.0)

    def init(self, robot: RobotCommands, safety: Safety) -> None:  # type: ignore[override]
        """``safety`` is what the drive keeps to."""
        super().init()
        self._robot = robot
        self._safety = safety
        self._pressed: tuple[bool, ...] = ()
        self.notify_change(self.load, lambda: robot.switch_motors(number(self.load) != 0))
        self.notify_change(self.safetyDistanceMin, self._set_safety)
        self.notify_change(self.safetyDistanceMax, self._set_safety)
        self.notify_change(self.digitalOut, self._set_outputs)
        for var in (self.safetyDistanceMin, self.safetyDistanceMax):
            set_range(var, 0.0, 5.0)
        set_range(self.digitalOut, 0.0, 255.0)

    def _set_safety(self) -> None:
        least, most = number(self.safetyDistanceMin), number(self.safetyDistanceMax)
        self._safety.least, self._safety.most = least, most
        self.safetyDistanceMin.sense(least)
        self.safetyDistanceMax.sense(most)

    def _set_outputs(self) -> None:
        self._robot.command("DIGOUT", 0xFF00 | int(number(self.digitalOut)))

    def show_bumpers(self, front: tuple[bool, ...], rear: tuple[bool, ...]) -> None:
        """The bumpers, leftmost first; ``bumped`` tells of each that was hit: "front" or "rear", and its number."""
        pressed = front + rear
        if pressed == self._pressed:
            return
        old, self._pressed = self._pressed, pressed
        self.frontBumpers.sense(list(front))
        self.rearBumpers.sense(list(rear))
        for index, hit in enumerate(pressed):
            if hit and not (index < len(old) and old[index]):
                at_front = index < len(front)
                self.bumped.emit("front" if at_front else "rear", float(index if at_front else index - len(front)))


class Wheel(UObject):
    """A wheel: how fast its rim goes, m/s."""

    uname = "P3dxWheel"

    speed = reading(0.0)


class Sonar(UObject):
    """One sonar: m to what it hears, 5 (about) when it hears nothing, nan while it is off."""

    uname = "P3dxSonar"

    val = reading(math.nan)


class Sonars(Switch):
    """All sonars: ``load`` switches them."""

    uname = "P3dxSonars"

    def init(self, robot: RobotCommands) -> None:  # type: ignore[override]
        """Bind the switch of all sonars."""
        super().init()
        self.notify_change(self.load, lambda: robot.switch_sonars(number(self.load) != 0))

    @function("lendTo")
    def lend_to(self, ring: Any) -> None:
        """Let the Localizer of the sonars have the slot ``load``."""
        self.load.add_slot(ring, "load")


class XSpeed(EffectorDevice):
    """How fast the robot goes, m/s forward."""

    uname = "P3dxX"

    off_is_error = True
    speed = owned(0.0)

    def init(self, robot: RobotCommands, fastest: float) -> None:
        """``fastest`` in m/s."""
        self._robot = robot
        self.guard(robot.motion, ROBOT, self.speed)
        self.notify_change(self.speed, lambda: robot.set_speed(v=number(self.speed)))
        set_range(self.speed, -fastest, fastest)

    def explain_off(self) -> str:
        """Return why a speed does not drive the robot, "" if it does."""
        return self._robot.explain_off()


class YawSpeed(EffectorDevice):
    """How fast the robot turns, rad/s to the left."""

    uname = "P3dxYaw"

    off_is_error = True
    speed = owned(0.0)

    def init(self, robot: RobotCommands, fastest: float) -> None:
        """``fastest`` in rad/s."""
        self._robot = robot
        self.guard(robot.motion, ROBOT, self.speed)
        self.notify_change(self.speed, lambda: robot.set_speed(w=number(self.speed)))
        set_range(self.speed, -fastest, fastest)

    def explain_off(self) -> str:
        """Return why a speed does not turn the robot, "" if it does."""
        return self._robot.explain_off()


class Battery(UObject):
    """The battery; ``remain`` is what the controller says, or an estimate from the voltage."""

    uname = "P3dxBattery"

    voltage = reading(math.nan)
    remain = reading(math.nan)
    capacity = reading(math.nan)
    current = reading(math.nan)
    charging = reading("unknown")
    low = event()

    FULL = 12.6
    CHARGING = {0: "no", 1: "bulk", 2: "overcharge", 3: "float", 4: "balance"}

    def init(self, low: float, empty: float) -> None:
        """``low`` is the voltage below which ``low`` is emitted, ``empty`` that at which the robot gives up."""
        self._low, self._empty = low or 11.5, empty or 11.0
        self._was_low = False

    def update_values(self, values: dict[str, Any], stamp: float) -> None:
        """Update the slots from the items of a SIP."""
        voltage = (values.get("battery_x10") or values["battery"]) / 10
        self.voltage.sense(voltage, stamp)
        charge = values.get("charge", 0)
        estimate = (voltage - self._empty) / (self.FULL - self._empty)
        self.remain.sense(charge / 100 if charge else max(0.0, min(1.0, estimate)), stamp)
        if "charge_state" in values:
            self.charging.sense(self.CHARGING.get(values["charge_state"], "unknown"), stamp)
        is_low = voltage < self._low
        if is_low and not self._was_low:
            self.low.emit(voltage)
        self._was_low = is_low


class Camera(Switch):
    """The camera's mechanics: a Sony EVI-D30 on AUX1.  It reports nothing, so slots read the last command."""

    uname = "P3dxCamera"

    yaw = owned(0.0)
    pitch = owned(0.0)
    zoom = owned(0.0)
    # Required by Interface.VideoIn; the picture is not transmitted over this wire.
    val = reading()
    width = reading(0.0)
    height = reading(0.0)
    xfov = reading(math.nan)
    yfov = reading(math.nan)

    def init(self, robot: RobotCommands) -> None:  # type: ignore[override]
        """Nothing moves before ``load`` is 1."""
        super().init()
        self._robot = robot
        self.notify_change(self.load, self._connect)
        for var in (self.yaw, self.pitch):
            self.notify_change(var, self._send_direction)
        self.notify_change(self.zoom, self._send_zoom)
        set_range(self.yaw, -camera.PAN_MOST, camera.PAN_MOST)
        set_range(self.pitch, -camera.TILT_MOST, camera.TILT_MOST)
        set_range(self.zoom, 0.0, 1.0)

    def _connect(self) -> None:
        on = number(self.load) != 0
        if on:
            self._robot.command("TTY2", camera.INIT)
        self.load.sense(float(on))

    def _send_direction(self) -> None:
        yaw, pitch = number(self.yaw), number(self.pitch)
        self._send_command(camera.pan_tilt(yaw, pitch))
        self.yaw.sense(yaw)
        self.pitch.sense(pitch)

    def _send_zoom(self) -> None:
        zoom = number(self.zoom)
        self._send_command(camera.zoom(zoom))
        self.zoom.sense(zoom)

    def _send_command(self, data: bytes) -> None:
        if not self.load.sensed:
            raise ValueError("the camera is not connected; set its load to 1 first")
        self._robot.command("TTY2", data)
