"""What a worker runs on an NXT: messages in, messages out.  Devices are "A" to "C", 1 to 4, and "brick".

One telegram is in flight at a time.  A reply that has not arrived at the end of a tick is awaited in the next one: a
slow link (Bluetooth takes some 30 ms per reply) makes readings rarer and does not delay ticks.  Targets are sent before
each reading, and do not wait for a late or lost reply, because most of them request no reply.

Targets: see ``motion``; watches: see ``reading``.  "write" requests: ("brick", "telegram", bytes) sends a command,
beginning with its opcode, and returns the reply, beginning with its opcode; ("brick", "silent", bytes) sends a command
without a reply; (port, "i2c", (data, count)) returns the bytes read; (motor, "rotation", 0) resets the rotation count.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any

from urbihw.buses.driver import Driver, ImpliedTarget, no_stop
from urbihw.buses.errors import BadFrame, BadValue, BusError, BusTimeout, LinkGone, Unavailable
from urbihw.buses.link import Port, byte_link
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    Found,
    FromWorker,
    Limit,
    Refused,
    Reply,
    Request,
    Samples,
    Watch,
)
from urbihw.buses.readings import Quantity
from urbihw.frozen import frozen
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.exchange import NxtExchange
from urbihw.platforms.nxt.i2c import transfer
from urbihw.platforms.nxt.motion import EXCLUSIVE, NxtMotion
from urbihw.platforms.nxt.reading import BRICK, Plan, ReadingJob

KEEP_ALIVE = 60.0
"""Seconds between KEEPALIVEs: the shortest sleep limit in the brick's menu is 2 minutes."""
PROTOCOL = 1
"""The supported major version of the protocol."""
_SHARE = 0.8  # share of a tick that readings may use
_NEXT = 0.9  # share of a tick after which the next one may begin
_TRIES = 2


@frozen
class FoundBrick:
    """The identification in ``Found``; versions as text, ``sleep_limit`` in s, 0 for never."""

    name: str
    address: str
    firmware: str
    protocol: str
    free: int
    sleep_limit: float


