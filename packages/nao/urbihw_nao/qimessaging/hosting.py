"""Objects of ours as services of NAOqi: registered in its ServiceDirectory, called over the connection to it or over
connections that others make to us.

    hosting.serve_object("mathematics", [ServedMethod("add", add, "(mm)")], "sums")

An object is registered at once, or when there is a session, and again in each new session, until ``withdraw_object``.
Others reach it at an end point of ours, which is open only while there are objects.  NAOqi itself may also call over
the connection on which it was registered.

The end point is on the address by which this computer reaches the robot: on loopback for a robot on loopback.  It is
not encrypted; so over ``qis://`` there is none unless an address is given, for a client that logs in there would
send the robot's password in clear.
"""

from __future__ import annotations

import errno
import ipaddress
import os
import socket
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.listening import BusListener
from urbihw.buses.tcp import TcpLink
from urbihw.frozen import frozen
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.login_guard import LoginGuard
from urbihw_nao.qimessaging.metaobject import MetaObject
from urbihw_nao.qimessaging.serving import ObjectServer, ServedMethod, ServedObject
from urbihw_nao.qimessaging.session import QiCall, QiService, QiSession
from urbihw_nao.qimessaging.signatures import parse
from urbihw_nao.qimessaging.visitors import QiVisitor

DIRECTORY: Final = "ServiceDirectory"
LOOPBACK: Final = "127.0.0.1"
RETRY_S: Final = 2.0
"""Seconds until a name that was refused in a new session is tried again: the robot may not have noticed yet that the
last connection is gone."""

Then = Callable[[str], None]
"""Gets "" or, in one line, why an object is not registered."""


def ignore_outcome(problem: str) -> None:
    """Does nothing: the default of an object whose owner does not ask whether it is registered."""


@frozen(slots=False)
class EndPointSettings:
    """Who may call, and where.

    Attributes:
        login: what a caller must know: that of this computer at the robot.
        host: address to listen on, "" for the one by which this computer reaches the robot.
        port: port to listen on, 0 for any.
    """

    login: Login = field(default_factory=Login)
    host: str = ""
    port: int = 0


@dataclass
class _HostedObject:
    """An object: ``number`` is that of its service, 0 while it is not registered; ``known`` whether it ever was, so
    that a refusal is not the end."""

    served: ServedObject
    then: Then
    number: int = 0
    known: bool = False
    retry_at: float | None = None


