"""The properties of slots that movements honour: range, speed, nearness; and how movements of one slot are blended."""

from __future__ import annotations

import itertools

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, variable


class Motor(UObject):
    """Remembers what it was told."""

    val = variable(0.0)

    def init(self) -> None:
        self.told: list[float] = []
        self.notify_change(self.val, self.move)

    def move(self, value: float) -> None:
        self.told.append(value)


class Console:
    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        self.motor = self.kernel.host.create(Motor, "m")
        self.say("var Global.o = Object.new|; var o.x = 0|;")

    def say(self, text: str, until: float | None = None) -> list[str]:
        answer = self.kernel.run_text(self.lobby, text, until)
        return [line.partition("] ")[2] for line in answer.splitlines()]

    def samples(self, place: str, *times: float) -> list[float]:
        """The values of a slot at these times."""
        found = []
        for time in times:
            self.say("", time)
            found.append(float(self.say(f"{place};", time)[0]))
        return found


@pytest.fixture
def console() -> Console:
    return Console()


@pytest.mark.parametrize("place", ["o.x", "m.val"])
def test_a_movement_stays_within_the_range(console: Console, place: str) -> None:
    console.say(f"{place}->rangemax = 3| {place}->rangemin = -1|; {place} = 10 time:1s,", 0.05)
    assert console.samples(place, 0.49, 1.2) == [pytest.approx(1.44, abs=0.1), 3.0]
    console.say(f"{place} = 0 sin:1s ampli:5,", 1.3)
    values = console.samples(place, *(1.3 + 0.1 * n for n in range(1, 12)))
    assert (min(values), max(values)) == (-1.0, 3.0)


@pytest.mark.parametrize(("movement", "end"), [
    ("10 time:1s", 5.0), ("10 speed:100", 5.0), ("10 smooth:1s", 7.85), ("10 time:1s adaptive:true", 5.0),
    ("10 speed:100 adaptive:true", 5.0), ("10 accel:1000", 5.0),
])
def test_a_movement_is_not_faster_than_allowed(console: Console, movement: str, end: float) -> None:
    console.say("o.x->speedmax = 2|;")
    times = [0.1 * n for n in range(1, 90)]
    console.say(f"o.x = {movement},", 0.001)
    values = console.samples("o.x", *times)
    steps = [b - a for a, b in zip(values, values[1:], strict=False)]
    assert max(steps) <= 0.2 + 0.05
    reached = next(time for time, value in zip(times, values, strict=True) if value == 10)
    assert reached == pytest.approx(end, abs=0.15)


@pytest.mark.parametrize("movement", ["1 time:10s", "1 speed:0.1", "1 speed:0.1 adaptive:true"])
def test_a_movement_is_not_slower_than_allowed(console: Console, movement: str) -> None:
    console.say(f"o.x->speedmin = 1|; o.x = {movement},", 1.1)
    assert console.say("o.x;", 1.1) == ["1"]


def test_near_enough_is_near_enough_for_a_closed_loop(console: Console) -> None:
    console.say("o.x->delta = 0.5|; o.x = 10 speed:5 adaptive:true | echo(o.x);", 5.0)
    assert float(console.say("o.x;", 5.1)[0]) == pytest.approx(9.5, abs=0.11)


# ---------------------------------------------------------------- blending


@pytest.mark.parametrize("place", ["o.x", "m.val"])
@pytest.mark.parametrize(("mode", "middle", "end"), [
    ("normal", 3.0, 6.0),  # the second began later and is read
    ("mix", 4.0, 8.0),  # the mean
    ("add", 8.0, 16.0),
    ("discard", 5.0, 10.0),  # the first alone
    ("cancel", 3.0, 6.0),  # the second alone
])
def test_two_movements_at_once(console: Console, place: str, mode: str, middle: float, end: float) -> None:
    console.say(f'{place}->blend = "{mode}"|; {place} = 10 time:1s & {place} = 6 time:1s,', 0.001)
    assert console.samples(place, 0.51, 1.1) == [pytest.approx(middle, abs=0.2), end]


