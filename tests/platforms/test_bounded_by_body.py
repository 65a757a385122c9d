"""Motion is bounded by what the body does, not by what was sent: the horns of simulated servos tell."""

from __future__ import annotations

import math
from typing import Any

import pytest
from chain_lab import Lab
from servo_hands import body_of

from urbihw.buses import messages as m
from urbihw.kernel.uobject import RobotSettings

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
        return [body_of(unit) for unit in self.kit]


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


def test_a_movement_takes_its_time_on_a_slow_line() -> None:
    """18 servos behind a CM-5: a cycle takes 0.11 s, and each goal lasts until the next one."""
    lab = Chain.ready(",".join(f"AX-12:{number}" for number in range(1, 19)))
    lab.kit.pace(57_600)
    lab.say_all("motor#.load = 1|;", 1.0)
    lab.say_all("motor#.val = 1 time:1,", 1.6)
    places = {number: lab.place(number) for number in lab.numbers}
    assert all(abs(place - 1) < 0.03 for place in places.values()), places


@pytest.mark.parametrize(("push", "lifts"), [(0.05, False), (0.4, True)])
def test_a_joint_lifts_an_arm_that_lies_on_something_if_it_may_push(push: float, lifts: bool) -> None:
    lab = Chain.ready("AX-12:1", push=push)
    lab.say("motor1.load = 1|;", 0.5)
    (body,) = lab.bodies()
    body.load, body.held = -0.2, True
    rest, lies = lab.place(1), lab.register(1, "goal_position")
    lab.say("motor1.val = 0.5 time:1,")
    for _ in range(200):
        # What it lies on carries the weight until the motor does: 33 counts away it pushes as hard as it can.
        body.held = lab.place(1) <= rest and lab.register(1, "goal_position") - lies < 0.2 * 33
        lab.step()
    assert (lab.place(1) - rest > 0.4) is lifts


@pytest.mark.parametrize("chain", CHAINS)
def test_a_weight_does_not_pull_a_joint_down_while_an_emergency_stop_holds(chain: str) -> None:
    """It gives way once, by its droop; the stops that are repeated for other masters leave it alone."""
    lab = Chain.ready(chain)
    lab.say_all("motor#.load = 1|; motor#.val = 0.5|;", 1.0)
    for body in lab.bodies():
        body.load = -0.4
    lab.run(1.0)
    lab.look("chain.estop = true")
    lab.run(1.0)
    before = {number: lab.place(number) for number in lab.numbers}
    lab.run(3.0)
    ways = {number: lab.place(number) - before[number] for number in lab.numbers}
    assert all(abs(way) < 0.03 for way in ways.values()), ways


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


@pytest.mark.parametrize(
    ("model", "entry", "data"), [("XL330-M288", 168, 208), ("XM430-W350", 168, 224), ("XM430-W350", 578, 634)]
)
def test_an_indirect_write_counts_as_one_of_the_register_that_it_leads_to(model: str, entry: int, data: int) -> None:
    lab = Chain.ready(f"{model}:3")

    def write(place: str, raw: int) -> str:
        return lab.say(f'motor3.writeRegister("{place}", {raw})|;', 0.3)

    assert "leads to id: write that name" in write(f"@{entry}:2", 7)
    assert "leads to baud_rate" in write(f"@{entry + 2}:4", 8 << 16 | 300)
    # Another program set the entry before.
    lab.kit[3].registers.put("indirect_address_0_0" if entry == 168 else "indirect_address_1_0", 7)
    assert "leads to id" in write(f"@{data}:1", 9)
    assert lab.register(3, "id") == 3
    assert write(f"@{entry}:2", data + 5) == ""
    assert write(f"@{data}:1", 44) == ""


