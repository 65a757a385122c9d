"""The driver in the worker: it owns the simulation, and lets it go on one step per tick.

The programs follow the time of the simulation: after each step the kernel gets the samples, runs all that is due, and
answers with the target GRANTED, the number of that step; only then comes the next one.  So a program runs the same
way each time.  A kernel that does not answer for PATIENCE_S does not hold the simulation: it goes on in real time, and
the kernel gets ``HELD_UP``; the dead-man time of the worker then stops the robot as on a real wire.  In the mode "fast"
these are seconds of the kernel's processor time: on a loaded machine it may wait for its turn as long as it has to, and
simulated time stands still meanwhile.

Devices: the names of the simulated robot's, ``NODES`` + a name for what a supervisor moves, and SIMULATOR for the rest.
Targets: "position", "velocity" and "torque" of motors, in rad, rad/s and N m (m, m/s and N of a linear one); the worker
limits them.  Requests: "write" to another device or a node; "label", "reset physics", "revert", "quit" and
"mode" of SIMULATOR; "read" of the last sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.buses.clock import BusClock, BusRealClock
from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.buses.link import Port
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    Found,
    FromWorker,
    Reply,
    Request,
    Samples,
    Watch,
)
from urbihw.buses.readings import Quantity
from urbihw.platforms.webots.model_check import TIMEOUT_S
from urbihw.platforms.webots.options import FAST, WebotsOptions
from urbihw.platforms.webots.port import Simulation, SimulationPort
from urbihw.platforms.webots.simulator import CAMERA, MOTOR, NODES, Outcome, StepOrder

SIMULATOR: Final = "simulator"
GRANTED: Final = "granted"
"""The target of SIMULATOR with the number of the step that the kernel has handled, as (number,).  A target and no
request: those are executed after the tick."""
HELD_UP: Final = "held up"
PROBLEM: Final = "problem"
PATIENCE_S: Final = 1.0
"""Seconds for the kernel's answer, after which the simulation goes on without it: of real time, or of work."""
FIRST_PATIENCE_S: Final = 5.0
"""The same before the first step, when the kernel makes the objects of the devices."""
RENDERER_S: Final = 3.0
"""Seconds that a simulator may need until the first picture of a camera."""
RELOAD_S: Final = TIMEOUT_S + 1.0
"""Seconds in which the model of a world is tried before it is loaded again."""
STOP_PATIENCE_S: Final = 0.1
"""The same once the robot is stopped."""
ALIVE_PERIOD_S: Final = 0.2
"""Seconds between two samples without a step, for a kernel whose time stands still."""
_TARGETS: Final = ("position", "velocity", "torque")


