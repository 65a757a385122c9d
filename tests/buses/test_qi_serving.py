"""Objects of ours that others call: what comes in as bytes, and the end point on a real socket."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from urbihw.buses.errors import BadFrame, BadValue, Unavailable
from urbihw.buses.listening import IDLE_S, MOST_UNREAD, MOST_VISITORS, BusListener
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.call_limits import (
    CALL_BURST,
    CALLS_A_SECOND,
    DEEPEST,
    MOST_ELEMENTS,
    MOST_TEXT,
    TokenBucket,
    check_arguments,
)
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.login_guard import MOST_ADDRESSES, WRONG_LOGINS, LoginGuard
from urbihw_nao.qimessaging.metaobject import MetaObject
from urbihw_nao.qimessaging.metatype import META_OBJECT
from urbihw_nao.qimessaging.serving import (
    CALL_TIMEOUT_S,
    LONGEST_ERROR,
    MOST_CALLS,
    MOST_CALLS_OF_ONE,
    IncomingCall,
    ObjectServer,
    ServedMethod,
    ServedObject,
)
from urbihw_nao.qimessaging.values import decode, encode
from urbihw_nao.qimessaging.visitors import LARGEST, LARGEST_LOGIN, LOGIN_TIMEOUT_S, QiVisitor

NUMBER = 7
"""The service."""
ADD, WAIT, BROKEN, ODD, UNKNOWN = range(100, 105)
LOGIN = f.QiMessage(f.CALL, 1, 0, 0, 8, encode("{sm}", {}))


class Bench:
    """An object, its server, and the calls that it has not answered yet."""

    def __init__(self) -> None:
        self.now = 0.0
        self.waiting: list[IncomingCall] = []
        self.cancelled: list[IncomingCall] = []
        self.server = ObjectServer(lambda: self.now)
        self.guard = LoginGuard(lambda: self.now)
        methods = [
            ServedMethod("add", self._add, "(mm)", "m", "the sum", (("a", "one"), ("b", "other")), "the sum"),
            ServedMethod("wait", self._wait),
            ServedMethod("broken", self._break),
            ServedMethod("odd", lambda call: call.answer(object()), returns="m"),
        ]
        self.server.objects[NUMBER] = ServedObject("mathematics", "sums", methods)

    def _add(self, call: IncomingCall) -> None:
        call.answer(call.arguments[0] + call.arguments[1])

    def _wait(self, call: IncomingCall) -> None:
        call.cancelled = lambda: self.cancelled.append(call)
        self.waiting.append(call)

    def _break(self, call: IncomingCall) -> None:
        raise ValueError("no such thing")

    def visitor(self, login: Login | None = None, address: str = "192.0.2.1") -> QiVisitor:
        """Somebody who has connected."""
        return QiVisitor(self.server, self.now, address, self.guard, login)

    def guest(self) -> QiVisitor:
        """One who has logged in."""
        made = self.visitor()
        assert told(made, LOGIN) == [(f.REPLY, 1, {"__qi_auth_state": 3})]
        return made


@pytest.fixture
def bench() -> Bench:
    """A fresh one."""
    return Bench()


def call(number: int, action: int, payload: bytes = b"", kind: int = f.CALL, **fields: Any) -> f.QiMessage:
    """A message to the object."""
    return f.QiMessage(kind, number, fields.get("service", NUMBER), fields.get("object", 1), action, payload,
                       fields.get("flags", 0))  # fmt: skip


def told(visitor: QiVisitor, *messages: f.QiMessage | bytes) -> list[tuple[int, int, Any]]:
    """What is answered to these: kind, number, and value."""
    for message in messages:
        visitor.receive(bytes(message))
    while visitor.work(64):
        pass
    answers = f.QiFramer().feed(bytes(visitor.out))
    visitor.out.clear()
    return [(each.type, each.id, _value(each)) for each in answers]


def _value(message: f.QiMessage) -> Any:
    signature = "{sm}" if message.service == 0 else META_OBJECT if message.action == 2 else "m"
    return decode(signature, message.payload) if message.payload else None


# ---------------------------------------------------------------- calls


def test_a_call_is_answered(bench: Bench) -> None:
    assert told(bench.guest(), call(5, ADD, encode("(mm)", (2, 3)))) == [(f.REPLY, 5, 5)]


def test_the_description(bench: Bench) -> None:
    ((kind, number, value),) = told(bench.guest(), call(2, 2, encode("(I)", (0,))))
    found = MetaObject.from_value(value)
    assert (kind, number, value[3]) == (f.REPLY, 2, "sums")
    assert found.names() == ["add", "broken", "odd", "wait"]
    (add,) = found.methods["add"]
    assert (add.uid, add.parameters, add.returns, add.description) == (ADD, "(mm)", "m", "the sum")
    assert value[0][ADD][5:] == ([("a", "one"), ("b", "other")], "the sum")


@pytest.mark.parametrize(
    ("message", "error"),
    [
        (call(5, BROKEN), "broken: no such thing"),
        (call(5, ODD), "odd: the result cannot be sent: a object cannot be sent"),
        (call(5, UNKNOWN), "mathematics has no method or signal of the number 104"),
        (call(5, 0, encode("(IIL)", (1, 86, 1))), "mathematics has no method or signal of the number 0"),
        (call(5, ADD, service=8), "there is no object 1 of a service 8 here"),
        (call(5, ADD, object=3), "there is no object 3 of a service 7 here"),
        (call(5, ADD, b"\xff\xff\xff\xff"), "a value ends 4294967295 bytes behind its message"),
        (call(5, ADD, encode("m", 3), flags=f.DYNAMIC), "mathematics.add: the arguments are no list"),
    ],
)
def test_an_error_is_one_line(bench: Bench, message: f.QiMessage, error: str) -> None:
    answers = told(bench.guest(), message)
    assert [(kind, number) for kind, number, _ in answers] == [(f.ERROR, 5)]
    assert answers[0][2] == error


def test_a_post_gets_no_answer(bench: Bench) -> None:
    guest = bench.guest()
    assert told(guest, call(5, ADD, encode("(mm)", (2, 3)), f.POST), call(6, BROKEN, kind=f.POST)) == []


def test_an_answer_may_come_later_and_once(bench: Bench) -> None:
    guest = bench.guest()
    assert told(guest, call(5, WAIT)) == []
    bench.waiting[0].answer("now")
    bench.waiting[0].fail("again")
    assert told(guest) == [(f.REPLY, 5, "now")]


def test_a_call_that_takes_too_long_fails(bench: Bench) -> None:
    guest = bench.guest()
    told(guest, call(5, WAIT))
    bench.now = CALL_TIMEOUT_S
    bench.server.end_overdue()
    assert bench.cancelled == []
    bench.now += 1
    bench.server.end_overdue()
    assert bench.cancelled == bench.waiting
    bench.waiting[0].answer("late")
    assert told(guest) == [(f.ERROR, 5, "no result in 60 s")]


def test_who_leaves_cancels_calls_but_not_posts(bench: Bench) -> None:
    guest, other = bench.guest(), bench.guest()
    told(guest, call(5, WAIT), call(6, WAIT, kind=f.POST))
    told(other, call(5, WAIT))
    guest.leave()
    assert bench.cancelled == bench.waiting[:1]


def test_a_caller_may_cancel(bench: Bench) -> None:
    guest, other = bench.guest(), bench.guest()
    told(guest, call(5, WAIT), call(6, WAIT))
    assert told(other, call(1, 0, encode("I", 5), f.CANCEL)) == []
    assert told(guest, call(7, 0, encode("I", 5), f.CANCEL), call(8, 0, b"x", f.CANCEL)) == [(f.ERROR, 5, "cancelled")]
    assert bench.cancelled == bench.waiting[:1]


def test_calls_under_way_are_bounded(bench: Bench) -> None:
    guest, others = bench.guest(), [bench.guest() for _ in range(3)]
    answers = told(guest, *[call(number, WAIT) for number in range(1, MOST_CALLS_OF_ONE + 3)])
    assert answers == [
        (f.ERROR, number, "wait: too many calls at once") for number in (MOST_CALLS_OF_ONE + 1, MOST_CALLS_OF_ONE + 2)
    ]
    for other in others:
        told(other, *[call(number, WAIT) for number in range(1, MOST_CALLS_OF_ONE)])
    assert len(bench.waiting) == MOST_CALLS
    # Places become free again.
    bench.waiting[0].answer(1)
    told(guest)
    assert told(guest, call(99, ADD, encode("(mm)", (1, 1)))) == [(f.REPLY, 99, 2)]


def test_a_long_error_is_cut(bench: Bench) -> None:
    guest = bench.guest()
    told(guest, call(5, WAIT))
    bench.waiting[0].fail("x\n\x1b[31m" + "y" * 70_000)
    ((kind, number, text),) = told(guest)
    assert (kind, number) == (f.ERROR, 5)
    assert text.startswith("x\\n\\x1b[31my") and len(text) <= LONGEST_ERROR


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (([None] * MOST_ELEMENTS, 1), "more than 512 elements"),
        (("z" * (MOST_TEXT + 1), 1), "texts of more than 4096 characters"),
        (({"z" * MOST_TEXT: "z"}, 1), "texts of more than 4096 characters"),
    ],
    ids=["elements", "text", "key"],
)
def test_arguments_are_bounded(bench: Bench, arguments: tuple[Any, ...], error: str) -> None:
    ((kind, _, text),) = told(bench.guest(), call(5, ADD, encode("(mm)", arguments)))
    assert kind == f.ERROR and error in text and len(text) <= LONGEST_ERROR


def test_a_list_of_all_types_may_have_as_many_elements(bench: Bench) -> None:
    values = [1.0, True, "z", None] * ((MOST_ELEMENTS - 3) // 4)
    assert told(bench.guest(), call(5, ADD, encode("(mm)", (values, ["end"])))) == [(f.REPLY, 5, [*values, "end"])]


def test_depth_of_arguments_is_bounded() -> None:
    value: Any = 1
    for _ in range(DEEPEST):
        value = [value]
    check_arguments([value])
    with pytest.raises(BadValue, match="lists in each other deeper than 8"):
        check_arguments([[value]])
    check_arguments([b"x" * 65536, ["y"] * 500, {"k": [1.0, True, None]}])


def test_the_worst_arguments_cost_little(bench: Bench) -> None:
    bomb = encode("s", "[(" + "v" * 1000 + ")]") + encode("I", 60000) + bytes(LARGEST - 2000)
    ((kind, _, text),) = told(bench.guest(), call(5, ADD, bomb))
    assert kind == f.ERROR and "more than 2048 elements" in text
    # A client must not send one with the login either.
    words = encode("I", 1) + encode("s", "k") + bomb[:3000]
    ((_, _, answer),) = told(bench.visitor(Login("nao", "secret")), f.QiMessage(f.CALL, 1, 0, 0, 8, words))
    assert answer["__qi_auth_state"] == 1


def test_calls_of_one_a_second_are_bounded(bench: Bench) -> None:
    guest, other = bench.guest(), bench.guest()
    add = encode("(mm)", (1, 1))
    for _ in range(3):
        kinds = [kind for kind, _, _ in told(guest, *[call(5, ADD, add)] * (3 * CALL_BURST))]
        assert kinds.count(f.REPLY) == CALL_BURST
        assert told(other, call(5, ADD, add)) == [(f.REPLY, 5, 2)]
        bench.now += CALL_BURST / CALLS_A_SECOND
    assert told(guest, *[call(5, ADD, add)] * (CALL_BURST + 1))[-1] == (
        f.ERROR, 5, "add: more than 100 calls a second",
    )  # fmt: skip


def test_a_token_bucket() -> None:
    bucket = TokenBucket(2.0, 4, 10.0)
    assert [bucket.take(10.0) for _ in range(5)] == [True] * 4 + [False]
    assert [bucket.take(10.5), bucket.take(10.5)] == [True, False]
    assert not bucket.is_full(12.0) and bucket.is_full(100.0)
    assert [bucket.take(100.0) for _ in range(5)] == [True] * 4 + [False]


# ---------------------------------------------------------------- logging in


def test_nobody_calls_before_the_login(bench: Bench) -> None:
    visitor = bench.visitor()
    assert told(visitor, call(5, ADD, encode("(mm)", (2, 3))), call(6, ADD)) == [(f.ERROR, 5, "log in first")]
    assert visitor.closing


@pytest.mark.parametrize(
    "words",
    [{}, {"auth_user": "nao"}, {"auth_user": "nao", "auth_token": "xyz"}, {"auth_user": 5, "auth_token": ["a"]}],
)
def test_a_wrong_password_is_refused(bench: Bench, words: dict[str, Any]) -> None:
    visitor = bench.visitor(Login("nao", "secret"))
    ((_, _, answer),) = told(visitor, f.QiMessage(f.CALL, 1, 0, 0, 8, encode("{sm}", words)))
    assert answer == {"__qi_auth_state": 1, "__qi_auth_err_reason": "user or password is wrong"}
    assert visitor.closing
    assert told(visitor, call(5, ADD, encode("(mm)", (2, 3)))) == []


def test_the_right_password_lets_in(bench: Bench) -> None:
    visitor = bench.visitor(Login("nao", "sécret"))
    words = {"auth_user": "nao", "auth_token": "sécret", "ClientServerSocket": True}
    ((_, _, answer),) = told(visitor, f.QiMessage(f.CALL, 1, 0, 0, 8, encode("{sm}", words)))
    assert answer == {"__qi_auth_state": 3}


def log_in(bench: Bench, token: str, address: str = "192.0.2.1") -> str:
    """Try once; return why not, "" for success."""
    words = {"auth_user": "nao", "auth_token": token}
    visitor = bench.visitor(Login("nao", "secret"), address)
    ((_, _, answer),) = told(visitor, f.QiMessage(f.CALL, 1, 0, 0, 8, encode("{sm}", words)))
    assert visitor.closing == ("__qi_auth_err_reason" in answer)
    return str(answer.get("__qi_auth_err_reason", ""))


def test_guesses_are_bounded(bench: Bench) -> None:
    assert [log_in(bench, "guess") for _ in range(WRONG_LOGINS)] == ["user or password is wrong"] * WRONG_LOGINS
    # Not even the right one is looked at now; a client from elsewhere enters.
    assert log_in(bench, "secret") == "too many wrong logins from 192.0.2.1: wait 2 s"
    assert log_in(bench, "secret", "192.0.2.2") == ""
    bench.now += 2.0
    assert log_in(bench, "secret") == ""
    assert log_in(bench, "guess") == "user or password is wrong"
    assert log_in(bench, "guess").startswith("too many wrong logins")


def test_right_logins_are_not_counted(bench: Bench) -> None:
    assert [log_in(bench, "secret") for _ in range(20)] == [""] * 20


def test_addresses_of_wrong_logins_are_bounded(bench: Bench) -> None:
    for number in range(MOST_ADDRESSES + 10):
        for _ in range(WRONG_LOGINS):
            log_in(bench, "guess", f"192.0.2.{number}")
    assert bench.guard.count <= MOST_ADDRESSES
    assert log_in(bench, "secret", f"192.0.2.{MOST_ADDRESSES + 9}").startswith("too many")


@pytest.mark.parametrize("data", [b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01", bytes(LOGIN)[:8] + b"\xff" * 20])
def test_strangers_are_dismissed(bench: Bench, data: bytes) -> None:
    visitor = bench.visitor()
    assert told(visitor, data) == []
    assert visitor.closing


def test_sizes_are_bounded(bench: Bench) -> None:
    visitor = bench.visitor()
    told(visitor, f.QiMessage(f.CALL, 1, 0, 0, 8, bytes(LARGEST_LOGIN + 1)))
    assert visitor.closing
    guest = bench.guest()
    head = bytes(call(5, ADD, bytes(LARGEST + 1)))[: f.HEADER.size]
    told(guest, head)
    assert guest.closing
    with pytest.raises(BadFrame):
        f.QiFramer(4).feed(bytes(call(1, 2, b"12345")))


def test_one_who_does_not_read_is_dismissed(bench: Bench) -> None:
    guest = bench.guest()
    question = bytes(call(2, 2, encode("(I)", (0,))))
    while not guest.closing:
        guest.receive(question)
        guest.work(64)
        assert len(guest.out) <= MOST_UNREAD


# ---------------------------------------------------------------- the end point


@pytest.fixture
def listener(bench: Bench) -> Iterator[BusListener]:
    """On a free port of loopback."""
    made = BusListener("127.0.0.1", 0, lambda now, address: QiVisitor(bench.server, now, address, bench.guard))
    yield made
    made.close()


def connect(listener: BusListener) -> socket.socket:
    """A client."""
    made = socket.create_connection((listener.host, listener.port), timeout=5)
    made.setblocking(False)
    return made


def poll_until(listener: BusListener, done: Callable[[], Any], now: float = 0.0) -> Any:
    """Look at the end point until something is there."""
    for _ in range(2000):
        listener.poll(now)
        if found := done():
            return found
    raise AssertionError("it did not happen in time")


def read(client: socket.socket, size: int = 65536) -> bytes | None:
    """What has come; b"" for a closed connection gives ``b"closed"``, None for nothing yet."""
    try:
        return client.recv(size) or b"closed"
    except BlockingIOError:
        return None
    except ConnectionError:
        return b"closed"


def test_the_end_point_answers(listener: BusListener) -> None:
    with connect(listener) as client:
        client.sendall(bytes(LOGIN))
        (answer,) = f.QiFramer().feed(poll_until(listener, lambda: read(client)))
        assert decode("{sm}", answer.payload) == {"__qi_auth_state": 3}
        client.sendall(bytes(call(2, ADD, encode("(mm)", ("a", "b")))))
        (answer,) = f.QiFramer().feed(poll_until(listener, lambda: read(client)))
        assert decode("m", answer.payload) == "ab"


def test_one_who_is_silent_is_dismissed(listener: BusListener) -> None:
    with connect(listener) as client:
        listener.poll(0.0)
        listener.poll(LOGIN_TIMEOUT_S)
        assert read(client) is None
        assert poll_until(listener, lambda: read(client), LOGIN_TIMEOUT_S + 1) == b"closed"


def test_a_crowd_is_bounded(listener: BusListener, bench: Bench) -> None:
    crowd = [connect(listener) for _ in range(MOST_VISITORS)]
    for client in crowd:
        client.sendall(bytes(LOGIN))
        poll_until(listener, lambda client=client: read(client))  # type: ignore[misc]
    with connect(listener) as late:
        assert poll_until(listener, lambda: read(late)) == b"closed"
    crowd.pop().close()
    listener.poll(0.0)
    with connect(listener) as client:
        client.sendall(bytes(LOGIN))
        assert poll_until(listener, lambda: read(client)) != b"closed"
    for client in crowd:
        client.close()


def test_the_one_that_was_silent_longest_gives_its_place(listener: BusListener) -> None:
    crowd = [connect(listener) for _ in range(MOST_VISITORS)]
    for client in crowd:
        client.sendall(bytes(LOGIN))
        poll_until(listener, lambda client=client: read(client))  # type: ignore[misc]
    for client in crowd:
        if client is not crowd[3]:
            client.sendall(bytes(call(2, ADD, encode("(mm)", (1, 1)))))
            poll_until(listener, lambda client=client: read(client), 1.0)  # type: ignore[misc]
    with connect(listener) as late:
        assert poll_until(listener, lambda: read(late), IDLE_S - 1) == b"closed"
    with connect(listener) as late:
        late.sendall(bytes(LOGIN))
        assert poll_until(listener, lambda: read(late), IDLE_S + 0.5) != b"closed"
        assert read(crowd[3]) == b"closed"
        assert all(read(client) is None for client in crowd if client is not crowd[3])
    for client in crowd:
        client.close()


def test_a_flood_takes_its_share_of_a_look(listener: BusListener, bench: Bench) -> None:
    with connect(listener) as loud, connect(listener) as quiet:
        for client in (loud, quiet):
            client.sendall(bytes(LOGIN))
            poll_until(listener, lambda client=client: read(client))  # type: ignore[misc]
        loud.setblocking(True)
        loud.sendall(bytes(call(2, 2, encode("(I)", (0,)))) * 500)
        quiet.sendall(bytes(call(2, ADD, encode("(mm)", (1, 1)))))
        looks = 0
        while read(quiet) is None:
            looks += 1
            listener.poll(0.0)
            assert looks < 20


def test_a_closed_connection_cancels_its_calls(listener: BusListener, bench: Bench) -> None:
    with connect(listener) as client:
        client.sendall(bytes(LOGIN) + bytes(call(2, WAIT)))
        poll_until(listener, lambda: bench.waiting)
    poll_until(listener, lambda: bench.cancelled)


def test_a_port_that_is_taken(listener: BusListener, bench: Bench) -> None:
    with pytest.raises(Unavailable, match=rf"cannot listen on 127.0.0.1:{listener.port}: Address already in use"):
        BusListener(
            listener.host, listener.port, lambda now, address: QiVisitor(bench.server, now, address, bench.guard)
        )
