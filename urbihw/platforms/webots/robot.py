"""The object ``webots``: the simulation, its devices, and the time of the programs.

The kernel's clock is that of the simulation (``Host.lead_time``): the samples of a step bring its time, all that is due
runs, and when nothing is left to do the worker may make the next step (``GRANTED``).  A program that gives way again
and again without ever waiting gets PATIENT_ROUNDS rounds at one time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
    BadConfig,
    Opened,
    RobotSettings,
    event,
    finite_number,
    not_ended,
    owned,
    reading,
)
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.scene.view import TREE, WorldView
from urbihw.platforms.webots import words
from urbihw.platforms.webots.blobs import BlobDetector
from urbihw.platforms.webots.driver import GRANTED, HELD_UP, SIMULATOR
from urbihw.platforms.webots.media import Camera, Display, Receiver, Speaker
from urbihw.platforms.webots.motors import DifferentialWheels, Servo, SimMotor
from urbihw.platforms.webots.options import SPEEDS, WebotsOptions
from urbihw.platforms.webots.scene import SimulatedScene
from urbihw.platforms.webots.sensors import (
    GPS,
    Accelerometer,
    Compass,
    DistanceSensor,
    Emitter,
    Gyro,
    InertialUnit,
    Led,
    Lidar,
    LightSensor,
    PositionSensor,
    RangeFinder,
    TouchSensor,
)
from urbihw.platforms.webots.simulator import SimulatedWorld
from urbihw.platforms.webots.supervisor import Label, ManipulateNode, SimulationController
from urbihw.platforms.webots.surface import Shown
from urbihw.settings import BadSetting

PATIENT_ROUNDS: Final = 100
"""Rounds of the scheduler at one time of the simulation for a program that never waits."""
FAST_RATE: Final = 2000.0
"""Ticks of the worker per second in the mode fast: an exchange with the kernel takes about as long."""
PAUSE_RATE: Final = 50.0
"""Ticks per second while the simulation stands still."""
MAX_RATE: Final = 1000.0
_TREE: Final = """
if (!Global.hasLocalSlot("robot")) webots.assemble(%s)|;
if (!robot.hasLocalSlot("stop")) robot.setSlot("stop", function () { webots.stop })|;
"""


class Webots(WiredRobot):
    """A simulated robot: its devices, clock and world."""

    slot_words = words.ROBOT
    classes = (
        Servo, DifferentialWheels, Accelerometer, Gyro, GPS, Compass, InertialUnit, DistanceSensor, TouchSensor,
        LightSensor, PositionSensor, RangeFinder, Lidar, Camera, BlobDetector, Led, Emitter, Receiver, Speaker, Display,
        Label, ManipulateNode, SimulationController,
    )  # fmt: skip
    uname = "WebotsRobot"
    robot_name = "webots"
    model_name = "simulated robot"
    family = "urbihw.platforms.webots.driver:SimulationDriver"

    time = reading(0.0)
    step = reading(0.0)
    mode = owned("real")
    factor = owned(1.0)
    simulator = reading("")
    world_ = reading("", "world")
    deviceNames = reading({})
    deviceOrder = reading([])
    heldUp = event()
    problem = event()

    def init(self) -> None:
        """Called by ``new``; the worker is started by ``open``."""
        super().init()
        self.options = WebotsOptions()
        self._wanted: RobotSettings
        self._world: SimulatedWorld | None = None
        self._shown: dict[str, list[Shown]] = {}
        self._periods: dict[str, float] = {}
        self._motors: dict[str, SimMotor] = {}
        self._motor_names: dict[str, None] = {}
        self._base = 0.0
        """Kernel's time at the beginning of the simulation."""
        self._owed: int | None = None
        self._rounds = 0
        self._waits = False
        self._running = ""
        """The binding file that runs."""
        self._built = self._measured = False
        self._labels = 0
        self._view: WorldView | None = None
        self.notify_change(self.mode, self._write_mode)
        self.notify_change(self.factor, self._write_factor)

    # ---------------------------------------------------------------- what the daemon calls

    def await_programs(self) -> None:
        self._waits = True

    def begin_programs(self) -> None:
        self._waits, self._rounds = False, 0
        # A program that has still something to do at this time is waited for, as at each other time.
        if self.host.is_idle():
            self._grant()

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        self._apply_options(settings)
        self.mode.sense(self.options.mode)
        self.factor.sense(self.options.factor)
        super().open(settings, opened)
        self.host.each_round(self._end_round)

    def close(self) -> None:
        if self._view is not None:
            self._view.close()
        super().close()

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings; mode and factor stay as programs have set them."""
        self._apply_options(settings)
        self._pace()

    def _apply_options(self, settings: RobotSettings) -> None:
        try:
            self.options = WebotsOptions.of(settings.options)
        except BadSetting as error:
            raise BadConfig(f"webots: {error}") from error
        self._wanted = settings

    def summary(self) -> str:
        """Return world, simulator and time."""
        world = self.world
        return f"{world.name} in {world.simulator}, {len(world.devices)} devices, {self.mode.sensed}"

    def waits_for(self) -> str:
        """See ``Robot``: it waits for a binding file that does not end, too."""
        return super().waits_for() or (not_ended(self._running) if self._running else "")

    def on_absent(self) -> None:
        """While there is no simulation, time goes on by itself."""
        self.host.release_time()

    # ---------------------------------------------------------------- what devices use (``surface``)

    @property
    def world(self) -> SimulatedWorld:
        if self._world is None:
            raise ValueError("the simulation is not there yet")
        return self._world

    def add_motor(self, name: str, motor: SimMotor) -> None:
        self._motors[name] = motor
        self.add_device(name, motor, 0.0)
        self.limits.send()

    def stop_motor(self, name: str, reason: str) -> None:
        self.motion.end(name, reason)
        self.worker.send(m.Stop(self.motion.epoch, reason, (name,)))

    def add_device(self, name: str, device: Shown, period: float) -> None:
        self._shown.setdefault(name, []).append(device)
        self._periods[name] = period
        self.channel.watch(name, ("value",), period)

    def switch(self, name: str, on: bool) -> None:
        self.channel.watch(name, ("value",), self._periods[name] if on else None)
        for device in self._shown.get(name, ()):
            load = getattr(device, "load", None)
            if load is not None:
                load.sense(float(on))
            if not on:
                device.mark_stale()

    def is_taken(self, name: str) -> bool:
        return name in self._shown

    def write(self, device: str, item: str, value: Any) -> None:
        self.channel.write(device, item, value, self._report)

    def ask(self, verb: str, value: Any = None) -> None:
        self.channel.send_request(verb, SIMULATOR, self._report, value=value)

    def next_label(self) -> int:
        self._labels += 1
        return self._labels

    def _report(self, reply: m.Reply) -> None:
        if not reply.ok:
            self._tell_problem(reply.error)

    def _tell_problem(self, text: str) -> None:
        self.log.warning("%s", text)
        self.problem.emit(text)

    # ---------------------------------------------------------------- time

    def _write_mode(self) -> None:
        if self.mode.value not in SPEEDS:
            raise ValueError(f"the mode is one of {', '.join(SPEEDS)}")
        self.mode.sense(self.mode.value)
        self._pace()
        self.ask("mode", str(self.mode.value))

    def _write_factor(self) -> None:
        value = finite_number(self.factor.value)
        if not 0.01 <= value <= 100:
            raise ValueError("the factor is 0.01 to 100")
        self.factor.sense(value)
        self._pace()

    def _pace(self) -> None:
        """Let the worker make as many steps per second as mode and factor ask for."""
        if self._world is not None:
            step = float(self.step.sensed)
            real = min(max(float(self.factor.sensed) / step, 1.0), MAX_RATE)
            rate = {"real": real, "fast": FAST_RATE, "pause": PAUSE_RATE}[str(self.mode.sensed)]
            options = {**self._wanted.options, "mode": str(self.mode.sensed)}
            self._wanted = replace(self._wanted, rate=rate, options=options)
        super().configure(self._wanted)

    def _lead(self, values: Mapping[str, Any]) -> float:
        """Set the kernel's clock to the time of a step; return it."""
        time = self._base + float(values["time"])
        self.host.lead_time(time)
        self.time.sense(float(values["time"]), time)
        self._owed = int(values["step"])
        self._rounds = 0
        return time

    def _end_round(self) -> None:
        """End of a round: the worker may go on when nothing is left to do at this time."""
        if self._owed is not None:
            self._rounds += 1
            if self.host.is_idle() or self._rounds >= PATIENT_ROUNDS:
                self._grant()

    def _grant(self) -> None:
        if self._owed is None or (self._waits and not self.arrival.opening):
            return
        step, self._owed = self._owed, None
        self.worker.send(m.Targets({(SIMULATOR, GRANTED): (step,)}, self.motion.epoch, self.host.now()))

    # ---------------------------------------------------------------- the worker

    def on_found(self, message: m.Found) -> None:
        """The simulation is there: its time begins, and at the first time the objects of its devices are made."""
        (world,) = message.devices
        self._world = world
        self._base = self.host.now()
        self.host.lead_time(self._base)
        self._owed, self._rounds = 0, 0
        basic = world.step_ms
        self.step.sense(max(1, round(self.options.step / basic)) * basic / 1000)
        self.simulator.sense(world.simulator)
        self.world_.sense(world.name)
        self.deviceNames.sense({each.name: each.kind for each in world.devices})
        self.deviceOrder.sense([each.name for each in world.devices])
        self.identity.show(name=world.name, model=f"{self.model_name} in {world.simulator}")
        self._pace()
        if self._built:
            return
        self._built = True
        paths = [Path(self.options.program)] if self.options.program else [
            Path(world.folder) / name for name in world.program.split()
        ]  # fmt: skip
        try:
            texts = [(path.read_text("latin-1"), path.name) for path in paths]
        except OSError as error:
            reason = f"the program of the world cannot be read: {error.filename}: {error.strerror}"
            self.arrival.answer(BadConfig(reason))
            return
        texts.append((_TREE % str(not texts).lower(), "webots.u"))
        if world.model:
            self._view = self.host.create(WorldView, "worldView", SimulatedScene(self))
            texts.append((TREE, "scene.u"))
        self._run_programs(texts, "")

    def _run_programs(self, texts: list[tuple[str, str]], problem: str) -> None:
        """Run the binding files of the world, one after the other; the last one makes a tree if there is none."""
        self._running = texts[0][1] if texts and not problem else ""
        if problem:
            self.arrival.answer(BadConfig(f"the objects of the world cannot be made: {problem}"))
            return
        if texts:
            self.host.run(*texts[0], lambda found: self._run_programs(texts[1:], found))
            return
        self.limits.send()
        self._measured = True
        self.arrival.wait_for_readings()

    def is_complete(self) -> bool:
        """Return whether the tree is built, and a step was made since."""
        return self._measured and self.time.sensed > 0

    def on_samples(self, message: m.Samples) -> None:
        """Show the samples of a step, and set the time."""
        stamp = self._lead(message.values[SIMULATOR])
        for name, values in message.values.items():
            if name == SIMULATOR:
                continue
            value = values["value"] if "value" in values else tuple(values.values())
            for device in self._shown.get(name, ()):
                device.show(value, stamp)

    def on_happened(self, message: m.DeviceReport) -> None:
        """Report what the simulation could not do, and that it did not wait any longer."""
        if message.what == HELD_UP:
            self.log.warning("programs did not give way: the simulation went on without them at %.3f s", message.value)
            self.heldUp.emit(float(message.value))
        else:
            self._tell_problem(str(message.value))

    def on_link_down(self, reason: str) -> None:
        """The simulation is gone: time goes on by itself, and values are old."""
        self._owed = None
        self.host.release_time()
        for devices in self._shown.values():
            for device in devices:
                device.mark_stale()

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the motors that have an object, by the names of the simulator."""
        return self._motors
