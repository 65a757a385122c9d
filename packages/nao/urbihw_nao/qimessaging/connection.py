"""One connection of QiMessaging over a link: messages out, answers and events in.  No thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from urbihw.buses.errors import BadFrame, LinkGone
from urbihw.buses.link import Link
from urbihw.frozen import frozen
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.login import describe_stranger
from urbihw_nao.qimessaging.session import TIMEOUT_S, Heard, QiCall, QiCounters, first_line, unusable
from urbihw_nao.qimessaging.signatures import parse
from urbihw_nao.qimessaging.values import decode, encode

REGISTER_EVENT, UNREGISTER_EVENT = 0, 1
_READ_BYTES: Final = 65536
_MOST_READS: Final = 16
"""Reads in one ``receive``: an endless sender must not hold the worker."""

Address = tuple[int, int, int]
"""Service, object and action."""


@frozen(slots=False, eq=False)
class QiListener:
    """Who hears a signal; ``link`` is the number under which the first one registered it with the other side."""

    address: Address
    signature: str
    heard: Heard
    link: int


class QiConnection:
    """A link on which messages of QiMessaging go out and come in.

    Attributes:
        link: the link, open.
        answer_call: called for a call, post or cancellation of the other side; it answers through ``send``.
        stranger: why the other side is no server of QiMessaging, "" as long as it may be one.
    """

    def __init__(self, link: Link, counters: QiCounters) -> None:
        self.link = link
        self.answer_call: Callable[[QiConnection, f.QiMessage], None] = refuse_call
        self.stranger = ""
        self._counters = counters
        self._framer = f.QiFramer()
        self._calls: dict[int, tuple[QiCall, Address, str]] = {}
        self._listeners: dict[Address, list[QiListener]] = {}
        self._count = 0

    # ---------------------------------------------------------------- in

    def receive(self, deadline: float) -> None:
        """Handle what has arrived; if that is nothing, wait until the deadline for something.  Raises LinkGone."""
        for _ in range(_MOST_READS):
            data = self.link.read(_READ_BYTES, deadline)
            if not data:
                break
            self._handle(data)
            deadline = self.link.clock.now()

    def _handle(self, data: bytes) -> None:
        try:
            messages = self._framer.feed(data)
        except BadFrame as error:
            where = self.link.url.text
            self.stranger = describe_stranger(where, data)
            raise LinkGone(f"{where}: {error}; connecting again") from error
        for message in messages:
            try:
                self._handle_message(message)
            except LinkGone:
                raise
            except Exception as error:
                # Nothing that the other side sends may end the worker.
                raise unusable(self.link.url.text, error) from error

    def _handle_message(self, message: f.QiMessage) -> None:
        if message.type == f.EVENT:
            self._dispatch_event(message)
        elif message.type in (f.REPLY, f.ERROR, f.CANCELLED):
            self._handle_answer(message)
        elif message.type in (f.CALL, f.POST, f.CANCEL):
            self.answer_call(self, message)

    def _handle_answer(self, message: f.QiMessage) -> None:
        call, address, returns = self._calls.pop(message.id, (None, None, ""))
        if call is None:
            self._counters.late += 1
            return
        if address != (message.service, message.object, message.action):
            call.finish(error="the answer is damaged")
            raise LinkGone(f"{self.link.url.text}: what came is no message of QiMessaging; connecting again")
        value, problem = None, ""
        try:
            if message.type == f.ERROR:
                self._counters.refused += 1
                problem = first_line(decode("m", message.payload))
            elif message.type == f.CANCELLED:
                problem = "NAOqi has cancelled it"
            else:
                value = decode("m" if message.flags & f.DYNAMIC else returns, message.payload)
        except BadFrame as error:
            self._counters.unreadable += 1
            problem = f"the answer cannot be read: {error}"
        call.finish(value, problem)

    def _dispatch_event(self, message: f.QiMessage) -> None:
        listeners = self._listeners.get((message.service, message.object, message.action))
        if not listeners:
            return
        try:
            value = decode("m" if message.flags & f.DYNAMIC else listeners[0].signature, message.payload)
        except BadFrame:
            self._counters.unreadable += 1
            return
        for listener in tuple(listeners):
            listener.heard(value if isinstance(value, tuple) else (value,))

    # ---------------------------------------------------------------- out

    def send(self, kind: int, address: Address, payload: bytes, number: int | None = None) -> int:
        """Send a message; return its number, a new one unless it answers another.  Raises LinkGone."""
        if number is None:
            number = self.next_number()
        self.link.write(bytes(f.QiMessage(kind, number, *address, payload)))
        return number

    def next_number(self) -> int:
        """A number that no message and no subscription of this connection has now."""
        self._count = self._count % 0xFFFFFFFF + 1
        return self._count

    def call(
        self,
        address: Address,
        payload: bytes,
        returns: str,
        then: Callable[[QiCall], None] | None = None,
        timeout: float = TIMEOUT_S,
    ) -> QiCall:
        """Call an action by its number; ``timeout`` in seconds.  Raises LinkGone."""
        parse(returns)
        call = QiCall(timeout, self.link.clock.now() + timeout, then)
        self._calls[self.send(f.CALL, address, payload)] = call, address, returns
        return call

    def listen(self, address: Address, signature: str, heard: Heard) -> QiListener:
        """Call ``heard`` with the values of each event that comes from this address.  Raises LinkGone.

        An event does not tell for which subscription it was sent, so the other side gets one for all listeners.
        """
        listeners = self._listeners.setdefault(address, [])
        link = listeners[0].link if listeners else self.next_number()
        listener = QiListener(address, signature, heard, link)
        listeners.append(listener)
        if len(listeners) == 1:
            service, object_, signal = address
            self.call((service, object_, REGISTER_EVENT), encode("(IIL)", (object_, signal, link)), "L")
        return listener

    def stop_listening(self, listener: QiListener) -> None:
        """End it; twice is fine.  Raises LinkGone."""
        listeners = self._listeners.get(listener.address, [])
        if listener not in listeners:
            return
        listeners.remove(listener)
        if not listeners:
            service, object_, signal = listener.address
            self.call((service, object_, UNREGISTER_EVENT), encode("(IIL)", (object_, signal, listener.link)), "v")

    # ---------------------------------------------------------------- the end of calls

    def has(self, call: QiCall) -> bool:
        """Whether a call waits for its answer here."""
        return any(row[0] is call for row in self._calls.values())

    def pop_overdue(self, now: float) -> list[QiCall]:
        """Remove the calls whose deadline has passed, and return them."""
        late = [number for number, row in self._calls.items() if now > row[0].deadline]
        return [self._calls.pop(number)[0] for number in late]

    def drop(self, call: QiCall) -> None:
        """Remove a call: an answer that still comes is late."""
        self._calls = {number: row for number, row in self._calls.items() if row[0] is not call}

    def fail_all(self, reason: str) -> None:
        """Everything that waits fails, and nothing is listened to any more."""
        calls, self._calls = self._calls, {}
        self._listeners.clear()
        for call, _, _ in calls.values():
            call.finish(error=reason)


def refuse_call(connection: QiConnection, message: f.QiMessage) -> None:
    """Answer a call of the other side where nothing is offered to it.  Raises LinkGone."""
    if message.type == f.CALL:
        address = message.service, message.object, message.action
        connection.send(f.ERROR, address, encode("m", "urbihw offers no service"), message.id)
