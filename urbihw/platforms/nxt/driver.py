"""What a worker runs on an NXT: messages in, messages out.  Devices are "A" to "C", 1 to 4, and "brick".

One telegram is in flight at a time.  A reply that is not there at the end of a tick is awaited in the next, so a slow
link (Bluetooth takes some 30 ms a reply) makes readings rarer but ticks no later; targets go out before each reading.
When a reply is late or lost they do not wait for it: most want none themselves.

Targets: see ``motion``; watches: see ``reading``.  "write" requests: ("brick", "telegram", bytes) sends a command from
its opcode on and gives the reply from its opcode on; ("brick", "silent", bytes) sends one without a reply; (port,
"i2c", (data, count)) gives the bytes read; (motor, "rotation", 0) resets the count of degrees.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from urbihw.buses.driver import Driver, never
from urbihw.buses.errors import BadFrame, BadValue, BusError, BusTimeout, LinkGone, Unavailable
from urbihw.buses.link import Port, byte_link
from urbihw.buses.messages import (
    Configure,
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
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.exchange import Exchange
from urbihw.platforms.nxt.i2c import transfer
from urbihw.platforms.nxt.motion import Motion
from urbihw.platforms.nxt.reading import BRICK, Job, Plan

KEEP_ALIVE = 60.0
"""Seconds between KEEPALIVEs: the shortest sleep limit in the brick's menu is 2 minutes."""
PROTOCOL = 1
"""The major version of the protocol that is spoken here."""
_SHARE = 0.8  # of a tick, for readings
_NEXT = 0.9  # of a tick; later is the next one, which may begin a little early
_TRIES = 2


@dataclass(frozen=True, slots=True)
class FoundBrick:
    """What ``Found`` tells; versions as text, ``sleep_limit`` in s, 0 for never."""

    name: str
    address: str
    firmware: str
    protocol: str
    free: int
    sleep_limit: float


