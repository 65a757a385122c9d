"""What the writer of a movement hears when the robot cannot make it or go on with it."""

from __future__ import annotations

import math

import pytest
from lab import RobotLab
from nao_lab import Lab as Nao
from nao_lab import stand
from nxt_lab import Lab as Nxt
from p3dx_lab import Lab as Pioneer
from segway_lab import Lab as Segway
from spykee_lab import Lab as Spykee

from urbihw.platforms import find, guess_url

SLACK = "warning: the legs are slack: robot.wakeUp lets the robot stand"
FALLEN = "robot: ALMotion: the robot cannot walk"


def standing() -> Nao:
    lab = Nao.ready()
    stand(lab.device.body)
    lab.run(0.2)
    return lab


@pytest.mark.parametrize(
    "write", ["naoWalk.xSpeed = 0.1|;", "robot.xSpeed = 0.1|;", "handL.pos = [0.18, 0.11, 0.1]|;", "robot.go(0.3);"]
)
def test_a_nao_with_slack_legs_says_so_at_the_write(write: str) -> None:
    lab = Nao.ready()
    assert SLACK in lab.say(write, 1.0)
    assert lab.device.body.x == 0


def test_a_standing_nao_warns_of_nothing() -> None:
    lab = Nao.ready()
    assert lab.say("motion.wakeUp;", 5.0) == ""
    assert lab.say("naoWalk.xSpeed = 0.1|; sleep(1s); naoWalk.xSpeed = 0|;", 3.0) == ""
    assert lab.say("robot.go(0.1);", 4.0) == ""
    assert lab.device.body.x > 0.15


@pytest.mark.parametrize("movement", ["robot.go(0.3);", "robot.turn(90deg);", "robot.goTo([0.1, 0.1]);"])
def test_a_movement_that_the_robot_refuses_is_an_error(movement: str) -> None:
    lab = Nao.ready()
    assert FALLEN in lab.say(movement, 1.0)
    assert lab.look("[robot.xSpeed, robot.yawSpeed, naoWalk.xSpeed, naoWalk.yawSpeed]") == "[0, 0, 0, 0]"
    # The next one is another one.
    lab.say("motion.wakeUp;", 5.0)
    assert FALLEN not in lab.say("robot.go(0.05);", 3.0)
    assert lab.device.body.x == pytest.approx(0.05, abs=0.02) and lab.device.body.y == pytest.approx(0, abs=0.01)


def test_a_speed_that_was_refused_does_not_come_back_with_another_one() -> None:
    lab = Nao.ready()
    lab.say("naoWalk.xSpeed = 0.1|;", 0.5)
    lab.say("motion.wakeUp;", 5.0)
    lab.say("naoWalk.yawSpeed = 0.3|;", 1.0)
    assert lab.device.body.x == pytest.approx(0, abs=0.005) and lab.device.body.heading > 0.1


def pioneer() -> Pioneer:
    lab = Pioneer.ready()
    lab.say("P3dx.body.load = 1|;", 1.0)
    return lab


def segway() -> Segway:
    lab = Segway.ready()
    lab.say('rmp.mode = "tractor"|;', 1.0)
    return lab


def unplug(lab: RobotLab) -> None:
    if isinstance(lab, Nao | Spykee):
        lab.unplug()
    elif isinstance(lab, Pioneer):
        lab.robot_line.end.unplug()
    elif isinstance(lab, Nxt | Segway):
        lab.end.unplug()


@pytest.mark.parametrize("make", [standing, Spykee.ready, Nxt.ready, segway, pioneer])
def test_a_movement_whose_link_is_lost_ends_with_an_error_on_every_base(make: object) -> None:
    assert callable(make)
    lab: RobotLab = make()
    assert lab.say("robot.go(0.8);", 1.0) == ""
    unplug(lab)
    lab.run(4.0)
    heard = lab.heard()
    assert "the link was lost after 0." in heard and "of 0.80 m" in heard
    for movement in ("robot.go(0.1);", "robot.turn(90deg);", "robot.goTo([1, 1]);"):
        assert "the link to the robot is down" in lab.say(movement, 0.1)


