"""The controller: its connection, its watchdog, its commands, and the SIPs it sends.

The connection counts SYNC0, SYNC1, SYNC2, then waits for OPEN; any other order starts it again, with an answer of
number 255.  While it is open, number 0 is PULSE, 1 OPEN and 2 CLOSE.  The watchdog suspends the motion after 2 s
without a packet, and the next packet continues it, as in a real controller.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.p3dx import numbers, sips
from urbihw_fakes.p3dx.body import BUMPERS, HALF_TRACK, Body
from urbihw_fakes.p3dx.codec import ArcosReader, Command, arcos_packet, parse_command
from urbihw_fakes.p3dx.extras import Extras
from urbihw_fakes.p3dx.simlaser import SimLaser
from urbihw_fakes.p3dx.sips import Settings, SipFields
from urbihw_fakes.p3dx.sonar import Sonars

BAUDS = (9600, 19200, 38400, 57600, 115200)
LOST_COUNT, RESET_NOTICE = 255, 0xFF
OPEN_STATE = 4
DISTANCE_CONV = {"p3dx": 0.485, "p3dx-sh": 1.0, "p2dx": 0.84, "p2de": 0.969, "p3at": 0.465, "p3at-sh": 1.0,
                 "amigo": 0.5083, "amigo-sh": 1.0}  # fmt: skip
RANGE_CONV = {"p2dx": 0.268, "p2de": 0.268}
SPEED_CONV = {"amigo": 0.6154}
UNIT = 2 * math.pi / 4096


class Arcos(Device):
    """A controller that drives ``body``; ``lock`` is held during every access to the robot.

    Attributes:
        state: of the connection: 0 to 2 the number of the SYNC that is expected, 3 OPEN expected, 4 open.
        powered, button: power, and whether the STOP button is pressed.
        low_firmware: SIPs end behind the digital outputs, as P2OS sends them.
    """

    def __init__(self, body: Body, settings: Settings | None = None, lock: threading.RLock | None = None) -> None:
        super().__init__()
        self.body = body
        self.settings = settings if settings is not None else Settings(front_bumps=BUMPERS, rear_bumps=BUMPERS)
        self.lock = lock if lock is not None else threading.RLock()
        self.sonars = Sonars(body)
        self.extras = Extras(body, self.settings.ticks_mm)
        self.sim_laser = SimLaser(body)
        self.state = 0
        self.powered = True
        self.button = False
        self.low_firmware = False
        self.host_baud = BAUDS[self.settings.host_baud]
        self.orders: list[Command] = []
        self.volts_pretended = 0
        self._reader = ArcosReader()
        self._next_sip = 0.0
        self._heard_at = 0.0
        self._shots_due = 0.0
        self._handlers = self._command_table()

    # --- the wire -------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Receive bytes; at another line speed they are noise and ignored."""
        if not self.powered or (self.baud is not None and self.baud != self.host_baud):
            return []
        with self.lock:
            self.body.advance(now)
            answers: list[Answer] = []
            for body in self._reader.feed(data):
                self._heard_at = now
                if self.body.halted:
                    self.body.halted = False
                if self.state < OPEN_STATE:
                    answers += self._handle_sync(body, now)
                else:
                    heard = parse_command(body)
                    if heard is not None:
                        answers += self._execute_command(heard, now)
            return answers

    def due(self) -> float | None:
        """When the next SIP goes out."""
        return self._next_sip if self.state == OPEN_STATE and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """Advance to `now`; SIPs that were missed are not sent later."""
        with self.lock:
            self.body.advance(now)
            if self.state == OPEN_STATE and now - self._heard_at > self.settings.watchdog / 1000:
                self.body.halted = True
            if self.state != OPEN_STATE or not self.powered or now < self._next_sip:
                return []
            cycle = self.settings.sip_cycle / 1000
            self.extras.gripper.advance(cycle)
            self._next_sip = max(self._next_sip + cycle, now + cycle / 2)
            bodies = [self.sip().body(), *self.extras.bodies(), *self.sim_laser.bodies()]
            return [answer for body in bodies for answer in self._send_packet(body, now)]

    def _send_packet(self, body: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, arcos_packet(body))
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []

    # --- the connection -------------------------------------------------------------------------------------------

    def _handle_sync(self, body: bytes, now: float) -> list[Answer]:
        number = body[0]
        if self.state == 3 and number == numbers.OPEN:
            self.state = OPEN_STATE
            self._next_sip = now + self.settings.sip_cycle / 1000
            return []
        if number != self.state or self.state == 3:
            # A SYNC0 always restarts the handshake.
            self.state = 1 if number == numbers.SYNC0 else 0
            return self._send_packet(b"\0" if number == numbers.SYNC0 else bytes([LOST_COUNT]), now)
        self.state += 1
        return self._send_packet(body[:1] if number < 2 else sips.names(self.settings), now)

    def _close(self) -> None:
        self.body.stop()
        self.extras.drop_requests()
        self.sim_laser.mode = 0
        self.state = 0

    def reset(self, now: float) -> list[Answer]:
        """Restart the controller; it sends a reset notice."""
        self._close()
        self.body.switch_motors(False)
        return self._send_packet(bytes([RESET_NOTICE]), now)

    def power_off(self, now: float, who: int | None = None) -> None:
        """Power off: the robot coasts to a stop, and the connection is lost."""
        with self.lock:
            self.body.advance(now)
            self.powered = False
            self._close()
            self.body.switch_motors(False)

    def power_on(self, now: float, who: int | None = None) -> None:
        """On again, as after the main switch."""
        self.powered = True

    # --- commands -------------------------------------------------------------------------------------------------

    def _execute_command(self, heard: Command, now: float) -> list[Answer]:
        self.orders.append(heard)
        del self.orders[:-1000]
        if heard.number == numbers.CLOSE:
            self._close()
        elif heard.number == numbers.CONFIG:
            return self._send_packet(self.settings.body(), now)
        elif heard.number == numbers.RESET:
            return self.reset(now)
        elif heard.number in self.extras.COMMANDS:
            self.extras.execute_command(heard)
        elif heard.number in self.sim_laser.COMMANDS:
            self.sim_laser.execute_command(heard)
        elif heard.number in self._handlers:
            self._handlers[heard.number](heard)
        return []

    def _command_table(self) -> dict[int, Callable[[Command], None]]:
        forward, turning = self.body.forward, self.body.turning
        millimetres, degrees = 0.001, math.radians(1)
        return {
            numbers.POLLING: lambda heard: self.sonars.poll(heard.text),
            numbers.ENABLE: lambda heard: self.body.switch_motors(bool(heard.value) and not self.button),
            numbers.SETA: lambda heard: _ramp(forward, heard.value * millimetres),
            numbers.SETV: lambda heard: setattr(forward, "most", abs(heard.value) * millimetres),
            numbers.SETO: lambda heard: setattr(self.body, "odometry", (0.0, 0.0, 0.0)),
            numbers.MOVE: lambda heard: forward.set_distance(heard.value * millimetres),
            numbers.ROTATE: lambda heard: turning.set_speed(heard.value * degrees),
            numbers.SETRV: lambda heard: setattr(turning, "most", abs(heard.value) * degrees),
            numbers.VEL: lambda heard: forward.set_speed(heard.value * millimetres),
            numbers.HEAD: lambda heard: self._turn_to(heard.value * degrees),
            numbers.DHEAD: lambda heard: turning.set_distance(heard.value * degrees),
            numbers.RVEL: lambda heard: turning.set_speed(heard.value * degrees),
            numbers.SETRA: lambda heard: _ramp(turning, heard.value * degrees),
            numbers.SONAR: lambda heard: setattr(self.sonars, "on", bool(heard.value & 1)),
            numbers.STOP: lambda heard: self.body.stop(),
            numbers.VEL2: self._set_wheel_speeds,
            numbers.BUMPSTALL: lambda heard: setattr(self.body, "bump_stall", heard.value),
            numbers.HOSTBAUD: self._change_baud,
            numbers.E_STOP: lambda heard: self._emergency_stop(),
            numbers.SIM_SET_POSE: lambda heard: None,
            numbers.SIM_RESET: lambda heard: self._reset_to_home(),
            numbers.BATTEST: lambda heard: setattr(self, "volts_pretended", heard.value),
        }

    def _turn_to(self, heading: float) -> None:
        away = heading - self.body.odometry[2]
        self.body.turning.set_distance((away + math.pi) % (2 * math.pi) - math.pi)

    def _set_wheel_speeds(self, heard: Command) -> None:
        step = 0.02
        left, right = (_byte(heard.value >> shift) * step for shift in (8, 0))
        self.body.forward.set_speed((left + right) / 2)
        self.body.turning.set_speed((right - left) / 2 / 0.1786)

    def _change_baud(self, heard: Command) -> None:
        if self.settings.auto_baud and 0 <= heard.value < len(BAUDS):
            self.host_baud = BAUDS[heard.value]

    def _emergency_stop(self) -> None:
        self.body.stop()
        self.body.forward.halt()
        self.body.turning.halt()

    def _reset_to_home(self) -> None:
        self._emergency_stop()
        self.body.set_pose(*self.body.world.home)
        self.body.odometry = (0.0, 0.0, 0.0)

    # --- the SIP --------------------------------------------------------------------------------------------------

    def press_stop_button(self, pressed: bool) -> None:
        """Press or release the STOP button: the motors stay off until they are enabled."""
        with self.lock:
            self.button = pressed
            if pressed:
                self.body.switch_motors(False)

    def sip(self) -> SipFields:
        """Return the fields of the present SIP, with the sonars that fired since the last one."""
        body, settings = self.body, self.settings
        x, y, theta = body.odometry
        left, right = body.wheels
        distance = DISTANCE_CONV.get(settings.subclass, 1.0)
        speed = SPEED_CONV.get(settings.subclass, 1.0)
        volts = self.volts_pretended or round(body.volts * 10)
        self._shots_due += settings.sip_cycle / settings.sonar_cycle
        shots = int(self._shots_due)
        self._shots_due -= shots
        unit = RANGE_CONV.get(settings.subclass, 1.0)
        heard = self.sonars.fire(shots)
        return SipFields(
            moving=body.moving,
            x=round(x * 1000 / distance),
            y=round(y * 1000 / distance),
            theta=max(-2048, min(2047, round(theta / UNIT))),
            left=round(left * 1000 / speed),
            right=round(right * 1000 / speed),
            battery=min(volts, 255),
            stall=self._stall(),
            flags=body.motors | (0b11110 if self.sonars.on else 0) | self.button << 5,
            compass=round(math.degrees(-theta) % 360 / 2) % 180,
            sonars=[(number, round(metres * 1000 / unit)) for number, metres in heard],
            gripper=self.extras.gripper.state if settings.gripper else 0,
            digital_in=self.extras.digital_in,
            digital_out=self.extras.digital_out,
            tail={}
            if self.low_firmware
            else {
                "battery_x10": volts,
                "charge_state": 0,
                "rotation": round(math.degrees((right - left) / 2 / HALF_TRACK) * 10),
                "faults": 0,
            },
        )

    def _stall(self) -> int:
        left, right = self.body.stalled
        rear = sum(1 << BUMPERS - number for number in self.body.rear)
        front = sum(1 << number + 1 for number in self.body.front)
        return left | rear | (right | front) << 8


def _ramp(axis: object, value: float) -> None:
    """Set the acceleration (positive value) or the deceleration (negative value) of an axis."""
    setattr(axis, "faster" if value > 0 else "slower", max(abs(value), 0.001))


def _byte(value: int) -> int:
    value &= 0xFF
    return value - 256 if value > 127 else value
