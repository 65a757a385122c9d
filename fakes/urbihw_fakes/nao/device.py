"""NAOqi: who calls what on which connection, answers that come later, and signals."""

from __future__ import annotations

import math
from typing import Any

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.nao import codec
from urbihw_fakes.nao.body import Body
from urbihw_fakes.nao.motion import Motion
from urbihw_fakes.nao.others import Memory, Voice, leds, simple
from urbihw_fakes.nao.services import Failed, Later, Method, Service

UNIT = 0
"""The only unit there is, for faults."""
LOOK_PERIOD = 0.01
"""Seconds between two looks at what a blocking call waits for."""
DONE, REFUSED = 3, 1
TERMINATE = 3
"""The client has no use for an object any more."""
INFO = "(sIsI[s]s)<ServiceInfo,name,serviceId,machineId,processId,endpoints,sessionId>"
FIRST_SERVICE = 2


class Connection:
    """A client."""

    def __init__(self) -> None:
        self.cutter = codec.Cutter()
        self.allowed = False
        self.closed = False
        self.waiting: list[tuple[codec.Message, Method, Later]] = []
        self.listens: dict[tuple[int, int, int], str] = {}


class Nao(Device):
    """A Nao with one client, or several (``receive_from``).

    Attributes:
        body, motion, memory, voice: its parts; leds: what was written to lights, as 0xRRGGBB.
        user, password: who may come in, "" for anybody.
        endpoint: what it says of where it is.
    """

    def __init__(self, user: str = "", password: str = "") -> None:
        super().__init__()
        self.user, self.password = user, password
        self.endpoint = "tcp://127.0.0.1:9559"
        self.now = 0.0
        self.body = Body()
        self.body.on_fall = lambda: self.memory.raise_event("robotHasFallen", 1)
        self.motion = Motion(self.body)
        self.memory = Memory(self.body, self._raised, self._subscriber)
        self.voice = Voice(lambda: self.now)
        self.leds: dict[str, int] = {}
        self.connections: list[Connection] = []
        self.unsent: list[tuple[Connection, Answer]] = []
        self._events: dict[str, int] = {}
        self._client = Connection()
        found = [self.motion.service, self.motion.posture, self.memory.service, self.voice.service, leds(self.leds)]
        found += simple(self.body, self.memory, lambda: self.now)
        self.services = dict(enumerate(found, FIRST_SERVICE))
        self.services[1] = self._directory()

    def _directory(self) -> Service:
        def info(number: int) -> tuple[Any, ...]:
            return self.services[number].name, number, "machine", 4242, [self.endpoint], "0"

        def find(name: str) -> tuple[Any, ...]:
            for number, service in self.services.items():
                if service.name == name:
                    return info(number)
            raise Failed(f"Cannot find service '{name}' in index")

        made = Service("ServiceDirectory")
        made.add(INFO, "service", "(s)", find)
        made.add(f"[{INFO}]", "services", "()", lambda: [info(number) for number in sorted(self.services)])
        made.add("v", "registerService", f"({INFO})", self._no_services)
        made.add("v", "unregisterService", "(I)", self._no_services)
        made.add("v", "serviceReady", "(I)", self._no_services)
        made.add("v", "updateServiceInfo", f"({INFO})", self._no_services)
        made.add_signal("serviceAdded", "(Is)")
        made.add_signal("serviceRemoved", "(Is)")
        made.add("s", "machineId", "()", lambda: "machine")
        return made

    def _no_services(self, *_: Any) -> None:
        raise Failed("no services of others here")

    # ---------------------------------------------------------------- connections

    def connect(self) -> Connection:
        """Somebody connects."""
        made = Connection()
        self.connections.append(made)
        return made

    def disconnect(self, connection: Connection) -> None:
        """A client is gone; what it has begun goes on."""
        connection.closed = True
        if connection in self.connections:
            self.connections.remove(connection)

    def reconnect(self) -> None:
        """The only client connects anew, where there is but one (``receive``)."""
        self.disconnect(self._client)
        self._client = self.connect()

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """See `Device`: of the only client."""
        self.receive_from(self._client, data, now)
        return self._sent_to(self._client)

    def receive_from(self, connection: Connection, data: bytes, now: float) -> None:
        """Bytes of a client; answers go to ``unsent``."""
        self._live(now)
        if not self.body.powered or connection.closed:
            return
        try:
            for message in connection.cutter.take(data):
                self._obey(connection, message)
        except codec.Garbage:
            connection.closed = True

    def tick(self, now: float) -> list[Answer]:
        """See `Device`."""
        self._live(now)
        return self._sent_to(self._client)

    def _sent_to(self, connection: Connection) -> list[Answer]:
        mine = [answer for to, answer in self.unsent if to is connection]
        self.unsent = [row for row in self.unsent if row[0] is not connection]
        return mine

    def due(self) -> float | None:
        """See `Device`."""
        times = [answer.at for _, answer in self.unsent]
        if any(one.waiting for one in self.connections):
            times.append(self.now + LOOK_PERIOD)
        return min(times, default=None)

    def _live(self, now: float) -> None:
        self.now = max(now, self.now)
        self.body.advance(now)
        for connection in self.connections:
            for row in list(connection.waiting):
                message, method, later = row
                if later.ready():
                    connection.waiting.remove(row)
                    self._reply(connection, message, codec.put(method.returns, later.value))

    # ---------------------------------------------------------------- messages

    def _obey(self, connection: Connection, message: codec.Message) -> None:
        if message.kind not in (codec.CALL, codec.POST):
            return
        try:
            if message.service == 0:
                self._authenticate(connection, message)
            elif not connection.allowed:
                raise Failed("you must authenticate first")
            elif message.action < 100:
                self._common(connection, message)
            else:
                self._run(connection, message)
        except Failed as error:
            self._send(connection, codec.ERROR, message, codec.put("m", str(error)))

    def _authenticate(self, connection: Connection, message: codec.Message) -> None:
        words = codec.get("{sm}", message.payload)
        allowed = not self.user or (words.get("auth_user"), words.get("auth_token")) == (self.user, self.password)
        connection.allowed = message.action == 8 and allowed
        state = DONE if connection.allowed else REFUSED
        self._reply(connection, message, codec.put("{sm}", {"__qi_auth_state": state}))

    def _common(self, connection: Connection, message: codec.Message) -> None:
        thing = self._thing(message)
        if message.action == 2:
            self._reply(connection, message, codec.put(codec.META, thing.meta()))
        elif message.action in (0, 1):
            _, signal, link = codec.get("(IIL)", message.payload)
            key = message.service, message.thing, signal
            if message.action:
                connection.listens.pop(key, None)
                self._reply(connection, message)
            elif signal not in thing.signals:
                raise Failed(f"no signal {signal}")
            else:
                connection.listens[key] = thing.signals[signal][1]
                self._reply(connection, message, codec.put("L", link))
        elif message.action != TERMINATE:
            raise Failed(f"action {message.action} is not there")

    def _thing(self, message: codec.Message) -> Service:
        service = self.services.get(message.service)
        if service is None:
            raise Failed(f"no service {message.service}")
        if message.thing == 1 or message.thing == 0:
            return service
        if service is self.memory.service and message.thing in self._events.values():
            made = Service("subscriber")
            made.signals[100] = "signal", "(m)"
            return made
        raise Failed(f"no object {message.thing}")

    def _run(self, connection: Connection, message: codec.Message) -> None:
        method = self._thing(message).methods.get(message.action)
        if method is None:
            raise Failed(f"no method {message.action}")
        result = method.run(*codec.get(method.takes, message.payload))
        if not isinstance(result, Later):
            self._reply(connection, message, codec.put(method.returns, result))
        else:
            connection.waiting.append((message, method, result))

    def _reply(self, connection: Connection, message: codec.Message, payload: bytes = b"") -> None:
        if message.kind == codec.CALL:
            self._send(connection, codec.REPLY, message, payload)

    def _send(self, connection: Connection, kind: int, to: codec.Message, payload: bytes) -> None:
        data = codec.frame(kind, to.number, to.service, to.thing, to.action, payload)
        delay, data = self.faults.disturb(UNIT, data)
        if data:
            self.unsent.append((connection, Answer(self.now + delay, data)))

    # ---------------------------------------------------------------- events

    def _subscriber(self, key: str) -> Any:
        number = self._events.setdefault(key, 1000 + len(self._events))
        made = Service("subscriber")
        made.signals[100] = "signal", "(m)"
        (service,) = [number for number, each in self.services.items() if each is self.memory.service]
        return made.meta(), service, number

    def _raised(self, key: str, value: Any) -> None:
        thing = self._events.get(key)
        for connection in self.connections:
            for service, number, signal in connection.listens:
                if number == thing:
                    event = codec.Message(0, codec.POST, service, number, signal, b"")
                    self._send(connection, codec.EVENT, event, codec.put("(m)", (value,)))

    # ---------------------------------------------------------------- power

    def power_off(self, now: float, who: int | None = None) -> None:
        """See `Device`: the motors are slack; nobody is told that the connections are gone."""
        self.body.advance(now)
        self.body.powered = False
        self.body.slack()
        self.body.drive((0.0, 0.0, 0.0))
        for connection in self.connections:
            connection.closed = True

    def power_on(self, now: float, who: int | None = None) -> None:
        """See `Device`: NAOqi has started, and knows of no connection."""
        self.body.advance(now)
        self.body.powered = True
        self.body.walk = [0.0, 0.0, 0.0]
        for joint in self.body.joints.values():
            joint.command = joint.angle
        self.memory.subscribed_sonars.clear()


def speeds_of(body: Body) -> tuple[float, ...]:
    """The speed of each joint, rad/s, and of walking: how fast it goes (m/s), how fast it turns (rad/s)."""
    rates = [joint.moves_at for joint in body.joints.values()]
    return (*rates, math.hypot(*body.walk[:2]), body.walk[2])
