"""What drives the wire of a Pioneer's controller: a family for ``urbihw.buses.driver``.

Devices and their items, all raw:

    robot     x y theta (counted on beyond their wrapping), left right battery stall flags compass ... and what the tail
              of a SIP holds; targets: vel (mm/s), rvel (deg/s)
    sonar     "0" to "31": the readings of those that fired
    encoder io gyro joystick gripper battery aux1 aux2: their packets, sent while watched
    laser     ranges (mm, right to left) of MobileSim's laser, sent while watched

Requests: "write" of ("robot", "enable") and ("robot", "sonar") answers when the flags show it; "write" of ("command",
name) sends any command of ``commands`` that does not drive; "read" gives the latest value of an item.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Final

from urbihw.buses.driver import Driver, never
from urbihw.buses.errors import BadFrame, BadValue, LinkGone
from urbihw.buses.link import Link, Port, byte_link
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Targets, Watch
from urbihw.platforms.p3dx import packets, sip
from urbihw.platforms.p3dx.commands import DRIVING, encode
from urbihw.platforms.p3dx.handshake import Greeting
from urbihw.platforms.p3dx.options import Options
from urbihw.platforms.p3dx.protocol import LARGEST, Framer
from urbihw.platforms.p3dx.setpoint import SetPoint, Switch

ROBOT, SONAR, LASER, COMMAND = "robot", "sonar", "laser", "command"
PULSE_AFTER: Final = 0.5
"""Seconds without a command after which a PULSE keeps the controller's watchdog (2 s) quiet, as ARIA does."""
BLIND: Final = 0.5
"""Seconds without a packet after which a robot that drives is stopped: five of its reports."""
SILENCE: Final = 2.0
"""Seconds without a packet after which the connection counts as lost."""
PACE: Final = 0.004
"""Seconds between two commands (the AROS manual asks for 3 to 5 ms)."""
_SWITCHES: Final = {"enable": ("ENABLE", sip.MOTORS_ON), "sonar": ("SONAR", sip.SONARS_ON)}
_SIP_ITEMS: Final = (
    "moving", "left", "right", "battery", "stall", "control", "flags", "compass", "gripper", "analog_port", "analog",
    "digital_in", "digital_out",
)  # fmt: skip

Values = dict[Any, dict[str, Any]]


