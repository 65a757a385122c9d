"""The kernel does not poll: while conditions wait for variables, slots and events, the kernel sleeps until one of
them changes."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock

HOUR = 3600.0


class CountingClock(SimClock):
    """Counts how often the kernel wanted to be woken."""

    def __init__(self) -> None:
        super().__init__()
        self.wakes: list[float] = []

    def idle(self, deadline: float) -> None:
        """Somebody sleeps until then."""
        self.wakes.append(deadline)
        super().idle(deadline)


class Idle:
    """A kernel with a slot ``x``, a UVar ``o.v`` and an event ``e``."""

    def __init__(self) -> None:
        self.clock = CountingClock()
        self.kernel = Kernel(self.clock)
        self.lobby = self.kernel.open_lobby()
        self.say('var Global.x = 0| var Global.o = Object.new| UVar.new(o, "v")| o.v = 0| var Global.e = Event.new|;')

    def say(self, text: str) -> str:
        """Send a program and run what is ready now; what comes back."""
        self.lobby.feed(text.encode())
        self.kernel.run()
        return self.lobby.output.take_bytes().decode()

    def wakes(self, seconds: float = HOUR) -> list[float]:
        """When the kernel wakes, in so many seconds from now in which nothing comes from outside."""
        self.clock.wakes.clear()
        begin = self.clock.now()
        self.kernel.scheduler.run_simulated(begin + seconds)
        return [wake - begin for wake in self.clock.wakes if wake < begin + seconds]


WAITING = [
    "at (x > 5) echo(1);",
    "at (x > 5 ~ 1s) echo(1);",
    "at (o.v > 5 && x > 1) echo(1);",
    "at (e?(var y) if y > 3) echo(y);",
    "at (e? ~ 1s) echo(1) onleave echo(2);",
    "waituntil (x > 5 || o.v > 5),",
    "waituntil (e?),",
    "whenever (x > 5) echo(1);",
    "whenever (e?) echo(1);",
    "stopif (x > 5) sleep(inf),",
    "freezeif (e?) sleep(inf),",
    "at (o.v->changed?) echo(1);",
    "sleep(inf),",
]


@pytest.mark.parametrize("program", WAITING)
def test_what_waits_for_a_change_does_not_wake_the_kernel(program: str) -> None:
    idle = Idle()
    assert "error" not in idle.say(program)
    assert idle.wakes() == []


def test_the_change_itself_is_seen_at_once() -> None:
    idle = Idle()
    idle.say("at (x > 5) echo(System.time);")
    idle.wakes()
    assert idle.say("x = 6|;").endswith(f"*** {HOUR:g}\n")


def test_the_else_of_a_whenever_goes_on_when_the_event_ends() -> None:
    idle = Idle()
    idle.say("whenever (e?) sleep(inf) else { echo(System.time); sleep(10s) },")
    idle.say("e! ~ 100s,")
    assert idle.wakes(100.5) == [10.0, 100.0]
    assert idle.lobby.output.take_bytes().decode().endswith("*** 100\n")
