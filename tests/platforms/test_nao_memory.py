"""ALMemory: places that are followed as variables, and events with any value."""

from __future__ import annotations

import pytest
from nao_lab import Lab

from urbihw_nao.reading import MOST_CHARACTERS, MOST_PARTS, is_bounded
from urbihw_nao.sense_part import MOST_FOLLOWED


def replug(lab: Lab) -> None:
    """The network is lost for a second."""
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.run(0.3)


def bound(value: object = 3) -> Lab:
    """A robot whose place "mine" is the variable stm.m."""
    lab = Lab.ready()
    lab.device.memory.stored["mine"] = value
    assert lab.say('stm.bindRenameVariable("mine", "m");', 0.3) == ""
    return lab


def test_a_bound_variable_is_followed() -> None:
    lab = bound()
    assert lab.look("stm.m") == "3"
    lab.say('at (stm.m > 4) echo("more") onleave echo("less"); at (stm.m->changed?) echo("changed");')
    for value, told in ((5, ["*** more", "*** changed"]), (4, ["*** changed", "*** less"])):
        lab.device.memory.stored["mine"] = value
        lab.run(0.1)
        assert sorted(lab.heard().split("\n")) == sorted(told)
    lab.say('whenever (stm.m == 7) { echo("seven"); sleep(1h) };')
    lab.device.memory.stored["mine"] = 7
    lab.run(0.1)
    assert "seven" in lab.heard()


def test_devices_can_follow_it() -> None:
    lab = bound()
    seen = []
    var = lab.robot.host.var("stm.m")
    var.notify_change(lambda: seen.append(var.sensed))
    lab.device.memory.stored["mine"] = "text"
    lab.run(0.1)
    assert seen == ["text"]


def test_it_is_told_only_when_it_changes() -> None:
    lab = bound(["a", [1, True]])
    assert lab.look("stm.m") == '["a", [1, true]]'
    lab.say('at (stm.m->changed?) echo("changed");')
    lab.run(1)
    assert lab.heard() == ""
    lab.device.memory.stored["mine"] = ["b"]
    lab.run(0.1)
    assert lab.heard() == "*** changed" and lab.look("stm.m") == '["b"]'


def test_it_cannot_be_written() -> None:
    lab = bound()
    assert "m: this slot can only be read" in lab.say("stm.m = 4;", 0.1)
    assert lab.look("stm.m") == "3" and lab.device.memory.stored["mine"] == 3


def test_it_may_be_a_slot_of_another_object_and_a_sensor() -> None:
    lab = Lab.ready()
    key = "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"
    lab.say(f'class Global.a {{}}|; stm.bindRenameVariable("{key}", "a.yaw");', 0.3)
    lab.say("headYaw.load = 1; sleep(100ms); headYaw.val = 0.5;", 1)
    assert lab.number("a.yaw") == pytest.approx(0.5, abs=0.01)
    assert lab.number("headYaw.val") == pytest.approx(0.5, abs=0.01)


def test_it_survives_a_lost_link_a_restart_and_the_worker() -> None:
    lab = bound()
    replug(lab)
    lab.device.memory.stored["mine"] = 5
    lab.run(0.1)
    assert lab.look("stm.m") == "5"
    lab.device.memory.stored["mine"] = 6
    replug(lab)
    assert lab.look("stm.m") == "6"


def test_a_place_that_comes_later() -> None:
    lab = Lab.ready()
    assert lab.say('stm.bindRenameVariable("later", "m"); at (stm.m->changed?) echo("changed");', 0.3) == ""
    lab.device.memory.stored["later"] = "now"
    lab.run(0.1)
    assert lab.heard() == "*** changed" and lab.look("stm.m") == '"now"'


def test_the_same_variable_can_follow_another_place() -> None:
    lab = bound()
    lab.device.memory.stored["other"] = 8
    lab.say('stm.bindRenameVariable("other", "m");', 0.3)
    assert lab.look("stm.m") == "8"
    lab.device.memory.stored["mine"] = 9
    lab.run(0.1)
    assert lab.look("stm.m") == "8"


@pytest.mark.parametrize(
    ("name", "problem"),
    [("nothing.b", "there is no object nothing"), ("HeadYaw.val", "HeadYaw.val is a variable of another device"),
     ("get", "stm.get is a function, not a variable")],
)  # fmt: skip
def test_what_cannot_be_bound(name: str, problem: str) -> None:
    lab = Lab.ready()
    lab.device.memory.stored["mine"] = 3
    answer = lab.say(f'stm.bindRenameVariable("mine", "{name}");', 0.3)
    assert problem in answer and "/" not in answer  # no path of this machine
    assert lab.say('stm.get("mine");', 0.2) == "3"