def test_movements_in_a_queue(console: Console) -> None:
    console.say('o.x->blend = "queue"|; { o.x = 10 time:1s & o.x = 6 time:1s & o.x = 0 time:1s },', 0.001)
    values = console.samples("o.x", 0.51, 1.02, 1.51, 2.03, 3.1)
    assert values == pytest.approx([5, 10, 8, 6, 0], abs=0.25)


def test_a_stopped_movement_makes_room(console: Console) -> None:
    console.say('o.x->blend = "queue"|; var t = Tag.new|; t: o.x = 10 time:10s, o.x = 1 time:0.1s,', 0.5)
    assert console.samples("o.x", 1.0)[0] < 2
    console.say("t.stop;", 1.001)
    assert console.samples("o.x", 1.3) == [1.0]


def test_a_movement_ended_by_a_later_one_says_nothing(console: Console) -> None:
    said = console.say('o.x->blend = "cancel"|; { o.x = 10 time:1s | echo("over") },', 0.1)
    said += console.say("o.x = 1 time:0.1s;", 1.5)
    assert said == ["*** over"]
    assert console.say("o.x;", 1.6) == ["1"]


def test_assignments_of_a_round_are_applied_as_one(console: Console) -> None:
    console.say('m.val->blend = "mix"|; { m.val = 1 & m.val = 2 & m.val = 6 };')
    assert console.motor.told == [3.0]
    console.say('m.val->blend = "add"|; { m.val = 1 & m.val = 2 & m.val = 6 };')
    assert console.motor.told == [3.0, 9.0]
    console.say('m.val->blend = "normal"|; { m.val = 1 & m.val = 2 };')
    assert console.motor.told == [3.0, 9.0, 1.0, 2.0]


def test_assignments_during_a_movement(console: Console) -> None:
    console.say('m.val->blend = "discard"|; m.val = 10 time:1s,', 0.5)
    console.say("m.val = 100;", 0.501)
    assert max(console.motor.told) < 6
    console.say('m.val->blend = "cancel"|; m.val = -1;', 1.2)
    assert console.samples("m.val", 1.3) == [-1.0]
    console.say('m.val->blend = "queue"|; m.val = 10 time:1s, m.val = 5;', 1.8)
    assert console.samples("m.val", 2.5) == [5.0]
    assert console.motor.told[-2:] == [10.0, 5.0]


def test_other_modes_are_stored_and_mean_normal(console: Console) -> None:
    assert console.say('m.val->blend = 3; m.val = 4; m.val;') == ["3", "4", "4"]
    assert console.say('m.val->blend = "mix"; m.val = "text"; m.val;') == ['"mix"', '"text"', '"text"']


def test_a_wave_of_a_device_that_is_lost_goes_on_within_its_speed(console: Console) -> None:
    console.say("o.x->speedmax = 2| o.x = nan|;")
    assert console.say("o.x = 0 sin:1s ampli:1,", 0.5) == []
    values = console.samples("o.x", *(0.02 * n for n in range(30)))
    assert max(abs(b - a) for a, b in zip(values, values[1:], strict=False)) <= 0.04 + 1e-6


@pytest.mark.parametrize("movement", ["time:2s", "speed:5", "time:2s adaptive:true", "speed:5 adaptive:true"])
def test_a_movement_under_way_follows_the_period(console: Console, movement: str) -> None:
    console.say(f"System.period = 10ms| m.val = 10 {movement},", 0.995)
    first = len(console.motor.told)
    console.say("System.period = 100ms;", 3.0)
    assert first == pytest.approx(100, abs=2)
    assert len(console.motor.told) - first == pytest.approx(11, abs=1)
    assert console.motor.told[-1] == 10
    steps = [after - before for before, after in itertools.pairwise(console.motor.told)]
    assert max(steps[: first - 1]) == pytest.approx(0.05)
    assert max(steps[first + 1 :]) == pytest.approx(0.5)
