"""Lights of a Nao: all forms of colour, groups, the tree of robot, and how often they are written."""

from __future__ import annotations

from typing import Any

import pytest
from nao_lab import Lab

from urbihw_nao.light_part import LIGHTS_PER_TICK
from urbihw_nao_fakes.device import Nao


def shown(lab: Lab, name: str) -> str:
    """The colour of a light of the fake."""
    return f"{lab.device.leds.colour(name):06x}"


@pytest.mark.parametrize(
    ("text", "colour"),
    [("eyeL.val = 1;", "ffffff"), ("eyeL.rgb = 0xFF0000;", "ff0000"), ("eyeL.b = 1;", "0000ff"),
     ("eyeL.r = 1; eyeL.g = 1;", "ffff00"), ("eyeL.rgb = 0xFF00FF; eyeL.r = 0;", "0000ff"),
     ("eyeL.rgb = 0xFF0000; eyeL.val = 0;", "000000")],
)  # fmt: skip
def test_all_forms_of_colour(text: str, colour: str) -> None:
    lab = Lab.ready()
    lab.say(text, 0.2)
    assert shown(lab, "LeftFaceLeds") == shown(lab, "LeftFaceLed3") == colour
    assert shown(lab, "RightFaceLeds") == "000000"
    assert f"{round(lab.number('LeftFaceLeds.rgb')):06x}" == colour


def test_lights_of_one_colour_have_a_level() -> None:
    lab = Lab.ready()
    lab.say("LeftEarLeds.val = 0.5; RightEarLeds.b = 1; headLed.rgb = 0x800000; AllLedsGreen.val = 1;", 0.3)
    leds = lab.device.leds
    assert leds.level("LeftEarLed3") == 0.5 and leds.level("RightEarLeds") == 1.0
    assert leds.level("Brain4") == pytest.approx(0.5, abs=0.01)
    assert shown(lab, "ChestLeds") == shown(lab, "FaceLedRight2") == "00ff00"


def test_the_tree_of_robot() -> None:
    lab = Lab.ready()
    lab.say(
        "robot.body.head.eye[left].rgb = 0xFF0000; robot.body.head.eye[right].led[2].b = 1;"
        "robot.body.head.ear[right].led.val = 1; robot.body.leg[left].foot.led.g = 1; robot.body.led.rgb = 0xFF8000;"
        "robot.body.head.headLed.val = 1;",
        0.5,
    )
    assert [shown(lab, name) for name in ("FaceLedLeft5", "FaceLedRight2", "FaceLedRight3")] == [
        "ff0000", "0000ff", "000000",
    ]  # fmt: skip
    assert [shown(lab, name) for name in ("LeftFootLeds", "RightFootLeds", "ChestLeds")] == [
        "00ff00", "000000", "ff8000",
    ]  # fmt: skip
    assert [lab.device.leds.level(name) for name in ("LeftEarLeds", "RightEarLeds", "BrainLeds")] == [0, 1, 1]
    assert lab.look("[eyeL === LeftFaceLeds, eyeR === RightFaceLeds, eye === FaceLeds]") == "[true, true, true]"
    assert lab.look("[footLedR === RightFootLeds, earL === LeftEarLeds, eyeLedL[7] === FaceLedLeft7]") == (
        "[true, true, true]"
    )
    assert lab.look("[eyeL.interfaces, earL.interfaces]") == "[[RGBLed, Led], [Led]]"


def test_a_message_to_both_eyes() -> None:
    lab = Lab.ready()
    lab.say("robot.body.head.eye.rgb = 0x00FF00; eye.b = 1;", 0.3)
    assert shown(lab, "FaceLeds") == "00ffff"


def read(lab: Lab, name: str) -> str:
    """The colour of a light as a program reads it."""
    return f"{round(lab.number(f'{name}.rgb')):06x}"


def test_a_write_to_a_group_is_one_to_each_of_its_members() -> None:
    lab = Lab.ready()
    lab.say("FaceLeds.rgb = 0xFF0000; eyeL.g = 0.3;", 0.3)
    for name in ("LeftFaceLeds", "FaceLedLeft3", "LeftFaceLed1"):
        assert shown(lab, name) == read(lab, name) == "ff4c00"
    assert shown(lab, "RightFaceLeds") == read(lab, "RightFaceLeds") == "ff0000"
    assert lab.look("[eyeR.r, eyeL.val, FaceLedRight2.b]") == "[1, 1, 0]"
    assert read(lab, "FaceLeds") == "ff4c00", "a group of lights that differ shows the brightest of each colour"
    # A part of the colour leaves the other parts of each member as they are.
    lab.say("FaceLeds.b = 1; AllLeds.r = 0;", 0.3)
    assert [shown(lab, name) for name in ("LeftFaceLeds", "RightFaceLeds")] == ["004cff", "0000ff"]
    assert [read(lab, name) for name in ("FaceLedLeft3", "FaceLedRight3")] == ["004cff", "0000ff"]
    lab.say("eyeL.val = 0; AllLedsGreen.val = 1;", 0.3)
    assert [shown(lab, name) for name in ("FaceLedLeft5", "FaceLedRight5")] == ["00ff00", "00ffff"]
    assert [read(lab, name) for name in ("FaceLedLeft5", "FaceLedRight5")] == ["00ff00", "00ffff"]


