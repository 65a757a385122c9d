"""A Bioloid in simulated time: see ``lab``."""

from __future__ import annotations

import math
from typing import Any, Final, Self

from lab import RobotLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import AX, BUS, ON_BUS, TAUGHT, UnitTable

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos.device import DeviceInfo
from urbihw_fakes.bioloid import Bioloid as Kit
from urbihw_fakes.bioloid.console import commands
from urbihw_fakes.console import Console
from urbihw_fakes.dynamixel.ax12 import DEGREES, Ax12
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import STEPS

BAUD = 1_000_000


class Lab(RobotLab):
    """A Bioloid on a pipe."""

    platform = "bioloid"
    url = f"pipe://robot?baud={BAUD}"

    def __init__(self, kit: Kit | None = None, **options: Any) -> None:
        self.kit = kit if kit is not None else Kit(baud=BAUD)
        for unit in self.kit:
            unit.registers.put("return_delay", 0)
        self.kit.pace(BAUD)
        self.end = PipeEnd(self._receive)
        super().__init__(**options)

    @classmethod
    def small(cls, *servos: int, **options: Any) -> Self:
        """A lab whose robot has these servos only: each one takes 5 ms of the processor for a simulated second."""
        return cls.ready(Kit(servos=servos, sensors=(), baud=BAUD), **options)

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.end})

    def console(self) -> Console:
        return self.console_of(self.kit, self.end, commands(self.kit, self.bus_clock.now))

    def register(self, unit: int, name: str) -> int:
        """A register of the fake, by the fake's own name."""
        return self.kit[unit].registers.get(name)

    def _receive(self, data: bytes, at: float) -> None:
        self.kit.tick(at)
        for answer in self.kit.feed(data, at):
            self.end.send(answer.data, answer.at)


def lab() -> Lab:
    """For the contract of all platforms."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    lab.kit.tick(lab.bus_clock.now())
    seen = [
        (unit.motor.speed * _X_STEP, unit.motor.position * _X_STEP)
        if isinstance(unit, XSeries)
        else (unit.speed * _AX_STEP, unit.position * _AX_STEP)
        for unit in lab.kit
        if isinstance(unit, XSeries | Ax12)
    ]
    return tuple(speed for speed, _ in seen), tuple(place for _, place in seen)


def _found(lab: Lab) -> tuple[DeviceInfo, ...]:
    """A worker that takes the place of another looks only at the numbers."""
    return tuple(DeviceInfo(unit.id, 12, "AX-12", "AX", 24, 1, "joint") for unit in lab.kit)


def _x_lab() -> Lab:
    return Lab.ready(Kit.x_series(2, baud=BAUD))


_AX_STEP, _X_STEP = math.radians(DEGREES), math.tau / STEPS
_X_WHEEL = "motor2.cwLimit = motor2.ccwLimit = 0;"
_WHEEL = "motor7.cwLimit = motor7.ccwLimit = 0;"



def _push_joint(lab: Lab) -> None:
    """Another master sends a joint to the other end of its range."""
    registers = lab.kit[6].registers
    goal = 800 if registers.get("goal_position") < 512 else 200
    for name, value in (("moving_speed", 100), ("torque_enable", 1), ("goal_position", goal)):
        registers.put(name, value)


def _turn_wheel(lab: Lab) -> None:
    lab.kit[7].registers.put("torque_enable", 1)
    lab.kit[7].registers.put("moving_speed", 200)


MOTION = Motion(
    make=lambda: Lab.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD)),
    look=_body,
    slot="bioloid",
    unplug=lambda lab: lab.end.unplug(),
    plug=lambda lab: lab.end.replug(),
    # A joint of the X series comes to rest at the end of its lag; measured, rounded up.
    standstill=0.3,
    grain=0.05,
    found=_found,
    kinds={
        "joint": Kind("motor6.val = 100deg;", 0.3, prepare="motor6.speed = 0.5;"),
        "wheel": Kind("motor7.speed = 1;", 0.5, prepare=_WHEEL),
        "trajectory": Kind("motor6.val = 0 sin:1s ampli:20deg,", 1.0, lead=2.3, live=True),
        "trajectory to a place": Kind(
            "motor6.val = 140deg time:8s,", 0.2, lead=2.5, live=True, again="motor6.val = -100deg time:8s,"
        ),
        "trajectory of a wheel": Kind("motor7.speed = 0 sin:2s ampli:1,", 0.5, prepare=_WHEEL, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 0.5, lead=2.5, live=True,
            prepare="if (!Global.hasLocalSlot(\"trip\")) var Global.trip = Event.new|; motor6.speed = 1|;"
            " at (trip?) loop { motor6.val = 60deg; sleep(200ms); motor6.val = -60deg; sleep(400ms) };",
        ),
        "switch of mode": Kind(f"{_WHEEL} motor7.speed = 1;", 0.5, lead=0.0),
        "switch of mode on its way": Kind(f"{_WHEEL} motor7.speed = 1;", 0.5, lead=0.01),
        "switch of mode just done": Kind(f"{_WHEEL} motor7.speed = 1;", 0.5, lead=0.03),
        "X joint": Kind("motor1.val = 100deg;", 0.3, prepare="motor1.speed = 0.5;", make=_x_lab),
        "X wheel": Kind("motor2.speed = 1;", 0.5, prepare=_X_WHEEL, make=_x_lab),
        "X trajectory": Kind("motor1.val = 0 sin:1s ampli:20deg,", 1.0, lead=2.3, live=True, make=_x_lab),
        "X switch of mode": Kind(f"{_X_WHEEL} motor2.speed = 1;", 0.5, lead=0.01, make=_x_lab),
        "X switch of mode just done": Kind(f"{_X_WHEEL} motor2.speed = 1;", 0.5, lead=0.03, make=_x_lab),
        "remote": Kind("motor6.val = 1.7", 0.3, prepare="motor6.speed = 0.5;", remote=True),
    },
    others={
        "wheel": OtherMaster(_turn_wheel, 0.5, prepare=_WHEEL),
        "joint": OtherMaster(_push_joint, 0.3),
    },
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "Bioloid": BUS,
    "robot": TAUGHT,
    "AX12": AX,
    "AXS1": ON_BUS | {
        "1": "IRLeft IRCenter IRRight lightLeft lightCenter lightRight lightThreshold lightThresholdDefault"
        " obstacleThreshold obstacleThresholdDefault buzzerIndex clapCount remocon"
        " id model firmware lock statusReturnLevel",
        "ratio": "soundVolume soundVolumeMax",
        "s": "age returnDelay buzzerTime soundTime",
    },
}  # fmt: skip
