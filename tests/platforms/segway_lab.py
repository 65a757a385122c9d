"""A Segway RMP in simulated time: see ``lab``.  The base is on its USB link, or, in ``CanLab``, on a CAN bus."""

from __future__ import annotations

from typing import Any, Final

from lab import SpeakingLab
from motions import Kind, Motion, Numbers, OtherMaster
from paths import on_map
from slot_units import BUS, MOBILE, ODOMETRY, PLANNER, UnitTable

from urbihw_fakes.can.device import CanDevice, Codec
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.can.records import Records
from urbihw_fakes.console import Console
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway.console import commands
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.usb import UsbLink

BAUD = 460_800


class Lab(SpeakingLab):
    """A base on a pipe."""

    platform = "segway"
    url = f"pipe://robot?baud={BAUD}"
    tick = 0.02

    def __init__(self, base: SegwayRmp | None = None, **options: Any) -> None:
        self.base = base if base is not None else SegwayRmp()
        self.device = CanDevice(self.base, self.codec())
        super().__init__(**options)

    def codec(self) -> Codec:
        """What stands between the base and the pipe."""
        return UsbLink()

    def console(self) -> Console:
        return self.console_of(self.device, self.end, commands(self.base))


class CanLab(Lab):
    """A base on a bus."""

    url = "can://pipe/robot"

    def codec(self) -> Codec:
        return Records()


def lab() -> Lab:
    """A base that is open, for the contract of all robots."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    body = lab.base.body
    return (body.speed, body.turn), (body.forward, body.yaw)


_PATH = "segway.moveTo([5, 1, 90deg]);"


def _drive_from_elsewhere(lab: Lab) -> None:
    """Another program on the bus sends one command; ours, with zeros, follow in the next ticks."""
    half = round(f.FULL_VELOCITY / 2)
    lab.base.receive_frame(CanFrame(f.COMMAND, half.to_bytes(2, "big") + bytes(6)), lab.bus_clock.now())


MOTION = Motion(
    make=lab,
    look=_body,
    slot="segway",
    unplug=lambda lab: lab.end.unplug(),
    plug=lambda lab: lab.end.replug(),
    standstill=0.35,
    kinds={
        "speed": Kind("rmp.forwardSpeed = 0.5;", 0.4),
        "turn": Kind("robot.body.yaw.speed = 0.5;", 0.4),
        "trajectory": Kind("rmp.forwardSpeed = 0 sin:2s ampli:0.3,", 0.2, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 0.2, lead=1.5, live=True,
            prepare="if (!Global.hasLocalSlot(\"trip\")) var Global.trip = Event.new|;"
            " at (trip?) loop { rmp.forwardSpeed = 0.3; sleep(200ms); rmp.forwardSpeed = -0.3; sleep(400ms) };",
        ),
        "switch of mode": Kind(
            'rmp.mode = "tractor"; rmp.forwardSpeed = 0.5;', 0.4, lead=0.02, again="rmp.forwardSpeed = 0.5;"
        ),
        "go": Kind("robot.go(2);", 0.15, error=True),
        "turn by an angle": Kind("robot.turn(20);", 0.3, error=True),
        "planner": Kind(_PATH, 0.2, lead=3.0, ready=on_map("segway")),
        "planner that plans": Kind(_PATH, 0.2, lead=0.0, ready=on_map("segway")),
        "remote": Kind("rmp.forwardSpeed = 0.5", 0.4, remote=True),
    },
    others={"second program on the bus": OtherMaster(_drive_from_elsewhere, 0.02)},
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "Segway": BUS | {"1": "epoch stops build"},
    "RMP": {  # chapter "Segway RMP": a coefficient is the unit of its slot for one count
        "m/s": "forwardSpeed leftSpeed rightSpeed forwardSpeedCoeff leftSpeedCoeff rightSpeedCoeff velocityCoeff"
        " requested applied",
        "rad/s": "yawSpeed yawSpeedCoeff turnCoeff pitchRate rollRate",
        "m": "forward left right forwardCoeff leftCoeff rightCoeff",
        "rad": "yaw yawCoeff pitch roll",
        "N m": "leftTorque rightTorque torqueCoeff",
        "V": "voltage boxVoltage lowVoltage",
        "ratio": "remain speedScale accelerationScale turnScale currentLimit",
        "s": "period",
    },
    "SegwayOdometry": ODOMETRY,
    "SegwayPlanner": PLANNER,
    "robot": MOBILE,
}  # fmt: skip
