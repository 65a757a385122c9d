"""Who is served first when there is not enough processor time: contexts that have used little lately.

The time is simulated: a turn takes the processor time that the test says.
"""

from __future__ import annotations

from collections.abc import Callable

from urbihw.kernel.sched.accounts import CREDIT_S, Accounts
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.scheduler import MAX_RUN_S, Scheduler

SHORT, LONG = 0.0001, 0.02
HOLD = 0.5
"""Seconds for which a program may hold the interpreter."""


class BusyClock(SimClock):
    """A machine that does nothing but this: time passes by the processor time that turns take."""

    def processor_time(self) -> float:
        """The time by the clock."""
        return self.now()


class World:
    """Clients whose turns take known times, and when each turn ended."""

    def __init__(self) -> None:
        self.clock = BusyClock()
        self.scheduler = Scheduler(self.clock)
        self.turns: list[tuple[str, float]] = []

    def take(self, seconds: float) -> None:
        """The running job works; longer than a run may take, it is interrupted as by the watchdog."""
        self.clock.advance(seconds)
        if seconds > MAX_RUN_S:
            self.scheduler.interrupt()

    def client(self, name: str, turns: int, seconds: float) -> None:
        """A client with some statements, of which each takes a turn."""

        def body() -> None:
            for _ in range(turns):
                self.take(seconds)
                self.turns.append((name, self.clock.now()))
                self.scheduler.yield_()

        self.scheduler.spawn(body, name, name)

    def run(self, until: Callable[[], bool]) -> None:
        while self.scheduler.jobs and not until():
            self.scheduler.run()

    def names(self) -> str:
        return "".join(name for name, _ in self.turns)


def test_short_statements_are_answered_in_a_row_beside_long_ones() -> None:
    """A client that owes nothing is not given one turn for each long turn of another."""
    world = World()
    world.client("L", 1000, LONG)
    world.run(lambda: len(world.turns) == 20)
    world.client("s", 50, SHORT)
    before = len(world.turns)
    world.run(lambda: world.names().count("s") == 50)
    assert len(world.turns) - before <= 50 + 1


def test_clients_that_work_share_the_processor() -> None:
    """By time, not by turns; and the one that slept does not make the other wait for all that it did not use."""
    world = World()
    world.scheduler.spawn(lambda: world.scheduler.sleep(1e6), "sleeps", "m")
    world.client("L", 1000, LONG)
    world.run(lambda: world.clock.now() >= 2)
    world.client("m", 10_000, LONG / 5)
    came = world.clock.now()
    world.run(lambda: world.clock.now() >= came + 2)
    used = {"L": 0.0, "m": 0.0}
    gaps, last = [], came
    for name, when in world.turns:
        if when > came:
            used[name] += LONG if name == "L" else LONG / 5
            if name == "L":
                gaps.append(when - last)
                last = when
    assert abs(used["L"] - used["m"]) <= 2 * CREDIT_S
    assert max(gaps) <= CREDIT_S + 3 * LONG


def test_who_came_before_waits_for_one_hold_of_many_newcomers() -> None:
    """Six connections that hold as long as they may, several times, do not add up for a seventh that asks little."""
    world = World()
    world.scheduler.spawn(lambda: world.scheduler.sleep(1e6), "stays", "q")
    world.client("q", 500, SHORT)
    world.run(lambda: not world.scheduler.ready)
    for name in "abcdef":
        world.client(name, 3, HOLD)
    waits: list[float] = []

    def ask() -> None:
        asked = world.clock.now()

        def answer() -> None:
            world.take(SHORT)
            waits.append(world.clock.now() - asked)

        world.scheduler.spawn(answer, "question", "q")

    while len(world.names()) < 500 + 18:
        ask()
        world.scheduler.run()
        world.clock.advance(0.001)
    assert len(waits) >= 18
    assert max(waits) <= HOLD + 0.05


def test_time_that_nobody_is_charged_for_counts_for_who_was_there() -> None:
    """A server that was not busy has read no clock; who came before is ahead of newcomers when it is."""
    clock = BusyClock()
    accounts = Accounts(clock.processor_time)
    accounts.open("old")
    accounts.open("busy")
    clock.advance(1.0)
    accounts.charge("busy", 0.1)
    accounts.open("new")
    assert accounts.rank("old") < accounts.rank("new")


def test_a_simulated_clock_lets_clients_take_turns() -> None:
    """The order does not depend on the machine: no processor time passes."""
    scheduler, said = Scheduler(SimClock()), []

    def client(name: str) -> None:
        def body() -> None:
            for _ in range(100):
                said.append(name)
                scheduler.interrupt()
                scheduler.yield_()

        scheduler.spawn(body, name, name)

    for name in "abc":
        client(name)
    while scheduler.jobs:
        scheduler.run()
    assert "".join(said) == "abc" * 100