class NxtDriver(Driver):
    """See ``urbihw.buses.driver.Driver`` for who calls what."""

    def __init__(self) -> None:
        self._settings = Configure()
        self._exchange: Exchange | None = None
        self._plan = Plan()
        self._motion = Motion()
        self._pending: Job | None = None
        self._on: frozenset[str] = frozenset()
        self._moved: set[str] = set()
        self._rotations: dict[str, int] = {}
        self._keep_alive_at = 0.0
        self._next_tick = 0.0

    def configure(self, settings: Configure) -> None:
        """Take new settings; the options are those of the robot, not of the wire."""
        self._settings = settings

    def attach(self, port: Port) -> list[FromWorker]:
        """Meet the brick."""
        exchange = Exchange(byte_link(port))
        try:
            found = self._meet(exchange)
        except (LinkGone, Unavailable):
            raise
        except BusError as error:
            raise Unavailable(
                f"{port.url.text}: no NXT answers: is it switched on, and does it run the firmware of LEGO? ({error})"
            ) from error
        now = port.clock.now()
        self._exchange = exchange
        self._pending = None
        self._rotations = self._look_where_motors_are(exchange)
        self._plan.restart(now)
        self._keep_alive_at = now + KEEP_ALIVE
        return [Found((found,))]

    def detach(self) -> None:
        """Let go of the link: it is gone.  Targets are forgotten."""
        self._exchange = None
        self._pending = None
        self._motion.forget()

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = never) -> list[FromWorker]:
        """Send targets, then read until most of the tick is over.  Raises LinkGone."""
        exchange = self._exchange
        if exchange is None:
            return []
        clock = exchange.link.clock
        end = now + _SHARE / self._settings.rate
        self._next_tick = now + _NEXT / self._settings.rate
        gathered = _Gathered()
        if exchange.late:
            self._send_targets(exchange, clock.now())
        while True:
            if not exchange.busy:
                self._send_targets(exchange, clock.now())
                if not self._begin(exchange, clock.now()):
                    break
                meanwhile()
            if not self._collect(exchange, end, gathered):
                break
            if urgent():
                break
            if clock.now() >= end:
                if not exchange.busy:
                    self._send_targets(exchange, clock.now())
                break
        return gathered.messages()

    def targets(self, message: Targets) -> list[FromWorker]:
        """Take targets for the next tick."""
        if self._exchange is None:
            return []
        refused: list[FromWorker] = []
        for (device, item), value in message.values.items():
            try:
                self._motion.aim(device, item, value)
            except BadValue as error:
                refused.append(Refused(device, item, str(error)))
        return refused

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Begin, change or end a watch."""
        try:
            self._plan.watch(message.device, message.items, message.period, now)
        except BadValue as error:
            return [Refused(message.device, ", ".join(message.items), str(error))]
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """Do something once.  Raises LinkGone, after which the request is to be answered as failed."""
        exchange = self._exchange
        if exchange is None:
            return [Reply(message.reply_id, False, error="the link is down")]
        self._pending = None
        try:
            return [Reply(message.reply_id, True, self._errand(exchange, message))]
        except LinkGone:
            raise
        except p.Refused as error:
            exchange.counters.refused += 1
            return [Reply(message.reply_id, False, error=str(error))]
        except BusError as error:
            return [Reply(message.reply_id, False, error=str(error))]

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """The motors, all or some, hold, or with ``torque_off_on_stop`` coast; silence.  Raises LinkGone."""
        self._motion.forget(devices)
        exchange, self._pending = self._exchange, None
        if exchange is None:
            return
        ports = [port for port in p.OUTPUTS if devices is None or port in devices]
        try:
            self._hold(exchange, ports, silence=devices is None or BRICK in devices)
        except BusError as error:
            raise LinkGone(f"{exchange.link.url.text}: the brick did not confirm that it stopped ({error})") from error
        self._moved -= {*ports}

    def rest(self) -> None:
        """See ``Driver``; a brick that nobody moved is left as it is.  Raises LinkGone."""
        if self._moved:
            self.safe_stop()

    def stop_what_moves(self) -> tuple[Any, ...]:
        """See ``Driver``: motors that run by themselves hold.  Raises LinkGone."""
        exchange = self._exchange
        if exchange is None:
            return ()
        try:
            running = [
                port
                for number, port in enumerate(p.OUTPUTS)
                if p.parse_output_runs(_patiently(exchange, p.output_state(number)))
            ]
            self._hold(exchange, running, silence=False)
        except BusError as error:
            raise LinkGone(f"{exchange.link.url.text}: the brick did not confirm that it stopped ({error})") from error
        return tuple(running)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Powers and goals of motors."""
        return device in p.OUTPUTS and (item == "goal" or (item == "power" and value != 0))

    def request_moves(self, request: Request) -> bool:
        """A telegram that runs a motor, starts a program or plays something."""
        telegram = request.value
        return request.device == BRICK and isinstance(telegram, bytes) and telegram[:1] in p.MOVING_OPCODES

    def implied(self, request: Request) -> Mapping[tuple[Any, str], Any]:
        """The power of a telegram that runs motors."""
        telegram = request.value
        if request.device != BRICK or not isinstance(telegram, bytes) or telegram[:1] != b"\x04" or len(telegram) < 3:
            return {}
        power = int.from_bytes(telegram[2:3], "little", signed=True)
        return {(port, "power"): power for port in p.outputs_of(b"\x00" + telegram)}

    def pose(self, device: Any, item: str) -> float | None:
        """The count of degrees as last read, for the goal of a motor."""
        return self._rotations.get(device) if item == "goal" else None

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """Goals may have parts of degrees."""
        return signed if item == "goal" else round(signed)

    def errors(self) -> dict[str, int]:
        """Return failures since ``attach``, by kind."""
        return {} if self._exchange is None else asdict(self._exchange.counters)

    # ---------------------------------------------------------------- attaching

    def _meet(self, exchange: Exchange) -> FoundBrick:
        version = p.parse_version(_patiently(exchange, p.firmware_version()))
        if version.protocol[0] != PROTOCOL:
            raise Unavailable(
                f"{exchange.link.url.text}: the brick speaks protocol {_dotted(version.protocol)}, "
                f"urbihw {PROTOCOL}.x; install the firmware of LEGO"
            )
        info = p.parse_device_info(_patiently(exchange, p.device_info()))
        limit = p.parse_sleep_limit(_patiently(exchange, p.keep_alive(reply=True)))
        return FoundBrick(
            info.name, info.address, _dotted(version.firmware), _dotted(version.protocol), info.free, limit / 1000
        )

    def _look_where_motors_are(self, exchange: Exchange) -> dict[str, int]:
        """The counts of degrees of the motors that we have moved: they may have run on while the link was lost."""
        found = {}
        for number, port in enumerate(p.OUTPUTS):
            if port in self._moved:
                with contextlib.suppress(BusTimeout, BadFrame, p.Refused):
                    found[port] = p.parse_output_state(_patiently(exchange, p.output_state(number))).rotation
        return found

    def _hold(self, exchange: Exchange, ports: Iterable[str], *, silence: bool) -> None:
        ports = list(ports)
        outputs = [p.ALL_OUTPUTS] if len(ports) == len(p.OUTPUTS) else [p.OUTPUTS.index(port) for port in ports]
        for output in outputs:
            stop = p.coast(output) if self._settings.torque_off_on_stop else p.run(output, 0)
            p.body(_patiently(exchange, p.replied(stop)), 0)
        if silence:
            exchange.tell(p.stop_sound())

    # ---------------------------------------------------------------- a tick

    def _send_targets(self, exchange: Exchange, now: float) -> None:
        for telegram in self._motion.silent(now):
            self._tell(exchange, telegram)
        if now >= self._keep_alive_at:
            self._keep_alive_at = now + KEEP_ALIVE
            exchange.tell(p.keep_alive(reply=False))

    def _tell(self, exchange: Exchange, telegram: bytes) -> None:
        self._moved |= p.outputs_of(telegram)
        exchange.tell(telegram)

    def _begin(self, exchange: Exchange, now: float) -> bool:
        """Send the next telegram that wants a reply; False when there is nothing to ask."""
        telegram = self._motion.asked()
        self._pending = None
        if telegram is None:
            self._pending = self._plan.next(now)
            if self._pending is None:
                return False
            telegram = self._pending.telegram(now)
        self._on = self._motion.on()
        exchange.begin(telegram)
        return True

    def _collect(self, exchange: Exchange, end: float, gathered: _Gathered) -> bool:
        """Take the reply in; False when it is not there yet.  Raises LinkGone."""
        job = self._pending
        values = None
        try:
            reply = exchange.poll(end)
            if reply is None:
                return False
            now = exchange.link.clock.now()
            if job is None:
                p.body(reply, 0)
                return True
            if not self._plan.holds(job):
                return True
            values = job.take(reply, now)
        except p.Refused as error:
            exchange.counters.refused += 1
            gathered.complain(job, error)
        except (BusTimeout, BadFrame):
            now = exchange.link.clock.now()
            values = None if job is None else job.failed(now)
        if job is None:
            return True
        job.rest_until(self._next_tick)
        if values is not None:
            gathered.add(job.device, values, now)
            if "rotation" in values:
                if job.device in self._on and not p.is_on(values["mode"]):
                    # Its counts and our goals have nothing to do with each other any more.
                    raise LinkGone(f"{exchange.link.url.text}: the brick was switched off and on, or forgot its motors")
                self._rotations[job.device] = values["rotation"]
                for telegram in self._motion.control(job.device, values["rotation"]):
                    self._tell(exchange, telegram)
        return True

    # ---------------------------------------------------------------- requests

    def _otherwise(self, telegram: bytes) -> None:
        outputs = p.outputs_of(telegram)
        self._moved |= outputs
        self._motion.told_otherwise(outputs)

    def _errand(self, exchange: Exchange, message: Request) -> Any:
        device, item, value = message.device, message.item, message.value
        if (message.verb, device, item) == ("write", BRICK, "telegram"):
            raw = p.raw(value, reply=True)
            self._otherwise(raw)
            return _patiently(exchange, raw, tries=1)[1:]
        if (message.verb, device, item) == ("write", BRICK, "silent"):
            raw = p.raw(value, reply=False)
            self._otherwise(raw)
            exchange.tell(raw)
            return None
        if (message.verb, item) == ("write", "i2c") and device in p.INPUTS:
            data, count = value
            return transfer(exchange, device - 1, data, count)
        if (message.verb, item) == ("write", "rotation") and device in p.OUTPUTS:
            p.body(_patiently(exchange, p.reset_rotation(p.OUTPUTS.index(device))), 0)
            return 0
        if (message.verb, device, item) == ("read", BRICK, "millivolts"):
            return p.parse_battery(_patiently(exchange, p.battery()))
        raise BadValue(f"port {device!r} of an NXT has no {item!r} to {message.verb}")


