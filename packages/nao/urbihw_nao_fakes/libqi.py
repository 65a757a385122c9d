"""A Nao behind a session of libqi itself (PyPI ``qi``): the same body and services, Aldebaran's own wire and directory.

Each service is registered as an object of libqi whose methods have the exact signatures.  libqi calls them on its own
threads; they do nothing there but hand the work to the thread that serves the robot, and return a future.  So a method
that blocks delays no other, calls keep their order, and the robot's time goes on by one clock.

libqi wants a process of its own.  Its threads may still hold objects of Python when the session is closed, and abort a
process that ends by the book; so once there was such an end point, the process ends without the interpreter's clean-up.

What the wire of the other end point can do wrong (noise, late answers) it cannot.  In a dynamic result bytes would
become text; services declare raw (``r``) where they return any.
"""

from __future__ import annotations

import atexit
import os
import sys
import time
from collections.abc import Callable
from typing import Any

from urbihw_fakes.errors import FakeError
from urbihw_fakes.serving import Endpoint
from urbihw_nao_fakes import codec
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.foreign import ForeignService, Info, Then
from urbihw_nao_fakes.services import Failed, Later, Method, Service, as_failure

# Its log would be mixed with what the fake prints; the level counts only before the package is loaded.
os.environ.setdefault("QI_LOG_LEVEL", "0")

try:
    import qi
except ImportError:
    qi = None

LOOK_PERIOD_S = 0.01
"""Between two looks at what blocking calls wait for."""
LISTEN_TRIES, LISTEN_PAUSE_S = 20, 0.05
"""Tries to listen on a port that an earlier session has just left."""


