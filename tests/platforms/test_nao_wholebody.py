"""Hands in space (manual, "Whole body motion"), and foot-step parameters of walking: by what the body does."""

from __future__ import annotations

import math

import pytest
from nao_lab import Lab, stand
from nao_rig import Rig

from urbihw.buses.messages import Refused, Reply, Request
from urbihw_nao_fakes.device import Nao

AHEAD = (0.18, 0.11, 0.40)
"""A place that the left hand reaches."""


def standing(**options: object) -> Lab:
    """A robot on its feet."""
    lab = Lab.ready(**options)
    stand(lab.device.body)
    lab.run(0.3)
    return lab


def place(lab: Lab, hand: str = "LArm") -> tuple[float, ...]:
    """The place of a hand of the body."""
    return lab.device.motion.find_hand(hand)


def reach(lab: Lab, target: tuple[float, ...], seconds: float = 4.0) -> str:
    """Write the place of the left hand."""
    return lab.say(f"handL.pos = {list(target)}|;", seconds)


def test_pos_is_where_the_hand_is() -> None:
    lab = standing()
    lab.say("handL.pos|; handR.pos|;", 0.5)
    for hand, effector in (("handL", "LArm"), ("handR", "RArm")):
        told = [lab.number(f"{hand}.pos[{axis}]") for axis in range(3)]
        assert told == pytest.approx(place(lab, effector), abs=0.001)
    assert lab.number("handL.pos[1]") > 0 > lab.number("handR.pos[1]")
    lab.say("armL.load = 1; sleep(100ms); shoulderPitchL.val = 0;", 1.0)
    assert lab.number("handL.pos[2]") == pytest.approx(place(lab)[2], abs=0.001)


def test_a_place_that_is_written_is_reached_by_the_body() -> None:
    lab = standing()
    assert math.dist(place(lab), AHEAD) > 0.1
    assert reach(lab, AHEAD) == ""
    assert math.dist(place(lab), AHEAD) < 0.02
    assert lab.device.motion.balancing and not lab.device.body.fallen
    assert math.dist([lab.number(f"handL.pos[{axis}]") for axis in range(3)], AHEAD) < 0.02


def test_the_balancer_gets_no_more_than_five_places_a_second() -> None:
    lab = standing()
    lab.say("handL.pos|;", 0.2)
    lab.say("for (var i : 100) { handL.pos = [0.18, 0.11, 0.38 + i * 0.0003]; sleep(20ms) };", 2.5)
    calls = lab.device.motion.calls
    assert 8 <= calls["wbSetEffectorControl"] <= 12
    assert [calls[name] for name in ("wbEnable", "wbFootState", "wbEnableBalanceConstraint")] == [1, 1, 1]
    assert place(lab)[2] == pytest.approx(0.41, abs=0.01), "the last one counts"


def test_a_stop_holds_the_hand_and_switches_the_balancer_off() -> None:
    lab = standing()
    reach(lab, AHEAD, 0.5)
    lab.say("robot.stop;", 0.05)
    where = place(lab)
    lab.run(2.0)
    assert math.dist(place(lab), where) < 0.005 and math.dist(where, AHEAD) > 0.02
    assert not lab.device.motion.balancing
    reach(lab, AHEAD)
    assert math.dist(place(lab), AHEAD) < 0.02


def test_the_end_of_a_client_stops_the_hand_that_it_has_moved() -> None:
    lab = standing()
    other = lab.kernel.open_lobby()
    lab.kernel.feed(other, f"handL.pos = {list(AHEAD)};".encode())
    lab.run(0.5)
    other.close()
    lab.run(0.1)
    where = place(lab)
    lab.run(2.0)
    assert math.dist(place(lab), where) < 0.005 and not lab.device.motion.balancing


def test_an_emergency_stop_lets_no_hand_move() -> None:
    lab = standing()
    lab.say("nao.estop = true;", 0.2)
    assert "held by an emergency stop" in reach(lab, AHEAD, 1.0)
    assert "wbEnable" not in lab.device.motion.calls or not lab.device.motion.balancing


def test_the_balancer_is_switched_off_when_nobody_uses_it() -> None:
    lab = standing()
    reach(lab, AHEAD, 8.0)
    assert lab.device.motion.balancing
    lab.run(4.0)
    assert not lab.device.motion.balancing
    assert math.dist(place(lab), AHEAD) < 0.02, "the arm holds"


def test_a_robot_that_does_not_stand_says_why() -> None:
    lab = Lab.ready()
    rig = Rig(lab.device).attach()
    rig.driver.request(pos("LArm", *AHEAD))
    refused = [each for each in rig.run(0.5) if isinstance(each, Refused)]
    assert [(each.device, each.item) for each in refused] == [("wholebody", "wbEnable")]
    assert "needs a robot that stands on stiff legs" in refused[0].reason


