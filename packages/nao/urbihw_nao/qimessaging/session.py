"""A session with NAOqi, whatever carries it: log in, look services up, call them, hear their signals.

Two back ends have this interface, and one contract test:

    wire_session    ours, over a link: ``qi://``, ``qis://``
    libqi           that of Aldebaran's library: ``libqi://``, ``libqis://``

``opening.open_session`` chooses by the port.  A session belongs to one thread.  Calls are sent at once and answered
later: ``poll`` handles what has arrived, and gives each answer to the ``QiCall`` it belongs to.  A call that is not
answered in time fails, and so do all of them when the link is gone.  Only ``authenticate``, ``names``, ``look_up`` and
``wait`` wait.
"""

from __future__ import annotations

import errno
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from urbihw.buses.clock import BusClock
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.frozen import frozen
from urbihw_nao.qimessaging.checked import LONGEST_SHOWN, describe_error, show_text
from urbihw_nao.qimessaging.frames import QiMessage
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.metaobject import MetaObject, Method, QiSignal
from urbihw_nao.qimessaging.serving import Caller

TIMEOUT_S: Final = 2.0
"""Seconds for the answer to a call, unless its caller says otherwise."""
Heard = Callable[[tuple[Any, ...]], None]
"""Gets the values of a signal."""


@dataclass(eq=False)
class QiCall:
    """A call under way, and its outcome: ``value``, or ``error`` in one line.

    Attributes:
        timeout: seconds that it may take; ``deadline`` is when they are over.
        then: gets it when it is over.
    """

    timeout: float
    deadline: float
    then: Callable[[QiCall], None] | None = None
    done: bool = False
    value: Any = None
    error: str = ""

    def finish(self, value: Any = None, error: str = "") -> None:
        """Set the outcome and tell ``then``."""
        self.done, self.value, self.error = True, value, error
        if self.then is not None:
            self.then(self)


@frozen(slots=False)
class QiService:
    """A service that was looked up: its name, its number in the directory, what it offers."""

    name: str
    number: int
    meta: MetaObject


@frozen(slots=False, eq=False)
class QiSubscription:
    """A signal that is listened to; ``handle`` is the back end's."""

    handle: Any


@dataclass
class QiCounters:
    """What went wrong since the session began."""

    timeouts: int = 0
    refused: int = 0
    unreadable: int = 0
    late: int = 0


