"""The worker's half of a Nao: one ``setAngles`` of all joints with a new goal and one ``getListData`` a cycle.

Devices and their items:

    HeadYaw ...     targets "angle" (rad) and "stiffness" (0 to 1); values "angle", "stiffness", "temperature"
    walk            targets "x", "y" (m/s), "yaw" (rad/s); values "x", "y", "theta": where it is
    led NAME        ("led", NAME): targets "rgb" (0xRRGGBB), "level" (0 to 1)
    sensors         values: see ``reading.SENSORS``

Requests: "describe" of a service: the names of its methods; "call" of a service (device) and a method (item) with a
list of arguments: its result.  An answer may take hours: such a call ends with its link.  "listen" to an event of
ALMemory: from then on it comes as a ``Happened`` of ("event", KEY).

Each kind of thing is a ``Part``; one more kind is one more module with a part and a line in ``NaoDriver.__init__``.

A stop lets the robot stop walking, and joints that are under way hold where they are: none gets slack.  What services
were told to do is ended with ``killAll``.  A Nao whose link is lost goes on with what it was told last: a joint to its
goal, a walk without end, until the link is back; the fall manager of NAOqi is never switched off here.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.link import Port, byte_link
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Targets, Watch
from urbihw.buses.qi.session import Session
from urbihw.platforms.nao.call_part import CallPart, may_move
from urbihw.platforms.nao.exchange import Exchange
from urbihw.platforms.nao.finding import MEMORY, MOTION, find
from urbihw.platforms.nao.joint_part import JointPart
from urbihw.platforms.nao.light_part import LightPart
from urbihw.platforms.nao.options import Options
from urbihw.platforms.nao.orders import JointOrders
from urbihw.platforms.nao.part import Part
from urbihw.platforms.nao.sense_part import SensePart
from urbihw.platforms.nao.walk_part import WALK, WalkPart


class NaoDriver(Driver):
    """See the head of this file, and ``urbihw.buses.driver.Driver`` for who calls what."""

    slow_verbs = frozenset({"describe", "listen"})

    def __init__(self) -> None:
        self._rest_on_stop = False
        self._exchange = exchange = Exchange()
        self._orders = orders = JointOrders()
        self._senses = SensePart(exchange, orders)
        # In a stop the walk ends first: its legs are no joints under way then.
        self._parts: tuple[Part, ...] = (
            WalkPart(exchange), CallPart(exchange), JointPart(exchange, orders), LightPart(exchange), self._senses,
        )  # fmt: skip

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take settings.  Raises BadSetting for an option."""
        self._exchange.options = Options.of(settings.options)
        self._rest_on_stop = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Log in, and learn what there is.  Raises Unavailable, BadUrl, LinkGone."""
        exchange = self._exchange
        session = Session(byte_link(port))
        session.authenticate(exchange.options.user, exchange.options.password)
        try:
            motion, memory = session.look_up(MOTION), session.look_up(MEMORY)
            found = find(session, motion, memory)
            exchange.info = found.info
            self._senses.show_first(found)
            exchange.begin(session, motion, memory)
            for part in self._parts:
                part.begin()
        except (ValueError, TypeError, IndexError) as error:
            # An answer of another form is as bad as none.
            raise Unavailable(errno.EPROTO, f"{port.url.text}: {error}; is this a Nao?") from error
        return [Found((exchange.info,)), *self._collect(port.clock.now())]

    def detach(self) -> None:
        """The port is gone: what waits fails; what was sent is remembered, for the robot goes on with it."""
        for part in self._parts:
            part.end()
        self._exchange.end()

    def errors(self) -> dict[str, int]:
        """Failures since ``attach``."""
        if not self._exchange.linked:
            return {}
        found = self._exchange.session.counters
        return {"timeouts": found.timeouts, "refused": found.refused, "unreadable": found.unreadable}

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Take in what has come, send what is due.  Raises LinkGone."""
        if self._exchange.linked:
            self._exchange.session.poll()
            if not urgent():
                for part in self._parts:
                    part.send()
            meanwhile()
            for part in self._parts:
                part.read()
        return self._collect(now)

    def _collect(self, now: float) -> list[FromWorker]:
        exchange = self._exchange
        values, exchange.values = exchange.values, {}
        news, exchange.news = exchange.news, []
        if values:
            news.append(Samples(now, values, dict.fromkeys(values, now)))
        return news

    # ---------------------------------------------------------------- what the parent wants

    def targets(self, message: Targets) -> list[FromWorker]:
        """Goals for the next cycle; without a robot they are dropped."""
        refused: list[FromWorker] = []
        for (device, item), value in message.values.items():
            problem = self._set_target(device, item, value)
            if problem:
                refused.append(Refused(device, item, problem))
        return refused

    def _set_target(self, device: Any, item: str, value: Any) -> str:
        if not isinstance(value, int | float):
            return f"{value!r} is no number"
        if not self._exchange.linked:
            return ""
        for part in self._parts:
            if part.owns(device):
                return part.set_target(device, item, float(value))
        return "no such target"

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Everything is read always."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """See the head of this file.  Raises LinkGone."""
        if not self._exchange.linked:
            return [Reply(message.reply_id, False, error="the link is down")]
        try:
            for part in self._parts:
                if message.verb in part.verbs:
                    return part.request(message)
        except (Unavailable, ValueError, TypeError, IndexError) as error:
            return [Reply(message.reply_id, False, error=str(error))]
        return [Reply(message.reply_id, False, error=f"a Nao knows no request {message.verb!r}")]

    # ---------------------------------------------------------------- motion

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop walking, let joints under way hold where they are.  Raises LinkGone."""
        for part in self._parts:
            part.drop_targets(devices)
        if not self._exchange.linked:
            return
        for part in self._parts:
            part.stop(devices)
        if self._rest_on_stop and devices is None:
            self._exchange.post_motion("rest")

    def stop_what_moves(self) -> tuple[Any, ...]:
        """See ``Driver``: what another program, or the last worker, has left moving.  Raises LinkGone."""
        try:
            moving = [device for part in self._parts for device in part.find_moving()]
        except (Unavailable, ValueError, TypeError) as error:
            raise LinkGone(f"NAOqi does not tell whether it moves: {error}") from error
        if moving:
            self.safe_stop()
        return tuple(moving)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """A goal does, and a stiffness and a speed other than 0."""
        if device == WALK or item == "stiffness":
            return bool(value)
        return item == "angle"

    def request_moves(self, request: Request) -> bool:
        """A method may, unless it is known that it only asks."""
        return request.verb == "call" and may_move(str(request.device), request.item)

    def pose(self, device: Any, item: str) -> float | None:
        """See ``Driver``."""
        return self._orders.where.get(device) if item == "angle" else None

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """See ``Driver``: targets are SI, and no counts."""
        return signed
