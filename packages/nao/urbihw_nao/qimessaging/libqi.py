"""``libqi://`` and ``libqis://``: a session of libqi, the library of Aldebaran, by its Python package ``qi``.

The package exists for x86-64 Linux and Python up to 3.12 only; ``qi://`` needs nothing and is faster.

libqi has threads of its own and calls back on them.  They do no more than to put what they bring into a queue; ``poll``
and ``wait`` empty it in the thread of the session.  The port closes libqi's session: a process that ends with an open
one may crash (fact sheet, section 3).

Overloads are chosen here, by the same rules as in our own session.  libqi's Python makes text of bytes that travel as a
dynamic value, so bytes are accepted only where a method says raw (``r``).
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping
from queue import Empty, SimpleQueue
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.extras import install_command
from urbihw.settings import SettingRule
from urbihw_nao.qimessaging.checked import is_name, show_text, to_row
from urbihw_nao.qimessaging.libqi_values import DYNAMIC, from_libqi, meta_value, to_libqi
from urbihw_nao.qimessaging.link import LINE_BITS, PORT, TLS_PORT, split_address
from urbihw_nao.qimessaging.login import (
    AUTH_CONTINUE,
    AUTH_ERROR,
    AUTH_STATE,
    REFUSED,
    Login,
    describe_closed_port,
    describe_hang_up,
    describe_silence,
)
from urbihw_nao.qimessaging.metaobject import MetaObject, Method, QiSignal
from urbihw_nao.qimessaging.opening import SessionPort
from urbihw_nao.qimessaging.session import (
    TIMEOUT_S,
    Heard,
    QiCall,
    QiService,
    QiSession,
    QiSubscription,
    first_line,
    no_such_signal,
    unusable,
)
from urbihw_nao.qimessaging.signatures import Type, parse

CLOSE_S: Final = 2.0
"""Seconds for libqi to close its session."""
_MOST_NEWS: Final = 4096
"""Entries of the queue that one ``poll`` handles: who never stops sending must not hold the worker."""


class LibqiPort(SessionPort):
    """A session of libqi, made when it is opened; it connects at the login."""

    scheme = "tcp"
    default_port = PORT

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self.baud = LINE_BITS
        self.address = split_address(url, self.default_port)
        self._session: Any = None

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return no rules: there are no parameters."""
        return {}

    def _open(self) -> None:
        # What libqi logs is said by us, in one line; the level must be there before the package is loaded.
        os.environ.setdefault("QI_LOG_LEVEL", "0")
        try:
            import qi
        except ImportError as error:
            raise Unavailable(
                errno.ENOPKG,
                f"{self.url.scheme}:// needs the Python package qi (for x86-64 Linux and Python up to 3.12 only): "
                f"{install_command('libqi', wheel='urbihw-nao')}; qi:// needs no package",
            ) from error
        self._session = qi.Session()

    def _close(self) -> None:
        session, self._session = self._session, None
        session.close(_async=True).wait(round(CLOSE_S * 1000))

    def make_session(self) -> QiSession:
        """The session over the open port."""
        return LibqiSession(self, self._session)


class LibqisPort(LibqiPort):
    """The same over TLS; libqi verifies no certificate."""

    scheme = "tcps"
    default_port = TLS_PORT
    warning = "encrypted, but libqi does not verify the certificate of the robot; qis:// can pin it"


