"""The chapter "Nao" of the Urbi manual, line by line, and what this platform adds."""

from __future__ import annotations

import pytest
from nao_lab import Lab, stand


def angle(lab: Lab, joint: str) -> float:
    """The angle of a joint of the body."""
    return lab.device.body.joints[joint].angle


def test_starting_up() -> None:
    lab = Lab.ready()
    assert lab.say('tts.say("Hello, I am Nao."),', 0.5) == ""
    assert lab.device.speech.said == ["Hello, I am Nao."]
    assert lab.say("armR.load = 1;", 0.2) == "Group [1, 1, 1, 1, 1]"
    lab.say("shoulderRollR.val = -0.3 time: 0.5s | shoulderPitchR.val = -1 speed: 0.9;", 3.5)
    assert angle(lab, "RShoulderRoll") == pytest.approx(-0.3, abs=0.01)
    assert angle(lab, "RShoulderPitch") == pytest.approx(-1, abs=0.01)
    lab.say("timeout(6s) shoulderRollR.val = -0.4 sin:2s ampli:0.4,", 2.5)
    assert angle(lab, "RShoulderRoll") == pytest.approx(0.0, abs=0.05)
    lab.run(4)
    assert lab.say("robot.body.arm[right].shoulder.pitch.val = 2 speed:0.9;", 4) == ""
    assert angle(lab, "RShoulderPitch") == pytest.approx(2, abs=0.01)
    lab.say("motors.on;", 0.2)
    lab.say("motion.walkTo(0.1,0,0);", 4)
    assert lab.device.body.x == pytest.approx(0.1, abs=0.01)
    begun = lab.device.body.x
    lab.say("var Global.tag = Tag.new|;")
    lab.say("tag: robot.walk(1),", 2)
    assert lab.device.body.walking
    lab.say("sleep(10ms) | tag.stop;", 1)
    assert not lab.device.body.walking and 0.1 < lab.device.body.x - begun < 0.5
    assert lab.say("robot.dump;").startswith("*** robot: Identity Network Mobile\n***   body")


def test_accessing_joints() -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1; head.load = 1;", 0.2)
    joints = lab.device.body.joints
    assert {name for name, joint in joints.items() if not joint.stiffness} == {"LHand", "RHand"}
    lab.say("headYaw.val = 0.8 time: 1s,", 0.5)
    assert 0.2 < angle(lab, "HeadYaw") < 0.6
    lab.say("headPitch.val = -0.5;", 0.3)
    assert angle(lab, "HeadPitch") == pytest.approx(-0.5, abs=0.01)
    lab.run(0.5)
    assert angle(lab, "HeadYaw") == pytest.approx(0.8, abs=0.01)
    lab.say("var Global.tag = Tag.new|; tag: headYaw.val = 0 sin:2s ampli:0.5,", 3.5)
    lab.say("tag.stop;", 0.2)
    place = angle(lab, "HeadYaw")
    lab.run(1)
    assert angle(lab, "HeadYaw") == pytest.approx(place, abs=0.01)


def test_hands() -> None:
    lab = Lab.ready()
    lab.say("handR.open;", 1)
    assert angle(lab, "RHand") == pytest.approx(1, abs=0.01) and lab.device.body.joints["RHand"].stiffness == 0.0
    lab.say("handR.close;", 1)
    assert angle(lab, "RHand") == pytest.approx(0, abs=0.01)
    lab.say("handR.load = 1; sleep(100ms); RHand.val = 0.5;", 1)
    assert lab.number("handR.val") == pytest.approx(0.5, abs=0.01)


def test_a_slack_joint_says_how_to_make_it_stiff() -> None:
    lab = Lab.ready()
    assert "HeadYaw is slack: make it stiff with load = 1" in lab.say("headYaw.val = 1;", 0.5)
    assert angle(lab, "HeadYaw") == 0.0
    assert lab.look("HeadYaw.limitedBy") == '"off"'


def test_the_two_joints_with_one_motor() -> None:
    lab = Lab.ready()
    lab.say("motors.on; sleep(100ms); RHipYawPitch.val = -0.5;", 1)
    assert angle(lab, "LHipYawPitch") == angle(lab, "RHipYawPitch") == pytest.approx(-0.5, abs=0.01)
    assert lab.number("LHipYawPitch.val") == lab.number("hipYawR.val") == pytest.approx(-0.5, abs=0.01)


@pytest.mark.parametrize(
    ("text", "colour"),
    [("FaceLeds.val = 1;", 0xFFFFFF), ("FaceLeds.rgb = 0xFF8000;", 0xFF8000), ("FaceLeds.b = 1;", 0x0000FF),
     ("FaceLeds.rgb = 0xFF0000; FaceLeds.g = 1;", 0xFFFF00)],
)  # fmt: skip
def test_leds(text: str, colour: int) -> None:
    lab = Lab.ready()
    lab.say(text, 0.2)
    assert lab.device.leds.colour("FaceLedLeft0") == lab.device.leds.colour("FaceLedRight7")
    assert lab.device.leds.colour("FaceLeds") == pytest.approx(colour, abs=0x020202)
    assert lab.number("FaceLeds.rgb") == colour


def test_all_leds_and_groups_are_objects() -> None:
    lab = Lab.ready()
    assert lab.look('nao.services.has("ALLeds")') == "true"
    assert lab.look("[AllLeds, ChestLeds, FaceLedRight0, Brain11].all(closure (l) { l.val == 0 })") == "true"


