"""A session with NAOqi over one link: log in, look services up, call them, hear their signals.  No thread, no waiting
but in ``wait``.

Calls are sent at once and answered later: ``poll`` takes in what has come, and gives each answer to the ``Call`` it
belongs to.  A call that is not answered in time fails, and so do all of them when the link is gone.

All services are called over the connection to the ServiceDirectory: NAOqi has them in one process.  One that lives in
another process, at an end point of its own, is said to be out of reach (``Unavailable``).
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Link
from urbihw.buses.qi import frames as f
from urbihw.buses.qi.metaobject import MetaObject
from urbihw.buses.qi.metatype import META_OBJECT
from urbihw.buses.qi.signatures import parse
from urbihw.buses.qi.values import decode, encode

TIMEOUT_S: Final = 2.0
"""Seconds for the answer to a call, unless its caller says otherwise."""
SERVER, DIRECTORY = 0, 1
MAIN: Final = 1
"""The object that is the service itself."""
AUTHENTICATE = 8
REGISTER_EVENT, UNREGISTER_EVENT, GET_META_OBJECT, PROPERTY, SET_PROPERTY = 0, 1, 2, 5, 6
AUTH_STATE: Final = "__qi_auth_state"
AUTH_ERROR, AUTH_CONTINUE, AUTH_DONE = 1, 2, 3
_READ_BYTES: Final = 65536
_MOST_READS: Final = 16
"""In one ``poll``: who never stops sending must not hold the worker."""


@dataclass(eq=False)
class Call:
    """A call under way, and its outcome: ``value``, or ``error`` in one line.

    Attributes:
        address: service, object and action.
        returns: the signature of its result.
        deadline: when it has waited too long.
        then: gets it when it is over.
    """

    address: tuple[int, int, int]
    returns: str
    deadline: float
    then: Callable[[Call], None] | None = None
    done: bool = False
    value: Any = None
    error: str = ""

    def finish(self, value: Any = None, error: str = "") -> None:
        """It is over."""
        self.done, self.value, self.error = True, value, error
        if self.then is not None:
            self.then(self)


@dataclass(frozen=True)
class Service:
    """A service that was looked up."""

    name: str
    number: int
    meta: MetaObject


@dataclass(frozen=True, slots=True)
class Subscription:
    """A signal that is listened to."""

    service: int
    object: int
    signal: int
    link: int


@dataclass
class Counters:
    """What went wrong since the session began."""

    timeouts: int = 0
    refused: int = 0
    unreadable: int = 0
    late: int = 0


class Session:
    """One connection, to be polled by its owner."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._framer = f.Framer()
        self._calls: dict[int, Call] = {}
        self._listeners: dict[tuple[int, int, int], tuple[str, Callable[[tuple[Any, ...]], None]]] = {}
        self._services: dict[str, Service] = {}
        self._count = 0
        self.counters = Counters()

    # ---------------------------------------------------------------- in and out

    def poll(self) -> None:
        """Take in what has come, and give up what has waited too long.  Raises LinkGone."""
        now = self._link.clock.now()
        for _ in range(_MOST_READS):
            data = self._link.read(_READ_BYTES, now)
            if not data:
                break
            self._take_in(data)
        late = [number for number, call in self._calls.items() if now > call.deadline]
        for number in late:
            self.counters.timeouts += 1
            self._calls.pop(number).finish(error="NAOqi did not answer in time")

    def wait(self, call: Call) -> Any:
        """Wait until a call is answered; return its value.  Raises Unavailable for an error or no answer, LinkGone."""
        while not call.done:
            data = self._link.read(_READ_BYTES, call.deadline)
            if data:
                self._take_in(data)
            elif not call.done and self._link.clock.now() >= call.deadline:
                call.finish(error=f"no answer in {TIMEOUT_S:g} s")
        if call.error:
            raise Unavailable(errno.EPROTO, call.error)
        return call.value

    def close(self, reason: str) -> None:
        """The link is gone: everything that waits fails."""
        calls, self._calls = self._calls, {}
        self._listeners.clear()
        self._services.clear()
        for call in calls.values():
            call.finish(error=reason)

    def _take_in(self, data: bytes) -> None:
        try:
            messages = self._framer.feed(data)
        except BadFrame as error:
            raise LinkGone(f"{self._link.url.text}: {error}; connecting again") from error
        for message in messages:
            if message.type == f.EVENT:
                self._dispatch_event(message)
            elif message.type in (f.REPLY, f.ERROR, f.CANCELLED):
                self._answer(message)
            elif message.type == f.CALL:
                # Nobody may call us: there is no service here.
                reply = encode("m", "urbihw offers no service")
                answer = f.Message(f.ERROR, message.id, message.service, message.object, message.action, reply)
                self._link.write(bytes(answer))

    def _answer(self, message: f.Message) -> None:
        call = self._calls.pop(message.id, None)
        if call is None:
            self.counters.late += 1
            return
        if call.address != (message.service, message.object, message.action):
            call.finish(error="the answer is damaged")
            raise LinkGone(f"{self._link.url.text}: what came is no message of QiMessaging; connecting again")
        try:
            if message.type == f.ERROR:
                self.counters.refused += 1
                call.finish(error=first_line(decode("m", message.payload)))
            elif message.type == f.CANCELLED:
                call.finish(error="NAOqi has cancelled it")
            else:
                value = decode("m" if message.flags & f.DYNAMIC else call.returns, message.payload)
                call.finish(value)
        except BadFrame as error:
            self.counters.unreadable += 1
            call.finish(error=f"the answer cannot be read: {error}")

    def _dispatch_event(self, message: f.Message) -> None:
        listener = self._listeners.get((message.service, message.object, message.action))
        if listener is None:
            return
        signature, heard = listener
        try:
            value = decode("m" if message.flags & f.DYNAMIC else signature, message.payload)
        except BadFrame:
            self.counters.unreadable += 1
            return
        heard(value if isinstance(value, tuple) else (value,))

    def _send(self, kind: int, service: int, object_: int, action: int, payload: bytes) -> int:
        self._count = self._count % 0xFFFFFFFF + 1
        self._link.write(bytes(f.Message(kind, self._count, service, object_, action, payload)))
        return self._count

    def call_raw(
        self,
        service: int,
        object_: int,
        action: int,
        payload: bytes,
        returns: str,
        then: Callable[[Call], None] | None = None,
        timeout: float = TIMEOUT_S,
    ) -> Call:
        """Call an action by its number; ``timeout`` in seconds.  Raises LinkGone."""
        parse(returns)
        call = Call((service, object_, action), returns, self._link.clock.now() + timeout, then)
        self._calls[self._send(f.CALL, service, object_, action, payload)] = call
        return call

    # ---------------------------------------------------------------- beginning

    def authenticate(self, user: str = "", token: str = "") -> Mapping[str, Any]:
        """Log in; return what the server says of itself.  Raises Unavailable, LinkGone."""
        words: dict[str, Any] = {"auth_user": user, "auth_token": token} if user or token else {}
        where = self._link.url.text
        try:
            call = self.call_raw(SERVER, 0, AUTHENTICATE, encode("{sm}", words), "{sm}")
            found = self.wait(call)
        except Unavailable as error:
            why = f"{where}: {error}; is this NAOqi 2 or later? NAOqi 1 does not speak QiMessaging"
            raise Unavailable(errno.EACCES, why) from error
        except LinkGone as error:
            raise Unavailable(errno.EACCES, f"{where}: the other side hangs up at the login; is this NAOqi?") from error
        state = found.get(AUTH_STATE, AUTH_DONE) if isinstance(found, dict) else AUTH_ERROR
        if state != AUTH_DONE:
            why = "wants more than a password" if state == AUTH_CONTINUE else "refuses user or password"
            raise Unavailable(errno.EACCES, f"{where}: the robot {why}: options.user, options.password")
        return dict(found)

    def names(self) -> list[str]:
        """The services that there are.  Raises Unavailable, LinkGone."""
        return sorted(row[0] for row in self.wait(self.call(self._directory(), "services")))

    def look_up(self, name: str) -> Service:
        """Find a service, and what it offers; both are remembered.  Raises Unavailable, LinkGone."""
        if name not in self._services:
            self._describe(name, self.wait(self.call(self._directory(), "service", name))[1])
        return self._services[name]

    def _directory(self) -> Service:
        # Its own description tells the fields of a service, of which newer servers have more.
        name = "ServiceDirectory"
        return self._services.get(name) or self._describe(name, DIRECTORY)

    def _describe(self, name: str, number: int) -> Service:
        meta = self.wait(self.call_raw(number, MAIN, GET_META_OBJECT, encode("(I)", (0,)), META_OBJECT))
        made = self._services[name] = Service(name, number, MetaObject.from_value(meta))
        return made

    # ---------------------------------------------------------------- services

    def call(
        self,
        service: Service,
        name: str,
        *arguments: Any,
        then: Callable[[Call], None] | None = None,
        timeout: float = TIMEOUT_S,
    ) -> Call:
        """Call a method; ``then`` gets the outcome.  Raises BadValue (no such method, wrong arguments), LinkGone."""
        method = service.meta.choose(service.name, name, arguments)
        payload = encode(method.parameters, arguments)
        return self.call_raw(service.number, MAIN, method.uid, payload, method.returns, then, timeout)

    def post(self, service: Service, name: str, *arguments: Any) -> None:
        """Call a method and want no answer.  Raises BadValue, LinkGone."""
        method = service.meta.choose(service.name, name, arguments)
        self._send(f.POST, service.number, MAIN, method.uid, encode(method.parameters, arguments))

    def get_property(self, service: Service, name: str, then: Callable[[Call], None] | None = None) -> Call:
        """Read a property.  Raises BadValue, LinkGone."""
        uid = _member(service, "property", service.meta.properties, name)
        return self.call_raw(service.number, MAIN, PROPERTY, encode("(m)", (uid,)), "m", then)

    def set_property(self, service: Service, name: str, value: Any, then: Callable[[Call], None] | None = None) -> Call:
        """Write a property.  Raises BadValue, LinkGone."""
        uid = _member(service, "property", service.meta.properties, name)
        return self.call_raw(service.number, MAIN, SET_PROPERTY, encode("(mm)", (uid, value)), "v", then)

    def listen(self, service: Service, name: str, heard: Callable[[tuple[Any, ...]], None]) -> Subscription:
        """Call ``heard`` with the values of each signal from now on.  Raises BadValue, LinkGone."""
        uid = _member(service, "signal", service.meta.signals, name)
        return self._listen_to(service.number, MAIN, uid, service.meta.signals[name].signature, heard)

    def listen_to_object(self, found: Any, name: str, heard: Callable[[tuple[Any, ...]], None]) -> Subscription:
        """The same of an object that a method has returned, such as a subscriber of ALMemory.

        Raises BadValue, LinkGone.
        """
        try:
            meta, service, object_ = found
            signal = MetaObject.from_value(meta).signals[name]
        except (TypeError, ValueError, KeyError) as error:
            raise BadValue(f"what NAOqi returned is no object with a signal {name}") from error
        return self._listen_to(service, object_, signal.uid, signal.signature, heard)

    def _listen_to(
        self, service: int, object_: int, uid: int, signature: str, heard: Callable[[tuple[Any, ...]], None]
    ) -> Subscription:
        self._count += 1
        made = Subscription(service, object_, uid, self._count)
        self._listeners[service, object_, uid] = signature, heard
        payload = encode("(IIL)", (object_, uid, made.link))
        self.call_raw(service, object_, REGISTER_EVENT, payload, "L")
        return made

    def stop_listening(self, subscription: Subscription) -> None:
        """End it.  Raises LinkGone."""
        one = subscription
        if self._listeners.pop((one.service, one.object, one.signal), None) is not None:
            payload = encode("(IIL)", (one.object, one.signal, one.link))
            self.call_raw(one.service, one.object, UNREGISTER_EVENT, payload, "v")


def _member(service: Service, kind: str, members: Mapping[str, Any], name: str) -> int:
    if name not in members:
        known = ", ".join(sorted(members)) or "none"
        raise BadValue(f"{service.name} has no {kind} {name}; it has {known}")
    uid: int = members[name].uid
    return uid


def first_line(text: Any) -> str:
    """The part of an error text of NAOqi that is for people: behind it come the lines of the server's own source."""
    head = str(text).strip().partition("\n\n")[0]
    return " ".join(head.split())[:300] or "NAOqi gives no reason"
