"""The simulated robots whose bodies are looked at when something goes wrong: see ``faults_lab``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import urbihw_nao
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.cia402.node import Drive
from urbihw_fakes.dynamixel.ax12 import DEGREES
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot
from urbihw_fakes.nxt.usb_endpoint import UsbEndpoint
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.start import TwoPtys
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.start import UsbPty
from urbihw_fakes.segway.usb import UsbLink
from urbihw_fakes.serving import Endpoint
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint

Look = Callable[[], float]

NAO_WATCHDOG = Path(urbihw_nao.__path__[0]) / "watchdog.py"


@dataclass(frozen=True)
class Rig:
    """A simulated robot, and one way to move it.

    Attributes:
        make: the robot on its transport, and the greatest speed of its body, in degrees/s or m/s (``unit``).
        prepare: what is said before, and until what holds; go: what sets it moving, faster than ``moving``.
        rest: the speed below which it stands.
        live: a movement that goes on by itself, also when the adapter is back.
        other: how another master than the daemon moves the simulated robot, None where the daemon has the only wire, or
            where its own orders follow each of theirs (Segway).
    """

    name: str
    platform: str
    make: Callable[[], tuple[Endpoint, Look]]
    go: str
    moving: float
    prepare: str = ""
    until: str = "true"
    rest: float = 0.5
    unit: str = "deg"
    live: bool = False
    other: Callable[[Any], None] | None = None


def _bioloid(number: int) -> tuple[Endpoint, Look]:
    kit = Bioloid(servos=(6, 7), sensors=(), baud=1_000_000)
    end = PtyEndpoint(kit)

    def look() -> float:
        kit.tick(end.clock())
        return abs(kit.servo(number).speed) * DEGREES

    return end, look


def _nxt() -> tuple[Endpoint, Look]:
    robot = TriBot(4.0)
    end = UsbEndpoint(NxtDevice(robot))

    def look() -> float:
        end.device.tick(end.clock())
        return max(abs(robot.brick.motor(port).speed) for port in "ABC")

    return end, look


def _segway() -> tuple[Endpoint, Look]:
    base = SegwayRmp()
    return UsbPty(CanDevice(base, UsbLink())), lambda: abs(base.body.speed)


def _p3dx() -> tuple[Endpoint, Look]:
    kit = P3dx()
    return TwoPtys(kit.robot, kit.laser), lambda: abs(kit.body.forward.speed)


def _cia402() -> tuple[Endpoint, Look]:
    drive = Drive(5)
    end = SlcanPty(CanDevice(drive, Slcan()))
    return end, lambda: abs(drive.machine.speed) * 360 / drive.machine.increments


def _spykee() -> tuple[Endpoint, Look]:
    robot = Spykee()
    end = SpykeeEndpoint(robot)

    def speed() -> float:
        robot.body.advance(end.clock())
        return max(map(abs, robot.body.speeds))

    return end, lambda: end.call(speed)


def _nao_walk(watchdog: bool) -> tuple[Endpoint, Look]:
    robot = Nao()
    robot.body.put_on_feet()
    if watchdog:
        robot.add_watchdog(NAO_WATCHDOG)
    end = NaoEndpoint(robot)

    def look() -> float:
        robot.advance(end.clock())
        return math.hypot(*robot.body.walk[:2])

    return end, look


def _nao_joint() -> tuple[Endpoint, Look]:
    robot = Nao()
    end = NaoEndpoint(robot)
    joint = robot.body.joints["HeadYaw"]
    seen = (0.0, 0.0)

    def look() -> float:
        # Between two looks: a motor goes to each goal at its full speed, and waits there for the next one.
        nonlocal seen
        now = end.clock()
        robot.advance(now)
        (then, angle), seen = seen, (now, joint.angle)
        return math.degrees(abs(joint.angle - angle)) / (now - then)

    return end, look


def _turn_wheel(kit: Any) -> None:
    for name, value in (("torque_enable", 1), ("moving_speed", 300)):
        kit.servo(7).registers.put(name, value)


def _start_program(device: Any) -> None:
    device.robot.brick.program_power = 50
    device.robot.brick.start_program("drive.rxe")


def _turn_drive(device: Any) -> None:
    machine = device.node.machine
    machine.mode, machine.target_speed = 3, machine.increments
    for word in (6, 7, 15):
        machine.control(word)


def _push_joystick(base: Any) -> None:
    base.body.forward.set_speed(0.3)


def _walk(robot: Any) -> None:
    robot.body.drive((0.1, 0.0, 0.0))


RIGS = (
    Rig(
        "Bioloid, a wheel", "bioloid", lambda: _bioloid(7), "motor7.speed = 2;", 60,
        prepare="motor7.cwLimit = motor7.ccwLimit = 0;", until="motor7.wheel", other=_turn_wheel,
    ),
    Rig("Bioloid, a joint that swings", "bioloid", lambda: _bioloid(6), "motor6.val = 0 sin:1s ampli:20deg,", 60,
        live=True),
    Rig("NXT", "nxt", _nxt, "wheels.speed = 50;", 300, other=_start_program),
    Rig("Segway RMP", "segway", _segway, "rmp.forwardSpeed = 0.5;", 0.4, rest=0.005, unit="m"),
    Rig(
        "Pioneer 3-DX", "p3dx", _p3dx, "P3dx.body.x.speed = 0.3;", 0.25,
        prepare="P3dx.body.load = 1;", until="P3dx.body.load == 1", rest=0.005, unit="m", other=_push_joystick,
    ),
    Rig(
        "CiA 402 drive", "cia402", _cia402, "drive5.speed = 6;", 300,
        prepare="drive5.load = 1;", until="drive5.load == 1", other=_turn_drive,
    ),
    Rig("Spykee", "spykee", _spykee, "trackL.val = 60 | trackR.val = 60;", 0.2, rest=0.005, unit="m",
        other=lambda robot: robot.body.drive(60, 60)),
    Rig("Nao, a walk", "nao", lambda: _nao_walk(False), "naoWalk.xSpeed = 0.1;", 0.08, rest=0.005, unit="m",
        other=_walk),
    Rig(
        "Nao, a walk, with the watchdog on the robot", "nao", lambda: _nao_walk(True), "naoWalk.xSpeed = 0.1;", 0.08,
        rest=0.005, unit="m",
    ),
    Rig(
        "Nao, a joint that swings", "nao", _nao_joint, "headYaw.val = 0 sin:1s ampli:20deg,", 60,
        prepare="headYaw.load = 1;", until="headYaw.load == 1", live=True,
    ),
)  # fmt: skip