@pytest.mark.parametrize("make", [standing, Spykee.ready])
def test_a_turn_that_was_lost_does_not_go_on_when_the_link_is_back(make: object) -> None:
    assert callable(make)
    lab = make()
    assert lab.say('robot.turn(180deg); echo("next");', 1.0) == ""
    lab.unplug()
    lab.run(3.0)
    lab.end.replug()
    lab.run(3.0)
    heard = lab.heard()
    assert "of 3.14 rad: the movement has ended" in heard and "next" in heard
    assert lab.look("robot.moving") == "false"


def test_a_track_of_a_robot_that_is_gone_says_so_and_stands_when_it_is_back() -> None:
    lab = Spykee.ready()
    lab.unplug()
    lab.run(4.0)
    assert "warning: the link to the robot is down" in lab.say("trackL.val = 40;", 0.2)
    assert math.isnan(lab.number("trackL.applied")) and lab.number("trackL.val") == 0
    assert "the link to the robot is down" in lab.look("trackL.why")
    lab.end.replug()
    lab.run(3.0)
    assert lab.device.body.speeds[0] == 0
    assert "warning" not in lab.say("trackL.val = 40|;", 0.5)
    assert lab.device.body.speeds[0] != 0


@pytest.mark.parametrize(("lab", "slot"), [(Nao.ready, "headYaw"), (Spykee.ready, "trackL")])
def test_what_is_no_number_was_not_requested(lab: object, slot: str) -> None:
    assert callable(lab)
    robot = lab()
    robot.say(f"motors.load = 1|; {slot}.val = 0.5|;" if slot == "headYaw" else f"{slot}.val = 0.5|;", 0.5)
    before = robot.look(f"[{slot}.requested, {slot}.applied]")
    assert "val: this slot takes a number" in robot.say(f'{slot}.val = "fast";', 0.2)
    assert robot.look(f"[{slot}.requested, {slot}.applied]") == before


def test_load_of_what_has_no_switch_and_of_groups() -> None:
    lab = Spykee.ready()
    assert lab.say("trackL.load; robot.body.track.load;") == "1\nGroup [1, 1]"
    assert "lookup failed: load" in lab.say("class Bare {}|; Bare.new.addProto(Interface.Motor).load;")
    assert lab.say("class Own { var load = 0.5 }|; Own.new.addProto(Interface.Motor).load;") == "0.5"
    nao = Nao.ready()
    assert nao.say("head.load; motors.load = 1|;", 0.5) == "Group [0, 0]"
    assert nao.say("head.load; (motors.load == 1).all;", 0.5).splitlines()[0] == "Group [1, 1]"


def test_values_are_stale_while_the_link_is_down() -> None:
    nao = Nao.ready()
    slots = "[" + ", ".join(f"{name}.stale" for name in ("headYaw", "battery", "sonarL", "footTouchL", "fsr")) + "]"
    assert nao.look(slots) == "[false, false, false, false, false]"
    nao.unplug()
    nao.run(3.0)
    assert nao.look(slots) == "[true, true, true, true, true]"
    nao.end.replug()
    nao.run(3.0)
    assert nao.look(slots) == "[false, false, false, false, false]"


def test_a_setting_that_the_robot_does_not_take_is_told_to_its_writer() -> None:
    lab = Nao.ready()
    assert "warning: lang is not set: " in lab.say('tts.lang = "xx";', 1.0)
    assert lab.look("tts.lang") == '"en"'


def test_a_limit_of_a_track_below_one_percent_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    Spykee.ready(limits={"speed": 0.3})
    assert "limits.speed = 0.3 is percent of full power, so trackL does not run" in caplog.text


@pytest.mark.parametrize(
    ("platform", "url", "meant"),
    [
        ("nao", "127.0.0.1:54810", "qi://127.0.0.1:54810"), ("nao", "nao.local", "qi://nao.local"),
        ("spykee", "172.17.6.1", "spykee://172.17.6.1"), ("nao", "qi://nao.local", ""), ("nao", "/dev/ttyUSB0", ""),
        ("bioloid", "127.0.0.1:54810", ""), ("segway", "can0", ""),
    ],
)  # fmt: skip
def test_a_url_without_its_scheme_is_guessed_for_robots_on_tcp(platform: str, url: str, meant: str) -> None:
    hint = guess_url(find(platform), url)
    assert hint == (f"bus url {url!r}: did you mean {meant}?" if meant else "")
