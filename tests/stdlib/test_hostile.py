"""Every built-in function of every class, called with too few, too many and the wrong arguments: an urbiscript error or
a value comes back, never a failure of ours, and the kernel goes on."""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from library_samples import SAMPLES

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.runtime.code import Primitive
from urbihw.robot import ROBOT_LIBRARY
from urbihw.robot.sampling import feeds_of
from urbihw.ros.script import ROS_LIBRARY

LEFT_OUT = {
    ("System", "_exit"): "does not return",
    ("Profiling", "new"): "does what it is given as often as it is told; see tests/lang/std/nan.chk",
    ("System", "system"): "runs what it is given in a shell; see tests/e2e/test_outside.py",
}
"""Slots that cannot be called here, and why."""

VALUES = (
    "nil", "void", "true", "0", "1", "-1", "1.5", "nan", "inf", "1e17", "1e300", '""', '"x"', '"\\0"', '"%s%d["', "[]",
    '[1, "x", nil]', '["k" => 1]', "(1, 2)", "function () { 1 }", "closure (a, b) { a }", "Object", "Object.new",
    'Path.new("nowhere")', "Date.epoch", "System", "lobby", 'Exception.new("x")',
)  # fmt: skip
"""What is given as an argument."""

FEW = ("1", '"x"', "[]", "function () { 1 }")
"""What is given where there are many arguments."""

OTHERS = (
    "nil", "1", "true", '"x"', "[]", "function () { 1 }", "Object.new", '["k" => 1]', "(1, 2)", "Event.new", "Float",
)  # fmt: skip
"""What functions of other classes are called on."""

PYTHON = re.compile(r"internal error|Traceback|NoneType|object has no attribute|<class |<built-in|0x[0-9a-f]{9,}>")


class Bench:
    """One kernel, and values made by urbiscript."""

    def __init__(self, name: str) -> None:
        self.kernel = Kernel(fast=True, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))
        self.world = self.kernel.world
        self.lobby: Lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")
        self._make = {text: self._maker(text) for text in {SAMPLES[name], *VALUES, *FEW, *OTHERS}}
        self.name = name

    def _maker(self, text: str) -> Any:
        self.kernel.run_text(self.lobby, f"var lobby.maker = function () {{ {text} }}|;")
        function = self.lobby.slots.pop("maker")
        self.world.flush()
        return function

    def make(self, text: str) -> Any:
        """A fresh value; must be called in a job."""
        return self.world.invoke(self._make[text], self.lobby)

    def functions(self) -> dict[str, Primitive]:
        """The built-in functions of the class."""
        holder: Any = self.world.global_
        for part in self.name.split("."):
            holder = holder.slots[part]
        slots = self.world.peek_obj(holder).slots
        found = {name: value for name, value in slots.items() if isinstance(value, Primitive)}
        return {name: value for name, value in found.items() if (self.name, name) not in LEFT_OUT}

    def call(self, function: Primitive, this: str, given: tuple[str, ...]) -> str:
        """Call a function on a fresh object; the error in words, or nothing, and what was said."""
        words = [""]
        made: list[Any] = []

        def run() -> None:
            try:
                made.append(self.make(this))
                args = tuple(self.make(text) for text in given)
                self.world.text(self.world.invoke(function, made[0], args, "called"))
            except Exception as error:
                words[0] = "\n".join(self.world.describe(error))

        scheduler = self.kernel.scheduler
        job = scheduler.spawn(run, "hostile", context=self.lobby)
        scheduler.run_simulated(self.kernel.clock.now() + 100)
        if not job.done:  # it waits for what will not come
            scheduler.kill(job)
            scheduler.run_simulated(self.kernel.clock.now() + 1)
        assert made, f"{this} failed: {words[0]}"
        if isinstance(made[0], Lobby) and made[0] is not self.lobby:
            made[0].close()
        for feed in feeds_of(self.lobby):  # it would go on for ever
            feed.close()
        return words[0] + self.lobby.output.take_bytes().decode("latin-1")


def arguments(function: Primitive) -> Iterator[tuple[str, ...]]:
    """One too few and one too many; as many as are wanted, each place with every value."""
    least, most = function.least, function.most if function.most >= 0 else function.least + 1
    if least:
        yield ("1",) * (least - 1)
    yield ("1",) * (most + 1)
    for size in range(least, most + 1):
        if size == 0:
            yield ()
        for place in range(size):
            for value, usual in itertools.product(VALUES, FEW if size > 1 else FEW[:1]):
                yield (*(usual,) * place, value, *(usual,) * (size - place - 1))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """A folder to write to, variables of the environment to change, and a look at the log."""
    monkeypatch.chdir(tmp_path)
    for variable in ("x", "k"):
        monkeypatch.setenv(variable, "set back when the test is over")
    caplog.set_level(logging.WARNING)


def failures(bench: Bench, calls: Iterable[tuple[str, Primitive, str, tuple[str, ...]]],
             caplog: pytest.LogCaptureFixture) -> list[str]:
    """What a client was told of our own doing, or the log, for each of these calls."""
    wrong = []
    for slot, function, this, given in calls:
        said = bench.call(function, this, given)
        logged = [record.getMessage() for record in caplog.records if record.name.startswith("urbihw")]
        caplog.clear()
        if logged or PYTHON.search(said):
            wrong.append(f"({this}).{slot}({', '.join(given)}): {said} {logged}")
    assert bench.kernel.run_text(bench.lobby, "40 + 2;").endswith("] 42\n")
    assert bench.kernel.run_text(bench.other, "40 + 2;").endswith("] 42\n")
    return wrong


def hostile_calls(bench: Bench) -> Iterator[tuple[str, Primitive, str, tuple[str, ...]]]:
    """Every function with wrong arguments, and on what it is not for."""
    for slot, function in bench.functions().items():
        for given in arguments(function):
            yield slot, function, SAMPLES[bench.name], given
        for this, usual in itertools.product(OTHERS, FEW[: 1 + function.least]):
            yield slot, function, this, (usual,) * function.least


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", SAMPLES)
def test_no_call_brings_out_a_failure_of_ours(name: str, caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(name)
    assert failures(bench, hostile_calls(bench), caplog) == []


def test_what_is_left_out_is_there() -> None:
    kernel = Kernel(fast=True)
    for name, slot in LEFT_OUT:
        holder: Any = kernel.world.global_.slots[name]
        assert slot in holder.slots
