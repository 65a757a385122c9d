"""Closed-loop movements of a device that comes to what was written to it only after a while."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, owned

STEP_S = 0.01


class LaggingMotor(UObject):
    """Follows what is written 0.1 s later, at 5 units a second at most, and does not move for less than a tenth."""

    val = owned(0.0)

    def init(self) -> None:
        self.place = 0.0
        self.held = False
        self._queue = [0.0] * 10
        self.set_timer(STEP_S, self.follow)

    def follow(self) -> None:
        """Live for one step."""
        self._queue.append(self.val.target)
        way = self._queue.pop(0) - self.place
        if not self.held and abs(way) >= 0.1:
            self.place += max(-5 * STEP_S, min(5 * STEP_S, way))
        self.val.sense(self.place)


class Bench:
    """A kernel with one such motor."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        self.device = self.kernel.host.create(LaggingMotor, "motor")

    def say(self, text: str, until: float | None = None) -> str:
        return self.kernel.run_text(self.lobby, text, until)

    def move(self, movement: str, until: float = 60.0) -> float:
        """How long a movement takes."""
        began = self.kernel.clock.now()
        answer = self.say(f'motor.val = {movement} | echo("over");', began + until)
        assert "over" in answer, "it does not end"
        return int(answer[1:9]) / 1000 - began


@pytest.fixture
def bench() -> Iterator[Bench]:
    yield Bench()


@pytest.mark.parametrize(("movement", "seconds"), [
    ("2 speed:1 adaptive:true", 2.0), ("2 adaptive:1 speed:1", 2.0), ("-3 speed:1.5 adaptive:true", 2.0),
    ("0.5 speed:0.05 adaptive:true", 10.0), ("2 time:2s adaptive:true", 2.0), ("2 adaptive:1 time:3s", 3.0),
])  # fmt: skip
def test_a_device_that_lags_keeps_the_pace(bench: Bench, movement: str, seconds: float) -> None:
    assert bench.move(movement) == pytest.approx(seconds, abs=0.1)
    target = float(movement.split()[0])
    assert bench.device.place == pytest.approx(target, abs=0.4)
    bench.say("", bench.kernel.clock.now() + 0.5)
    assert bench.device.place == pytest.approx(target, abs=0.11)


def test_a_device_that_is_held_is_waited_for(bench: Bench) -> None:
    bench.say('motor.val = 4 speed:1 adaptive:true | echo("over"),', 1.0)
    bench.device.held = True
    bench.say("", 3.0)
    assert bench.device.val.target - bench.device.place < 2.1
    bench.device.held = False
    assert "over" not in bench.say("", 3.9)
    assert "over" in bench.say("", 6.0)
    assert bench.device.place == pytest.approx(4.0, abs=0.2)


def test_a_device_that_does_not_stir_does_not_keep_a_movement_from_its_end(bench: Bench) -> None:
    assert bench.move("0.08 speed:0.04 adaptive:true") < 6
    bench.device.held = True
    assert bench.move("3 speed:1 adaptive:true") < 7


def test_a_device_that_is_pushed_on_is_not_pulled_back(bench: Bench) -> None:
    bench.say("motor.val = 4 speed:1 adaptive:true,", 1.0)
    bench.device.place = 3.0
    bench.say("", 1.2)
    assert bench.device.val.target > 3.0


def test_adaptive_alone_waits_until_the_device_is_there(bench: Bench) -> None:
    assert bench.move("4 adaptive:true") == pytest.approx(0.9, abs=0.6)
    assert bench.device.place == pytest.approx(4.0, abs=0.11)
    bench.device.held = True
    assert bench.move("9 adaptive:true") == pytest.approx(0.5, abs=0.1)
