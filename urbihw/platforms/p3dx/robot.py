"""The object ``P3dx``: the robot in urbiscript, and the connection between its worker and its parts.

Each packet of the robot updates the slots of the parts; then ``Drive`` computes the speeds, which are sent as targets.
The tree of components (``P3dx.body``, ``robot``) is built in ``p3dx.u``.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from typing import Any

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import split_parameters
from urbihw.kernel.uobject import (
    BadConfig,
    Opened,
    Origin,
    RobotSettings,
    finite_number,
    function,
    number,
    reading,
)
from urbihw.navigation.drive import Drive, DriveLimits, State
from urbihw.navigation.frames import Point
from urbihw.platforms.arrival import LINK_DOWN
from urbihw.platforms.hooks import LimitedDevice, LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.p3dx import sip, words
from urbihw.platforms.p3dx.arcos import ArcosRobot
from urbihw.platforms.p3dx.camera import CAMERAS
from urbihw.platforms.p3dx.commands import GRIPPER
from urbihw.platforms.p3dx.devices import P3dxBattery, P3dxBody, P3dxCamera, P3dxWheel, Sonar, Sonars, XSpeed, YawSpeed
from urbihw.platforms.p3dx.factors import ANGLE, FACTORS, NO_ECHO, SONARS, Factors, factors_of
from urbihw.platforms.p3dx.gripper import Gripper
from urbihw.platforms.p3dx.gyro import HOST_READS, P3dxGyro
from urbihw.platforms.p3dx.handshake import ArcosRobotInfo
from urbihw.platforms.p3dx.navigation import P3dxLaser, P3dxOdometry, P3dxPilot, P3dxPlanner, mount_of
from urbihw.platforms.p3dx.options import FUSED, P3dxOptions
from urbihw.settings import BadSetting

ROBOT, SONAR = "robot", "sonar"
FRONT, REAR = range(8), range(8, 16)
_SIMULATORS = ("SIM", "MobileSim")


class P3dx(ArcosRobot):
    """A Pioneer 3-DX, or another robot that speaks ARCOS."""

    slot_words = words.BASE

    uname = "P3dxRobot"
    classes = (
        P3dxBody, P3dxWheel, P3dxOdometry, Sonar, Sonars, P3dxLaser, P3dxCamera, XSpeed, YawSpeed, P3dxBattery,
        P3dxPlanner, Gripper, P3dxGyro,
    )  # fmt: skip

    robotType = reading("")
    firmware = reading("")

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.options = P3dxOptions()
        self.factors: Factors = FACTORS["p3dx-sh"]
        self._parts = False
        self._last: tuple[float, float, float] | None = None
        self._motors = self._motors_wanted = False
        self._sent_speeds = (0, 0)
        self.gripper: Gripper | None = None
        self.gyro: P3dxGyro | None = None
        self._fuses_gyro = False

    # ---------------------------------------------------------------- the interface for the pilot

    devices: tuple[Hashable, ...] = (ROBOT,)
    """What moves the base, for ``navigation.pilot.Wheels``."""

    @property
    def navigation(self) -> P3dxOptions:
        """The options of the navigation, for ``navigation.pilot.Wheels``."""
        return self.options

    @property
    def drive(self) -> Drive:
        """The limits, the safety distances and the current motion."""
        return self.pilot.drive

    def update_limits(self, limits: DriveLimits) -> None:
        """Write the limits of the controller, and the decelerations that are set now."""
        limits.fastest, limits.fastest_turn = self._fastest
        limits.braking = number(self.x.deceleration) or limits.braking
        limits.braking_turn = number(self.yaw.deceleration) or limits.braking_turn

    def order_speeds(self, v: float, w: float, origin: Origin) -> None:
        """Send speeds, m/s and rad/s; nothing while the motors are off.

        A speed that is not 0 is sent each time: the robot may have refused it while its motors were off.
        """
        if not self._motors:
            self._sent_speeds = (0, 0)
            return
        wanted = round(v / self.factors.speed), round(math.degrees(w))
        for item, new, old in zip(("vel", "rvel"), wanted, self._sent_speeds, strict=True):
            if new or new != old:
                self.channel.set_target(ROBOT, item, new, origin)
        self._sent_speeds = wanted

    # ---------------------------------------------------------------- opening and closing

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the worker.  The option ``laser``, or ``?laser=`` in the url, names the port of the laser."""
        self._apply_options(settings)
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings.  Raises BadConfig."""
        self._apply_options(settings)
        super().configure(settings)

    def _apply_options(self, settings: RobotSettings) -> None:
        try:
            _, in_url = split_parameters(settings.url, P3dxOptions.in_url())
            self.options = P3dxOptions.of({**in_url, **settings.options})
        except (BadUrl, BadSetting) as error:
            raise BadConfig(f"p3dx: {error}") from error

    def close(self) -> None:
        """Close the laser and the camera, then the robot."""
        if self._parts:
            self.laser.close()
            self.camera.close()
        super().close()

    def summary(self) -> str:
        """Return the model, the name, the voltage, and the states of motors and laser."""
        parts = [f"{self.identity.model.sensed} {self.identity.name_.sensed!r}", f"{self.battery.voltage.sensed:.1f} V"]
        parts.append("motors on" if self._motors else "motors off")
        if self.laser.state.sensed != "off":
            parts.append(f"laser {self.laser.state.sensed}")
        return ", ".join(parts)

    # ---------------------------------------------------------------- identification and parts

    def on_found(self, message: m.Found) -> None:
        """Identify the robot; at the first connection, make its parts and build the tree."""
        (info,) = message.devices
        self._identify(info)
        if self._parts:
            self.x.update_ramps(info.config)
            self.yaw.update_ramps(info.config)
        else:
            self._make_parts(info)
            self._make_extras(info.config)
            self.host.run("P3dx.assemble();", "p3dx.u", self._on_tree_built)

    def _identify(self, info: ArcosRobotInfo) -> None:
        self.factors, known = factors_of(self.options.subclass or info.subclass)
        if not known:
            self.log.warning(
                "subclass %r is not known; its numbers are taken for mm: if that is wrong, set the option subclass",
                info.subclass,
            )
        config = info.config
        self.identity.show(name=info.name, model=info.subclass, serial=str(config["serial"]))
        self.robotType.sense(str(info.kind))
        self.firmware.sense(str(config["firmware"]))
        factors = self.factors
        fastest = int(config["trans_vel_max"]) / 1000 or factors.fastest
        fastest_turn = math.radians(int(config["rot_vel_max"])) or factors.fastest_turn
        self._fastest = min(factors.fastest, fastest), min(factors.fastest_turn, fastest_turn)
        self._bumpers = int(config["front_bumps"]), int(config["rear_bumps"])

    def _make_parts(self, info: ArcosRobotInfo) -> None:
        create, config = self.host.create, info.config
        self.odometry = create(P3dxOdometry)
        self.pilot = P3dxPilot(self, self.odometry, self.motion, self.log)
        simulator = config["serial"] in _SIMULATORS or info.name in _SIMULATORS
        mount = mount_of(self.options, self.factors, simulator=simulator)
        self.body = create(P3dxBody, None, self, self.drive.safety)
        self.wheels = create(P3dxWheel), create(P3dxWheel)
        self.sonar_ring = create(Sonars, None, self)
        self.sonars = [create(Sonar) for _ in SONARS]
        self.laser = create(
            P3dxLaser, None, mount, self.start_worker, self._watch_laser, self.offset
        )
        self.laser.log = self.log
        self.laser.tell_lost = partial(self.report.show_part, "laser")
        mechanics = CAMERAS[self.options.camera_model]()
        self.camera = create(P3dxCamera, None, self, mechanics, self.channel, self.options.camera_url, self.log)
        self.x = create(XSpeed, None, self, self._fastest[0])
        self.yaw = create(YawSpeed, None, self, self._fastest[1])
        self.x.update_ramps(config)
        self.yaw.update_ramps(config)
        self.update_limits(self.drive.limits)
        self.battery = create(
            P3dxBattery, None, int(config["low_battery"]) / 10, int(config["shutdown_volts"]) / 10
        )
        self.pilot.scanner = self.laser
        self.planner = self.pilot.planner = create(P3dxPlanner, None, self.pilot)
        parts = {"bodyPart": self.body, "odometryPart": self.odometry, "sonarSwitch": self.sonar_ring}
        parts |= {"laserPart": self.laser, "cameraPart": self.camera, "xPart": self.x, "yawPart": self.yaw}
        parts |= {"leftWheel": self.wheels[0], "rightWheel": self.wheels[1], "batteryPart": self.battery}
        for name, part in (parts | {"planner": self.planner}).items():
            self.put_slot(name, part)
        # The words that the manual also uses for these slots (26.2.9 and 26.3).
        for name, var in (
            ("speedDelta", self.x.speed), ("speedAlpha", self.yaw.speed), ("motorsLoad", self.body.load),
            ("laserLoad", self.laser.load), ("distMin", self.body.safetyDistanceMin),
            ("distMax", self.body.safetyDistanceMax), ("mapFileName", self.planner.mapFileName),
        ):  # fmt: skip
            var.add_slot(self.face, name)
        self._parts = True

    def _make_extras(self, config: Mapping[str, int | str]) -> None:
        """Make the parts that the controller says it has: gripper and gyro."""
        if config["gripper"]:
            self.gripper = self.host.create(Gripper, None, self)
            self.put_slot("gripperPart", self.gripper)
        if config["gyro_type"]:
            self.gyro = self.host.create(P3dxGyro)
            self._fuses_gyro = config["gyro_type"] == HOST_READS and self.options.gyro == FUSED
            self.put_slot("gyroPart", self.gyro)
            self._watch("gyro", 0.0)

    @function("sonarPart")
    def sonar_part(self, index: int) -> Sonar:
        """A sonar by its number, 0 to 15."""
        if not 0 <= index < len(self.sonars):
            raise ValueError(f"there is no sonar {index}; there are 0 to {len(self.sonars) - 1}")
        return self.sonars[index]

    def _on_tree_built(self, problem: str) -> None:
        if problem:
            self.arrival.answer(BadConfig(f"the tree of components could not be made: {problem}"))
        else:
            self._complete = True
            self.limits.send()
            self.arrival.wait_for_readings()

    _complete = False
    _is_still = True
    _has_fused = False
    """The gyro has turned the odometry: from then on it is no longer the controller's."""

    def is_complete(self) -> bool:
        """Return whether the tree is built and the robot has reported once."""
        return self._complete and self._last is not None

    # ---------------------------------------------------------------- measured values

    def on_samples(self, message: m.Samples) -> None:
        """Show pose, sonars, laser and other packets; then send the next speeds."""
        if not self._parts:
            return
        for device, values in message.values.items():
            stamp = message.times[device] + self.offset
            if device == ROBOT:
                self._update_pose(values, stamp)
            elif device == SONAR:
                self._update_sonars(values, stamp)
            elif device == "gyro" and self.gyro is not None and "rate" in values:
                self.store_packet(device, values)
                self.gyro.add_packet(values["rate"], values["temperature"], stamp, still=self._is_still)
            elif device == "laser":
                self.laser.show_simulated_scan(values["ranges"], stamp)
            else:
                self.store_packet(device, values)

    def _update_pose(self, values: Mapping[str, Any], stamp: float) -> None:
        factors = self.factors
        x, y, heading = values["x"] * factors.distance, values["y"] * factors.distance, values["theta"] * ANGLE
        old, self._last = self._last or (x, y, heading), (x, y, heading)
        middle = (heading + old[2]) / 2
        way = (x - old[0]) * math.cos(middle) + (y - old[1]) * math.sin(middle)
        left, right = values["left"] * factors.speed, values["right"] * factors.speed
        rotation = values.get("rotation")
        w = (right - left) / 2 / factors.half_track if rotation is None else math.radians(rotation / 10)
        v = (left + right) / 2
        stalled = bool(values["stall"] & 0x0101)
        self._is_still = v == 0 and left == right
        turned = self.gyro.take_angle(stamp) if self.gyro is not None and self._fuses_gyro else None
        if turned is not None:
            self._has_fused = True
        if self._has_fused:
            self.odometry.add_way(way, heading - old[2] if turned is None else turned, stamp)
        else:
            self.odometry.show_pose(x, y, heading, way, heading - old[2], stamp)
        for wheel, speed in zip(self.wheels, (left, right), strict=True):
            wheel.speed.sense(speed, stamp)
        self.x.speed.sense(v, stamp)
        self.yaw.speed.sense(w, stamp)
        self.battery.update_values(dict(values), stamp)
        if self.gripper is not None:
            self.gripper.show_state(values["gripper"], stamp)
        self._update_flags(values["flags"])
        self._update_contacts(values, stalled)
        self.pilot.show_state(State(stamp, v, w, self._clearance(FRONT), self._clearance(REAR), stalled))

    def _update_flags(self, flags: int) -> None:
        motors = bool(flags & sip.MOTORS_ON)
        self.body.load.sense(float(motors))
        self.body.stopButton.sense(bool(flags & sip.STOP_BUTTON))
        if self._motors and not motors:
            self._motors_wanted = False
            self.halt("the motors were switched off")
        self._motors = motors
        sonars = bool(flags & sip.SONARS_ON)
        if self.sonar_ring.load.sensed and not sonars:
            self._clear_sonars()
        self.sonar_ring.load.sense(float(sonars))

    def _update_contacts(self, values: Mapping[str, Any], stalled: bool) -> None:
        self.body.stalled.sense(stalled)
        self.body.digitalIn.sense(float(values["digital_in"]))
        self.body.digitalOut.sense(float(values["digital_out"]))
        front, rear = self._bumpers
        self.body.show_bumpers(sip.front_bumpers(values["stall"], front), sip.rear_bumpers(values["stall"], rear))

    def _update_sonars(self, values: Mapping[str, Any], stamp: float) -> None:
        unit, sonars = self.factors.range, self.sonars
        for number_, value in values.items():
            index = int(number_)
            if index < len(sonars):
                distance = value * unit
                sonars[index].val.sense(distance if distance < NO_ECHO else math.inf, stamp)

    def _clearance(self, sonars: range) -> float:
        """Return the distance in m to the nearest obstacle on one side; nan (a sonar that is off) counts as far."""
        room = min((value for index in sonars if (value := self.sonars[index].val.sensed) == value), default=math.inf)
        return min(room, self.laser.nearest()) if sonars is FRONT else room

    def obstacles(self) -> list[Point]:
        """Return the echoes of the front sonars as points in the robot's frame, in m."""
        echoes = []
        for index in FRONT:
            value, place = self.sonars[index].val.sensed, SONARS[index]
            if value < NO_ECHO - 0.1:
                x, y = math.cos(place.heading), math.sin(place.heading)
                echoes.append((place.x + value * x, place.y + value * y))
        return echoes

    def _clear_sonars(self) -> None:
        for sonar in self.sonars:
            sonar.val.sense(math.nan)

    def on_link_down(self, reason: str) -> None:
        """End all motion, and show the motors and the sonars as off."""
        if self._parts:
            self._motors = self._motors_wanted = False
            self.halt("the link was lost")
            self.body.load.sense(0.0)
            self.sonar_ring.load.sense(0.0)
            self._clear_sonars()
            if self.gripper is not None:
                self.gripper.forget_state()
            if self.gyro is not None:
                self.gyro.restart()
            for speed in (self.x.speed, self.yaw.speed, self.wheels[0].speed, self.wheels[1].speed):
                speed.sense(0.0)

    # ---------------------------------------------------------------- limits of the settings

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the robot itself: its limits are those of the whole base."""
        return {"robot": self} if self._parts else {}

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits from m/s, rad/s, m/s2 and V."""
        speed = 1 / self.factors.speed
        speeds, turns = (
            whole_counts(-most, most) for most in (limits.speed * speed, math.degrees(limits.turn))
        )
        table = {
            (ROBOT, "vel"): m.Limit(*speeds, limits.acceleration * speed, named("speed")),
            (ROBOT, "rvel"): m.Limit(*turns, name=named("turn")),
        }
        low, high = (volts * 10 for volts in limits.voltage)
        rows = (
            m.Threshold(ROBOT, "battery", low, named("voltage"), above=False, hysteresis=2),
            m.Threshold(ROBOT, "battery", high, named("voltage"), hysteresis=2),
        )
        return table, [row for row in rows if math.isfinite(row.level)]

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited speed or turn."""
        if message.item == "vel":
            self.x.limit_applied(message.applied * self.factors.speed, message.limit)
        else:
            self.yaw.limit_applied(math.radians(message.applied), message.limit)

    # ---------------------------------------------------------------- commands

    def switch_motors(self, on: bool) -> None:
        """Switch the motors; off ends all motion."""
        self.check_link()
        self._motors_wanted = on
        if not on:
            self.halt("the motors were switched off")
        origin = self.motion.origin()

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self._motors_wanted = self._motors
                self.guard.warn_writer(origin, "motors: %s", reply.error)
                if not self._motors:
                    self.halt(reply.error)

        self.channel.write(ROBOT, "enable", int(on), done)

    def switch_sonars(self, on: bool) -> None:
        """Switch all sonars on or off."""
        self.check_link()
        self.channel.write(ROBOT, "sonar", int(on), self.warn_on_failure("sonars"))

    def set_speed(self, v: float | None = None, w: float | None = None) -> None:
        """Drive at these speeds, m/s and rad/s; None keeps the present one.  Raises ValueError while the motors are
        off."""
        if v or w:
            self.check_motors()
        self.pilot.set_speeds(v, w)

    def order_gripper(self, code: int, origin: Origin) -> None:
        """Send an action of the gripper.  Raises ValueError while the link is down."""
        self.check_link()
        self.channel.write(GRIPPER, "action", code, self.warn_on_failure("gripper"), origin)

    def check_motors(self) -> None:
        """Raise MovementRefused under an emergency stop, which keeps the motors off; ValueError while they are off."""
        self.motion.check_device(ROBOT)
        if off := self.explain_off():
            raise ValueError(off)

    def explain_off(self) -> str:
        """Return why the robot does not drive while the link is down or the motors are off, else ""."""
        if not self.arrival.is_up():
            return LINK_DOWN
        on = self._motors or self._motors_wanted
        return "" if on else "the motors are off; switch them on first: P3dx.body.load = 1"

    def halt(self, why: str) -> None:
        """End all motion and cancel the planned path."""
        self.pilot.stop_following(why)

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """Cancel the planner's path and the motion of the drive."""
        if self._parts and (devices is None or ROBOT in devices):
            self._sent_speeds = (0, 0)
            self.pilot.drop_orders(reason)

    # ---------------------------------------------------------------- what urbiscript calls

    @function("driveAt")
    def drive_at(self, v: float, w: float) -> None:
        """Drive at these speeds, m/s forward and rad/s to the left, for the movements of the standard robot API."""
        self.set_speed(finite_number(v), finite_number(w))

    def stop(self) -> None:
        """Not bound here: the urbiscript function of this name also ends the movements that urbiscript steers."""
        super().stop()

    @function("halt")
    def halt_now(self) -> None:
        """Stop now; what is written afterwards moves the robot again."""
        super().stop()

    @function("moveTo")
    def move_to(self, goal: Any) -> None:
        """Go to [x, y, heading] of the map, along a planned path; see the planner's events."""
        self.planner.move_to(goal)

    def _watch_laser(self, wanted: bool) -> None:
        self.worker.send(m.Watch("laser", ("ranges",), 0.0 if wanted else None))
