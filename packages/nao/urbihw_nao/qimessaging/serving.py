"""Objects of ours that others call by QiMessaging: what they offer, and calls that come in.  No I/O.

``ObjectServer`` answers messages that arrive on any connection; a ``Caller`` is the sender of one.  A method gets an
``IncomingCall`` and answers it at once or later::

    def add(call: IncomingCall) -> None:
        first, second = call.arguments
        call.answer(first + second)

    ServedObject("mathematics", "sums", [ServedMethod("add", add, "(mm)")])

What comes in is never trusted: calls under way, the time of each, calls per second of a caller and the size of the
arguments are bounded (see ``call_limits``), and what exceeds them, or cannot be read, is answered with an error of one
line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

from urbihw.buses.errors import BadFrame, BadValue, BusError
from urbihw.frozen import frozen
from urbihw.settings import one_line
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.call_limits import CALL_BURST, CALLS_A_SECOND, MOST_READ, TokenBucket, check_arguments
from urbihw_nao.qimessaging.metaobject import FIRST_USER_UID
from urbihw_nao.qimessaging.metatype import META_OBJECT
from urbihw_nao.qimessaging.values import decode, encode

CALL_TIMEOUT_S: Final = 60.0
"""Seconds that a call may take; then its caller gets an error."""
MOST_CALLS: Final = 32
"""Calls under way, of all callers together."""
MOST_CALLS_OF_ONE: Final = 16
"""Calls under way of one caller."""
LONGEST_ERROR: Final = 300
"""Characters of an error that a caller gets."""
MAIN: Final = 1
"""The object that is the service itself."""
REGISTER_EVENT, UNREGISTER_EVENT, GET_META_OBJECT, TERMINATE = range(4)
_COMMON: Final = (
    (REGISTER_EVENT, "L", "registerEvent", "(IIL)"),
    (UNREGISTER_EVENT, "v", "unregisterEvent", "(IIL)"),
    (GET_META_OBJECT, META_OBJECT, "metaObject", "(I)"),
    (TERMINATE, "v", "terminate", "(I)"),
)
"""Actions that each object has: number, result, name, parameters."""

Address = tuple[int, int, int]
"""Service, object and action."""


class Caller(Protocol):
    """The connection on which a call has arrived."""

    def send(self, kind: int, address: Address, payload: bytes, number: int | None = None) -> int:
        """Send a message; ``number`` is that of the call it answers."""
        ...


class IncomingCall:
    """A call of somebody else.  It is answered once; later answers, and answers to a post, are dropped.

    Attributes:
        arguments: the values, as they came.
        cancelled: called when the answer is no longer awaited: the caller has left, has cancelled the call, or has
            waited too long.
    """

    def __init__(self, arguments: Sequence[Any], finish: Callable[[Any, str], None]) -> None:
        """``finish(value, error)`` sends the answer."""
        self.arguments = arguments
        self.cancelled: Callable[[], None] | None = None
        self._finish: Callable[[Any, str], None] | None = finish

    @property
    def done(self) -> bool:
        """Whether it was answered, or needs no answer any more."""
        return self._finish is None

    def answer(self, value: Any = None) -> None:
        """Answer with a value; None for a method without a result.  Raises LinkGone."""
        self._end(value, "")

    def fail(self, error: str) -> None:
        """Answer with an error, of which one line is sent.  Raises LinkGone."""
        self._end(None, shorten_error(error) or "no reason is known")

    def cancel(self, error: str = "") -> None:
        """End it from the caller's side: with an error to send, "" for a caller that has left.  Raises LinkGone."""
        if self.done:
            return
        if error:
            self.fail(error)
        self._finish = None
        if self.cancelled is not None:
            self.cancelled()

    def _end(self, value: Any, error: str) -> None:
        finish, self._finish = self._finish, None
        if finish is not None:
            finish(value, error)


@frozen(slots=False)
class ServedMethod:
    """A method that others may call.

    Attributes:
        name: its name.
        run: executes a call.
        parameters: the signature of all parameters together, such as "(mm)".
        returns: that of the result.
        description: what it does.
        parameter_texts: name and description of each parameter.
        result_text: description of the result.
    """

    name: str
    run: Callable[[IncomingCall], None]
    parameters: str = "()"
    returns: str = "m"
    description: str = ""
    parameter_texts: Sequence[tuple[str, str]] = ()
    result_text: str = ""


class ServedObject:
    """What is offered under a name; the numbers of the methods are their places in the list."""

    def __init__(self, name: str, description: str, methods: Sequence[ServedMethod]) -> None:
        self.name = name
        self.description = description
        self.methods = tuple(methods)
        self.meta = encode(META_OBJECT, self._meta_object())

    def find_method(self, uid: int) -> ServedMethod | None:
        """The method of a number."""
        index = uid - FIRST_USER_UID
        return self.methods[index] if 0 <= index < len(self.methods) else None

    def _meta_object(self) -> tuple[Any, ...]:
        rows: list[tuple[Any, ...]] = [
            (uid, returns, name, parameters, "", [], "") for uid, returns, name, parameters in _COMMON
        ]
        rows += [
            (uid, one.returns, one.name, one.parameters, one.description, list(one.parameter_texts), one.result_text)
            for uid, one in enumerate(self.methods, FIRST_USER_UID)
        ]
        return {row[0]: row for row in rows}, {}, {}, self.description


