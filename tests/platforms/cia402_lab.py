"""Drives after CiA 402 in simulated time: see ``lab``."""

from __future__ import annotations

import math
from typing import Any, Final

from lab import SpeakingLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import BUS, GAINS, TAUGHT, UnitTable

from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.records import Records
from urbihw_fakes.cia402.node import Drive
from urbihw_fakes.cia402.start import words_of
from urbihw_fakes.console import Console


class Lab(SpeakingLab):
    """A drive with the number 5 on a pipe."""

    platform = "cia402"
    url = "can://pipe/robot"

    def __init__(self, drive: Drive | None = None, **options: Any) -> None:
        self.drive = drive if drive is not None else Drive(5)
        self.device = CanDevice(self.drive, Records())
        super().__init__(**options)

    def console(self) -> Console:
        return self.console_of(self.device, self.end, words_of(self.drive))


class _Living(BusSimClock):
    """A clock on which the drive goes on living while somebody sleeps."""

    def __init__(self, lab: Lab) -> None:
        super().__init__(lab.bus_clock.now())
        self._lab = lab

    def sleep_until(self, when: float) -> None:
        """Jump there in ticks."""
        while self.now() < when:
            super().sleep_until(min(when, self.now() + self._lab.tick))
            answers = self._lab.device.tick(self.now())
            if self._lab.end.plugged:
                self._lab._answer(answers)


class LivingLab(Lab):
    """A lab whose drive also lives while a worker waits for it, as one does that takes the place of another."""

    def context(self) -> Context:
        """See ``RobotLab``; the drive also lives while the worker waits for it."""
        if not isinstance(self.bus_clock, _Living):
            self.bus_clock = _Living(self)
        return super().context()


def lab() -> Lab:
    """A drive that is open, for the contract of all robots."""
    return Lab.ready()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    machine = lab.drive.machine
    turn = math.tau / machine.increments
    return (machine.speed * turn,), (machine.position * turn,)



def _drive_from_elsewhere(lab: Lab) -> None:
    """Another master of the bus switches the drive on and turns it."""
    machine = lab.drive.machine
    machine.mode, machine.target_speed = 3, machine.increments
    for word in (6, 7, 15):
        machine.control(word)


MOTION = Motion(
    make=LivingLab.ready,
    look=_body,
    slot="cia402",
    unplug=lambda lab: lab.end.unplug(),
    plug=lambda lab: lab.end.replug(),
    revive="drive5.load = 1",
    standstill=0.15,
    kinds={
        "speed": Kind("drive5.speed = 6;", 5.0),
        "goal": Kind("drive5.val = drive5.val + 60;", 5.0),
        "switch of mode": Kind("drive5.val = drive5.val + 60; drive5.speed = 6;", 5.0, lead=0.01),
        "trajectory": Kind("drive5.val = drive5.val smooth:1s | drive5.val = 0 sin:2s ampli:2,", 2.0,
                           lead=4.3, live=True),
        "trajectory of speeds": Kind("drive5.speed = 0 sin:2s ampli:6,", 3.0, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 3.0, lead=1.5, live=True,
            prepare="if (!Global.hasLocalSlot(\"trip\")) var Global.trip = Event.new|;"
            " at (trip?) loop { drive5.speed = 6; sleep(200ms); drive5.speed = -6; sleep(400ms) };",
        ),
        "remote": Kind("drive5.speed = 6", 5.0, remote=True),
        "remote goal": Kind("drive5.val = 60", 5.0, remote=True),
    },
    others={
        "drive that is off": OtherMaster(_drive_from_elsewhere, 1.0, prepare="drive5.load = 0;"),
        "drive that is on": OtherMaster(_drive_from_elsewhere, 5.0),
    },
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "Cia402": BUS,
    "robot": TAUGHT,
    "ServoDrive": {
        "rad": "val angle requested applied positionCoeff", "rad/s": "speed velocityCoeff", "turn": "turn",
        "N m": "torque", "1": GAINS + "node increments load",
    },
}  # fmt: skip
