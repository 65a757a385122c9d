"""Motion is bounded by what the body does, not by what was sent: the horns of simulated servos tell."""

from __future__ import annotations

import math
from typing import Any

import pytest
from chain_lab import Lab

from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.feetech.servo import FeetechServo

MARGIN = 1.1
"""A body may be so much faster than told."""
SPAN = 0.1
"""Seconds over which a speed is looked at, as in ``motions``."""
GRAIN = 0.05
"""What the counts of an AX-12 add to a speed."""
CHAINS = ("AX-12:1,MX-28:2,XL330-M288:3,XM430-W350:4", "STS3215:1")


class Chain(Lab):
    """Servos, each of which stands on its own."""

    @property
    def numbers(self) -> list[int]:
        """The ids."""
        return [unit.id for unit in self.kit]

    def fastest(self, seconds: float) -> dict[int, float]:
        """The highest speed of each horn in some time, rad/s, each over SPAN: an AX-12 goes in steps of a count."""
        places = []
        for _ in range(round(seconds / self.tick)):
            self.step()
            places.append({number: self.place(number) for number in self.numbers})
        pairs = list(zip(places, places[round(SPAN / self.tick) :], strict=False))
        return {n: max(abs(math.remainder(b[n] - a[n], math.tau)) for a, b in pairs) / SPAN for n in self.numbers}

    def stand_still(self, seconds: float) -> None:
        """Let time pass in which the interpreter does nothing, while the bus goes on."""
        scheduler: Any = self.kernel.scheduler
        scheduler.run_simulated = self.clock.idle
        self.run(seconds)
        del scheduler.run_simulated

    def say_all(self, text: str, seconds: float = 0.0) -> str:
        """Say a statement for each motor; ``#`` stands for its number."""
        return self.say(" ".join(text.replace("#", str(number)) for number in self.numbers), seconds)

    def hold(self, held: bool) -> None:
        """Hold all horns by hand, or let them go."""
        self.kit.tick(self.bus_clock.now())
        for body in self.bodies():
            body.held = held

    def bodies(self) -> list[Any]:
        """What turns of each servo: with ``held``, and ``load`` where the fake has forces."""
        return [unit.motor if isinstance(unit, XSeries | FeetechServo) else unit for unit in self.kit]


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize(
    ("limits", "go", "wanted"),
    [
        pytest.param({"speed": 1.0}, "motor#.val = 0.9|;", 1.0, id="limit"),
        pytest.param({}, "motor#.val = 0.9 speed:0.5,", 0.5, id="speed"),
        pytest.param({}, "motor#.val = 0.9 smooth:2s,", 0.9 * 3.1416 / 4, id="smooth"),
    ],
)
def test_a_joint_that_was_held_does_not_leap_when_it_is_let_go(chain: str, limits: Any, go: str, wanted: float) -> None:
    lab = Chain.ready(chain, limits=limits)
    lab.say_all("motor#.load = 1|;", 0.5)
    lab.hold(True)
    lab.say_all(go, 1.8)
    assert max(lab.fastest(0.2).values()) == 0.0
    lab.hold(False)
    most = lab.fastest(4.0)
    assert all(speed <= wanted * MARGIN + GRAIN for speed in most.values()), most
    places = {number: lab.place(number) for number in lab.numbers}
    assert all(abs(place - 0.9) < 0.03 for place in places.values()), places


@pytest.mark.parametrize("chain", CHAINS)
def test_a_joint_that_carries_a_weight_reaches_its_goal(chain: str) -> None:
    """Its weight pulls it down by its droop; it goes up all the same, as slowly as told."""
    lab = Chain.ready(chain, limits={"speed": 0.3})
    lab.say_all("motor#.load = 1|;", 0.5)
    for body in lab.bodies():
        body.load = -0.4
    lab.run(1.0)
    before = {number: lab.place(number) for number in lab.numbers}
    lab.say_all("motor#.val = 0.9|;")
    assert max(lab.fastest(4.0).values()) <= 0.3 * MARGIN + GRAIN
    ways = {number: lab.place(number) - before[number] for number in lab.numbers}
    assert all(abs(way - 0.9) < 0.03 for way in ways.values()), ways


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("go", ["speed:0.5", "time:2s", "smooth:2s", "sin:4s ampli:0.5", "speed:0.5 adaptive:true"])
def test_a_neighbour_who_holds_the_interpreter_does_not_make_a_trajectory_leap(chain: str, go: str) -> None:
    lab = Chain.ready(chain)
    lab.say_all("motor#.load = 1|;", 0.5)
    undisturbed = Chain.ready(chain)
    undisturbed.say_all("motor#.load = 1|;", 0.5)
    undisturbed.say_all(f"motor#.val = 1 {go},")
    told = max(undisturbed.fastest(4.0).values())
    lab.say_all(f"motor#.val = 1 {go},", 0.3)
    for _ in range(3):
        lab.stand_still(0.8)
        most = lab.fastest(0.3)
        assert all(speed <= told * MARGIN + GRAIN for speed in most.values()), most



def _raw(name: str, value: int) -> str:
    return f'motor#.writeRegister("{name}", {value})|;'


EFFORTS = {
    "torque limit": ("motor#.torqueLimit = 0|;", "motor#.torqueLimit = 1.5|;", "1,3,4,5"),
    "raw torque limit": (_raw("torque_limit", 0), _raw("torque_limit", 900), "1,2,5"),
    "PWM": ("motor#.goalPwm = 0|;", "motor#.goalPwm = 1|;", "3,4"),
    "raw PWM": (_raw("goal_pwm", 0), _raw("goal_pwm", 885), "3,4"),
    "gain": (_raw("position_p_gain", 0), _raw("position_p_gain", 800), "3,4"),
    "current": (
        'motor#.mode = "current-based position"; sleep(0.3s); motor#.goalCurrent = 0|;', "motor#.goalCurrent = 0.5|;",
        "3,4",
    ),
}
"""Without and with force: what is said, and to which servos of the chains (5 is the STS3215)."""


@pytest.mark.parametrize("speed", [1.0, None], ids=["limit", "no limit"])
@pytest.mark.parametrize("effort", EFFORTS)
def test_a_joint_that_gets_its_force_back_begins_where_it_is(effort: str, speed: float | None) -> None:
    without, with_force, which = EFFORTS[effort]
    for chain, own in ((CHAINS[0], [n for n in which.split(",") if n != "5"]), (CHAINS[1], ["1"] * ("5" in which))):
        if not own:
            continue
        lab = Chain.ready(chain, limits={} if speed is None else {"speed": speed})

        def tell(text: str, seconds: float, lab: Chain = lab, own: list[str] = own) -> None:
            heard = lab.say(" ".join(text.replace("#", number) for number in own), seconds)
            assert all("warning" in line for line in heard.splitlines() if "!!!" in line), heard

        tell("motor#.load = 1|;", 0.5)
        tell(without, 0.5)
        tell("motor#.val = 1.2|;", 1.8)
        tell(with_force, 0.0)
        assert max(lab.fastest(2.0).values()) <= (0.0 if speed is None else speed * MARGIN) + GRAIN
        tell("motor#.val = 0.5|;", 2.0)
        assert all(abs(lab.place(int(number)) - 0.5) < 0.03 for number in own)
