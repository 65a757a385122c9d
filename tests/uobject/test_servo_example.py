"""The servomotor of the manual's chapter 4.1, as it stands in docs/examples, on the simulated clock."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "servo.py"


def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("servo_example", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Motors:
    """Four motors that reach their place at once, but for friction."""

    def __init__(self) -> None:
        self.positions = dict.fromkeys(range(4), 0.0)
        self.orders: list[tuple[int, float]] = []
        self.gains: list[tuple[int, float, float, float]] = []

    def initialize(self, id: int) -> bool:
        return id in self.positions

    def get_position(self, id: int) -> float:
        return self.positions[id]

    def set_position(self, id: int, position: float) -> None:
        self.orders.append((id, position))
        self.positions[id] = position - 0.01

    def set_pid(self, id: int, p: float, i: float, d: float) -> None:
        self.gains.append((id, p, i, d))


class Console:
    def __init__(self) -> None:
        self.motors = Motors()
        self.kernel = Kernel(SimClock())
        servo: Any = example().Servo
        kind: type[UObject] = type("Servo", (servo,), {"hardware": self.motors})
        self.kernel.host.register(kind)
        self.lobby = self.kernel.open_lobby()

    def say(self, text: str, until: float | None = None) -> list[str]:
        answer = self.kernel.run_text(self.lobby, text, until)
        return [line.partition("] ")[2] for line in answer.splitlines()]


@pytest.fixture
def console() -> Console:
    return Console()


def test_it_takes_about_one_screen() -> None:
    code = [line for line in EXAMPLE.read_text().splitlines() if line.strip()]
    assert len(code) <= 60


def test_val_orders_when_written_and_measures_when_read(console: Console) -> None:
    assert console.say("var wrist = Servo.new(3)|; wrist.val = 0.5; wrist.val;") == ["0.5", "0.49"]
    assert console.motors.orders == [(3, 0.5)]


def test_a_trajectory_is_many_small_orders(console: Console) -> None:
    console.say("var wrist = Servo.new(3)|; wrist.val = 1 time:1s;", 2.0)
    positions = [position for _, position in console.motors.orders]
    assert len(positions) == pytest.approx(50, abs=2)
    assert positions == sorted(positions)
    assert positions[-1] == 1.0


def test_gains_one_by_one_and_together(console: Console) -> None:
    console.say("var wrist = Servo.new(2)|; wrist.P = 2; wrist.setPID(3, 1, 0.5);")
    assert console.motors.gains == [(2, 2.0, 0.0, 0.0), (2, 3.0, 1.0, 0.5)]
    assert console.say("wrist.D;") == ["0.5"]


def test_instances_are_independent(console: Console) -> None:
    console.say("var a = Servo.new(1)|; var b = Servo.new(2)|; a.val = 1; b.val = 2;")
    assert console.say("a.val; b.val;") == ["0.99", "1.99"]


def test_what_cannot_be_made_says_why(console: Console) -> None:
    (answer,) = console.say("Servo.new(9);")[:1]
    assert answer.endswith("there is no servomotor 9")
    assert "expected an" in console.say('Servo.new("three");')[0] or "expected a" in console.say('Servo.new("x");')[0]
