"""One contract of sessions with NAOqi: both back ends (ours, libqi's), each against both simulated robots.

The robots are processes of their own: the pure-Python fake, and the same services behind a real libqi.
"""

from __future__ import annotations

import contextlib
import importlib.util
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw import buses
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.session import QiCall, QiSession

pytestmark = pytest.mark.e2e
SERVER = Path(__file__).parent / "qi_contract_server.py"
HAS_LIBQI = importlib.util.find_spec("qi") is not None
KINDS = ["fake", "libqi"] if HAS_LIBQI else ["fake"]
SCHEMES = ["qi", "libqi"] if HAS_LIBQI else ["qi"]
WITHIN_S = 10.0
"""Generous: on a busy machine a process may be held up for seconds."""


@contextlib.contextmanager
def serving(kind: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A robot in a process of its own, and its address."""
    command = [sys.executable, str(SERVER), kind]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None and server.stdin is not None
        address = server.stdout.readline().strip().removeprefix("qi://")
        assert address, "the robot has not started"
        try:
            yield server, address
        finally:
            server.stdin.close()
            try:
                server.wait(WITHIN_S)
            except subprocess.TimeoutExpired:
                server.kill()
                raise


@pytest.fixture(scope="module", params=KINDS)
def robot(request: pytest.FixtureRequest) -> Iterator[tuple[str, str]]:
    """Kind and address of a robot that all tests of this file share."""
    with serving(request.param) as (_, address):
        yield request.param, address


@pytest.fixture(params=SCHEMES)
def session(request: pytest.FixtureRequest, robot: tuple[str, str]) -> Iterator[QiSession]:
    """A session of one of the back ends."""
    with buses.open(f"{request.param}://{robot[1]}") as port:
        made = open_session(port)
        made.authenticate()
        yield made
        made.close("the test ends")


def ask(session: QiSession, name: str, *arguments: Any, service: str = "Contract") -> Any:
    """Call a method and wait."""
    return session.wait(session.call(session.look_up(service), name, *arguments, timeout=WITHIN_S))


def poll_until(session: QiSession, reached: Callable[[], bool]) -> None:
    """Poll until a condition holds."""
    end = time.monotonic() + WITHIN_S
    while not reached():
        assert time.monotonic() < end, "not reached"
        session.poll()
        time.sleep(0.002)


def test_services_are_named_and_described(session: QiSession) -> None:
    assert {"ServiceDirectory", "ALMotion", "ALMemory", "Contract"} <= set(session.names())
    contract = session.look_up("Contract")
    assert {"echo", "go", "boom"} <= set(contract.meta.names())
    assert session.look_up("Contract") is contract
    assert sorted(each.parameters for each in contract.meta.methods["go"]) == ["(f)", "(ff)", "(fs)"]
    assert contract.meta.signals["moved"].signature == "(sf)"
    assert contract.meta.properties["level"].signature == "i"


def test_overloads_are_chosen_by_the_arguments(session: QiSession) -> None:
    assert ask(session, "go", 1) == "one"
    assert ask(session, "go", 1, 2.5) == "two"
    assert ask(session, "go", 1.0, "home") == "name"


@pytest.mark.parametrize(
    "value", [1, -7, 2.5, True, False, "x", "ä€", "", [1, 2.5, "a"], [1.0, 2.0], [], {"a": 1}, None, 1 << 40, [[1], []]]
)
def test_dynamic_values_come_back(session: QiSession, value: Any) -> None:
    found = ask(session, "echo", value)
    assert found == value and type(found) is type(value)


def test_a_tuple_is_a_list_for_naoqi(session: QiSession) -> None:
    assert ask(session, "echo", (1, (2, "a"))) == [1, [2, "a"]]


def test_typed_values(session: QiSession) -> None:
    assert ask(session, "sum", -1, 4_000_000_000, -(1 << 40), 1 << 41, 0.5, 0.25) == -1 + 4e9 - 2**40 + 2**41 + 0.75
    # Programs in urbiscript have floats only.
    assert ask(session, "sum", 1.0, 2.0, 3.0, 4.0, 5.0, 6.0) == 21
    assert ask(session, "both", True, "Köln") == (True, "Köln")
    assert ask(session, "lists", [1, 2], [[0.5], []], {"a": 1}) == ([1, 2], [[0.5], []], {"a": 1})


def test_raw_bytes_survive(session: QiSession) -> None:
    every = bytes(range(256))
    found = ask(session, "reverse", every)
    assert found == every[::-1] and type(found) is bytes
    image = ask(session, "image")
    assert image == (2, 1, bytes([255, 0, 128, 1, 2, 254])) and type(image) is tuple and type(image[2]) is bytes


@pytest.mark.parametrize("arguments", [(1,), ("x", 1.0), (1.0, 2.0, 3.0), (None,), ()])
def test_arguments_that_fit_no_overload_are_refused_here(session: QiSession, arguments: tuple[Any, ...]) -> None:
    name = "both" if arguments == (1,) else "go"
    with pytest.raises(BadValue, match=rf"Contract\.{name} does not take these {len(arguments)} arguments; it takes"):
        session.call(session.look_up("Contract"), name, *arguments)


@pytest.mark.parametrize("value", [object(), {1, 2}, [object()], 1j])
def test_values_that_cannot_travel_are_refused_here(session: QiSession, value: Any) -> None:
    with pytest.raises(BadValue):
        session.call(session.look_up("Contract"), "echo", value)
    assert ask(session, "echo", 1) == 1, "and the session goes on"


def test_errors_are_one_line_without_paths(session: QiSession) -> None:
    with pytest.raises(Unavailable) as error:
        ask(session, "boom")
    assert str(error.value) == "Contract: no such joint"
    with pytest.raises(Unavailable, match="^Cannot find service 'ALNothing' in index$"):
        session.look_up("ALNothing")
    with pytest.raises(BadValue, match=r"Contract has no method ecko; did you mean echo\?"):
        session.call(session.look_up("Contract"), "ecko")
    assert session.counters.refused == 2


def test_a_call_that_takes_too_long_fails_and_its_answer_is_late(session: QiSession) -> None:
    contract = session.look_up("Contract")
    with pytest.raises(Unavailable, match=r"did not answer in 0\.1 s"):
        session.wait(session.call(contract, "nap", 0.4, timeout=0.1))
    polled = session.call(contract, "nap", 0.4, timeout=0.1)
    poll_until(session, lambda: polled.done)
    assert polled.error == "NAOqi did not answer in 0.1 s"
    assert session.counters.timeouts == 2
    poll_until(session, lambda: session.counters.late == 2)
    assert ask(session, "echo", 1) == 1


def test_a_blocking_call_holds_nothing_else(session: QiSession) -> None:
    done: list[QiCall] = []
    session.call(session.look_up("Contract"), "nap", 0.5, then=done.append, timeout=WITHIN_S)
    assert ask(session, "echo", "meanwhile") == "meanwhile"
    assert not done
    poll_until(session, lambda: bool(done))
    assert (done[0].value, done[0].error) == ("rested", "")


def test_each_of_many_calls_under_way_gets_its_own_answer(session: QiSession) -> None:
    # In which order answers come is not promised: libqi has several threads.
    contract = session.look_up("Contract")
    calls = [session.call(contract, "echo", number, timeout=WITHIN_S) for number in range(500)]
    poll_until(session, lambda: all(call.done for call in calls))
    assert [call.value for call in calls] == list(range(500))


def test_posts_come_in_their_order(session: QiSession) -> None:
    ask(session, "notes")
    contract = session.look_up("Contract")
    for number in range(50):
        session.post(contract, "note", number)
    assert ask(session, "notes") == list(range(50))
    with pytest.raises(BadValue):
        session.post(contract, "note")


def test_signals_are_heard_by_each_listener_until_it_stops(session: QiSession) -> None:
    contract = session.look_up("Contract")
    first: list[Any] = []
    second: list[Any] = []
    one = session.listen(contract, "moved", first.append)
    two = session.listen(contract, "moved", second.append)
    # A subscription takes effect a moment after it was sent.
    poll_until(session, lambda: ask(session, "fire", "HeadYaw", 0.25) is None and bool(first) and bool(second))
    assert first[0] == ("HeadYaw", 0.25) == second[0]
    session.stop_listening(one)
    session.stop_listening(one)
    heard = len(first)
    ask(session, "fire", "HeadPitch", 1.0)
    poll_until(session, lambda: ("HeadPitch", 1.0) in second)
    session.stop_listening(two)
    ask(session, "fire", "LHand", 1.0)
    ask(session, "echo", 1)
    session.poll()
    assert len(first) == heard and ("LHand", 1.0) not in second
    with pytest.raises(BadValue, match="Contract has no signal mowed; it has .*moved"):
        session.listen(contract, "mowed", first.append)


def test_properties_are_read_and_written(session: QiSession) -> None:
    contract = session.look_up("Contract")
    session.wait(session.set_property(contract, "level", 7))
    assert session.wait(session.get_property(contract, "level")) == 7
    told: list[QiCall] = []
    # One after the other: libqi carries calls out in several threads, and answers them in any order.
    session.set_property(contract, "level", 3, told.append)
    poll_until(session, lambda: len(told) == 1)
    session.get_property(contract, "level", told.append)
    poll_until(session, lambda: len(told) == 2)
    assert (told[0].error, told[1].value) == ("", 3)
    with pytest.raises(BadValue, match="Contract has no property colour; it has level"):
        session.get_property(contract, "colour")


def test_events_of_almemory(session: QiSession) -> None:
    heard: list[Any] = []
    subscriber = ask(session, "subscriber", "mine", service="ALMemory")
    listening = session.listen_to_object(subscriber, "signal", heard.append)

    def raised_and_heard() -> bool:
        ask(session, "raiseEvent", "mine", [1, "a"], service="ALMemory")
        return bool(heard)

    # A subscription takes effect a moment after it was sent.
    poll_until(session, raised_and_heard)
    assert heard[0] == ([1, "a"],)
    session.stop_listening(listening)
    strangers: list[Any] = [5, None, "x", {}]
    for nothing in strangers:
        with pytest.raises(BadValue, match="no object with a signal signal"):
            session.listen_to_object(nothing, "signal", heard.append)
    with pytest.raises(BadValue, match="no object with a signal zignal"):
        session.listen_to_object(subscriber, "zignal", heard.append)


def test_closing_fails_what_waits(session: QiSession) -> None:
    told: list[QiCall] = []
    session.call(session.look_up("Contract"), "nap", 5.0, then=told.append, timeout=WITHIN_S)
    session.close("the link went down")
    assert [call.error for call in told] == ["the link went down"]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_that_dies_is_told_at_once_and_nothing_hangs(kind: str, scheme: str) -> None:
    with serving(kind) as (server, address), buses.open(f"{scheme}://{address}") as port:
        session = open_session(port)
        session.authenticate()
        contract = session.look_up("Contract")
        told: list[QiCall] = []
        session.call(contract, "nap", 60.0, then=told.append, timeout=120.0)
        server.kill()
        server.wait(WITHIN_S)
        with pytest.raises(LinkGone):
            poll_until(session, lambda: False)
        with pytest.raises(LinkGone):
            for _ in range(100):
                session.call(contract, "echo", 1)
                session.poll()
                time.sleep(0.01)
        session.close("the link went down")
        assert told and told[0].error


@pytest.mark.parametrize("scheme", SCHEMES)
def test_who_listens_at_the_port_is_said(scheme: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    text = rf"^cannot connect to 127\.0\.0\.1:{port} \(Connection refused\); is the robot on"
    with pytest.raises(Unavailable, match=text), buses.open(f"{scheme}://127.0.0.1:{port}") as opened:
        open_session(opened).authenticate()
