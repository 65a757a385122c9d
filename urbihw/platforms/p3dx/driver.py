"""The driver of a Pioneer's controller, in the worker.

Devices and their items, all raw:

    robot     x y theta (counted on beyond their wrapping), left right battery stall flags compass ... and what the tail
              of a SIP holds; targets: vel (mm/s), rvel (deg/s)
    sonar     "0" to "31": the readings of those that fired
    gripper   its actions are requests (below); its state is an item of the robot
    encoder io gyro joystick gripper battery aux1 aux2: their packets, sent while watched
    laser     ranges (mm, right to left) of MobileSim's laser, sent while watched

Requests: "write" of ("robot", "enable") and ("robot", "sonar") answers when the flags show it; "write" of ("gripper",
"action") moves or halts the gripper; "write" of ("command", name) sends any command of ``commands`` that does not
drive; "read" gives the latest value of an item.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadFrame, BadValue, LinkGone
from urbihw.buses.halfpacket import HalfPacket
from urbihw.buses.link import Link, Port, byte_link
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Watch
from urbihw.buses.readings import ALARM, Quantity, Reading
from urbihw.platforms.p3dx import packets, sip
from urbihw.platforms.p3dx.commands import DRIVING, GRIPPER, GRIPPER_HALTS, HALT, encode
from urbihw.platforms.p3dx.handshake import ArcosHandshake, ArcosRobotInfo
from urbihw.platforms.p3dx.options import P3dxOptions
from urbihw.platforms.p3dx.protocol import LARGEST, ArcosFramer
from urbihw.platforms.p3dx.setpoint import FlagSwitch, SetPoint

ROBOT, SONAR, LASER, COMMAND = "robot", "sonar", "laser", "command"
PULSE_PERIOD_S: Final = 0.5
"""Seconds without a command after which a PULSE keeps the controller's watchdog (2 s) quiet, as ARIA does."""
STOP_TIMEOUT_S: Final = 0.5
"""Seconds without a packet after which a robot that drives is stopped: five of its reports."""
HALF_PACKET_S: Final = 0.3
"""Seconds in which a packet must be complete: the longest has some 200 bytes, 0.22 s at 9600 baud."""
SILENCE_TIMEOUT_S: Final = 2.0
"""Seconds without a packet after which the connection counts as lost."""
SEND_PERIOD_S: Final = 0.004
"""Seconds between two commands (the AROS manual asks for 3 to 5 ms)."""
_SWITCHES: Final = {"enable": ("ENABLE", sip.MOTORS_ON), "sonar": ("SONAR", sip.SONARS_ON)}
_SIP_ITEMS: Final = (
    "moving", "left", "right", "battery", "stall", "control", "flags", "compass", "gripper", "analog_port", "analog",
    "digital_in", "digital_out",
)  # fmt: skip

Values = dict[Any, dict[str, Any]]


