"""What device code may do: variables of others, data flow, threads, timers, hubs, statistics, binaries, modules."""

from __future__ import annotations

import logging
from typing import Any

import pytest
from uobject_console import Console

from urbihw.kernel.uobject import (
    UBinary,
    UImage,
    UObject,
    UObjectHub,
    USound,
    UVar,
    event,
    function,
    owned,
    variable,
)

# ---------------------------------------------------------------- variables


class Source(UObject):
    out = variable(0.0)
    level = owned(0.0)
    fired = event()


class Chain(UObject):
    """Takes its input from another's variable, and gives twice of it."""

    out = variable(0.0)

    def init(self, source: UVar) -> None:
        self.notify_change(source, self.changed)

    def changed(self, value: float) -> None:
        self.out.value = 2 * value


def test_values_flow_through_a_chain_at_once() -> None:
    console = Console(Source, Chain)
    console.say('var s = Source.new|; var a = Chain.new(s.getSlot("out"))|; var b = Chain.new(a.getSlot("out"))|;')
    assert console.say("s.out = 3| a.out | b.out;") == ["12"]
    assert console.say('var c = Chain.new(b.__uobjectName + ".out")|; s.out = 1| c.out;') == ["8"]
    assert console.say("Chain.new(1);")[0].endswith("new: unexpected 1 for argument 1, expected an UVar")
    assert console.say('Chain.new("no.body");')[0].endswith("there is no object no")


class Typed(UObject):
    """Callbacks with every kind of argument."""

    x = variable(0.0)

    def init(self) -> None:
        self.seen: list[Any] = []
        self.notify_change(self.x, self.none)
        self.notify_change(self.x, self.itself)
        self.notify_change(self.x, self.any)
        self.notify_change(self.x, self.number)

    def none(self) -> None:
        self.seen.append("none")

    def itself(self, x: UVar) -> None:
        self.seen.append(x is self.x)

    def any(self, x: Any) -> None:
        self.seen.append(x is self.x)

    def number(self, x: int) -> None:
        self.seen.append(x)


def test_callbacks_take_nothing_the_variable_or_its_value(caplog: pytest.LogCaptureFixture) -> None:
    console = Console()
    typed = console.host.create(Typed, "typed")
    console.say("typed.x = 3;")
    assert typed.seen == ["none", True, True, 3]
    with caplog.at_level(logging.ERROR, "urbihw.uobject"):
        assert console.say('typed.x = "a";') == ['"a"']
    assert "callback on x removed because it failed: 1.13-19: updateSlot: unexpected" in caplog.text
    typed.seen.clear()
    console.say("typed.x = 4;")
    assert typed.seen == ["none", True, True]


def test_a_callback_that_fails_may_stay(caplog: pytest.LogCaptureFixture) -> None:
    console = Console()
    typed = console.host.create(Typed, "typed")
    typed.x.remove_throwing = False
    with caplog.at_level(logging.CRITICAL, "urbihw.uobject"):
        console.say('typed.x = "a";')
    console.say("typed.x = 5;")
    assert typed.seen[-1] == 5


def test_unnotify_forgets_one_or_all() -> None:
    console = Console()
    typed = console.host.create(Typed, "typed")
    typed.x.unnotify(typed.none)
    console.say("typed.x = 1;")
    assert typed.seen == [True, True, 1]
    typed.x.unnotify()
    console.say("typed.x = 2;")
    assert typed.seen == [True, True, 1]


def test_variables_of_others_are_read_and_written_as_urbiscript_does() -> None:
    console = Console()
    source, other = console.host.create(Source, "source"), console.host.create(Typed)
    console.say("var Global.plain = Object.new|; var plain.v = 4|;")
    level = other.var("source.level")
    source.level.sense(0.25)
    level.set(7.0)
    console.say("")
    assert (source.level.value, level.get()) == (7.0, 0.25)
    plain = other.var("plain.v")
    heard: list[float] = []
    other.notify_change("plain.v", lambda v: heard.append(v.get()))
    plain.set(5.0)
    assert console.say("plain.v; plain.v = 6;") == ["5", "6"]
    assert heard == [5.0, 6.0]
    with pytest.raises(ValueError, match=r"there is no object nobody"):
        other.var("nobody.v")


def test_copy_properties_and_changed() -> None:
    console = Console()
    console.host.create(Source, "source")
    console.say('var Global.alias = Object.new|; source.getSlot("out").copy(alias, "o")|;')
    assert console.say("source.out = 2; alias.o;") == ["2", "2"]
    assert console.say('at (source.out->changed?) echo("new"); source.out = 3; alias.o = 4;') == [
        "3", "*** new", "4", "*** new",
    ]
    console.say("source.out->rangemax = 10; source.out = 12;")
    assert console.say("source.out->rangemax; source.out; alias.o;") == ["10", "10", "10"]


