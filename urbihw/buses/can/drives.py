"""The driver of CiA 402 drives on one CAN bus, in the worker.

Devices are node numbers. Targets: "velocity" in increments/s, "position" in increments, "torque" in thousandths of the
rated torque; they move a drive that is on and are dropped by one that is off. Items measured: "status", "mode",
"position", "velocity", and "torque" if the drive has a torque mode.

Requests: "enable", "disable", "quick_stop" (brake hard, then off) and "reset" (of a fault) are answered when the drive
has reached the state, or with an error after TRANSITION_TIMEOUT_S; "home" (value: the method, object 6098) when the
position is found, or with an error when something else has ended it, or after HOMING_TIMEOUT_S; "read" and "write"
take an object as item, "6081" or "607D:1".

The start of the worker switches no drive on. A drive keeps its commanded state while it is present: one that was lost,
or has restarted, is off until it is switched on again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from canopen import SdoAbortedError, SdoCommunicationError

from urbihw.buses.can import cia402 as c
from urbihw.buses.can.drive import HEARTBEAT_PERIOD_S, HEARTBEAT_TIMEOUT_S, MASTER, CanDrive, DriveInfo
from urbihw.buses.can.emergencies import advised
from urbihw.buses.can.network import PortNetwork
from urbihw.buses.can.options import LAST_NODE, CanOptions
from urbihw.buses.can.port import can_port
from urbihw.buses.clock import BusClock, BusRealClock
from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadValue, BusTimeout, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    DeviceState,
    Found,
    FromWorker,
    Limit,
    Reply,
    Request,
    Samples,
    Targets,
)
from urbihw.buses.readings import ALARM, Reading
from urbihw.frozen import frozen

SEARCH_S: Final = 0.2
"""Seconds to wait for the answers of all nodes on the bus."""
TRANSITION_TIMEOUT_S: Final = 2.0
"""Seconds within which a drive must have changed its state."""
HOMING_TIMEOUT_S: Final = 120.0
"""Seconds within which a drive must have found its home position."""
_HEARTBEAT_OPERATIONAL = b"\x05"
_GOAL_STATES: Final = {
    "enable": (c.ENABLED,),
    "disable": (c.DISABLED, c.READY, c.SWITCHED_ON),
    "quick_stop": (c.DISABLED, c.READY, c.SWITCHED_ON),
    "reset": (c.DISABLED, c.READY, c.SWITCHED_ON),
}
"""Verb -> states in which it is done."""
_LARGEST: Final = {"velocity": (1 << 31) - 1, "position": (1 << 31) - 1, "torque": (1 << 15) - 1}
"""Target -> largest number of its object."""
_NO_LIMIT: Final = Limit()


@frozen(slots=False)
class _Transition:
    reply_id: int
    verb: str
    until: float


class DrivesDriver(Driver):
    """The driver described at the head of this file; `urbihw.buses.driver.Driver` describes the calls of the engine."""

    slow_verbs: frozenset[str] = frozenset({"read", "write"})
    knows_motion = True
    device_info = DriveInfo
    exclusive = frozenset({"velocity", "position", "torque"})

    def __init__(self) -> None:
        self._clock: BusClock = BusRealClock()
        self._network: PortNetwork | None = None
        self._drives: dict[int, CanDrive] = {}
        self._lost: dict[int, float] = {}
        self._nodes: tuple[int, ...] = ()
        self._period = 0.01
        self._off_on_stop = False
        self._limits: Mapping[tuple[Any, str], Limit] = {}
        self._unbound: set[int] = set()
        self._transitions: dict[int, _Transition] = {}
        self._pending_messages: list[FromWorker] = []
        self._beat_at = -math.inf
        self._unsent = 0

    # ---------------------------------------------------------------- the engine's calls

    def configure(self, settings: Configure) -> None:
        """Apply settings. Raises BadSetting."""
        self._nodes = CanOptions.of(settings.options).nodes
        self._period = 1 / settings.rate
        self._off_on_stop = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Find the drives and set them up. Raises Unavailable when there is none that can be used."""
        can = can_port(port)
        self._clock = port.clock
        self._network = network = PortNetwork(can)
        network.receive()
        numbers = self._nodes or self._search_nodes(network)
        problems = []
        self._drives = {}
        for number in numbers:
            try:
                self._drives[number] = CanDrive(network, number, self._period, self._clock.now())
            except Unavailable as error:
                problems.append(str(error))
        if not self._drives:
            raise Unavailable("; ".join(problems) or f"no node answers on {port.url.text}: power, wiring, bitrate?")
        self._lost = {}
        self._unbound = set(self._drives)
        infos = tuple(drive.info for drive in self._drives.values())
        return [Found(infos), *(DeviceReport(0, "left alone", problem) for problem in problems)]

    def detach(self) -> None:
        """Drop the drives of the closed port; their pending requests are answered with an error."""
        self._network = None
        self._drives, self._unbound = {}, set()
        why = "the link went down"
        self._pending_messages += [Reply(wait.reply_id, False, error=why) for wait in self._transitions.values()]
        self._transitions = {}

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Send the heartbeat and control words, receive what has arrived, and check each drive."""
        news, self._pending_messages = self._pending_messages, []
        network = self._network
        if network is None:
            return news
        self._send_heartbeat(network, now)
        self._bound_speeds()
        for drive in self._present_drives():
            self._try_send(lambda drive=drive: drive.send_control_word(now))  # type: ignore[misc]
        meanwhile()
        network.receive()
        now = self._clock.now()
        values: dict[Any, dict[str, int]] = {}
        for number, drive in self._drives.items():
            drive.update_heard_at(now)
            news += self._check_drive(number, drive, now)
            if number not in self._lost and drive.heard:
                values[number] = drive.values()
        if values:
            news.append(Samples(now, values, {number: self._drives[number].heard_at for number in values}))
        return news

    def targets(self, message: Targets) -> list[FromWorker]:
        self._bound_speeds()
        return super().targets(message)

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Send a target to a drive that is present and on; the others drop it."""
        drive = self._drives.get(device)
        if not isinstance(value, int) or abs(value) > _LARGEST.get(item, 0):
            raise BadValue(f"no such target, or {value!r} is not a number of its units")
        if drive is None or device in self._lost or not drive.wanted or drive.state != c.ENABLED:
            return
        if item == "torque" and not drive.has_torque:
            raise BadValue("the drive has no torque mode")
        if item == "position" and drive.profile.problem:
            raise BadValue(drive.profile.problem)
        action = {"velocity": drive.set_velocity, "position": drive.set_position, "torque": drive.set_torque}[item]
        self._try_send(lambda: action(value))

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Execute a request; a change of state is answered in a later tick."""
        drive = self._drives.get(message.device)
        if drive is None or message.device in self._lost:
            raise BadValue(f"drive {message.device} is not there")
        if message.verb in _GOAL_STATES:
            return self._start_transition(message, drive)
        if message.verb == "home":
            return self._start_homing(message, drive)
        if message.verb in ("read", "write"):
            return [self._access_object(message, drive)]
        raise BadValue(f"a drive does not know {message.verb!r}")

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """The drives, all or those of `devices`, brake and hold, or are switched off."""
        for number, drive in self._drives.items():
            if devices is not None and number not in devices:
                continue
            if self._off_on_stop or not drive.wanted or number in self._lost:
                # A drive that was set up again may still execute an old command; a lost one may still receive; one
                # that is off may have been switched on by another master.
                drive.quick_stop()
            else:
                self._try_send(drive.halt)
            self._try_send(lambda drive=drive: drive.send_control_word(self._clock.now()))  # type: ignore[misc]

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Stop drives that move although this worker has not switched them on: brake, then off. Returns their ids."""
        network = self._network
        if network is None:
            return ()
        network.receive_for(2 * self._period)
        moving = [drive for drive in self._present_drives() if drive.state == c.ENABLED and drive.values()["velocity"]]
        for drive in moving:
            drive.quick_stop()
            self._try_send(lambda drive=drive: drive.send_control_word(self._clock.now()))  # type: ignore[misc]
        return tuple(drive.info.id for drive in moving)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """True for all targets but a velocity of zero."""
        return item == "position" or bool(value)

    def request_moves(self, request: Request) -> bool:
        """True for power on, homing, and writes of objects, which bypass the targets."""
        return request.verb in ("enable", "home", "write")

    def displaced(self, request: Request) -> tuple[Any, ...]:
        """Homing decides how the drive turns: a ramp that was under way to a speed would end it."""
        return (request.device,) if request.verb == "home" else ()

    def limits_changed(self, limits: Mapping[tuple[Any, str], Limit]) -> None:
        """Before the next target, bound the speed with which the drives go to positions by themselves."""
        self._limits = limits
        self._unbound = set(self._drives)

    def pose(self, device: Any, item: str) -> float | None:
        """The position in increments, for the target position; nan before the drive was heard."""
        if item != "position":
            return None
        drive = self._drives.get(device)
        return drive.values()["position"] if drive is not None and drive.heard else math.nan

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return position, speed and torque of the motor's shaft in rad, rad/s and N m; a fault is an alarm."""
        drive = self._drives.get(device)
        if item == "status":
            return Reading(ALARM, advised("fault", device) if c.state_of(raw) in (c.FAULT, c.REACTION) else "")
        if drive is None:
            return None
        increment = math.tau / (drive.info.increments or math.nan)
        match item:
            case "position":
                return Reading("position", raw * increment, "rad")
            case "velocity":
                return Reading("speed", raw * increment, "rad/s")
            case "torque":
                return Reading("torque", raw / 1000 * drive.info.rated_torque, "N m")
        return None

    def errors(self) -> dict[str, int]:
        """Failures since `attach`."""
        return {"damaged": self._network.damaged if self._network is not None else 0, "unsent": self._unsent}

    # ---------------------------------------------------------------- inside

    def _search_nodes(self, network: PortNetwork) -> list[int]:
        """The numbers of all nodes that answer, in order."""
        network.scanner.reset()  # type: ignore[no-untyped-call]
        for number in range(1, LAST_NODE + 1):
            # As `network.scanner.search`, but receiving meanwhile, since adapters buffer few frames.
            network.send_message(0x600 + number, b"\x40\x00\x10\x00\x00\x00\x00\x00")
            network.receive()
        network.receive_for(SEARCH_S)
        return sorted(number for number in network.scanner.nodes if number <= LAST_NODE)

    def _present_drives(self) -> list[CanDrive]:
        return [drive for number, drive in self._drives.items() if number not in self._lost]

    def _send_heartbeat(self, network: PortNetwork, now: float) -> None:
        """Send the master's heartbeat when it is due; drives that supervise it stop when it is missing."""
        if now - self._beat_at >= HEARTBEAT_PERIOD_S - self._period / 2:
            self._beat_at = now
            self._try_send(lambda: network.send_message(0x700 + MASTER, _HEARTBEAT_OPERATIONAL))

    def _try_send(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BusTimeout:
            # No ACK on the bus; the silence time-out reports the drives.
            self._unsent += 1

    def _bound_speeds(self) -> None:
        for number in self._unbound - self._lost.keys():
            self._unbound.discard(number)
            most = self._limits.get((number, "velocity"), _NO_LIMIT).high
            self._try_send(lambda drive=self._drives[number], most=most: drive.bound_speed(most))  # type: ignore[misc]

    def _start_transition(self, message: Request, drive: CanDrive) -> list[FromWorker]:
        news = self._end_transition(message.device, f"gave way to {message.verb}")
        match message.verb:
            case "enable":
                self._try_send(drive.enable)
            case "disable":
                drive.wanted = False
            case "quick_stop":
                drive.quick_stop()
            case "reset":
                drive.wanted, drive.resets = None, True
        until = self._clock.now() + TRANSITION_TIMEOUT_S
        self._transitions[message.device] = _Transition(message.reply_id, message.verb, until)
        return news

    def _start_homing(self, message: Request, drive: CanDrive) -> list[FromWorker]:
        if not (drive.wanted and drive.state == c.ENABLED):
            return [Reply(message.reply_id, False, error=f"drive {message.device} is off: switch it on with load = 1")]
        if not drive.info.modes & c.CAN_HOME:
            return [Reply(message.reply_id, False, error=f"drive {message.device} has no homing mode (0x6502)")]
        try:
            drive.start_homing(int(message.value))
        except (SdoAbortedError, SdoCommunicationError, ValueError, TypeError) as error:
            # ValueError and TypeError: canopen cannot encode the number.
            why = f"drive {message.device} refuses homing method {message.value}: {error}"
            return [Reply(message.reply_id, False, error=why)]
        news = self._end_transition(message.device, f"gave way to {message.verb}")
        until = self._clock.now() + HOMING_TIMEOUT_S
        self._transitions[message.device] = _Transition(message.reply_id, message.verb, until)
        return news

    def _end_transition(self, number: int, reason: str) -> list[FromWorker]:
        """Answer a pending request of a drive with an error."""
        wait = self._transitions.pop(number, None)
        return [] if wait is None else [Reply(wait.reply_id, False, error=f"{wait.verb} {reason}")]

    def _access_object(self, message: Request, drive: CanDrive) -> Reply:
        index, _, sub = message.item.partition(":")
        try:
            place = int(index, 16), int(sub or "0", 16)
            if message.verb == "read":
                return Reply(message.reply_id, True, drive.read_object(*place))
            drive.write_object(*place, message.value)
            return Reply(message.reply_id, True, message.value)
        except (KeyError, ValueError, TypeError):
            return Reply(message.reply_id, False, error=f"no object {message.item!r} is known here, or no such value")
        except (SdoAbortedError, SdoCommunicationError) as error:
            return Reply(message.reply_id, False, error=f"drive {message.device} refuses {message.item}: {error}")

    def _check_drive(self, number: int, drive: CanDrive, now: float) -> list[FromWorker]:
        """Return the messages about a drive: its emergencies, its loss or return, the end of a transition."""
        news: list[FromWorker] = [DeviceReport(number, "emergency", one) for one in drive.emergencies]
        drive.emergencies = []
        if number in self._lost:
            return news + self._set_up_lost_drive(number, drive, now)
        reason = _loss_of(drive, now)
        if reason:
            self._lost[number] = now
            wait = self._transitions.pop(number, None)
            if wait is not None:
                news.append(Reply(wait.reply_id, False, error=f"drive {number} is lost: {reason}"))
            return [*news, DeviceState(number, "ok", "lost", reason)]
        return news + self._check_transition(number, drive, now)

    def _set_up_lost_drive(self, number: int, drive: CanDrive, now: float) -> list[FromWorker]:
        """A lost drive that speaks again brakes, and is set up again: it may still execute an old command."""
        if drive.heard_at <= self._lost[number] and not drive.booted:
            return []
        assert self._network is not None
        try:
            self._drives[number] = CanDrive(self._network, number, self._period, now, brakes=True)
        except Unavailable:
            self._lost[number] = self._clock.now()
            drive.booted = False
            drive.listen()
            return []
        del self._lost[number]
        self._unbound.add(number)
        return [DeviceState(number, "lost", "back", ""), DeviceState(number, "back", "ok", "")]

    def _check_transition(self, number: int, drive: CanDrive, now: float) -> list[FromWorker]:
        wait = self._transitions.get(number)
        if wait is None:
            return []
        if wait.verb == "home":
            return self._check_homing(number, drive, wait, now)
        state = drive.state
        if state in _GOAL_STATES[wait.verb]:
            drive.resets = False
            del self._transitions[number]
            return [Reply(wait.reply_id, True, state)]
        hopeless = state == c.FAULT and wait.verb != "reset"
        if not hopeless and now < wait.until:
            return []
        del self._transitions[number]
        drive.resets = False
        if wait.verb == "enable":
            drive.wanted = None
        told = advised(state, number) if state == c.FAULT else state
        return [Reply(wait.reply_id, False, error=f"drive {number} stays in {told}")]

    def _check_homing(self, number: int, drive: CanDrive, wait: _Transition, now: float) -> list[FromWorker]:
        result = drive.homing_result() if drive.state == c.ENABLED else False
        if result is None and now >= wait.until:
            self._try_send(drive.halt)
            return self._end_transition(number, f"has not found the home position within {HOMING_TIMEOUT_S:.0f} s")
        if result is None:
            return []
        if not result:
            return self._end_transition(number, "was ended, or failed, before the home position was found")
        del self._transitions[number]
        return [Reply(wait.reply_id, True, drive.values()["position"])]


def _loss_of(drive: CanDrive, now: float) -> str:
    """Why a drive cannot be commanded any more; "" if it can."""
    if drive.booted:
        return "it has started anew"
    if drive.displaced:
        return f"another master on the bus has put it into {drive.displaced}"
    return "it says nothing" if now - drive.heard_at > HEARTBEAT_TIMEOUT_S else ""