class ArcosDriver(Driver):
    """See the head of this file, and ``urbihw.buses.driver.Driver``."""

    url_parameters = Options.in_url()

    def __init__(self) -> None:
        self._link: Link | None = None
        self._framer = Framer()
        self._odometer = sip.Odometer()
        self._sim_laser = packets.SimLaser()
        self._options = Options()
        self._torque_off = False
        self._speeds = {"vel": SetPoint("VEL"), "rvel": SetPoint("RVEL")}
        self._queue: deque[bytes] = deque()
        self._switches: list[Switch] = []
        self._failed: list[FromWorker] = []
        self._watched: set[str] = set()
        self._latest: Values = {}
        self._flags = 0
        self._heard_at = self._sent_at = 0.0
        self._unreadable = 0

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take the settings.  Raises BadSetting."""
        self._options = Options.of(settings.options)
        self._torque_off = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Connect to the controller.  Raises Unavailable, BadUrl, LinkGone."""
        link = byte_link(port)
        self._framer = Framer()
        info = Greeting(link, self._framer).greet(self._options.host_baud)
        self._link = link
        self._odometer.restart()
        self._sim_laser = packets.SimLaser()
        self._unreadable = 0
        self._heard_at = self._sent_at = link.clock.now()
        for speed in self._speeds.values():
            speed.halt()
        self._queue.clear()
        for device in sorted(self._watched):
            self._queue.append(_request_of(device, True))
        failed, self._failed = self._failed, []
        return [Found((info,)), *failed]

    def detach(self) -> None:
        """The link is gone: nothing that was to be done survives it but the watches."""
        self._link = None
        self._queue.clear()
        self._failed += [Reply(switch.reply_id, False, error="the link went down") for switch in self._switches]
        self._switches.clear()
        self._latest.clear()
        self._flags = 0
        for speed in self._speeds.values():
            speed.halt()

    def errors(self) -> dict[str, int]:
        """Packets that were damaged on the way, and good ones that made no sense."""
        return {"damaged": self._framer.damaged, "unreadable": self._unreadable}

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = never) -> list[FromWorker]:
        """Take in what has come, send what is due.  Raises LinkGone."""
        link = self._link
        if link is None:
            return []
        news: list[FromWorker] = []
        data = link.read(4096, now)
        if data:
            values: Values = {}
            for body in self._framer.feed(data):
                # A packet is a sign of life; bytes alone are none.
                self._heard_at = now
                self._take(body, values)
            if values:
                for device, items in values.items():
                    self._latest.setdefault(device, {}).update(items)
                news.append(Samples(now, values, dict.fromkeys(values, now)))
            if ROBOT in values:
                news += self._confirm(now)
        self._stop_if_blind(link, now)
        if now - self._heard_at > SILENCE:
            link.write(encode("STOP"))
            raise LinkGone(f"{link.url.text}: the robot has been silent for {SILENCE:g} s; is it switched off?")
        news += self._send(link, now)
        return news

    def _stop_if_blind(self, link: Link, now: float) -> None:
        """What drives and says nothing more is stopped."""
        if now - self._heard_at > BLIND and any(speed.value for speed in self._speeds.values()):
            for speed in self._speeds.values():
                speed.halt()
            link.write(encode("STOP"))
            self.halted = f"the robot has said nothing for {BLIND:g} s"

    def _take(self, body: bytes, values: Values) -> None:
        kind = body[0]
        try:
            if kind in (sip.STOPPED, sip.MOVING):
                self._take_sip(sip.parse(body), values)
            elif kind in packets.PACKETS:
                packet = packets.PACKETS[kind]
                values[packet.device] = packet.read(body[1:])
            elif kind in packets.SIM_LASER:
                ranges = self._sim_laser.feed(kind, body[1:])
                if ranges is not None:
                    values[LASER] = {"ranges": ranges}
            elif kind in packets.RESET_NOTICES:
                raise LinkGone("the robot's controller was reset; connecting again")
        except BadFrame:
            self._unreadable += 1

    def _take_sip(self, seen: sip.Sip, values: Values) -> None:
        odometer = self._odometer
        odometer.take(seen)
        if self._flags & sip.MOTORS_ON and not seen.flags & sip.MOTORS_ON:
            # What was wanted of the motors must not come back with them.
            if any(speed.value for speed in self._speeds.values()):
                self.halted = "the motors were switched off"
            for speed in self._speeds.values():
                speed.halt()
        self._flags = seen.flags
        robot: dict[str, Any] = {"x": odometer.x, "y": odometer.y, "theta": odometer.theta}
        for name in _SIP_ITEMS:
            robot[name] = getattr(seen, name)
        robot.update(seen.tail)
        values[ROBOT] = robot
        if seen.sonars:
            values.setdefault(SONAR, {}).update([(str(number), value) for number, value in seen.sonars])

    def _confirm(self, now: float) -> list[FromWorker]:
        """Answer the switches that the flags show."""
        if not self._switches:
            return []
        shown = [switch for switch in self._switches if switch.shown(self._flags, now)]
        self._switches = [switch for switch in self._switches if switch not in shown]
        return [Reply(switch.reply_id, True, switch.wanted) for switch in shown]

    # ---------------------------------------------------------------- sending

    def _send(self, link: Link, now: float) -> list[FromWorker]:
        """Send at most one packet, the most urgent first; answer switches that were tried in vain."""
        failed = [switch for switch in self._switches if not switch.tries and switch.due(now)]
        if failed:
            self._switches = [switch for switch in self._switches if switch not in failed]
        if now - self._sent_at >= PACE:
            data = self._next(now)
            if data is not None:
                link.write(data)
                self._sent_at = now
        why = "the robot did not obey; is its STOP button pressed?"
        return [Reply(switch.reply_id, False, error=why) for switch in failed]

    def _next(self, now: float) -> bytes | None:
        for speed in self._speeds.values():
            data = speed.packet(now)
            if data is not None:
                return data
        for switch in self._switches:
            if switch.tries and switch.due(now):
                return switch.send(now)
        if self._queue:
            return self._queue.popleft()
        if now - self._sent_at >= PULSE_AFTER:
            return encode("PULSE")
        return None

    # ---------------------------------------------------------------- what the parent wants

    def targets(self, message: Targets) -> list[FromWorker]:
        """Speeds: ("robot", "vel") in mm/s, ("robot", "rvel") in deg/s."""
        refused: list[FromWorker] = []
        for (device, item), value in message.values.items():
            reason = self._aim(device, item, value)
            if reason:
                refused.append(Refused(device, item, reason))
        return refused

    def _aim(self, device: Any, item: str, value: Any) -> str:
        speed = self._speeds.get(item) if device == ROBOT else None
        if speed is None:
            return "there is no such target"
        if not isinstance(value, int) or abs(value) > LARGEST:
            return f"{value!r} is no speed"
        if value and not self._flags & sip.MOTORS_ON:
            return "the motors are off"
        speed.set(value)
        return ""

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Ask for the packets of a device, or for no more of them."""
        device = message.device
        if device in (ROBOT, SONAR):
            return []
        if device != LASER and device not in packets.REQUESTS:
            return [Refused(device, ",".join(message.items), "there is nothing of this kind to watch")]
        wanted = message.period is not None
        (self._watched.add if wanted else self._watched.discard)(device)
        if self._link is not None:
            self._queue.append(_request_of(device, wanted))
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """See the head of this file."""
        try:
            return self._request(message)
        except BadValue as error:
            return [Reply(message.reply_id, False, error=str(error))]

    def _request(self, message: Request) -> list[FromWorker]:
        if self._link is None:
            raise BadValue("the link is down")
        if message.verb == "read":
            items = self._latest.get(message.device, {})
            if message.item not in items:
                raise BadValue(f"nothing is known of {message.device} {message.item}")
            return [Reply(message.reply_id, True, items[message.item])]
        if message.verb == "write" and message.device == ROBOT and message.item in _SWITCHES:
            name, mask = _SWITCHES[message.item]
            wanted = int(bool(message.value))
            overtaken = [switch for switch in self._switches if switch.mask == mask]
            self._switches = [switch for switch in self._switches if switch.mask != mask]
            self._switches.append(Switch(message.reply_id, encode(name, wanted), mask, wanted))
            return [Reply(switch.reply_id, False, error="it was overtaken by another one") for switch in overtaken]
        if message.verb == "write" and message.device == COMMAND:
            if message.item in DRIVING:
                raise BadValue(f"{message.item} is sent by the driver only: use the slots that drive the robot")
            self._queue.append(encode(message.item, message.value))
            return [Reply(message.reply_id, True)]
        raise BadValue(f"this robot knows no request {message.verb} {message.device} {message.item}")

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Speeds other than zero."""
        return device == ROBOT and bool(value)

    def request_moves(self, request: Request) -> bool:
        """None: what drives is no request, and motors that are switched on stand."""
        return False

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop at once, and say it again: nothing is acknowledged.  Raises LinkGone."""
        link = self._link
        if link is None:
            return
        for speed in self._speeds.values():
            speed.halt()
        link.write(encode("STOP"))
        if self._torque_off:
            self._queue.append(encode("ENABLE", 0))
        self._sent_at = link.clock.now()


def _request_of(device: str, wanted: bool) -> bytes:
    """The command that switches the packets of a device on or off."""
    if device == LASER:
        return encode("SIM_LRF_ENABLE", int(wanted))
    if device == "gyro":
        return encode("GYRO", int(wanted))
    return encode(packets.REQUESTS[device], 2 if wanted else 0)
