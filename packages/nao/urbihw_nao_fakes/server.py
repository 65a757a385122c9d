"""The messages of NAOqi's port: who calls what on which connection, answers that come later, and signals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw_fakes.device import Answer
from urbihw_nao_fakes import codec
from urbihw_nao_fakes.connection import Connection, Returned
from urbihw_nao_fakes.services import (
    AUTHENTICATE,
    DONE,
    FIRST_MEMBER,
    GET_PROPERTY,
    META_OBJECT,
    REFUSED,
    REGISTER_EVENT,
    SET_PROPERTY,
    TERMINATE,
    UNREGISTER_EVENT,
    Failed,
    Later,
    Service,
    as_failure,
)

LOOK_PERIOD = 0.01
"""Seconds between two looks at what a blocking call waits for."""


class Server:
    """Services by number, and connections.

    ``disturb`` is the fault of the wire: it returns the delay in seconds and what is left of the bytes.

    Attributes:
        user, password: who may come in, "" for anybody.
        now: the time, seconds.
        calling: whose message is carried out.
        unsent: messages to clients, and to whom.
        dial: connects to an end point of a client (raises Failed); there is none without a network.
        on_disconnect: called for each connection that is gone.
    """

    def __init__(self, user: str, password: str, disturb: Callable[[bytes], tuple[float, bytes]]) -> None:
        self.user, self.password = user, password
        self.now = 0.0
        self.services: dict[int, Service] = {}
        self.connections: list[Connection] = []
        self.calling = Connection()
        self.unsent: list[tuple[Connection, Answer]] = []
        self.dial: Callable[[str], Connection] = _refuse_to_dial
        self.on_disconnect: Callable[[Connection], None] = lambda _: None
        self._disturb = disturb
        self._last_call = 0

    def add_service(self, service: Service) -> None:
        """Offer one more; the first one gets number 1."""
        service.number = max(self.services, default=0) + 1
        service.send_event = self._send_event
        self.services[service.number] = service

    # ---------------------------------------------------------------- connections

    def connect(self) -> Connection:
        """A client connects to the server."""
        made = Connection()
        self.connections.append(made)
        return made

    def disconnect(self, connection: Connection) -> None:
        """A client is gone; what it has begun goes on."""
        connection.closed = True
        if connection in self.connections:
            self.connections.remove(connection)
        for returned in connection.calls.values():
            returned(Failed("the connection is closed"))
        connection.calls.clear()
        self.on_disconnect(connection)

    def open_connection(self, url: str) -> Connection:
        """Connect to an end point of a client.  Raises Failed."""
        return self.dial(url)

    def receive(self, connection: Connection, data: bytes) -> None:
        """Bytes of a client; answers go to ``unsent``."""
        if connection.closed:
            return
        try:
            for message in connection.splitter.feed(data):
                self._handle(connection, message)
        except codec.BadMessage:
            connection.closed = True

    def advance(self, now: float) -> None:
        """Answer the calls whose result has come."""
        self.now = max(now, self.now)
        for service in list(self.services.values()):
            service.advance(self.now)
        for connection in self.connections:
            for row in list(connection.waiting):
                message, method, later = row
                try:
                    if not later.ready():
                        continue
                    self._reply(connection, message, codec.encode(method.returns, later.value))
                except Exception as error:
                    self._reply_error(connection, message, as_failure(error))
                connection.waiting.remove(row)

    def due(self) -> float | None:
        """When there is something to send next, None for never."""
        times = [answer.at for _, answer in self.unsent]
        if any(one.waiting for one in self.connections) or any(one.is_active() for one in self.services.values()):
            times.append(self.now + LOOK_PERIOD)
        return min(times, default=None)

    def pop_answers(self, connection: Connection) -> list[Answer]:
        """What is to be sent to one client; it is no longer ``unsent``."""
        mine = [answer for to, answer in self.unsent if to is connection]
        self.unsent = [row for row in self.unsent if row[0] is not connection]
        return mine

    # ---------------------------------------------------------------- messages

    def _handle(self, connection: Connection, message: codec.Message) -> None:
        if message.kind in (codec.REPLY, codec.ERROR, codec.CANCELLED):
            self._return(connection, message)
        if message.kind not in (codec.CALL, codec.POST):
            return
        self.calling = connection
        try:
            if message.service == 0:
                self._authenticate(connection, message)
            elif not connection.allowed:
                raise Failed("you must authenticate first")
            elif message.action < FIRST_MEMBER:
                self._call_common(connection, message)
            else:
                self._call(connection, message)
        except codec.BadMessage:
            raise
        except Exception as error:
            self._reply_error(connection, message, as_failure(error))

    def _authenticate(self, connection: Connection, message: codec.Message) -> None:
        words = codec.decode("{sm}", message.payload)
        known = not self.user or (words.get("auth_user"), words.get("auth_token")) == (self.user, self.password)
        connection.allowed = message.action == AUTHENTICATE and known
        state = DONE if connection.allowed else REFUSED
        self._reply(connection, message, codec.encode("{sm}", {"__qi_auth_state": state}))

    def _find_object(self, message: codec.Message) -> Service:
        if message.service not in self.services:
            raise Failed(f"no service {message.service}")
        return self.services[message.service].find_object(message.thing)

    def _call_common(self, connection: Connection, message: codec.Message) -> None:
        """What all objects have."""
        thing = self._find_object(message)
        if message.action == META_OBJECT:
            self._reply(connection, message, codec.encode(codec.META, thing.describe()))
        elif message.action in (REGISTER_EVENT, UNREGISTER_EVENT):
            _, signal, link = codec.decode("(IIL)", message.payload)
            key = message.service, message.thing, signal
            if message.action == UNREGISTER_EVENT:
                connection.subscriptions.pop(key, None)
                self._reply(connection, message)
            elif signal not in thing.signals:
                raise Failed(f"no signal {signal}")
            else:
                connection.subscriptions[key] = thing.signals[signal].signature
                self._reply(connection, message, codec.encode("L", link))
        elif message.action == GET_PROPERTY:
            (key,) = codec.decode("(m)", message.payload)
            self._reply(connection, message, codec.encode("m", thing.values[thing.find_property(key).name]))
        elif message.action == SET_PROPERTY:
            key, value = codec.decode("(mm)", message.payload)
            thing.values[thing.find_property(key).name] = value
            self._reply(connection, message)
        elif message.action != TERMINATE:
            raise Failed(f"action {message.action} is not there")

    def _call(self, connection: Connection, message: codec.Message) -> None:
        service = self._find_object(message)
        method = service.find_method(message.action)
        result = service.call(method, *codec.decode(method.parameters, message.payload))
        if isinstance(result, Later):
            connection.waiting.append((message, method, result))
        else:
            self._reply(connection, message, codec.encode(method.returns, result))

    # ---------------------------------------------------------------- answers

    def _reply(self, connection: Connection, message: codec.Message, payload: bytes = b"") -> None:
        if message.kind == codec.CALL:
            self._send(connection, codec.REPLY, message, payload)

    def _reply_error(self, connection: Connection, message: codec.Message, error: Failed) -> None:
        self._send(connection, codec.ERROR, message, codec.encode("m", str(error)))

    def _send(self, connection: Connection, kind: int, to: codec.Message, payload: bytes) -> None:
        self._send_frame(connection, codec.frame(kind, to.number, to.target, payload))

    def _send_frame(self, connection: Connection, data: bytes) -> None:
        delay, data = self._disturb(data)
        if data:
            self.unsent.append((connection, Answer(self.now + delay, data)))

    def _send_event(self, service: Service, signal: int, values: tuple[Any, ...]) -> None:
        key = codec.Target(service.number, service.thing, signal)
        for connection in self.connections:
            if key in connection.subscriptions:
                payload = codec.encode(connection.subscriptions[key], values)
                self._send_frame(connection, codec.frame(codec.EVENT, 0, key, payload))

    # ---------------------------------------------------------------- calls of the robot

    def send_call(self, connection: Connection, target: codec.Target, payload: bytes, then: Returned) -> None:
        """Call a method of a client; ``then`` gets the payload of the answer or a Failed."""
        if connection.closed:
            then(Failed("the connection is closed"))
            return
        self._last_call += 1
        connection.calls[self._last_call] = then
        self._send_frame(connection, codec.frame(codec.CALL, self._last_call, target, payload))

    def _return(self, connection: Connection, message: codec.Message) -> None:
        returned = connection.calls.pop(message.number, None)
        if returned is None:
            return
        if message.kind == codec.REPLY:
            returned(message.payload)
        else:
            text = codec.decode("m", message.payload) if message.kind == codec.ERROR else "cancelled"
            returned(Failed(str(text)))


def _refuse_to_dial(url: str) -> Connection:
    raise Failed(f"{url}: there is no network here")
