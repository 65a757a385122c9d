"""Services of clients: what is known of one that was registered in the directory, and calls to it.

A client that has an end point of its own is called there, over a connection that the robot opens; one without is
called over the connection on which it has registered.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from urbihw_nao_fakes import codec
from urbihw_nao_fakes.connection import Connection, Returned
from urbihw_nao_fakes.services import AUTHENTICATE, DONE, MAIN_OBJECT, META_OBJECT, Failed, as_failure

ABSOLUTE = "tcp://"
Then = Callable[[Any], None]
"""Gets the value of a call, or a `Failed`."""


class Info(NamedTuple):
    """A ServiceInfo as clients send it."""

    name: str
    number: int
    machine: str
    process: int
    endpoints: list[str]
    session: str


class Caller(Protocol):
    """Who sends messages: the server."""

    def open_connection(self, url: str) -> Connection:
        """Connect to an end point.  Raises Failed."""

    def send_call(self, connection: Connection, target: codec.Target, payload: bytes, then: Returned) -> None:
        """Call, and get the payload of the answer or a Failed."""


class ForeignService:
    """A service of a client.

    Attributes:
        info: what its owner has told.
        owner: the connection on which it was registered.
        ready: whether its owner has said that it can be called.
    """

    def __init__(self, info: Info, owner: Connection, caller: Caller) -> None:
        self.info, self.owner = info, owner
        self.ready = False
        self._caller = caller
        self._route: Connection | None = None
        self._methods: list[tuple[Any, ...]] = []

    def call(self, name: str, arguments: tuple[Any, ...], then: Then) -> None:
        """Call a method by its name; the first one with so many parameters that takes the values."""

        def run(connection: Connection) -> None:
            try:
                uid, returns, payload = self._encode(name, arguments)
            except Failed as error:
                then(error)
            else:
                self._send(connection, uid, payload, lambda answer: then(codec.decode(returns, answer)), then)

        self._find_route(run, then)

    def _encode(self, name: str, arguments: tuple[Any, ...]) -> tuple[int, str, bytes]:
        """The number of the method, its result's signature, and the payload.  Raises Failed."""
        for uid, returns, each, parameters, *_ in self._methods:
            if each == name and len(codec.inner(parameters)) == len(arguments):
                try:
                    return uid, returns, codec.encode(parameters, arguments)
                except (struct.error, TypeError, ValueError, AttributeError):
                    continue
        raise Failed(f"{self.info.name} has no method {name} for {len(arguments)} such values")

    def _find_route(self, then: Callable[[Connection], None], failed: Then) -> None:
        """Connect, log in and ask for the methods; at once where that was done before."""
        if self._route is not None and not self._route.closed:
            then(self._route)
            return
        urls = [url for url in self.info.endpoints if url.startswith(ABSOLUTE)]
        try:
            route = self._caller.open_connection(urls[0]) if urls else self.owner
        except Failed as error:
            failed(error)
            return

        def learn(answer: bytes) -> None:
            self._methods = list(codec.decode(codec.META, answer)[0].values())
            self._route = route
            then(route)

        def enter(answer: bytes) -> None:
            if codec.decode("{sm}", answer).get("__qi_auth_state", DONE) != DONE:
                raise Failed(f"{self.info.name} at {urls[0]} refuses the robot")
            self._send(route, META_OBJECT, codec.encode("I", 0), learn, failed)

        if route is self.owner:
            self._send(route, META_OBJECT, codec.encode("I", 0), learn, failed)
        else:
            login = codec.Target(0, 0, AUTHENTICATE)
            self._caller.send_call(route, login, codec.encode("{sm}", {}), _either(enter, failed))

    def _send(
        self, connection: Connection, action: int, payload: bytes, then: Callable[[bytes], None], failed: Then
    ) -> None:
        target = codec.Target(self.info.number, MAIN_OBJECT, action)
        self._caller.send_call(connection, target, payload, _either(then, failed))


def _either(then: Callable[[bytes], None], failed: Then) -> Returned:
    """One continuation for an answer, one for an error and for an answer that cannot be read."""

    def returned(answer: bytes | Failed) -> None:
        if isinstance(answer, Failed):
            failed(answer)
            return
        try:
            then(answer)
        except codec.BadMessage:
            failed(Failed("the answer cannot be read"))
        except Exception as error:
            failed(as_failure(error))

    return returned