def test_the_changed_event_may_be_switched_off() -> None:
    console = Console()
    assert console.say("UVar.hookChanged; UVar.hookChanged = false; UVar.hookChanged;") == ["true", "false", "false"]
    console.host.create(Source, "source")
    assert console.say('at (source.out->changed?) echo("new"); source.out = 3;') == ["3"]


def test_a_slot_in_zero_copy_mode_is_read_from_callbacks_only() -> None:
    console = Console()
    source = console.host.create(Source, "source")
    source.out.set_bypass()
    pixels = bytearray(b"abcdef")
    seen: list[bytes] = []

    def look(image: UImage) -> None:
        assert isinstance(image.data, bytearray) and image.data is pixels
        seen.append(bytes(image.data))

    other = console.host.create(Typed)
    other.notify_change(source.out, look)
    source.out.value = UImage.of(pixels, 2, 1)
    console.say("")
    assert seen == [b"abcdef"]
    assert console.say("source.out.isNil;") == ["true"]
    source.out.set_bypass(False)
    source.out.value = UImage(pixels, "rgb 2 1")
    pixels[0] = 0
    console.say("")
    assert source.out.value.data == b"abcdef"


# ---------------------------------------------------------------- binaries


def test_headers_of_binaries() -> None:
    image = UImage.of(bytes(12), 2, 2)
    assert (image.keywords, image.width, image.height, image.format, len(image)) == ("rgb 2 2", 2, 2, "rgb", 12)
    sound = USound.of(bytes(64), channels=2, rate=8000, bits=16)
    assert sound.keywords == "raw 2 8000 16 1"
    assert (sound.channels, sound.rate, sound.bits, sound.signed, sound.duration) == (2, 8000, 16, True, 0.002)
    assert not USound.of(b"ab", bits=8, signed=False).signed
    with pytest.raises(ValueError, match="an rgb image of 2 by 2 has 12 bytes, not 11"):
        UImage.of(bytes(11), 2, 2)
    with pytest.raises(ValueError, match="an image cannot be -1 by 2"):
        UImage.of(b"", -1, 2)
    with pytest.raises(ValueError, match="3 bytes are no whole number of samples of 2 bytes"):
        USound.of(b"abc")
    with pytest.raises(ValueError, match="a sound cannot have 0 channels"):
        USound.of(b"", channels=0)
    with pytest.raises(ValueError, match="one line without semicolons"):
        UBinary(b"", "a\nb")


class Eye(UObject):
    val = variable()

    @function
    def size(self, image: UImage) -> list[int]:
        return [image.width, image.height, len(image)]

    @function
    def invert(self, data: bytes) -> UBinary:
        return UBinary(bytes(255 - one for one in data), "inverted")


def test_binaries_go_both_ways() -> None:
    console = Console()
    eye = console.host.create(Eye, "eye")
    assert console.say('eye.size(Binary.new("rgb 2 1", "abcdef"));') == ["[2, 1, 6]"]
    assert console.say('eye.size(Binary.new("raw 1 1 8 1", "a"));')[0].endswith("expected a Binary with an image")
    assert console.say('eye.invert("\\xff\\x00").keywords; eye.invert("\\xfe").data;') == ['"inverted"', '"\\x01"']
    console.say('eye.val = Binary.new("wav 1 8000 8 2", "xy");')
    assert eye.val.value == USound(b"xy", "wav 1 8000 8 2")


# ---------------------------------------------------------------- timers and hubs


class Clockwork(UObject):
    log: list[str] = []

    def init(self, name: str) -> None:
        self.label = name
        self.register(Gears)
        self.handle = self.set_timer(0.1, lambda: self.log.append(f"{name} timer"))
        self.set_update(0.1)

    def update(self) -> None:
        self.log.append(f"{self.label} update")


class Gears(UObjectHub):
    def init(self) -> None:
        self.set_update(0.1)

    def update(self) -> None:
        Clockwork.log.append(f"hub of {len(self.members)}")


def test_timers_come_before_a_pass_updates_after_it_and_the_hub_last() -> None:
    Clockwork.log.clear()
    console = Console(Gears, Clockwork)
    clockwork = [console.host.create(Clockwork, name, name) for name in ("x", "y")]
    clockwork[0].bind_function(lambda: Clockwork.log.append("pass"), "mark")
    console.host.put("x", clockwork[0])
    console.say("sleep(100ms) | x.mark;", 0.05)
    console.say("", 0.15)
    assert Clockwork.log == ["x timer", "y timer", "pass", "x update", "y update", "hub of 2"]
    clockwork[0].remove_timer(clockwork[0].handle)
    clockwork[1].set_update(-1)
    Clockwork.log.clear()
    console.say("", 0.25)
    assert Clockwork.log == ["y timer", "x update", "hub of 2"]
    clockwork[0].destroy()
    Clockwork.log.clear()
    console.say("", 0.35)
    assert Clockwork.log == ["y timer", "hub of 1"]


