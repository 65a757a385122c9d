"""Our own session: QiMessaging over links, ``qi://`` and ``qis://``.  No thread, no waiting but in ``wait``.

Services in the process of the ServiceDirectory are called over the connection to it.  One that lives elsewhere gets a
connection to its own end point, by the same login, when it is looked up; it is closed with the session.  When such a
connection is lost, calls over it fail, and the next ``look_up`` makes it anew; the session itself goes on.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Callable
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadUrl, BadValue, BusError, LinkGone, Unavailable
from urbihw.buses.link import Link
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.checked import is_name, show_text, to_row, to_whole
from urbihw_nao.qimessaging.connection import QiConnection, QiListener
from urbihw_nao.qimessaging.endpoints import ServicePlace
from urbihw_nao.qimessaging.login import (
    AUTH_CONTINUE,
    AUTH_DONE,
    AUTH_ERROR,
    AUTH_STATE,
    NEW_TOKEN,
    REFUSED,
    Login,
    describe_hang_up,
    describe_silence,
    describe_stranger,
)
from urbihw_nao.qimessaging.metaobject import MetaObject, Method, QiSignal
from urbihw_nao.qimessaging.metatype import META_OBJECT
from urbihw_nao.qimessaging.serving import Caller
from urbihw_nao.qimessaging.session import (
    TIMEOUT_S,
    Heard,
    QiCall,
    QiService,
    QiSession,
    QiSubscription,
    no_such_signal,
)
from urbihw_nao.qimessaging.values import encode

SERVER, DIRECTORY = 0, 1
MAIN: Final = 1
"""The object that is the service itself."""
AUTHENTICATE: Final = 8
GET_META_OBJECT, PROPERTY, SET_PROPERTY = 2, 5, 6
DIRECTORY_NAME: Final = "ServiceDirectory"
MOST_CONNECTIONS: Final = 8
"""Connections to end points other than the directory's."""
OTHER_TIMEOUT_S: Final = 0.3
"""Seconds to connect to another end point, and to log in there: a stop waits meanwhile."""
RETRY_S: Final = 5.0
"""Seconds until an end point that could not be reached is tried again."""
PROBE_S: Final = 1.0
"""Seconds for a server that did not understand the login to answer an empty line."""