class NxtDriver(Driver):
    """Drives a brick over one link; ``urbihw.buses.driver.Driver`` tells when each method is called."""

    quantities = {"millivolts": Quantity("voltage", "V", 1e-3)}
    exclusive = EXCLUSIVE

    def __init__(self) -> None:
        self._settings = Configure()
        self._exchange: NxtExchange | None = None
        self._plan = Plan()
        self._motion = NxtMotion()
        self._pending: ReadingJob | None = None
        self._active_motors: frozenset[str] = frozenset()
        self._moved: set[str] = set()
        self._began_program = False
        self._rotations: dict[str, int] = {}
        self._keep_alive_at = 0.0
        self._next_tick = 0.0

    def configure(self, settings: Configure) -> None:
        """Apply new settings; the options concern the robot, not the link."""
        self._settings = settings

    def attach(self, port: Port) -> list[FromWorker]:
        """Identify the brick.  Raises Unavailable for another protocol, LinkGone."""
        exchange = NxtExchange(byte_link(port))
        try:
            found = self._identify(exchange)
        except (LinkGone, Unavailable):
            raise
        except BusError as error:
            raise Unavailable(
                f"{port.url.text}: no NXT answers: is it switched on, and does it run the firmware of LEGO? ({error})"
            ) from error
        now = port.clock.now()
        self.identity = found.address
        self._exchange = exchange
        self._pending = None
        self._rotations = self._read_rotations(exchange)
        self._plan.restart(now)
        self._keep_alive_at = now + KEEP_ALIVE
        return [Found((found,))]

    def detach(self) -> None:
        """Drop the closed link and the targets."""
        self._exchange = None
        self._pending = None
        self._motion.drop_targets()

    def tick(
        self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop
    ) -> list[FromWorker]:
        """Send targets, then read until most of the tick is over.  Raises LinkGone."""
        exchange = self._exchange
        if exchange is None:
            return []
        clock = exchange.link.clock
        end = now + _SHARE / self._settings.rate
        self._next_tick = now + _NEXT / self._settings.rate
        result = _TickResult()
        if exchange.is_late:
            self._send_targets(exchange, clock.now())
        while True:
            if not exchange.is_busy:
                self._send_targets(exchange, clock.now())
                if not self._send_next_request(exchange, clock.now()):
                    break
                meanwhile()
            if not self._collect_reply(exchange, end, result):
                break
            if urgent():
                break
            if clock.now() >= end:
                if not exchange.is_busy:
                    self._send_targets(exchange, clock.now())
                break
        return result.messages()

    def set_target(self, device: Any, item: str, value: Any) -> None:
        if self._exchange is not None:
            self._motion.set_target(device, item, value)

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Begin, change or end a watch."""
        try:
            self._plan.watch(message.device, message.items, message.period, now)
        except BadValue as error:
            return [Refused(message.device, ", ".join(message.items), str(error))]
        return []

    def execute_request(self, message: Request) -> list[FromWorker]:
        exchange = self._exchange
        if exchange is None:
            raise BadValue("the link is down")
        self._pending = None
        try:
            return [Reply(message.reply_id, True, self._send_request(exchange, message))]
        except p.BrickRefused:
            exchange.counters.refused += 1
            raise

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Hold all or some motors, or coast with ``torque_off_on_stop``; end the sound.  Raises LinkGone.

        A full stop also ends the program on the brick, which would move the motors again; that of the brick alone ends
        one that a telegram has begun: the lease of its client is over. Its end lets all motors coast, so all are held.
        """
        self._motion.drop_targets(devices)
        exchange, self._pending = self._exchange, None
        if exchange is None:
            return
        ports = [port for port in p.OUTPUTS if devices is None or port in devices]
        try:
            self._stop_motors(exchange, ports, silence=devices is None or BRICK in devices)
        except BusError as error:
            raise LinkGone(f"{exchange.link.url.text}: the brick did not confirm that it stopped ({error})") from error
        if devices is None or (BRICK in devices and self._began_program):
            self.stop_again()
        self._moved -= {*ports}

    def stop_again(self) -> None:
        """End a program on the brick, and the motion of the motors, which its end lets coast.  Raises LinkGone."""
        self._began_program = False
        if self._exchange is not None:
            for telegram in (p.stop_program(), self._stop_telegram(p.ALL_OUTPUTS)):
                self._exchange.send(telegram)

    def stop_on_reconnect(self) -> tuple[Any, ...]:
        """Stop the motors if one was moved; else those that run: another brick may be at the link.  Raises LinkGone."""
        if self._moved:
            self.safe_stop()
            return ()
        return self.stop_what_moves()

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Stop the motors that already run, and return their ports.  Raises LinkGone."""
        exchange = self._exchange
        if exchange is None:
            return ()
        try:
            running = [
                port
                for number, port in enumerate(p.OUTPUTS)
                if p.parse_output_runs(_request_with_retries(exchange, p.output_state(number)))
            ]
            self._stop_motors(exchange, running, silence=False)
        except BusError as error:
            raise LinkGone(f"{exchange.link.url.text}: the brick did not confirm that it stopped ({error})") from error
        return tuple(running)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Return whether the target is a power other than 0, or a goal."""
        return device in p.OUTPUTS and (item == "goal" or (item == "power" and value != 0))

    def request_moves(self, request: Request) -> bool:
        """Return whether the telegram runs a motor, starts a program or plays a sound."""
        telegram = request.value
        return request.device == BRICK and isinstance(telegram, bytes) and telegram[:1] in p.MOVING_OPCODES

    def implied_targets(self, request: Request) -> Iterable[ImpliedTarget]:
        """Return the power of a telegram that runs motors."""
        telegram = request.value
        if request.device != BRICK or not isinstance(telegram, bytes) or telegram[:1] != b"\x04" or len(telegram) < 3:
            return ()
        power = int.from_bytes(telegram[2:3], "little", signed=True)
        return [ImpliedTarget(port, "power", power) for port in p.outputs_of(b"\x00" + telegram)]

    def displaced(self, request: Request) -> tuple[Any, ...]:
        """The motors that a telegram runs or stops."""
        telegram = request.value
        is_telegram = request.device == BRICK and isinstance(telegram, bytes)
        return tuple(p.outputs_of(b"\x00" + telegram)) if is_telegram else ()

    def limits_changed(self, limits: Mapping[tuple[Any, str], Limit]) -> None:
        """Go to positions with no more than the power that is allowed."""
        self._motion.limits = limits

    def pose(self, device: Any, item: str) -> float | None:
        """Return the rotation count as last read, in degrees, for the goal of a motor; nan before that."""
        return self._rotations.get(device, math.nan) if item == "goal" else None

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """Return a goal unrounded: it may be a fraction of a degree."""
        return signed if item == "goal" else round(signed)

    def errors(self) -> dict[str, int]:
        """Return failures since ``attach``, by kind."""
        return {} if self._exchange is None else asdict(self._exchange.counters)

    # ---------------------------------------------------------------- attaching

    def _identify(self, exchange: NxtExchange) -> FoundBrick:
        version = p.parse_version(_request_with_retries(exchange, p.firmware_version()))
        if version.protocol[0] != PROTOCOL:
            raise Unavailable(
                f"{exchange.link.url.text}: the brick speaks protocol {_dotted(version.protocol)}, "
                f"urbihw {PROTOCOL}.x; install the firmware of LEGO"
            )
        info = p.parse_device_info(_request_with_retries(exchange, p.device_info()))
        limit = p.parse_sleep_limit(_request_with_retries(exchange, p.keep_alive(reply=True)))
        return FoundBrick(
            info.name, info.address, _dotted(version.firmware), _dotted(version.protocol), info.free, limit / 1000
        )

    def _read_rotations(self, exchange: NxtExchange) -> dict[str, int]:
        """Return the rotation counts of the motors this driver has moved: they may have run on without the link."""
        found = {}
        for number, port in enumerate(p.OUTPUTS):
            if port in self._moved:
                with contextlib.suppress(BusTimeout, BadFrame, p.BrickRefused):
                    found[port] = p.parse_output_state(_request_with_retries(exchange, p.output_state(number))).rotation
        return found

    def _stop_motors(self, exchange: NxtExchange, ports: Iterable[str], *, silence: bool) -> None:
        ports = list(ports)
        outputs = [p.ALL_OUTPUTS] if len(ports) == len(p.OUTPUTS) else [p.OUTPUTS.index(port) for port in ports]
        for output in outputs:
            p.body(_request_with_retries(exchange, p.replied(self._stop_telegram(output))), 0)
        if silence:
            exchange.send(p.stop_sound())

    def _stop_telegram(self, output: int) -> bytes:
        return p.coast(output) if self._settings.torque_off_on_stop else p.run(output, 0)

    # ---------------------------------------------------------------- a tick

    def _send_targets(self, exchange: NxtExchange, now: float) -> None:
        for telegram in self._motion.silent_telegrams(now):
            self._send_silently(exchange, telegram)
        if now >= self._keep_alive_at:
            self._keep_alive_at = now + KEEP_ALIVE
            exchange.send(p.keep_alive(reply=False))

    def _send_silently(self, exchange: NxtExchange, telegram: bytes) -> None:
        self._moved |= p.outputs_of(telegram)
        exchange.send(telegram)

    def _send_next_request(self, exchange: NxtExchange, now: float) -> bool:
        """Send the next telegram that requests a reply; return False if there is none."""
        telegram = self._motion.next_request()
        self._pending = None
        if telegram is None:
            self._pending = self._plan.next_job(now)
            if self._pending is None:
                return False
            telegram = self._pending.telegram(now)
        self._active_motors = self._motion.active_motors()
        exchange.send_request(telegram)
        return True

    def _collect_reply(self, exchange: NxtExchange, end: float, result: _TickResult) -> bool:
        """Process the reply; return False while it has not arrived.  Raises LinkGone."""
        job = self._pending
        values = None
        try:
            reply = exchange.poll_reply(end)
            if reply is None:
                return False
            now = exchange.link.clock.now()
            if job is None:
                p.body(reply, 0)
                return True
            if not self._plan.is_wanted(job):
                return True
            values = job.parse_reply(reply, now)
        except p.BrickRefused as error:
            exchange.counters.refused += 1
            result.add_refusal(job, error)
        except (BusTimeout, BadFrame):
            now = exchange.link.clock.now()
            values = None if job is None else job.failed(now)
        if job is None:
            return True
        job.rest_until(self._next_tick)
        if values is not None:
            result.add_reading(job.device, values, now)
            if "rotation" in values:
                if job.device in self._active_motors and not p.is_on(values["mode"]):
                    # Its counts started again at 0, so the goals are void.
                    raise LinkGone(f"{exchange.link.url.text}: the brick was switched off and on, or forgot its motors")
                self._rotations[job.device] = values["rotation"]
                for telegram in self._motion.control_position(job.device, values["rotation"]):
                    self._send_silently(exchange, telegram)
        return True

    # ---------------------------------------------------------------- requests

    def _note_telegram(self, telegram: bytes) -> None:
        outputs = p.outputs_of(telegram)
        self._moved |= outputs
        self._motion.drop_goals(outputs)
        self._began_program = self._began_program or telegram[1:2] == p.START_PROGRAM

    def _send_request(self, exchange: NxtExchange, message: Request) -> Any:
        device, item, value = message.device, message.item, message.value
        if (message.verb, device, item) == ("write", BRICK, "telegram"):
            raw = p.raw(value, reply=True)
            self._note_telegram(raw)
            return _request_with_retries(exchange, raw, tries=1)[1:]
        if (message.verb, device, item) == ("write", BRICK, "silent"):
            raw = p.raw(value, reply=False)
            self._note_telegram(raw)
            exchange.send(raw)
            return None
        if (message.verb, item) == ("write", "i2c") and device in p.INPUTS:
            data, count = value
            return transfer(exchange, device - 1, data, count)
        if (message.verb, item) == ("write", "rotation") and device in p.OUTPUTS:
            p.body(_request_with_retries(exchange, p.reset_rotation(p.OUTPUTS.index(device))), 0)
            return 0
        if (message.verb, device, item) == ("read", BRICK, "millivolts"):
            return p.parse_battery(_request_with_retries(exchange, p.battery()))
        raise BadValue(f"port {device!r} of an NXT has no {item!r} to {message.verb}")