def test_their_number_and_size_are_bounded() -> None:
    lab = Lab.ready()
    lab.device.memory.stored["long"] = "x" * (MOST_CHARACTERS + 1)
    assert "the value of long is too long" in lab.say('stm.bindRenameVariable("long", "l");', 0.3)
    text = f'for (var k : {MOST_FOLLOWED}) stm.bindRenameVariable("k" + k, "v" + k); echo("bound");'
    assert lab.say(text, 3) == "*** bound"
    assert f"{MOST_FOLLOWED} places of the memory are bound: no more" in lab.say(
        'stm.bindRenameVariable("one", "more");', 0.3
    )


def test_what_is_bounded() -> None:
    assert is_bounded([1, 2.5, "three", True, None, {"a": [4]}])
    assert not is_bounded(b"bytes") and not is_bounded([b"bytes"])
    assert not is_bounded([0] * MOST_PARTS) and not is_bounded(["x" * MOST_CHARACTERS, "y"])


# ---------------------------------------------------------------- events


def test_events_have_any_value() -> None:
    lab = Lab.ready()
    lab.say('var Global.e = nao.memoryEvent("mine")|; at (e?(var x)) echo(x);', 0.3)
    for value, told in (("text", "text"), (["a", 1, [True]], '["a", 1, [true]]'), (2.5, "2.5")):
        lab.device.memory.raise_event("mine", value)
        lab.run(0.1)
        assert lab.heard() == f"*** {told}"
    assert lab.say('nao.memoryEvent("mine") === e;', 0.2) == "true"


def test_micro_events() -> None:
    lab = Lab.ready()
    lab.say('var Global.e = nao.memoryEvent("mine")|; at (e?(var x)) echo(x);', 0.3)
    told = lab.say('memory.raiseMicroEvent("mine", "a"); memory.raiseMicroEvent("mine", "a");', 0.3)
    assert told == "*** a\n*** a"


def test_an_event_that_nobody_follows_is_not_sent() -> None:
    lab = Lab.ready()
    lab.say('var Global.e = nao.memoryEvent("mine")|; follow: at (e?(var x)) echo(x),', 0.3)
    (connection,) = [each for each in lab.device.server.connections if each.subscriptions]
    lab.say("follow.stop;", 0.1)
    lab.device.memory.raise_event("mine", 1)
    lab.run(0.1)
    assert not connection.subscriptions and lab.heard() == ""
    lab.say("at (e?(var x)) echo(x);", 0.1)
    lab.device.memory.raise_event("mine", 2)
    lab.run(0.1)
    assert lab.heard() == "*** 2"


def test_an_event_is_sent_once_whoever_follows_it() -> None:
    lab = Lab.ready()
    lab.say(
        'var Global.e = nao.memoryEvent("mine")|; at (e?(var x)) echo("first"); at (e?(var x)) echo("second");', 0.3
    )
    replug(lab)
    lab.device.memory.raise_event("mine", 1)
    lab.run(0.1)
    assert sorted(lab.heard().split("\n")) == ["*** first", "*** second"]


def test_a_value_that_is_too_long_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('var Global.e = nao.memoryEvent("mine")|; at (e?(var x)) echo("came");', 0.3)
    lab.device.memory.raise_event("mine", ["x" * 100] * 1000)
    lab.run(0.1)
    assert lab.heard() == "" and "event: mine: its value is too long" in caplog.text


def test_an_event_outlives_the_connection_that_asked_for_it() -> None:
    lab = Lab.ready()
    lab.say('var Global.e = nao.memoryEvent("mine")|; at (e?(var x)) echo(x);', 0.3)
    lab.lobby.close()
    lab.run(0.1)
    lab.device.memory.raise_event("mine", 1)
    lab.run(0.1)
    lab.lobby = lab.kernel.open_lobby()
    lab.say("at (e?(var x)) echo(x);", 0.1)
    lab.device.memory.raise_event("mine", 2)
    lab.run(0.1)
    assert lab.heard() == "*** 2"


@pytest.mark.parametrize("argument", ["Object", "function () { 1 }", "Event.new", "[[1, [Tag.new]]]", '["a" => Lobby]'])
def test_an_object_is_no_argument_of_a_service(argument: str) -> None:
    lab = Lab.ready()
    told = lab.say(f'stm.set("a", {argument});', 0.3)
    assert "no other object can be sent" in told, told
    assert lab.say('stm.set("a", [1, "b"]); stm.get("a");', 0.3) == '[1, "b"]'
