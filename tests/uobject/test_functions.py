"""Bound functions: what they take, and those that run in threads."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from uobject_console import Console

from urbihw.kernel.uobject import (
    LOCK_CLASS,
    LOCK_FUNCTION,
    LOCK_INSTANCE,
    LOCK_MODULE,
    LOCK_NONE,
    Lock,
    UObject,
    event,
    function,
    threaded,
    variable,
)


class Tool(UObject):
    @function
    def add(self, a: int, b: float = 1.0, *more: float) -> float:
        return a + b + sum(more)

    @function
    def words(self, each: list[str], table: dict[str, float] | None = None) -> str:
        return " ".join(each) + str(table or "")

    @function
    def itself(self, other: Tool) -> bool:
        return other is self

    @function
    def truth(self, value: bool) -> bool:
        return value

    @function
    def broken(self) -> None:
        raise KeyError("oops")

    @function
    def whatever(self, value: Any) -> Any:
        self.got = value
        return value


@pytest.mark.parametrize(("text", "answer"), [
    ("tool.add(1);", "2"),
    ("tool.add(1, 2, 3, 4);", "10"),
    ("tool.add();", "!!! add: expected at least 1 argument, given 0"),
    ("tool.add(1.5);", "!!! add: expected integer, got 1.5"),
    ('tool.add(1, "2");', '!!! add: unexpected "2" for argument 2, expected a Float'),
    ('tool.add(1, 2, "3");', '!!! add: unexpected "3" for argument 3, expected a Float'),
    ('tool.words(["a", "b"]);', '"a b"'),
    ('tool.words(["a", 1]);', '!!! words: unexpected 1 for argument 1, expected a String'),
    ('tool.words("a");', '!!! words: unexpected "a" for argument 1, expected a List'),
    ('tool.words(["a"], ["k" => 1]);', '''"a{'k': 1.0}"'''),
    ('tool.words(["a"], nil);', '"a"'),
    ("tool.itself(tool);", "true"),
    ("tool.itself(tool.__uobjectName);", "true"),
    ("tool.itself(1);", "!!! itself: unexpected 1 for argument 1, expected a Tool"),
    ("tool.truth(0); ", "false"),
    ("tool.broken;", "!!! broken: KeyError: 'oops'"),
    ('tool.whatever([1, "a", ["k" => nil]]);', '[1, "a", ["k" => void]]'),
    ("Tool.add(1);", "!!! add: this is a class: make an instance with new"),
])
def test_arguments_are_checked_and_converted(text: str, answer: str) -> None:
    console = Console(Tool)
    console.host.create(Tool, "tool")
    (said,) = console.say(text)
    head, colon, rest = said.partition(": ")
    assert (f"!!! {rest}" if head.startswith("!!! ") and colon else said) == answer


def test_functions_bound_late() -> None:
    console = Console()
    tool = console.host.create(Tool, "tool")
    tool.bind_function(lambda: 42, "answer")
    tool.bind_function(tool.add, "plus")
    assert console.say("tool.answer; tool.plus(1, 1);") == ["42", "2"]


class Finger(UObject):
    def init(self) -> None:
        self.cells: dict[int, float] = {}

    @function("[]")
    def get(self, index: int) -> float:
        return self.cells[index]

    @function("[]=")
    def put(self, index: int, value: float) -> float:
        self.cells[index] = value
        return value


class Hand(UObject):
    def init(self) -> None:
        self.fingers = [self.host.create(Finger) for _ in range(4)]

    @function("[]")
    def get(self, index: int) -> Finger:
        return self.fingers[index]


def test_assignments_by_index_reach_through_nested_devices() -> None:
    console = Console(Finger, Hand)
    hand = console.host.create(Hand, "finger")
    assert console.say("finger[3][2] = 7; finger[3][2] += 1; finger[3][2]++; finger[3][2];") == ["7", "8", "8", "9"]
    assert hand.fingers[3].cells == {2: 9.0}
    assert hand.fingers[2].cells == {}


# ---------------------------------------------------------------- threads


class Worker(UObject):
    """Tells which of its functions run at the same time."""

    running: list[str] = []
    most: dict[str, int] = {}
    doors: dict[str, threading.Event] = {}

    def work(self, name: str) -> str:
        self.running.append(name)
        for kind in ("a", "b"):
            self.most[kind] = max(self.most.get(kind, 0), sum(1 for one in self.running if one[0] == kind))
        self.most["all"] = max(self.most.get("all", 0), len(self.running))
        time.sleep(0.03)
        self.running.remove(name)
        return name


def worker(lock: Lock) -> type[UObject]:
    class Locked(Worker):
        uname = "Locked"

        @threaded(lock)
        def a(self) -> str:
            return self.work("a")

        @threaded(lock)
        def b(self) -> str:
            return self.work("b")

    Locked.running, Locked.most = [], {}
    return Locked


@pytest.mark.parametrize(("lock", "most"), [
    (LOCK_NONE, {"a": 4, "all": 8}),
    (LOCK_FUNCTION, {"a": 2, "all": 4}),
    (LOCK_INSTANCE, {"all": 2}),
    (LOCK_CLASS, {"all": 1}),
    (LOCK_MODULE, {"all": 1}),
])
def test_lock_modes(lock: Lock, most: dict[str, int]) -> None:
    kind = worker(lock)
    console = Console(kind)
    console.say("var x = Locked.new|; var y = Locked.new|;")
    console.lobby.feed(b"x.a & x.a & x.b & x.b & y.a & y.a & y.b & y.b | 1;")
    assert console.wait(1) == ["1"]
    assert {key: kind.most[key] for key in most} == most  # type: ignore[attr-defined]


def test_a_limit_of_threads() -> None:
    kind = worker(LOCK_NONE)
    console = Console(kind)
    locked = console.host.create(kind, "x")
    locked.set_thread_limit(3)
    console.lobby.feed(b"x.a & x.a & x.a & x.b & x.b & x.b | 1;")
    assert console.wait(1) == ["1"]
    assert kind.most["all"] == 3  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="cannot be limited to 0"):
        locked.set_thread_limit(0)


class Slow(UObject):
    val = variable(0.0)
    done = event()

    @threaded()
    def think(self, door: float) -> float:
        self.val.value = self.val.value + door
        self.done.emit(self.val.value)
        self.notify_change(self.val, lambda: None)
        if door < 0:
            raise ValueError("no such door")
        return float(self.val.value)


def test_others_go_on_while_a_thread_works_and_it_may_use_everything() -> None:
    console = Console(Slow)
    console.say('var s = Slow.new|; at (s.done?(var x)) echo("done %s" % x);')
    console.lobby.feed(b's.think(2), echo("first");')
    assert set(console.wait(2)) == {"*** first", "*** done 2"}
    console.lobby.feed(b"s.think(3);")
    assert set(console.wait(2)) == {"*** done 5", "5"}
    console.lobby.feed(b"s.think(-1);")
    assert console.wait(2)[-1].endswith("think: no such door")


def test_a_job_that_waits_for_a_thread_can_be_stopped() -> None:
    kind = worker(LOCK_CLASS)
    console = Console(kind)
    console.say("var x = Locked.new|; var t = Tag.new|;")
    console.lobby.feed(b't: x.a, t: x.a, t.stop | echo("stopped"); x.b;')
    assert console.wait(2) == ["*** stopped", '"b"']


class Busy(UObject):
    number = variable(0.0)
    words = variable([])
    ping = event()

    def init(self) -> None:
        self.ticks = 0

    def tick(self) -> None:
        self.ticks += 1


def test_everything_may_be_used_from_any_thread() -> None:
    console = Console()
    busy = console.host.create(Busy, "busy")
    console.say("var Global.heard = 0|; at (busy.ping?(var n)) heard++; var Global.sent = 0|;")
    wrong: list[Exception] = []

    def work() -> None:
        try:
            for turn in range(40):
                busy.number.value = float(turn)
                busy.words.value = [turn, "words"]
                assert busy.words.value[1] == "words"
                assert busy.var("busy.number").get() >= 0
                busy.remove_timer(busy.set_timer(1.0, busy.tick))
                busy.ping.emit(turn)
                busy.send("sent++;")
        except Exception as error:
            wrong.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        console.kernel.run()
        time.sleep(0.0005)
    assert wrong == []
    assert console.say("heard; sent; busy.number;") == ["160", "160", "39"]
    assert busy.ticks == 0