class ArcosDriver(Driver):
    """Drives a Pioneer over one link; ``urbihw.buses.driver.Driver`` tells when each method is called."""

    url_parameters = P3dxOptions.in_url()
    device_info = ArcosRobotInfo
    quantities = {"battery": Quantity("voltage", "V", 0.1)}

    def __init__(self) -> None:
        self._link: Link | None = None
        self._framer, self._half = ArcosFramer(), HalfPacket(HALF_PACKET_S)
        self._odometer = sip.Odometer()
        self._sim_laser = packets.SimLaser()
        self._options = P3dxOptions()
        self._torque_off = False
        self._speeds = {"vel": SetPoint("VEL"), "rvel": SetPoint("RVEL")}
        self._queue: deque[bytes] = deque()
        self._switches: list[FlagSwitch] = []
        self._failed: list[FromWorker] = []
        self._watched: set[str] = set()
        self._latest: Values = {}
        self._flags = 0
        self._low_battery = math.nan
        self._heard_at = self._sent_at = 0.0
        self._unreadable = 0

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take the settings.  Raises BadSetting."""
        self._options = P3dxOptions.of(settings.options)
        self._torque_off = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Connect to the controller.  Raises Unavailable, BadUrl, LinkGone."""
        link = byte_link(port)
        self._framer, self._half = ArcosFramer(), HalfPacket(HALF_PACKET_S)
        info = ArcosHandshake(link, self._framer).connect(self._options.host_baud)
        self._link = link
        self.identity = str(info.config["serial"])
        self._low_battery = int(info.config["low_battery"]) / 10 or math.nan
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
        """Drop the queue, speeds and pending switches of the closed link; watches stay."""
        self._link = None
        self._queue.clear()
        self._failed += [Reply(switch.reply_id, False, error="the link went down") for switch in self._switches]
        self._switches.clear()
        self._latest.clear()
        self._flags = 0
        for speed in self._speeds.values():
            speed.halt()

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return the voltage beside the controller's own threshold (CONFIGpac), and the STOP button (FLAGS, bit 5)."""
        if item == "flags" and raw.__class__ is int:
            pressed = "its STOP button is pressed: release it, then P3dx.body.load = 1"
            return Reading(ALARM, pressed if raw & sip.STOP_BUTTON else "")
        found = super().reading(device, item, raw)
        return found and found._replace(low=self._low_battery)

    def errors(self) -> dict[str, int]:
        """Return the number of damaged packets, of intact ones with invalid content, and of those that were not
        complete in time.
        """
        return {"damaged": self._framer.damaged, "unreadable": self._unreadable,
                "incomplete": self._half.dropped}  # fmt: skip

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Handle the packets that have arrived, and send the next one that is due.  Raises LinkGone."""
        link = self._link
        if link is None:
            return []
        news: list[FromWorker] = []
        data = link.read(4096, now)
        bodies = self._framer.feed(data) if data else []
        if self._half.is_overdue(len(bodies), self._framer.held, now):
            self._framer.reset()
        if data:
            values: Values = {}
            for body in bodies:
                # Only a whole packet proves that the robot is alive; single bytes may be noise.
                self._heard_at = now
                self._handle_packet(body, values)
            if values:
                for device, items in values.items():
                    self._latest.setdefault(device, {}).update(items)
                news.append(Samples(now, values, dict.fromkeys(values, now)))
            if ROBOT in values:
                news += self._confirm_switches(now)
        self._stop_if_silent(link, now)
        if now - self._heard_at > SILENCE_TIMEOUT_S:
            link.write(encode("STOP"))
            silence = f"the robot has been silent for {SILENCE_TIMEOUT_S:g} s"
            raise LinkGone(f"{link.url.text}: {silence}; is it switched off?")
        news += self._send_next(link, now)
        return news

    def _stop_if_silent(self, link: Link, now: float) -> None:
        """Stop a driving robot that has been silent for STOP_TIMEOUT_S."""
        if now - self._heard_at > STOP_TIMEOUT_S and any(speed.value for speed in self._speeds.values()):
            for speed in self._speeds.values():
                speed.halt()
            link.write(encode("STOP"))
            self.halted = f"the robot has said nothing for {STOP_TIMEOUT_S:g} s"

    def _handle_packet(self, body: bytes, values: Values) -> None:
        kind = body[0]
        try:
            if kind in (sip.STOPPED, sip.MOVING):
                self._handle_sip(sip.parse(body), values)
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

    def _handle_sip(self, seen: sip.Sip, values: Values) -> None:
        odometer = self._odometer
        odometer.add_sip(seen)
        if self._flags & sip.MOTORS_ON and not seen.flags & sip.MOTORS_ON:
            # Old speeds must not take effect when the motors are switched on again.
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

    def _confirm_switches(self, now: float) -> list[FromWorker]:
        """Reply to the switch requests that the flags confirm."""
        if not self._switches:
            return []
        shown = [switch for switch in self._switches if switch.is_confirmed(self._flags, now)]
        self._switches = [switch for switch in self._switches if switch not in shown]
        return [Reply(switch.reply_id, True, switch.wanted) for switch in shown]

    # ---------------------------------------------------------------- sending

    def _send_next(self, link: Link, now: float) -> list[FromWorker]:
        """Send at most one packet, the most urgent first; reply with an error to switches without effect."""
        failed = [switch for switch in self._switches if not switch.tries and switch.is_due(now)]
        if failed:
            self._switches = [switch for switch in self._switches if switch not in failed]
        if now - self._sent_at >= SEND_PERIOD_S:
            data = self._next_packet(now)
            if data is not None:
                link.write(data)
                self._sent_at = now
        why = "the robot did not obey; is its STOP button pressed?"
        return [Reply(switch.reply_id, False, error=why) for switch in failed]

    def _next_packet(self, now: float) -> bytes | None:
        for speed in self._speeds.values():
            data = speed.next_packet(now)
            if data is not None:
                return data
        for switch in self._switches:
            if switch.tries and switch.is_due(now):
                return switch.next_packet(now)
        if self._queue:
            return self._queue.popleft()
        if now - self._sent_at >= PULSE_PERIOD_S:
            return encode("PULSE")
        return None

    # ---------------------------------------------------------------- messages of the parent

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Set a speed: ("robot", "vel") in mm/s, ("robot", "rvel") in deg/s."""
        speed = self._speeds.get(item) if device == ROBOT else None
        if speed is None:
            raise BadValue("there is no such target")
        if not isinstance(value, int) or abs(value) > LARGEST:
            raise BadValue(f"{value!r} is no speed")
        if value and not self._flags & sip.MOTORS_ON:
            raise BadValue("the motors are off")
        speed.set_value(value)

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Start or end the packets of a device."""
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

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Execute a request: the head of this file lists them."""
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
            self._switches.append(FlagSwitch(message.reply_id, encode(name, wanted), mask, wanted))
            return [Reply(switch.reply_id, False, error="it was overtaken by another one") for switch in overtaken]
        if message.verb == "write" and message.device == GRIPPER:
            self._queue.append(encode("GRIPPER", message.value))
            return [Reply(message.reply_id, True)]
        if message.verb == "write" and message.device == COMMAND:
            if message.item in DRIVING:
                raise BadValue(f"{message.item} is sent by the driver only: use the slots that drive the robot")
            self._queue.append(encode(message.item, message.value))
            return [Reply(message.reply_id, True)]
        raise BadValue(f"this robot knows no request {message.verb} {message.device} {message.item}")

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """True for speeds other than zero."""
        return device == ROBOT and bool(value)

    def request_moves(self, request: Request) -> bool:
        """True for the gripper: no other request moves, and motors that are switched on stand still."""
        return request.device == GRIPPER and request.verb == "write" and request.value not in GRIPPER_HALTS

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Send STOP at once, and zero speeds in the next ticks: nothing is acknowledged.  Raises LinkGone.

        A gripper is halted too.
        """
        link = self._link
        if link is None:
            return
        if devices is None or ROBOT in devices:
            for speed in self._speeds.values():
                speed.halt()
            link.write(encode("STOP"))
            if self._torque_off:
                # At once: at the end of the worker no tick follows that could send it.
                link.clock.sleep_until(link.clock.now() + SEND_PERIOD_S)
                link.write(encode("ENABLE", 0))
        if devices is None or GRIPPER in devices:
            link.write(encode("GRIPPER", HALT))
        self._sent_at = link.clock.now()

    def stop_again(self) -> None:
        """Send STOP, and zero speeds with the next ticks: a joystick at the robot drives it, too.  Raises LinkGone."""
        if self._link is not None:
            for speed in self._speeds.values():
                speed.halt()
            self._link.write(encode("STOP"))
            self._sent_at = self._link.clock.now()


def _request_of(device: str, wanted: bool) -> bytes:
    """The command that switches the packets of a device on or off."""
    if device == LASER:
        return encode("SIM_LRF_ENABLE", int(wanted))
    if device == "gyro":
        return encode("GYRO", int(wanted))
    return encode(packets.REQUESTS[device], 2 if wanted else 0)