def test_other_sensors() -> None:
    lab = Lab.ready()
    lab.run(0.5)
    assert [lab.number(f"{name}.val") for name in ("sonarL", "sonarR")] == pytest.approx([1.2, 1.5])
    assert lab.console().line("touch LFoot/Bumper/Right") == "ok"
    assert lab.console().line("touch Head/Touch/Rear") == "ok"
    lab.run(0.3)
    names = ("footTouchL", "footTouchR", "headSensorR", "headSensorM", "headSensorF", "accelZ", "gyroX", "gyroY")
    assert [lab.number(f"{name}.val") for name in names] == pytest.approx([1, 0, 1, 0, 0, 9.8, 0, 0])
    assert lab.number("battery.current") == pytest.approx(-0.8)
    assert lab.look("battery.voltage") == "nan"
    slots = ("val", "left", "right", "leftFootTotalWeight", "rightFootTotalWeight")
    assert [lab.number(f"fsr.{slot}") for slot in slots] == pytest.approx([1, 1, 1, 2.6, 2.6])


def test_the_shared_memory() -> None:
    lab = Lab.ready()
    assert lab.say('stm.set("mine", 5); stm.get("mine");', 0.5).split() == ["5"]
    lab.say('stm.bindRenameVariable("mine", "own"); class Global.a {}|; stm.bindRenameVariable("mine", "a.b");', 0.2)
    assert lab.say("[stm.own, a.b];", 0.5) == "[5, 5]"
    lab.device.memory.stored["mine"] = 6
    lab.run(0.1)
    assert lab.say("a.b;", 0.5) == "6"
    assert "getData: ALMemory: data nothing not found" in lab.say('stm.get("nothing");', 0.5)


def test_modules() -> None:
    lab = Lab.ready()
    stand(lab.device.body)
    lab.run(0.2)
    assert lab.say('var Global.walker = ALProxy("Motion", ["legs"], ["waitUntilMoveIsFinished"])|;', 0.5) == ""
    lab.say("walker.walkTo(0.1, 0, 0) & legs.waitUntilMoveIsFinished;", 4)
    assert lab.device.body.x == pytest.approx(0.1, abs=0.01)
    assert lab.say("ALMotion.robotIsWakeUp; DCM.getTime(5) - DCM.getTime(0) < 100;", 0.5).split() == ["true", "true"]
    assert "this robot has no service ALNothing, and no Nothing" in lab.say('ALProxy("Nothing");', 0.5)
    assert "it takes setAngles(mmf)" in lab.say("motion.setAngles(1);", 0.5)


def test_a_call_that_blocks_holds_only_its_statement() -> None:
    lab = Lab.ready()
    lab.say('tts.say("one two three four five six seven"); echo("said"),', 1)
    assert lab.look("1 + 1") == "2" and lab.heard() == ""
    lab.run(3)
    assert lab.heard() == "*** said"


def test_events_of_memory() -> None:
    lab = Lab.ready()
    lab.say('var Global.touched = nao.memoryEvent("FrontTactilTouched")|;', 0.3)
    lab.say("at (touched?(var x)) echo(x);")
    assert lab.console().line("touch Head/Touch/Front") == "ok"
    lab.run(0.3)
    assert lab.heard() == "*** 1"
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    assert lab.console().line("touch Head/Touch/Front 0") == "ok"
    lab.run(0.5)
    assert lab.heard() == "*** 0"


def test_walking_needs_legs_and_says_so() -> None:
    lab = Lab.ready()
    assert "cannot walk: it has fallen, or its legs have no stiffness" in lab.say("motion.moveTo(0.1, 0, 0);", 0.5)


def test_limits_hold_for_joints_and_walking() -> None:
    lab = Lab.ready(limits={"HeadYaw": {"position": [-0.5, 0.5], "speed": 1.0}, "walk": {"speed": 0.05}})
    stand(lab.device.body)
    lab.run(0.2)
    lab.say("headYaw.val = 2;", 0.3)
    assert 0.2 < angle(lab, "HeadYaw") < 0.4
    lab.run(1)
    assert angle(lab, "HeadYaw") == pytest.approx(0.5, abs=0.001)
    assert lab.look("HeadYaw.limitedBy") == '"limits.HeadYaw.position"'
    lab.say("naoWalk.xSpeed = 0.1;", 1)
    assert lab.device.body.walk[0] == pytest.approx(0.05, abs=0.001)


def test_a_robot_that_fell_and_was_restarted_stays_slack() -> None:
    lab = Lab.ready()
    lab.say("motors.on;", 0.3)
    lab.device.power_off(lab.bus_clock.now())
    lab.until(lambda: lab.look("nao.link") == "false")
    lab.device.power_on(lab.bus_clock.now())
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.run(1)
    assert not any(joint.stiffness for joint in lab.device.body.joints.values())
    assert lab.number("headYaw.load") == 0


def test_a_hand_is_open_when_open_returns() -> None:
    lab = Lab.ready()
    said = ""
    lab.say('handR.open; echo("open");')
    while "open" not in said:
        lab.run(0.01)
        said += lab.heard()
        assert lab.clock.now() < 20
    assert lab.device.body.joints["RHand"].angle > 0.98 and said == "*** open"
    lab.say("nao.stop;")
    assert "emergency stop" in lab.say("nao.estop = true; handR.close;", 0.2)