class LibqiSession(QiSession):
    """A session over ``session``, that of libqi which ``port`` has made."""

    def __init__(self, port: LibqiPort, session: Any) -> None:
        super().__init__(port.clock)
        self._port = port
        self._session = session
        self._news: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._calls: dict[QiCall, Any] = {}
        self._services: dict[str, QiService] = {}
        self._objects: dict[str, Any] = {}
        self._listening: set[QiSubscription] = set()

    # ---------------------------------------------------------------- in and out

    def _receive(self, deadline: float, call: QiCall | None) -> None:
        pause = deadline - self._clock.now()
        try:
            work = self._news.get(timeout=pause) if pause > 0 else self._news.get_nowait()
            for _ in range(_MOST_NEWS):
                try:
                    work()
                except LinkGone:
                    raise
                except Exception as error:
                    # Nothing that the other side sends may end the worker.
                    raise unusable(self._port.url.text, error) from error
                if call is not None and call.done:
                    return
                work = self._news.get_nowait()
        except Empty:
            pass

    def _follow(
        self,
        future: Any,
        then: Callable[[QiCall], None] | None = None,
        timeout: float = TIMEOUT_S,
        returns: Type = DYNAMIC,
    ) -> QiCall:
        """The call that a future of libqi answers, with a value of the type ``returns``."""
        call = QiCall(timeout, self._clock.now() + timeout, then)
        self._calls[call] = future
        news = self._news
        # Called on a thread of libqi, or here at once if the future is ready.
        future.addCallback(lambda ready: news.put(lambda: self._handle_answer(call, ready, returns)))
        return call

    def _handle_answer(self, call: QiCall, future: Any, returns: Type) -> None:
        if self._calls.pop(call, None) is None:
            self.counters.late += 1
            return
        if not future.hasError():
            call.finish(from_libqi(returns, future.value()))
        elif self._services and not self._session.isConnected():
            call.finish(error="the connection is gone")
            raise self._gone()
        else:
            self.counters.refused += 1
            call.finish(error=first_line(future.error()))

    def _gone(self) -> LinkGone:
        return LinkGone(f"{self._port.url.text}: the other side closed; is it switched off?")

    def _handle_disconnection(self) -> None:
        raise self._gone()

    def _pop_overdue(self, now: float) -> list[QiCall]:
        late = [call for call in self._calls if now > call.deadline]
        for call in late:
            del self._calls[call]
        return late

    def _drop(self, call: QiCall) -> None:
        self._calls.pop(call, None)

    def close(self, reason: str) -> None:
        """Fail what waits, for this reason; libqi's own session is closed by the port."""
        calls, self._calls = self._calls, {}
        self._services.clear()
        self._objects.clear()
        self._listening.clear()
        for call in calls:
            call.finish(error=reason)

    # ---------------------------------------------------------------- the robot

    def authenticate(self, login: Login | None = None) -> None:
        """Connect, and log in; the names of the credentials are libqi's own.  Raises Unavailable."""
        host, port = self._port.address
        words = login.words() if login is not None else {}
        news, refusals = self._news, list[int]()

        def refuse(state: int) -> None:
            """Called on a thread of libqi, which would ask for ever."""
            refusals.append(state)
            news.put(lambda: call.finish(error=REFUSED) if not call.done else None)

        user, token = (words[login.user_key], words[login.token_key]) if login is not None and words else ("", "")
        self._session.setClientAuthenticatorFactory(_Authenticator(user, token, refuse))
        call = self._follow(self._session.connect(f"{self._port.scheme}://{host}:{port}", _async=True))
        while not call.done and self._clock.now() < call.deadline:
            self._receive(call.deadline, call)
        if not call.done or call.error:
            self._drop(call)
            raise Unavailable(errno.EACCES, self._describe_failure(call, refusals))
        self._session.disconnected.connect(lambda _: news.put(self._handle_disconnection))

    def _describe_failure(self, call: QiCall, refusals: list[int]) -> str:
        where = self._port.url.text
        if refusals and refusals[0] == AUTH_CONTINUE:
            return f"{where}: the robot wants more than a user and a password; qi:// can keep a token for it"
        if refusals:
            return f"{where}: {REFUSED}"
        if not call.done:
            return describe_silence(where, call.timeout)
        head, _, reason = call.error.partition("Connect error: ")
        if not head and reason:
            return describe_closed_port(*self._port.address, reason.partition(": ")[2] or reason)
        return describe_hang_up(where) if "disconnected" in call.error else f"{where}: the login failed: {call.error}"

    def names(self) -> list[str]:
        """Ask the directory for the services, sorted.  Raises Unavailable, LinkGone."""
        found = self.wait(self._follow(self._session.services(_async=True)))
        return sorted(row["name"] for row in to_row(found) if is_name(row["name"]))

    def look_up(self, name: str) -> QiService:
        """Find a service, and what it offers; both are remembered.  Raises Unavailable, LinkGone."""
        if name not in self._services:
            found = self.wait(self._follow(self._session.service(name, _async=True)))
            try:
                meta = MetaObject.from_value(meta_value(found.metaObject()))
            except (BadFrame, AttributeError) as error:
                raise Unavailable(errno.EPROTO, f"{show_text(name)} does not tell what it offers: {error}") from error
            self._objects[name] = found
            self._services[name] = QiService(name, 0, meta)
        return self._services[name]

    # ---------------------------------------------------------------- services

    def _object(self, service: QiService) -> Any:
        """libqi's object of a service.  Raises LinkGone."""
        found = self._objects.get(service.name)
        if found is None or not self._session.isConnected():
            raise self._gone()
        return found

    def _send(self, service: QiService, method: Method, arguments: tuple[Any, ...]) -> tuple[Any, Type]:
        """Call a method; return the future of libqi and the type of its value.  Raises BadValue, LinkGone."""
        parts = parse(method.parameters).parts
        words = [to_libqi(part, each, 0) for part, each in zip(parts, arguments, strict=True)]
        try:
            future = self._object(service).call(f"{method.name}::{method.parameters}", *words, _async=True)
        except RuntimeError as error:
            raise BadValue(f"{service.name}.{method.name}: {first_line(error)}") from error
        return future, parse(method.returns)

    def _call(
        self,
        service: QiService,
        method: Method,
        arguments: tuple[Any, ...],
        then: Callable[[QiCall], None] | None,
        timeout: float,
    ) -> QiCall:
        future, returns = self._send(service, method, arguments)
        return self._follow(future, then, timeout, returns)

    def _post(self, service: QiService, method: Method, arguments: tuple[Any, ...]) -> None:
        # libqi gets the answer all the same.
        self._send(service, method, arguments)

    def _read(self, service: QiService, found: QiSignal, then: Callable[[QiCall], None] | None) -> QiCall:
        return self._follow(self._object(service).call("property::(m)", found.name, _async=True), then)

    def _write(
        self, service: QiService, found: QiSignal, value: Any, then: Callable[[QiCall], None] | None
    ) -> QiCall:
        word = to_libqi(parse("m"), value, 0)
        return self._follow(self._object(service).call("setProperty::(mm)", found.name, word, _async=True), then)

    def _hear(self, service: QiService, signal: QiSignal, heard: Heard) -> QiSubscription:
        return self._listen(self._object(service), signal.name, heard)

    def listen_to_object(self, found: Any, name: str, heard: Heard) -> QiSubscription:
        """Listen to an object that a method has returned.  Raises BadValue, LinkGone."""
        try:
            signals = MetaObject.from_value(meta_value(found.metaObject())).signals
        except AttributeError as error:
            raise no_such_signal(name) from error
        if name not in signals:
            raise no_such_signal(name)
        return self._listen(found, name, heard)

    def _listen(self, found: Any, name: str, heard: Heard) -> QiSubscription:
        news, listening = self._news, self._listening
        signal = getattr(found, name)

        def deliver(values: tuple[Any, ...]) -> None:
            if made in listening:
                heard(tuple([from_libqi(DYNAMIC, each) for each in values]))

        # Called on a thread of libqi.
        future = signal.connect(lambda *values: news.put(lambda: deliver(values)), _async=True)
        made = QiSubscription((signal, future))
        listening.add(made)
        return made

    def stop_listening(self, subscription: QiSubscription) -> None:
        """End a subscription; twice is fine.  Raises LinkGone."""
        if subscription not in self._listening:
            return
        self._listening.remove(subscription)
        signal, future = subscription.handle
        # Only when it is there can it be ended; libqi does not wait here either.
        future.addCallback(lambda ready: None if ready.hasError() else signal.disconnect(ready.value(), _async=True))


class _Authenticator:
    """What libqi asks for credentials, on its own threads; the names of the methods are libqi's."""

    def __init__(self, user: str, token: str, refuse: Callable[[int], None]) -> None:
        self._words = {"user": user, "token": token} if user or token else {}
        self._refuse = refuse

    def newAuthenticator(self) -> _Authenticator:
        """Return who knows the credentials."""
        return self

    def initialAuthData(self) -> dict[str, str]:
        return self._words

    def _processAuth(self, data: Mapping[str, Any]) -> Any:
        """Called when the credentials were not enough; libqi asks again and again until this raises an error."""
        state = data.get(AUTH_STATE)
        self._refuse(state if isinstance(state, int) else AUTH_ERROR)
        raise RuntimeError(REFUSED)
