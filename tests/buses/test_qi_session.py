"""A session: against the simulated NAOqi, and against answers that no NAOqi gives."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import BadFrame, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeEnd, PipeLink
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.endpoints import ServicePlace
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.metaobject import MetaObject
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.session import first_line
from urbihw_nao.qimessaging.values import encode
from urbihw_nao.qimessaging.wire_session import GET_META_OBJECT
from urbihw_nao_fakes.device import Nao


class Rig:
    """A session and a NAOqi in simulated time."""

    def __init__(self, robot: Nao | None = None) -> None:
        self.robot = Nao() if robot is None else robot
        self.robot.reconnect()
        self.clock = BusSimClock(100.0)
        self.sent: list[f.QiMessage] = []
        self.end = PipeEnd(self._receive)
        self.link = PipeLink(Url.parse("pipe://nao?baud=100000000"), Context(self.clock, {"nao": self.end}))
        self.link.open()
        self.session = open_session(self.link)

    def _receive(self, data: bytes, at: float) -> None:
        # Who does not answer is sent an empty line, in case it is a web server.
        self.sent += f.QiFramer().feed(data.removesuffix(b"\r\n\r\n"))
        for answer in self.robot.feed(data, at):
            self.end.send(answer.data, answer.at)

    def ready(self) -> Rig:
        """Logged in."""
        self.session.authenticate()
        return self

    def run(self, seconds: float) -> None:
        """Let the robot live, and poll."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            for answer in self.robot.tick(self.clock.now()):
                self.end.send(answer.data, answer.at)
            self.session.poll()
            self.clock.sleep_until(self.clock.now() + 0.02)

    def ask(self, service: str, name: str, *arguments: Any) -> Any:
        """Call and wait."""
        session = self.session
        return session.wait(session.call(session.look_up(service), name, *arguments))


def test_services_are_found_and_called() -> None:
    rig = Rig().ready()
    assert {"ALMotion", "ALMemory", "ServiceDirectory"} <= set(rig.session.names())
    assert rig.ask("ALMotion", "getAngles", ["HeadYaw", "HeadPitch"], True) == [0.0, 0.5]
    assert rig.ask("ALBattery", "getBatteryCharge") == 80
    before = len(rig.sent)
    rig.ask("ALMotion", "getAngles", "HeadYaw", True)
    assert len(rig.sent) == before + 1, "a service that is known is not looked up again"


def test_a_call_before_the_login_is_refused() -> None:
    with pytest.raises(Unavailable, match="you must authenticate first"):
        Rig().session.names()


def test_user_and_password() -> None:
    rig = Rig(Nao("nao", "secret"))
    with pytest.raises(
        Unavailable, match=r"the robot refuses user or password: options.user, options.password"
    ) as error:
        rig.session.authenticate(Login("nao", "wrong"))
    assert "wrong" not in str(error.value)
    rig.session.authenticate(Login("nao", "secret"))
    assert "ALMotion" in rig.session.names()


def test_who_does_not_answer_is_no_naoqi() -> None:
    rig = Rig()
    rig.robot.faults.start("silence")
    with pytest.raises(Unavailable, match=r"connected, but no answer to the login in 2 s"):
        rig.session.authenticate()