class Hosting:
    """All objects of one worker.

    Attributes:
        settings: take effect when the end point is opened.
        guard: counts wrong logins of callers, by whatever way they come; a new one for each session.
    """

    def __init__(self) -> None:
        self.settings = EndPointSettings()
        self._entries: dict[str, _HostedObject] = {}
        self._session: QiSession | None = None
        self._port: Port
        self.guard: LoginGuard
        self._server: ObjectServer
        self._listener: BusListener | None = None
        self._refusal = ""

    # ---------------------------------------------------------------- objects

    def serve_object(
        self,
        name: str,
        methods: Sequence[ServedMethod],
        description: str = "",
        then: Then = ignore_outcome,
        insist: bool = False,
    ) -> None:
        """Offer an object under a name, or change what is offered under it.

        ``then("")`` is called when it is registered, ``then(problem)`` when the robot refuses it, which is then
        forgotten; with ``insist`` it is tried again instead.  Raises BadValue for an invalid signature, LinkGone.
        """
        served = ServedObject(name, description, methods)
        entry = self._entries.get(name)
        if entry is None:
            entry = self._entries[name] = _HostedObject(served, then, known=insist)
            self._register(entry)
            return
        entry.served = served
        if entry.number:
            self._server.objects[entry.number] = served
            then("")
        else:
            entry.then = _both(entry.then, then)

    def withdraw_object(self, name: str) -> None:
        """Offer it no more; a name that is not there is no error.  Raises LinkGone."""
        entry = self._entries.pop(name, None)
        if entry is not None and entry.number and self._session is not None:
            self._unregister(entry.number)
        if not self._entries:
            self._close_end_point()

    # ---------------------------------------------------------------- the session

    def begin(self, session: QiSession, port: Port) -> None:
        """Use this session from now on, and register all objects.  Raises LinkGone."""
        self._session, self._port = session, port
        self.guard = LoginGuard(port.clock.now)
        self._server = ObjectServer(port.clock.now)
        self._refusal = ""
        try:
            session.serve_calls(self._server.answer_call)
        except Unavailable as error:
            self._refusal = str(error)
        for entry in list(self._entries.values()):
            self._register(entry)

    def end(self) -> None:
        """The session is gone, and all who call."""
        if self._session is None:
            return
        self._session = None
        for entry in self._entries.values():
            entry.number, entry.retry_at = 0, None
        self._close_end_point()
        self._server.objects.clear()
        self._server.drop_all()

    @property
    def server(self) -> ObjectServer:
        """Runs calls that come by another way.  Raises LinkGone without a session."""
        if self._session is None:
            raise LinkGone("the link is down")
        return self._server

    def poll(self, now: float) -> None:
        """Handle what has come in; call it once a tick.  Raises LinkGone."""
        if self._session is None:
            return
        if self._listener is not None:
            self._listener.poll(now)
        self._server.end_overdue()
        for entry in list(self._entries.values()):
            if entry.retry_at is not None and now >= entry.retry_at:
                self._register(entry)

    # ---------------------------------------------------------------- registering

    def _register(self, entry: _HostedObject) -> None:
        entry.retry_at = None
        session = self._session
        if session is None:
            return
        try:
            if self._refusal:
                raise Unavailable(errno.ENOTSUP, self._refusal)
            directory = session.look_up(DIRECTORY)
            info = self._describe(session, directory, entry.served.name)
            session.call(directory, "registerService", info, then=lambda call: self._registered(session, entry, call))
        except (Unavailable, BadValue) as error:
            self._refused(entry, str(error))

    def _describe(self, session: QiSession, directory: QiService, name: str) -> tuple[Any, ...]:
        """The ServiceInfo of a new service."""
        local = self._is_local()
        machine = session.wait(session.call(directory, "machineId")) if local else str(own_machine_id())
        info = (name, 0, machine, os.getpid(), self._open_end_point(), "")
        # Since libqi 4 an identifier of the object follows.
        return info + ("",) * (_count_of_fields(directory.meta) - len(info))

    def _registered(self, session: QiSession, entry: _HostedObject, call: QiCall) -> None:
        if self._session is not session:
            return
        if call.error:
            self._refused(entry, call.error)
            return
        number = int(call.value)
        if self._entries.get(entry.served.name) is not entry:
            # It was withdrawn meanwhile.
            self._unregister(number)
            return
        entry.number, entry.known = number, True
        self._server.objects[number] = entry.served
        session.call(session.look_up(DIRECTORY), "serviceReady", number, then=lambda _: self._tell(entry, ""))

    def _refused(self, entry: _HostedObject, problem: str) -> None:
        if entry.known:
            entry.retry_at = self._port.clock.now() + RETRY_S
            return
        if self._entries.get(entry.served.name) is entry:
            del self._entries[entry.served.name]
        if not self._entries:
            self._close_end_point()
        self._tell(entry, problem)

    def _tell(self, entry: _HostedObject, problem: str) -> None:
        then, entry.then = entry.then, ignore_outcome
        then(problem)

    def _unregister(self, number: int) -> None:
        assert self._session is not None
        self._server.objects.pop(number, None)
        self._session.call(self._session.look_up(DIRECTORY), "unregisterService", number)

    # ---------------------------------------------------------------- the end point

    def _host(self) -> str:
        """The address of this computer on the connection to the robot."""
        return self._port.local_host if isinstance(self._port, TcpLink) else LOOPBACK

    def _is_local(self) -> bool:
        return ipaddress.ip_address(self._host()).is_loopback

    def _open_end_point(self) -> list[str]:
        """Listen, if that was not done before; return the end points.  Raises Unavailable."""
        wanted = self.settings
        if self._port.url.scheme == "qis" and not wanted.host:
            return []
        if self._listener is None:
            server = self._server

            def welcome(now: float, address: str) -> QiVisitor:
                return QiVisitor(server, now, address, self.guard, self.settings.login)

            self._listener = BusListener(wanted.host or self._host(), wanted.port, welcome)
        host = self._listener.host
        shown = self._host() if ipaddress.ip_address(host).is_unspecified else host
        return [f"tcp://{shown}:{self._listener.port}"]

    def _close_end_point(self) -> None:
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()


def own_machine_id() -> uuid.UUID:
    """An identifier of this computer, for a robot that is another one: the same each time."""
    return uuid.uuid5(uuid.NAMESPACE_DNS, socket.gethostname())


def _count_of_fields(directory: MetaObject) -> int:
    """How many fields the ServiceInfo of this directory has."""
    (method, *_) = directory.methods["registerService"]
    (info,) = parse(method.parameters).parts
    return len(info.parts)


def _both(first: Then, second: Then) -> Then:
    def then(problem: str) -> None:
        first(problem)
        second(problem)

    return then
