"""The controller: its connection, its watchdog, its commands, and the SIPs it sends.

The connection counts SYNC0, SYNC1, SYNC2, then waits for OPEN; whatever comes out of order starts it again, with an
answer of number 255.  While it is open, number 0 is PULSE, 1 OPEN and 2 CLOSE.  The watchdog holds a robot that hears
nothing for 2 s, and lets it go on as before with the next packet: that is what a real one does.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.p3dx import sips
from urbihw_fakes.p3dx.body import BUMPERS, Body
from urbihw_fakes.p3dx.codec import ArcosReader, Order, arcos_packet, order
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
    """A controller that drives ``body``; ``lock`` is held while anything of the robot is touched.

    Attributes:
        state: how far the connection is: 0 to 2 the SYNC that is waited for, 3 OPEN, 4 open.
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
        self.orders: list[Order] = []
        self.volts_pretended = 0
        self._reader = ArcosReader()
        self._next_sip = 0.0
        self._heard_at = 0.0
        self._shots_owed = 0.0
        self._handlers = self._table()

    # --- the wire -------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes; a controller that listens at another speed hears only noise."""
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
                    answers += self._greet(body, now)
                else:
                    heard = order(body)
                    if heard is not None:
                        answers += self._obey(heard, now)
            return answers

    def due(self) -> float | None:
        """When the next SIP goes out."""
        return self._next_sip if self.state == OPEN_STATE and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """Let time pass; SIPs that are late are not sent after."""
        with self.lock:
            self.body.advance(now)
            if self.state == OPEN_STATE and now - self._heard_at > self.settings.watchdog / 1000:
                self.body.halted = True
            if self.state != OPEN_STATE or not self.powered or now < self._next_sip:
                return []
            cycle = self.settings.sip_cycle / 1000
            self._next_sip = max(self._next_sip + cycle, now + cycle / 2)
            bodies = [self.sip().body(), *self.extras.bodies(), *self.sim_laser.bodies()]
            return [answer for body in bodies for answer in self._say(body, now)]

    def _say(self, body: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, arcos_packet(body))
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []

    # --- the connection -------------------------------------------------------------------------------------------

    def _greet(self, body: bytes, now: float) -> list[Answer]:
        number = body[0]
        if self.state == 3 and number == 1:
            self.state = OPEN_STATE
            self._next_sip = now + self.settings.sip_cycle / 1000
            return []
        if number != self.state or self.state == 3:
            # A SYNC0 always begins anew.
            self.state = 1 if number == 0 else 0
            return self._say(b"\0" if number == 0 else bytes([LOST_COUNT]), now)
        self.state += 1
        return self._say(body[:1] if number < 2 else sips.names(self.settings), now)

    def _close(self) -> None:
        self.body.stop()
        self.extras.forget()
        self.sim_laser.mode = 0
        self.state = 0

    def reset(self, now: float) -> list[Answer]:
        """The controller starts again; it says so."""
        self._close()
        self.body.switch(False)
        return self._say(bytes([RESET_NOTICE]), now)

    def power_off(self, now: float, who: int | None = None) -> None:
        """Dark: it coasts to a stop and forgets its connection."""
        with self.lock:
            self.body.advance(now)
            self.powered = False
            self._close()
            self.body.switch(False)

    def power_on(self, now: float, who: int | None = None) -> None:
        """On again, as after the main switch."""
        self.powered = True

    # --- commands -------------------------------------------------------------------------------------------------

    def _obey(self, heard: Order, now: float) -> list[Answer]:
        self.orders.append(heard)
        del self.orders[:-1000]
        if heard.number == 2:
            self._close()
        elif heard.number == 18:
            return self._say(self.settings.body(), now)
        elif heard.number == 253:
            return self.reset(now)
        elif heard.number in self.extras.ORDERS:
            self.extras.obey(heard)
        elif heard.number in self.sim_laser.ORDERS:
            self.sim_laser.obey(heard)
        elif heard.number in self._handlers:
            self._handlers[heard.number](heard)
        return []

    def _table(self) -> dict[int, Callable[[Order], None]]:
        forward, turning = self.body.forward, self.body.turning
        millimetres, degrees = 0.001, math.radians(1)
        return {
            3: lambda heard: self.sonars.poll(heard.text),
            4: lambda heard: self.body.switch(bool(heard.value) and not self.button),
            5: lambda heard: _ramp(forward, heard.value * millimetres),
            6: lambda heard: setattr(forward, "most", abs(heard.value) * millimetres),
            7: lambda heard: setattr(self.body, "odometry", (0.0, 0.0, 0.0)),
            8: lambda heard: forward.go(heard.value * millimetres),
            9: lambda heard: turning.want(heard.value * degrees),
            10: lambda heard: setattr(turning, "most", abs(heard.value) * degrees),
            11: lambda heard: forward.want(heard.value * millimetres),
            12: lambda heard: self._turn_to(heard.value * degrees),
            13: lambda heard: turning.go(heard.value * degrees),
            21: lambda heard: turning.want(heard.value * degrees),
            23: lambda heard: _ramp(turning, heard.value * degrees),
            28: lambda heard: setattr(self.sonars, "on", bool(heard.value & 1)),
            29: lambda heard: self.body.stop(),
            32: self._wheels,
            44: lambda heard: setattr(self.body, "bump_stall", heard.value),
            50: self._change_baud,
            55: lambda heard: self._emergency(),
            224: lambda heard: None,
            225: lambda heard: self._to_start(),
            250: lambda heard: setattr(self, "volts_pretended", heard.value),
        }

    def _turn_to(self, heading: float) -> None:
        away = heading - self.body.odometry[2]
        self.body.turning.go((away + math.pi) % (2 * math.pi) - math.pi)

    def _wheels(self, heard: Order) -> None:
        step = 0.02
        left, right = (_byte(heard.value >> shift) * step for shift in (8, 0))
        self.body.forward.want((left + right) / 2)
        self.body.turning.want((right - left) / 2 / 0.1786)

    def _change_baud(self, heard: Order) -> None:
        if self.settings.auto_baud and 0 <= heard.value < len(BAUDS):
            self.host_baud = BAUDS[heard.value]

    def _emergency(self) -> None:
        self.body.stop()
        self.body.forward.halt()
        self.body.turning.halt()

    def _to_start(self) -> None:
        self._emergency()
        self.body.place(*self.body.world.home)
        self.body.odometry = (0.0, 0.0, 0.0)

    # --- the SIP --------------------------------------------------------------------------------------------------

    def press(self, pressed: bool) -> None:
        """Press the STOP button, or let it go: the motors stay off until they are enabled."""
        with self.lock:
            self.button = pressed
            if pressed:
                self.body.switch(False)

    def sip(self) -> SipFields:
        """What the controller would say now; the sonars that fired since the last SIP are in it."""
        body, settings = self.body, self.settings
        x, y, theta = body.odometry
        left, right = body.wheels
        distance = DISTANCE_CONV.get(settings.subclass, 1.0)
        speed = SPEED_CONV.get(settings.subclass, 1.0)
        volts = self.volts_pretended or round(body.volts * 10)
        self._shots_owed += settings.sip_cycle / settings.sonar_cycle
        shots = int(self._shots_owed)
        self._shots_owed -= shots
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
            digital_in=self.extras.digital_in,
            digital_out=self.extras.digital_out,
            tail={}
            if self.low_firmware
            else {
                "battery_x10": volts,
                "charge_state": 0,
                "rotation": round(math.degrees(body.turning.speed) * 10),
                "faults": 0,
            },
        )

    def _stall(self) -> int:
        left, right = self.body.stalled
        rear = sum(1 << BUMPERS - number for number in self.body.rear)
        front = sum(1 << number + 1 for number in self.body.front)
        return left | rear | (right | front) << 8


def _ramp(axis: object, value: float) -> None:
    """A positive value says how hard to speed up, a negative one how hard to brake."""
    setattr(axis, "faster" if value > 0 else "slower", max(abs(value), 0.001))


def _byte(value: int) -> int:
    value &= 0xFF
    return value - 256 if value > 127 else value