@dataclass(eq=False)
class _Pending:
    """A call under way; ``number`` is the caller's, None when no answer is wanted."""

    call: IncomingCall
    caller: object
    number: int | None
    deadline: float


class ObjectServer:
    """Answers calls to our objects.

    Attributes:
        objects: what can be called, by the number of the service.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self.objects: dict[int, ServedObject] = {}
        self._now = now
        self._pending: list[_Pending] = []
        self._rates: dict[object, TokenBucket] = {}

    # ---------------------------------------------------------------- messages

    def answer_call(self, caller: Caller, message: f.QiMessage) -> None:
        """Handle a call, post or cancellation.  Raises LinkGone when the caller's link is the one to the robot."""
        if message.type == f.CANCEL:
            self._cancel(caller, message)
            return
        try:
            self._answer(caller, message)
        except (BadFrame, BadValue) as error:
            self._refuse(caller, message, str(error))

    def _answer(self, caller: Caller, message: f.QiMessage) -> None:
        served = self.objects.get(message.service)
        if served is None or message.object not in (0, MAIN):
            raise BadValue(f"there is no object {message.object} of a service {message.service} here")
        if message.action == GET_META_OBJECT:
            self._reply(caller, message, served.meta)
        elif message.action == TERMINATE:
            self._reply(caller, message, b"")
        elif (method := served.find_method(message.action)) is None:
            raise BadValue(f"{served.name} has no method or signal of the number {message.action}")
        else:
            signature = "m" if message.flags & f.DYNAMIC else method.parameters
            arguments = decode(signature, message.payload, MOST_READ)
            if not isinstance(arguments, tuple | list):
                raise BadValue(f"{served.name}.{method.name}: the arguments are no list")
            self._run(caller, message, method, arguments)

    def _run(self, caller: Caller, message: f.QiMessage, method: ServedMethod, arguments: Sequence[Any]) -> None:
        def finish(value: Any, error: str) -> None:
            if message.type != f.CALL:
                return
            if error:
                self._refuse(caller, message, error)
                return
            try:
                payload = encode(method.returns, value)
            except BadValue as problem:
                self._refuse(caller, message, f"{method.name}: the result cannot be sent: {problem}")
            else:
                self._reply(caller, message, payload)

        self.start_call(caller, method, arguments, finish, message.id if message.type == f.CALL else None)

    def _reply(self, caller: Caller, message: f.QiMessage, payload: bytes) -> None:
        if message.type == f.CALL:
            caller.send(f.REPLY, _address(message), payload, message.id)

    def _refuse(self, caller: Caller, message: f.QiMessage, error: str) -> None:
        if message.type == f.CALL:
            caller.send(f.ERROR, _address(message), encode("m", shorten_error(error)), message.id)

    # ---------------------------------------------------------------- calls under way

    def start_call(
        self,
        caller: object,
        method: ServedMethod,
        arguments: Sequence[Any],
        finish: Callable[[Any, str], None],
        number: int | None = None,
    ) -> None:
        """Run a method; ``finish(value, error)`` gets its outcome, once.  Raises LinkGone.

        A call without a number goes on when its caller leaves.
        """
        call = IncomingCall(arguments, finish)
        self._pending = [each for each in self._pending if not each.call.done]
        own = sum(each.caller is caller for each in self._pending)
        if len(self._pending) >= MOST_CALLS or own >= MOST_CALLS_OF_ONE:
            call.fail(f"{method.name}: too many calls at once")
            return
        now = self._now()
        rate = self._rates.get(caller)
        if rate is None:
            rate = self._rates[caller] = TokenBucket(CALLS_A_SECOND, CALL_BURST, now)
        if not rate.take(now):
            call.fail(f"{method.name}: more than {CALLS_A_SECOND:g} calls a second")
            return
        try:
            check_arguments(arguments)
            self._pending.append(_Pending(call, caller, number, now + CALL_TIMEOUT_S))
            method.run(call)
        except (BusError, ValueError, TypeError) as error:
            call.fail(f"{method.name}: {error}")

    def end_overdue(self) -> None:
        """End the calls that have taken too long.  Raises LinkGone."""
        now = self._now()
        for each in [each for each in self._pending if now > each.deadline]:
            self._pending.remove(each)
            each.call.cancel(f"no result in {CALL_TIMEOUT_S:g} s")

    def drop_caller(self, caller: object) -> None:
        """A caller is gone: its calls are cancelled; what it has posted goes on."""
        self._rates.pop(caller, None)
        for each in [each for each in self._pending if each.caller is caller and each.number is not None]:
            self._pending.remove(each)
            each.call.cancel()

    def drop_all(self) -> None:
        """All callers are gone."""
        self._rates.clear()
        pending, self._pending = self._pending, []
        for each in pending:
            each.call.cancel()

    def _cancel(self, caller: Caller, message: f.QiMessage) -> None:
        try:
            number = decode("I", message.payload)
        except BadFrame:
            return
        for each in [each for each in self._pending if each.caller is caller and each.number == number]:
            self._pending.remove(each)
            each.call.cancel("cancelled")


def shorten_error(error: str) -> str:
    """An error as a caller gets it: one line, without control characters, of bounded length."""
    return one_line(error[:LONGEST_ERROR])[:LONGEST_ERROR]


def _address(message: f.QiMessage) -> Address:
    return message.service, message.object, message.action