def test_the_servo_itself_keeps_a_limit_of_speed() -> None:
    """By its own register, whatever programs write: so it does when the worker is dead."""
    lab = Chain.ready(CHAINS[0], limits={"speed": 1.0})
    lab.run(0.1)
    registers = {1: ("moving_speed", 0.0116239), 2: ("speed", 0.0119381), 3: ("profile_velocity", 0.0239808)}
    writes = {1: "moving_speed", 2: "moving_speed", 3: "profile_velocity"}

    def bounds() -> dict[int, float]:
        return {number: lab.register(number, name) * unit for number, (name, unit) in registers.items()}

    assert all(0.9 < speed <= 1.0 for speed in bounds().values()), bounds()
    lab.say_all("motor#.speed = 3|;", 0.3)
    assert all(0.9 < speed <= 1.0 for speed in bounds().values()), bounds()
    for raw in (0, 900):
        lab.say(" ".join(f'motor{n}.writeRegister("{name}", {raw})|;' for n, name in writes.items()), 0.3)
        assert all(0.9 < speed <= 1.0 for speed in bounds().values()), bounds()
    lab.say_all("motor#.speed = 0.5|;", 0.3)
    assert all(0.4 < speed <= 0.51 for speed in bounds().values()), bounds()
    lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=0))
    lab.run(0.3)
    assert all(0.4 < speed <= 0.51 for speed in bounds().values()), bounds()
    lab.say_all("motor#.speed = 3|;", 0.3)
    assert all(2.9 < speed <= 3.1 for speed in bounds().values()), bounds()


def test_limits_that_are_reloaded_act_on_what_moves_already() -> None:
    lab = Chain.ready("AX-12:1,XL330-M288:3,AX-12:4,XL330-M288:6")
    lab.say('motor1.mode = "wheel"; motor3.mode = "velocity"; motor4.load = motor6.load = 1;', 0.5)
    lab.say("motor1.speed = 4|; motor3.speed = -4|; motor4.val = 2.5 speed:3, motor6.val = 2.5 speed:3,", 0.3)
    assert min(lab.fastest(0.2).values()) > 2.5
    lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=0, limits={"speed": 1.0}))
    lab.run(0.1)
    most = lab.fastest(1.0)
    assert all(0.8 < speed <= MARGIN + GRAIN for speed in most.values()), most
    assert lab.number("motor1.requested") == 4.0
    assert lab.number("motor1.applied") == pytest.approx(1.0, abs=0.02)
    assert lab.look("motor1.limitedBy") == '"limits.speed"'
    assert lab.number("motor3.applied") == pytest.approx(-1.0, abs=0.03)


@pytest.mark.parametrize("estop", [False, True])
@pytest.mark.parametrize("chain", CHAINS)
def test_a_joint_that_becomes_a_wheel_stands_until_it_gets_a_speed(chain: str, estop: bool) -> None:
    lab = Chain.ready(chain, limits={"speed": 1.0})
    lab.say_all("motor#.load = 1|; motor#.val = 0.2|;", 1.0)
    if estop:
        lab.look("chain.estop = true")
        lab.run(0.3)
    modes = {n: "velocity" if lab.look(f"motor{n}.model").strip('"')[:2] == "X" else "wheel" for n in lab.numbers}
    heard = lab.say(" ".join(f'motor{n}.mode = "{mode}"|;' for n, mode in modes.items()))
    most = lab.fastest(1.5)
    assert all(speed <= GRAIN for speed in most.values()), (most, heard)


@pytest.mark.parametrize("go", ["motor#.val = 0.9|;", "motor#.val = 0.9 speed:0.5,"])
@pytest.mark.parametrize("chain", CHAINS)
def test_what_blocks_a_joint_is_told(chain: str, go: str) -> None:
    lab = Chain.ready(chain)
    lab.say_all("motor#.load = 1|; at (motor#.blocked?) echo(#);", 0.5)
    lab.hold(True)
    heard = lab.say_all(go, 0.9)
    assert {line for line in heard.splitlines() if "***" in line} == {f"*** {n}" for n in lab.numbers}
    for number in lab.numbers:
        assert 0.5 < lab.number(f"motor{number}.blockedFor") < 1.0
        assert "; blocked for 0." in lab.look(f"motor{number}.why")
    lab.hold(False)
    lab.run(3.0)
    assert all(lab.number(f"motor{number}.blockedFor") == 0 for number in lab.numbers)
    assert all("blocked" not in lab.look(f"motor{number}.why") for number in lab.numbers)
    # One that moves, stands at its goal, or holds a weight is not blocked.
    for body in lab.bodies():
        body.load = -0.3
    lab.run(2.0)
    assert lab.say_all("motor#.val = 0.2|;", 3.0) == ""