def test_a_robot_without_the_balancer_still_starts() -> None:
    robot = Nao()
    for uid in [uid for uid, each in robot.motion.methods.items() if each.name.startswith(("wb", "getPosition"))]:
        del robot.motion.methods[uid]
    rig = Rig(robot).attach()
    rig.run(2.0)
    assert not [each for each in rig.news if isinstance(each, Refused)]
    (reply,) = rig.driver.request(pos("LArm", *AHEAD))
    assert isinstance(reply, Reply) and reply.error == "this robot has no whole body control"
    rig.driver.safe_stop()
    assert not [each for each in rig.run(0.5) if isinstance(each, Refused)]


def test_a_new_worker_switches_off_what_the_last_one_has_left() -> None:
    robot = Nao()
    rig = Rig(robot)
    stand(rig.body)
    rig.attach()
    rig.driver.request(pos("LArm", *AHEAD))
    rig.run(0.5)
    fresh = Rig(robot)
    fresh.clock.sleep_until(rig.clock.now())
    fresh.link.open()
    fresh.driver.attach(fresh.link)
    fresh.driver.safe_stop()
    fresh.run(0.2)
    assert not robot.motion.balancing


def test_limits_of_joints_refuse_hands_in_space(caplog: pytest.LogCaptureFixture) -> None:
    lab = standing(limits={"HeadYaw": {"position": [-0.5, 0.5]}})
    where = place(lab)
    reach(lab, AHEAD, 2.0)
    assert math.dist(place(lab), where) < 0.001
    assert "LHand.pos: not done: it may exceed limits.HeadYaw.position, which cannot be told before" in caplog.text


@pytest.mark.parametrize("text", ["1", "[1, 2]", '["a", 1, 2]', "[0, 0, nan]"])
def test_what_is_no_place(text: str) -> None:
    lab = standing()
    assert "expected [x, y, z] in m" in lab.say(f"handL.pos = {text};", 0.5)
    assert not lab.device.motion.balancing


def pos(effector: str, *target: float) -> Request:
    """A request."""
    return Request(1, "write", effector, "pos", list(target))


# ---------------------------------------------------------------- foot steps


@pytest.mark.parametrize(
    ("config", "speed"),
    [("[]", 0.1), ('[["MaxStepX", 0.02]]', 0.06), ('[["MaxStepFrequency", 0.5]]', 0.06),
     ('[["LeftMaxStepX", 0.01], ["StepHeight", 0.01]]', 0.03)],
)  # fmt: skip
def test_foot_step_parameters_go_with_the_walk(config: str, speed: float) -> None:
    lab = standing()
    assert lab.say(f"naoWalk.moveConfig = {config}|; naoWalk.xSpeed = 0.1|;", 1.5) == ""
    assert lab.device.body.walk[0] == pytest.approx(speed, abs=0.002)


def test_foot_step_parameters_change_a_walk_that_goes_on() -> None:
    lab = standing()
    lab.say("naoWalk.xSpeed = 0.1|;", 1.0)
    assert (
        lab.say('naoWalk.moveConfig = [["MaxStepX", 0.01]]; naoWalk.moveConfig;', 1.0).splitlines()
        == ['[["MaxStepX", 0.01]]'] * 2
    )
    assert lab.device.body.walk[0] == pytest.approx(0.03, abs=0.002)
    lab.say("robot.stop;", 1.0)
    assert not lab.device.body.walking
    lab.say('naoWalk.moveConfig = [["MaxStepX", 0.02]];', 1.0)
    assert not lab.device.body.walking, "a parameter starts nothing"


def test_foot_step_parameters_survive_a_lost_link() -> None:
    lab = standing()
    lab.say('naoWalk.moveConfig = [["MaxStepX", 0.02]]|;', 0.2)
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.say("naoWalk.xSpeed = 0.1|;", 1.5)
    assert lab.device.body.walk[0] == pytest.approx(0.06, abs=0.002)


@pytest.mark.parametrize(
    ("config", "why"),
    [('[["MaxStepZ", 1]]', "no parameter of steps MaxStepZ; there are MaxStepX, MaxStepY, MaxStepTheta"),
     ("5", "takes a list such as"), ('[["MaxStepX"]]', "takes a list such as"),
     ('[["MaxStepX", "a"]]', "takes a number"), ('[["MaxStepX", inf]]', "takes a finite number")],
)  # fmt: skip
def test_what_is_no_foot_step_parameter(config: str, why: str) -> None:
    lab = standing()
    assert why in lab.say(f"naoWalk.moveConfig = {config};", 0.3)
    assert lab.look("naoWalk.moveConfig") == "[]"
