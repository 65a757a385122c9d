"""The same work in urbiscript and in plain Python, with the budget of their ratio: rows of ``bench.kernel_bench``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Work:
    """The same work twice: ``urbi`` is the body of a function, ``python`` a function.

    ``before`` is typed first, ``elsewhere`` by another client before that.
    """

    name: str
    urbi: str
    python: Callable[[], object]
    budget: float
    before: str = ""
    elsewhere: str = ""


def fibo(n: float) -> float:
    """The peer of the recursive function."""
    return n if n < 2 else fibo(n - 1) + fibo(n - 2)


def empty_loop() -> None:
    """The peer of ``for| (100000) {}``."""
    for _ in range(100_000):
        pass


def c_loop() -> float:
    """The peer of a C-like for, which Python says as a while."""
    total, i = 0.0, 0.0
    while i < 100_000:
        total += i
        i += 1
    return total


class Box:
    """Has a method that gives a constant, and one that reads a slot."""

    def __init__(self) -> None:
        self.width = 1.0

    def read(self) -> float:
        """The peer of a method that reads a slot."""
        return self.width

    def method(self) -> float:
        """The peer of a method that gives a constant."""
        return 1.0


def call_method() -> None:
    """The peer of 100 000 calls."""
    box = Box()
    for _ in range(100_000):
        box.method()


class Holder:
    """Has a box."""

    def __init__(self) -> None:
        self.box = Box()

    def call(self) -> None:
        """The peer of 100 000 calls through a slot of this."""
        for _ in range(100_000):
            self.box.method()


def call_slot_method() -> None:
    """The peer of calls to an object that is itself looked up by name each time."""
    Holder().call()


def append() -> list[float]:
    """The peer of ``list << 1``."""
    made: list[float] = []
    for _ in range(100_000):
        made.append(1.0)  # one call a turn is what is measured
    return made


def concatenate() -> str:
    """The peer of ``string += "x"``."""
    made = ""
    for _ in range(10_000):
        made += "x"
    return made


def read_slots() -> None:
    """The peer of 100 000 calls of a method that reads a slot."""
    box = Box()
    for _ in range(100_000):
        box.read()


def write_slots() -> None:
    """The peer of 100 000 writes of a slot."""
    box = Box()
    for _ in range(100_000):
        box.width = 2.0


class Made:
    """Takes an argument when it is made."""

    def __init__(self, size: float) -> None:
        self.size = size


def make_objects() -> None:
    """The peer of ``K.new(1)``."""
    for _ in range(10_000):
        Made(1.0)


class Adder:
    """Has a strict method by a name that somebody's lazy function has."""

    def add(self, x: float) -> float:
        """The argument."""
        return x


def call_adder() -> None:
    """The peer of 50 000 calls."""
    adder, i = Adder(), 0.0
    while i < 50_000:
        adder.add(i)
        i += 1


def write_dictionary() -> None:
    """The peer of ``d["a"] = 1``."""
    made: dict[str, float] = {}
    for _ in range(20_000):
        made["a"] = 1.0


def split_and_join() -> None:
    """The peer of ``split`` and ``join``."""
    text = "a,b,c,d,e,f,g,h"
    for _ in range(2000):
        ",".join(text.split(","))


def remainders() -> float:
    """The peer of ``%``."""
    total, i = 0.0, 0.0
    while i < 20_000:
        total += i % 7
        i += 1
    return total


def choose_cases() -> float:
    """The peer of ``switch``."""
    total, i = 0.0, 0.0
    while i < 10_000:
        match i:
            case 1.0:
                total += 1
            case 2.0:
                total += 2
            case _:
                total += 3
        i += 1
    return total


def throw_and_catch() -> None:
    """The peer of ``throw`` and ``catch``."""
    for _ in range(5000):
        try:
            raise ValueError("x")
        except ValueError:
            pass


def catch_division(zero: float = 0.0) -> None:
    """The peer of a caught ``1 / 0``."""
    for _ in range(5000):
        try:
            _ = 1 / zero
        except ZeroDivisionError:
            pass


def catch_lookup() -> None:
    """The peer of a caught failure of a look-up."""
    box = Box()
    for _ in range(1000):
        try:
            box.widht  # type: ignore[attr-defined]  # noqa: B018
        except AttributeError:
            pass


BOX = "class Box { var width = 1; function method() { 1 }; function read() { width } }|;"
C_FOR = "var s = 0; for{} (var i = 0; i < 100000; i += 1) s += i; s"
WORKS = (
    Work("recursive fibo(20)", "fibo(20)", lambda: fibo(20.0), 4,
         "function fibo(n) { if (n < 2) n else fibo(n - 1) + fibo(n - 2) }|;"),
    Work("for| (100000) {}", "for| (100000) {}", empty_loop, 3),
    Work("C-for| with a local sum, 100 000", C_FOR.format("|"), c_loop, 3),
    Work("C-for; with a local sum, 100 000", C_FOR.format(""), c_loop, 6),
    Work("method without arguments, 100 000", "var box = Box.new; for| (100000) box.method()", call_method, 5,
         BOX),
    Work("the same of an object that is a slot, 100 000", "for| (100000) box.method()", call_slot_method, 5,
         BOX + "var box = Box.new|;"),
    Work("method that reads a slot, 100 000", "var box = Box.new; for| (100000) box.read()", read_slots, 5, BOX),
    Work("slot write, 100 000", "var box = Box.new; for| (100000) box.width = 2", write_slots, 10, BOX),
    Work("call by the name of a lazy function, 50 000",
         "var a = A.new; for| (var i = 0; i < 50000; i += 1) a.add(i)", call_adder, 8,
         "function add { call.args.size }|; class A { function add(x) { x } }|;"),
    Work("the same, which another client has defined, 50 000",
         "var a = A.new; for| (var i = 0; i < 50000; i += 1) a.add({ var x = i; x })", call_adder, 5,
         "class A { function add(x) { x } }|;", "function add { call.args.size }|;"),
    Work("K.new(1), 10 000", "for| (10000) K.new(1)", make_objects, 10,
         "class K { var size = 0; function init(x) { size = x } }|;"),
    Work("dictionary write, 20 000", 'var d = [=>]; for| (20000) d["a"] = 1', write_dictionary, 10),
    Work("split and join, 2000", 'for| (2000) "a,b,c,d,e,f,g,h".split(",").join(",")', split_and_join, 10),
    Work("%, 20 000", "var s = 0; for| (var i = 0; i < 20000; i += 1) s += i % 7; s", remainders, 10),
    Work("switch, 10 000",
         "var s = 0; for| (var i = 0; i < 10000; i += 1)"
         " switch (i) { case 1: s += 1; case 2: s += 2; default: s += 3 }",
         choose_cases, 10),
    Work("throw and catch, 5000", "for| (5000) try { throw 1 } catch (var e) {}", throw_and_catch, 10),
    Work("caught 1/0, 5000", "for| (5000) try { 1 / 0 } catch (var e) {}", catch_division, 20),
    Work("caught look-up failure, 1000", "var box = Box.new; for| (1000) try { box.widht } catch (var e) {}",
         catch_lookup, 20, BOX),
    Work("list << 1, 100 000", "var l = []; for| (100000) l << 1; l", append, 6),
    Work('string += "x", 10 000', 'var s = ""; for| (10000) s += "x"; s', concatenate, 6),
)  # fmt: skip