class SimulationDriver(Driver):
    """Drives one simulation; ``urbihw.buses.driver.Driver`` describes when each method is called."""

    exclusive = frozenset(_TARGETS)
    quantities = {
        "position": Quantity("position", "rad"), "velocity": Quantity("speed", "rad/s"),
        "torque": Quantity("torque", "N m"),
    }  # fmt: skip

    def __init__(self) -> None:
        self._simulation: Simulation | None = None
        self._clock: BusClock = BusRealClock()
        self._options = WebotsOptions()
        self._orders: list[StepOrder] = []
        self._watches: dict[str, float] = {}
        self._motors: dict[str, tuple[float, float, float]] = {}
        self._last: dict[str, Any] = {}
        self._moved: dict[str, None] = {}
        self._kinds: frozenset[str] = frozenset()
        self._cameras: frozenset[str] = frozenset()
        self._port: Port | None = None
        self._steps = self._granted = 0
        self._stepping = False
        self._paused = False
        self._told_at = self._stepped_at = 0.0
        self._parent_work: Callable[[], float | None] = lambda: None
        self._work_at_step: float | None = None
        self._held_up = False
        self._held_ups = 0
        self._time = 0.0

    # ---------------------------------------------------------------- the link

    def configure(self, settings: Configure) -> None:
        """Apply the settings.  Raises BadSetting for an option."""
        options = WebotsOptions.of(settings.options)
        self._paused = options.mode == "pause"
        self._options = options

    def attach(self, port: Port) -> list[FromWorker]:
        """Tell what is in the world, and begin to sample what is watched.  Raises BadUrl."""
        if not isinstance(port, SimulationPort):
            raise BadUrl(f"{port.url.text} is no simulation: write mujoco:///PATH, ipc://PORT, tcp://ADDRESS:PORT")
        self._simulation, self._clock = port.simulation, port.clock
        motors = [each.name for each in port.simulation.world.devices if each.kind == MOTOR]
        # A robot of Webots may be turning still: its last controller has died.
        self._orders = [StepOrder("stop", name) for name in motors]
        self._kinds = frozenset(motors)
        self._cameras = frozenset(each.name for each in port.simulation.world.devices if each.kind == CAMERA)
        self._port = port
        self._motors, self._last, self._moved = {}, {}, {}
        # The first step waits, too: it shall find the same orders each time, however fast the kernel is.
        self._steps, self._granted = 0, -1
        self._stepping = self._held_up = False
        self._parent_work = port.context.parent_work
        self._told_at = port.clock.now()
        self._begin_waiting(self._told_at)
        self._time = 0.0
        for device, period in self._watches.items():
            self._enable(device, period)
        return [Found((self._simulation.world,))]

    def detach(self) -> None:
        """Forget the simulation, which is gone."""
        self._simulation = None
        self._orders = []

    @property
    def _step_ms(self) -> int:
        assert self._simulation is not None
        basic = self._simulation.world.step_ms
        return max(1, round(self._options.step / basic)) * basic

    # ---------------------------------------------------------------- the cycle

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """One step, if the kernel has handled the last one.  Raises LinkGone."""
        simulation = self._simulation
        if simulation is None:
            return []
        meanwhile()
        news: list[FromWorker] = []
        if not self._stepping:
            if not self._may_step(now, news):
                if now - self._told_at >= ALIVE_PERIOD_S or (self._paused and self._granted >= self._steps):
                    news.append(self._samples(now, {}))
                return news
            orders, self._orders = self._orders, []
            slow = self._longest_wait(orders)
            if slow and self._port is not None:
                # The worker gives a sign of life for as long.
                (self._port.before_wait or _nothing)(now + slow)
            simulation.begin(0 if self._paused else self._step_ms, orders)
            self._stepping = True
        outcome = simulation.poll()
        if outcome is None:
            if now - self._told_at >= ALIVE_PERIOD_S:
                news.append(self._samples(now, {}))
            return news
        self._stepping = False
        return news + self._handle_outcome(outcome, now)

    def _longest_wait(self, orders: list[StepOrder]) -> float:
        """Seconds that a simulator may need for some orders besides its step."""
        if any(order.verb == "revert" for order in orders):
            return RELOAD_S
        return RENDERER_S if any(order.device in self._cameras for order in orders) else 0.0

    def _may_step(self, now: float, news: list[FromWorker]) -> bool:
        """Whether a step may begin: the kernel has handled the last one, or has been waited for long enough."""
        if self._paused:
            return bool(self._orders)
        if self._granted >= self._steps:
            self._held_up = False
            return True
        patience = PATIENCE_S if self._steps else FIRST_PATIENCE_S
        if self._waited(now) <= patience and not self._held_up:
            return False
        if not self._held_up:
            self._held_up = True
            self._held_ups += 1
            news.append(DeviceReport(SIMULATOR, HELD_UP, self._time))
        return True

    def _begin_waiting(self, now: float) -> None:
        self._stepped_at, self._work_at_step = now, self._parent_work()

    def _waited(self, now: float) -> float:
        """Seconds that the kernel has had for the last step: of its work in the mode "fast", where that is known."""
        waited = now - self._stepped_at
        if waited <= PATIENCE_S or self._options.mode != FAST:
            return waited
        work = self._parent_work()
        return waited if work is None or self._work_at_step is None else work - self._work_at_step

    def waits_for_parent(self) -> bool:
        """See ``Driver``: in the mode "fast" simulated time stands still until the kernel has handled the step."""
        held = self._simulation is not None and self._granted < self._steps and not self._held_up
        return held and self._options.mode == FAST

    def _handle_outcome(self, outcome: Outcome, now: float) -> list[FromWorker]:
        news: list[FromWorker] = [DeviceReport(SIMULATOR, PROBLEM, problem) for problem in outcome.problems]
        if outcome.ended:
            raise LinkGone(outcome.ended)
        self._time = outcome.time
        if not self._paused:
            self._steps += 1
        self._begin_waiting(now)
        values: dict[str, Mapping[str, Any]] = {}
        for name, value in outcome.samples.items():
            self._last[name] = value
            if name in self._kinds:
                self._motors[name] = value
                values[name] = dict(zip(("position", "velocity", "torque"), value, strict=True))
            else:
                values[name] = {"value": value}
        return [*news, self._samples(now, values)]

    def _samples(self, now: float, values: dict[str, Mapping[str, Any]]) -> Samples:
        self._told_at = now
        values[SIMULATOR] = {"time": self._time, "step": self._steps}
        return Samples(now, values, dict.fromkeys(values, now))

    # ---------------------------------------------------------------- what is asked

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Order what a motor does with the next step."""
        if item == GRANTED:
            self._granted = max(self._granted, int(value[0]))
        elif item not in _TARGETS or isinstance(value, bool) or not isinstance(value, int | float):
            raise BadValue(f"no such target: {value!r}")
        elif self._simulation is not None:
            self._moved[device] = None
            if item == "velocity":
                self._order(device, "position", math.inf)
            self._order(device, item, float(value))

    def _order(self, device: str, item: str, value: Any) -> None:
        self._orders.append(StepOrder("write", device, item, value))

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Sample a device from now on, or no longer."""
        if message.period is None:
            self._watches.pop(message.device, None)
        else:
            self._watches[message.device] = message.period
        if self._simulation is not None:
            self._enable(message.device, message.period)
        return []

    def _enable(self, device: str, period: float | None) -> None:
        assert self._simulation is not None
        ms = 0 if period is None else max(round(period * 1000), self._step_ms)
        self._orders.append(StepOrder("enable", device, "", ms))

    def execute_request(self, message: Request) -> list[FromWorker]:
        """See the top of this file."""
        if message.verb == "read":
            known = self._last.get(message.device)
            return [Reply(message.reply_id, known is not None, known, "" if known is not None else "not measured yet")]
        if self._simulation is None:
            raise BadValue("there is no simulation")
        if message.verb == "mode":
            was_paused, self._paused = self._paused, message.value == "pause"
            if was_paused != self._paused:
                self._granted = max(self._granted, self._steps)
        elif message.verb == "write" and message.device.startswith(NODES):
            self._orders.append(StepOrder("move", message.device.removeprefix(NODES), message.item, message.value))
        elif message.verb == "write":
            self._order(message.device, message.item, message.value)
        elif message.verb in ("label", "reset physics", "revert", "quit"):
            self._orders.append(StepOrder(message.verb, "", "", message.value))
        else:
            raise BadValue(f"a simulation has no request {message.verb!r}")
        return [Reply(message.reply_id, True)]

    # ---------------------------------------------------------------- motion

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Motors hold their place, or turn no more, from the next step on: some, those that were moved; else all."""
        overdue = self._granted < self._steps and self._clock.now() - self._stepped_at > STOP_PATIENCE_S
        if overdue and not self.waits_for_parent():
            # The kernel is silent: without a step nothing would stop.
            self._held_up = True
        stopped = sorted(self._kinds) if devices is None else [each for each in self._moved if each in devices]
        obsolete = {(verb, device) for verb in ("write", "stop") for device in stopped}
        self._orders = [each for each in self._orders if (each.verb, each.device) not in obsolete]
        for device in stopped:
            self._orders.append(StepOrder("stop", device))
            self._moved.pop(device, None)

    def stop_again(self) -> None:
        """Do nothing: a simulator lets no second controller move the motors of a robot."""

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """True for a position, and for a speed or torque other than zero."""
        return item == "position" or (item != GRANTED and bool(value))

    def request_moves(self, request: Request) -> bool:
        """False: the supervisor's hand moves nodes, not the robot's motors."""
        return False

    def pose(self, device: Any, item: str) -> float | None:
        return self._motors.get(device, (math.nan,))[0] if item == "position" else None

    def raw_of(self, device: Any, item: str, signed: float) -> float:
        """See ``Driver``: targets are in SI units."""
        return signed

    def errors(self) -> dict[str, int]:
        """How often the simulation did not wait for the programs any longer."""
        return {"held up": self._held_ups}


def _nothing(deadline: float) -> None:
    """Do nothing: the simulator needs no sign of life."""
