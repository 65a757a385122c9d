"""An SO-101 arm in simulated time, with or without a leader: see ``lab``."""

from __future__ import annotations

import math
from typing import Any, Final

from lab import START, HandWorker, RobotLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import ANGLES, BUS, NUMBERS, SERVO, TAUGHT, Units, UnitTable

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos.device import DeviceInfo
from urbihw_fakes.console import Console
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.feetech.console import commands
from urbihw_fakes.so101 import JOINTS, So101

BAUD = 1_000_000
STEP = math.tau / 4096
LEADER = f"pipe://leader?baud={BAUD}"


class Lab(RobotLab):
    """A follower on a pipe; ``leader`` is the other arm."""

    platform = "so101"
    url = f"pipe://robot?baud={BAUD}"

    def __init__(self, kit: ServoBus | None = None, leader: So101 | None = None, **options: Any) -> None:
        self.bus = kit if kit is not None else So101(calibrated=True)
        self.leader = leader
        self.bus.pace(BAUD)
        self.end = PipeEnd(lambda data, at: _receive(self.bus, self.end, data, at))
        self.workers: list[HandWorker] = []
        if leader is not None:
            leader.pace(BAUD)
            self.leader_end = PipeEnd(lambda data, at: _receive(leader, self.leader_end, data, at))
            options["leader"] = LEADER
        super().__init__(**options)

    def _start(self, *arguments: Any, **options: Any) -> HandWorker:
        self.workers.append(super()._start(*arguments, **options))
        # The worker of the follower is the one that the tests of all robots look at.
        self.worker = self.workers[0]
        return self.workers[-1]

    def step(self) -> None:
        """One tick of both buses, and the kernel up to the same time."""
        scheduler = self.kernel.scheduler
        scheduler.run_simulated(self.clock.now() + self.tick)
        while self.bus_clock.now() - START < self.clock.now():
            for worker in self.workers:
                worker.step()
        scheduler.run_simulated(self.clock.now())

    @property
    def kit(self) -> So101:
        """The follower."""
        assert isinstance(self.bus, So101)
        return self.bus

    def context(self) -> Context:
        ends = {"robot": self.end}
        if self.leader is not None:
            ends["leader"] = self.leader_end
        return Context(self.bus_clock, ends)

    def console(self) -> Console:
        names = {name: joint.id for name, joint in JOINTS.items()}
        return self.console_of(self.kit, self.end, commands(self.kit, self.bus_clock.now, names))

    def bend(self, joint: str) -> float:
        """How far a joint of the follower is from its middle: rad."""
        self.kit.tick(self.bus_clock.now())
        return self.kit.bend(joint) * STEP

    def register(self, unit: int, name: str) -> int:
        """A register of the fake, by the fake's own name."""
        return self.kit[unit].registers.get(name)


def _receive(kit: ServoBus, end: PipeEnd, data: bytes, at: float) -> None:
    kit.tick(at)
    for answer in kit.feed(data, at):
        end.send(answer.data, answer.at)


def lab() -> Lab:
    """For the contract of all platforms."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    lab.kit.tick(lab.bus_clock.now())
    motors = [lab.kit.joint(name).motor for name in JOINTS]
    return tuple(motor.speed * STEP for motor in motors), tuple(motor.angle * STEP for motor in motors)


def _found(lab: Lab) -> tuple[DeviceInfo, ...]:
    """A worker that takes the place of another looks only at the numbers."""
    return tuple(DeviceInfo(unit.id, 777, "STS3215", "STS3215", 310, 3, "position") for unit in lab.kit)


_WHEEL = 'wrist_roll.mode = "wheel";'
_PWM = 'wrist_roll.mode = "pwm";'



def _push_joint(lab: Lab) -> None:
    """Another master sends a joint to the other end of its range."""
    number = JOINTS["shoulder_pan"].id
    goal = 2600 if lab.register(number, "goal_position") < 2048 else 1500
    for address, data in ((40, b"\1"), (46, (300).to_bytes(2, "little")), (42, goal.to_bytes(2, "little"))):
        body = bytes((number, len(data) + 3, 3, address)) + data
        lab.kit.feed(b"\xff\xff" + body + bytes((~sum(body) & 0xFF,)), lab.bus_clock.now())


MOTION = Motion(
    make=Lab.ready,
    look=_body,
    slot="so101",
    unplug=lambda lab: lab.end.unplug(),
    plug=lambda lab: lab.end.replug(),
    standstill=0.15,
    grain=0.05,
    found=_found,
    kinds={
        "joint": Kind("shoulder_pan.val = 80deg;", 0.3, prepare="shoulder_pan.speed = 0.5;"),
        "trajectory": Kind("shoulder_lift.val = 0 sin:1s ampli:20deg,", 1.0, lead=2.3, live=True),
        "wheel": Kind("wrist_roll.speed = 1;", 0.5, prepare=_WHEEL),
        "pwm": Kind("wrist_roll.goalPwm = 0.3;", 0.5, prepare=_PWM),
        "switch of mode": Kind(f"{_WHEEL} wrist_roll.speed = 1;", 0.5, lead=0.01),
        "remote": Kind("motor1.val = 1.85", 0.3, prepare="motor1.speed = 0.4;", remote=True),
    },
    others={"joint": OtherMaster(_push_joint, 0.3)},
)


# Feetech tells torques as a share of the stall torque.
_STS: Final[Units] = SERVO | {
    "rad": ANGLES + "homingOffset",
    "rad/s^2": "acceleration",
    "A": "current",
    "1": NUMBERS + "alarmLed lock pGain iGain dGain velocityPGain velocityIGain goalPwm"
    " torque torqueLimit maxTorque punch",
}
UNITS: Final[UnitTable] = {"robot": TAUGHT, "SO101": BUS, "ArmServo": _STS, "GripperServo": _STS}