class QiSession(ABC):
    """Base of the back ends: a connection to the services of a robot, polled by its owner.

    Attributes:
        counters: what went wrong so far.
    """

    def __init__(self, clock: BusClock) -> None:
        self.counters = QiCounters()
        self._clock = clock

    # ---------------------------------------------------------------- in and out

    def poll(self) -> None:
        """Handle what has arrived, and give up what has waited too long.  Raises LinkGone."""
        now = self._clock.now()
        self._receive(now, None)
        for call in self._pop_overdue(now):
            self._expire(call)

    def wait(self, call: QiCall) -> Any:
        """Wait until a call is answered; return its value.  Raises Unavailable for an error or no answer, LinkGone."""
        while not call.done:
            self._receive(call.deadline, call)
            if not call.done and self._clock.now() >= call.deadline:
                self._drop(call)
                self._expire(call)
        if call.error:
            raise Unavailable(errno.EPROTO, call.error)
        return call.value

    def _expire(self, call: QiCall) -> None:
        self.counters.timeouts += 1
        call.finish(error=f"NAOqi did not answer in {call.timeout:g} s")

    @abstractmethod
    def _receive(self, deadline: float, call: QiCall | None) -> None:
        """Handle what has arrived; if that is nothing, wait until the deadline for what belongs to ``call``.

        Raises LinkGone.
        """

    @abstractmethod
    def _pop_overdue(self, now: float) -> list[QiCall]:
        """Remove the calls whose deadline has passed, and return them."""

    @abstractmethod
    def _drop(self, call: QiCall) -> None:
        """Remove a call: an answer that still comes is late."""

    @abstractmethod
    def close(self, reason: str) -> None:
        """The link is gone: everything that waits fails for this reason."""

    # ---------------------------------------------------------------- the robot

    @abstractmethod
    def authenticate(self, login: Login | None = None) -> None:
        """Log in, by default without a name.  Raises Unavailable, LinkGone."""

    @abstractmethod
    def names(self) -> list[str]:
        """The services that there are, sorted.  Raises Unavailable, BadFrame, LinkGone."""

    @abstractmethod
    def look_up(self, name: str) -> QiService:
        """Find a service, and what it offers; both are remembered.  Raises Unavailable, LinkGone."""

    # ---------------------------------------------------------------- services

    def call(
        self,
        service: QiService,
        name: str,
        *arguments: Any,
        then: Callable[[QiCall], None] | None = None,
        timeout: float = TIMEOUT_S,
    ) -> QiCall:
        """Call a method; ``then`` gets the outcome.  Raises BadValue (no such method, wrong arguments), LinkGone."""
        return self._call(service, service.meta.choose(service.name, name, arguments), arguments, then, timeout)

    @abstractmethod
    def _call(
        self,
        service: QiService,
        method: Method,
        arguments: tuple[Any, ...],
        then: Callable[[QiCall], None] | None,
        timeout: float,
    ) -> QiCall:
        """Call a method that was chosen.  Raises BadValue, LinkGone."""

    def post(self, service: QiService, name: str, *arguments: Any) -> None:
        """Call a method and want no answer.  Raises BadValue, LinkGone."""
        self._post(service, service.meta.choose(service.name, name, arguments), arguments)

    @abstractmethod
    def _post(self, service: QiService, method: Method, arguments: tuple[Any, ...]) -> None:
        """Call a method that was chosen, for no answer.  Raises BadValue, LinkGone."""

    def get_property(self, service: QiService, name: str, then: Callable[[QiCall], None] | None = None) -> QiCall:
        """Read a property.  Raises BadValue, LinkGone."""
        return self._read(service, find_member(service, "property", service.meta.properties, name), then)

    @abstractmethod
    def _read(self, service: QiService, found: QiSignal, then: Callable[[QiCall], None] | None) -> QiCall:
        """Read a property that is there.  Raises LinkGone."""

    def set_property(
        self, service: QiService, name: str, value: Any, then: Callable[[QiCall], None] | None = None
    ) -> QiCall:
        """Write a property.  Raises BadValue, LinkGone."""
        return self._write(service, find_member(service, "property", service.meta.properties, name), value, then)

    @abstractmethod
    def _write(
        self, service: QiService, found: QiSignal, value: Any, then: Callable[[QiCall], None] | None
    ) -> QiCall:
        """Write a property that is there.  Raises BadValue, LinkGone."""

    def listen(self, service: QiService, name: str, heard: Heard) -> QiSubscription:
        """Call ``heard`` with the values of each signal from now on.  Raises BadValue, LinkGone."""
        return self._hear(service, find_member(service, "signal", service.meta.signals, name), heard)

    @abstractmethod
    def _hear(self, service: QiService, signal: QiSignal, heard: Heard) -> QiSubscription:
        """Listen to a signal that is there.  Raises LinkGone."""

    @abstractmethod
    def listen_to_object(self, found: Any, name: str, heard: Heard) -> QiSubscription:
        """The same of an object that a method has returned, such as a subscriber of ALMemory.

        Raises BadValue, LinkGone.
        """

    @abstractmethod
    def stop_listening(self, subscription: QiSubscription) -> None:
        """End a subscription; twice is fine.  Raises LinkGone."""

    # ---------------------------------------------------------------- objects of ours

    def serve_calls(self, answer: Callable[[Caller, QiMessage], None]) -> None:
        """Give calls of the other side to ``answer``, which no back end but ours can.  Raises Unavailable."""
        raise Unavailable(errno.ENOTSUP, "objects can be offered to NAOqi over qi:// and qis:// only")


def find_member(service: QiService, kind: str, members: Mapping[str, QiSignal], name: str) -> QiSignal:
    """The signal or property of this name.  Raises BadValue, naming what there is."""
    if name not in members:
        known = show_text(", ".join(sorted(members)) or "none")
        raise BadValue(f"{show_text(service.name)} has no {kind} {show_text(name)}; it has {known}")
    return members[name]


def no_such_signal(name: str) -> BadValue:
    """The error for an object of a method that cannot be listened to."""
    return BadValue(f"what NAOqi returned is no object with a signal {show_text(name)}")


def first_line(text: Any) -> str:
    """The part of an error text of NAOqi that is for people: behind it come the lines of the server's own source."""
    head = str(text)[: 4 * LONGEST_SHOWN].strip().partition("\n\n")[0]
    return show_text(" ".join(head.split())) or "NAOqi gives no reason"


def unusable(where: str, error: Exception) -> LinkGone:
    """The error for a message that cannot be handled: whatever the other side sends ends its link, not the worker."""
    return LinkGone(f"{where}: what came cannot be handled: {describe_error(error)}; connecting again")
