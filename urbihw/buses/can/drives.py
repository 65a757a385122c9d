"""The worker's half of CiA 402 drives on one CAN bus.

Devices are node numbers. Targets: "velocity" in increments/s, "position" in increments; they move a drive that is on
and are forgotten by one that is not. Items measured: "status", "mode", "position", "velocity".

Requests: "enable", "disable", "quick_stop" (brake hard, then off) and "reset" (of a fault) are answered when the drive
has got there, or has not after SLOW seconds; "read" and "write" take an object as item, "6081" or "607D:1".

Starting switches nothing on. What a drive was switched to lasts while it is there: one that was lost, or has started
anew, is off until it is switched on again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from canopen import SdoAbortedError, SdoCommunicationError

from urbihw.buses.can import cia402 as c
from urbihw.buses.can.drive import BEAT, MASTER, PATIENCE, Drive
from urbihw.buses.can.network import PortNetwork
from urbihw.buses.can.options import LAST_NODE, Options
from urbihw.buses.can.port import can_port
from urbihw.buses.clock import Clock, RealClock
from urbihw.buses.driver import Driver, never
from urbihw.buses.errors import BusTimeout, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.messages import (
    Configure,
    DeviceState,
    Found,
    FromWorker,
    Happened,
    Refused,
    Reply,
    Request,
    Samples,
    Targets,
    Watch,
)

SEARCH: Final = 0.2
"""Seconds in which all that is on the bus answers."""
SLOW: Final = 2.0
"""Seconds in which a drive changes its state."""
_BEATING = b"\x05"
_GOALS: Final = {
    "enable": (c.ENABLED,),
    "disable": (c.DISABLED, c.READY, c.SWITCHED_ON),
    "quick_stop": (c.DISABLED, c.READY, c.SWITCHED_ON),
    "reset": (c.DISABLED, c.READY, c.SWITCHED_ON),
}
"""Verb -> states that it is about."""


@dataclass(frozen=True)
class _Wait:
    reply_id: int
    verb: str
    until: float


class DrivesDriver(Driver):
    """See the head of this file, and `urbihw.buses.driver.Driver` for who calls what."""

    slow_verbs: frozenset[str] = frozenset({"read", "write"})

    def __init__(self) -> None:
        self._clock: Clock = RealClock()
        self._network: PortNetwork | None = None
        self._drives: dict[int, Drive] = {}
        self._lost: dict[int, float] = {}
        self._nodes: tuple[int, ...] = ()
        self._period = 0.01
        self._off_on_stop = False
        self._waits: dict[int, _Wait] = {}
        self._owed: list[FromWorker] = []
        self._beat_at = -math.inf
        self._unsent = 0

    # ---------------------------------------------------------------- the engine's calls

    def configure(self, settings: Configure) -> None:
        """Take settings. Raises BadSetting."""
        self._nodes = Options.of(settings.options).nodes
        self._period = 1 / settings.rate
        self._off_on_stop = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Find the drives and set them up. Raises Unavailable when there is none that can be used."""
        can = can_port(port)
        self._clock = port.clock
        self._network = network = PortNetwork(can)
        network.receive()
        numbers = self._nodes or self._search(network)
        problems = []
        self._drives = {}
        for number in numbers:
            try:
                self._drives[number] = Drive(network, number, self._period, self._clock.now())
            except Unavailable as error:
                problems.append(str(error))
        if not self._drives:
            raise Unavailable("; ".join(problems) or f"no node answers on {port.url.text}: power, wiring, bitrate?")
        self._lost = {}
        infos = tuple(drive.info for drive in self._drives.values())
        return [Found(infos), *(Happened(0, "left alone", problem) for problem in problems)]

    def detach(self) -> None:
        """The port is gone."""
        self._network = None
        self._drives = {}
        self._owed += [Reply(wait.reply_id, False, error="the link went down") for wait in self._waits.values()]
        self._waits = {}

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = never) -> list[FromWorker]:
        """Control words out, what has come in."""
        news, self._owed = self._owed, []
        network = self._network
        if network is None:
            return news
        self._beat(network, now)
        for drive in self._living():
            self._tried(lambda drive=drive: drive.work(now))  # type: ignore[misc]
        meanwhile()
        network.receive()
        now = self._clock.now()
        values: dict[Any, dict[str, int]] = {}
        for number, drive in self._drives.items():
            drive.listen(now)
            news += self._look(number, drive, now)
            if number not in self._lost and drive.heard:
                values[number] = drive.values()
        if values:
            news.append(Samples(now, values, {number: self._drives[number].heard_at for number in values}))
        return news

    def targets(self, message: Targets) -> list[FromWorker]:
        """Aim drives that are there and on."""
        refused: list[FromWorker] = []
        for (number, item), value in message.values.items():
            drive = self._drives.get(number)
            if item not in ("velocity", "position") or not isinstance(value, int) or abs(value) >= 1 << 31:
                refused.append(Refused(number, item, f"no such target, or {value!r} is no number of increments"))
            elif drive is not None and number not in self._lost and drive.wanted and drive.state == c.ENABLED:
                aim = drive.run if item == "velocity" else drive.go
                self._tried(lambda aim=aim, value=value: aim(value))  # type: ignore[misc]
        return refused

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Everything is reported each tick; there is nothing to choose."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """Do something once."""
        drive = self._drives.get(message.device)
        if drive is None or message.device in self._lost:
            return [Reply(message.reply_id, False, error=f"drive {message.device} is not there")]
        if message.verb in _GOALS:
            return self._walk(message, drive)
        if message.verb in ("read", "write"):
            return [self._object(message, drive)]
        return [Reply(message.reply_id, False, error=f"a drive does not know {message.verb!r}")]

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """The drives, all or those of `devices`, brake and hold, or are switched off."""
        for number, drive in self._drives.items():
            if devices is not None and number not in devices:
                continue
            if self._off_on_stop or drive.wanted is None or number in self._lost:
                # One that was set up anew may still do what it was told before; one that is lost may hear us.
                drive.quick_stop()
            elif drive.wanted:
                self._tried(drive.halt)
            self._tried(lambda drive=drive: drive.work(self._clock.now()))  # type: ignore[misc]

    def stop_what_moves(self) -> tuple[Any, ...]:
        """See `Driver`: drives that are on although nobody switched them on brake, and are off then."""
        network = self._network
        if network is None:
            return ()
        network.wait(2 * self._period)
        moving = [drive for drive in self._living() if drive.state == c.ENABLED and drive.values()["velocity"]]
        for drive in moving:
            drive.quick_stop()
            self._tried(lambda drive=drive: drive.work(self._clock.now()))  # type: ignore[misc]
        return tuple(drive.info.id for drive in moving)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """All targets but a speed of zero."""
        return item == "position" or bool(value)

    def request_moves(self, request: Request) -> bool:
        """Power on, and objects that are written past the targets."""
        return request.verb in ("enable", "write")

    def pose(self, device: Any, item: str) -> float | None:
        """The position in increments, for the target position."""
        drive = self._drives.get(device)
        return drive.values()["position"] if drive is not None and item == "position" and drive.heard else None

    def errors(self) -> dict[str, int]:
        """Failures since `attach`."""
        return {"damaged": self._network.damaged if self._network is not None else 0, "unsent": self._unsent}

    # ---------------------------------------------------------------- inside

    def _search(self, network: PortNetwork) -> list[int]:
        """The numbers of all nodes that answer, in order."""
        network.scanner.reset()  # type: ignore[no-untyped-call]
        for number in range(1, LAST_NODE + 1):
            # As `network.scanner.search`, but taking in the answers meanwhile: adapters hold only so many.
            network.send_message(0x600 + number, b"\x40\x00\x10\x00\x00\x00\x00\x00")
            network.receive()
        network.wait(SEARCH)
        return sorted(number for number in network.scanner.nodes if number <= LAST_NODE)

    def _living(self) -> list[Drive]:
        return [drive for number, drive in self._drives.items() if number not in self._lost]

    def _beat(self, network: PortNetwork, now: float) -> None:
        """Our heartbeat: drives that watch it stop when it ends."""
        if now - self._beat_at >= BEAT - self._period / 2:
            self._beat_at = now
            self._tried(lambda: network.send_message(0x700 + MASTER, _BEATING))

    def _tried(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BusTimeout:
            # Nobody acknowledges; that the drives are silent will be said.
            self._unsent += 1

    def _walk(self, message: Request, drive: Drive) -> list[FromWorker]:
        old = self._waits.pop(message.device, None)
        news: list[FromWorker] = []
        if old is not None:
            news.append(Reply(old.reply_id, False, error=f"{old.verb} gave way to {message.verb}"))
        match message.verb:
            case "enable":
                self._tried(drive.enable)
            case "disable":
                drive.wanted = False
            case "quick_stop":
                drive.quick_stop()
            case "reset":
                drive.wanted, drive.resets = None, True
        self._waits[message.device] = _Wait(message.reply_id, message.verb, self._clock.now() + SLOW)
        return news

    def _object(self, message: Request, drive: Drive) -> Reply:
        index, _, sub = message.item.partition(":")
        try:
            place = int(index, 16), int(sub or "0", 16)
            if message.verb == "read":
                return Reply(message.reply_id, True, drive.read(*place))
            drive.write(*place, message.value)
            return Reply(message.reply_id, True, message.value)
        except (KeyError, ValueError, TypeError):
            return Reply(message.reply_id, False, error=f"no object {message.item!r} is known here, or no such value")
        except (SdoAbortedError, SdoCommunicationError) as error:
            return Reply(message.reply_id, False, error=f"drive {message.device} refuses {message.item}: {error}")

    def _look(self, number: int, drive: Drive, now: float) -> list[FromWorker]:
        """What has become of a drive."""
        news: list[FromWorker] = [Happened(number, "emergency", one) for one in drive.emergencies]
        drive.emergencies = []
        if number in self._lost:
            return news + self._look_for(number, drive, now)
        if now - drive.heard_at > PATIENCE or drive.booted:
            reason = "it has started anew" if drive.booted else "it says nothing"
            self._lost[number] = now
            wait = self._waits.pop(number, None)
            if wait is not None:
                news.append(Reply(wait.reply_id, False, error=f"drive {number} is lost: {reason}"))
            return [*news, DeviceState(number, "ok", "lost", reason)]
        return news + self._waited(number, drive, now)

    def _look_for(self, number: int, drive: Drive, now: float) -> list[FromWorker]:
        """A lost drive that speaks again is set up again."""
        if drive.heard_at <= self._lost[number] and not drive.booted:
            return []
        assert self._network is not None
        try:
            self._drives[number] = Drive(self._network, number, self._period, now)
        except Unavailable:
            self._lost[number] = self._clock.now()
            drive.booted = False
            return []
        del self._lost[number]
        return [DeviceState(number, "lost", "back", ""), DeviceState(number, "back", "ok", "")]

    def _waited(self, number: int, drive: Drive, now: float) -> list[FromWorker]:
        wait = self._waits.get(number)
        if wait is None:
            return []
        state = drive.state
        if state in _GOALS[wait.verb]:
            drive.resets = False
            del self._waits[number]
            return [Reply(wait.reply_id, True, state)]
        hopeless = state == c.FAULT and wait.verb != "reset"
        if not hopeless and now < wait.until:
            return []
        del self._waits[number]
        drive.resets = False
        if wait.verb == "enable":
            drive.wanted = None
        return [Reply(wait.reply_id, False, error=f"drive {number} stays in {state}")]