def test_a_timer_that_fails_is_reported_and_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    console = Console()
    typed = console.host.create(Typed)
    typed.set_timer(0.1, lambda: 1 / 0)
    with caplog.at_level(logging.ERROR, "urbihw.uobject"):
        console.say("", 0.25)
    assert caplog.text.count("timer of Typed failed: ZeroDivisionError") == 2
    typed.destroy()


# ---------------------------------------------------------------- life


class Tool(UObject):
    @function
    def add(self, a: int) -> float:
        return a + 1.0


class Failing(UObject):
    val = variable(0.0)

    def init(self, how: float) -> float:
        if how == 1:
            raise ValueError("will not")
        return how


def test_a_construction_that_fails_leaves_nothing() -> None:
    console = Console(Failing)
    assert console.say("Failing.new(1);")[0].endswith("new: will not")
    assert console.say("Failing.new(3);")[0].endswith("new: Failing construction failed: init returned 3.")
    assert console.say("Failing.new;")[0].endswith("new: expected 1 argument, given 0")
    assert console.say('uobjects.localSlotNames.filter(closure(n) { n.hasSlot("size") && n[0] == "o" });') == ["[]"]
    assert console.say("var f = Failing.new(0)|; uobjects.hasSlot(f.__uobjectName);") == ["true"]
    assert console.say("f.destroy; uobjects.hasSlot(f.__uobjectName); f.destroy;") == ["false"]


def test_a_destroyed_device_hears_no_more_of_others() -> None:
    console = Console(Source, Chain)
    console.say('var s = Source.new|; var c = Chain.new(s.getSlot("out"))|; s.out = 1; c.destroy; s.out = 2;')
    assert console.say("c.out;") == ["2"]


def test_sending_urbiscript_and_calling(caplog: pytest.LogCaptureFixture) -> None:
    console = Console()
    tool = console.host.create(Tool, "tool")
    tool.send("var Global.sent = 1;")
    console.say("")
    tool.call("Global", "setSlot", "called", [1, "two"])
    assert console.say("sent; called;") == ["1", '[1, "two"]']
    with caplog.at_level(logging.ERROR, "urbihw.uobject"):
        tool.send("nonsense +;")
        tool.send("nobody;")
        tool.call("nobody", "home")
        console.say("")
    assert "urbiscript sent by Tool: Tool:1.11: syntax error" in caplog.text
    assert "lookup failed: nobody" in caplog.text and "call of nobody.home failed" in caplog.text


def test_events_are_heard() -> None:
    console = Console()
    source, tool = console.host.create(Source, "source"), console.host.create(Tool)
    heard: list[Any] = []
    tool.at_event(source.fired, lambda *what: heard.append(what), lambda *what: heard.append("over"))
    tool.at_event("source.fired", lambda x: heard.append(x))
    console.say("source.fired!(1);")
    assert heard == [(1.0,), 1.0, "over"]
    tool.destroy()
    console.say("source.fired!(2);")
    assert len(heard) == 3


def test_statistics() -> None:
    console = Console()
    tool = console.host.create(Tool, "tool")
    typed = console.host.create(Typed, "typed")
    console.say("tool.add(1); uobjects.enableStats(true); for (3) tool.add(1)|; typed.x = 1;")
    typed.set_timer(0.1, lambda: None)
    console.say("", 0.15)
    stats = console.host.registry.stats.get()
    assert stats["Tool.add"][3] == 3 and stats["Typed.none"][3] == 1 and stats["timer of Typed"][3] == 1
    assert console.say('uobjects.getStats["Tool.add"].size; uobjects.getStats["Tool.add"][3];', 0.16) == ["4", "3"]
    assert console.say("uobjects.clearStats; uobjects.getStats;", 0.17) == ["[ => ]"]
    console.say("uobjects.enableStats(false); tool.add(1);", 0.18)
    assert "Tool.add" not in console.host.registry.stats.get()
    tool.destroy()
    typed.destroy()




def test_a_callback_of_a_closed_connection_that_fails_is_told_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    console = Console()
    made = console.kernel.open_lobby()
    code = 'UVar.new(Global, "v")|; Global.getSlot("v").notifyChange(uobjects_handle, closure() { 1 / 0 })|;'
    console.kernel.run_text(made, code)
    made.close()
    with caplog.at_level(logging.ERROR, "urbihw.uobject"):
        assert console.say("Global.v = 1;") == ["1"]
    assert "callback on v removed because it failed: 1." in caplog.text and "/: division by 0" in caplog.text
