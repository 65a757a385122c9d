"""The worker's half of a Nao: one ``setAngles`` of all joints with a new goal and one ``getListData`` a cycle.

Devices and their items:

    HeadYaw ...     targets "angle" (rad) and "stiffness" (0 to 1); values "angle", "stiffness", "temperature"
    walk            targets "x", "y" (m/s), "yaw" (rad/s); values "x", "y", "theta": where it is
    led NAME        ("led", NAME): targets "rgb" (0xRRGGBB), "level" (0 to 1)
    sensors         values: see ``reading.SENSORS``

Requests: "describe" of a service: the names of its methods; "call" of a service (device) and a method (item) with a
list of arguments: its result.  An answer may take hours: such a call ends with its link.  "listen" to an event of
ALMemory: from then on it comes as a ``Happened`` of ("event", KEY).

A stop lets the robot stop walking, and joints that are under way hold where they are: none gets slack.  What services
were told to do is ended with ``killAll``.  A Nao whose link is lost goes on with what it was told last: a joint to its
goal, a walk without end, until the link is back; the fall manager of NAOqi is never switched off here.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
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
from urbihw.buses.qi.session import Call, Service, Session
from urbihw.platforms.nao import reading
from urbihw.platforms.nao.finding import LEDS, MEMORY, MOTION, SONAR, NaoInfo, find
from urbihw.platforms.nao.options import Options
from urbihw.platforms.nao.orders import REACHED, SLACK, JointOrders

WALK: Final = "walk"
LED: Final = "led"
SERVICES: Final = "services"
"""Stands for all that services were told to do, for stops and for who may move."""
AXES: Final = ("x", "y", "yaw")
CYCLE_TIMEOUT_S: Final = 1.0
"""Seconds in which NAOqi must answer in the cycle; then the link is given up."""
WHERE_TIMEOUT_S: Final = 0.1
"""Seconds that a stop waits to hear where the joints are now."""
SLOW_CYCLES: Final = 5
"""Sensors and temperatures are read in each such cycle."""
BLOCKING_TIMEOUT_S: Final = 1e6
"""Seconds that a call of a program may take."""
HARMLESS: Final = frozenset({
    MEMORY, LEDS, SONAR, "ALBattery", "ALTextToSpeech", "ALVideoDevice", "ALAudioDevice", "ALAudioPlayer", "ALLogger",
    "ServiceDirectory",
})  # fmt: skip
"""Services that move nothing."""
ASKING: Final = ("get", "is", "are", "robotIs", "moveIs", "walkIs", "list", "ping", "version")
"""How methods begin that move nothing."""


class NaoDriver(Driver):
    """See the head of this file, and ``urbihw.buses.driver.Driver`` for who calls what."""

    slow_verbs = frozenset({"describe", "listen"})

    def __init__(self) -> None:
        self._options = Options()
        self._rest_on_stop = False
        self._session: Session | None = None
        self._motion: Service
        self._memory: Service
        self._orders = JointOrders()
        self._info = NaoInfo("", (), (), ())
        self._fast: Mapping[str, reading.Key] = {}
        self._all: Mapping[str, reading.Key] = {}
        self._cycle = 0
        self._open: dict[str, Call] = {}
        self._walk = dict.fromkeys(AXES, 0.0)
        self._walk_due = self._walks = self._services_move = False
        self._lights: dict[tuple[str, str], Any] = {}
        self._described: set[str] = set()
        self._events: set[str] = set()
        self._news: list[FromWorker] = []
        self._values: dict[Any, dict[str, float]] = {}

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take settings.  Raises BadSetting for an option."""
        self._options = Options.of(settings.options)
        self._rest_on_stop = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Log in, and learn what there is.  Raises Unavailable, BadUrl, LinkGone."""
        session = Session(byte_link(port))
        session.authenticate(self._options.user, self._options.password)
        try:
            self._motion, self._memory = session.look_up(MOTION), session.look_up(MEMORY)
            found = find(session, self._motion, self._memory)
            for name in sorted(self._described):
                session.look_up(name)
        except (ValueError, TypeError, IndexError) as error:
            # An answer of another form is as bad as none.
            raise Unavailable(errno.EPROTO, f"{port.url.text}: {error}; is this a Nao?") from error
        self._info, self._fast, self._all = found.info, found.fast_keys, found.all_keys
        self._sort(self._all, found.values)
        self._session = session
        self._open.clear()
        self._walk_due = False
        for name in sorted(self._events):
            self._listen(session, name)
        now = port.clock.now()
        values, self._values = self._values, {}
        return [Found((self._info,)), Samples(now, values, dict.fromkeys(values, now))]

    def detach(self) -> None:
        """The port is gone: what waits fails; what was sent is remembered, for the robot goes on with it."""
        session, self._session = self._session, None
        self._orders.angles.clear()
        self._orders.stiffnesses.clear()
        self._lights.clear()
        if session is not None:
            session.close("the link went down")

    def errors(self) -> dict[str, int]:
        """Failures since ``attach``."""
        if self._session is None:
            return {}
        found = self._session.counters
        return {"timeouts": found.timeouts, "refused": found.refused, "unreadable": found.unreadable}

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Take in what has come, send what is due.  Raises LinkGone."""
        session = self._session
        if session is not None:
            session.poll()
            if not urgent():
                self._send_joints(session)
                self._send_walk(session)
                self._send_lights(session)
            meanwhile()
            self._ask(session)
        values, self._values = self._values, {}
        news, self._news = self._news, []
        if values:
            news.append(Samples(now, values, dict.fromkeys(values, now)))
        return news

    def _busy(self, what: str) -> bool:
        """Whether the last call of this kind is still under way: the next one waits for its answer."""
        call = self._open.get(what)
        return call is not None and not call.done

    def _cycle_call(
        self, session: Session, what: str, name: str, *arguments: Any, then: Callable[[Call], None]
    ) -> None:
        def answered(call: Call) -> None:
            if not call.error:
                then(call)
            elif self._session is session and call.error != _LOST:
                self._news.append(Refused(what, name, call.error))

        service = self._memory if name == "getListData" else self._motion
        try:
            self._open[what] = session.call(service, name, *arguments, then=answered, timeout=CYCLE_TIMEOUT_S)
        except BadValue as error:
            self._news.append(Refused(what, name, str(error)))

    def _post(self, session: Session, name: str, *arguments: Any) -> None:
        """Tell ALMotion to do something; that a robot has no such method is said.  Raises LinkGone."""
        try:
            session.post(self._motion, name, *arguments)
        except BadValue as error:
            self._news.append(Refused(MOTION, name, str(error)))

    def _send_joints(self, session: Session) -> None:
        orders = self._orders
        if orders.stiffnesses and not self._busy("stiffness"):
            stiffnesses, goals = orders.pop_stiffnesses()

            def stiffen(call: Call | None = None) -> None:
                names, values = list(stiffnesses), list(stiffnesses.values())
                self._cycle_call(session, "stiffness", "setStiffnesses", names, values, then=_nothing)

            if goals:
                # Only behind the answer is it sure that no old goal is left.
                names, places = list(goals), list(goals.values())
                self._cycle_call(session, "stiffness", "setAngles", names, places, 1.0, then=stiffen)
            else:
                stiffen()
        if orders.angles and not self._busy("angles") and not self._busy("stiffness"):
            angles = orders.pop_angles()
            rows = list(angles), list(angles.values())
            self._cycle_call(session, "angles", "setAngles", *rows, self._options.fraction, then=_nothing)

    def _send_walk(self, session: Session) -> None:
        if not self._walk_due or self._busy(WALK):
            return
        self._walk_due = False
        speeds = tuple(self._walk.values())
        if any(speeds):
            self._walks = True
            self._cycle_call(session, WALK, "move", *speeds, then=_nothing)
        elif self._walks:
            self._walks = False
            self._cycle_call(session, WALK, "stopMove", then=_nothing)

    def _send_lights(self, session: Session) -> None:
        if not self._lights:
            return
        lights, self._lights = self._lights, {}
        service = session.look_up(LEDS)
        for (name, item), value in lights.items():
            if item == "rgb":
                session.post(service, "fadeRGB", name, value, 0.0)
            else:
                session.post(service, "setIntensity", name, float(value))

    def _ask(self, session: Session) -> None:
        if self._busy("reading"):
            return
        previous = self._open.get("reading")
        if previous is not None and previous.error:
            raise LinkGone(f"NAOqi does not tell what it measures: {previous.error}")
        slow = self._cycle % SLOW_CYCLES == 0
        self._cycle += 1
        keys = self._all if slow else self._fast
        self._cycle_call(session, "reading", "getListData", list(keys), then=lambda call: self._sort(keys, call.value))
        if (slow or self._walks) and not self._busy("place"):
            self._cycle_call(session, "place", "getRobotPosition", True, then=self._take_place)

    def _take_place(self, call: Call) -> None:
        if isinstance(call.value, list) and len(call.value) == 3:
            self._values[WALK] = dict(zip(("x", "y", "theta"), map(float, call.value), strict=True))

    def _sort(self, keys: Mapping[str, reading.Key], values: Any) -> None:
        ranges = {joint.name: joint for joint in self._info.joints}
        for device, items in reading.sort_values(keys, values).items():
            joint, angle = ranges.get(device), items.get("angle")
            if joint is not None and angle is not None:
                if not joint.low - reading.OUTSIDE <= angle <= joint.high + reading.OUTSIDE:
                    continue
                self._orders.where[device] = angle
                self._orders.stiff[device] = items.get("stiffness", 0.0)
            self._values.setdefault(device, {}).update(items)

    # ---------------------------------------------------------------- what the parent wants

    def targets(self, message: Targets) -> list[FromWorker]:
        """Goals for the next cycle; without a robot they are forgotten."""
        refused: list[FromWorker] = []
        joints = {joint.name for joint in self._info.joints}
        for (device, item), value in message.values.items():
            if not isinstance(value, int | float):
                refused.append(Refused(device, item, f"{value!r} is no number"))
            elif self._session is None:
                continue
            elif device in joints and item == "angle":
                self._orders.angles[device] = float(value)
            elif device in joints and item == "stiffness":
                self._orders.stiffnesses[device] = float(value)
            elif device == WALK and item in AXES:
                self._walk[item] = float(value)
                self._walk_due = True
            elif isinstance(device, tuple) and device[0] == LED:
                self._lights[device[1], item] = value
            else:
                refused.append(Refused(device, item, "no such target"))
        return refused

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Everything is read always."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """See the head of this file.  Raises LinkGone."""
        session = self._session
        if session is None:
            return [Reply(message.reply_id, False, error="the link is down")]
        try:
            match message.verb:
                case "describe":
                    found = session.look_up(str(message.device))
                    self._described.add(found.name)
                    return [Reply(message.reply_id, True, found.meta.names())]
                case "call":
                    self._call(session, message)
                    return []
                case "listen":
                    self._events.add(str(message.device))
                    self._listen(session, str(message.device))
                    return [Reply(message.reply_id, True)]
        except (Unavailable, ValueError, TypeError, IndexError) as error:
            return [Reply(message.reply_id, False, error=str(error))]
        return [Reply(message.reply_id, False, error=f"a Nao knows no request {message.verb!r}")]

    def _call(self, session: Session, message: Request) -> None:
        """Call a method for a program.  Raises BadValue, Unavailable, LinkGone."""

        def answered(call: Call) -> None:
            self._news.append(Reply(message.reply_id, not call.error, call.value, call.error))

        service = session.look_up(str(message.device))
        session.call(service, message.item, *message.value, then=answered, timeout=BLOCKING_TIMEOUT_S)
        self._services_move = self._services_move or self.request_moves(message)

    def _listen(self, session: Session, key: str) -> None:
        """Hear of an event of ALMemory.  Raises Unavailable, BadValue, LinkGone."""
        subscriber = session.wait(session.call(self._memory, "subscriber", key))
        session.listen_to_object(
            subscriber, "signal", lambda values: self._news.append(Happened("event", key, values[0]))
        )

    # ---------------------------------------------------------------- motion

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop walking, let joints under way hold where they are.  Raises LinkGone."""
        joints = [joint.name for joint in self._info.joints if devices is None or joint.name in devices]
        self._orders.forget(joints)
        walks = devices is None or WALK in devices
        if walks:
            self._walk = dict.fromkeys(AXES, 0.0)
            self._walk_due = False
        session = self._session
        if session is None:
            return
        if walks and self._walks:
            self._walks = False
            self._post(session, "stopMove")
        if self._services_move and (devices is None or SERVICES in devices):
            self._services_move = False
            self._post(session, "stopMove")
            self._post(session, "killAll")
        self._hold(session, joints)
        if self._rest_on_stop and devices is None:
            self._post(session, "rest")

    def _hold(self, session: Session, joints: Iterable[str]) -> None:
        sent = [name for name in joints if name in self._orders.sent and self._orders.stiff.get(name, 0.0) > SLACK]
        if not sent:
            return
        try:
            call = session.call(self._motion, "getAngles", sent, True, timeout=WHERE_TIMEOUT_S)
            where = dict(zip(sent, map(float, session.wait(call)), strict=True))
        except (Unavailable, ValueError, TypeError):
            where = {name: self._orders.where[name] for name in sent}
        hold = self._orders.under_way(sent, where)
        if hold:
            self._orders.hold(hold)
            self._post(session, "setAngles", list(hold), list(hold.values()), 1.0)

    def stop_what_moves(self) -> tuple[Any, ...]:
        """See ``Driver``: what another program, or the last worker, has left moving.  Raises LinkGone."""
        session = self._session
        assert session is not None
        moving: list[Any] = []
        try:
            if self._ask_now(session, "moveIsActive"):
                moving.append(WALK)
                self._walks = True
            names = [joint.name for joint in self._info.joints]
            goals, angles = (
                dict(zip(names, self._ask_now(session, "getAngles", "Body", sensors), strict=True))
                for sensors in (False, True)
            )
        except (Unavailable, ValueError, TypeError) as error:
            raise LinkGone(f"NAOqi does not tell whether it moves: {error}") from error
        for name in names:
            if self._orders.stiff.get(name, 0.0) > SLACK and abs(goals[name] - angles[name]) > REACHED:
                self._orders.sent[name] = goals[name]
                moving.append(name)
        if moving:
            self.safe_stop()
        return tuple(moving)

    def _ask_now(self, session: Session, name: str, *arguments: Any) -> Any:
        """Ask ALMotion and wait.  Raises Unavailable, LinkGone."""
        return session.wait(session.call(self._motion, name, *arguments))

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


def may_move(service: str, method: str) -> bool:
    """Whether a method may move the robot: all of which it is not known that they do not."""
    return service not in HARMLESS and not method.startswith(ASKING)


_LOST: Final = "the link went down"


def _nothing(call: Call) -> None:
    """The answer tells nothing more than that it was done."""