class _Gathered:
    """What a tick brought."""

    def __init__(self) -> None:
        self._values: dict[Any, dict[str, Any]] = {}
        self._times: dict[Any, float] = {}
        self._complaints: list[FromWorker] = []

    def add(self, device: Any, values: dict[str, Any], now: float) -> None:
        """A device was read."""
        self._values.setdefault(device, {}).update(values)
        self._times[device] = now

    def complain(self, job: Job | None, error: p.Refused) -> None:
        """The brick refused something."""
        self._complaints.append(Happened(BRICK if job is None else job.device, "refused", str(error)))

    def messages(self) -> list[FromWorker]:
        """All of it."""
        if not self._values:
            return self._complaints
        return [*self._complaints, Samples(max(self._times.values()), self._values, self._times)]


def _patiently(exchange: Exchange, telegram: bytes, tries: int = _TRIES) -> bytes:
    """The reply to a telegram that may be sent again.  Raises BusTimeout, BadFrame, LinkGone."""
    for attempt in range(tries):
        try:
            return exchange.ask(telegram)
        except (BusTimeout, BadFrame):
            if attempt == tries - 1:
                raise
    raise BadValue("no tries")


def _dotted(version: tuple[int, int]) -> str:
    return f"{version[0]}.{version[1]:02d}"
