"""A Pioneer in simulated time: see ``lab``.  Its two wires have a worker each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

from lab import START, HandWorker, RobotLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import BATTERY, BUS, GAINS, MOBILE, ODOMETRY, PICTURE, PLANNER, UnitTable

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw_fakes.console import Console
from urbihw_fakes.device import Device
from urbihw_fakes.p3dx.console import commands
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

BAUD = 115200


class Line:
    """A device of the fake at the end of a pipe, which also speaks unasked."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.end = PipeEnd(self._receive)

    def tick(self, now: float) -> None:
        """Let the device speak."""
        for answer in self.device.tick(now):
            if self.end.plugged:
                self.end.send(answer.data, answer.at)

    def _receive(self, data: bytes, at: float) -> None:
        for answer in self.device.feed(data, at):
            self.end.send(answer.data, answer.at)


class PatientWorker(HandWorker):
    """A worker that ends at its next step: the platform lets go of a laser in a thread of its own."""

    over = False

    def step(self) -> None:
        if self.over:
            super().stop()
        else:
            super().step()

    def stop(self) -> None:
        self.over = True


class Lab(RobotLab):
    """A Pioneer and its laser on two pipes."""

    platform = "p3dx"
    tick = 0.02
    url = f"pipe://robot?baud={BAUD}&laser=pipe://laser?baud={BAUD}"

    def __init__(self, kit: Kit | None = None, **options: Any) -> None:
        self.kit = kit if kit is not None else Kit()
        self.robot_line, self.laser_line = Line(self.kit.robot), Line(self.kit.laser)
        self.workers: list[PatientWorker] = []
        super().__init__(**options)

    @classmethod
    def in_world(cls, world: World, slip: float = 0.0, **options: Any) -> Lab:
        """A robot, open, in a world of the test's own."""
        return cls.ready(Kit(world, slip=slip), **options)

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.robot_line.end, "laser": self.laser_line.end})

    def step(self) -> None:
        """One tick of both wires, of the fake, and of the kernel."""
        end = self.clock.now() + self.tick
        self.kernel.scheduler.run_simulated(end)
        now = self.bus_clock.now()
        self.robot_line.tick(now)
        self.laser_line.tick(now)
        # Both workers are on one clock: a tick that took long puts it ahead, until the kernel has caught up.
        if self.bus_clock.now() - START < end:
            for worker in self.workers:
                worker.step()
        self.workers = [worker for worker in self.workers if not worker.pipe.closed]
        self.bus_clock.sleep_until(START + end)
        self.kernel.scheduler.run_simulated(self.clock.now())

    def console(self) -> Console:
        laser = SimpleNamespace(unplug=self.laser_line.end.unplug, plug=self.laser_line.end.replug)
        words = commands(self.kit, self.bus_clock.now, laser)
        return self.console_of(self.kit.robot, self.robot_line.end, words)

    def where(self) -> tuple[float, float, float]:
        """Where the robot truly is."""
        return self.kit.body.pose

    def write_map(self, folder: Path) -> str:
        """The fake's world as a map; its path."""
        path = folder / "room.map"
        path.write_text(self.kit.world.as_map(), "ascii")
        return str(path)

    def _start(
        self, url: str, *, post: Callable[[m.FromWorker], None], settings: m.Configure, family: str, control: str = ""
    ) -> HandWorker:
        def engine(mailbox: Any) -> Engine:
            return Engine(url, driver_of(family), mailbox, m.Begin(settings), self.context())

        worker = PatientWorker(engine, post)
        self.workers.append(worker)
        if self.worker is None:
            self.worker = worker
        return worker


def lab() -> Lab:
    """For the contract of all platforms."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    body = lab.kit.body
    return (body.forward.speed, body.turning.speed), body.pose


def _on_map(lab: Lab, folder: Path) -> None:
    lab.say(f'P3dx.planner.mapFileName = "{lab.write_map(folder)}";')
    for _ in range(3):
        lab.thought()
        lab.run(0.1)
    assert lab.look("P3dx.planner.ready") == "true"


_PATH = "P3dx.moveTo([5, 0, 90deg]);"

MOTION = Motion(
    make=lab,
    look=_body,
    slot="P3dx",
    unplug=lambda lab: lab.robot_line.end.unplug(),
    plug=lambda lab: lab.robot_line.end.replug(),
    revive="P3dx.body.load = 1",
    standstill=1.1,
    kinds={
        "speed": Kind("P3dx.body.x.speed = 0.3;", 0.2, lead=1.5),
        "turn": Kind("P3dx.body.yaw.speed = 0.5;", 0.4),
        "trajectory": Kind("P3dx.body.yaw.speed = 0 sin:4s ampli:0.5,", 0.3, lead=4.3, live=True),
        "at": Kind(
            "trip!;", 0.2, lead=1.5, live=True,
            prepare="if (!Global.hasLocalSlot(\"trip\")) var Global.trip = Event.new|;"
            " at (trip?) loop { P3dx.body.yaw.speed = 0.4; sleep(400ms); P3dx.body.yaw.speed = -0.4; sleep(800ms) };",
        ),
        "go": Kind("robot.go(2);", 0.1, error=True),
        "turn by an angle": Kind("robot.turn(20);", 0.3, error=True),
        "planner": Kind(_PATH, 0.1, lead=3.0, ready=_on_map),
        "planner that plans": Kind(_PATH, 0.1, lead=0.0, ready=_on_map),
        "remote": Kind("P3dx.body.yaw.speed = 0.5", 0.4, remote=True),
    },
    others={"joystick at the robot": OtherMaster(lambda lab: lab.kit.body.forward.set_speed(0.3), 0.2, lead=1.5)},
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "P3dx": BUS | {"m/s": "speedDelta", "rad/s": "speedAlpha", "m": "distMin distMax",
                    "1": "epoch stops motorsLoad laserLoad"},
    "P3dxBody": {"m": "safetyDistanceMin safetyDistanceMax", "1": "load digitalIn digitalOut"},
    "P3dxWheel": {"m/s": "speed val", "1": GAINS},
    "Sonars": {"1": "load"},
    "Sonar": {"m": "val distance"},
    "P3dxLaser": {
        "m": "val distanceMin distanceMax laserDistanceMin laserDistanceMax",
        "rad": "angleMin angleMax resolution",
        "Hz": "rate", "s": "lastCaptureTimestamp", "1": "load",
    },
    "P3dxCamera": PICTURE | {"rad": "yaw pitch xfov yfov", "ratio": "zoom",
                          "1": "load frames gain wb quality resolution"},
    "XSpeed": {"m/s": "speed val requested applied", "m/s^2": "acceleration deceleration", "1": GAINS},
    "YawSpeed": {"rad/s": "speed val requested applied", "rad/s^2": "acceleration deceleration", "1": GAINS},
    "P3dxBattery": BATTERY,
    "P3dxOdometry": ODOMETRY,
    "P3dxPlanner": PLANNER,
    "robot": MOBILE,
}  # fmt: skip