class LibqiEndpoint(Endpoint):
    """See the head of this file.  `port` 0 takes a free one.  Raises FakeError without the package."""

    device: Nao

    def __init__(self, device: Nao, port: int = 0, *, clock: Callable[[], float] = time.monotonic) -> None:
        if qi is None:
            raise FakeError("--libqi needs the Python package qi: pip install qi (x86-64 Linux, Python up to 3.12)")
        super().__init__(device, clock=clock)
        self.port = port
        self._session: Any = None
        self._shown: dict[int, Any] = {}
        self._blocking: list[tuple[Later, Method, Any]] = []
        self._plug()

    @property
    def url(self) -> str:
        """`qi://127.0.0.1:` and the port."""
        return f"qi://127.0.0.1:{self.port}"

    @property
    def plugged(self) -> bool:
        """True while the port is open."""
        return self._session is not None

    # ---------------------------------------------------------------- the session

    def _plug(self) -> None:
        self._session = session = self._listen()
        self.port = int(session.endpoints()[0].rpartition(":")[2])
        for number, service in sorted(self.device.services.items()):
            if service is not self.device.directory:
                # libqi numbers in the same order.
                assert session.registerService(service.name, self._show(service)) == number
        session.serviceRegistered.connect(lambda number, name: self._run(lambda: self._add_foreign(number, name)))
        session.serviceUnregistered.connect(lambda number, _: self._run(lambda: self._remove_foreign(number)))

    def _listen(self) -> Any:
        for left in reversed(range(LISTEN_TRIES)):
            session = qi.Session()
            try:
                session.listenStandalone(f"tcp://127.0.0.1:{self.port}")
                return session
            except RuntimeError as error:
                session.close()
                if not left:
                    raise FakeError(f"libqi cannot listen on port {self.port}: {error}") from error
                time.sleep(LISTEN_PAUSE_S)
        raise AssertionError

    def close(self) -> None:
        """See `Endpoint`; and let the process end without the interpreter's clean-up."""
        super().close()
        atexit.unregister(_leave)
        atexit.register(_leave)

    def _unplug(self) -> None:
        session, self._session = self._session, None
        self._shown.clear()
        self._blocking.clear()
        self.device.directory.foreign.clear()
        if session is not None:
            session.close()

    def _readers(self) -> list[int]:
        return []

    def _receive(self, ready: int) -> bytes:
        return b""

    def _send(self, data: bytes) -> None:
        """Do nothing: libqi sends by itself."""

    # ---------------------------------------------------------------- the thread of the robot

    def _run(self, work: Callable[[], None]) -> None:
        """Let the serving thread do it soon."""
        self._calls.append(work)
        self._wake()

    def _select_timeout(self, now: float) -> float | None:
        return LOOK_PERIOD_S if self._blocking or self.device.body.walking else super()._select_timeout(now)

    def _deliver(self, now: float) -> None:
        self.device.tick(now)
        for row in list(self._blocking):
            later, method, promise = row
            try:
                if not later.ready():
                    continue
                promise.setValue(self._shown_value(method, later.value))
            except Exception as error:
                promise.setError(str(as_failure(error)))
            self._blocking.remove(row)

    def _answer(self, service: Service, method: Method, arguments: tuple[Any, ...], promise: Any) -> None:
        """Call a method; its answer may come later."""
        self.device.tick(self.clock())
        try:
            result = service.call(method, *map(_plain, arguments))
            if isinstance(result, Later):
                self._blocking.append((result, method, promise))
            else:
                promise.setValue(self._shown_value(method, result))
        except Exception as error:
            promise.setError(str(as_failure(error)))

    # ---------------------------------------------------------------- objects of libqi

    def _shown_value(self, method: Method, value: Any) -> Any:
        if method.returns != "o":
            return value
        _, number, thing = value
        return self._show(self.device.services[number].find_object(thing))

    def _show(self, service: Service) -> Any:
        """The object of libqi for a service, or for an object that it hands out."""
        if id(service) not in self._shown:
            members = {f"method{uid}": self._bind(service, each) for uid, each in service.methods.items()}
            shown = type(service.name, (), members)()
            for signal in service.signals.values():
                setattr(shown, signal.name, qi.Signal(signal.signature))
            for each in service.properties.values():
                setattr(shown, each.name, qi.Property(each.signature))
                getattr(shown, each.name).setValue(service.values[each.name])
            service.send_event = self._send_event
            self._shown[id(service)] = shown
        return self._shown[id(service)]

    def _bind(self, service: Service, method: Method) -> Any:
        def run(_: Any, *arguments: Any) -> Any:
            """Called on a thread of libqi."""
            promise = qi.Promise()
            self._run(lambda: self._answer(service, method, arguments, promise))
            return promise.future()

        return qi.bind(method.returns, codec.inner(method.parameters), method.name)(run)

    def _send_event(self, service: Service, uid: int, values: tuple[Any, ...]) -> None:
        shown = self._shown.get(id(service))
        if shown is not None:
            getattr(shown, service.signals[uid].name)(*values)

    # ---------------------------------------------------------------- services of clients

    def _add_foreign(self, number: int, name: str) -> None:
        if self._session is not None and all(name != each.name for each in self.device.services.values()):
            self.device.directory.foreign[number] = _LibqiService(self, number, name)

    def _remove_foreign(self, number: int) -> None:
        self.device.directory.foreign.pop(number, None)

    def call_foreign(self, name: str, method: str, arguments: tuple[Any, ...], then: Then) -> None:
        """Call a method of a client's service; ``then`` gets the value, or a `Failed`, in the robot's thread."""

        def tell(future: Any) -> None:
            told = Failed(str(future.error())) if future.hasError() else _plain(future.value())
            self._run(lambda: then(told))

        def call(future: Any) -> None:
            if future.hasError():
                tell(future)
            else:
                future.value().call(method, *arguments, _async=True).addCallback(tell)

        self._session.service(name, _async=True).addCallback(call)


class _LibqiService(ForeignService):
    """A service of a client, called through libqi."""

    def __init__(self, end: LibqiEndpoint, number: int, name: str) -> None:
        super().__init__(Info(name, number, "", 0, [], ""), Connection(), end.device.server)
        self.ready = True
        self._end = end

    def call(self, name: str, arguments: tuple[Any, ...], then: Then) -> None:
        self._end.call_foreign(self.info.name, name, arguments, then)


def _leave() -> None:
    """End the process now; an uncaught exception has been printed, and is a failure."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(1 if hasattr(sys, "last_type") else 0)


def _plain(value: Any) -> Any:
    """An argument as the services know it: raw data are bytes."""
    if isinstance(value, bytearray):
        return bytes(value)
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return value
