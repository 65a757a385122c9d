"""When the worker makes a step of a simulation: after the kernel, so that a program is the same each time."""

from __future__ import annotations

from typing import Any

from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context
from urbihw.platforms.webots.driver import GRANTED, SIMULATOR, SimulationDriver
from urbihw.platforms.webots.port import SimulationPort
from urbihw.platforms.webots.simulator import Outcome, SimulatedWorld, StepOrder


class Counting:
    """A simulation that notes its steps, with their orders."""

    world = SimulatedWorld("one", "none", 20, (), (), False, "", "", "")

    def __init__(self) -> None:
        self.steps: list[list[str]] = []

    def begin(self, ms: int, orders: list[StepOrder]) -> None:
        """A step."""
        self.steps.append([order.verb for order in orders])

    def poll(self) -> Outcome:
        """It is over at once."""
        return Outcome(0.02 * len(self.steps), {})

    def close(self) -> None:
        """There is nothing to leave."""


class OpenPort(SimulationPort):
    """A port that is open already."""

    def _open(self) -> None:
        """Nothing is left to do."""


class Rig:
    """The driver with a simulated clock."""

    def __init__(self) -> None:
        self.simulation, self.clock, self.driver = Counting(), BusSimClock(0.0), SimulationDriver()
        port: Any = OpenPort.__new__(OpenPort)
        port.simulation, port.clock = self.simulation, self.clock
        self.work = 0.0
        port._context = Context(self.clock, parent_work=lambda: self.work)
        self.driver.attach(port)

    def tick(self, seconds: float = 0.0) -> list[m.FromWorker]:
        """Let time pass, then one tick."""
        self.clock.sleep_until(self.clock.now() + seconds)
        return self.driver.tick(self.clock.now(), lambda: None)

    def grant(self, step: int) -> None:
        """The kernel has handled a step."""
        self.driver.targets(m.Targets({(SIMULATOR, GRANTED): (step,)}, 0, 0.0))

    def ask_mode(self, mode: str) -> None:
        """A program changes the mode."""
        self.driver.request(m.Request(1, "mode", SIMULATOR, value=mode))


def test_the_first_step_waits_for_the_kernel_and_finds_its_orders() -> None:
    rig = Rig()
    rig.tick(0.5)
    assert rig.simulation.steps == []
    rig.driver.watch(m.Watch("camera", ("value",), 0.1), rig.clock.now())
    rig.grant(0)
    rig.tick()
    rig.tick()
    assert rig.simulation.steps == [["enable"]]


def test_each_step_waits_for_the_kernel_but_not_for_ever() -> None:
    rig = Rig()
    assert [each for each in rig.tick(4.9) if isinstance(each, m.DeviceReport)] == []
    assert [each.what for each in rig.tick(0.2) if isinstance(each, m.DeviceReport)] == ["held up"]
    assert len(rig.simulation.steps) == 1
    rig.grant(1)
    rig.tick()
    rig.tick(0.9)
    assert len(rig.simulation.steps) == 2
    rig.tick(0.2)
    assert len(rig.simulation.steps) == 3


def test_in_the_mode_fast_it_waits_as_long_as_the_kernel_waits_for_a_processor() -> None:
    rig = Rig()
    rig.driver.configure(m.Configure(options={"mode": "fast"}))
    rig.grant(0)
    rig.tick()
    assert len(rig.simulation.steps) == 1 and rig.driver.waits_for_parent()
    # A minute on a loaded machine, in which the kernel has had a processor for 0.9 s.
    rig.work = 0.9
    rig.driver.safe_stop()
    assert rig.tick(60) != [] and len(rig.simulation.steps) == 1 and rig.driver.waits_for_parent()
    rig.grant(1)
    rig.tick()
    assert len(rig.simulation.steps) == 2
    # A program that computes for longer does not hold it.
    rig.work = 2.0
    assert [each.what for each in rig.tick(60) if isinstance(each, m.DeviceReport)] == ["held up"]
    assert len(rig.simulation.steps) == 3 and not rig.driver.waits_for_parent()


def test_another_speed_is_no_permission_to_go_on() -> None:
    rig = Rig()
    rig.ask_mode("fast")
    rig.tick()
    assert rig.simulation.steps == []
    rig.ask_mode("pause")
    rig.ask_mode("real")
    rig.tick()
    assert len(rig.simulation.steps) == 1


def test_a_stop_takes_the_place_of_the_orders_that_wait() -> None:
    rig = Rig()
    rig.driver.targets(m.Targets({("left", "velocity"): 3.0, ("right", "velocity"): 3.0}))
    rig.driver.safe_stop(("left",))
    rig.grant(0)
    rig.tick()
    assert rig.simulation.steps == [["write", "write", "stop"]]
