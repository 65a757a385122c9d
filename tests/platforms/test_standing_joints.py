"""Joints that stand: forced away by a hand and let go, under a weight, with an emergency stop, at several rates."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from chain_lab import Lab
from servo_hands import turn_horn
from test_bounded_by_body import CHAINS, GRAIN, MARGIN, Chain

from urbihw.kernel.uobject import RobotSettings

AWAY = 0.8
"""How far a hand turns the horns, rad."""
PLACE = 0.3


class Standing(Chain):
    """Joints that stand at PLACE."""

    @classmethod
    def at_place(cls, chain: str, go: str = f"motor#.val = {PLACE}|;", tick: float = 0.01, **options: Any) -> Standing:
        kind: type[Standing] = type(cls.__name__, (cls,), {"tick": tick})
        lab = kind.ready(chain, overspeed="tell", **options)
        lab.say_all(f"motor#.load = 1|; {go}", 1.5)
        return lab

    def turn(self, way: float, seconds: float, held: float = 0.0) -> None:
        """Turn the horns by hand, keep them there, and let them go."""
        steps = max(1, round(seconds / self.tick))
        self.hold(True)
        for _ in range(steps):
            for unit in self.kit:
                turn_horn(unit, way / steps)
            self.step()
        self.run(held)
        self.hold(False)

    def places(self) -> dict[int, float]:
        """Where the horns are."""
        return {number: self.place(number) for number in self.numbers}

    def pull(self, load: float) -> None:
        """Pull at the horns, with a share of the force that they have."""
        self.kit.tick(self.bus_clock.now())
        for body in self.bodies():
            body.load = load


def _near(places: dict[int, float], wanted: float, within: float = 0.03) -> bool:
    return all(abs(place - wanted) < within for place in places.values())


@pytest.mark.parametrize("held", [0.0, 1.0])
@pytest.mark.parametrize("chain", CHAINS)
def test_a_standing_joint_that_is_forced_away_comes_back_no_faster_than_its_limit(chain: str, held: float) -> None:
    lab = Standing.at_place(chain, limits={"speed": 1.0})
    for _ in range(2):
        lab.turn(AWAY, 0.4, held)
        most = lab.fastest(1.5)
        assert all(speed <= MARGIN + GRAIN for speed in most.values()), most
        assert _near(lab.places(), PLACE), lab.places()


@pytest.mark.parametrize("chain", CHAINS)
def test_it_comes_back_at_the_speed_of_its_last_movement(chain: str) -> None:
    lab = Standing.at_place(chain, f"motor#.val = {PLACE} speed:0.5|;")
    lab.turn(AWAY, 0.4)
    most = lab.fastest(2.5)
    assert all(speed <= 0.5 * MARGIN + 2 * GRAIN for speed in most.values()), most
    assert _near(lab.places(), PLACE), lab.places()


@pytest.mark.parametrize("limits", [{}, {"speed": 1.0}])
@pytest.mark.parametrize("chain", CHAINS)
def test_while_an_emergency_stop_holds_it_stays_where_it_is_let_go(chain: str, limits: dict[str, float]) -> None:
    lab = Standing.at_place(chain, limits=limits)
    lab.look("chain.estop = true")
    lab.run(0.5)
    for turn in (1, 2):
        lab.turn(AWAY / 2, 0.2, held=0.5 if turn == 1 else 0.0)
        let_go = lab.places()
        most = lab.fastest(1.0)
        assert all(speed <= 5 * GRAIN for speed in most.values()), most
        ways = [abs(lab.place(number) - place) for number, place in let_go.items()]
        assert max(ways) < 0.04, ways
    rest = lab.places()
    lab.look("chain.estop = false")
    lab.run(1.0)
    assert max(abs(lab.place(number) - place) for number, place in rest.items()) < 0.01


@pytest.mark.parametrize("held", [0.0, 1.0])
@pytest.mark.parametrize("chain", CHAINS)
def test_a_joint_that_is_pulled_back_on_its_way_does_not_leap_when_it_is_let_go(chain: str, held: float) -> None:
    lab = Standing.at_place(chain, limits={"speed": 1.0})
    lab.say_all("motor#.val = 1|;", 0.4)
    lab.turn(-0.5, 0.25, held)
    most = lab.fastest(2.5)
    assert all(speed <= MARGIN + GRAIN for speed in most.values()), most
    assert _near(lab.places(), 1.0), lab.places()


def test_a_hand_that_turns_a_joint_a_little_and_stays_there_is_no_weight() -> None:
    lab = Standing.at_place("XL330-M288:3", limits={"speed": 1.0})
    lab.turn(0.18, 0.2, held=0.5)
    most = lab.fastest(1.0)
    assert all(speed <= MARGIN + GRAIN for speed in most.values()), most


@pytest.mark.parametrize("tick", [0.02, 0.1])
def test_slow_cycles_do_the_same(tick: float) -> None:
    lab = Standing.at_place(CHAINS[0], tick=tick, limits={"speed": 1.0})
    lab.turn(AWAY, 0.8)
    most = lab.fastest(2.0)
    assert all(speed <= MARGIN + GRAIN for speed in most.values()), most
    assert _near(lab.places(), PLACE), lab.places()


@pytest.mark.parametrize("estop", [False, True])
@pytest.mark.parametrize(("load", "tick"), [(-0.1, 0.01), (-0.25, 0.01), (-0.4, 0.01), (-0.4, 0.05)])
def test_a_weight_that_is_put_on_is_held_and_not_let_down_tick_by_tick(load: float, tick: float, estop: bool) -> None:
    lab = Standing.at_place(CHAINS[0], tick=tick, limits={"speed": 1.0})
    if estop:
        lab.look("chain.estop = true")
        lab.run(0.5)
    lab.pull(load)
    lab.run(1.0)
    held = lab.places()
    lab.run(3.0)
    assert all(abs(lab.place(number) - place) < 0.01 for number, place in held.items())
    # What the servo gives way by, the error of full force being at most 0.43 rad, and the test of what pulls.
    assert min(held.values()) > PLACE + load * 0.43 - 0.06, held


def test_a_weight_that_falls_off_is_forgotten_at_once() -> None:
    """The joint springs up by what it carried, and its goal does not push it on."""
    lab = Standing.at_place("XL330-M288:3,XM430-W350:4", limits={"speed": 1.0})
    lab.pull(-0.4)
    lab.run(1.0)
    lab.pull(0.0)
    most = lab.fastest(2.0)
    assert all(speed <= 1.5 for speed in most.values()), most
    assert _near(lab.places(), PLACE), lab.places()


@pytest.mark.parametrize("seconds", [0.01, 0.4])
def test_a_standing_joint_that_is_turned_by_hand_without_torque_stays_limp(seconds: float) -> None:
    """On an AX-12 to write a goal would switch the torque on, and another master may have switched it off."""
    lab = Standing.at_place("AX-12:1,XL330-M288:3", limits={"speed": 1.0})
    # Not at the moment at which its torque is read anyway.
    lab.run(0.04)
    for unit in lab.kit:
        unit.registers.put("torque_enable", 0)
    lab.turn(AWAY, seconds)
    lab.run(1.0)
    assert [lab.register(number, "torque_enable") for number in lab.numbers] == [0, 0]
    assert _near(lab.places(), PLACE + AWAY)


@pytest.mark.parametrize("phase", range(5))
@pytest.mark.parametrize(("way", "seconds"), [(0.036, 0.0), (0.09, 0.03)])
def test_a_joint_that_an_emergency_stop_made_limp_stays_limp(
    monkeypatch: pytest.MonkeyPatch, way: float, seconds: float, phase: int
) -> None:
    monkeypatch.setattr("lab.RobotSettings", partial(RobotSettings, torque_off_on_stop=True))
    lab = Standing.at_place("AX-12:1,XL330-M288:3", limits={"speed": 1.0})
    lab.run(phase * 0.02)
    lab.look("chain.estop = true")
    lab.step()
    lab.turn(way, seconds)
    lab.run(0.3)
    assert [lab.register(number, "torque_enable") for number in lab.numbers] == [0, 0]


def test_the_servo_keeps_its_own_limit_of_speed_after_it_has_followed_a_hand() -> None:
    lab = Standing.at_place("XL330-M288:3", limits={"speed": 1.0})
    before = lab.register(3, "profile_velocity")
    assert before > 0
    lab.turn(AWAY, 0.4, held=0.3)
    assert lab.register(3, "profile_velocity") == 0
    lab.run(0.3)
    assert lab.register(3, "profile_velocity") == before


def test_a_joint_that_is_stopped_while_a_hand_turns_it_has_not_started_anew() -> None:
    """The stop switches the profile off, so that the joint is held at once."""
    lab = Standing.at_place("XL330-M288:3", f"motor#.speed = 1|; motor#.val = {PLACE}|;", limits={"speed": 1.0})
    heard = lab.say('at (motor3.lost?) echo("it is lost");')
    before = lab.register(3, "profile_velocity")
    lab.hold(True)
    for step in range(60):
        if step < 20:
            turn_horn(lab.kit[3], 0.0075)
        lab.step()
        if step == 6:
            lab.look("chain.stop")
    lab.hold(False)
    lab.run(0.5)
    assert not heard + lab.heard()
    assert lab.register(3, "profile_velocity") == before


def test_a_wheel_is_not_held_by_a_place() -> None:
    lab = Lab.ready("AX-12:1,XL330-M288:3", limits={"speed": 1.0})
    lab.say('motor1.load = motor3.load = 1; motor1.mode = "wheel"; motor3.mode = "velocity";', 0.5)
    goals = [lab.register(number, "goal_position") for number in (1, 3)]
    lab.say("motor1.speed = 0.5|; motor3.speed = 0.5|;", 2.0)
    assert [lab.register(number, "goal_position") for number in (1, 3)] == goals
    paces = [lab.pace(number) for number in (1, 3)]
    assert all(abs(pace - 0.5) < 0.15 for pace in paces), paces


def test_without_a_limit_and_a_speed_a_joint_comes_back_as_it_can() -> None:
    lab = Standing.at_place("XL330-M288:3")
    lab.turn(AWAY, 0.4)
    assert min(lab.fastest(1.0).values()) > 3.0
    assert _near(lab.places(), PLACE)


@pytest.mark.parametrize("noted", ["it holds", "it is led"])
def test_a_joint_that_a_hand_has_turned_out_of_sight_does_not_leap_when_it_is_let_go(noted: str) -> None:
    """A servo with a profile leads a goal of its own, which is far behind when the servo answers again."""
    lab = Chain.ready("XL430-W250:1,XL330-M288:2,XM430-W350:3", limits={"speed": 1.0})
    lab.say_all("motor#.load = 1|; motor#.val = 0.9|;", 0.6 if noted == "it holds" else 1.8)
    for number in lab.numbers:
        lab.kit.faults.start("silence", number)
    lab.hold(True)
    for _ in range(30):
        lab.kit.tick(lab.bus_clock.now())
        for unit in lab.kit:
            turn_horn(unit, -0.02)
        lab.step()
    for number in lab.numbers:
        lab.kit.faults.stop("silence", number)
    while any(lab.look(f"motor{number}.state") != '"ok"' for number in lab.numbers):
        lab.step()
    lab.run(0.05)
    lab.hold(False)
    most = lab.fastest(1.0)
    assert all(speed <= MARGIN + GRAIN for speed in most.values()), most
    lab.say_all("motor#.val = 0|;", 2.5)
    assert all(abs(lab.place(number)) < 0.03 for number in lab.numbers)
    speeds = [lab.register(number, "profile_velocity") for number in lab.numbers]
    assert all(speeds), speeds


def test_an_emergency_stop_leaves_a_joint_in_a_hand_the_goal_that_its_movement_has_brought_near() -> None:
    lab = Standing.at_place("STS3215:1", tick=0.02, limits={"speed": 1.0})
    for body in lab.bodies():
        # A worn motor: the error with which it turns is taken for what it carries, and a far goal is kept as for that.
        body.full_speed = 300.0
    lab.say_all(f"motor#.val = {PLACE - 1},", 1.2)
    lab.turn(0.3, 0.2)
    lab.hold(True)
    lab.say_all(f"motor#.val = {PLACE},", 0.5)
    lab.look("chain.estop = true")
    lab.run(0.5)
    held = lab.places()
    lab.hold(False)
    lab.run(0.5)
    ways = [abs(lab.place(number) - place) for number, place in held.items()]
    assert max(ways) < 0.04, ways
