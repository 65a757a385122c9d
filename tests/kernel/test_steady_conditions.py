"""Conditions that record what they read only when that may differ from the last time."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.watch import ConditionWatch, Recorder
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, owned, variable


class Console:
    """A kernel and a lobby in simulated time, which count how often a condition records what it reads."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        self.recorded = 0
        begin = Recorder.begin

        def counted(recorder: Recorder, watch: ConditionWatch) -> ConditionWatch | None:
            self.recorded += 1
            return begin(recorder, watch)

        monkeypatch.setattr(Recorder, "begin", counted)

    def say(self, text: str) -> list[str]:
        """The lines of the answer, without time stamps."""
        said = self.kernel.run_text(self.lobby, text)
        return [line.partition("] ")[2] for line in said.splitlines()]

    def records(self, text: str) -> int:
        """How often conditions record what they read while a program runs, which answers nothing."""
        self.recorded = 0
        assert self.say(text) == []
        return self.recorded


class Sonar(UObject):
    """A measured value, and a wanted one."""

    val = owned(0.0)
    rate = variable(0.0)


WATCH = 'at ({}) echo("on") onleave echo("off");'


@pytest.fixture
def console(monkeypatch: pytest.MonkeyPatch) -> Console:
    return Console(monkeypatch)


def test_numbers_that_change_are_not_recorded_again(console: Console) -> None:
    console.say("var a = 0|; var o = Object.new|; var o.b = 0|;" + WATCH.format("a + o.b * 2 > 9.abs"))
    assert console.records("a = 1|; o.b = 2|; a = 3|;") == 0
    assert console.say("o.b = 4|;") == ["*** on"]
    assert console.records("o.b = 5|; a = 4|;") == 0
    assert console.say("a = -4|; o.b = 7|;") == ["*** off", "*** on"]


def test_variables_of_a_function_and_of_a_device_count_as_well(console: Console) -> None:
    console.say("{ var k = 0; " + WATCH.format("k > 2") + "; function Global.setK(x) { k = x } };")
    assert console.records("setK(1)|; setK(2)|;") == 0
    assert console.say("setK(3)|; setK(0)|;") == ["*** on", "*** off"]
    sonar = console.kernel.host.create(Sonar, "sonar")
    console.say(WATCH.format("sonar.val < sonar.rate"))
    sonar.val.sense(2.0)
    assert console.records("sonar.rate = 1|;") == 0
    assert console.say("sonar.rate = 3|;") == ["*** on"]
    sonar.val.sense(4.0)
    assert console.say("") == ["*** off"]


@pytest.mark.parametrize(
    ("before", "condition", "changes", "answer"),
    [
        # another object in the way
        ("var o = Object.new|; var o.v = 0|; var p = o.clone|; p.v = 1|;", "o.v > 5",
         "o.v = 1|; o = p|; o.v = 7|;", ["*** on"]),
        # a number becomes a function that reads something else
        ("var x = 0|; var y = 0|;", "x > 5", "x = 1|; x = function() { y }|; y = 6|; y = 0|;", ["*** on", "*** off"]),
        # a function that reads something else each time
        ("var x = 0|; var y = 0|; function f() { if (x == 1) y else 0 }|;", "f > 5",
         "x = 2|; x = 1|; y = 6|;", ["*** on"]),
        # the other side of a choice
        ("var x = 0|; var y = 0|;", "x > 5 && y > 5",
         "y = 6|; x = 6|; y = 0|; y = 7|;", ["*** on", "*** off", "*** on"]),
        # an inherited number becomes an own one
        ("class A { var v = 0 }|; var a = A.new|;", "a.v > 5", "A.v = 1|; a.v = 2|; A.v = 9|; a.v = 8|;", ["*** on"]),
        # a slot that goes and comes back
        ("class A { var v = 0 }|; var a = A.new|; var a.v = 1|;", "a.v > 5",
         "a.v = 2|; a.removeSlot(\"v\")|; A.v = 9|;", ["*** on"]),
        # the members of a list, and a number in its place
        ("var l = [1]|;", "l.size > 1", "l << 2|; l = [1]|; l << 3|;", ["*** on", "*** off", "*** on"]),
        # an operator of an object
        ("class N { var v = 0; function '>'(x) { v > x } }|; var n = N.new|; var k = 5|;", "n > k",
         "k = 4|; n.v = 6|; k = 8|;", ["*** on", "*** off"]),
        # a condition that writes what another one reads
        ("var x = 0|; var y = 0|; function g() { y = x; x }|; at (y > 3) echo(\"y\")|;", "g > 3",
         "x = 2|; x = 4|;", ["*** y", "*** on"]),
    ],
)  # fmt: skip
def test_what_a_condition_reads_is_recorded_when_the_way_is_another(
    console: Console, before: str, condition: str, changes: str, answer: list[str]
) -> None:
    console.say(before + WATCH.format(condition))
    assert console.say(changes) == answer


def test_an_error_of_a_steady_condition_is_reported_once(console: Console) -> None:
    console.say("var x = 1|; var y = 2|;" + WATCH.format("y / x > 5"))
    assert console.records("x = 2|;") == 0
    assert ["division by 0" in line for line in console.say("x = 0|;")] == [True, False]  # and where it was called
    assert console.say("x = 0.1|;") == ["*** on"]