@pytest.mark.parametrize("action", ["stop", "relax"])
def test_a_joint_that_is_blocked_for_long_is_stopped_or_gets_slack(action: str) -> None:
    lab = Chain.ready("AX-12:1,XL330-M288:3", blocked_limit=1.0, blocked_action=action)
    lab.say_all("motor#.load = 1|;", 0.5)
    lab.hold(True)
    heard = lab.say_all("motor#.val = 0.9 time:1min,", 2.5)
    assert heard.count("was blocked for 1.") == 2, heard
    lab.hold(False)
    assert max(lab.fastest(1.0).values()) <= GRAIN
    torque = 1 if action == "stop" else 0
    assert [lab.register(number, "torque_enable") for number in lab.numbers] == [torque, torque]
    lab.say_all("motor#.load = 1|; sleep(0.2s); motor#.val = 0.3|;", 2.0)
    assert all(abs(lab.place(number) - 0.3) < 0.03 for number in lab.numbers)


def test_missed_readings_do_not_begin_the_time_of_a_blocked_joint_anew() -> None:
    lab = Chain.ready("AX-12:1,XL330-M288:3", blocked_limit=1.0)
    lab.say_all("motor#.load = 1|; at (motor#.blocked?) echo(#);", 0.5)
    lab.hold(True)
    heard = lab.say_all("motor#.val = 0.9 time:1min,")
    for _ in range(20):
        for number in lab.numbers:
            lab.kit.faults.start("silence", number, times=2)
        heard += lab.say("", 0.2)
    assert [heard.count(f"*** {number}") for number in lab.numbers] == [1, 1], heard
    assert heard.count("was blocked for 1.") == 2, heard
    lab.hold(False)
    assert max(lab.fastest(1.0).values()) <= GRAIN


def test_a_joint_that_turns_faster_than_its_limit_is_told_and_stopped() -> None:
    lab = Chain.ready("XL330-M288:3", limits={"speed": 0.5})
    lab.say('motor3.load = 1|; at (motor3.overspeed?(var v)) echo("too fast");', 0.5)
    lab.say("motor3.val = 1.5 time:1min,", 1.0)
    (body,) = lab.bodies()
    body.load = 1.3  # Something pushes it that is stronger than the motor.
    heard = lab.say("", 0.3)
    assert heard.count("*** too fast") == 1
    assert "above limits.speed" in heard
    body.load = 0.0
    lab.run(4.0)
    assert max(lab.fastest(1.0).values()) <= GRAIN


def test_nobody_claims_to_have_stopped_a_standing_joint_that_was_pushed(caplog: pytest.LogCaptureFixture) -> None:
    lab = Chain.ready("XL330-M288:3", limits={"speed": 0.5})
    lab.say("motor3.load = 1|; motor3.val = 0;", 1.0)
    (body,) = lab.bodies()
    body.load = 1.3
    lab.run(0.3)
    told = [text for text in caplog.messages if "above limits.speed: its movements are over" in text]
    assert len(told) == 1 and "stopped" not in caplog.text, caplog.text


def test_the_health_tells_what_is_blocked() -> None:
    lab = Chain.ready("AX-12:1")
    assert lab.worker is not None
    health = lab.worker._engine._health
    health.hear(m.DeviceState(1, "back", "ok", ""), lab.bus_clock.now())
    health.hear(m.DeviceReport(1, "blocked", lab.bus_clock.now() - 2.0), lab.bus_clock.now())
    assert lab.findings() == ["1: blocked for 2.0 s: free it, or stop it"]
    health.hear(m.DeviceReport(1, "free", 2.0), lab.bus_clock.now())
    assert lab.findings() == []
