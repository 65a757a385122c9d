"""UObject and UVar: both sides of a device."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, event, function, owned, reading, variable


class Lamp(UObject):
    """A lamp that can be dimmed, and gets warm."""

    val = owned(0.0)
    colour = variable("white")
    warmth = reading(20.0)
    broken = event()

    def init(self) -> None:
        self.seen: list[float] = []
        self.ticks = 0
        self.notify_change(self.val, self.dim)
        self.notify_change(self.colour, self.paint)

    def dim(self) -> None:
        if not isinstance(self.val.value, float):
            raise ValueError("a lamp takes a number")
        self.seen.append(self.val.value)

    def paint(self) -> None:
        if self.colour.value == "black":
            raise ValueError("there is no black light")

    @function
    def twin(self) -> Lamp:
        return self

    @function
    def glow(self, level: float) -> float:
        if level > 1:
            raise ValueError("too bright")
        return level * 2

    def update(self) -> None:
        self.ticks += 1


class Bench:
    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        self.lamp = self.kernel.host.create(Lamp, "lamp")

    def say(self, text: str, until: float | None = None) -> list[str]:
        answer = self.kernel.run_text(self.lobby, text, until)
        return [line.partition("] ")[2] for line in answer.splitlines()]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_an_owned_variable_has_a_target_and_a_sensed_value(bench: Bench) -> None:
    assert bench.say("lamp.val = 3; lamp.val;") == ["3", "0"]
    assert bench.lamp.seen == [3.0]
    bench.lamp.val.sense(2.5)
    assert bench.say("lamp.val;") == ["2.5"]
    assert (bench.lamp.val.value, bench.lamp.val.sensed) == (3.0, 2.5)


def test_a_value_the_owner_refuses_is_an_error_and_the_next_one_works(bench: Bench) -> None:
    assert bench.say('lamp.val = "x";')[0].endswith("val: a lamp takes a number")
    assert bench.lamp.val.value == 0.0
    bench.say("lamp.val = 4;")
    assert bench.lamp.seen == [4.0]


def test_a_refused_plain_variable_keeps_its_value(bench: Bench) -> None:
    assert bench.say('lamp.colour = "black"; lamp.colour;')[-1] == '"white"'


def test_a_reading_cannot_be_assigned(bench: Bench) -> None:
    assert bench.say("lamp.warmth = 3;")[0].endswith("warmth: this slot can only be read")
    assert bench.say("lamp.warmth;") == ["20"]


def test_sensing_drives_conditions_and_changed(bench: Bench) -> None:
    bench.say('at (lamp.warmth > 50) echo("hot") onleave echo("cool"); at (lamp.warmth->changed?) echo("new");')
    for value in (40.0, 60.0, 60.0, 30.0):
        bench.lamp.warmth.sense(value)
        bench.kernel.scheduler.run_simulated(0)
    heard = [line.partition("] ")[2] for line in bench.lobby.output.take_bytes().decode().splitlines()]
    assert sorted(heard) == ["*** cool", "*** hot", "*** new", "*** new", "*** new"]


def test_range_properties_clamp(bench: Bench) -> None:
    bench.lamp.val.set_property("rangemax", 1.0)
    bench.say("lamp.val = 7;")
    assert bench.lamp.seen == [1.0]
    assert bench.say("lamp.val->rangemax;") == ["1"]


def test_functions_refuse_in_words_and_give_devices_as_objects(bench: Bench) -> None:
    assert bench.say("lamp.glow(0.5); lamp.twin === lamp;") == ["1", "true"]
    assert bench.say("lamp.glow(2);")[0].endswith("glow: too bright")


def test_events_carry_devices(bench: Bench) -> None:
    bench.say("at (lamp.broken?(var who, var why)) echo(why + (who === lamp).asString);")
    bench.lamp.broken.emit(bench.lamp, "burnt ")
    assert "*** burnt true" in bench.say("")


@pytest.mark.parametrize("condition", ["lamp.val->changed?", "lamp.val > 3"])
def test_a_variable_is_followed_while_somebody_hears_of_its_changes(bench: Bench, condition: str) -> None:
    val = bench.lamp.val
    assert not val.has_subscribers
    bench.say('lamp.val; lamp.val->changed; var Global.follow = Tag.new("follow");')
    assert not val.has_subscribers
    bench.say(f"follow: at ({condition}) 1;")
    assert val.has_subscribers
    bench.say("follow.stop;")
    assert not val.has_subscribers
    callback = val.notify_change(lambda: None)
    assert val.has_subscribers
    val.unnotify(callback)
    assert not val.has_subscribers


def test_update_runs_periodically_until_destroyed(bench: Bench) -> None:
    bench.lamp.set_update(0.1)
    bench.say("1;", 1.05)
    assert bench.lamp.ticks == 10
    bench.lamp.destroy()
    bench.say("1;", 2.0)
    assert bench.lamp.ticks == 10


def test_age_is_that_of_the_last_reading(bench: Bench) -> None:
    bench.lamp.warmth.sense(21.0)
    bench.say("1;", 3.0)
    assert bench.lamp.warmth.age() == pytest.approx(3.0)
    bench.lamp.warmth.dated = lambda: 2.5
    assert bench.lamp.warmth.age() == pytest.approx(0.5)
    bench.lamp.warmth.dated = None
    bench.lamp.warmth.sense(22.0, 1.0)
    assert bench.lamp.warmth.age() == pytest.approx(2.0)


def test_who_hears_of_an_owned_variable_gets_its_sensed_value(bench: Bench) -> None:
    heard: list[float] = []

    def hear(value: float) -> None:
        heard.append(value)

    bench.lamp.val.notify_change(hear)
    bench.say("lamp.val = 5|;")
    heard.clear()
    bench.lamp.val.sense(4.0)
    bench.say("1;")
    assert heard == [4.0]


def test_a_library_says_that_its_job_was_ended(bench: Bench) -> None:
    """Who waits for the end of a library, such as the growth of a tree, would wait for ever."""
    said: list[str] = []
    bench.kernel.host.run("var e = Event.new; waituntil (e?);", "slow.u", said.append)
    bench.say("1;")
    assert said == []
    bench.say("for (var job : Job.jobs) { if (job.name == \"slow.u\") job.terminate };")
    bench.say("1;")
    assert said == ["slow.u: its job was ended"]


def test_a_library_says_where_it_is_wrong(bench: Bench) -> None:
    said: list[str] = []
    bench.kernel.host.run("var Global.x = 1;", "good.u", said.append)
    bench.kernel.host.run("var y = 1;\ny +;\n", "bad.u", said.append)
    bench.kernel.host.run("nobody.home;", "lost.u", said.append)
    bench.kernel.scheduler.run_simulated()
    assert sorted(said) == [
        "",
        "bad.u:2.4: syntax error: unexpected ;",
        "lost.u:1.1-6: lookup failed: nobody",
    ]
