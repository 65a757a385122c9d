"""What a killed worker has left behind, a robot that was swapped for another one, and answers that are lies."""

from __future__ import annotations

import contextlib
import logging
import math
from dataclasses import replace
from typing import Any

import pytest
from nao_lab import Lab, stand
from nao_rig import TICK, Rig

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.messages import DeviceReport, Refused, Reply, Request, Targets
from urbihw_nao.call_part import BEGUN, CallPart
from urbihw_nao.finding import BODY_ID
from urbihw_nao.qimessaging.frames import DYNAMIC, REPLY, QiFramer, QiMessage
from urbihw_nao.qimessaging.values import encode
from urbihw_nao_fakes.behaviours import Behaviours
from urbihw_nao_fakes.device import Nao


def behaviours(robot: Nao) -> Behaviours:
    """Its ALBehaviorManager."""
    (found,) = [each for each in robot.services.values() if isinstance(each, Behaviours)]
    return found


def kill_worker(rig: Rig) -> Rig:
    """The worker is gone without a word; another one logs in to the same robot."""
    rig.link.close()
    rig.robot.reconnect()
    fresh = Rig(rig.robot)
    fresh.clock.sleep_until(rig.clock.now())
    return fresh


def shoulder(rig: Rig, seconds: float) -> float:
    """How far a shoulder moves in this time."""
    places = []
    for _ in range(round(seconds / TICK)):
        rig.run(TICK)
        places.append(rig.body.joints["RShoulderPitch"].angle)
    return max(places) - min(places)


def wave(verb: str = "startBehavior") -> Rig:
    """A robot on which a program has begun a behaviour, and somebody else another one."""
    rig = Rig()
    stand(rig.body)
    rig.attach()
    behaviours(rig.robot).start("dialog/wait")
    rig.request("call", "ALBehaviorManager", verb, "animations/wave")
    assert shoulder(rig, 0.5) > 0.05
    return rig


@pytest.mark.parametrize("verb", ["startBehavior", "runBehavior"])
def test_a_behaviour_that_a_killed_worker_has_begun_is_stopped_by_the_next_one(verb: str) -> None:
    rig = kill_worker(wave(verb))
    rig.link.open()
    rig.driver.attach(rig.link)
    assert "services" in rig.driver.stop_what_moves()
    rig.run(0.5)
    assert shoulder(rig, 3.0) < 0.01
    manager = behaviours(rig.robot)
    assert (manager.stopped, manager.get_running()) == (["animations/wave"], ["dialog/wait"]), "those of others go on"
    # It is reported once.
    rig = kill_worker(rig)
    rig.link.open()
    rig.driver.attach(rig.link)
    assert rig.driver.stop_what_moves() == ()


def test_what_services_do_is_ended_by_the_next_worker() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    rig.request("call", "ALMotion", "angleInterpolation", "HeadYaw", 1.0, 8.0, True)
    rig = kill_worker(rig).attach()
    assert rig.robot.motion.calls["killAll"] == 1


def test_a_robot_that_was_left_in_order_is_not_stopped() -> None:
    rig = wave()
    rig.driver.safe_stop()
    rig.run(1.0)
    assert rig.robot.memory.stored[BEGUN] == [False, []]
    rig = kill_worker(rig)
    rig.link.open()
    rig.driver.attach(rig.link)
    assert rig.driver.stop_what_moves() == ()


def test_a_behaviour_that_has_ended_or_never_begun_is_not_kept() -> None:
    rig = wave("runBehavior")
    rig.request("call", "ALBehaviorManager", "runBehavior", "none/such", number=2)
    rig.request("call", "ALBehaviorManager", "startBehavior", "animations/wave", number=3)  # it runs already
    assert rig.robot.memory.stored[BEGUN] == [True, ["animations/wave"]]
    rig.run(4.0)
    assert rig.robot.memory.stored[BEGUN] == [True, []]


@pytest.mark.parametrize("value", [5, [], [1], [True, 5], [True, [5]], [True, ["x" * 1000]], "x", {"a": 1}])
def test_a_note_that_is_none_is_left_alone(value: Any) -> None:
    rig = Rig()
    rig.robot.memory.stored[BEGUN] = value
    rig.link.open()
    rig.driver.attach(rig.link)
    assert rig.driver.stop_what_moves() == ()


# ---------------------------------------------------------------- another robot


def swap(lab: Lab, serial: str) -> None:
    """The cable is moved to a robot with this number; it stands like the last one."""
    lab.unplug()
    lab.run(1.0)
    lab.device.memory.stored[BODY_ID] = serial
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")


def head(lab: Lab, seconds: float) -> float:
    """How far the head turns in this time."""
    places = []
    for _ in range(round(seconds / lab.tick)):
        lab.run(lab.tick)
        places.append(lab.device.body.joints["HeadYaw"].angle)
    return max(places) - min(places)


