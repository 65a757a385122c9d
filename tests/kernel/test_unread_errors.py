"""Caught errors whose message, location and backtrace are made when they are read, as they were at the throw."""

from __future__ import annotations

import gc
import weakref

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.compiler.linemap import LineMap, MappedCall
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.clock import SimClock

LOOKUP = """
    function fail(o) { o.hieght }|;
    function Global.caught(o) { try { fail(o) } catch (var e) { e } }|;
    """


class Console:
    """A kernel and a lobby in simulated time."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()

    def say(self, text: str) -> list[str]:
        """The lines of the answer, without time stamps."""
        said = self.kernel.run_text(self.lobby, text)
        return [line.partition("] ")[2] for line in said.splitlines()]


def test_an_error_that_nobody_reads_is_not_described(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_up: list[int] = []
    frames = LineMap.frames

    def counted(self: LineMap, index: int, bounces: bool = False) -> list[MappedCall]:
        looked_up.append(index)
        return frames(self, index, bounces)

    monkeypatch.setattr(LineMap, "frames", counted)
    console = Console()
    console.say(LOOKUP + "var e = caught(1)|; try { 1 / 0 } catch {}; try { throw Exception.new(3) } catch (var e) {};")
    assert not looked_up
    assert console.say("e.location; e.backtrace;") == ["2.24-31", "[3.39-45: fail, 4.13-21: caught]"]
    assert looked_up


def test_the_place_of_an_error_is_that_of_the_throw() -> None:
    console = Console()
    text = """
        function thrower { throw Exception.new("mine") }|;
        var e = 0|;
        try { thrower } catch (var x) { e = x }|;
        """
    console.say(text)
    assert console.say("e.location; e.backtrace;") == ["2.28-54", "[4.15-21: thrower]"]
    console.say("var d = nil|; try { try { [1, 2].insert(1) } catch (7) {} } catch (var x) { d = x }|;")
    assert console.say("d.routine; d.message; d.localSlotNames;") == [
        '"insert"',
        '"expected 2 arguments, given 1"',
        '["backtrace", "effective", "location", "max", "message", "min", "routine"]',
    ]


def test_a_suggestion_has_the_names_of_the_throw() -> None:
    console = Console()
    console.say(LOOKUP + "var o = Object.new|; var o.height = 1|; var p = Object.new|;")
    console.say("var e = caught(o)|; o.removeSlot(\"height\")|; var f = caught(p)|; var p.height = 2|;")
    console.say("var g = caught(2)|; var Object.height = 3|;")
    assert console.say("[e.message, f.message, g.message];") == [
        '["lookup failed: hieght (possible misspelling of height)", "lookup failed: hieght", "lookup failed: hieght"]'
    ]


def test_an_unread_error_keeps_no_object_and_no_variable_alive(few_objects: None) -> None:
    console = Console()
    world = console.kernel.world
    searched, argument = Obj(world, [world.object]), Obj(world, [world.object])
    console.lobby.slots.update(searched=searched, argument=argument)
    console.say(LOOKUP)
    console.say("var kept = [caught(searched), { var local = argument; try { 1 / 0 } catch (var e) { e } }]|;")
    refs = [weakref.ref(searched), weakref.ref(argument)]
    del searched, argument
    console.lobby.slots.pop("searched"), console.lobby.slots.pop("argument")
    gc.collect()
    assert [ref() for ref in refs] == [None, None]
    assert console.say("kept[0].message;") == ['"lookup failed: hieght"']
    assert console.say("kept[1].message;") == ['"division by 0"']


def test_an_error_that_is_a_prototype_gets_its_place() -> None:
    console = Console()
    console.say("var p = Exception.new(\"base\")|; var c = p.new(\"derived\")|; c.location|;")
    console.say("try { throw p } catch (var e) {};")
    assert console.say("c.location;") == ["1.78-84"]
