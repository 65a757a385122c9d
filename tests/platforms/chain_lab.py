"""A chain of servos in simulated time: see ``lab``."""

from __future__ import annotations

import math
from typing import Any, Final

from lab import RobotLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import ANGLES, AX, BUS, NUMBERS, SERVO, TAUGHT, UnitTable

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos.device import DeviceInfo
from urbihw_fakes.bioloid.console import commands
from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.chain.parts import chain_of
from urbihw_fakes.chain.start import SERVOS
from urbihw_fakes.console import Console
from urbihw_fakes.dynamixel.ax12 import DEGREES, Ax12
from urbihw_fakes.dynamixel.servo import Shaft
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import STEPS
from urbihw_fakes.feetech.servo import FeetechServo

BAUD = 1_000_000
_AX_STEP, _X_STEP = math.radians(DEGREES), math.tau / STEPS


class Lab(RobotLab):
    """A chain on a pipe; ``servos`` is the list of the fake."""

    platform = "chain"
    url = f"pipe://robot?baud={BAUD}"

    def __init__(self, servos: str = SERVOS, **options: Any) -> None:
        self.kit = chain_of(servos)
        for unit in self.kit:
            unit.set_baud(BAUD)
            if "return_delay" in unit.registers.by_name:
                unit.registers.put("return_delay", 0)
        self.kit.pace(BAUD)
        self.end = PipeEnd(self._receive)
        super().__init__(**options)

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.end})

    def console(self) -> Console:
        assert isinstance(self.kit, Bioloid)
        return self.console_of(self.kit, self.end, commands(self.kit, self.bus_clock.now))

    def register(self, unit: int, name: str) -> int:
        """A register of the fake, by the fake's own name."""
        return self.kit[unit].registers.get(name)

    def place(self, unit: int) -> float:
        """Where the horn of a servo is: rad, from the middle of its range."""
        self.kit.tick(self.bus_clock.now())
        match self.kit[unit]:
            case XSeries() as found:
                return (found.motor.position - STEPS / 2) * _X_STEP
            case FeetechServo() as found:
                middle, turn = (2048, math.tau) if found.steps == STEPS else (511.5, math.radians(300))
                return (found.motor.angle - middle) / found.steps * turn
            case Shaft() as found:
                return (found.position - found.family.middle) / found.family.counts * math.tau
            case Ax12() as found:
                return found.position * _AX_STEP - math.radians(150)
        raise AssertionError(f"unit {unit} has no horn")

    def pace(self, unit: int) -> float:
        """How fast the horn of a servo turns: rad/s."""
        self.kit.tick(self.bus_clock.now())
        match self.kit[unit]:
            case XSeries() as found:
                return found.motor.speed * _X_STEP
            case FeetechServo() as found:
                return found.motor.speed / found.steps * (math.tau if found.steps == STEPS else math.radians(300))
            case Shaft() as found:
                return found.speed / found.family.counts * math.tau
            case Ax12() as found:
                return found.speed * _AX_STEP
        raise AssertionError(f"unit {unit} has no horn")

    def _receive(self, data: bytes, at: float) -> None:
        self.kit.tick(at)
        for answer in self.kit.feed(data, at):
            self.end.send(answer.data, answer.at)


def lab() -> Lab:
    """For the contract of all platforms."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    numbers = [unit.id for unit in lab.kit]
    return tuple(map(lab.pace, numbers)), tuple(map(lab.place, numbers))


def _found(lab: Lab) -> tuple[DeviceInfo, ...]:
    """A worker that takes the place of another looks only at the numbers."""
    return tuple(DeviceInfo(unit.id, 12, "AX-12", "AX", 24, 1, "joint") for unit in lab.kit)


_MOTIONS = "AX-12:1,XL330-M288:3,XL330-M288:4"
_WHEEL = 'motor1.mode = "wheel";'
_CURRENT = 'motor3.mode = "current";'
_PWM = 'motor3.mode = "pwm";'
_EXTENDED = 'motor3.mode = "extended"; motor3.speed = 0.5;'



def _turn_wheel(lab: Lab) -> None:
    """Another master turns a wheel of the X series."""
    lab.kit[3].registers.put("torque_enable", 1)
    lab.kit[3].registers.put("goal_velocity", 100)


MOTION = Motion(
    make=lambda: Lab.ready(_MOTIONS),
    look=_body,
    slot="chain",
    unplug=lambda lab: lab.end.unplug(),
    plug=lambda lab: lab.end.replug(),
    # A worker that takes the place of another scans in both protocols.
    standstill=0.3,
    grain=0.05,
    found=_found,
    kinds={
        "AX joint": Kind("motor1.val = 100deg;", 0.3, prepare="motor1.speed = 0.5;"),
        "AX wheel": Kind("motor1.speed = 1;", 0.5, prepare=_WHEEL),
        "X joint": Kind("motor3.val = 100deg;", 0.3, prepare="motor3.speed = 0.5;"),
        "X wheel": Kind("motor3.speed = 1;", 0.5, prepare='motor3.mode = "velocity";'),
        "X current": Kind("motor3.goalCurrent = 0.3;", 0.5, prepare=_CURRENT),
        "X pwm": Kind("motor3.goalPwm = 0.2;", 0.5, prepare=_PWM),
        "X extended": Kind("motor3.val = 500deg;", 0.3, prepare=_EXTENDED),
        "switch to current": Kind(f"{_CURRENT} motor3.goalCurrent = 0.3;", 0.5, lead=0.01),
        "switch to current just done": Kind(f"{_CURRENT} motor3.goalCurrent = 0.3;", 0.5, lead=0.04),
    },
    others={"X wheel": OtherMaster(_turn_wheel, 0.5, prepare='motor3.mode = "velocity";')},
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "Chain": BUS,
    "robot": TAUGHT,
    "AX-12A": AX,
    "MX-28": SERVO | {
        "rad": ANGLES,
        "rad/s^2": "acceleration",
        "N m": "torque torqueLimit maxTorque punch",
        "1": NUMBERS + "led lock alarmLed statusReturnLevel pGain iGain dGain",
    },
    "XL330-M288": SERVO | {
        "rad": ANGLES + "homingOffset",
        "rad/s^2": "acceleration",
        "A": "current goalCurrent",
        "N m": "torque torqueLimit maxTorque",
        "1": NUMBERS + "led statusReturnLevel goalPwm pGain iGain dGain velocityPGain velocityIGain"
        " feedForward1 feedForward2",
    },
}  # fmt: skip