class _TickResult:
    """The values and refusals of one tick."""

    def __init__(self) -> None:
        self._values: dict[Any, dict[str, Any]] = {}
        self._times: dict[Any, float] = {}
        self._refusals: list[FromWorker] = []

    def add_reading(self, device: Any, values: dict[str, Any], now: float) -> None:
        """Add the values of a device."""
        self._values.setdefault(device, {}).update(values)
        self._times[device] = now

    def add_refusal(self, job: ReadingJob | None, error: p.BrickRefused) -> None:
        """Add a refusal by the brick."""
        self._refusals.append(DeviceReport(BRICK if job is None else job.device, "refused", str(error)))

    def messages(self) -> list[FromWorker]:
        """Return the messages to post."""
        if not self._values:
            return self._refusals
        return [*self._refusals, Samples(max(self._times.values()), self._values, self._times)]


def _request_with_retries(exchange: NxtExchange, telegram: bytes, tries: int = _TRIES) -> bytes:
    """Return the reply to a telegram that may be sent again.  Raises BusTimeout, BadFrame, LinkGone."""
    for attempt in range(tries):
        try:
            return exchange.request(telegram)
        except (BusTimeout, BadFrame):
            if attempt == tries - 1:
                raise
    raise BadValue("no tries")


def _dotted(version: tuple[int, int]) -> str:
    return f"{version[0]}.{version[1]:02d}"
