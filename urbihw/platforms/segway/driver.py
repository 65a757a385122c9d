"""The driver of an RMP in the worker: one command per tick.

The base executes a command for about 0.4 s and then ramps to zero by itself (Segway's overview of the RMP; Orca). The
commands of a standing robot are zeros, and the base stops when this process dies. Nothing is sent before a frame of the
base has arrived: on a bus with other devices 0x0413 may mean something else.

When the motors were switched off, however briefly, by hand, by a fault or by a mode, the driver reports a stop to the
engine (`halted`): they start again at zero. While they are off, no speed is accepted. A change between the modes with
motors is a stop too, unless this driver requested it.

Two commands are at least SPACING apart (the maker requires 10 ms): a tick that follows too soon after a late one sends
nothing.

The option "second_channel" is the other bus of the same base (see `channels`), "second_base" the other half of an RMP
400 (see `bases`): both get the same commands. When the line to one half is gone, the other gets a stop.

Device: "base". Targets: "velocity", "turn", in counts. Requests: "write" of a row of `protocol.CONFIGURATIONS`, "read"
of a value of the last cycle, "shutdown" (switches the base off: a balancing one falls).
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw import buses
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.clock import BusClock, BusRealClock
from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadValue, BusTimeout, LinkGone
from urbihw.buses.link import Port
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    DeviceState,
    Found,
    FromWorker,
    Reply,
    Request,
    Samples,
    Watch,
)
from urbihw.buses.readings import ALARM, Quantity, Reading
from urbihw.frozen import frozen
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway.bases import Bases
from urbihw.platforms.segway.channels import DoubleLine
from urbihw.platforms.segway.line import RmpLine, line_over
from urbihw.platforms.segway.monitor import MOVING_MODES, OTHER_MODE
from urbihw.platforms.segway.options import SegwayOptions
from urbihw.platforms.segway.orders import Orders

BASE: Final = "base"
SPACING: Final = 0.012
"""Minimum time between two commands, in seconds."""
SLOWEST, FASTEST = 20.0, 50.0
"""Ticks per second: a command every 20 to 50 ms."""
SILENCE: Final = 0.25
"""Seconds without a frame of the base after which it is lost."""
_FIRST_FRAME_S: Final = 1.0
"""Seconds to wait for the first frame after the link was opened."""
_REMEMBERED: Final = 50
_FOREIGN_PAUSE: Final = 10.0
"""Seconds between two reports of foreign commands."""
_LIMITS: Final = {"velocity": p.MOST_VELOCITY, "turn": p.MOST_TURN}


@frozen
class BaseInfo:
    """The identification in `Found`: the firmware build, and whether it is the oldest firmware."""

    build: int
    old: bool


class RmpDriver(Driver):
    """Drives a base over one port; `urbihw.buses.driver.Driver` tells when each method is called."""

    device_info = BaseInfo
    quantities = {"battery": Quantity("voltage", "V", 0.25)}

    def __init__(self) -> None:
        self._clock: BusClock = BusRealClock()
        self._lines: list[RmpLine] = []
        self._more_ports: list[Port] = []
        self._options = SegwayOptions()
        self._monitor = Bases()
        self._orders = Orders()
        self._speeds = dict.fromkeys(_LIMITS, 0)
        self._state = ""
        # Items whose targets were refused since the motors went off.
        self._refused: set[str] = set()
        self._stops_itself = False
        self._asked_mode: int | None = None
        self._attached_at = 0.0
        self._sent_at = -math.inf
        self._unsent = 0
        self._restarts = 0
        self._fall_on_stop = False
        self._tick = 1 / FASTEST
        self._period: float | None = None
        self._next_sample = 0.0
        self._sampled_at: float | None = None
        self._pending_messages: list[FromWorker] = []
        # Multicast returns our own commands; all other commands are foreign.
        self._own: deque[bytes] = deque(maxlen=_REMEMBERED)
        self._foreign_at = -math.inf

    # ---------------------------------------------------------------- the engine's calls

    def configure(self, settings: Configure) -> None:
        """Apply settings. Raises BadValue for an invalid rate, BadSetting for an option."""
        if not SLOWEST <= settings.rate <= FASTEST:
            raise BadValue(f"commands go out every 20 to 50 ms, so the rate must be 20 to 50, not {settings.rate:g}")
        self._options = SegwayOptions.of(settings.options)
        self._fall_on_stop = settings.torque_off_on_stop
        self._tick = 1 / settings.rate

    def attach(self, port: Port) -> list[FromWorker]:
        """Use an open port, and open those of the options; the base is found when its first cycle arrives.

        Raises Unavailable if the second half of an RMP 400 cannot be reached, BadUrl.
        """
        self._lines = self._make_lines(port)
        for line in self._lines:
            # Frames that were buffered before are too old.
            line.receive()
        self._clock = port.clock
        self._attached_at = self._clock.now()
        self._state = ""
        return []

    def detach(self) -> None:
        """Drop the closed port, speeds and orders; stop what is behind the other ports, and close them."""
        self._stop_lines()
        for line in self._lines:
            if isinstance(line, DoubleLine):
                line.close()
        self._lines = []
        for port in self._more_ports:
            port.close()
        self._more_ports = []
        self._state = ""
        self._unsent = 0
        self._monitor.drop_partial()
        self._halt()
        self._pending_messages += self._orders.drop_all("the link went down")

    def tick(
        self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop
    ) -> list[FromWorker]:
        """Send a command, then process the received frames."""
        news, self._pending_messages = self._pending_messages, []
        if not self._lines:
            return news
        if self._known and now >= self._sent_at + SPACING:
            self._send_command(now)
        meanwhile()
        for which, line in enumerate(self._lines):
            try:
                frames = line.receive()
            except LinkGone:
                self._stop_lines()
                raise
            now = self._clock.now()
            for frame in frames:
                if frame.id == p.COMMAND:
                    news += self._check_foreign(frame, now)
                self._monitor.add_frame(which, frame, now)
            if isinstance(line, DoubleLine):
                news += [DeviceReport(BASE, "channel", text) for text in line.pop_news()]
        return news + self._check_base(now)

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Accept a new speed for the next command. Without a base it is dropped.

        While the motors are off it is refused; one refusal per item is posted each time the motors go off.
        """
        if device != BASE or item not in _LIMITS or not isinstance(value, int):
            raise BadValue(f"no such target, or {value!r} is no number of counts")
        if self._state == "ok" and not (value and self._monitor.motors_off):
            self._speeds[item] = value
        elif self._state == "ok" and item not in self._refused:
            self._refused.add(item)
            raise BadValue("the motors of the base are off")

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Post the last cycle, with all items, every `period` seconds, at most once per tick."""
        self._period = message.period
        self._next_sample = now
        return []

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Execute a request: see the head of this file."""
        if self._state != "ok":
            raise BadValue("the base is not there")
        match message.verb:
            case "write":
                parameter = message.value if isinstance(message.value, int) else -1
                error = self._orders.add_order(message.reply_id, message.item, parameter)
                return [Reply(message.reply_id, False, error=error)] if error else []
            case "read":
                value = self._monitor.latest.get(message.item)
                error = "" if value is not None else f"the base says nothing of {message.item!r}"
                return [Reply(message.reply_id, not error, value, error)]
            case "shutdown":
                self._halt()
                self._send(CanFrame(p.SHUTDOWN, bytes(8)))
                return [Reply(message.reply_id, True)]
            case _:
                raise BadValue(f"an RMP does not know {message.verb!r}")

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Set speed and turn to zero and send the command, SPACING after the last one."""
        self._halt()
        mine, self._stops_itself = self._stops_itself, False
        if not mine:
            self._pending_messages += self._orders.drop_all("the robot was stopped")
        self._refused.clear()
        if not self._lines or not self._known:
            return
        if self._fall_on_stop and not mine:
            self._orders.add_order(0, "mode", 0)
        # The clock may wake up a moment too early; the stop is sent all the same.
        self._clock.sleep_until(self._sent_at + SPACING)
        self._send_command(self._clock.now())

    def stop_again(self) -> None:
        """Do nothing: a command with zero speeds goes out in each tick, on both channels."""

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Return whether the speed is not zero."""
        return bool(value)

    def request_moves(self, request: Request) -> bool:
        """Return whether the request sets a mode in which the motors are on."""
        return request.verb == "write" and request.item == "mode" and request.value in MOVING_MODES

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return the faults of both status words, and the voltage beside the one below which the battery is low."""
        if item == "status1" and raw.__class__ is int:
            return Reading(ALARM, p.fault_words(raw, self._monitor.latest.get("status2", 0)))
        found = super().reading(device, item, raw)
        return found and found._replace(low=p.LOW_VOLTAGE)

    def errors(self) -> dict[str, int]:
        """Return the number of failures since `attach`."""
        return {"damaged": sum(line.damaged for line in self._lines), "unsent": self._unsent}

    # ---------------------------------------------------------------- commands

    @property
    def _known(self) -> bool:
        """Whether a cycle of the base has arrived on this port: nothing is sent before."""
        cycle = self._monitor.cycle_at
        return cycle is not None and cycle >= self._attached_at

    def _halt(self) -> None:
        self._speeds = dict.fromkeys(_LIMITS, 0)

    def _stop_by_itself(self, reason: str) -> None:
        """Set the speeds to zero; report a stop if a speed was set or refused."""
        if any(self._speeds.values()) or self._refused:
            self.halted = reason
            # This stop keeps the pending configurations.
            self._stops_itself = True
        self._halt()
        self._refused.clear()

    def _send_command(self, now: float) -> None:
        order = self._orders.next_order(now)
        number, parameter = 0, 0
        if order is not None:
            name, parameter = order
            number = p.CONFIGURATIONS[name][0]
            if name == "reset":
                self._monitor.reset(parameter, now)
            elif name == "mode":
                self._asked_mode = parameter
                if parameter not in MOVING_MODES:
                    self._stop_by_itself("a mode without motors was asked for")
        # A configuration command also carries the speeds: with zeros the base would jerk.
        self._send(CanFrame(p.COMMAND, p.command(self._speeds["velocity"], self._speeds["turn"], number, parameter)))
        # Read the clock after sending: on a busy machine some time has passed since the tick began.
        self._sent_at = self._clock.now()

    def _send(self, frame: CanFrame) -> None:
        self._own.append(frame.data)
        for line in self._lines:
            try:
                line.send(frame)
            except BusTimeout:
                # There is no acknowledgement; the silence time-out reports a lost base.
                self._unsent += 1
            except LinkGone:
                self._stop_lines()
                raise

    # ---------------------------------------------------------------- the lines

    def _make_lines(self, port: Port) -> list[RmpLine]:
        options = self._options
        self._monitor.set_count(2 if options.second_base else 1)
        if options.second_channel:
            second = buses.port_for(options.second_channel, port.context)
            return [DoubleLine(port, second)]
        if options.second_base:
            second = buses.open(options.second_base, port.context)
            self._more_ports.append(second)
            return [line_over(port), line_over(second)]
        return [line_over(port)]

    def _stop_lines(self) -> None:
        """Send a stop on all lines that still work: one half of an RMP 400 must not go on without the other."""
        if len(self._lines) > 1 and self._known:
            for line in self._lines:
                with contextlib.suppress(LinkGone, BusTimeout):
                    line.send(CanFrame(p.COMMAND, p.command(0, 0)))

    # ---------------------------------------------------------------- what is on the bus

    def _check_foreign(self, frame: CanFrame, now: float) -> list[FromWorker]:
        """Report a command on the bus that this driver has not sent."""
        if frame.data in self._own or now - self._foreign_at < _FOREIGN_PAUSE:
            return []
        self._foreign_at = now
        return [DeviceReport(BASE, "commanded by another")]

    def _check_base(self, now: float) -> list[FromWorker]:
        news: list[FromWorker] = []
        heard = self._monitor.heard_at
        alive = self._known and heard is not None and now - heard <= SILENCE
        if alive and self._state != "ok":
            news += self._found()
        elif not alive and (self._state == "ok" or (not self._state and now - self._attached_at > _FIRST_FRAME_S)):
            news += self._lost(now)
        if self._restarts != self._monitor.restarts:
            self._restarts = self._monitor.restarts
            news.append(DeviceReport(BASE, "restarted"))
            self._stop_by_itself("the base was switched off and on")
        switched = self._monitor.pop_switched()
        if switched and not (switched == OTHER_MODE and self._monitor.mode == self._asked_mode):
            self._stop_by_itself(switched)
        latest = self._monitor.latest
        news += self._orders.check_progress(latest, now)
        news += self._sample(latest, now)
        return news

    def _sample(self, latest: Mapping[str, int], now: float) -> list[FromWorker]:
        """Return the last cycle if it is new and due."""
        heard = self._monitor.heard_at
        # A sample may be up to half a tick early.
        early = now < self._next_sample - self._tick / 2
        if self._state != "ok" or self._period is None or heard in (None, self._sampled_at) or early:
            return []
        self._sampled_at = heard
        self._next_sample += self._period
        if self._next_sample < now - self._period:
            self._next_sample = now
        return [Samples(now, {BASE: latest}, {BASE: now})]

    def _found(self) -> list[FromWorker]:
        before, self._state = self._state, "ok"
        if before == "lost":
            return [DeviceState(BASE, "lost", "back", ""), DeviceState(BASE, "back", "ok", "")]
        return [Found((BaseInfo(self._monitor.latest.get("build", 0), self._monitor.old),))]

    def _lost(self, now: float) -> list[FromWorker]:
        before, self._state = self._state, "lost"
        self._halt()
        off = self._monitor.off_at
        if off is not None and now - off <= SILENCE:
            reason = "it is switched off, says its user interface box"
        else:
            reason = self._monitor.silent_words(now - SILENCE)
        replies: list[Any] = self._orders.drop_all(f"the base is lost: {reason}")
        return [*replies, DeviceState(BASE, before or "ok", "lost", reason)]