def test_a_web_server_is_no_naoqi() -> None:
    rig = Rig()
    rig.end.send(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n", rig.clock.now())
    with pytest.raises(Unavailable, match="answers in HTTP: this is NAOqi 1"):
        rig.session.authenticate()


def test_the_overload_is_chosen_by_the_arguments() -> None:
    rig = Rig().ready()
    motion = rig.session.look_up("ALMotion")

    def choose(*arguments: Any) -> str:
        return motion.meta.choose("ALMotion", "moveTo", arguments).parameters

    assert choose(1, 2.0, 3) == "(fff)"
    assert choose(1, 2.0, 3, 4.0) == "(ffff)"
    assert choose(1, 2.0, 3, [["MaxStepX", 0.02]]) == "(fffm)"
    with pytest.raises(BadValue, match=r"moveTo does not take these 1 arguments; it takes moveTo\(fff\) or"):
        choose(1)
    with pytest.raises(BadValue, match=r"ALMotion has no method moveToo; did you mean moveTo\?"):
        motion.meta.choose("ALMotion", "moveToo", ())


def test_errors_of_the_server_are_one_line() -> None:
    rig = Rig().ready()
    with pytest.raises(Unavailable) as error:
        rig.ask("ALMotion", "getAngles", "Nose", True)
    assert str(error.value) == "ALMotion: Nose is not a recognized joint name"
    assert first_line("ValueError: no\n\nTraceback:\n  File /home/nao/x.py") == "ValueError: no"
    assert first_line("") == "NAOqi gives no reason"
    assert first_line("E\x1b[31m\x9b\u202e") == r"E\x1b[31m\x9b\u202e"
    assert len(first_line("z" * 100_000)) == 300 and len(first_line("\x1b" * 100_000)) == 300


def test_a_blocking_call_holds_nothing_else() -> None:
    rig = Rig().ready()
    done: list[Any] = []
    speech = rig.session.look_up("ALTextToSpeech")
    rig.session.call(speech, "say", "one two three four five", then=done.append, timeout=60)
    rig.run(1.0)
    assert rig.ask("ALBattery", "getBatteryCharge") == 80 and not done
    rig.run(1.2)
    assert len(done) == 1 and done[0].error == ""


def test_signals_are_heard_until_they_are_not() -> None:
    rig = Rig().ready()
    session = rig.session
    heard: list[Any] = []
    subscriber = rig.ask("ALMemory", "subscriber", "FrontTactilTouched")
    link = session.listen_to_object(subscriber, "signal", heard.append)
    rig.run(0.1)
    rig.robot.memory.touch("Head/Touch/Front", 1.0)
    rig.run(0.1)
    assert heard == [(1.0,)]
    session.stop_listening(link)
    rig.run(0.1)
    rig.robot.memory.touch("Head/Touch/Front", 0.0)
    rig.run(0.1)
    assert len(heard) == 1
    with pytest.raises(BadValue, match="no object with a signal"):
        session.listen_to_object(5, "signal", heard.append)


def test_a_late_answer_is_counted_and_a_lost_link_fails_all_calls() -> None:
    rig = Rig().ready()
    rig.session.look_up("ALBattery")
    rig.robot.faults.start("late", amount=3.0, times=1)
    call = rig.session.call(rig.session.look_up("ALBattery"), "getBatteryCharge")
    rig.run(2.2)
    assert (call.done, call.error) == (True, "NAOqi did not answer in 2 s")
    rig.run(1.0)
    assert (rig.session.counters.timeouts, rig.session.counters.late) == (1, 1)
    pending = rig.session.call(rig.session.look_up("ALBattery"), "getBatteryCharge")
    rig.session.close("the link went down")
    assert pending.error == "the link went down"


@pytest.mark.parametrize("word", ["noise", "cut"])
def test_garbage_on_the_wire_ends_the_link(word: str) -> None:
    rig = Rig().ready()
    battery = rig.session.look_up("ALBattery")
    rig.robot.faults.start(word)
    with pytest.raises(LinkGone, match="no message of QiMessaging"):
        for _ in range(10):
            rig.session.call(battery, "getBatteryCharge")
            rig.run(0.05)


def test_an_answer_that_cannot_be_read_fails_its_call_alone() -> None:
    rig = Rig().ready()
    call = rig.session.call(rig.session.look_up("ALBattery"), "getBatteryCharge")
    asked = rig.sent[-1]
    # The true answer is still on its way, and comes too late.
    rig.end.hang_up()
    rig.end.connection -= 1
    rig.end.send(bytes(f.QiMessage(f.REPLY, asked.id, asked.service, 1, asked.action, b"\0")), rig.clock.now())
    rig.run(0.1)
    assert "the answer cannot be read" in call.error
    assert rig.ask("ALBattery", "getBatteryCharge") == 80


def test_who_calls_us_is_told_that_there_is_nothing() -> None:
    rig = Rig().ready()
    rig.end.send(bytes(f.QiMessage(f.CALL, 9, 77, 1, 100, encode("(s)", ("x",)))), rig.clock.now())
    rig.run(0.1)
    assert (rig.sent[-1].type, rig.sent[-1].id) == (f.ERROR, 9)


FORMS: list[Any] = [[5], {"k": 1}, 5, None, "x\x1b[31m", [], [[], [], []], [{}, {}, {}]]
DYNAMIC_ANSWERS = [encode("m", value) for value in FORMS]
"""Values under a signature of their own, which are not of the form that was asked for."""


def lie(rig: Rig, payload: bytes, action: int | None = None) -> None:
    """From now on the robot answers calls, or those of one action, with this dynamic value."""

    def receive(data: bytes, at: float) -> None:
        for message in f.QiFramer().feed(data.removesuffix(b"\r\n\r\n")):
            if message.type == f.CALL and action in (None, message.action):
                address = message.service, message.object, message.action
                rig.end.send(bytes(f.QiMessage(f.REPLY, message.id, *address, payload, f.DYNAMIC)), at)
            else:
                for answer in rig.robot.feed(bytes(message), at):
                    rig.end.send(answer.data, answer.at)

    rig.end.on_receive = receive


@pytest.mark.parametrize("payload", DYNAMIC_ANSWERS)
@pytest.mark.parametrize("action", [GET_META_OBJECT, None])
def test_answers_of_another_form_are_one_error(payload: bytes, action: int | None) -> None:
    rig = Rig().ready()
    lie(rig, payload, action)
    with pytest.raises((Unavailable, LinkGone, BadValue)) as error:
        rig.session.look_up("ALMotion")
    assert str(error.value).isprintable() and len(str(error.value)) < 400


def test_an_error_of_python_in_an_answer_ends_the_link_in_one_line() -> None:
    rig = Rig().ready()
    battery = rig.session.look_up("ALBattery")
    rig.session.call(battery, "getBatteryCharge", then=lambda call: call.value[0])
    with pytest.raises(LinkGone, match=r"what came cannot be handled: an answer of another form \(TypeError: "):
        rig.run(0.2)


def test_members_with_names_or_signatures_that_are_none_are_left_out() -> None:
    members = ("good", "()"), ("\x1b[31m", "()"), ("bad", "(("), ("n" * 300, "()"), ("", "()")
    rows: dict[int, Any] = {uid: (uid, "v", name, sign, "", [], "") for uid, (name, sign) in enumerate(members, 100)}
    assert MetaObject.from_value((rows, {}, {}, "")).names() == ["good"]
    odd = {1: ("x", "v", "a", "()", "")}
    values: list[Any] = [5, [5], {"k": 1}, ([], [], []), ({1: 5}, {}, {}), (odd, {}, {}), None]
    for value in values:
        with pytest.raises(BadFrame):
            MetaObject.from_value(value)


@pytest.mark.parametrize("number", [math.inf, math.nan, -5, 1 << 32, 0.5, "1", None])
def test_places_with_numbers_that_are_none(number: Any) -> None:
    with pytest.raises(BadFrame):
        ServicePlace.from_value(("X", number, "m", 1, ["tcp://127.0.0.1:1"], ""))
