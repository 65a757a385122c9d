"""The parts of a Pioneer in urbiscript: body, wheels, sonars, speeds, camera, battery.

Slots are in SI units.  ``robot`` updates each part with measured values; writes go to the robot, which sends commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, Final, Protocol

from urbihw.kernel.uobject import (
    EffectorDevice,
    Motion,
    UObject,
    event,
    function,
    number,
    owned,
    reading,
    set_range,
)
from urbihw.navigation.drive import Safety
from urbihw.platforms.arrival import Arrival
from urbihw.platforms.camera import CameraLog, PictureCamera
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.p3dx import words
from urbihw.platforms.p3dx.camera import Mechanics

ROBOT: Final = "robot"
MOST_RAMP: Final = 5.0
"""m/s2 or rad/s2; the greatest ramp of a controller that does not tell its own."""
LEAST_BRAKING: Final = {"SETA": 0.3, "SETRA": math.radians(100)}
"""m/s2 and rad/s2; the least deceleration for a controller that does not tell its own: those of a new one (the
CONFIGpac of a Pioneer 3-DX)."""

_RAMPS = "acceleration", "deceleration"


class RobotCommands(Protocol):
    """The interface of the robot for its parts."""

    motion: Motion
    """Decides who may move it."""
    arrival: Arrival
    """Knows whether it is connected."""

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


class P3dxSwitch(UObject):
    """A part with the slot ``load``: 1 on, 0 off; reads the state that the robot reports, not the last write."""

    load = owned(0.0)

    def init(self) -> None:
        """Numbers from 0 to 1."""
        set_range(self.load, 0.0, 1.0)


class P3dxBody(P3dxSwitch):
    """The body: motors, bumpers, and the room to keep."""

    slot_words = words.BODY

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


class P3dxWheel(UObject):
    """A wheel: how fast its rim goes, m/s."""

    slot_words = words.WHEEL

    speed = reading(0.0)


class Sonar(UObject):
    """One sonar: m to what it hears, inf when it hears nothing, nan while it is off."""

    slot_words = words.SONAR

    uname = "P3dxSonar"

    val = reading(math.nan)


class Sonars(P3dxSwitch):
    """All sonars: ``load`` switches them."""

    slot_words = words.SONARS

    uname = "P3dxSonars"

    def init(self, robot: RobotCommands) -> None:  # type: ignore[override]
        """Bind the switch of all sonars."""
        super().init()
        self.notify_change(self.load, lambda: robot.switch_sonars(number(self.load) != 0))

    @function("lendTo")
    def lend_to(self, ring: Any) -> None:
        """Let the Localizer of the sonars have the slot ``load``."""
        self.load.add_slot(ring, "load")


class AxisSpeed(EffectorDevice):
    """A speed of the robot, and the ramps with which its controller changes it.

    ``acceleration`` and ``deceleration`` are settings of the controller (SETA, SETRA), sent when written; a new
    connection sets those that the robot has told at the first one. No deceleration is weaker than that: the controller
    brakes with it at each stop, also at those of its own, when this machine has died.
    """

    off_is_error = True
    speed = owned(0.0)
    acceleration = owned(0.0)
    deceleration = owned(0.0)

    command: ClassVar[str]
    """The command that sets the ramps: positive for the acceleration, negative for the deceleration."""
    names: ClassVar[tuple[str, str, str]]
    """CONFIGpac's names of the acceleration, the deceleration, and the greatest one."""
    unit: ClassVar[float]
    """m/s2 or rad/s2 per count of the command."""

    def init(self, robot: RobotCommands, fastest: float) -> None:
        """``fastest`` in m/s or rad/s."""
        self._robot = robot
        self._serial: object = None
        self._own: dict[str, int] = {}
        self.guard(robot.motion, ROBOT, self.speed)
        self.notify_change(self.speed, self._order_speed)
        set_range(self.speed, -fastest, fastest)
        for name in _RAMPS:
            self.notify_change(self.variables[name], partial(self._write_ramp, name))

    def explain_off(self) -> str:
        """Return why a speed does not drive the robot, "" if it does."""
        return self._robot.explain_off()

    def update_ramps(self, config: Mapping[str, int | str]) -> None:
        """Set the ramps of CONFIGpac at a new connection; at a later one with the same robot, those of the first.

        A controller may tell those that are in force, which a program may have written.
        """
        if config["serial"] != self._serial:
            self._serial = config["serial"]
            self._own = {name: int(config[field]) for name, field in zip(_RAMPS, self.names, strict=False)}
        most = int(config[self.names[2]]) * self.unit or MOST_RAMP
        for name, counts in self._own.items():
            var = self.variables[name]
            var.set_property("rangemax", max(most, counts * self.unit))
            var.sense(counts * self.unit)
            if counts and self._robot.arrival.is_up():  # an absent robot gets them when it comes
                self._send_counts(name, counts)

    def _order_speed(self) -> None:
        raise NotImplementedError

    def _write_ramp(self, name: str) -> None:
        var = self.variables[name]
        counts, least, why = round(number(var) / self.unit), 1, ""
        if name == "deceleration":
            least = self._own[name] or round(LEAST_BRAKING[self.command] / self.unit)
            why = ", the robot's own, so that every stop brakes as it should"
        if counts < least:
            raise ValueError(f"at least {least * self.unit:.3g}{why}")
        self._send_counts(name, counts)
        var.sense(counts * self.unit)

    def _send_counts(self, name: str, counts: int) -> None:
        self._robot.command(self.command, counts if name == "acceleration" else -counts)


