"""Services as objects in urbiscript: stops, names of NAOqi 1, ``ALProxy``; by what the body does and clients see."""

from __future__ import annotations

from dataclasses import replace

import pytest
from nao_lab import Lab

from urbihw_nao_fakes.services import Later, Service


def hold(service: Service, name: str) -> list[bool]:
    """Let a method never answer, whatever the robot does; put something in the list to let it."""
    free: list[bool] = []
    for uid, each in service.methods.items():
        if each.name == name:
            service.methods[uid] = replace(each, run=lambda *_: Later(lambda: any(free)))
    return free


def test_a_posture_ends_under_the_balancer() -> None:
    lab = Lab.ready()
    lab.say("motion.wakeUp;", 5)
    lab.say("handL.pos = [0.18, 0.11, 0.4]|;", 1)
    assert lab.say("motion.wakeUp; echo(1);", 5) == "*** 1"
    assert lab.say("handL.pos = [0.18, 0.11, 0.4]|;", 4) == ""
    assert lab.device.motion.find_hand("LArm") == pytest.approx((0.18, 0.11, 0.4), abs=0.02)


def test_a_robot_that_was_stopped_on_its_way_down_does_not_get_slack() -> None:
    lab = Lab.ready()
    lab.say("motion.wakeUp;", 5)
    lab.say("motion.rest,", 0.2)
    lab.look("robot.stop")
    lab.run(5)
    assert lab.device.body.legs_stiff and not lab.device.body.fallen


@pytest.mark.parametrize("call", ["motion.wakeUp", 'motion.angleInterpolation("HeadYaw", 1, 2, true)'])
def test_a_stop_ends_the_statement_that_waits_for_a_motion_whatever_the_robot_does(call: str) -> None:
    lab = Lab.ready()
    method = call.removeprefix("motion.").partition("(")[0]
    free = hold(lab.device.motion, method)
    assert lab.say(f"{call}; echo(1);", 1) == ""
    lab.look("robot.stop")
    lab.run(0.1)
    told = lab.heard()
    assert "stopped" in told and told.endswith("*** 1"), told
    # The late answer belongs to no call: not to the next one either.
    assert lab.say(f"{call}; echo(2);", 0.5) == ""
    free.append(True)
    lab.run(0.5)
    assert lab.heard() == "*** 2"


def test_a_stop_ends_no_statement_that_waits_for_what_does_not_move() -> None:
    lab = Lab.ready()
    lab.say('tts.say("one two three four five"); echo(1);', 0.5)
    lab.look("robot.stop")
    lab.run(0.2)
    assert lab.heard() == ""
    lab.run(3)
    assert lab.heard() == "*** 1"


# -------------------------------------------------------------------- names of NAOqi 1


def test_names_of_naoqi_1_work_where_the_robot_has_only_the_new_ones() -> None:
    lab = Lab.ready()
    lab.say("motion.wakeUp;", 5)
    lab.say('var Global.walker = ALProxy("Motion", [], ["waituntilWalkIsFinished"])|; walker.walkTo(0.1, 0, 0),')
    told = lab.say("sleep(100ms); walker.waituntilWalkIsFinished; echo(motion.walkIsActive);", 4)
    assert told == "*** false"
    assert lab.device.body.x == pytest.approx(0.1, abs=0.01)
    lab.say("motion.setWalkTargetVelocity(1, 0, 0, 0.5);", 1)
    assert lab.device.body.walk[0] == pytest.approx(0.06, abs=0.005), "half of the step frequency"
    lab.say("motion.stopWalk;", 1)
    assert not lab.device.body.walking
    assert lab.device.motion.calls["moveToward"] == lab.device.motion.calls["stopMove"] == 1


def test_limits_hold_for_the_old_names() -> None:
    lab = Lab.ready(limits={"walk": {"speed": 0.05}})
    lab.say("motion.wakeUp;", 5)
    assert "limit" in lab.say("motion.setWalkTargetVelocity(1, 0, 0, 1);", 1)
    assert not lab.device.body.walking


# -------------------------------------------------------------------- ALProxy


def test_a_proxy_can_be_made_again_under_the_same_names() -> None:
    lab = Lab.ready()
    for _ in range(2):
        assert lab.say('ALProxy("Battery", ["charge"])|; charge.getBatteryCharge;', 0.5) == "80"
    assert lab.say('ALProxy("TextToSpeech", ["tts"])|; tts.volume;', 0.5) == "0.7", "tts stays what it is"


def test_an_alias_hides_nothing() -> None:
    lab = Lab.ready()
    for name in ("robot", "motion"):
        told = lab.say(f'ALProxy("Battery", ["{name}"]);', 0.5)
        assert told.splitlines()[0].endswith(f"ALProxy: {name} is something else already: choose another alias")
    assert lab.look("robot.body.isNil") == "false" and lab.look('motion.hasSlot("wakeUp")') == "true"
    assert "ALProxy: an alias must be a name" in lab.say('ALProxy("Battery", [1]);', 0.5)


@pytest.mark.parametrize("name", ["ALMotion", "Motion", "DCM", "ALLogger", "Logger"])
def test_a_service_is_found_with_and_without_the_al(name: str) -> None:
    lab = Lab.ready()
    assert lab.say(f'var Global.found = ALProxy("{name}")|; found.isNil;', 0.5) == "false"


def test_a_service_that_is_not_there() -> None:
    lab = Lab.ready()
    (told, *_) = lab.say('ALProxy("Nose");', 0.5).splitlines()
    assert told.endswith("ALProxy: this robot has no service ALNose, and no Nose")
    for name in ("1", '""', '"AL"'):
        (told, *_) = lab.say(f"ALProxy({name});", 0.5).splitlines()
        assert told.endswith('ALProxy: write the name of a service, such as "Motion"')


# -------------------------------------------------------------------- the services of the manual


@pytest.mark.parametrize(
    ("program", "answer"),
    [
        ('ALLogger.warn("test", "hot"); ALLogger.verbosity;', "4"),
        ("ALFrameManager.behaviors;", "[]"),
        ('ALAutonomousLife.setState("disabled"); ALAutonomousLife.getState;', '"disabled"'),
    ],
)
def test_services_that_the_manual_names_are_there(program: str, answer: str) -> None:
    assert Lab.ready().say(program, 0.5) == answer


# -------------------------------------------------------------------- variables of the memory


@pytest.mark.parametrize("names", ["1, 2", '"", "x"', '"mine", ""', '"mine", "a.b.c"', '"mine", "a."', '"mine", "a b"'])
def test_names_that_are_none(names: str) -> None:
    (told, *_) = Lab.ready().say(f"stm.bindRenameVariable({names});", 0.5).splitlines()
    assert "bindRenameVariable: write bindRenameVariable(" in told, told