class WireSession(QiSession):
    """A session in QiMessaging of our own.

    ``link`` leads to the ServiceDirectory at the address ``robot`` and stays its owner's; ``open_link`` opens links to
    other end points, by their urls.
    """

    def __init__(self, link: Link, open_link: Callable[[str], Link], robot: str) -> None:
        super().__init__(link.clock)
        self._main = QiConnection(link, self.counters)
        self._robot = robot
        self._open_link = open_link
        self._login = Login()
        self._others: dict[str, QiConnection] = {}
        self._unreachable: dict[str, tuple[float, str]] = {}
        self._homes: dict[int, QiConnection] = {}
        self._gone: set[int] = set()
        self._services: dict[str, QiService] = {}
        self._directory_place: ServicePlace | None = None

    # ---------------------------------------------------------------- in and out

    def _receive(self, deadline: float, call: QiCall | None) -> None:
        awaited = next((each for each in self._others.values() if call is not None and each.has(call)), self._main)
        for url, connection in list(self._others.items()):
            try:
                connection.receive(deadline if connection is awaited else self._clock.now())
            except LinkGone as error:
                self._lose(url, str(error))
        self._main.receive(deadline if awaited is self._main else self._clock.now())

    def _lose(self, url: str, reason: str) -> None:
        """A connection to another end point is gone: its services must be looked up again."""
        connection = self._others.pop(url)
        connection.link.close()
        lost = {number for number, home in self._homes.items() if home is connection}
        self._homes = {number: home for number, home in self._homes.items() if number not in lost}
        self._gone |= lost
        self._services = {name: each for name, each in self._services.items() if each.number not in lost}
        connection.fail_all(reason)

    def _pop_overdue(self, now: float) -> list[QiCall]:
        return [call for each in (self._main, *self._others.values()) for call in each.pop_overdue(now)]

    def _drop(self, call: QiCall) -> None:
        for connection in (self._main, *self._others.values()):
            connection.drop(call)

    def close(self, reason: str) -> None:
        """Fail what waits, for this reason, and close the connections to other end points."""
        self._services.clear()
        self._main.fail_all(reason)
        for url in list(self._others):
            self._lose(url, reason)

    # ---------------------------------------------------------------- the robot

    def authenticate(self, login: Login | None = None) -> None:
        """Log in over this connection; those to other end points get the same login.  Raises Unavailable."""
        self._login = login if login is not None else Login()
        self._authenticate(self._main, TIMEOUT_S)

    def _authenticate(self, connection: QiConnection, timeout: float) -> None:
        where = connection.link.url.text
        found = self._ask_to_enter(connection, self._login.words(), timeout)
        if found.get(AUTH_STATE) == AUTH_CONTINUE and isinstance(found.get(NEW_TOKEN), str):
            self._login.keep_token(where, found[NEW_TOKEN])
            found = self._ask_to_enter(connection, self._login.words(), timeout)
        state = found.get(AUTH_STATE, AUTH_DONE)
        if state == AUTH_CONTINUE:
            raise Unavailable(errno.EACCES, f"{where}: the robot wants more than a user and a password")
        if state != AUTH_DONE:
            raise Unavailable(errno.EACCES, f"{where}: {REFUSED}")

    def _ask_to_enter(self, connection: QiConnection, words: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Send credentials; return the answer, or say what it is that does not give one.  Raises Unavailable."""
        where = connection.link.url.text
        try:
            call = connection.call((SERVER, 0, AUTHENTICATE), encode("{sm}", words), "{sm}", timeout=timeout)
            found = self._wait_on(connection, call)
        except LinkGone as error:
            raise Unavailable(errno.EACCES, connection.stranger or describe_hang_up(where)) from error
        if not call.done:
            connection.drop(call)
            main = connection is self._main
            raise Unavailable(errno.EACCES, _probe(connection.link) if main else describe_silence(where, timeout))
        if call.error:
            # libqi's own servers refuse a login by an error instead of a state.
            why = REFUSED if words else "the login failed"
            raise Unavailable(errno.EACCES, f"{where}: {why} ({call.error})")
        return found if isinstance(found, dict) else {AUTH_STATE: AUTH_ERROR}

    def _wait_on(self, connection: QiConnection, call: QiCall) -> Any:
        while not call.done and self._clock.now() < call.deadline:
            connection.receive(call.deadline)
        return call.value

    def names(self) -> list[str]:
        """Ask the directory for the services, sorted.  Raises Unavailable, BadFrame, LinkGone."""
        rows = to_row(self.wait(self.call(self._directory(), "services")))
        return sorted(name for name in (to_row(row, 1)[0] for row in rows) if is_name(name))

    def look_up(self, name: str) -> QiService:
        """Find a service and connect to where it lives; both are remembered.  Raises Unavailable, LinkGone."""
        if name == DIRECTORY_NAME:
            return self._directory()
        if name not in self._services:
            place = self._place_of(name)
            self._describe(self._connection_to(place), name, place.number)
        return self._services[name]

    def _directory(self) -> QiService:
        # Its own description tells the fields of a ServiceInfo, of which newer servers have more.
        found = self._services.get(DIRECTORY_NAME)
        return found or self._describe(self._main, DIRECTORY_NAME, DIRECTORY)

    def _place_of(self, name: str) -> ServicePlace:
        found = self.wait(self.call(self._directory(), "service", name))
        try:
            return ServicePlace.from_value(found)
        except BadFrame as error:
            text = f"the ServiceDirectory does not tell where {show_text(name)} is: {error}"
            raise Unavailable(errno.EPROTO, text) from error

    def _describe(self, connection: QiConnection, name: str, number: int) -> QiService:
        call = connection.call((number, MAIN, GET_META_OBJECT), encode("(I)", (0,)), META_OBJECT)
        value = self.wait(call)
        try:
            made = QiService(name, number, MetaObject.from_value(value))
        except BadFrame as error:
            raise Unavailable(errno.EPROTO, f"{show_text(name)} does not tell what it offers: {error}") from error
        self._services[name] = made
        self._homes[number] = connection
        self._gone.discard(number)
        return made

    # ---------------------------------------------------------------- other end points

    def _connection_to(self, place: ServicePlace) -> QiConnection:
        """The connection over which a service is called, made now if need be.  Raises Unavailable, LinkGone."""
        if self._directory_place is None:
            self._directory_place = self._place_of(DIRECTORY_NAME)
        link = self._main.link
        if place.is_with(self._directory_place):
            return self._main
        urls = place.urls(self._robot, link.url.scheme == "qis", self._login.other_hosts)
        problem = f"its end points are {place.describe()}"
        if not urls and place.urls(self._robot, link.url.scheme == "qis", True):
            problem += ", on another host than the robot: options.other_hosts = true sends user and password there"
        for url in urls:
            if url in self._others:
                return self._others[url]
            if len(self._others) >= MOST_CONNECTIONS:
                problem = f"there are {MOST_CONNECTIONS} connections to other processes already"
                break
            until, problem = self._unreachable.get(url, (-math.inf, ""))
            if self._clock.now() < until:
                continue
            try:
                return self._connect(url)
            except (Unavailable, BadUrl, LinkGone) as error:
                problem = str(error)
                self._unreachable[url] = self._clock.now() + RETRY_S, problem
        text = f"{show_text(place.name)} is in another process, out of reach: {problem}"
        raise Unavailable(errno.EHOSTUNREACH, text)

    def _connect(self, url: str) -> QiConnection:
        connection = QiConnection(self._open_link(url), self.counters)
        connection.answer_call = self._main.answer_call
        try:
            self._authenticate(connection, OTHER_TIMEOUT_S)
        except BusError:
            connection.link.close()
            raise
        self._others[url] = connection
        return connection

    def _home(self, number: int) -> QiConnection:
        """The connection to a service, or to an object of one.  Raises BadValue when it was lost."""
        if number in self._gone:
            raise BadValue("its process has ended, or the connection to it; look the service up again")
        return self._homes.get(number, self._main)

    # ---------------------------------------------------------------- services

    def _call(
        self,
        service: QiService,
        method: Method,
        arguments: tuple[Any, ...],
        then: Callable[[QiCall], None] | None,
        timeout: float,
    ) -> QiCall:
        address = service.number, MAIN, method.uid
        payload = encode(method.parameters, arguments)
        return self._home(service.number).call(address, payload, method.returns, then, timeout)

    def _post(self, service: QiService, method: Method, arguments: tuple[Any, ...]) -> None:
        payload = encode(method.parameters, arguments)
        self._home(service.number).send(f.POST, (service.number, MAIN, method.uid), payload)

    def _read(self, service: QiService, found: QiSignal, then: Callable[[QiCall], None] | None) -> QiCall:
        address = service.number, MAIN, PROPERTY
        return self._home(service.number).call(address, encode("(m)", (found.uid,)), "m", then)

    def _write(
        self, service: QiService, found: QiSignal, value: Any, then: Callable[[QiCall], None] | None
    ) -> QiCall:
        address = service.number, MAIN, SET_PROPERTY
        return self._home(service.number).call(address, encode("(mm)", (found.uid, value)), "v", then)

    def _hear(self, service: QiService, signal: QiSignal, heard: Heard) -> QiSubscription:
        return self._listen((service.number, MAIN, signal.uid), signal.signature, heard)

    def listen_to_object(self, found: Any, name: str, heard: Heard) -> QiSubscription:
        """Listen to an object that a method has returned.  Raises BadValue, LinkGone."""
        try:
            meta, service, object_ = to_row(found, 3)[:3]
            service, object_ = (to_whole(number, 0, 0xFFFFFFFF) for number in (service, object_))
            signal = MetaObject.from_value(meta).signals[name]
        except (BadFrame, KeyError) as error:
            raise no_such_signal(name) from error
        return self._listen((service, object_, signal.uid), signal.signature, heard)

    def _listen(self, address: tuple[int, int, int], signature: str, heard: Heard) -> QiSubscription:
        connection = self._home(address[0])
        return QiSubscription((connection, connection.listen(address, signature, heard)))

    def stop_listening(self, subscription: QiSubscription) -> None:
        """End a subscription; twice is fine.  Raises LinkGone."""
        connection: QiConnection
        listener: QiListener
        connection, listener = subscription.handle
        connection.stop_listening(listener)

    def serve_calls(self, answer: Callable[[Caller, f.QiMessage], None]) -> None:
        """Give calls that come over the connection to the directory to ``answer``."""
        self._main.answer_call = answer


def _probe(link: Link) -> str:
    """Find out who does not answer a login; return the sentence.

    A web server waits for the end of a line, which the login has not: an empty line lets it complain.
    """
    where = link.url.text
    try:
        link.write(b"\r\n\r\n")
        data = link.read(1024, link.clock.now() + PROBE_S)
    except LinkGone:
        return describe_hang_up(where)
    return describe_stranger(where, data) if data else describe_silence(where, TIMEOUT_S)