class XSpeed(AxisSpeed):
    """How fast the robot goes, m/s forward; the ramps in m/s2."""

    slot_words = words.X

    uname = "P3dxX"

    command = "SETA"
    names = ("trans_accel", "trans_decel", "trans_accel_top")
    unit = 0.001

    def _order_speed(self) -> None:
        self._robot.set_speed(v=number(self.speed))


class YawSpeed(AxisSpeed):
    """How fast the robot turns, rad/s to the left; the ramps in rad/s2."""

    slot_words = words.YAW

    uname = "P3dxYaw"

    command = "SETRA"
    names = ("rot_accel", "rot_decel", "rot_accel_top")
    unit = math.radians(1)

    def _order_speed(self) -> None:
        self._robot.set_speed(w=number(self.speed))


class P3dxBattery(UObject):
    """The battery; ``remain`` is what the controller says, or an estimate from the voltage."""

    slot_words = words.BATTERY

    voltage = reading(math.nan)
    remain = reading(math.nan)
    # The controller measures neither.
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


class P3dxCamera(PictureCamera):
    """The camera's mechanics, on AUX1.  It reports nothing, so slots read the last command.

    ``load`` 1 makes it ready; orders before that are refused.  The pictures come by the option ``camera_url``.
    """

    slot_words = words.CAMERA

    load = owned(0.0)
    yaw = owned(0.0)
    pitch = owned(0.0)
    zoom = owned(0.0)

    def init(  # type: ignore[override]
        self, robot: RobotCommands, mechanics: Mechanics, channel: DeviceChannel, url: str, log: CameraLog
    ) -> None:
        """Nothing moves before ``load`` is 1; ``url`` is that of the pictures."""
        super().init(channel, url, log)
        set_range(self.load, 0.0, 1.0)
        self._robot = robot
        self._mechanics = mechanics
        self._waiting: dict[str, list[bytes]] = {}
        self._timer = 0
        self.notify_change(self.load, self._connect)
        for var in (self.yaw, self.pitch):
            self.notify_change(var, self._send_direction)
        self.notify_change(self.zoom, self._send_zoom)
        set_range(self.yaw, -mechanics.pan, mechanics.pan)
        set_range(self.pitch, *mechanics.tilt)
        set_range(self.zoom, 0.0, 1.0)

    def _connect(self) -> None:
        on = number(self.load) != 0
        self._waiting.clear()
        if on:
            self._send_later("connect", self._mechanics.connect())
        self.load.sense(float(on))

    def _send_direction(self) -> None:
        yaw, pitch = number(self.yaw), number(self.pitch)
        self._check_connected()
        self._send_later("look", self._mechanics.look(yaw, pitch))
        self.yaw.sense(yaw)
        self.pitch.sense(pitch)

    def _send_zoom(self) -> None:
        zoom = number(self.zoom)
        self._check_connected()
        self._send_later("zoom", self._mechanics.zoom(zoom))
        self.zoom.sense(zoom)

    def _check_connected(self) -> None:
        if not self.load.sensed:
            raise ValueError("the camera is not connected; set its load to 1 first")

    def _send_later(self, order: str, packets: Sequence[bytes]) -> None:
        """Send the packets of an order, with the camera's pause between two; they replace older ones of the order."""
        self._waiting[order] = list(packets)
        if not self._timer:
            self._send_next()

    def _send_next(self) -> None:
        if self._timer:
            self.remove_timer(self._timer)
            self._timer = 0
        while self._waiting:
            order = next(iter(self._waiting))
            packets = self._waiting[order]
            try:
                self._robot.command("TTY2", packets.pop(0))
            except ValueError:
                self._waiting.clear()
                self.load.sense(0.0)
                raise
            if not packets:
                del self._waiting[order]
            if self._mechanics.gap:
                self._timer = self.set_timer(self._mechanics.gap, self._send_next)
                return