def test_a_group_of_lights_that_differ_takes_one_call_for_each_part_that_is_alike() -> None:
    lab = Lab.ready()
    lab.say("eyeL.g = 1; FaceLedRight0.r = 1;", 0.3)
    leds = lab.device.leds
    leds.written.clear()
    lab.say("FaceLeds.b = 1;", 0.3)
    assert leds.written[0] == "LeftFaceLeds" and {"FaceLedRight0", "RightFaceLed8"} & {*leds.written}
    assert len(leds.written) < 8
    leds.written.clear()
    lab.say("FaceLeds.rgb = 0xFF;", 0.3)
    assert leds.written == ["FaceLeds"]


@pytest.mark.parametrize("missing", ["listGroup", "listLED"])
def test_a_robot_that_does_not_tell_what_a_light_is_made_of(missing: str) -> None:
    device = Nao()
    leds = device.leds
    for uid in [uid for uid, each in leds.methods.items() if each.name == missing]:
        del leds.methods[uid]
    lab = Lab.ready(device)
    lab.say("eyeL.rgb = 0xFF0000; ChestLeds.b = 1; LeftEarLeds.val = 0.5; Brain3.val = 1;", 0.3)
    assert [shown(lab, name) for name in ("LeftFaceLeds", "ChestLeds")] == ["ff0000", "0000ff"]
    assert [leds.level(name) for name in ("LeftEarLeds", "Brain3", "Brain4")] == [0.5, 1, 0]


def test_trajectories_of_colours() -> None:
    lab = Lab.ready()
    lab.say("eyeL.r = 0 sin:2s ampli:1,", 0.2)
    seen = []
    for _ in range(20):
        lab.run(0.1)
        seen.append(lab.device.leds.colour("LeftFaceLeds") >> 16)
    assert max(seen) == 255 and min(seen) == 0 and len(set(seen)) > 4
    lab.say("chest: ChestLeds.val = 1 time:1s;", 0.5)
    assert 0.3 < lab.device.leds.level("ChestLeds") < 0.7
    lab.run(0.6)
    assert shown(lab, "ChestLeds") == "ffffff"


def test_one_call_for_each_changed_light_in_a_tick() -> None:
    lab = Lab.ready()
    leds = lab.device.leds
    lab.say("eyeL.r = 1; eyeL.g = 1; eyeL.b = 1; eyeL.rgb = 5; eyeL.val = 0.5;", 0.2)
    assert leds.calls["fadeRGB"] + leds.calls["setIntensity"] == 1
    # All at once: some in each tick, and all of them in the end.
    lab.say("for (var index : 8) { eyeL.led[index].rgb = 0xFF0000 | eyeR.led[index].rgb = 0xFF0000 };")
    lab.run(lab.tick)
    assert 1 <= leds.calls["fadeRGB"] <= 1 + LIGHTS_PER_TICK
    lab.run(0.3)
    assert leds.calls["fadeRGB"] == 17 and shown(lab, "FaceLeds") == "ff0000"


def test_the_last_one_written_wins_where_groups_overlap() -> None:
    lab = Lab.ready()
    lab.say("AllLeds.rgb = 0xFF0000;", 0.2)
    lab.say("FaceLeds.rgb = 0x00FF00;", 0.2)
    assert (shown(lab, "FaceLed3"), shown(lab, "ChestLeds")) == ("00ff00", "ff0000")
    lab.say("AllLeds.rgb = 0xFF0000;", 0.2)
    assert shown(lab, "FaceLed3") == "ff0000"


def test_a_light_that_the_robot_refuses_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    del lab.device.leds._groups["ChestLeds"]
    lab.say("ChestLeds.val = 1; eyeL.val = 1;", 0.3)
    assert "ALLeds: no such led or group ChestLeds" in caplog.text and "alleds.cpp" not in caplog.text
    assert shown(lab, "LeftFaceLeds") == "ffffff"


def test_groups_that_a_program_makes() -> None:
    lab = Lab.ready()
    lab.say('ALLeds.createGroup("mine", ["FaceLedLeft0", "ChestBoard/Led/Red/Actuator/Value"]);', 0.2)
    lab.say('ALLeds.fadeRGB("mine", 0xFFFFFF, 0); ALLeds.fadeRGB("ChestLeds", "blue", 0);', 0.3)
    assert shown(lab, "FaceLedLeft0") == "ffffff" and shown(lab, "ChestLeds") == "0000ff"
    assert lab.say('ALLeds.listGroup("mine").size;', 0.2) == "4"


def test_a_robot_without_lights_starts() -> None:
    device = Nao()
    del device.services[device.leds.number]
    lab = Lab.ready(device)
    assert lab.look('Global.hasSlot("eyeL")') == "false"
    assert lab.look("robot.body.head.yaw === headYaw") == "true"


def test_names_of_actuators_are_no_variables() -> None:
    lab = Lab.ready()
    found: Any = lab.look('Global.localSlotNames.filter(closure (name) { name.split("/").size > 1 }).size')
    assert found == "0"
