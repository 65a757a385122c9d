"""A TriBot in simulated time, behind the framing of Bluetooth: see ``lab``."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, Final

from lab import RobotLab
from motions import Kind, Motion, Numbers, OtherMaster
from paths import on_map
from slot_units import BATTERY, BUS, GAINS, MOBILE, ODOMETRY, PLANNER, Units, UnitTable

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw_fakes.console import Console
from urbihw_fakes.nxt.console import commands
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot


class Lab(RobotLab):
    """A TriBot on a pipe, 1.5 m before the wall unless ``tribot`` stands elsewhere."""

    platform = "nxt"

    def __init__(self, tribot: TriBot | None = None, **options: Any) -> None:
        self.tribot = tribot if tribot is not None else TriBot()
        self.brick = self.tribot.brick
        self.device = NxtDevice(self.tribot)
        self.end = PipeEnd(self._receive)
        super().__init__(**options)

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.end})

    def step(self) -> None:
        """See ``RobotLab``; the robot lives also without a request."""
        super().step()
        self.device.tick(self.bus_clock.now())

    def console(self) -> Console:
        clock, plug = self.bus_clock.now, self.end.replug
        cable: Any = SimpleNamespace(device=self.device, clock=clock, unplug=self.unplug, plug=plug)
        return Console(cable, commands(self.device, clock))

    def unplug(self) -> None:
        """The link is gone."""
        self.device.hang_up()
        self.end.unplug()

    def powers(self) -> list[int]:
        """What the motors A, B and C were told."""
        return [motor.power for motor in self.brick.motors]

    def _receive(self, data: bytes, at: float) -> None:
        self.device.tick(at)
        for answer in self.device.feed(data, at):
            self.end.send(answer.data, answer.at)


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    motors = [lab.brick.motor(port) for port in "ABC"]
    return tuple(math.radians(one.speed) for one in motors), tuple(math.radians(one.position) for one in motors)


def _run_motors(lab: Lab) -> None:
    """Another computer at the brick."""
    for motor in lab.brick.motors:
        motor.set_output(50, 1, 0, 0, 0x20, 0)


def _start_program(lab: Lab) -> None:
    """Somebody starts a program by the buttons of the brick."""
    lab.brick.program_power = 50
    lab.brick.start_program("drive.rxe")


_PATH = "nxt.moveTo([5, 1, 90deg]);"

MOTION = Motion(
    make=lambda: Lab.ready(TriBot(10.0)),
    look=_body,
    slot="nxt",
    unplug=lambda lab: lab.unplug(),
    plug=lambda lab: lab.end.replug(),
    standstill=0.4,
    kinds={
        "wheels": Kind("wheels.speed = 50;", 5.0),
        "goal": Kind("claw.val = 100000;", 5.0),
        "goal at once": Kind("claw.val = 100000;", 5.0, lead=0.0),
        "trajectory": Kind("wheels.speed = 0 sin:2s ampli:50,", 5.0, lead=2.3, live=True),
        "trajectory of places": Kind("claw.val = 0 sin:2s ampli:200,", 3.0, lead=4.3, live=True),
        "at": Kind(
            "trip!;", 3.0, lead=1.5, live=True,
            prepare="if (!Global.hasLocalSlot(\"trip\")) var Global.trip = Event.new|;"
            " at (trip?) loop { wheels.speed = 40; sleep(200ms); wheels.speed = -40; sleep(400ms) };",
        ),
        "go": Kind("robot.go(2);", 3.0, error=True),
        "turn": Kind("robot.turn(20);", 0.5, error=True),
        "planner": Kind(_PATH, 3.0, lead=3.0, ready=on_map("nxt")),
        "planner that plans": Kind(_PATH, 3.0, lead=0.0, ready=on_map("nxt")),
        "remote": Kind("wheelL.speed = 50", 5.0, remote=True),
        "remote goal": Kind("claw.val = 100000", 5.0, remote=True),
    },
    others={"motors": OtherMaster(_run_motors, 3.0), "program on the brick": OtherMaster(_start_program, 3.0)},
)  # fmt: skip


_NXT_SENSOR: Final[Units] = {"1": "port raw", "s": "age"}
UNITS: Final[UnitTable] = {
    "Nxt": BUS | {"m": "wheelRadius track", "rad/s": "fullSpeed"},
    "NxtServo": {  # val in degrees: chapter 24, "Servo"
        "deg": "val", "rad": "angle", "turn": "turn", "%": "speed requested applied", "N m": "torque",
        "s": "age", "1": GAINS,
    },
    "SoundSensor": _NXT_SENSOR | {"ratio": "val"},
    "NxtLightSensor": _NXT_SENSOR | {"ratio": "val"},
    "UltraSonicSensor": {"cm": "val", "m": "distance", "s": "age", "1": "port"},
    "NxtSwitch": {"1": "port raw val pressure", "s": "age"},
    "NxtBattery": BATTERY | {"ratio": "val remain"},
    "NxtOdometry": ODOMETRY,
    "NxtPlanner": PLANNER,
    "robot": MOBILE,
}  # fmt: skip
