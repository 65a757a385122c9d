"""The object ``P3dx``: the robot as urbiscript sees it, and the way between its worker and its parts.

With each packet of the robot: the parts are told what was measured, the ``Drive`` is asked how fast to go, and what it
says is ordered.  The tree of components (``P3dx.body``, ``robot``) is put together in ``p3dx.u``.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import take_off
from urbihw.kernel.uobject import BadConfig, NotReady, Opened, RobotSettings, finite_number, function, reading
from urbihw.navigation.drive import Drive, Motion, State
from urbihw.navigation.frames import Point
from urbihw.platforms.base import Limited, LimitTable, Named
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.p3dx import sip
from urbihw.platforms.p3dx.arcos import ArcosRobot
from urbihw.platforms.p3dx.devices import Battery, Body, Camera, Sonar, Sonars, Wheel, XSpeed, YawSpeed
from urbihw.platforms.p3dx.factors import ANGLE, FACTORS, NO_ECHO, SONARS, Factors, factors_of
from urbihw.platforms.p3dx.handshake import RobotInfo
from urbihw.platforms.p3dx.navigation import P3dxLaser, P3dxOdometry, P3dxPlanner, laser_url
from urbihw.platforms.p3dx.options import Options
from urbihw.settings import BadSetting

ROBOT, SONAR = "robot", "sonar"
FRONT, REAR = range(8), range(8, 16)
DEFAULT_BUMPERS = 5
_SIMULATORS = ("SIM", "MobileSim")


class P3dx(ArcosRobot):
    """A Pioneer 3-DX, or another robot that speaks ARCOS."""

    uname = "P3dxRobot"
    classes = (
        Body, Wheel, P3dxOdometry, Sonar, Sonars, P3dxLaser, Camera, XSpeed, YawSpeed, Battery, P3dxPlanner,
    )  # fmt: skip

    robotType = reading("")
    name_ = reading("", "name")
    model = reading("")
    serial = reading("")
    firmware = reading("")

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.drive = Drive(self._motion_ended)
        self.options = Options()
        self.factors: Factors = FACTORS["p3dx-sh"]
        self.state = State(0.0, 0.0, 0.0)
        self._parts = False
        self._last: tuple[float, float, float] | None = None
        self._motors = self._motors_wanted = False
        self._aimed = (0, 0)
        self._origin = self.motion.own()
        self._by_hand = False

    # ---------------------------------------------------------------- what the navigator asks, beside the motions

    @property
    def scanner(self) -> P3dxLaser:
        """See ``navigation.base.Base``."""
        return self.laser

    @property
    def navigation(self) -> Options:
        """See ``navigation.base.Base``."""
        return self.options

    @property
    def radius(self) -> float:
        """See ``navigation.base.Base``."""
        return self.factors.radius

    # ---------------------------------------------------------------- opening and closing

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """See ``Robot``.  The laser's line is named by the option ``laser`` or by ``?laser=`` in the url."""
        self._take_options(settings)
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """See ``Robot``."""
        self._take_options(settings)
        super().configure(settings)

    def _take_options(self, settings: RobotSettings) -> None:
        try:
            _, in_url = take_off(settings.url, Options.in_url())
            self.options = Options.of({**in_url, **settings.options})
        except (BadUrl, BadSetting) as error:
            raise BadConfig(f"p3dx: {error}") from error

    def close(self) -> None:
        """See ``Robot``."""
        if self._parts:
            self.laser.close()
        super().close()

    def status(self) -> str:
        """See ``Robot``."""
        if not self.link.sensed:
            return "link down"
        parts = [f"{self.model.sensed} {self.name_.sensed!r}", f"{self.battery.voltage.sensed:.1f} V"]
        parts.append("motors on" if self._motors else "motors off")
        if self.laser.state.sensed != "off":
            parts.append(f"laser {self.laser.state.sensed}")
        return ", ".join(parts)

    # ---------------------------------------------------------------- what is there

    def on_found(self, message: m.Found) -> None:
        """See ``WiredRobot``."""
        (info,) = message.devices
        self._identify(info)
        if not self._parts:
            self._make_parts(info)
            self.host.run("P3dx.assemble();", "p3dx.u", self._assembled)

    def _identify(self, info: RobotInfo) -> None:
        self.factors, known = factors_of(self.options.subclass or info.subclass)
        if not known:
            self.log.warning(
                "subclass %r is not known; its numbers are taken for mm: if that is wrong, set the option subclass",
                info.subclass,
            )
        config = info.config
        identity = {"robotType": info.kind, "name": info.name, "model": info.subclass}
        for slot, value in (identity | {"serial": config["serial"], "firmware": config["firmware"]}).items():
            self.variables[slot].sense(str(value))
        limits, factors = self.drive.limits, self.factors
        limits.fastest = min(factors.fastest, int(config["trans_vel_max"]) / 1000 or factors.fastest)
        limits.fastest_turn = min(
            factors.fastest_turn, math.radians(int(config["rot_vel_max"])) or factors.fastest_turn
        )
        limits.braking = int(config["trans_decel"]) / 1000 or limits.braking
        limits.braking_turn = math.radians(int(config["rot_decel"])) or limits.braking_turn
        self._bumpers = int(config["front_bumps"]), int(config["rear_bumps"])

    def _make_parts(self, info: RobotInfo) -> None:
        create, limits, config = self.host.create, self.drive.limits, info.config
        simulator = config["serial"] in _SIMULATORS or info.name in _SIMULATORS
        laser = laser_url(self.options.laser, simulator=simulator)
        self.body = create(Body, None, self, self.drive.safety)
        self.wheels = create(Wheel), create(Wheel)
        self.odometry = create(P3dxOdometry)
        self.sonar_ring = create(Sonars, None, self)
        self.sonars = [create(Sonar) for _ in SONARS]
        self.laser = create(
            P3dxLaser, None, laser, self.factors.laser_x, self.start_worker, self._watch_laser, self.offset
        )
        self.laser.log = self.log
        self.camera = create(Camera, None, self)
        self.x = create(XSpeed, None, self, limits.fastest)
        self.yaw = create(YawSpeed, None, self, limits.fastest_turn)
        self.battery = create(
            Battery, None, int(config["low_battery"]) / 10, int(config["shutdown_volts"]) / 10
        )
        self.planner = create(P3dxPlanner, None, self)
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
            var.put(self.face, name)
        self._parts = True

    @function("sonarPart")
    def sonar_part(self, index: int) -> Sonar:
        """A sonar by its number, 0 to 15."""
        if not 0 <= index < len(self.sonars):
            raise ValueError(f"there is no sonar {index}; there are 0 to {len(self.sonars) - 1}")
        return self.sonars[index]

    def _assembled(self, problem: str) -> None:
        if problem:
            self.answer(NotReady(f"the tree of components could not be made: {problem}"))
        else:
            self._complete = True
            self.send_limits()
            self.wait_for_readings()

    _complete = False

    def whole(self) -> bool:
        """See ``WiredRobot``."""
        return self._complete and self._last is not None

    # ---------------------------------------------------------------- what was measured

    def on_samples(self, message: m.Samples) -> None:
        """See ``WiredRobot``."""
        if not self._parts:
            return
        for device, values in message.values.items():
            stamp = message.times[device] + self.offset
            if device == ROBOT:
                self._take_robot(values, stamp)
            elif device == SONAR:
                self._take_sonars(values, stamp)
            elif device == "laser":
                self.laser.show_simulated_scan(values["ranges"], stamp)
            else:
                self.take_extra(device, values)
        if ROBOT in message.values:
            self._order()
            self.planner.pose_changed()

    def _take_robot(self, values: Mapping[str, Any], stamp: float) -> None:
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
        self.state = State(stamp, v, w, self._room(FRONT), self._room(REAR), stalled)
        self.odometry.show_pose(x, y, heading, way, heading - old[2], stamp)
        for wheel, speed in zip(self.wheels, (left, right), strict=True):
            wheel.speed.sense(speed, stamp)
        self.x.speed.sense(v, stamp)
        self.yaw.speed.sense(w, stamp)
        self.battery.show(dict(values), stamp)
        self._take_flags(values["flags"])
        self._take_contacts(values, stalled)

    def _take_flags(self, flags: int) -> None:
        motors = bool(flags & sip.MOTORS_ON)
        self.body.load.sense(float(motors))
        self.body.stopButton.sense(bool(flags & sip.STOP_BUTTON))
        if self._motors and not motors:
            self._motors_wanted = False
            self.halt("the motors were switched off")
        self._motors = motors
        sonars = bool(flags & sip.SONARS_ON)
        if self.sonar_ring.load.sensed and not sonars:
            self._forget_sonars()
        self.sonar_ring.load.sense(float(sonars))

    def _take_contacts(self, values: Mapping[str, Any], stalled: bool) -> None:
        self.body.stalled.sense(stalled)
        self.body.digitalIn.sense(float(values["digital_in"]))
        self.body.digitalOut.sense(float(values["digital_out"]))
        front, rear = self._bumpers
        self.body.show_bumpers(sip.front_bumpers(values["stall"], front), sip.rear_bumpers(values["stall"], rear))

    def _take_sonars(self, values: Mapping[str, Any], stamp: float) -> None:
        unit, sonars = self.factors.range, self.sonars
        for number_, value in values.items():
            index = int(number_)
            if index < len(sonars):
                sonars[index].val.sense(value * unit, stamp)

    def _room(self, sonars: range) -> float:
        """m to the nearest thing on one side; nan (a sonar that is off) is far."""
        room = min((value for index in sonars if (value := self.sonars[index].val.sensed) == value), default=math.inf)
        return min(room, self.laser.nearest()) if sonars is FRONT else room

    def obstacles(self) -> list[Point]:
        """See ``navigation.base.Base``: what the front sonars hear now."""
        echoes = []
        for index in FRONT:
            value, place = self.sonars[index].val.sensed, SONARS[index]
            if value < NO_ECHO - 0.1:
                x, y = math.cos(place.heading), math.sin(place.heading)
                echoes.append((place.x + value * x, place.y + value * y))
        return echoes

    def _forget_sonars(self) -> None:
        for sonar in self.sonars:
            sonar.val.sense(math.nan)

    def on_link_down(self, reason: str) -> None:
        """See ``WiredRobot``."""
        if self._parts:
            self._motors = self._motors_wanted = False
            self.halt("the link was lost")
            self.body.load.sense(0.0)
            self.sonar_ring.load.sense(0.0)
            self._forget_sonars()
            for speed in (self.x.speed, self.yaw.speed, self.wheels[0].speed, self.wheels[1].speed):
                speed.sense(0.0)

    # ---------------------------------------------------------------- limits of the settings

    def limited_devices(self) -> Mapping[str, Limited]:
        """See ``WiredRobot``: the robot itself."""
        return {"robot": self} if self._parts else {}

    def limits_in_counts(self, limits: DeviceLimits, named: Named) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.base.Limited``: m/s, rad/s and m/s2."""
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
        """See ``platforms.base.Limited``."""
        if message.item == "vel":
            self.x.limit_applied(message.applied * self.factors.speed, message.limit)
        else:
            self.yaw.limit_applied(math.radians(message.applied), message.limit)

    # ---------------------------------------------------------------- what is ordered

    def switch_motors(self, on: bool) -> None:
        """See ``devices.Commands``."""
        self.check_link()
        self._motors_wanted = on
        if not on:
            self.halt("the motors were switched off")
        self.wire.write(ROBOT, "enable", int(on), self._motors_answered)

    def _motors_answered(self, reply: m.Reply) -> None:
        if not reply.ok:
            self._motors_wanted = self._motors
            self.log.warning("motors: %s", reply.error)
            if not self._motors:
                self.halt(reply.error)

    def switch_sonars(self, on: bool) -> None:
        """See ``devices.Commands``."""
        self.check_link()
        self.wire.write(ROBOT, "sonar", int(on), self.warn("sonars"))

    def set_speed(self, v: float | None = None, w: float | None = None) -> None:
        """See ``devices.Commands``."""
        self._by_hand = True
        self._go_at(v, w)

    def _go_at(self, v: float | None, w: float | None) -> None:
        if v or w:
            self.check_motors()
        self._origin = self.motion.admit(ROBOT)
        self.planner.cancel()
        self.drive.set(v, w)
        self._order()

    def check_motors(self) -> None:
        """See ``navigation.base.Base``."""
        if off := self.explain_off():
            raise ValueError(off)

    def explain_off(self) -> str:
        """See ``devices.Commands``."""
        on = self._motors or self._motors_wanted
        return "" if on else "the motors are off; switch them on first: P3dx.body.load = 1"

    def begin_motion(self, motion: Motion) -> None:
        """See ``navigation.base.Base``."""
        self.drive.start(motion)
        self._order()

    def halt(self, why: str) -> None:
        """Nothing shall move any more, and nothing waits to move."""
        self.planner.cancel()
        self.drive.halt(why)
        self._order()

    def _order(self) -> None:
        """Order the speeds that the drive wants now; until the motors are on, none."""
        if not self._motors:
            self._aimed = (0, 0)
            return
        if not self.motion.is_live(self._origin):
            # What it was told belongs to another epoch, or to a client that is gone.
            self._origin = self.motion.own()
            self.drive.halt(self.motion.reason)
        v, w = self.drive.step(self.state)
        wanted = round(v / self.factors.speed), round(math.degrees(w))
        for item, new, old in zip(("vel", "rvel"), wanted, self._aimed, strict=True):
            if new or new != old:
                self.wire.aim(ROBOT, item, new, self._origin)
        self._aimed = wanted

    def claim_motion(self) -> None:
        """See ``navigation.base.Base``."""
        self._origin = self.motion.admit(ROBOT)

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """See ``WiredRobot``."""
        if self._parts:
            self.planner.cancel()
            self.drive.halt(reason)
            self._aimed = (0, 0)

    def _motion_ended(self, motion: Motion, how: str) -> None:
        self.planner.motion_ended(motion, how)

    # ---------------------------------------------------------------- what urbiscript calls

    @function("driveAt")
    def drive_at(self, v: float, w: float) -> None:
        """Go at these speeds for a movement that is steered by urbiscript; not once a speed was written by hand."""
        if self._by_hand:
            raise ValueError("a speed was written meanwhile")
        self._go_at(finite_number(v), finite_number(w))

    @function("takeOver")
    def take_over(self) -> None:
        """A movement that is steered by urbiscript begins."""
        self._by_hand = False
        self.planner.cancel()

    def halt_all(self, reason: str) -> None:
        """See ``WiredRobot``."""
        self._by_hand = False
        super().halt_all(reason)

    def stop(self) -> None:
        """Not bound here: the urbiscript function of this name also ends the movements that urbiscript steers."""
        super().stop()

    @function("halt")
    def halt_now(self) -> None:
        """Stop now; what is written afterwards moves the robot again."""
        super().stop()

    @function("startPath")
    def start_path(self, goal: Any) -> None:
        """Go to [x, y, heading] of the map, along a planned path; see the planner's events."""
        self.planner.move_to(goal)

    def _watch_laser(self, wanted: bool) -> None:
        self.tell(m.Watch("laser", ("ranges",), 0.0 if wanted else None))