def test_a_movement_does_not_go_on_in_another_robot(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1;", 0.5)
    lab.say('motion.setAngles("HeadPitch", 0.1, 0.1);', 0.5)
    lab.say("headYaw.val = 0 sin:2s ampli:0.5,", 1.0)
    assert head(lab, 1.0) > 0.2
    swap(lab, lab.device.memory.stored[BODY_ID])
    lab.run(1.0)
    assert head(lab, 2.0) > 0.2, "the same robot goes on"
    with caplog.at_level(logging.INFO):
        swap(lab, "OTHER\x1b[31m")
    lab.run(0.1)
    assert head(lab, 3.0) < 0.01
    told = [each for each in caplog.messages if "stopped" in each]
    assert told == [r"nao stopped: another robot answers: OTHER\x1b[31m, not ALDT000000000001; it is told to stop"]
    lab.say("headYaw.val = 0.8;", 1.0)
    assert lab.device.body.joints["HeadYaw"].angle == pytest.approx(0.8, abs=0.02), "what is written anew"


# ---------------------------------------------------------------- lies


FORMS: list[Any] = [None, 5, "x\x1b[31m", [], [5], {"k": 1}, [math.inf] * 12, [math.nan] * 12, [[]] * 3, b"x", [[], []]]


@pytest.mark.parametrize("answer", FORMS)
@pytest.mark.parametrize(
    "name",
    ["getBodyNames", "getLimits", "getRobotConfig", "getRobotPosition", "getPosition", "moveIsActive", "getAngles"],
)
def test_a_lie_of_almotion_is_one_line(name: str, answer: Any) -> None:
    rig = Rig()
    methods = rig.robot.motion.methods
    for uid, each in list(methods.items()):
        if each.name == name:
            methods[uid] = replace(each, returns="m", run=lambda *_: answer)
    try:
        rig.attach()
        rig.run(1.0)
        rig.driver.safe_stop()
    except (Unavailable, ConnectionError) as error:
        assert str(error).isprintable() and len(str(error)) < 700
    for each in rig.news:
        if isinstance(each, Refused):
            assert each.reason.isprintable() and len(each.reason) <= 600


@pytest.mark.parametrize("values", [(), (None,), (b"x",)])
def test_an_event_without_a_value_is_no_error_of_ours(values: tuple[Any, ...]) -> None:
    rig = Rig().attach()
    assert rig.request("listen", "FrontTactilTouched")[0].ok
    (part,) = [each for each in rig.driver._parts if isinstance(each, CallPart)]
    ((_, listener),) = [each.handle for each in part._events.values() if each is not None]
    listener.heard(values)
    told = [each for each in rig.run(0.1) if isinstance(each, Refused | DeviceReport)]
    assert [type(each) for each in told] == [DeviceReport if values == (None,) else Refused]


def test_words_of_the_robot_are_escaped_and_bounded() -> None:
    rig = Rig().attach()

    def fail(*_: Any) -> None:
        raise ValueError("\x1b[31m" + "z" * 100_000)

    methods = rig.robot.motion.methods
    (uid,) = [uid for uid, each in methods.items() if each.name == "getSummary"] or [next(iter(methods))]
    methods[uid] = replace(methods[uid], run=fail)
    (reply,) = rig.request("call", "ALMotion", methods[uid].name)
    assert not reply.ok and reply.error.isprintable() and len(reply.error) <= 600


def test_a_request_that_fails_in_python_fails_alone() -> None:
    rig = Rig().attach()
    told: list[Any] = rig.driver.request(Request(7, "call", "ALMotion", "getAngles", 5))
    assert [(each.reply_id, each.ok) for each in told] == [(7, False)]


@pytest.mark.parametrize("answer", FORMS)
def test_lies_to_all_calls_end_the_link_at_most(answer: Any) -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    rig.driver.request(Request(1, "listen", "FrontTactilTouched"))
    payload = encode("m", answer)

    def receive(data: bytes, at: float) -> None:
        for message in QiFramer().feed(data):
            address = message.service, message.object, message.action
            rig.end.send(bytes(QiMessage(REPLY, message.id, *address, payload, DYNAMIC)), at)

    rig.end.on_receive = receive
    told: list[Any] = []
    with contextlib.suppress(LinkGone):
        rig.driver.targets(Targets({("walk", "x"): 0.1, ("HeadYaw", "angle"): 0.5, ("HeadYaw", "stiffness"): 1.0}))
        for verb, device, item, value in (
            ("describe", "ALTracker", "", 0), ("call", "ALMotion", "moveTo", (1.0, 0.0, 0.0)),
            ("follow", "Some/Key", "", 0), ("listen", "Other", "", 0), ("write", "motors", "dcm", True),
            ("write", "LArm", "pos", (0.1, 0.1, 0.3)), ("film", "camera", "", None),
        ):  # fmt: skip
            told += rig.driver.request(Request(1, verb, device, item, value))
        told += rig.run(2.0)
        rig.driver.safe_stop()
    for each in told:
        words = each.reason if isinstance(each, Refused) else each.error if isinstance(each, Reply) else ""
        assert words.isprintable() and len(words) <= 600
